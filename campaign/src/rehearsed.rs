//! A run as a rehearsal: plant and controllers in this process, without files.
//!
//! Values of columns are rounded as in the files, so that the figures equal those of a run's folder to the bit; a test compares
//! them.

use crate::condition::{Condition, ConditionError};
use crate::factor::Value;
use crate::inputs::CampaignInputs;
use crate::outcome::{EndState, Outcome};
use axis_control::axis::{AxisController, AxisRecord};
use axis_control::setup::{Inputs, Mode};
use figures::record::{Record, TRUE};
use figures::series::Series;
use figures::tables_read::{StateSpan, Table, enter};
use figures::thresholds::{self, ByRepetition, FigureValue};
use figures::top::POSITIONS;
use figures::{self, position, top};
use plant::{Axis, CycleRecord, Truth};
use protocol::frames::MainChainState;
use protocol::periods::CYCLE_S;
use rehearsal::{Rehearsal, RehearsalParts, RehearsalRow};
use runlog::cycle_tables::MEASURED;
use std::collections::BTreeMap;

/// Rehearses a run of at most `seconds` of the rig's time.
///
/// # Errors
/// [`ConditionError`] when experiment, programs and variables are inconsistent: an error in the campaign, not a result.
pub(crate) fn rehearse(
    condition: &Condition<'_>,
    campaign_inputs: &CampaignInputs,
    run: u64,
    seconds: f64,
) -> Result<Outcome, ConditionError> {
    let refused = |message: String| ConditionError { run, message };
    let inputs = Inputs::of_sources(
        &condition.nominal.nominal,
        (&condition.experiment.path, &condition.experiment_toml),
        |axis, written| condition.program(campaign_inputs, axis, written),
        &condition.set,
    )
    .map_err(|error| refused(error.to_string()))?;
    let mode = Mode { partner_needed: true, real_time: false, forever: false };
    let controllers = Axis::ALL.into_iter().map(|axis| inputs.controller(axis, mode));
    let controllers = controllers
        .collect::<Result<_, _>>()
        .map_err(|error: axis_control::setup::InputError| refused(error.to_string()))?;
    let parts =
        RehearsalParts { rig: &condition.rig, scene: &condition.scene, seed: condition.seed, controllers };
    let mut rehearsal = Rehearsal::new(parts).map_err(|error| refused(error.to_string()))?;
    let cycles = (seconds * 1000.0).round() as u64;
    let mut columns = Columns::new();
    while rehearsal.cycles() < cycles && !rehearsal.ended() {
        columns.push(&rehearsal.step(|_, _| {}));
    }
    let record = columns.record(&inputs);
    outcome(&rehearsal, &record, &inputs).map_err(refused)
}

fn outcome(rehearsal: &Rehearsal, record: &Record, inputs: &Inputs) -> Result<Outcome, String> {
    let controllers = || rehearsal.node().controllers();
    let is_stopped = |controller: &&AxisController| {
        matches!(controller.state(), MainChainState::Aborted | MainChainState::Fault)
    };
    // The axis with the fault before one that only followed it.
    let stopped =
        controllers().filter(is_stopped).max_by_key(|controller| controller.state() == MainChainState::Fault);
    let broken = rehearsal.encode_error().map(|error| format!("the simulated rig broke: {error}"));
    let (ended, because) = match stopped {
        _ if broken.is_some() => (EndState::Failed, broken.unwrap_or_default()),
        Some(axis) => (EndState::Stopped, format!("{}: {}", axis.axis.name(), axis.cause())),
        None if rehearsal.node().done() => (EndState::Done, String::new()),
        None => (EndState::TimeOver, "the longest time was over before the experiment was done".to_owned()),
    };
    let drive =
        controllers().find(|controller| controller.axis == Axis::Drive).map(|controller| &controller.figures);
    let top = [
        drive.and_then(|figures| figures.dynamic_m()).or_else(|| position::error_dynamic_m(record)),
        drive.and_then(|figures| figures.static_m()).or_else(|| position::error_static_m(record)),
    ];
    let computed = figures::of(record);
    let known = POSITIONS.into_iter().zip(top).filter_map(|(name, value)| Some((name, value?)));
    let figures: BTreeMap<_, _> =
        known.chain(computed.iter()).map(|(name, value)| (name.to_owned(), Value::Number(value))).collect();
    let each = computed.by_repetition().map(|(name, values)| (name.to_owned(), values.to_vec())).collect();
    let passed = passed(inputs, &figures, &each, ended)?;
    let simulated_s = rehearsal.cycles() as f64 * CYCLE_S;
    Ok(Outcome { ended, because, simulated_s, passed, figures })
}

