//! Shipped experiments with shipped or other programs, rehearsed, and their figures as `bench` computes them from a run's folder.

use crate::rehearsed::{self, Run};
use crate::{Trial, TrialError};
use axis_control::axis::AxisRecord;
use axis_control::setup::{FileArguments, Inputs};
use figures::record::Record;
use figures::series::Series;
use figures::tables_read::{Table, enter};
use figures::{self, Figures, position};
use plant::{Axis, Scene};
use rehearsal::RehearsalRow;
use runlog::cycle_tables::MEASURED;
use std::error::Error;
use std::path::Path;

/// An experiment with the programs that it is tried with.
pub struct Case {
    pub inputs: Inputs,
    pub scene: Scene,
}

/// Specification of a case: names of the shipped files.
#[derive(Clone, Copy, Default)]
pub struct CaseSpec<'a> {
    pub experiment: &'a str,
    pub drive: Option<&'a str>,
    pub load: Option<&'a str>,
    /// Numbers in place of the programs', such as `drive.algorithm.gain_per_s=30`.
    pub set: &'a [String],
}

impl Case {
    pub fn new(spec: &CaseSpec) -> Result<Self, Box<dyn Error>> {
        let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../controller");
        let program = |name: Option<&str>| Some(room.join(format!("programs/{}.toml", name?)));
        let files = FileArguments {
            rig: room.join("../plant/rig.toml"),
            experiment: room.join(format!("experiments/{}.toml", spec.experiment)),
            drive_program: program(spec.drive),
            load_program: program(spec.load),
            set: spec.set.to_vec(),
            ..FileArguments::default()
        };
        let inputs = Inputs::read(&files)?;
        let scene = Scene::from_toml(&inputs.experiment_toml, spec.experiment, &inputs.rig)?;
        Ok(Self { inputs, scene })
    }

    pub fn run(&self, trial: &Trial) -> Result<Run, TrialError> {
        rehearsed::rehearse(&self.inputs, &self.scene, trial)
    }
}

pub fn record(run: &Run) -> Record {
    let rows = |axis: Axis| {
        run.rows.iter().filter_map(move |row| Some((time_s(row), row.axes[axis.index()].as_ref()?)))
    };
    Record {
        drive: controller(rows(Axis::Drive)),
        load: controller(rows(Axis::Load)),
        measured: measured(run),
        ..Record::default()
    }
}

/// Its figures; those of the drive's error, which a controller tells itself, taken from the tables too.
pub fn figures(run: &Run) -> impl Fn(&str) -> Option<f64> + use<> {
    let record = record(run);
    let figures: Figures = figures::of(&record);
    let reported = [position::error_dynamic_m(&record), position::error_static_m(&record)];
    move |name| match name {
        "position_error_dynamic_m" => reported[0],
        "position_error_static_m" => reported[1],
        name => figures.get(name),
    }
}

fn time_s(row: &RehearsalRow) -> f64 {
    row.cycle.cycle as f64 * 1e-3
}

fn measured(run: &Run) -> Table {
    let mut columns = vec![Series::default(); MEASURED.len()];
    for row in &run.rows {
        for (column, value) in columns.iter_mut().zip(row.cycle.measured()) {
            column.push(time_s(row), value);
        }
    }
    let mut table = Table::default();
    MEASURED.iter().zip(columns).for_each(|(name, column)| table.set_numbers(name, column));
    table
}

fn controller<'a>(rows: impl Iterator<Item = (f64, &'a AxisRecord)> + Clone) -> Table {
    let mut table = Table::default();
    for column in AxisRecord::NUMBERS {
        let samples = rows.clone().filter_map(|(time_s, row)| Some((time_s, (column.value)(row)?)));
        table.set_numbers(column.name, samples.collect());
    }
    for column in AxisRecord::CHAINS {
        let mut spans = Vec::new();
        rows.clone().for_each(|(time_s, row)| enter(&mut spans, (column.state)(row), time_s));
        table.set_states(column.name, spans);
    }
    table
}
