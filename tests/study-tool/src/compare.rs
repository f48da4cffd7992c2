//! Tables of several scores in Markdown, with a column for each program.
//!
//! ```text
//! 166/223 (68 to 80 %)        a rate that should be high, with Wilson's interval of 95 %
//! 0/100 (at most 3.0 %)       a rate that should be low, with the exact one-sided bound of 95 %
//! ```
//!
//! The scores may be of different studies of one mode: the first row states the number of draws and the seed.

use crate::draws::Shape;
use crate::interval::Rate;
use crate::leave_out::tables::Split as LeftSplit;
use crate::score::Score;
use crate::score::tables::{Line, QuantileSummary, Split};
use std::fmt::Write;

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CompareError {
    #[error("nothing to compare: give LABEL@FOLDER, once for each program")]
    Empty,
    #[error(
        "'{left}' and '{right}' are of different modes, one without the hidden effects: compare them apart"
    )]
    Modes { left: String, right: String },
}

/// The tables of several scores in Markdown: targets and figures, parts of the draws, effect by effect.
///
/// # Errors
/// [`CompareError`] when there is no score, or the scores are of different modes.
pub fn markdown(scores: &[Score]) -> Result<String, CompareError> {
    let first = scores.first().ok_or(CompareError::Empty)?;
    let is_left_out = |score: &Score| score.leave_out.is_some();
    if let Some(other) = scores.iter().find(|other| is_left_out(other) != is_left_out(first)) {
        return Err(CompareError::Modes { left: first.label.clone(), right: other.label.clone() });
    }
    let mut text = table("what", scores, "wanted", &figures(scores));
    if is_left_out(first) {
        text.push_str("\nBy what was left out and what was made hard:\n");
        for score in scores {
            let splits = score.leave_out.iter().flat_map(|left| &left.splits);
            let _ = write!(text, "\n{}", left_out("draws", score, splits));
        }
        text.push_str("\nEach effect:\n");
        for score in scores {
            let effects = score.leave_out.iter().flat_map(|left| &left.effects);
            let _ = write!(text, "\n{}", left_out("effect", score, effects));
        }
    } else {
        text.push_str(
            "\nClass among the names, by amplitude and by what was made hard (draws of one effect):\n\n",
        );
        text.push_str(&table("draws", scores, "", &parts(scores, |score| &score.tables.splits)));
        text.push_str("\nClass among the names, effect by effect:\n\n");
        text.push_str(&table("effect", scores, "", &parts(scores, |score| &score.tables.effects)));
    }
    Ok(text)
}

/// A row: its name, a cell for each score, the target.
struct Row {
    name: String,
    cells: Vec<String>,
    wanted: String,
}

/// `166/223 (68 to 80 %)`.
pub(crate) fn reported(rate: &Rate) -> String {
    if rate.of == 0 {
        return "none".to_owned();
    }
    let [low, high] = rate.interval.map(|end| end * 100.0);
    format!("{}/{} ({low:.0} to {high:.0} %)", rate.count, rate.of)
}

/// `0/100 (at most 3.0 %)`.
fn bound_cell(rate: &Rate) -> String {
    if rate.of == 0 {
        return "none".to_owned();
    }
    format!("{}/{} (at most {:.1} %)", rate.count, rate.of, rate.at_most * 100.0)
}

/// The upper bound for a line whose rate should be low, else the interval.
pub(crate) fn line_cell(line: &Line) -> String {
    if line.is_low() { bound_cell(&line.rate) } else { reported(&line.rate) }
}

fn quantile(spread: &QuantileSummary, at: usize, scale: f64, unit: &str) -> String {
    spread.quantiles.map_or("none".to_owned(), |all| format!("{:.1} {unit}", all[at] * scale))
}

