//! What a run's folder holds of the run itself: the tables, and what the experiment asked for.
//!
//! Sensors and valves come from `measurement.csv`, set-points and states of the chains from `controller-drive.csv` and
//! `controller-load.csv`, what only a simulation knows from `truth.csv`. A table that is not there is empty, and so are the
//! figures that would need it.

use crate::SummaryError;
use crate::experiment::Experiment;
use crate::reports;
use crate::series::{Series, Span};
use crate::tables_read::{self, StateSpan, Table};
use runlog::Axis;
use runlog::cycle_tables::MEASURED;
use runlog::run_folder::{MEASUREMENT_CSV, TRUTH_CSV, controller_csv};
use std::path::Path;

/// Numbers of a controller's table.
pub(crate) const CONTROLLER_NUMBERS: &[&str] = &[
    "set_position_m",
    "set_velocity_m_per_s",
    "set_force_N",
    "position_m",
    "velocity_m_per_s",
    "force_N",
    "wanted_velocity_m_per_s",
    "opening",
    "enabled",
    "moving",
];
/// Chains of a controller's table.
pub const CHAINS: &[&str] = &["main_chain", "force_chain", "matching_chain", "emergency_stop_chain"];
/// Columns of `truth.csv` that figures are made of.
pub const TRUE: &[&str] = &[
    "drive_position_m",
    "drive_rod_velocity_m_per_s",
    "drive_stored_air_a_J",
    "drive_stored_air_b_J",
    "load_stored_air_a_J",
    "load_stored_air_b_J",
    "supply_pressure_Pa",
    "check_valves_shut",
];
/// Laws of the load's set-point that follow from the motion: the names of `axis_control::set_point::force::KINDS` in their
/// order. This crate does not know those; a test of `campaign` compares both lists.
pub const STATE_DEPENDENT: &[&str] = &["spring", "damper", "mass", "dry-friction"];

/// The tables of a run; one that is not there is empty.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// `controller-drive.csv`.
    pub drive: Table,
    /// `controller-load.csv`.
    pub load: Table,
    /// Sensors and valves.
    pub measured: Table,
    /// What only a simulation knows.
    pub truth: Table,
    /// The experiment file; empty without one.
    pub experiment: Experiment,
}

/// Reads the tables of `folder`; of the controllers' those of the axes that the reports name, since another may be of an
/// earlier run.
pub fn read(folder: &Path, experiment: Experiment) -> Result<Record, SummaryError> {
    let table = |name: &str, numbers: &[&'static str], states: &[&'static str]| {
        let path = folder.join(name);
        if path.exists() { tables_read::read(&path, numbers, states) } else { Ok(Table::default()) }
    };
    let axes = reports::read(folder)?.axes();
    let of_axis = |axis: Axis| {
        let file = axes.contains_key(axis.name()).then(|| controller_csv(axis));
        file.map_or_else(|| Ok(Table::default()), |name| table(&name, CONTROLLER_NUMBERS, CHAINS))
    };
    Ok(Record {
        drive: of_axis(Axis::Drive)?,
        load: of_axis(Axis::Load)?,
        measured: table(MEASUREMENT_CSV, &MEASURED, &[])?,
        truth: table(TRUTH_CSV, TRUE, &[])?,
        experiment,
    })
}

impl Record {
    /// The table whose main chain is reported: the drive's, else the load's.
    pub fn leader(&self) -> &Table {
        if self.drive.states("main_chain").is_empty() { &self.load } else { &self.drive }
    }

    /// The stretches of the experiment itself, one for each repetition.
    pub fn experiments(&self) -> Vec<Span> {
        self.leader().in_state("main_chain", &["experiment"])
    }

    /// The run cut into its repetitions, the way to each included. One that the end of the run cut short is left out unless
    /// there is no other; a run without recorded states is one repetition.
    pub fn repetitions(&self) -> Vec<Span> {
        let states = self.leader().states("main_chain");
        let is_last = |entry: &StateSpan| entry.state == "final-settling";
        let begins_anew = |pair: &&[StateSpan]| is_last(&pair[0]) && pair[1].state == "initial-positioning";
        let mut repetitions: Vec<Span> = Vec::new();
        let mut from_s = f64::NEG_INFINITY;
        for to_s in states.windows(2).filter(begins_anew).map(|pair| pair[1].span.from_s) {
            repetitions.push(Span { from_s, to_s });
            from_s = to_s;
        }
        if repetitions.is_empty() || states.iter().any(|entry| is_last(entry) && entry.span.from_s >= from_s)
        {
            repetitions.push(Span { from_s, to_s: f64::INFINITY });
        }
        repetitions
    }

