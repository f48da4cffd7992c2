//! What is said of a record before a model file is fitted to it.

use crate::closing::{close, file, random};
use model_fit::{preview_records, simulate};

/// A tank that drains, a pump that fills it.
const TANK: &str = r#"
[inputs.pump]
column = "pump_V"
unit = "V"
[parameters]
gain = { unit = "1/s", value = 0.15, range = [0.001, 1] }
drain = { unit = "1/s", value = 0.1, range = [0.001, 1] }
[states.level]
unit = "V"
start = 0
derivative = "gain*pump - drain*level"
[outputs.seen]
column = "level_V"
unit = "V"
value = "level"
"#;

/// 400 rows of time, pump and level, 0.5 s apart; the pump jumps, the level has a noise of 10 mV.
fn rows() -> Vec<[f64; 3]> {
    let (mut level, mut state) = (0.0, 7_u64);
    let mut random = || random(&mut state);
    let mut pump = 3.0;
    let row = |k: i32| {
        if k % 40 == 0 {
            pump = 5.0 + 6.0 * random();
        }
        let row = [f64::from(k) * 0.5, pump, level + 0.035 * random()];
        level += (pump * 2.0 - level) * (1.0 - (-0.05_f64).exp());
        row
    };
    (0..400).map(row).collect()
}

fn written(rows: impl Iterator<Item = [f64; 3]>) -> String {
    let text: String = rows.map(|[t, pump, level]| format!("{t},{pump:.4},{level:.4}\n")).collect();
    format!("t_s,pump_V,level_V\n{text}")
}

/// Notes of a record beside a model.
fn notes(model: &str, rows: impl Iterator<Item = [f64; 3]>) -> String {
    let folder = tempfile::tempdir().unwrap();
    let model = file(folder.path(), "tank.toml", model);
    let record = file(folder.path(), "record.csv", &written(rows));
    preview_records(&model, &[record]).unwrap_or_else(|error| panic!("{error}"))[0].notes.join("\n")
}

#[test]
fn a_model_is_simulated_with_the_values_of_its_file_and_nothing_is_fitted() {
    let folder = tempfile::tempdir().unwrap();
    // In millivolts, with a row of units, and a suspect that does not act.
    let rows = rows().into_iter().map(|[t, pump, level]| [t, pump, level * 1e3]);
    let rows = written(rows).replace("level_V\n", "level_V\ns,V,mV\n");
    let record = file(folder.path(), "record.csv", &rows);
    let suspect = "[[suspects]]\nname = \"brim\"\nplace = \"level\"\nadd = \"-k*level\"\n\
                   parameters.k = { unit = \"1/s\", value = 1 }\n";
    let text = TANK.replace("unit = \"V\"\nvalue = \"level\"", "unit = \"mV\"\nvalue = \"level\"") + suspect;
    let of = |gain: &str| {
        let model = file(folder.path(), "tank.toml", &text.replace("value = 0.15", gain));
        simulate(&model, &record).unwrap_or_else(|error| panic!("{error}"))
    };
    let right = of("value = 0.2");
    // Noise of 35 mV / sqrt(12), and a level of some volts.
    let one = &right.outputs[0];
    assert_eq!((one.output.as_str(), one.unit.as_str()), ("seen", "mV"));
    assert!(one.rms > 9.0 && one.rms < 11.0 && one.signal_rms > 1000.0, "{one:?}");
    let wrong = of("value = 0.15");
    assert!(wrong.outputs[0].rms > 1000.0, "its own value, not that of a fit: {:?}", wrong.outputs);
    let lines: Vec<&str> = right.table.lines().collect();
    assert_eq!((lines[0], lines.len()), ("t_s,pump_V,level_V,seen_model", 401));
    let cells: Vec<f64> = lines[400].split(',').map(|cell| cell.parse().unwrap()).collect();
    assert_eq!(cells[0], 199.5);
    assert!((cells[2] - cells[3]).abs() < 40.0 && cells[3] > 500.0, "{cells:?}");
    let started = text.replace("start = 0", "start = \"fitted\"\nguess = 0");
    let model = file(folder.path(), "tank.toml", &started);
    let notes = simulate(&model, &record).unwrap().notes;
    let said = "the start of level is fitted by a close";
    assert!(notes.iter().any(|note| note.starts_with(said)), "{notes:?}");
}

