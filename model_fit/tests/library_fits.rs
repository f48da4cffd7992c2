//! Every suspect of the libraries, hidden in a plant of one line and fitted: it is named, with its numbers.
//!
//! ```text
//!   y = 0.9 was, and the suspect at was or at y; what it reads are inputs; noise is 2 % of what it does
//! ```
//! Its numbers are a fifth larger than a value of the library's; those that the library has at 0 are as large as makes it do
//! half a unit. Records are of the same integrator, so that the laws and their fits are tested here, and not the integration.

use crate::closing::{close_with, file, number, random};
use model::{Entry, Inputs, Library, Model, Program, Simulator, Start};
use model_fit::Search;
use std::fmt::Write as _;
use std::path::Path;

const ROWS: u32 = 200;
const PERIOD_S: f64 = 0.075;
const GAIN: f64 = 0.9;
/// Of a number that the library leaves to the file: hidden, and where a fit starts.
const NEEDED: [f64; 2] = [0.6, 0.5];
/// What holds a state, and has a test of its own.
const ELSEWHERE: [&str; 1] = ["friction/stick-slip"];

#[test]
fn every_suspect_of_the_libraries_is_named_with_its_numbers() {
    let mut wrong = Vec::new();
    let mut tried = 0;
    for library in Library::all() {
        for entry in &library.entries {
            let name = format!("{}/{}", library.name, entry.name);
            if ELSEWHERE.contains(&name.as_str()) {
                continue;
            }
            tried += 1;
            if let Err(why) = Plant::of(library, entry).and_then(|plant| plant.is_found()) {
                wrong.push(format!("{name}: {why}"));
            }
        }
    }
    assert!(wrong.is_empty() && tried > 50, "{tried} tried\n{}", wrong.join("\n"));
}

/// Mean and size of a variable, in its usual unit.
fn size(variable: &str) -> [f64; 2] {
    match variable {
        "v" => [0.0, 0.05],
        "x" => [0.0, 0.1],
        "p" => [3e5, 2e5],
        "outer" => [1e5, 2e4],
        "level" => [1.0, 0.8],
        "brim" => [1.2, 0.0],
        "T" => [350.0, 40.0],
        "ambient" => [300.0, 5.0],
        "current" => [0.0, 10.0],
        "voltage" => [0.0, 400.0],
        "temperature" => [40.0, 30.0],
        _ => [0.0, 2.0],
    }
}

fn wave(row: u32, which: usize) -> f64 {
    let time_s = f64::from(row) * PERIOD_S;
    let turns = [0.23, 0.31, 0.17, 0.41][which % 4] * std::f64::consts::TAU * time_s;
    0.7 * (turns + which as f64).sin() + 0.3 * (2.7 * turns).sin()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (count, squares) = values.fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value * value));
    (squares / count).sqrt()
}

/// A plant of one line, and a suspect.
struct Plant<'a> {
    entry: &'a Entry,
    /// Model file without the suspect, and what the suspect's table begins with.
    base: String,
    suspect: String,
    /// Columns of the record behind the time.
    columns: Vec<(String, Vec<f64>)>,
    /// What is hidden, of each number that is not known, and what `y` then is.
    truth: Vec<Option<f64>>,
    measured: Vec<f64>,
}

impl<'a> Plant<'a> {
    fn of(library: &Library, entry: &'a Entry) -> Result<Self, String> {
        let mut quantities = entry.parameters.iter().map(|one| &one.quantity);
        let of_place = quantities.find(|quantity| quantity.dimension.as_deref() == Some("place"));
        let unit = &of_place.map_or(&library.place, |quantity| &quantity.unit).text;
        let reads_place = entry.reads_place() || entry.expression.contains("delay(");
        let mut base = format!(
            "[record]\ntime = \"t\"\n[fit]\nstarts = 2\n[parameters.gain]\nvalue = {GAIN}\nfixed = true\n\
             [outputs.y]\nunit = \"{unit}\"\nvalue = \"gain*was\"\n[inputs.was]\nunit = \"{unit}\"\nhold = \"linear\"\n"
        );
        let place = if reads_place { "was" } else { "y" };
        let mut suspect =
            format!("name = \"it\"\nuse = \"{}/{}\"\nplace = \"{place}\"\n", library.name, entry.name);
        let mut columns = vec![("was".to_owned(), [0.0, 2.0])];
        for variable in library.variables_of(entry).into_iter().filter(|one| one.default.is_none()) {
            let name = &variable.name;
            // A delay reads the input at its place.
            if name == "u" {
                suspect += "with.u = \"was\"\n";
                continue;
            }
            let _ = writeln!(suspect, "with.{name} = \"in_{name}\"");
            let unit = &variable.unit.text;
            let _ = write!(base, "[inputs.in_{name}]\nunit = \"{unit}\"\nhold = \"linear\"\n");
            columns.push((format!("in_{name}"), size(name)));
        }
        let columns = columns.into_iter().enumerate();
        let columns = columns.map(|(which, (name, [mean, size]))| {
            (name, (0..ROWS).map(|row| mean + size * wave(row, which)).collect())
        });
        let (columns, truth, measured) = (columns.collect(), Vec::new(), Vec::new());
        Self { entry, base, suspect, columns, truth, measured }.hidden()
    }

