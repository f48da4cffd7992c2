//! Shipped experiments with shipped or other programs, rehearsed, and their figures as `bench` computes them from a run's folder.

use crate::rehearsed::{self, Run};
use crate::{Trial, TrialError};
use axis_control::axis::AxisRecord;
use axis_control::setup::{FileArguments, Inputs};
use figures::record::Record;
use figures::series::{Series, Span};
use figures::tables_read::{StateSpan, Table};
use figures::{self, Figures, position};
use plant::{Axis, Scene};
use rehearsal::Rehearsed;
use std::error::Error;
use std::path::Path;

/// An experiment with the programs that it is tried with.
pub struct Case {
    pub inputs: Inputs,
    pub scene: Scene,
}

/// What a case is made of: names of the shipped files.
#[derive(Clone, Copy, Default)]
pub struct Made<'a> {
    pub experiment: &'a str,
    pub drive: Option<&'a str>,
    pub load: Option<&'a str>,
    /// Numbers in place of the programs', such as `drive.algorithm.gain_per_s=30`.
    pub set: &'a [String],
}

impl Case {
    pub fn new(made: &Made) -> Result<Self, Box<dyn Error>> {
        let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../controller");
        let program = |name: Option<&str>| Some(room.join(format!("programs/{}.toml", name?)));
        let files = FileArguments {
            rig: room.join("../plant/rig.toml"),
            experiment: room.join(format!("experiments/{}.toml", made.experiment)),
            drive_program: program(made.drive),
            load_program: program(made.load),
            set: made.set.to_vec(),
            ..FileArguments::default()
        };
        let inputs = Inputs::read(&files)?;
        let scene = Scene::from_toml(&inputs.experiment_toml, made.experiment, &inputs.rig)?;
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

fn time_s(row: &Rehearsed) -> f64 {
    row.cycle.cycle as f64 * 1e-3
}

fn measured(run: &Run) -> Table {
    let mut table = Table::default();
    let mut put = |name, of: fn(&Rehearsed) -> f64| {
        table.set_numbers(name, run.rows.iter().map(|row| (time_s(row), of(row))).collect());
    };
    put("drive_valve", |row| row.cycle.valve[0]);
    put("drive_position_m", |row| row.cycle.readings[0].position.value);
    put("drive_force_N", |row| row.cycle.readings[0].force.value);
    put("load_valve", |row| row.cycle.valve[1]);
    put("load_position_m", |row| row.cycle.readings[1].position.value);
    put("load_force_N", |row| row.cycle.readings[1].force.value);
    table
}

fn controller<'a>(rows: impl Iterator<Item = (f64, &'a AxisRecord)> + Clone) -> Table {
    let mut table = Table::default();
    let mut put = |name, of: fn(&AxisRecord) -> Option<f64>| {
        let column: Series = rows.clone().filter_map(|(time_s, row)| Some((time_s, of(row)?))).collect();
        table.set_numbers(name, column);
    };
    put("set_position_m", |row| Some(row.set_position?.position_m));
    put("set_velocity_m_per_s", |row| Some(row.set_position?.velocity_m_per_s));
    put("set_force_N", |row| Some(row.set_force?.force_n));
    put("position_m", |row| Some(row.position_m));
    put("velocity_m_per_s", |row| Some(row.velocity_m_per_s));
    put("force_N", |row| Some(row.force_n));
    put("opening", |row| Some(row.opening));
    put("moving", |row| Some(f64::from(u8::from(row.moving()))));
    table.set_states("main_chain", states(rows.clone().map(|(time_s, row)| (time_s, row.main.name()))));
    table.set_states("force_chain", states(rows.map(|(time_s, row)| (time_s, row.force_chain.name()))));
    table
}

/// A state lasts until the row of the next one; the last one until its last row.
fn states(rows: impl Iterator<Item = (f64, &'static str)>) -> Vec<StateSpan> {
    let mut spans: Vec<StateSpan> = Vec::new();
    for (time_s, state) in rows {
        if let Some(last) = spans.last_mut() {
            last.span.to_s = time_s;
            if last.state == state {
                continue;
            }
        }
        spans.push(StateSpan { state: state.into(), span: Span { from_s: time_s, to_s: time_s } });
    }
    spans
}