    /// The part of the record inside `span`.
    #[must_use]
    pub fn within(&self, span: &Span) -> Self {
        Self {
            drive: self.drive.within(span),
            load: self.load.within(span),
            measured: self.measured.within(span),
            truth: self.truth.within(span),
            experiment: self.experiment.clone(),
        }
    }

    /// The drive's set-point less its position, as its controller saw it.
    pub fn position_error(&self) -> Series {
        self.drive.numbers("set_position_m").minus(self.drive.numbers("position_m"))
    }

    /// The stretches of the experiment in which the drive's set-point moves.
    pub fn moves(&self) -> Vec<Span> {
        let moving = self.drive.numbers("moving").stretches(|flag| flag != 0.0);
        common(&moving, &self.experiments())
    }

    /// The stretches in which the drive's set-point rests at one place, in the experiment and in the waiting around it.
    pub fn rests(&self) -> Vec<Span> {
        let with_settling = ["settling", "experiment", "final-settling"];
        let experiments = self.leader().in_state("main_chain", &with_settling);
        let resting = common(&self.drive.numbers("moving").stretches(|flag| flag == 0.0), &experiments);
        let places = self.drive.numbers("set_position_m");
        resting.iter().flat_map(|span| places.within(span).constant_stretches()).collect()
    }

    /// Whether the load's set-point follows from the motion: a spring, a damper, a mass, dry friction.
    pub(crate) fn load_depends_on_state(&self) -> bool {
        self.experiment.load_laws().any(|law| STATE_DEPENDENT.contains(&law))
    }

    /// Whether the load's controller did anything: wanted a force, or opened its valve.
    pub fn load_acts(&self) -> bool {
        !self.load.numbers("set_force_N").is_empty()
            || self.load.numbers("opening").values().iter().any(|opening| *opening != 0.0)
    }
}

/// What two lists of stretches have in common.
pub fn common(these: &[Span], those: &[Span]) -> Vec<Span> {
    these.iter().flat_map(|one| those.iter().filter_map(|other| one.common(other))).collect()
}

/// A jump of a set-point between two values at which it stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Step {
    /// First instant of the new value, s.
    pub at_s: f64,
    /// Value before it, in the set-point's unit.
    pub before_value: f64,
    /// Value after it, in the set-point's unit.
    pub after_value: f64,
    /// End of the new value, s.
    pub until_s: f64,
}

impl Step {
    /// Value after the step less value before it.
    pub(crate) fn height_value(&self) -> f64 {
        self.after_value - self.before_value
    }
}

/// For how long a set-point stays before and after what counts as a step.
const STAYS_S: f64 = 0.05;

/// The largest jump of `set_point` within `spans` of at least `least_value`; the first of equals. The values that it leaves
/// and takes last at least 50 ms each, so that ramps, sines and loads that follow the motion have none.
pub(crate) fn largest_step(set_point: &Series, spans: &[Span], least_value: f64) -> Option<Step> {
    let stretches = set_point.constant_stretches();
    let long = |span: &Span| span.length_s() > STAYS_S;
    let neighbours = stretches.windows(2).filter(|pair| long(&pair[0]) && long(&pair[1]));
    let steps = neighbours.filter_map(|pair| {
        let (before, after) = (&pair[0], &pair[1]);
        let step = Step {
            at_s: after.from_s,
            before_value: set_point.at(before.from_s)?,
            after_value: set_point.at(after.from_s)?,
            until_s: after.to_s,
        };
        let near = after.from_s - before.to_s < 1.5 * set_point.period_s();
        let inside = spans.iter().any(|span| span.holds(step.at_s));
        (near && inside && step.height_value().abs() >= least_value).then_some(step)
    });
    steps.reduce(
        |largest, step| {
            if step.height_value().abs() > largest.height_value().abs() { step } else { largest }
        },
    )
}

/// Records put together by tests.
#[doc(hidden)]
pub mod made {
    use super::*;

    /// A quantity each millisecond.
    pub fn each_ms(from_s: f64, to_s: f64, law: impl Fn(f64) -> f64) -> Series {
        let place = |time_s: f64| (time_s * 1e3).round() as u32;
        (place(from_s)..place(to_s))
            .map(|ms| f64::from(ms) * 1e-3)
            .map(|time_s| (time_s, law(time_s)))
            .collect()
    }

    /// A chain by its states and when each begins; the last entry ends the record.
    pub fn chain(states: &[(&str, f64)]) -> Vec<StateSpan> {
        let pairs = states.windows(2);
        pairs
            .map(|pair| StateSpan {
                state: pair[0].0.into(),
                span: Span { from_s: pair[0].1, to_s: pair[1].1 },
            })
            .collect()
    }