fn figures(scores: &[Score]) -> Vec<Row> {
    let row = |name: &str, wanted: &str, cell: &dyn Fn(&Score) -> String| Row {
        name: name.to_owned(),
        cells: scores.iter().map(cell).collect(),
        wanted: wanted.to_owned(),
    };
    let mut rows = vec![
        row("program, CRC-32", "", &|score| score.program.reported()),
        row("draws, seed", "", &|score| format!("{}, {}", score.cases.len(), score.seed)),
    ];
    let lines = scores.first().map_or(&[][..], |first| &first.tables.headline);
    rows.extend(lines.iter().enumerate().map(|(at, line)| {
        let cell = |score: &Score| score.tables.headline.get(at).map_or(String::new(), line_cell);
        row(&line.name, line.wanted, &cell)
    }));
    let is_left_out = scores.iter().any(|score| score.leave_out.is_some());
    if !is_left_out {
        type Pick = fn(&Score) -> &Rate;
        let rates: [(&str, &str, Pick); 3] = [
            ("amplitude within two standard errors", "90 to 98 %", |score| &score.tables.numbers.covered),
            ("the same, all numbers", "90 to 98 %", |score| &score.tables.numbers.all_covered),
            ("the same, all numbers, another form", "", |score| &score.tables.numbers.foreign_covered),
        ];
        rows.extend(rates.map(|(name, wanted, pick)| row(name, wanted, &|score| reported(pick(score)))));
        type Figure = fn(&Score) -> &QuantileSummary;
        let medians: [(&str, &str, Figure); 4] = [
            ("amplitude off by, of itself, median", "", |score| &score.tables.numbers.off_ratio),
            ("its standard error, of itself, median", "below 25 %", |score| {
                &score.tables.numbers.error_ratio
            }),
            ("class named: held-out gap closed as claimed, worst signal, median", "at least 95 %", |score| {
                &score.tables.claimed_closed_ratio
            }),
            ("the same, all signals together, median", "at least 95 %", |score| {
                &score.tables.claimed_joint_ratio
            }),
        ];
        rows.extend(
            medians
                .map(|(name, wanted, pick)| row(name, wanted, &|score| quantile(pick(score), 1, 100.0, "%"))),
        );
    }
    rows.push(row("wall time of a draw, median", "", &|score| quantile(&score.tables.wall_s, 1, 1.0, "s")));
    rows.push(row("wall time of a draw, largest", "", &|score| quantile(&score.tables.wall_s, 3, 1.0, "s")));
    rows.push(row("memory, largest", "", &|score| quantile(&score.tables.memory_mib, 3, 1.0, "MiB")));
    rows
}

/// The rate of the class among the names, part by part, without the parts that no score has a draw of.
fn parts(scores: &[Score], of: impl Fn(&Score) -> &Vec<Split>) -> Vec<Row> {
    let splits = scores.first().map_or(&[][..], |first| of(first));
    let row = |(at, split): (usize, &Split)| Row {
        name: split.name.clone(),
        cells: scores
            .iter()
            .map(|score| of(score).get(at).map_or(String::new(), |part| reported(&part.class_right)))
            .collect(),
        wanted: String::new(),
    };
    let any =
        |at: usize| scores.iter().any(|score| of(score).get(at).is_some_and(|part| part.class_right.of > 0));
    splits.iter().enumerate().filter(|(at, _)| any(*at)).map(row).collect()
}

/// Head of a column: the label, and noise and amplitudes where they are not the specified ones.
fn head(score: &Score) -> String {
    let Shape { noise_factor, weaker_factor, .. } = score.shape;
    let mut head = score.label.clone();
    for (name, factor) in [("noise times", noise_factor), ("amplitudes over", weaker_factor)] {
        if factor != 1.0 {
            let _ = write!(head, ", {name} {factor}");
        }
    }
    head
}

fn table(first: &str, scores: &[Score], last: &str, rows: &[Row]) -> String {
    let mut heads = vec![first.to_owned()];
    heads.extend(scores.iter().map(head));
    heads.extend((!last.is_empty()).then(|| last.to_owned()));
    let cells = rows.iter().map(|row| {
        let mut cells = vec![row.name.clone()];
        cells.extend(row.cells.iter().cloned());
        cells.extend((!last.is_empty()).then(|| row.wanted.clone()));
        cells
    });
    grid(&heads, cells)
}

