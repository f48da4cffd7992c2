//! A first model file from the columns of a record: what can be seen in them, and what is guessed and said so.
//!
//! ```text
//!   head, cells ─► separator, decimal sign, units in names ─► time, inputs, outputs ─► a lag of first order for each output
//! ```
//! Each output follows a weighted sum of all inputs with one time constant. That is a start: it can be fitted as it stands, and
//! its equations are for the user to write.

mod columns;
mod guess;

use columns::Table;
use guess::{Column, Role};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Why no model file can begin from a record.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the message of each says what it is
pub enum NewError {
    #[error("{}: {why}", file.display())]
    Open { file: PathBuf, why: std::io::Error },
    #[error(
        "{file}: no line with names above rows of numbers: the first line that is no comment names the columns"
    )]
    Head { file: String },
    #[error("{file}: no column grows from row to row: a record has a column of the time")]
    Time { file: String },
    #[error(
        "{file}:{line}: {column} = '{cell}'; the rows above it have times such as 2026-11-27T14:05:03.250"
    )]
    Calendar { file: String, line: u64, column: String, cell: String },
    #[error("{file}: beside the time {name} no column changes: nothing is measured")]
    Flat { file: String, name: String },
    #[error("{file}: {name} is no column with numbers beside the time; there are {known}")]
    Column { file: String, name: String, known: String },
    #[error(transparent)]
    Read(#[from] records::ReadError),
}

/// Columns whose role is known; that of all others is guessed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Roles<'a> {
    /// Columns that drive the plant.
    pub inputs: &'a [String],
    /// Columns that are measured of it.
    pub outputs: &'a [String],
}

/// Text of a new model file, and what was guessed.
#[derive(Clone, Debug)]
pub struct NewModel {
    /// TOML with comments, as `close` reads it.
    pub text: String,
    /// Whether a column drives it.
    pub has_input: bool,
}

/// A model file that begins from a record.
///
/// # Errors
/// A file that is no table over time, or lacks a column.
pub fn new_model(record: &Path, roles: Roles<'_>) -> Result<NewModel, NewError> {
    let bytes = std::fs::read(record).map_err(|why| NewError::Open { file: record.to_owned(), why })?;
    let table = Table::of(record, &String::from_utf8_lossy(&bytes))?;
    let (time, columns) = guess::columns(record, &table, roles)?;
    let text = ModelText { table: &table, time: &time, columns: &columns };
    Ok(NewModel { text: text.written(record), has_input: text.of(Role::Input).next().is_some() })
}

struct ModelText<'a> {
    table: &'a Table,
    time: &'a guess::TimeColumn,
    columns: &'a [Column],
}

