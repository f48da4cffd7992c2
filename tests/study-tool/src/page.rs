//! The score as one HTML page that works offline and without scripts.
//!
//! Well-formed XML, with the stylesheet of all pages of airbench (light, dark, print). The shade of a cell of the confusion
//! matrix is its share of the row; the number and the frame of right cells show the same without colour.

use crate::draws::Shape;
use crate::interval::Rate;
use crate::program::Identity;
use crate::score::tables::{ConfusionRow, OTHER_COLUMNS, QuantileSummary, Split};
use crate::score::{Case, Score};
use pagekit::page::{document, escaped};
use plant::effects::SHEETS;
use std::fmt::Write;

mod leave_out;

pub fn page(score: &Score) -> String {
    let title = format!("Study of {}: {}", score.program.name, score.label);
    let mut sections = vec![
        ("headline", "What the targets are about", headline(score)),
        ("confusion", "Hidden against named", confusion(score)),
    ];
    match &score.leave_out {
        Some(tables) => sections.extend(leave_out::sections(score, tables)),
        None => sections.extend([
            ("nothing", "Nothing hidden", nothing_hidden(score)),
            ("splits", "Over amplitude and difficulties", splits("part", &score.tables.splits)),
            ("effects", "Effect by effect", splits("effect", &score.tables.effects)),
        ]),
    }
    sections.extend([
        ("numbers", "Numbers, gap, time", numbers(score)),
        ("errors", "Without a good report", errors(score)),
        ("cases", "All cases", cases(score)),
    ]);
    let contents: String = sections
        .iter()
        .map(|(name, title, _)| format!("<li><a href=\"#{name}\">{title}</a></li>\n"))
        .collect();
    let body: String = sections
        .iter()
        .map(|(name, title, markup)| {
            format!("<section>\n<h2 id=\"{name}\">{title}</h2>\n{markup}</section>\n")
        })
        .collect();
    document(
        &title,
        &format!(
            "<header>\n<h1>{}</h1>\n<p class=\"lead\">{}</p>\n</header>\n<nav aria-label=\"Contents\">\n\
             <ul class=\"contents\">\n{contents}</ul>\n</nav>\n<main>\n{body}</main>\n\
             <footer class=\"page-foot\">\n<p>Schema version {}. The same for programs is in the \
             score's JSON file beside this page.</p>\n</footer>\n",
            escaped(&title),
            escaped(&lead(score)),
            score.schema_version
        ),
    )
}

fn lead(score: &Score) -> String {
    let Shape { each, nulls, parameters, pairs, triples, noise_factor, weaker_factor, .. } = score.shape;
    let Identity { name, crc32, arguments, .. } = &score.program;
    let classes = match score.without_classes {
        0 => String::new(),
        count => format!(
            " The classes of {count} draws are not known: there an effect counts as alone in its class."
        ),
    };
    let left_out = if score.leave_out.is_some() {
        " The hidden effect of each case, and its class, were left out of the program's catalogue; only draws of one effect."
    } else {
        ""
    };
    format!(
        "{} cases on 20 s records: {each} draws of each of the {} effects, {nulls} with nothing hidden, \
         {parameters} of each wrong parameter, {pairs} pairs, {triples} triples; seed {}, noise times {noise_factor}, \
         amplitudes over {weaker_factor}. Program {name} with CRC-32 {crc32:08x} {}. Intervals: Wilson, 95 %; \
         'at most' is the exact one-sided bound, 95 %.{left_out}{classes}",
        score.cases.len(),
        SHEETS.len(),
        score.seed,
        arguments.join(" ")
    )
}

/// A table of heads and rows, all of them markup; the first cell of a row is a head.
fn table(heads: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut text = String::from("<div class=\"scroll\" tabindex=\"0\">\n<table>\n<thead><tr>");
    for head in heads {
        let _ = write!(text, "<th scope=\"col\">{head}</th>");
    }
    text.push_str("</tr></thead>\n<tbody>\n");
    for row in rows {
        text.push_str("<tr>");
        for (at, cell) in row.iter().enumerate() {
            let _ = if at == 0 {
                write!(text, "<th scope=\"row\">{cell}</th>")
            } else {
                write!(text, "<td>{cell}</td>")
            };
        }
        text.push_str("</tr>\n");
    }
    text.push_str("</tbody>\n</table>\n</div>\n");
    text
}

