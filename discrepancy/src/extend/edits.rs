//! Edits of a text at the spans that its parser gives; everything between them keeps its bytes.

use super::{Addition, key_comment, written};
use plant::effects::declared::Declared;
use plant::effects::sheet::Sheet;
use std::ops::Range;
use toml_edit::{Document, Item, Table, TableLike};

/// What is to be done to a text.
pub(super) struct Edits<'t> {
    text: &'t str,
    line_end: &'static str,
    edits: Vec<(Range<usize>, String)>,
}

impl<'t> Edits<'t> {
    /// None yet.
    pub(super) fn new(text: &'t str) -> Self {
        let windows = text.split_once('\n').is_some_and(|(first, _)| first.ends_with('\r'));
        Edits { text, line_end: if windows { "\r\n" } else { "\n" }, edits: Vec::new() }
    }

    /// Other text in place of a span's.
    pub(super) fn replace(&mut self, span: Range<usize>, by: String) {
        self.edits.push((span, by));
    }

    /// A comment line above the line of a place, with its indentation.
    pub(super) fn comment_above(&mut self, place: usize, comment: &str) {
        let start = self.line_start(place);
        let indent: String =
            self.text[start..place].chars().take_while(|letter| letter.is_whitespace()).collect();
        self.edits.push((start..start, format!("{indent}# {comment}{}", self.line_end)));
    }

    /// The text with all edits done.
    pub(super) fn applied(mut self) -> String {
        // Stable: edits at one place keep their order.
        self.edits.sort_by_key(|(span, _)| (span.start, span.end));
        let mut result = String::with_capacity(self.text.len() + 1024);
        let mut copied = 0;
        for (span, by) in self.edits {
            result.push_str(&self.text[copied..span.start]);
            result.push_str(&by);
            copied = span.end;
        }
        result.push_str(&self.text[copied..]);
        result
    }

    fn line_start(&self, place: usize) -> usize {
        let start = self.text[..place].rfind('\n').map_or(0, |at| at + 1);
        // A byte order mark stays the first of the file.
        if start == 0 && self.text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { start }
    }

    /// An effect with its numbers: changed where it exists, else a new table.
    pub(super) fn switch_on(
        &mut self,
        document: &Document<&str>,
        sheet: &Sheet,
        addition: &Addition,
        from: &str,
    ) {
        let mut path = vec!["effects", sheet.name];
        path.extend(addition.place.split('.'));
        let mut item = document.as_item();
        let mut depth = 0;
        while let Some(inner) = path.get(depth).and_then(|name| item.as_table_like()?.get(name)) {
            item = inner;
            depth += 1;
        }
        match item.as_table_like() {
            Some(table) if depth == path.len() => self.change(item, table, sheet, addition, from),
            _ if item.is_inline_table() => self.add_inline(item, &path[depth..], sheet, addition, from),
            _ => self.append(sheet, addition, from),
        }
    }

    /// Numbers of an effect that is on.
    fn change(&mut self, item: &Item, table: &dyn TableLike, sheet: &Sheet, addition: &Addition, from: &str) {
        for (name, value, standard_error) in &addition.numbers {
            let Some(key) = sheet.keys.iter().find(|key| key.name == name) else { continue };
            let comment = key_comment(key, *value, *standard_error, from);
            let old = table.get(name).and_then(Item::span);
            if let (Some(span), Some(place)) = (old, table.key(name).and_then(toml_edit::Key::span)) {
                self.comment_above(place.start, &format!("was {}; {comment}", &self.text[span.clone()]));
                self.replace(span, written(*value));
                continue;
            }
            let pair = format!("{name} = {}", written(*value));
            let Some(span) = item.span() else { continue };
            if item.is_inline_table() {
                self.comment_above(span.start, &format!("{name}: {comment}"));
                self.add_to_braces(span, !table.is_empty(), &pair);
                continue;
            }
            let first = table.iter().next().and_then(|(first, _)| table.key(first)?.span());
            // Beside a key in the words of that key's line, which may be dotted; else right below the header.
            let (at, before) = match first {
                Some(first) => {
                    let start = self.line_start(first.start);
                    (start, self.text[start..first.start].to_owned())
                }
                None => {
                    let end = self.text[span.end..].find('\n').map(|length| span.end + length + 1);
                    if end.is_none() {
                        self.edits.push((self.text.len()..self.text.len(), self.line_end.to_owned()));
                    }
                    (end.unwrap_or(self.text.len()), String::new())
                }
            };
            let indent: String = before.chars().take_while(|letter| letter.is_whitespace()).collect();
            let end = self.line_end;
            self.edits.push((at..at, format!("{indent}# {comment}{end}{before}{pair}{end}")));
        }
    }