impl ModelText<'_> {
    fn of(&self, role: Role) -> impl Iterator<Item = &Column> {
        self.columns.iter().filter(move |column| column.role == role)
    }

    fn written(&self, record: &Path) -> String {
        let name = record.file_stem().unwrap_or_default().to_string_lossy();
        let mut text = format!(
            "# A first model of this record, written by 'discrepancy new'. Units come from the names of its columns;\n\
             # which columns are inputs is a guess. 'discrepancy explain FILE' shows the model,\n\
             # 'discrepancy close --model FILE --train RECORD' fits it.\n\
             # Keys, functions and units: docs/model-files.md.\nname = {}\n",
            quoted(&name)
        );
        self.record(&mut text);
        for column in self.of(Role::LeftOut) {
            let _ = writeln!(text, "\n# Column {} is left out: {}.", column.column, column.why);
        }
        if self.of(Role::Input).next().is_none() {
            text.push_str("\n# No column was taken as an input, so that nothing drives this model: --inputs names them.\n");
        }
        self.inputs(&mut text);
        self.parameters(&mut text);
        self.states(&mut text);
        self.suspects(&mut text);
        text
    }

    fn record(&self, text: &mut String) {
        let Table { separator, is_decimal_comma, skip_lines, absent, .. } = self.table;
        let _ = write!(text, "\n[record]\ntime = {}\n", quoted(&self.time.column));
        if self.time.unit != "s" {
            let _ = writeln!(text, "unit = {}", quoted(&self.time.unit));
        }
        if separator != "," {
            let _ = writeln!(text, "separator = {}", quoted(separator));
        }
        if *is_decimal_comma {
            text.push_str("decimal = \",\"\n");
        }
        if *skip_lines > 0 {
            let _ = writeln!(text, "skip_lines = {skip_lines}");
        }
        if !absent.is_empty() {
            let absent: Vec<String> = absent.iter().map(|cell| quoted(cell)).collect();
            let _ = writeln!(text, "absent = [{}]", absent.join(", "));
        }
    }

    fn inputs(&self, text: &mut String) {
        for input in self.of(Role::Input) {
            let _ = write!(
                text,
                "\n[inputs.{}] # {}. An output instead? Move it to [outputs] with a value\ncolumn = {}\nunit = {}{}\n",
                input.name,
                input.reason(),
                quoted(&input.column),
                quoted(&input.unit),
                remark(input)
            );
            text.push_str(match (input.is_stepwise, input.is_of_a_drive) {
                (true, _) => "",
                (false, true) => "# hold = \"linear\" where it is measured, and goes on between samples\n",
                (false, false) => {
                    "hold = \"linear\" # it changes from sample to sample; without it where it is a command\n"
                }
            });
        }
    }

    /// Gains, an offset and a time constant of each output, from the size of what was measured.
    fn parameters(&self, text: &mut String) {
        text.push_str(
            "\n[parameters] # first values from the record; a range keeps a fit where it makes sense\n",
        );
        let inputs = self.of(Role::Input).count().max(1) as f64;
        for output in self.of(Role::Output) {
            let mut rest = output.mean;
            for input in self.of(Role::Input) {
                let gain = guess::slope(input, output) / inputs;
                rest -= gain * input.mean;
                let unit = ratio(&output.unit, &input.unit);
                let _ = writeln!(
                    text,
                    "gain_{}_{} = {{ unit = {}, value = {} }}",
                    output.name,
                    input.name,
                    quoted(&unit),
                    number(gain)
                );
            }
            let lag_s = output.correlation_s.max(self.time.step_s);
            let _ = writeln!(
                text,
                "rest_{0} = {{ unit = {1}, value = {2} }} # where it stays without inputs\n\
                 lag_{0} = {{ unit = \"s\", value = {3}, range = [{4}, {5}] }}",
                output.name,
                quoted(&output.unit),
                number(rest),
                number(lag_s),
                number(self.time.step_s / 2.0),
                number((self.time.length_s * 10.0).max(lag_s * 2.0))
            );
        }
    }

    fn states(&self, text: &mut String) {
        for output in self.of(Role::Output) {
            let gains: String = self
                .of(Role::Input)
                .map(|input| format!(" + gain_{}_{1}*{1}", output.name, input.name))
                .collect();
            let Column { name, column, unit, .. } = output;
            let _ = write!(
                text,
                "\n[states.{name}] # a lag of first order; write the equation that you believe in\nunit = {0}{2}\n\
                 start = \"{name}_measured\" # the first sample of that output\n\
                 derivative = \"(rest_{name}{gains} - {name})/lag_{name}\"\n\n\
                 [outputs.{name}_measured] # {3}\ncolumn = {1}\nunit = {0}\nvalue = \"{name}\"\n",
                quoted(unit),
                quoted(column),
                remark(output),
                output.reason()
            );
        }
    }

    fn suspects(&self, text: &mut String) {
        text.push_str(
            "\n# What may be missing. 'discrepancy suspects' lists the ready ones; a law of your own has add, multiply or replace.\n",
        );
        for input in self.of(Role::Input) {
            let name = &input.name;
            let step = self.time.step_s;
            let _ = write!(
                text,
                "\n[[suspects]]\nname = \"dead-time-of-{name}\"\nuse = \"actuator/dead-time\"\n\
                 place = \"{name}\"\nwith.u = \"{name}\"\n\
                 parameters.late = {{ unit = \"s\", value = [{}, {}], range = [0, {}] }}\n",
                number(step / 2.0),
                number(step * 5.0),
                number((self.time.length_s / 4.0).max(step * 10.0))
            );
            if input.largest > 0.0 {
                let _ = write!(
                    text,
                    "\n[[suspects]]\nname = \"saturation-of-{name}\"\nuse = \"actuator/saturation\"\nplace = \"{name}\"\n\
                     parameters.limit = {{ unit = {}, value = {}, range = [0, {}] }}\n",
                    quoted(&input.unit),
                    number(input.largest * 0.8),
                    number(input.largest)
                );
            }
        }
        for output in self.of(Role::Output) {
            let name = &output.name;
            let _ = write!(
                text,
                "\n[[suspects]]\nname = \"quadratic-loss-of-{name}\"\nuse = \"damping/quadratic\"\n\
                 place = \"{name}\"\ntimes = \"-1\"\nwith.v = \"{name}\"\n\
                 \n[[suspects]]\nname = \"drift-of-{name}\"\nuse = \"sensor/drift\"\n\
                 place = \"{name}_measured\"\ndecoy = true # carried to be rejected\n"
            );
        }
    }
}

