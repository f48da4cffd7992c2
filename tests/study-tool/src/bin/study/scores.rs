//! The commands that score: one label as a page, several labels as tables, several noise factors as curves.

use crate::cli::{Column, CompareArguments, CurveArguments, ScoreArguments, WorldsArguments};
use crate::{CommandResult, EARLIER, EXPECTED, LIMITS, PAGE, committed, known_classes, read_if_there, say};
use std::error::Error;
use std::path::PathBuf;
use study::curve::Curves;
use study::folder::{Study, write_whole};
use study::leave_out::Expectations;
use study::limits::Limits;
use study::score::{Score, ScoreInputs};
use study::worlds::Worlds;
use study::{compare, document, page, score};

pub(crate) fn score(arguments: &ScoreArguments) -> CommandResult {
    let score = scored(&arguments.folders, &arguments.label, false)?;
    let folder = arguments.to.as_ref().unwrap_or(&arguments.folders[0]);
    let path = |extension: &str| folder.join(format!("score-{}.{extension}", arguments.label));
    write_whole(&path("json"), format!("{:#}\n", serde_json::json!(score)).as_bytes())?;
    write_whole(&path("html"), page::page(&score).as_bytes())?;
    for line in &score.tables.headline {
        let rate = &line.rate;
        say(&format!("{}: {} of {} (wanted: {})", line.name, rate.count, rate.of, line.wanted));
    }
    say(&path("html").display().to_string());
    Ok(())
}

/// Scores both worlds of a study; draws without a result are skipped.
pub(crate) fn worlds(arguments: &WorldsArguments) -> CommandResult {
    let WorldsArguments { folders, label, left_out, other, write } = arguments;
    let of_label = |label| scored(folders, label, true);
    let left_out = left_out.as_deref().map(of_label).transpose()?;
    let others = other.iter().map(|label| of_label(label)).collect::<Result<Vec<_>, _>>()?;
    let draws = Study::open(&folders[0])?.draws.len();
    let worlds = Worlds::of(&of_label(label)?, left_out.as_ref(), &others, draws);
    let text = worlds.markdown();
    let path = |extension: &str| folders[0].join(format!("worlds-{label}.{extension}"));
    write_whole(&path("json"), format!("{:#}\n", serde_json::json!(worlds)).as_bytes())?;
    write_whole(&path("md"), text.as_bytes())?;
    if *write {
        document::put(&committed(PAGE), "worlds", &text)?;
    }
    say(&format!("\n{text}"));
    Ok(())
}

pub(crate) fn compare(arguments: &CompareArguments) -> CommandResult {
    let scores = all(&arguments.columns)?;
    let text = compare::markdown(&scores)?;
    if let Some(path) = &arguments.to {
        write_whole(path, text.as_bytes())?;
    }
    if arguments.write {
        let is_left_out = scores.iter().any(|score| score.leave_out.is_some());
        document::put(&committed(EARLIER), if is_left_out { "leave-out" } else { "compare" }, &text)?;
    }
    if arguments.to.is_none() && !arguments.write {
        say(&format!("\n{text}"));
    }
    Ok(())
}

pub(crate) fn curve(arguments: &CurveArguments) -> CommandResult {
    let scores = all(&arguments.columns)?;
    let curves = Curves::new(&scores)?;
    let (text, picture) = (curves.markdown(), curves.svg()?);
    let name = format!("curve-{}", arguments.columns[0].label);
    write_whole(&arguments.to.join(format!("{name}.md")), text.as_bytes())?;
    write_whole(&arguments.to.join(format!("{name}.svg")), picture.as_bytes())?;
    if arguments.write {
        document::put(
            &committed(EARLIER),
            "curve",
            &format!("{text}\n![rates over noise and amplitude](curve.svg)"),
        )?;
        write_whole(&committed("docs/curve.svg"), picture.as_bytes())?;
    }
    say(&arguments.to.join(format!("{name}.svg")).display().to_string());
    Ok(())
}

fn all(columns: &[Column]) -> Result<Vec<Score>, Box<dyn Error>> {
    columns.iter().map(|column| scored(&column.folders, &column.label, false)).collect()
}

/// Scores results with the committed limits, classes and expectations.
fn scored(folders: &[PathBuf], label: &str, partly: bool) -> Result<Score, Box<dyn Error>> {
    let limits: Option<Limits> = read_if_there(&committed(LIMITS))?;
    let expectations: Option<Expectations> = read_if_there(&committed(EXPECTED))?;
    let mut draws = Vec::new();
    for folder in folders {
        draws.extend(Study::open(folder)?.draws);
    }
    let classes = known_classes(&draws)?;
    let known = ScoreInputs {
        limits: limits.as_ref(),
        classes: Some(&classes),
        expectations: expectations.as_ref(),
        partly,
    };
    Ok(score::score(folders, label, known)?)
}
