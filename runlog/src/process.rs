//! The processes of a run and the names of their files.

use crate::axis::Axis;
use crate::run_folder::SUMMARY_JSON;

/// How a log of distributions ends, behind the name of its process.
pub const HLOG_END: &str = ".hlog";
/// How a table of the stages of every cycle ends, behind the name of its process.
pub const TIMING_END: &str = "-timing.csv";

/// A process of a run, by what the names of its files begin with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    /// The program that simulates the rig.
    Emulator,
    /// A controller of both axes.
    Controller,
    /// A controller of one axis.
    ControllerOf(Axis),
}

impl Process {
    /// All that may leave files in a folder; a run has either [`Process::Controller`] or those of one axis.
    pub const ALL: [Self; 4] =
        [Self::Emulator, Self::Controller, Self::ControllerOf(Axis::Drive), Self::ControllerOf(Axis::Load)];

    /// The controllers of a run, with a process for each axis or one for both.
    #[must_use]
    pub const fn controllers(one_for_each_axis: bool) -> &'static [Self] {
        const OF_AN_AXIS: [Process; 2] =
            [Process::ControllerOf(Axis::Drive), Process::ControllerOf(Axis::Load)];
        if one_for_each_axis { &OF_AN_AXIS } else { &[Self::Controller] }
    }

    /// `emulator`, `controller`, `controller-drive` or `controller-load`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Emulator => "emulator",
            Self::Controller => "controller",
            Self::ControllerOf(Axis::Drive) => "controller-drive",
            Self::ControllerOf(Axis::Load) => "controller-load",
        }
    }

    /// The process of a name; `None` for the name of none.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|process| process.name() == name)
    }

    /// File of what it counted: `summary.json` of the emulator, `controller*.json` of a controller.
    #[must_use]
    pub fn report(self) -> String {
        match self {
            Self::Emulator => SUMMARY_JSON.to_owned(),
            controller => format!("{}.json", controller.name()),
        }
    }

    /// Log of its distributions.
    #[must_use]
    pub fn hlog(self) -> String {
        format!("{}{HLOG_END}", self.name())
    }

    /// Table of the stages of its cycles.
    #[must_use]
    pub fn timing(self) -> String {
        format!("{}{TIMING_END}", self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_after_their_process() {
        assert_eq!(
            Process::ALL.map(Process::hlog),
            ["emulator.hlog", "controller.hlog", "controller-drive.hlog", "controller-load.hlog"]
        );
        assert_eq!(
            Process::ALL.map(Process::report),
            ["summary.json", "controller.json", "controller-drive.json", "controller-load.json"]
        );
        assert_eq!(Process::Emulator.timing(), "emulator-timing.csv");
        assert_eq!(Process::ALL.map(|process| Process::of_name(process.name())), Process::ALL.map(Some));
        assert_eq!(Process::of_name("controller-of-somebody"), None);
        let of_both = [true, false].map(Process::controllers);
        assert_eq!(of_both.concat(), [&Process::ALL[2..], &Process::ALL[1..2]].concat());
    }
}
