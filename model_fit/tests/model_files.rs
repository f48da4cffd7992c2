//! Model files closed on records that are simulated here, by another integrator, with a term hidden or none.

use crate::closing::{close, close_with, file, number, random};
use model_fit::{ClosedModel, ModelReport, Search, Verdict, explain};
use std::path::Path;

/// A mass on a spring, pushed by a force; what may be missing, and a decoy.
pub(crate) const OSCILLATOR: &str = r#"
name = "Oscillator"
[fit]
starts = 0 # the files' values are near
[inputs.force]
column = "force_N"
unit = "N"
[parameters]
mass = { unit = "kg", value = 1.5, range = [0.1, 10] }
stiffness = { unit = "N/m", value = 60, range = [1, 1000] }
damping = { unit = "N s/m", value = 1, range = [0, 50] }
[states.x]
unit = "m"
start = 0
derivative = "v"
[states.v]
unit = "m/s"
start = 0
derivative = "(force - stiffness*x - damping*v)/mass"
[outputs.position]
column = "x_mm"
unit = "mm"
value = "x"
[[suspects]]
name = "cubic-stiffness"
place = "v"
add = "-k*x^3/mass"
parameters.k = { unit = "N/m^3", value = [100, 1000], range = [0, 1e6] }
[[suspects]]
name = "quadratic-damping"
place = "v"
add = "-c*v*abs(v)/mass"
parameters.c = { unit = "kg/m", value = 1, range = [0, 100] }
[[suspects]]
name = "dry-friction"
place = "v"
add = "-f*tanh(v/0.01[m/s])/mass"
parameters.f = { unit = "N", value = 0.5, range = [0, 50] }
[[suspects]]
name = "offset"
place = "position"
add = "o"
parameters.o = { unit = "mm", value = 1, range = [-100, 100] }
[[suspects]]
name = "end-stop"
place = "v"
add = "-hardness*max(x - 0.2[m], 0)/mass"
parameters.hardness = { unit = "N/m", value = 100, range = [0, 1e6] }
[[suspects]]
name = "drift"
place = "position"
add = "rate*t"
decoy = true
parameters.rate = { unit = "mm/s", value = 1, range = [-100, 100] }
"#;

/// 20 s at 50 Hz by 40 steps of semi-implicit Euler between two samples, noise of about 0.6 mm, a force that jumps.
fn record(mut seed: u64, hidden: impl Fn(f64, f64) -> f64) -> String {
    let mut text = "t_s,force_N,x_mm\n".to_owned();
    let mut random = || random(&mut seed);
    let (mut x, mut v, mut force) = (0.0, 0.0, 0.0);
    for row in 0..1000 {
        if row % 35 == 0 {
            force = 24.0 * random();
        }
        let noise = random() + random();
        text += &format!("{},{force},{}\n", f64::from(row) * 0.02, x * 1e3 + noise);
        for _ in 0..40 {
            v += 5e-4 * (force - 50.0 * x - 1.3 * v - hidden(x, v)) / 1.2;
            x += 5e-4 * v;
        }
    }
    text
}