    /// The same with what is hidden.
    fn hidden(mut self) -> Result<Self, String> {
        let listed = self.entry.parameters.iter().map(|parameter| {
            let middle_si = parameter.values_si.get(parameter.values_si.len() / 2);
            match middle_si.map(|value| value / parameter.quantity.unit.factor) {
                Some(_) if parameter.is_fixed => None,
                Some(value) => Some(1.2 * value),
                None => Some(NEEDED[0]),
            }
        });
        let listed: Vec<Option<f64>> = listed.collect();
        let with = |zero: f64| -> Vec<Option<f64>> {
            listed.iter().map(|value| value.map(|value| if value == 0.0 { zero } else { value })).collect()
        };
        let unit = 1e-3;
        let scale = unit * 0.5 / self.effect(&self.simulated(&with(unit))?);
        self.truth = with(scale);
        self.measured = self.simulated(&self.truth)?;
        Ok(self)
    }

    /// The model file with the suspect under `kind`, and these of its numbers.
    fn text(&self, kind: &str, values: &[Option<f64>]) -> String {
        let given = self.entry.parameters.iter().zip(values);
        let given = given.filter_map(|(parameter, value)| {
            value.map(|value| format!("parameters.{} = {{ value = {value:e} }}\n", parameter.name))
        });
        format!("{}[[{kind}]]\n{}{}", self.base, self.suspect, given.collect::<String>())
    }

    /// What `y` is with the suspect, in its unit.
    fn simulated(&self, values: &[Option<f64>]) -> Result<Vec<f64>, String> {
        let model = Model::parse(&self.text("terms", values), Path::new("hidden.toml"));
        let model = model.map_err(|error| error.to_string())?;
        let program = Program::new(&model, &[]).map_err(|error| error.to_string())?;
        let samples = model.inputs.iter().map(|input| {
            let (_, column) = self.columns.iter().find(|(name, _)| *name == input.name).unwrap();
            column.iter().map(|value| value * input.unit.factor).collect()
        });
        let samples: Vec<Vec<f64>> = samples.collect();
        let start = |start: Start| match start {
            Start::Input { input } => samples[input][0],
            _ => 0.0,
        };
        let values = [
            model.parameters.iter().map(|one| one.values_si[0]).collect::<Vec<_>>(),
            model.states.iter().map(|state| start(state.start)).collect(),
            model.memories.iter().map(|one| one.start_si).collect(),
        ];
        let time_s: Vec<f64> = (0..ROWS).map(|row| f64::from(row) * PERIOD_S).collect();
        let inputs = Inputs { time_s: &time_s, samples_si: &samples };
        let factor = model.outputs[0].unit.factor;
        let mut all = Vec::new();
        Simulator::new(&program, &[])
            .run(&inputs, values.each_ref().map(Vec::as_slice), |_, _, value, _| all.push(value / factor))
            .map_err(|error| error.to_string())?;
        Ok(all)
    }

    /// How much the suspect does.
    fn effect(&self, values: &[f64]) -> f64 {
        rms(values.iter().zip(&self.columns[0].1).map(|(value, was)| value - GAIN * was))
    }

    /// The record with its noise.
    fn record(&self) -> String {
        let noise = 0.02 * self.effect(&self.measured);
        let mut state = 7_u64;
        let mut text = "t".to_owned();
        self.columns.iter().for_each(|(name, _)| text += &format!(",{name}"));
        text += ",y\n";
        for (row, measured) in (0..ROWS).zip(&self.measured) {
            let _ = write!(text, "{}", f64::from(row) * PERIOD_S);
            self.columns.iter().for_each(|(_, column)| text += &format!(",{:e}", column[row as usize]));
            let normal: f64 = (0..12).map(|_| random(&mut state)).sum();
            let _ = writeln!(text, ",{:e}", measured + noise * normal);
        }
        text
    }

    /// Whether it is named where the file does not know its numbers, and these are found within 5 % or their interval of 90 %.
    fn is_found(&self) -> Result<(), String> {
        let folder = tempfile::tempdir().unwrap();
        let needed = self.entry.parameters.iter().map(|parameter| {
            parameter.values_si.is_empty().then_some(NEEDED[usize::from(!parameter.is_fixed)])
        });
        let text = self.text("suspects", &needed.collect::<Vec<_>>());
        let model = file(folder.path(), "model.toml", &text);
        let train = file(folder.path(), "train.csv", &self.record());
        let closed = close_with(&model, (&[train], &[]), Search::Never, &mut |_| {});
        let report = closed.map_err(|error| error.to_string())?.report;
        if report.named.len() != 1 {
            return Err(format!("{}; {}", report.headline, report.suspects[0].decision));
        }
        for (parameter, expected) in self.entry.parameters.iter().zip(&self.truth) {
            let Some(expected) = expected.filter(|_| !parameter.is_fixed) else { continue };
            let number = number(&report, &parameter.name);
            let away = (number.value - expected).abs();
            let is_inside = number.standard_error.is_some_and(|error| away < 1.645 * error);
            if away > 0.05 * expected.abs() && !is_inside {
                return Err(format!("{number:?} for {expected}"));
            }
        }
        Ok(())
    }
}
