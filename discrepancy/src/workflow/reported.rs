//! What steps after a report need of it, read back from its file.

use crate::report::{InputFiles, NamedEffect, Quantity, Report, TableTerm};
use plant::Axis;

/// What a report says of effects and parameters, as other steps need it.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct Reported {
    /// Effects, the best first.
    pub named: Vec<NamedEffect>,
    /// Parameters that were off.
    pub parameters: Vec<Quantity>,
    /// Parameters that the model moved by less.
    #[serde(default)]
    pub carried: Vec<Quantity>,
    /// Files.
    pub inputs: InputFiles,
    /// What the catalogue does not have.
    #[serde(default)]
    pub outside: Option<ReportedOutside>,
}

impl From<&Report> for Reported {
    fn from(report: &Report) -> Self {
        Reported {
            named: report.named.clone(),
            parameters: report.parameters.clone(),
            carried: report.carried.clone(),
            inputs: report.inputs.clone(),
            outside: report
                .outside
                .as_ref()
                .map(|outside| ReportedOutside { tables: outside.tables.clone() }),
        }
    }
}

/// The tables of what the catalogue does not have.
#[derive(Clone, Debug, Default, serde::Deserialize)]
pub struct ReportedOutside {
    /// Terms that were added.
    #[serde(default)]
    pub tables: Vec<TableTerm>,
}

impl Reported {
    /// Which axes the training records showed.
    #[must_use]
    pub fn measured(&self) -> [bool; 2] {
        Axis::ALL.map(|axis| self.inputs.axes.iter().any(|name| name == axis.name()))
    }
}
