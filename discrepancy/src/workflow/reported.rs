//! The part of a report that later steps read back from its file.

use crate::report::{DeclaredSuspect, InputFiles, NamedEffect, Quantity, Report, TableTerm};
use plant::Axis;

/// Effects and parameters of a report.
#[derive(Clone, Debug, serde::Deserialize)]
pub struct Reported {
    /// Effects, the best first.
    pub named: Vec<NamedEffect>,
    /// Effects that are too small to be named.
    #[serde(default)]
    pub small: Vec<NamedEffect>,
    /// Parameters that were off.
    pub parameters: Vec<Quantity>,
    /// Parameters that the model moved by less.
    #[serde(default, rename = "carried")]
    pub(crate) insignificant: Vec<Quantity>,
    pub inputs: InputFiles,
    /// Suspects beside the catalogue.
    #[serde(default)]
    pub suspects: Vec<DeclaredSuspect>,
    /// Term outside the catalogue.
    #[serde(default)]
    pub outside: Option<ReportedOutside>,
}

impl From<&Report> for Reported {
    fn from(report: &Report) -> Self {
        Reported {
            named: report.named.clone(),
            small: report.small.clone(),
            parameters: report.parameters.clone(),
            insignificant: report.insignificant.clone(),
            inputs: report.inputs.clone(),
            suspects: report.suspects.clone(),
            outside: report
                .outside
                .as_ref()
                .map(|outside| ReportedOutside { tables: outside.tables.clone() }),
        }
    }
}

/// Tables of a term outside the catalogue.
#[derive(Clone, Debug, Default, serde::Deserialize)]
pub struct ReportedOutside {
    /// Terms that were added.
    #[serde(default)]
    pub tables: Vec<TableTerm>,
}

impl Reported {
    /// Which axes the training records showed.
    pub fn measured(&self) -> [bool; 2] {
        Axis::ALL.map(|axis| self.inputs.axes.iter().any(|name| name == axis.name()))
    }
}
