//! Limits and twins as tables in Markdown, inserted into a page between two marks.

use crate::classes::{Classes, TWIN_COSINE};
use crate::folder::{FolderError, read, write_whole};
use crate::limits::{Limit, Limits};
use model_fit::stats::median;
use plant::effects::SHEETS;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// The table of limits in Markdown: of each effect at the places that are not the load's; the file has all.
pub fn limit_table(limits: &Limits) -> String {
    let mut table = String::from(
        "| effect | amplitude | limit | unit | drawn | signature of the most drawn, over the limit's | |\n|---|---|---|---|---|---|---|\n",
    );
    for sheet in SHEETS {
        let key = &sheet.keys[0];
        let drawn =
            format!("{} to {}{}", key.drawn[0], key.drawn[1], if key.signed { ", either sign" } else { "" });
        let of_effect = limits.limits.iter().filter(|limit| limit.effect == sheet.name);
        for limit in of_effect.filter(|limit| !limit.place.starts_with("load")) {
            let _ = writeln!(
                table,
                "| {} {} | {} | {} | {} | {drawn} | {} | {} |",
                limit.effect,
                limit.place,
                key.name,
                limit_cell(limit),
                limit.unit,
                digits(limit.strength),
                if limit.excited { "" } else { "not excited" }
            );
        }
    }
    table
}

fn limit_cell(limit: &Limit) -> String {
    let neutral = || plant::effects::sheet(&limit.effect)?.keys[0].neutral;
    match (limit.limit_value, neutral()) {
        (Some(value), Some(neutral)) if neutral.is_finite() && neutral != 0.0 => {
            let sign = if value > neutral { '+' } else { '-' };
            format!("{neutral} {sign} {}", digits((value - neutral).abs()))
        }
        (Some(value), _) => digits(value),
        (None, _) if limit.excited => "always seen".to_owned(),
        (None, _) => "none".to_owned(),
    }
}

fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let places = (2 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// The table of twins in Markdown: for each effect its twins, in how many of its draws, and the largest cosine of all.
pub fn twin_table(classes: &Classes) -> String {
    #[derive(Default)]
    struct Row<'a> {
        draws: usize,
        alone: usize,
        largest: Vec<f64>,
        twins: BTreeMap<&'a str, usize>,
    }
    let mut rows: BTreeMap<&str, Row<'_>> = BTreeMap::new();
    for hidden in classes.draws.iter().filter(|draw| draw.hidden.len() == 1).flat_map(|draw| &draw.hidden) {
        let row = rows.entry(&hidden.effect).or_default();
        row.draws += 1;
        let others = || hidden.members.iter().filter(|member| member.effect != hidden.effect);
        row.largest.push(others().map(|member| member.cosine).fold(0.0, f64::max));
        let mut names: Vec<&str> = others()
            .filter(|member| member.cosine > TWIN_COSINE)
            .map(|member| member.effect.as_str())
            .collect();
        names.sort_unstable();
        names.dedup();
        row.alone += usize::from(names.iter().all(|name| name.starts_with("parameter:")));
        for name in names {
            *row.twins.entry(name).or_default() += 1;
        }
    }
    let mut table = String::from(
        "| effect | draws | alone in its class | median of the largest cosine | twins, in so many draws |\n|---|---|---|---|---|\n",
    );
    for sheet in SHEETS {
        let Some(row) = rows.get_mut(sheet.name) else { continue };
        let median = median(&mut row.largest).expect("a row has a draw");
        let twins: Vec<_> = row.twins.iter().map(|(name, count)| format!("{name} {count}")).collect();
        let _ = writeln!(
            table,
            "| {} | {} | {} | {median:.3} | {} |",
            sheet.name,
            row.draws,
            row.alone,
            twins.join(", ")
        );
    }
    table
}

/// Replaces the text between the two marks `name` of a page.
///
/// # Errors
/// [`FolderError`] when the page lacks a mark, or cannot be read or written.
pub fn put(page: &Path, name: &str, text: &str) -> Result<(), FolderError> {
    let old = read(page)?;
    let [begin, end] = ["begin", "end"].map(|mark| format!("<!-- {name}: {mark} -->\n"));
    let parts = old.split_once(&begin).and_then(|(before, rest)| Some((before, rest.split_once(&end)?.1)));
    let Some((before, after)) = parts else {
        let what = format!("the marks '{}' and '{}' do not stand there once each", begin.trim(), end.trim());
        return Err(FolderError::content(page, what));
    };
    write_whole(page, format!("{before}{begin}\n{}\n\n{end}{after}", text.trim()).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_put_between_its_marks_and_nowhere_else() {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("page.md");
        std::fs::write(&page, "a\n<!-- x: begin -->\nold\n<!-- x: end -->\nb\n").unwrap();
        put(&page, "x", "new\n").unwrap();
        put(&page, "x", "newer\n").unwrap();
        let text = std::fs::read_to_string(&page).unwrap();
        assert_eq!(text, "a\n<!-- x: begin -->\n\nnewer\n\n<!-- x: end -->\nb\n");
        assert!(put(&page, "y", "z").unwrap_err().to_string().contains("y: begin"));
    }

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [
            (0.012_345, "0.0123"),
            (1.0, "1"),
            (12.34, "12.3"),
            (1234.5, "1234"),
            (0.1, "0.1"),
            (0.0, "0"),
            (120.0, "120"),
        ] {
            assert_eq!(digits(value), text);
        }
    }
}