fn closed(folder: &Path, model: &str, hidden: impl Fn(f64, f64) -> f64 + Copy) -> ClosedModel {
    let model = file(folder, "oscillator.toml", model);
    let [train, more, test] = [("train.csv", 1), ("more.csv", 2), ("test.csv", 3)]
        .map(|(name, seed)| file(folder, name, &record(seed, hidden)));
    close(&model, &[train, more], &[test]).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_hidden_term_is_named_and_confirmed_with_its_number() {
    let folder = tempfile::tempdir().unwrap();
    let closed = closed(folder.path(), OSCILLATOR, |x, _| 400.0 * x * x * x);
    let report = &closed.report;
    assert_eq!((report.verdict, report.confirmed), (Verdict::Named, Some(true)), "{report:#?}");
    assert_eq!(report.named.len(), 1);
    assert_eq!(report.named[0].suspect, "cubic-stiffness");
    assert!(report.headline.contains("confirmed"), "{}", report.headline);
    // The mass of 1.2 and the stiffness of 50 come back with it; semi-implicit Euler shifts them by some 1e-3.
    for (name, expected) in [("mass", 1.2), ("stiffness", 50.0), ("damping", 1.3), ("k", 400.0)] {
        let number = number(report, name);
        let error = number.standard_error.unwrap();
        assert!((number.value - expected).abs() < 4.0 * error + 5e-3 * expected, "{number:?}");
    }
    let held_out = &report.held_out[0];
    assert!(held_out.ratio.unwrap() < 0.8 && held_out.unit == "mm", "{held_out:?}");
    let decoy = report.suspects.iter().find(|suspect| suspect.is_decoy).unwrap();
    assert!(decoy.decision.starts_with("rejected"), "{decoy:?}");
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(&closed.page, options)
        .unwrap_or_else(|error| panic!("the page is well-formed: {error}"));
    assert!(closed.page.contains("cubic-stiffness") && closed.page.contains("dv/dt = "));
    said_once(report);
    assert!(closed.page.contains("<mo>+</mo><mrow class=\"named\">"), "the term is marked in its equation");
    // A line without a colour in the style sheet is not seen.
    assert!(closed.page.contains("cubic-stiffness at equation of v, over x"), "what the term looks like");
    assert!(closed.page.contains("<mfrac><mrow><mi>d</mi><mi>v</mi></mrow>"), "equations are set");
    for name in closed.page.split("class=\"line ").skip(1).filter_map(|rest| rest.split('"').next()) {
        assert!(closed.page.contains(&format!(".{name}{{--c:")), "line {name} is drawn without a colour");
    }
    assert!(closed.page.contains("class=\"line s0\""), "the measured line");
}

/// Where the misfit comes from is said beside a name if more than noise is left and it is another place, or if the name is taken
/// back.
fn said_once(report: &ModelReport) {
    assert!(report.adequate && report.located.is_some(), "{report:#?}");
    let with = |place: &str, adequate, taken_back| {
        let mut report = ModelReport { adequate, taken_back, ..report.clone() };
        let located = report.located.as_mut().unwrap();
        (located.place, located.alternatives) = (place.into(), Vec::new());
        report.located_in_words()
    };
    let [here, elsewhere] = ["equation of v", "output position"];
    assert_eq!(report.named[0].place, here);
    for (place, adequate) in [(here, true), (elsewhere, true), (here, false)] {
        assert_eq!(with(place, adequate, false), None, "{place}");
    }
    assert!(
        with(elsewhere, false, false)
            .is_some_and(|said| said.contains("; that is without cubic-stiffness: "))
    );
    assert!(with(here, true, true).is_some_and(|said| !said.contains("that is without")));
}

/// Its number stands in no file: the extended model has it beside the `use`, and goes on from there.
#[test]
fn a_term_of_a_library_is_named_and_written_into_the_extended_model() {
    let folder = tempfile::tempdir().unwrap();
    let (before, rest) = OSCILLATOR.split_once("add = \"-k*x^3/mass\"\n").unwrap();
    let rest = rest.split_once("[0, 1e6] }\n").unwrap().1;
    let used = "use = \"stiffness/cubic\"\ntimes = \"-1/mass\"\nwith.x = \"x\"\n";
    let library = format!("{before}{used}{rest}");
    let closed = closed(folder.path(), &library, |x, _| 400.0 * x * x * x);
    assert_eq!(closed.report.named[0].suspect, "cubic-stiffness", "{}", closed.report.headline);
    assert_eq!(closed.report.named[0].term, "dv/dt = … + (-1/mass*(k*x^3))");
    let path = file(folder.path(), "extended.toml", &closed.extended.unwrap());
    let extended = model_fit::read(&path).unwrap_or_else(|error| panic!("{error}"));
    let k = extended.parameters.iter().find(|one| one.name == "k").unwrap();
    assert!(extended.suspects[0].is_term && (k.values_si[0] / 400.0 - 1.0).abs() < 0.2, "{k:?}");
}

#[test]
fn a_model_that_lacks_nothing_names_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let report = closed(folder.path(), OSCILLATOR, |_, _| 0.0).report;
    assert_eq!((report.verdict, report.confirmed), (Verdict::NothingMissing, None), "{report:#?}");
    assert!(report.named.is_empty() && report.held_out[0].ratio == Some(1.0));
    let sum: f64 = report.suspects.iter().map(|suspect| suspect.probability).sum();
    assert!(sum < 0.5, "none of them is more likely than each: {sum}");
}