#[test]
fn a_good_record_has_no_notes() {
    assert_eq!(notes(TANK, rows().into_iter()), "");
}

#[test]
fn what_is_filled_into_a_hole_is_not_compared() {
    let without = || rows().into_iter().filter(|[t, ..]| !(50.0..100.0).contains(t));
    let said = notes(TANK, without());
    assert!(said.starts_with("lines 101 to 102: no row over 50.5 s, 101 usual periods: nothing"), "{said}");
    let folder = tempfile::tempdir().unwrap();
    let record = file(folder.path(), "record.csv", &written(without()));
    // As it is, on an even grid, and on one behind a filter.
    for (more, expected) in
        [("", 300), ("record.period_s = 0.5\n", 300), ("record.period_s = 0.5\nrows.every = 2\n", 150)]
    {
        let model = file(folder.path(), "tank.toml", &format!("{more}{TANK}"));
        let report = close(&model, std::slice::from_ref(&record), &[]).unwrap().report;
        let left = &report.training[0];
        assert!(left.rows.abs_diff(expected) <= 1, "{more}: {left:?}");
        assert!(report.notes[0].contains("no row over 50.5 s"), "{:?}", report.notes);
    }
}

#[test]
fn rows_that_are_lost_one_by_one_are_counted() {
    let said = notes(TANK, rows().into_iter().enumerate().filter(|(k, _)| k % 50 != 20).map(|(_, row)| row));
    assert_eq!(said, "one or two rows are missing at 8 places");
}

#[test]
fn a_spike_is_left_out_with_its_line() {
    let spiked = |[t, pump, level]: [f64; 3]| [t, pump, if t == 60.0 { 99999.0 } else { level }];
    let said = notes(TANK, rows().into_iter().map(spiked));
    assert!(said.starts_with("line 122: level_V is 99999, far beyond all others ("), "{said}");
    let folder = tempfile::tempdir().unwrap();
    let model = file(folder.path(), "tank.toml", TANK);
    let record = file(folder.path(), "record.csv", &written(rows().into_iter().map(spiked)));
    let report = close(&model, &[record], &[]).unwrap().report;
    assert!(report.training[0].rows == 399 && report.training[0].rms_before < 0.02, "{:?}", report.training);
}

#[test]
fn a_constant_and_a_saturated_output_are_noted() {
    let said = notes(TANK, rows().into_iter().map(|[t, pump, _]| [t, pump, 4.0]));
    assert!(said.contains("level_V is 4.00 all the time: it shows nothing of the equations"), "{said}");
    let clipped = || rows().into_iter().map(|[t, pump, level]| [t, pump, level.min(12.0)]);
    let said = notes(TANK, clipped());
    assert!(said.contains("level_V keeps one value, 12, over "), "{said}");
    assert!(said.contains("write value = \"min(level, 12[V])\" under [outputs.seen]"), "{said}");
    // The key that it names is one that a file may have.
    let told = TANK.replace("value = \"level\"", "value = \"min(level, 12[V])\"");
    let said = notes(&told, clipped());
    assert!(said.contains("keeps one value") && !said.contains("write value"), "{said}");
}

#[test]
fn a_sign_and_exchanged_columns_are_noted_before_the_fit() {
    let said = notes(TANK, rows().into_iter().map(|[t, pump, level]| [t, pump, -level]));
    assert!(said.contains("before the fit the model moves against seen (correlation -"), "{said}");
    let said = notes(TANK, rows().into_iter().map(|[t, pump, level]| [t, level, pump]));
    assert!(
        said.contains("with pump_V in its place it is (") && said.contains("are columns exchanged?"),
        "{said}"
    );
}