/// Whether the experiment's bounds are kept. A rehearsal has no lost frames, no missed cycles and no latencies.
fn passed(
    inputs: &Inputs,
    figures: &BTreeMap<String, Value>,
    by_repetition: &ByRepetition,
    ended: EndState,
) -> Result<Option<bool>, String> {
    let bounds = &inputs.experiment.passed;
    if bounds.is_empty() {
        return Ok(None);
    }
    let found = |key: &str| {
        let is_fault = || top::find(key).is_some_and(|figure| figure.kind == top::Kind::Fault);
        let measured = figures.get(key).and_then(Value::number);
        measured.or_else(|| is_fault().then_some(0.0)).map(FigureValue::Number)
    };
    let judged = thresholds::judge(bounds, found, by_repetition).map_err(|error| error.to_string())?;
    Ok(Some(ended == EndState::Done && judged.values().all(|bound| bound.kept)))
}

struct Columns {
    axes: [AxisColumns; 2],
    measured: Vec<Series>,
    truth: Vec<(usize, &'static str, Series)>,
}

#[derive(Default)]
struct AxisColumns {
    numbers: [Series; AxisRecord::NUMBERS.len()],
    states: [Vec<StateSpan>; AxisRecord::CHAINS.len()],
}

impl Columns {
    fn new() -> Self {
        let place = |name: &str| Truth::COLUMNS.iter().position(|column| *column == name);
        let truth = TRUE.iter().filter_map(|name| Some((place(name)?, *name, Series::default())));
        Self {
            axes: Default::default(),
            measured: vec![Series::default(); MEASURED.len()],
            truth: truth.collect(),
        }
    }

    fn push(&mut self, rehearsed: &RehearsalRow) {
        let CycleRecord { cycle, truth, .. } = &rehearsed.cycle;
        // The double next to the decimal number that a table has.
        let time_s = *cycle as f64 / 1000.0;
        for (column, value) in self.measured.iter_mut().zip(rehearsed.cycle.measured()) {
            column.push(time_s, value);
        }
        let values = truth.values();
        for (place, _, column) in &mut self.truth {
            column.push(time_s, values[*place]);
        }
        for (columns, row) in self.axes.iter_mut().zip(&rehearsed.axes) {
            if let Some(row) = row {
                columns.push(row, time_s);
            }
        }
    }

    fn record(self, inputs: &Inputs) -> Record {
        let [drive, load] = self.axes.map(AxisColumns::table);
        let mut measured = Table::default();
        MEASURED.iter().zip(self.measured).for_each(|(name, column)| measured.set_numbers(name, column));
        let mut truth = Table::default();
        self.truth.into_iter().for_each(|(_, name, column)| truth.set_numbers(name, column));
        // Cannot fail: the experiment's reader has parsed it.
        let experiment = inputs.experiment_toml.parse().unwrap_or_default();
        Record { drive, load, measured, truth, experiment }
    }
}

impl AxisColumns {
    fn push(&mut self, row: &AxisRecord, time_s: f64) {
        for (series, column) in self.numbers.iter_mut().zip(&AxisRecord::NUMBERS) {
            if let Some(value) = (column.value)(row) {
                series.push(time_s, value);
            }
        }
        for (spans, column) in self.states.iter_mut().zip(&AxisRecord::CHAINS) {
            enter(spans, (column.state)(row), time_s);
        }
    }

    fn table(self) -> Table {
        let mut table = Table::default();
        let numbers = AxisRecord::NUMBERS.into_iter().zip(self.numbers);
        numbers.for_each(|(column, series)| table.set_numbers(column.name, series));
        let states = AxisRecord::CHAINS.into_iter().zip(self.states);
        states.for_each(|(column, spans)| table.set_states(column.name, spans));
        table
    }
}

#[cfg(test)]
mod tests {
    use axis_control::set_point::force::KINDS;
    use figures::record::STATE_DEPENDENT;

    #[test]
    fn figures_know_every_load_of_the_set_points() {
        let loads: Vec<_> = KINDS.iter().map(|kind| kind.name).collect();
        assert_eq!(loads, STATE_DEPENDENT, "a load that is not listed has no load_law_error figures");
    }
}