    /// A table of columns by their names.
    pub fn table(columns: &[(&'static str, &Series)]) -> Table {
        let mut table = Table::default();
        for (name, column) in columns {
            table.set_numbers(name, (*column).clone());
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::made::{chain, each_ms, table};
    use super::*;

    #[test]
    fn a_step_is_a_jump_between_values_that_stay() {
        let spans = [Span { from_s: 0.0, to_s: 2.0 }];
        let up = |time: f64| if time < 0.5 { 100.0 } else { 300.0 };
        let step = largest_step(&each_ms(0.0, 1.0, up), &spans, 5.0).unwrap();
        assert_eq!((step.at_s, step.before_value, step.after_value), (0.5, 100.0, 300.0));
        assert_eq!(largest_step(&each_ms(0.0, 1.0, up), &spans, 500.0), None, "too small");
        assert_eq!(largest_step(&each_ms(0.0, 1.0, up), &[], 5.0), None, "outside the experiment");
        let ramp = |time: f64| 1000.0 * time.clamp(0.4, 0.6);
        assert_eq!(largest_step(&each_ms(0.0, 1.0, ramp), &spans, 0.1), None, "a ramp");
    }

    #[test]
    fn moves_and_rests_are_those_of_the_experiment() {
        let moving = each_ms(0.0, 4.0, |time| f64::from((1.0..2.0).contains(&time) || time < 0.2));
        let place = each_ms(0.0, 4.0, |time| if time < 3.0 { 0.1 } else { 0.2 });
        let mut drive = table(&[("moving", &moving), ("set_position_m", &place)]);
        let states =
            [("initial-positioning", 0.0), ("settling", 0.5), ("experiment", 0.8), ("done", 3.5), ("", 4.0)];
        drive.set_states("main_chain", chain(&states));
        let record = Record { drive, ..Record::default() };
        let rounded = |spans: Vec<Span>| -> Vec<_> {
            spans.iter().map(|span| ((span.from_s * 1e3).round(), (span.to_s * 1e3).round())).collect()
        };
        assert_eq!(rounded(record.moves()), [(1000.0, 2000.0)]);
        assert_eq!(rounded(record.rests()), [(500.0, 1000.0), (2000.0, 3000.0), (3000.0, 3500.0)]);
    }

    #[test]
    fn a_run_is_cut_where_another_repetition_follows_and_one_cut_short_does_not_count() {
        let repetition =
            [("initial-positioning", 0.0), ("settling", 0.1), ("experiment", 0.2), ("final-settling", 0.8)];
        let states = |times: f64, end_s: f64| {
            let mut states: Vec<_> = (0..times as u32)
                .flat_map(|number| repetition.map(|(state, at_s)| (state, at_s + f64::from(number))))
                .take_while(|(_, at_s)| *at_s < end_s)
                .collect();
            states.push(("", end_s));
            let mut drive = table(&[("position_m", &each_ms(0.0, end_s, |time| time))]);
            drive.set_states("main_chain", chain(&states));
            Record { drive, ..Record::default() }
        };
        let first_ms = |record: &Record| -> Vec<_> {
            let firsts = record.repetitions().into_iter().map(|span| record.within(&span));
            firsts.map(|part| (part.drive.numbers("position_m").values()[0] * 1e3).round()).collect()
        };
        assert_eq!(first_ms(&states(1.0, 1.0)), [0.0]);
        assert_eq!(first_ms(&states(3.0, 3.0)), [0.0, 1000.0, 2000.0]);
        assert_eq!(first_ms(&states(3.0, 2.5)), [0.0, 1000.0], "the third was cut short");
        assert_eq!(first_ms(&states(1.0, 0.5)), [0.0], "but there is no other");
        let record = states(3.0, 2.5);
        let spans: Vec<_> =
            record.repetitions().iter().flat_map(|span| record.within(span).experiments()).collect();
        assert_eq!(spans, record.experiments()[..2]);
    }

    #[test]
    fn a_load_that_follows_the_motion_is_known_by_its_law() {
        let record = |text: &str| Record { experiment: text.parse().unwrap(), ..Record::default() };
        assert!(
            record("[[load.set-point]]\nlaw = \"constant\"\n[[load.set-point]]\nlaw = \"spring\"")
                .load_depends_on_state()
        );
        assert!(!record("[[load.set-point]]\nlaw = \"step\"").load_depends_on_state());
        assert!(!record("").load_depends_on_state());
    }
}