#[test]
fn a_model_of_another_size_than_the_record_is_noted_with_the_factor() {
    let of = |from: &str, to: &str| notes(&TANK.replace(from, to), rows().into_iter());
    let said = of(
        "[inputs.pump]\ncolumn = \"pump_V\"\nunit = \"V\"",
        "[inputs.pump]\ncolumn = \"pump_V\"\nunit = \"kV\"",
    );
    let factor = said.strip_prefix("before the fit the model gives ").and_then(|rest| rest.split(' ').next());
    let factor: f64 = factor.and_then(|factor| factor.parse().ok()).unwrap_or_else(|| panic!("{said}"));
    assert!((500.0..1000.0).contains(&factor), "{said}");
    let expected = "of column level_V in V, of the inputs (pump_V in kV) and of the numbers";
    assert!(said.contains(expected), "{said}");
    let said = of("value = 0.15", "value = 0.001");
    assert!(said.starts_with("before the fit the model gives 0.00"), "{said}");
}

#[test]
fn a_condition_that_few_rows_meet_is_said_with_what_it_reads() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..40).map(|k| format!("{k},{k},1\n")).collect();
    let record = file(folder.path(), "record.csv", &format!("t_s,pump_V,level_V\n{rows}"));
    let why = |rows: &str| {
        let model = file(folder.path(), "tank.toml", &format!("{rows}\n{TANK}"));
        preview_records(&model, std::slice::from_ref(&record)).unwrap_err().to_string()
    };
    let said = why("rows.where = \"pump > 50[V]\"");
    let expected =
        "0 rows meet [rows] of the model; 8 are needed: where pump > 50[V], and pump is 0 to 39.0 V; ";
    assert!(said.contains(expected), "{said}");
    let said = why("rows.every = 20");
    assert!(said.contains("40 samples over 39.0 s, one of 20 is a row: is unit of the time right"), "{said}");
}

#[test]
fn a_model_that_explains_nothing_of_an_output_is_noted_first_and_on_top_of_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let record = |factor: f64| {
        let rows = rows().into_iter().map(|[t, pump, level]| [t, pump, factor * level]);
        file(folder.path(), "record.csv", &written(rows))
    };
    let model = |text: &str| file(folder.path(), "tank.toml", text);
    let closed = |text: &str, factor: f64| close(&model(text), &[record(factor)], &[]).unwrap();
    let other = closed(TANK, 1e3);
    let [note, page] = [&other.report.notes[0], &other.page];
    assert!(note.contains("leaves more of seen") && note.contains("than its mean would"), "{note}");
    assert!(page.find("The fitted model leaves more of seen").unwrap() < page.find("<main>").unwrap());
    // A constant leaves what the mean leaves.
    let constant = TANK
        .replace("derivative = \"gain*pump - drain*level\"", "derivative = \"0*gain*pump - 0*drain*level\"");
    let constant = constant.replace("start = 0", "start = \"fitted\"\nguess = 5");
    let note = &closed(&constant, 1.0).report.notes[0];
    assert!(note.contains("leaves nearly as much of seen") && note.contains("as its mean would"), "{note}");
    let good = closed(TANK, 1.0).report.notes;
    assert!(good.iter().all(|note| !note.contains("mean would")), "{good:?}");
    let text = model_fit::explain(&model(TANK), &[record(1.0)]).unwrap();
    assert!(!text.contains("\nnotes\n"), "{text}");
    let text = model_fit::explain(&model(TANK), &[record(1e3)]).unwrap();
    assert!(text.contains("\nnotes\n  the fitted model leaves more of seen"), "{text}");
    assert!(text.contains("record.csv: before the fit the model gives 7.50·10⁻⁴ times"), "{text}");
}