fn left_out<'a>(first: &str, score: &Score, splits: impl Iterator<Item = &'a LeftSplit>) -> String {
    let heads = [
        &format!("{first}, {}", head(score)),
        "no wrong name",
        "balance",
        "variable",
        "both",
        "gap closed, worst signal, median",
        "all signals together",
        "verdicts",
    ]
    .map(str::to_owned);
    let row = |split: &LeftSplit| {
        let rates = [split.no_wrong_name, split.balance_right, split.variable_right, split.both_right];
        let mut cells = vec![split.name.clone()];
        cells.extend(rates.iter().map(reported));
        cells.extend(
            [split.claimed_closed_ratio, split.claimed_joint_ratio]
                .iter()
                .map(|spread| quantile(spread, 1, 100.0, "%")),
        );
        cells.push(verdicts(split));
        cells
    };
    grid(&heads, splits.filter(|split| split.no_wrong_name.of > 0).map(row))
}

/// `named 2, outside-catalogue 4`.
pub(crate) fn verdicts(split: &LeftSplit) -> String {
    let reported: Vec<_> =
        split.verdicts.iter().map(|(verdict, count)| format!("{verdict} {count}")).collect();
    reported.join(", ")
}

pub(crate) fn grid(heads: &[String], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    // An unescaped bar would end the cell.
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let mut text = line(heads);
    let _ = writeln!(text, "|{}", "---|".repeat(heads.len()));
    for row in rows {
        text.push_str(&line(&row.iter().map(|cell| cell.replace('|', "\\|")).collect::<Vec<_>>()));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::tests::{scored, scored_without};
    use plant::effects::SHEETS;

    #[test]
    fn a_table_has_a_column_for_each_program_and_what_is_wanted() {
        let scores = [scored("ours"), scored("theirs")];
        let text = markdown(&scores).unwrap();
        let row = |name: &str| {
            text.lines().find(|line| line.starts_with(&format!("| {name} |"))).unwrap_or_default()
        };
        assert_eq!(text.lines().next().unwrap(), "| what | ours | theirs | wanted |");
        assert_eq!(
            row("nothing hidden: called missing"),
            "| nothing hidden: called missing | 0/2 (at most 77.6 %) | 0/2 (at most 77.6 %) | at most 2 % |"
        );
        assert_eq!(row("wall time of a draw, median"), "| wall time of a draw, median | 2.0 s | 2.0 s |  |");
        assert_eq!(row("inclination"), "| inclination | 1/1 (21 to 100 %) | 1/1 (21 to 100 %) |");
        assert!(row("the same, all signals together, median").contains("| 100.0 % |"));
        // All rows of a table have as many cells as its head.
        for line in text.lines().take(20) {
            assert_eq!(line.matches('|').count(), 5, "{line}");
        }
        // What no draw is of is not reported.
        assert!(!text.contains("| below the limit |"));
    }

    #[test]
    fn effects_left_out_have_tables_of_their_own_and_modes_are_not_mixed() {
        let text = markdown(&[scored_without("without")]).unwrap();
        let all = SHEETS.len();
        let row =
            format!("| one effect left out: no wrong name | {all}/{all} (91 to 100 %) | at least 85 % |");
        assert!(text.contains(&row));
        assert!(text.contains("| inclination | 1/1 (21 to 100 %) | 1/1"), "{text}");
        assert!(text.contains("outside-catalogue 1 |"));
        let mixed = markdown(&[scored("ours"), scored_without("without")]).unwrap_err();
        assert_eq!(mixed, CompareError::Modes { left: "ours".to_owned(), right: "without".to_owned() });
        assert_eq!(markdown(&[]), Err(CompareError::Empty));
    }

    #[test]
    fn a_bar_does_not_end_a_cell() {
        let text = grid(&["a".to_owned()], [vec!["|v|".to_owned()]]);
        assert_eq!(text, "| a |\n|---|\n| \\|v\\| |\n");
    }
}