fn percent(share: f64) -> String {
    format!("{:.1}", share * 100.0)
}

/// `19 of 20, 95.0 % (76.4 to 99.1)`.
fn reported(rate: &Rate) -> String {
    let Some(share) = rate.share else { return "<span class=\"none\">none</span>".to_owned() };
    let [low, high] = rate.interval.map(percent);
    format!(
        "{} of {}, {} % <span class=\"soft\">({low} to {high})</span>",
        rate.count,
        rate.of,
        percent(share)
    )
}

fn headline(score: &Score) -> String {
    let row = |line: &crate::score::tables::Line| {
        let most = format!("{} %", percent(line.rate.at_most));
        vec![escaped(&line.name), reported(&line.rate), most, escaped(line.wanted)]
    };
    table(&["what", "rate", "at most", "wanted"], score.tables.headline.iter().map(row))
}

fn splits(head: &str, splits: &[Split]) -> String {
    let row = |split: &Split| {
        let rates = [split.class_right, split.top, split.alone, split.where_right];
        std::iter::once(escaped(&split.name)).chain(rates.iter().map(reported)).collect()
    };
    let heads =
        [head, "class among the names", "first name right", "right alone, where alone in class", "where"];
    table(&heads, splits.iter().map(row))
}

fn confusion(score: &Score) -> String {
    const TIGHT: &str = "style=\"padding:.1rem .15rem;text-align:center\"";
    let numbered = (1..).map(|number: usize| number.to_string()).zip(SHEETS.iter().map(|sheet| sheet.name));
    let beside = OTHER_COLUMNS.iter().map(|name| ((*name).to_owned(), *name));
    let columns: Vec<(String, &str)> = numbered.chain(beside).collect();
    let mut text = String::from(
        "<p>One effect hidden: rows are the truth, columns the first name, numbered as the rows. A framed number is of the true \
         effect's class in those records; n/m: n of m at the right place.</p>\n<div class=\"scroll\" tabindex=\"0\">\n\
         <table style=\"font-size:.78rem\">\n<thead><tr><th scope=\"col\">hidden</th>",
    );
    for (head, name) in &columns {
        let _ = write!(text, "<th scope=\"col\" {TIGHT} title=\"{name}\">{head}</th>");
    }
    text.push_str("</tr></thead>\n<tbody>\n");
    for (at, row) in score.tables.confusion.iter().enumerate() {
        let truth = escaped(&row.truth);
        let _ = write!(
            text,
            "<tr><th scope=\"row\" style=\"padding:.1rem .4rem;white-space:nowrap\">{} {truth}</th>",
            at + 1
        );
        for (_, name) in &columns {
            let _ = write!(text, "<td {TIGHT}>{}</td>", cell(row, name));
        }
        text.push_str("</tr>\n");
    }
    text.push_str("</tbody>\n</table>\n</div>\n");
    text
}

/// A cell of the confusion matrix: the count, framed when right, shaded by its share of the row.
fn cell(row: &ConfusionRow, name: &str) -> String {
    let Some([all, right, at_place]) = row.called.get(name) else {
        return "<span class=\"soft\">·</span>".to_owned();
    };
    let share = all * 100 / row.of.max(1);
    let (shade, frame) = if right > &0 { ("--s2", "2px solid var(--ink)") } else { ("--s1", "0") };
    let text = if right == &0 || at_place == all { all.to_string() } else { format!("{at_place}/{all}") };
    let weight = if right == all { "bold" } else { "normal" };
    format!(
        "<span style=\"display:block;min-width:1.4rem;text-align:center;padding:0 .2rem;font-weight:{weight};border:{frame};\
         background:color-mix(in srgb,var({shade}) {share}%,transparent)\">{text}</span>"
    )
}