#[test]
fn two_suspects_with_the_same_law_are_indistinguishable() {
    let folder = tempfile::tempdir().unwrap();
    let twin = OSCILLATOR.replace(
        "[[suspects]]\nname = \"quadratic-damping\"",
        "[[suspects]]\nname = \"cubic-too\"\nplace = \"v\"\nadd = \"-k2*x*abs(x)^2/mass\"\n\
         parameters.k2 = { unit = \"N/m^3\", value = 100, range = [0, 1e6] }\n[[suspects]]\nname = \"quadratic-damping\"",
    );
    let closed = closed(folder.path(), &twin, |x, _| 400.0 * x * x * x);
    let report = &closed.report;
    assert_eq!(report.verdict, Verdict::Ambiguous, "{}", report.headline);
    let named = &report.named[0];
    let caption = format!("{} in place of {} at equation of v, over x", named.alternatives[0], named.suspect);
    assert!(closed.page.contains(&caption), "what the other one looks like");
    let bands = closed.page.matches("± 2 standard errors of its numbers").count();
    assert_eq!(bands, 2, "a band for each of both");
    let mut names = [report.named[0].suspect.as_str(), report.named[0].alternatives[0].as_str()];
    names.sort_unstable();
    assert_eq!(names, ["cubic-stiffness", "cubic-too"]);
    // The same law leaves the same of the held-out record.
    let other = &report.held_out_alternatives[0];
    assert_eq!(
        [other.instead_of.as_str(), other.suspect.as_str()],
        [&report.named[0].suspect, &report.named[0].alternatives[0]]
    );
    assert!((other.residual.rms_after / report.held_out[0].rms_after - 1.0).abs() < 1e-2, "{other:?}");
    // Structure says so before any of them is fitted.
    assert!(report.structure.twins.iter().any(|twins| twins.suspects == ["cubic-stiffness", "cubic-too"]));
    let train = [folder.path().join("train.csv")];
    let text = explain(&folder.path().join("oscillator.toml"), &train).unwrap();
    let said = "cubic-stiffness and cubic-too: the same to these records (cosine 1.000)";
    assert!(text.contains(said), "{text}");
}

/// A sine of 7 rad/s, fitted from 20: the squares over its frequency have a minimum in each lobe.
#[test]
fn a_fit_from_several_starts_finds_the_lowest_minimum() {
    let folder = tempfile::tempdir().unwrap();
    let row = |k: i32| {
        let [t, noise] = [f64::from(k) * 0.02, 0.01 * f64::from(k * k % 17 - 8) / 8.0];
        format!("{t},{}\n", 2.0 * (7.0 * t).sin() + noise)
    };
    let rows: String = (0..200).map(row).collect();
    let record = file(folder.path(), "sine.csv", &format!("t_s,y\n{rows}"));
    let frequency = |starts: u32| {
        let text = format!(
            "fit.starts = {starts}\n[parameters]\nsize = {{ value = 0.5, range = [0.01, 10] }}\n\
             w = {{ unit = \"1/s\", value = 20, range = [0.1, 100] }}\n[outputs.y]\nvalue = \"size*sin(w*t)\"\n"
        );
        let model = file(folder.path(), "sine.toml", &text);
        let report = close(&model, std::slice::from_ref(&record), &[]).unwrap().report;
        number(&report, "w").value
    };
    assert!((frequency(0) - 7.0).abs() > 1.0, "from one start it stays in a lobe beside: {}", frequency(0));
    assert!((frequency(24) - 7.0).abs() < 0.01, "{}", frequency(24));
}

/// Mass, stiffness and damping with a force of unknown gain: one of the four is free.
#[test]
fn a_number_that_the_records_do_not_determine_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let free = OSCILLATOR
        .replace("damping = {", "gain = { value = 1, range = [0.1, 10] }\ndamping = {")
        .replace("(force - ", "(gain*force - ");
    let report = closed(folder.path(), &free, |_, _| 0.0).report;
    for name in ["mass", "stiffness", "gain"] {
        assert!(report.structure.undetermined.contains(&name.to_owned()), "{name}: {:?}", report.structure);
        assert!(
            report.parameters.iter().any(|number| number.name == name && number.standard_error.is_none())
        );
    }
}

#[test]
fn a_held_out_record_that_cannot_be_judged_is_refused_before_a_fit() {
    let folder = tempfile::tempdir().unwrap();
    let fitted = OSCILLATOR.replacen("start = 0", "start = \"fitted\"\nguess = 0.01", 1);
    let with_start = |samples: u32| format!("{fitted}\n[held_out]\nstart_samples = {samples}\n");
    let good = record(3, |_, _| 0.0);
    let short: String = good.lines().take(31).map(|line| format!("{line}\n")).collect();
    let no_force = good.replacen("force_N", "force", 1);
    let no_position = good.replacen("x_mm", "x_m", 1);
    let words = good.replacen("0.02,", "0.02,low", 1);
    for (model, test, hint) in [
        (OSCILLATOR, &no_force, "force_N"),
        (OSCILLATOR, &no_position, "x_mm"),
        (OSCILLATOR, &words, "test.csv:3"),
        (&fitted, &good, "held_out.start_samples of the model is 0"),
        (&with_start(40), &short, "test.csv: 30 samples, of which the first 40 are for its start"),
    ] {
        let file = |name: &str, text: &str| file(folder.path(), name, text);
        let (model, train) = (file("oscillator.toml", model), file("train.csv", &good));
        let progress = &mut |said: &str| panic!("{hint}: {said} before the held-out record was checked");
        let refused =
            close_with(&model, (&[train], &[file("test.csv", test)]), Search::MoreThanNoise, progress)
                .map(|closed| closed.report.headline);
        let message = refused.unwrap_err().to_string();
        assert!(message.contains(hint), "{hint}: {message}");
    }
    let judged = closed(folder.path(), &with_start(40), |_, _| 0.0);
    assert_eq!((judged.not_judged, judged.report.held_out[0].rows), (None, 960));
}