    /// What is missing of the path, inside the braces of a table in one line.
    fn add_inline(&mut self, item: &Item, missing: &[&str], sheet: &Sheet, addition: &Addition, from: &str) {
        let (Some(span), Some(table)) = (item.span(), item.as_table_like()) else { return };
        let mut pairs = Vec::new();
        for (name, value, standard_error) in &addition.numbers {
            let Some(key) = sheet.keys.iter().find(|key| key.name == name) else { continue };
            let comment = key_comment(key, *value, *standard_error, from);
            self.comment_above(span.start, &format!("{} {name}: {comment}", sheet.name));
            pairs.push(format!("{name} = {}", written(*value)));
        }
        let Some((first, rest)) = missing.split_first() else { return };
        let innermost = format!("{{ {} }}", pairs.join(", "));
        let nested = rest.iter().rev().fold(innermost, |inner, name| format!("{{ {name} = {inner} }}"));
        let nested = format!("{first} = {nested}");
        self.add_to_braces(span, !table.is_empty(), &nested);
    }

    fn add_to_braces(&mut self, span: Range<usize>, has_others: bool, pair: &str) {
        let inside = self.text[span.start..span.end - 1].trim_end();
        let at = span.start + inside.len();
        let comma = if has_others && !inside.ends_with(',') { "," } else { "" };
        self.edits.push((at..at, format!("{comma} {pair}")));
    }

    /// Other numbers for a term that the file has; `false` where it has none of this name and place.
    pub(super) fn renew_term(&mut self, document: &Document<&str>, term: &Declared, comment: &str) -> bool {
        let terms = document.get("terms").and_then(Item::as_array_of_tables);
        let place = term.place();
        let is_it = |table: &&Table| {
            let text = |key: &str| table.get(key).and_then(Item::as_str);
            text("name") == Some(term.name.as_str()) && text("place") == Some(place.as_str())
        };
        let Some(table) = terms.and_then(|terms| terms.iter().find(is_it)) else { return false };
        for number in term.numbers() {
            let parameter = table.get("parameters").and_then(|all| all.as_table_like()?.get(&number.name));
            let value = parameter.and_then(|parameter| parameter.as_table_like()?.get("value")?.span());
            value.into_iter().for_each(|span| self.replace(span, written(number.value)));
        }
        if let Some(name) = table.get("name").and_then(Item::span) {
            self.comment_above(name.start, comment);
        }
        true
    }

    /// Text at the end of the file, with the file's line ends.
    pub(super) fn append_text(&mut self, text: &str) {
        let end = self.line_end;
        let first = if self.text.is_empty() || self.text.ends_with('\n') { "" } else { end };
        self.edits.push((self.text.len()..self.text.len(), format!("{first}{}", text.replace('\n', end))));
    }

    /// A table at the end of the file.
    fn append(&mut self, sheet: &Sheet, addition: &Addition, from: &str) {
        let end = self.line_end;
        let mut added = String::new();
        if !self.text.is_empty() && !self.text.ends_with('\n') {
            added.push_str(end);
        }
        added.push_str(&format!(
            "{end}# {}: {}{end}# Found{from}.{end}[effects.{}.{}]{end}",
            sheet.name, sheet.law, sheet.name, addition.place
        ));
        for key in sheet.keys {
            let number = addition.numbers.iter().find(|(name, ..)| name == key.name);
            if let Some((name, value, standard_error)) = number {
                let comment = key_comment(key, *value, *standard_error, "");
                added.push_str(&format!("# {comment}{end}{name} = {}{end}", written(*value)));
            }
        }
        self.edits.push((self.text.len()..self.text.len(), added));
    }
}
