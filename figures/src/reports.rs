//! Reports of the controllers of a run: `controller.json` (one process for both axes), or
//! `controller-drive.json` and `controller-load.json` (a process each).
//!
//! The rig removes the reports of an earlier run when it starts, and not the tables, which a controller that started before
//! it may be writing. So the reports say which tables are of this run: those of the axes that they name.

use crate::SummaryError;
use runlog::Axis;
use runlog::controller_report::SplitControllerReport;
use runlog::process::Process;
use runlog::run_folder::read_json;
use serde_json::{Map, Value};
use std::path::Path;

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ControllerReports {
    /// No controller left one.
    None,
    /// One process for both axes.
    Both(Box<SplitControllerReport>),
    /// A process for each axis, those that left one.
    Each(Vec<(&'static str, SplitControllerReport)>),
}

pub(crate) fn read(folder: &Path) -> Result<ControllerReports, SummaryError> {
    let read = |name: &str| {
        let path = folder.join(name);
        path.exists().then(|| read_json(&path)).transpose()
    };
    if let Some(both) = read(&Process::Controller.report())? {
        return Ok(ControllerReports::Both(Box::new(both)));
    }
    let mut each = Vec::new();
    for axis in Axis::ALL {
        let reported = read(&Process::ControllerOf(axis).report())?;
        each.extend(reported.map(|reported| (axis.name(), reported)));
    }
    Ok(if each.is_empty() { ControllerReports::None } else { ControllerReports::Each(each) })
}

impl ControllerReports {
    /// What they say of each axis that they name.
    pub(crate) fn axes(&self) -> Map<String, Value> {
        match self {
            Self::None => Map::new(),
            Self::Both(reported) => reported.axes.clone(),
            Self::Each(each) => each.iter().flat_map(|(_, reported)| reported.axes.clone()).collect(),
        }
    }
}