#[test]
fn a_model_is_explained_with_its_equations_and_units() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "oscillator.toml", OSCILLATOR);
    let text = explain(&path, &[]).unwrap();
    for line in [
        "force [N] from column force_N",
        "dv/dt = (force - stiffness*x - damping*v)/mass    v in m/s, starts at 0",
        "position [mm] = x    noise estimated",
        "mass = 1.50 kg, fitted within 0.100 to 10.0",
        "cubic-stiffness, equation of v: dv/dt = … + (-k*x^3/mass)",
        "drift, a decoy, output position: position + (rate*t)",
        "k = 100 N/m^3 (a fit starts from 1000 too), fitted",
        "held out\n  every sample is scored\n",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}

/// How records are read, and all that a suspect brings.
#[test]
fn a_model_is_explained_with_its_record_and_what_suspects_bring() {
    let folder = tempfile::tempdir().unwrap();
    let record = r#"
[record]
time = "t_ms"
unit = "ms"
period_s = 0.02
separator = ";"
decimal = ","
skip_lines = 2
absent = ["-", "nan"]
[inputs.force]
hold = "linear"
scale = 0.5"#;
    let inputs = r#"
[inputs.table]
[inputs.jolt]
rate_of = "force"
unit = "N/s"
[parameters]"#;
    let bringing = r#"
[[suspects]]
name = "creep"
place = "v"
effect = "relaxation"
local = true
twins = ["offset"]
add = "-k*(side + bent)/mass"
define.bent = "x - crept"
parameters.k = { unit = "N/m", value = 3 }
states.crept = { unit = "mm", start = 4, derivative = "(x - crept)/2[s]" }
memory.side = { unit = "mm", start = 5, update = "min(max(side, x - 1[mm]), x + 1[mm])" }
[[suspects]]
use = "stiffness/cubic"
name = "stiff"
place = "v"
times = "-1/mass"
with.x = "x"
[tables.bump]
x = [-10, 0, 20]
y = [0, 1, 0.5]
x_unit = "mm"
y_unit = "N"
[held_out]
start_samples = 40
"#;
    let text = OSCILLATOR
        .replacen("\n[inputs.force]", record, 1)
        .replacen("\n[parameters]", inputs, 1)
        .replacen("column = \"x_mm\"", "column = \"x_cm\"\nscale = 10\nmodel_error = 0.25", 1);
    let path = file(folder.path(), "oscillator.toml", &(text + bringing));
    let text = explain(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
    for lines in [
        "record\n  time from column t_ms, in units of 0.001 s\n  on an even grid of 0.02 s\n",
        "  separator \";\", decimal comma, comments begin with \"#\"\n  lines before the head: 2\n",
        "  no value: \"-\", \"nan\"\n",
        "  force [N] from column force_N times 0.5, straight between samples\n",
        "  table [1] from column table, kept between samples\n",
        "  jolt [N/s] the rate of force, kept between samples\n",
        "  position [mm] = x    noise estimated, error of the model 0.250 mm, column x_cm times 10\n",
        "tables\n  bump: 3 points from 0 N at −10.0 mm to 0.500 N at 20.0 mm, straight between them and level beyond\n",
        "held out\n  the first 40 samples of a record are for its start, and not scored\n",
        "fit\n  starts from the values of the file alone\n",
        "suspects\n  before the records as likely as none of them: 1/9 each\n  cubic-stiffness, ",
        "  stiff, equation of v: dv/dt = … + (-1/mass*(k*x^3))\n    from the library: stiffness/cubic\n",
        "  creep, equation of v: dv/dt = … + (-k*(side + bent)/mass)\n    \
         a form of relaxation: forms that cannot be told apart are one finding\n    \
         local: bands of the folds do not judge it\n    \
         does the same as offset\n    \
         dcrept/dt = (x - crept)/2[s]    crept in mm, starts at 4.00\n    \
         bent = x - crept    in m\n    \
         side becomes min(max(side, x - 1[mm]), x + 1[mm]) after each step, from 5.00    in mm\n    \
         k = 3.00 N/m, fitted\n",
    ] {
        assert!(text.contains(lines), "{lines}\n{text}");
    }
    assert_eq!(text.matches("crept/dt").count(), 1, "a suspect's state is none of the model:\n{text}");
}
