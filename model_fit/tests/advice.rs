//! Which sensor would tell suspects apart, in a plant where this follows from its equations.
//!
//! ```text
//!   upper' = u - upper/5 s        lower' = upper/5 s - lower/3 s        both start at 0; lower is measured
//! ```
//! A gain of the input and a gain of the flow between the two do the same to `lower`, and only the first one changes `upper`. A
//! gain of the sensor that is fitted hides them both.

use crate::closing::{close, file};
use model_fit::explain;
use std::path::{Path, PathBuf};

const TANKS: &str = r#"
[fit]
starts = 0
[inputs.u]
unit = "m/s"
[states.upper]
unit = "m"
start = 0
derivative = "u - upper/5[s]"
[states.lower]
unit = "m"
start = 0
derivative = "flow - lower/3[s]"
[define]
flow = "upper/5[s]"
[outputs.level]
unit = "m"
value = "lower"
[[suspects]]
name = "input-gain"
place = "u"
multiply = "1 + k"
parameters.k = { value = 0.1, range = [-1, 1] }
[[suspects]]
name = "flow-gain"
place = "flow"
multiply = "1 + k"
parameters.k = { value = 0.1, range = [-1, 1] }
[[suspects]]
name = "shape"
place = "flow"
multiply = "1 + k*upper/1[m]"
parameters.k = { value = 0.1, range = [-1, 1] }
"#;

/// 40 s at 5 Hz by Euler, an input that jumps, and errors of about a thousandth.
fn files(folder: &Path, model: &str) -> [PathBuf; 2] {
    let (mut upper, mut lower) = (0.0, 0.0);
    let mut text = "t_s,u,level\n".to_owned();
    for row in 0..200 {
        let u = [0.3, 0.0, 0.5, 0.1, 0.4][row / 40];
        text += &format!("{},{u},{}\n", row as f64 * 0.2, lower + 1e-3 * (((row * row) % 7) as f64 - 3.0));
        for _ in 0..100 {
            lower += 2e-3 * (upper / 5.0 - lower / 3.0);
            upper += 2e-3 * (u - upper / 5.0);
        }
    }
    [file(folder, "tanks.toml", model), file(folder, "record.csv", &text)]
}

fn explained(model: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let [file, record] = files(folder.path(), model);
    explain(&file, &[record]).unwrap()
}

/// The model with a gain of its sensor that is fitted.
fn with_gain(model: &str) -> String {
    model
        .replace("value = \"lower\"", "value = \"gain*lower\"")
        .replace("[states.upper]", "[parameters]\ngain = { value = 1, range = [0.1, 10] }\n[states.upper]")
}

#[test]
fn a_sensor_is_advised_that_two_suspects_do_not_move_alike() {
    let folder = tempfile::tempdir().unwrap();
    let [file, record] = files(folder.path(), TANKS);
    let report = close(&file, &[record], &[]).unwrap();
    let structure = &report.report.structure;
    assert_eq!(structure.twins.len(), 1, "{structure:?}");
    assert_eq!(structure.advice.len(), 1, "{structure:?}");
    assert_eq!(structure.advice[0].suspects, ["input-gain", "flow-gain"]);
    assert_eq!(structure.advice[0].measure, ["upper"]);
    let line = "To tell input-gain and flow-gain apart you would need a sensor of upper.";
    assert!(report.page.contains(line), "the page says so, too");
}

#[test]
fn a_sensor_is_advised_that_shows_a_suspect_which_hides() {
    let text = explained(&with_gain(TANKS));
    for line in [
        "suspect input-gain: looks like a change of the model's own numbers",
        "to see input-gain you would need a sensor of upper or lower",
        "to see flow-gain you would need a sensor of lower\n",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}

#[test]
fn a_sensor_is_advised_of_a_state_that_changes_no_output() {
    // Its rate is fitted from several starting points, of which the record prefers none.
    let third = "[parameters]\nrate = { unit = \"1/s\", value = 0.5 }\n[states.third]\nunit = \"m\"\nstart = 0\n\
                 derivative = \"rate*(lower - third)\"\n[define]";
    let leak = "[[suspects]]\nname = \"leak\"\nplace = \"third\"\nadd = \"-k*third\"\n\
                parameters.k = { unit = \"1/s\", value = 0.1, range = [0, 5] }\n";
    let model = TANKS.replace("starts = 0\n", "starts = 8\n").replace("[define]", third);
    let (plant, _) = model.split_once("[[suspects]]").unwrap();
    let text = explained(&format!("{plant}{leak}"));
    for line in
        ["rate: changes no output", "leak: changes no output", "to see leak you would need a sensor of third"]
    {
        assert!(text.contains(line), "{line}\n{text}");
    }
    assert!(!text.contains("looks like a change") && !text.contains("rate: not determined"), "{text}");
}

#[test]
fn no_sensor_is_advised_where_two_suspects_do_the_same_to_every_state() {
    let twin = TANKS.replace("\"flow-gain\"\nplace = \"flow\"", "\"flow-gain\"\nplace = \"u\"");
    let text = explained(&twin);
    let line = "no sensor of a state would tell input-gain and flow-gain apart";
    assert!(text.contains(line), "{text}");
    // Where each state is measured there is nothing to advise.
    let measured = "[outputs.above]\ncolumn = \"level\"\nunit = \"m\"\nvalue = \"upper\"\n[[suspects]]\n";
    let text = explained(&twin.replacen("[[suspects]]\n", measured, 1));
    assert!(text.contains("input-gain and flow-gain: the same") && !text.contains("sensor"), "{text}");
}

#[test]
fn a_suspect_whose_number_starts_at_0_is_seen_by_what_it_does_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let idle = "[[suspects]]\nname = \"squared\"\nplace = \"upper\"\nadd = \"0*k*u\"\n\
                parameters.k = { value = 0, range = [-1, 1] }\n";
    let zero = TANKS.replace("value = 0.1", "value = 0") + idle;
    let [file, record] = files(folder.path(), &zero);
    let report = close(&file, &[record], &[]).unwrap().report;
    let structure = &report.structure;
    assert_eq!(structure.without_effect, ["squared"], "{structure:?}");
    assert_eq!(structure.hidden, ["squared"], "{structure:?}");
    assert_eq!(structure.twins.len(), 1, "{structure:?}");
    assert_eq!(structure.twins[0].suspects, ["input-gain", "flow-gain"], "{structure:?}");
    assert_eq!(structure.advice[0].suspects, ["squared"], "{structure:?}");
    assert_eq!(structure.advice[1].measure, ["upper"], "{structure:?}");
    // A gain of the sensor does what both gains do.
    let text = explained(&with_gain(&zero));
    for line in
        ["squared: changes no output", "suspect input-gain: looks like a change of the model's own numbers"]
    {
        assert!(text.contains(line), "{line}\n{text}");
    }
    assert!(!text.contains("gain: changes no output"), "{text}");
}