fn remark(column: &Column) -> String {
    column.remark.map_or(String::new(), |remark| format!(" # {remark}"))
}

/// The unit of a gain.
fn ratio(over: &str, under: &str) -> String {
    let is_product = under.contains([' ', '/', '*', '^']);
    match (over, under) {
        _ if over == under => "1".into(),
        (_, "1") => over.into(),
        _ if is_product => format!("{over}/({under})"),
        _ => format!("{over}/{under}"),
    }
}

/// A number of four digits.
fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    // Adding 0 makes -0 one of the two zeros.
    format!("{:?}", rounded + 0.0)
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Search;
    use model::Model;

    fn of(text: &str) -> Result<(String, Model), String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let written = new_model(file.path(), Roles::default()).map_err(|error| error.to_string())?.text;
        let model = Model::parse(&written, Path::new("new.toml"))
            .unwrap_or_else(|error| panic!("{error}\n{written}"));
        Ok((written, model))
    }

    fn rows(row: impl Fn(f64) -> String) -> String {
        (0..40).map(|index| row(f64::from(index))).collect()
    }

    #[test]
    fn units_names_and_roles_come_from_the_columns() {
        let body = rows(|t| {
            format!("{t},{},{},{},5\n", f64::from(u8::from(t > 20.0)), 20.0 * (0.3 * t).sin(), t.sqrt())
        });
        let (text, model) = of(&format!("t_ms,u_V,drive_position_mm,force [kN],fixed_bar\n{body}")).unwrap();
        assert_eq!((model.record.time_column.as_str(), model.record.time_unit_s), ("t_ms", 1e-3));
        let inputs: Vec<_> =
            model.inputs.iter().map(|one| (one.name.as_str(), one.unit.text.as_str())).collect();
        assert_eq!(inputs, [("u", "V")], "{text}");
        let outputs: Vec<_> =
            model.outputs.iter().map(|one| (one.column.as_str(), one.unit.text.as_str())).collect();
        assert_eq!(outputs, [("drive_position_mm", "mm"), ("force [kN]", "kN")], "{text}");
        assert!(text.contains("Column fixed_bar is left out: it keeps one value"), "{text}");
        assert!(text.contains("[inputs.u] # guessed: "), "{text}");
    }

    #[test]
    fn a_row_of_units_under_the_head_is_read() {
        let body =
            rows(|t| format!("{},{},{}\n", 10.0 * t, f64::from(u8::from(t > 20.0)), 20.0 * (0.3 * t).sin()));
        let (text, model) = of(&format!("# bench\nclock,valve,stress\n[ms],[V],[N/mm2]\n{body}")).unwrap();
        assert_eq!((model.record.time_column.as_str(), model.record.time_unit_s), ("clock", 1e-3), "{text}");
        let units = (model.inputs[0].unit.text.as_str(), model.outputs[0].unit.text.as_str());
        assert_eq!((units, model.record.skip_lines), (("V", "N/mm^2"), 0), "{text}");
        let (text, model) = of(&format!("a title\nclock,valve,oven\nms,-,degC\n{body}")).unwrap();
        assert_eq!((model.outputs[0].unit.text.as_str(), model.record.skip_lines), ("K", 1), "{text}");
    }

    #[test]
    fn tables_of_other_countries_and_loggers_are_read() {
        let body = rows(|t| {
            format!(
                "{};{};{}\n",
                t.to_string().replace('.', ","),
                "1,5",
                (0.1 * t).sin().to_string().replace('.', ",")
            )
        });
        let (text, model) = of(&format!("# logger\nsome device;\nZeit;Ventil;T_C\n{body}")).unwrap();
        assert!(
            model.record.is_decimal_comma && model.record.separator == ";" && model.record.skip_lines == 2,
            "{text}"
        );
        assert!(text.contains("unit = \"K\" # degrees Celsius"), "{text}");
        let body = rows(|t| {
            format!(
                "{t}\t{}\t{}\n",
                if t == 3.0 { "NaN".into() } else { (t * 0.2).cos().to_string() },
                t % 7.0
            )
        });
        let (text, model) = of(&format!("time\tsin\tpi\n{body}")).unwrap();
        assert_eq!(model.record.absent, ["NaN"], "{text}");
    }

    #[test]
    fn a_byte_order_mark_quotes_and_times_of_a_calendar_are_read() {
        let second = |t: f64| format!("2026-11-27T23:59:{:02}.500Z", t as u32);
        let body = rows(|t| format!("{},{},{}\n", second(t), f64::from(u8::from(t > 20.0)), (0.2 * t).cos()));
        let text = format!("\u{feff}\"at\",\"valve, upper [V]\",\"level [mm]\"\n{body}");
        let (written, model) = of(&text).unwrap();
        assert_eq!((model.record.time_column.as_str(), model.record.is_calendar), ("at", true), "{written}");
        assert_eq!(model.inputs[0].column, "valve, upper [V]", "{written}");
        assert!(
            written.contains("unit = \"iso8601\"") && written.contains("range = [0.5, 390.0]"),
            "{written}"
        );
        // A column in seconds is taken before it.
        let body = rows(|t| format!("{};{t};{}\n", second(t), (0.2 * t).cos()));
        let (written, model) = of(&format!("\u{feff}# logger\nat;time_s;y\n{body}")).unwrap();
        let record = &model.record;
        assert_eq!((record.time_column.as_str(), record.is_calendar), ("time_s", false), "{written}");
        assert!(written.contains("Column at is left out: it holds no numbers"), "{written}");
        for (from, to, message) in [
            (
                "2026-11-27T23:59:07.500Z",
                "27.11.2026 23:59:07",
                ":9: at = '27.11.2026 23:59:07'; the rows above it have times such as",
            ),
            (
                "2026-11-27T23:59:07.500Z",
                "2026-11-27T23:59:07.500",
                ":9: at = '2026-11-27T23:59:07.500'; allowed is a time such as",
            ),
        ] {
            let found = of(&text.replace(from, to)).expect_err(to);
            assert!(found.contains(message), "{found}");
        }
    }

    #[test]
    fn columns_have_the_roles_that_are_asked_and_a_model_without_an_input_says_so() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let body = rows(|t| format!("{t},{},{},{}\n", (0.3 * t).sin(), t.sqrt(), (0.2 * t).cos()));
        std::fs::write(file.path(), format!("t_s,x_mm,p_bar_g,u_V\n{body}")).unwrap();
        let new = |inputs: &[&str], outputs: &[&str]| {
            let [inputs, outputs] = [inputs, outputs]
                .map(|names| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
            new_model(file.path(), Roles { inputs: &inputs, outputs: &outputs })
                .map_err(|why| why.to_string())
        };
        let names = |text: &str| {
            let model =
                Model::parse(text, Path::new("new.toml")).unwrap_or_else(|error| panic!("{error}\n{text}"));
            let held = |one: &model::Input| (one.column.clone(), one.hold == model::Hold::Linear);
            let inputs: Vec<_> = model.inputs.iter().map(held).collect();
            (inputs, model.outputs.iter().map(|one| one.column.clone()).collect::<Vec<_>>())
        };
        // A command keeps its value between samples; what is measured goes on.
        let guessed = new(&[], &[]).unwrap();
        assert!(guessed.has_input);
        assert_eq!(
            names(&guessed.text),
            (vec![("u_V".into(), false)], vec!["x_mm".into(), "p_bar_g".into()])
        );
        let asked = new(&["p_bar_g"], &["u_V"]).unwrap();
        assert!(asked.has_input && !asked.text.contains("No column was taken"), "{}", asked.text);
        assert_eq!(names(&asked.text), (vec![("p_bar_g".into(), true)], vec!["x_mm".into(), "u_V".into()]));
        let none = new(&[], &["u_V"]).unwrap();
        assert!(!none.has_input && none.text.contains("No column was taken as an input"), "{}", none.text);
        let refused = new(&["p_bar"], &[]).unwrap_err();
        let said = "p_bar is no column with numbers beside the time; there are x_mm, p_bar_g, u_V";
        assert!(refused.ends_with(said), "{refused}");
    }

    #[test]
    fn a_file_that_is_no_record_says_what_is_missing() {
        for (text, message) in [
            ("", "no line with names above rows of numbers"),
            ("1,2\n2,3\n3,4\n", "no line with names above rows of numbers"),
            ("a,b\n2,3\n1,4\n2,3\n", "no column grows from row to row"),
            ("t,b\n1,3\n2,3\n3,3\n", "beside the time t no column changes"),
        ] {
            let found = of(text).expect_err(text);
            assert!(found.contains(message), "{found}");
        }
    }

    /// A lag of 0.5 s behind a command in steps: the model that is written is the right one, and is fitted without an edit.
    #[test]
    fn what_is_written_is_fitted_as_it_stands() {
        let folder = tempfile::tempdir().unwrap();
        let [record, file] = ["heater.csv", "heater.toml"].map(|name| folder.path().join(name));
        let (mut y, mut text) = (1.0, "t_s,heater_V,y_mm\n".to_owned());
        for row in 0..400 {
            let u = f64::from(u8::from(row / 50 % 2 == 1)) * 4.0;
            text += &format!("{},{u},{}\n", f64::from(row) * 0.02, y + f64::from(row * row % 17 - 8) * 1e-3);
            y += (1.0 - (-0.04_f64).exp()) * (1.0 + 2.5 * u - y);
        }
        std::fs::write(&record, text).unwrap();
        std::fs::write(&file, new_model(&record, Roles::default()).unwrap().text).unwrap();
        let closed = crate::close(&file, (&[record], &[]), Search::MoreThanNoise, &mut |_| {}).unwrap();
        let value = |name: &str| closed.report.parameters.iter().find(|one| one.name == name).unwrap().value;
        assert!((value("lag_y") - 0.5).abs() < 0.01, "{}", value("lag_y"));
        assert!((value("gain_y_heater") - 2.5).abs() < 0.02, "{}", value("gain_y_heater"));
        assert_eq!(closed.report.verdict, crate::Verdict::NothingMissing, "{}", closed.report.headline);
    }

    #[test]
    fn a_gain_has_the_unit_of_output_over_input() {
        for (over, under, unit) in
            [("mm", "V", "mm/V"), ("V", "V", "1"), ("K", "1", "K"), ("1", "m/s", "1/(m/s)")]
        {
            assert_eq!(ratio(over, under), unit);
        }
        assert_eq!([number(0.0), number(-12345.6), number(1e-7)], ["0.0", "-12350.0", "1e-7"]);
    }
}