fn nothing_hidden(score: &Score) -> String {
    let row = |row: &ConfusionRow| {
        let called: Vec<_> =
            row.called.iter().map(|(name, [count, ..])| format!("{} {count}", escaped(name))).collect();
        vec![escaped(&row.truth), row.of.to_string(), called.join(", ")]
    };
    table(&["hidden", "cases", "called"], score.tables.nothing_hidden.iter().map(row))
}

fn spread(name: &str, spread: &QuantileSummary, scale: f64, unit: &str) -> Vec<String> {
    let quantile = |at: usize| {
        spread.quantiles.map_or("<span class=\"none\">none</span>".to_owned(), |all| {
            format!("{:.1} {unit}", all[at] * scale)
        })
    };
    let mut row = vec![name.to_owned(), spread.of.to_string()];
    row.extend((0..4).map(quantile));
    row
}

fn numbers(score: &Score) -> String {
    let numbers = &score.tables.numbers;
    let spreads = [
        spread("amplitude off by, of itself", &numbers.off_ratio, 100.0, "%"),
        spread("its standard error, of itself", &numbers.error_ratio, 100.0, "%"),
        spread("gap to the floor closed, <em>claimed</em>", &score.tables.claimed_closed_ratio, 100.0, "%"),
        spread("the same, all signals together", &score.tables.claimed_joint_ratio, 100.0, "%"),
        spread("wall time", &score.tables.wall_s, 1.0, "s"),
        spread("memory", &score.tables.memory_mib, 1.0, "MiB"),
    ];
    let covered = [
        ("amplitudes", &numbers.covered),
        ("all numbers", &numbers.all_covered),
        ("all numbers, another functional form", &numbers.foreign_covered),
    ];
    format!(
        "{}<p>Covered by value ± 2 standard errors; wanted are 90 to 98 %. {} right names came without an amplitude and its \
         error.</p>\n{}",
        table(&["what", "cases", "least", "median", "90 %", "largest"], spreads),
        numbers.untold,
        table(&["numbers", "covered"], covered.map(|(name, rate)| vec![name.to_owned(), reported(rate)]))
    )
}

fn errors(score: &Score) -> String {
    if score.tables.errors.is_empty() {
        return "<p class=\"none\">Every case has a good report.</p>\n".to_owned();
    }
    let rows = score.tables.errors.iter().map(|(reason, count)| vec![escaped(reason), count.to_string()]);
    table(&["why", "cases"], rows)
}

fn cases(score: &Score) -> String {
    let row = |case: &Case| {
        let hidden: Vec<_> = case
            .judgement
            .hidden
            .iter()
            .zip(&case.over_limit)
            .map(|(hidden, over)| {
                let over = over.map_or("limit not known".to_owned(), |over| format!("{over:.1} x limit"));
                let mark = if hidden.right { '✓' } else { '✗' };
                format!("{mark} {} {} ({over}, class of {})", hidden.effect, hidden.place, hidden.class_size)
            })
            .collect();
        let marks = [
            (case.foreign_form, "form"),
            (case.wrong_parameters, "parameters"),
            (case.coloured_noise, "noise"),
        ];
        let marks: Vec<_> = marks.iter().filter(|(is, _)| *is).map(|(_, name)| *name).collect();
        let error = case.judgement.error.as_ref().map_or(String::new(), |error| format!(": {error}"));
        vec![
            case.number.to_string(),
            if hidden.is_empty() { "nothing".to_owned() } else { escaped(&hidden.join("; ")) },
            marks.join(", "),
            escaped(&format!("{}{error}", case.judgement.called)),
            format!("{:.1}", case.wall_s),
            format!("<code>{}</code>", escaped(&case.repeat)),
        ]
    };
    format!(
        "<details>\n<summary>{} cases, each with the command that repeats it</summary>\n{}</details>\n",
        score.cases.len(),
        table(&["draw", "hidden", "difficulties", "called", "s", "again"], score.cases.iter().map(row))
    )
}
