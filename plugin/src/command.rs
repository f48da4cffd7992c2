//! The commands `check-library` and `probe-library`.

use crate::child::TrialRunner;
pub use crate::child::run as probe_library;
use crate::{Description, PluginError, describe};
use protocol::exit::Exit;
use settings::parameters::Parameter;
use std::fmt;
use std::io::{self, Write};
use std::path::Path;

/// Prints what the library offers.
///
/// # Errors
/// [`PluginError`] for a library that is refused, or without a program to try it with.
pub fn check_library(library: &Path) -> Result<Exit, PluginError> {
    let description = TrialRunner::find()
        .map_err(|reason| PluginError { library: library.to_owned(), reason })
        .and_then(|runner| describe(&runner, library))?;
    // A closed pipe is the reader's wish.
    let _ = write!(io::stdout(), "{description}");
    Ok(Exit::Good)
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let controls = self.controls.name();
        writeln!(f, "name      {}\nabout     {}\ncontrols  {controls}\n", self.name, self.about)?;
        let row = |p: &Parameter| {
            let [least, most, default] = [p.least, p.most, p.default].map(|value| value.to_string());
            [p.name.to_string(), p.unit.to_string(), least, most, default, p.meaning.to_string()]
        };
        let head = ["parameter", "unit", "least", "most", "default", "meaning"].map(str::to_owned);
        let rows: Vec<_> = [head].into_iter().chain(self.parameters.iter().map(row)).collect();
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: [usize; 5] = std::array::from_fn(width);
        for row in &rows {
            for (cell, width) in row.iter().zip(widths) {
                write!(f, "{cell:width$}  ")?;
            }
            writeln!(f, "{}", row[5])?;
        }
        Ok(())
    }
}
