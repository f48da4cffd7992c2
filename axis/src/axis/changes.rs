//! Parameters of the program that change at planned times of the experiment, and go back before the next one.

use crate::chains::main::Phase;
use crate::program::Program;

/// A parameter that changes at a time of the experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlannedChange {
    /// When, s from the experiment's start.
    pub(crate) at_s: f64,
    /// Index among the variables of the program.
    pub(crate) place: usize,
    /// In the variable's unit, within its range.
    pub(crate) value: f64,
}

pub(super) struct Changes {
    planned: Vec<PlannedChange>,
    before: Vec<(usize, f64)>,
    done: usize,
}

impl Changes {
    pub(super) fn new(mut planned: Vec<PlannedChange>, program: &Program) -> Self {
        planned.sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
        let before = planned.iter().map(|change| (change.place, program.values()[change.place])).collect();
        Self { planned, before, done: 0 }
    }

    /// Makes what is planned for the time that the experiment has reached; what was changed goes back before it begins.
    pub(super) fn follow(&mut self, phase: Phase, program: &mut Program) {
        match phase {
            Phase::Experiment { elapsed_s } => {
                while let Some(change) = self.planned.get(self.done).filter(|change| change.at_s <= elapsed_s)
                {
                    // The value was checked when the experiment was read.
                    let _ = program.set(change.place, change.value);
                    self.done += 1;
                }
            }
            Phase::Approach { .. } => self.take_back(program),
            _ => {}
        }
    }

    pub(super) fn take_back(&mut self, program: &mut Program) {
        if std::mem::take(&mut self.done) > 0 {
            for (place, value) in self.before.iter().rev() {
                let _ = program.set(*place, *value);
            }
        }
    }
}
