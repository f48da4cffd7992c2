//! What a record looks like before anything is fitted: holes, spikes, constants, saturation; and beside the model at the values
//! of its file sign and exchanged columns.
//!
//! | found | where | what is done |
//! |---|---|---|
//! | hole: no row over more than 3.5 usual periods | a record of which nine tenths are even | nothing in it is compared |
//! | spike: one sample ten times the width of all others beyond them | each column | noted; of an output left out |
//! | one value all the time | outputs | noted |
//! | a run of equal values at the end of the range | each column | noted, with the key that says so |
//! | correlation of model and measurement below -0.7 | outputs | noted |
//! | another column that fits the model better | inputs and outputs | noted |
//! | model and measurement of sizes that differ by a factor above 30 | outputs | noted |
//!
//! The limits are choices. With the shipped models the foreign records have two notes: runs of the tanks' level at its ceiling,
//! and holes of up to 0.3 s in those of the cylinder.

use super::fit::Fitting;
use super::record::MeasuredRecord;
use super::report::significant;
use super::select::Fitted;
use crate::equal_runs::stuck;
use crate::stats::{mean_and_variance, median, order_statistic};
use model::{Model, Output, Program};

/// Usual periods without a row that are a hole.
pub(super) const HOLE: f64 = 3.5;
/// Usual periods without a row that are lost rows.
const LOST: f64 = 1.5;
/// Share of distances within a quarter of the usual one, from which on a record is even.
const EVEN: f64 = 0.9;
/// Widths by which a spike is beyond the middle of a column: all but a hundredth at either side, and but so many at least.
const FAR: f64 = 10.0;
const ASIDE: usize = 2;
/// Correlation below which a model runs against the record; above which a column is that of the model, and below which not.
const AGAINST: f64 = -0.7;
const SAME_SHAPE: f64 = 0.85;
const UNLIKE: f64 = 0.5;

/// Size of a model at the values of its file over that of the record, or the other way round, from which on a unit is doubted.
const SIZES: f64 = 30.0;
/// Residual rms over an output's standard deviation from which on a fit explains nearly nothing.
const NEARLY_ALL: f64 = 0.95;

/// A period is far from the rows' distance from this factor on: a wrong unit is off by sixty or a thousand, a wrong digit by ten.
const FAR_PERIOD: f64 = 5.0;

/// Median distance of rows.
pub(super) fn usual_period_s(time_s: &[f64]) -> f64 {
    let mut distances: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    median(&mut distances).unwrap_or(0.0)
}

/// A note where the period of the file is far from the distance of the rows: it asks for that, or the time has another unit.
pub(super) fn period(period_s: f64, time_s: &[f64]) -> Option<String> {
    let usual_s = usual_period_s(time_s);
    let ratio = period_s / usual_s;
    let what = if ratio > 1.0 {
        "rows between are passed over"
    } else {
        "samples between the rows are straight lines"
    };
    (ratio.is_finite() && ratio > 0.0 && ratio.max(1.0 / ratio) > FAR_PERIOD).then(|| {
        format!(
            "period_s under [record] is {period_s} s, {} times the usual distance of the rows, {} s: {what}; is the time in \
             another unit?",
            significant(ratio),
            significant(usual_s)
        )
    })
}

/// Rows that are missing in a record that is even otherwise.
pub(super) fn holes(time_s: &[f64], lines: &[u64], has_states: bool) -> Vec<String> {
    let usual_s = usual_period_s(time_s);
    let distances: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let even = distances.iter().filter(|distance| (*distance / usual_s - 1.0).abs() < 0.25).count();
    if (even as f64) < EVEN * distances.len() as f64 {
        return Vec::new();
    }
    let is_hole = |distance: &f64| *distance > HOLE * usual_s;
    let holes: Vec<usize> = (0..distances.len()).filter(|at| is_hole(&distances[*at])).collect();
    let lost = distances.iter().filter(|distance| **distance > LOST * usual_s && !is_hole(distance)).count();
    let mut notes = Vec::new();
    if let Some(longest) = holes.iter().copied().max_by(|a, b| distances[*a].total_cmp(&distances[*b])) {
        let others = match holes.len() - 1 {
            0 => String::new(),
            more => format!(", the longest of {} holes", more + 1),
        };
        let then = match has_states {
            true => ", and what follows starts from inputs that nobody knows: split the record there",
            false => "",
        };
        notes.push(format!(
            "lines {} to {}: no row over {} s, {:.0} usual periods{others}: nothing is compared there{then}",
            lines[longest],
            lines[longest + 1],
            significant(distances[longest]),
            distances[longest] / usual_s
        ));
    }
    if lost > 0 {
        notes.push(format!("one or two rows are missing at {lost} places"));
    }
    notes
}

/// Whether a time lies between known ones that are farther apart than this, or beyond them.
pub(super) fn is_in_hole(known_s: &[f64], at_s: f64, farthest_s: f64) -> bool {
    let after = known_s.partition_point(|known| *known < at_s);
    match (after.checked_sub(1).map(|before| known_s[before]), known_s.get(after)) {
        (_, Some(next)) if *next <= at_s => false,
        (Some(before), Some(next)) => next - before > farthest_s,
        (Some(end), None) => at_s - end > farthest_s,
        (None, Some(first)) => first - at_s > farthest_s,
        (None, None) => true,
    }
}

/// A column of a record, and the output that it is of.
pub(super) struct Column<'a> {
    pub(super) name: &'a str,
    pub(super) output: Option<&'a Output>,
}

/// A column that is stuck for more than half of its samples, from this row on.
pub(super) struct StuckFrom(pub(super) usize);

impl Column<'_> {
    /// What there is to say of its values; spikes are taken out of them.
    pub(super) fn check_values(
        &self,
        values: &mut [Option<f64>],
        lines: &[u64],
    ) -> Result<Vec<String>, StuckFrom> {
        let mut notes = self.spikes(values, lines);
        let present: Vec<f64> = values.iter().flatten().copied().collect();
        let least = present.iter().copied().fold(f64::INFINITY, f64::min);
        let most = present.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if least >= most {
            if self.output.is_some() {
                notes.push(format!(
                    "{} is {} all the time: it shows nothing of the equations",
                    self.name,
                    significant(least)
                ));
            }
            return Ok(notes);
        }
        let (runs, is_fatal) = stuck(values);
        let Some(first) = runs.first() else { return Ok(notes) };
        if is_fatal {
            return Err(StuckFrom(first.places.start));
        }
        let level = values[first.places.start].unwrap_or(f64::NAN);
        let end = match level {
            level if level >= most => Some("min"),
            level if level <= least => Some("max"),
            _ => None,
        };
        let (line, name, samples, count) = (lines[first.places.start], self.name, first.samples, runs.len());
        let what = match end.zip(self.output) {
            Some((function, output)) if !output.value.text.contains(&format!("{function}(")) => format!(
                "the end of its range? Then write value = \"{function}({}, {}[{}])\" under [outputs.{}], so that the model ends \
                 there, too",
                output.value.text,
                level * output.scale,
                output.unit.text,
                output.name
            ),
            _ => "stuck, or at the end of its range".to_owned(),
        };
        notes.push(format!(
            "line {line}: {name} keeps one value, {level}, over {samples} samples, {count} times in all: {what}"
        ));
        Ok(notes)
    }

    /// Takes out single samples that are far beyond all others.
    fn spikes(&self, values: &mut [Option<f64>], lines: &[u64]) -> Vec<String> {
        let mut present: Vec<f64> = values.iter().flatten().copied().collect();
        let aside = (present.len() / 100).max(ASIDE);
        let last = present.len().saturating_sub(1 + aside);
        let ends = [aside, last].map(|rank| order_statistic(&mut present, rank));
        let [Some(least), Some(most)] = ends else { return Vec::new() };
        let width = most - least;
        let beyond = |value: &Option<f64>| value.map_or(0.0, |value| (least - value).max(value - most));
        let is_calm = |row: Option<usize>| {
            row.and_then(|row| values.get(row)).is_none_or(|value| beyond(value) <= width)
        };
        let is_spike = |row: &usize| {
            beyond(&values[*row]) > FAR * width && is_calm(row.checked_sub(1)) && is_calm(Some(row + 1))
        };
        let rows: Vec<usize> =
            if width > 0.0 { (0..values.len()).filter(is_spike).collect() } else { Vec::new() };
        let Some((first, value)) = rows.first().and_then(|first| Some((*first, values[*first]?))) else {
            return Vec::new();
        };
        // A pulse of an input may be one sample long.
        if self.output.is_some() {
            rows.iter().for_each(|row| values[*row] = None);
        }
        vec![format!(
            "line {}: {} is {value}, far beyond all others ({} to {}), {} such samples in all{}: a mark of what is missing \
             belongs into absent under [record]",
            lines[first],
            self.name,
            significant(least),
            significant(most),
            rows.len(),
            if self.output.is_some() { ", left out" } else { "" }
        )]
    }
}

/// Adds to each record what it looks like beside the model at the values of its file; nothing where that cannot be simulated.
pub(super) fn beside_model(model: &Model, records: &mut [MeasuredRecord]) {
    for record in records {
        let notes = of_record(model, record);
        record.notes.extend(notes);
    }
}

fn of_record(model: &Model, record: &MeasuredRecord) -> Vec<String> {
    let Some(predicted) = simulated(model, record) else { return Vec::new() };
    let mut notes = Vec::new();
    for (output, of_model) in model.outputs.iter().enumerate() {
        let agreement = correlation(&predicted[output], &record.outputs[output]);
        let name = &of_model.name;
        notes.extend(sizes(model, output, &predicted[output], &record.outputs[output]));
        if agreement < AGAINST {
            notes.push(format!(
                "before the fit the model moves against {name} (correlation {agreement:.2}): is a sign wrong, in the record \
                 or in the equations?"
            ));
            continue;
        }
        if agreement > UNLIKE {
            continue;
        }
        let others = model.outputs.iter().enumerate().filter(|(other, _)| *other != output);
        let like =
            others.map(|(other, of)| (correlation(&predicted[output], &record.outputs[other]), &of.column));
        let inputs = model.inputs.iter().enumerate().filter(|(_, input)| input.rate_of.is_none());
        let exchanged = inputs.filter_map(|(input, of)| {
            let exchanged = exchange(record, input, output)?;
            let predicted = simulated(model, &exchanged)?;
            Some((correlation(&predicted[output], &exchanged.outputs[output]), &of.column))
        });
        let best = like.chain(exchanged).max_by(|one, other| one.0.total_cmp(&other.0));
        if let Some((best, column)) = best.filter(|(best, _)| *best > SAME_SHAPE) {
            notes.push(format!(
                "before the fit the model of {name} is not like column {} (correlation {agreement:.2}), and with {column} in its \
                 place it is ({best:.2}): are columns exchanged?",
                of_model.column
            ));
        }
    }
    notes
}

/// A note where a model at the values of its file is of another size than the record.
fn sizes(model: &Model, output: usize, predicted: &[f64], measured: &[Option<f64>]) -> Option<String> {
    let pairs =
        predicted.iter().zip(measured).filter_map(|(predicted, measured)| Some([*predicted, (*measured)?]));
    let squares = pairs.fold([0.0, 0.0], |[x, y], [predicted, measured]| {
        [x + predicted * predicted, y + measured * measured]
    });
    let ratio = (squares[0] / squares[1]).sqrt();
    let is_other = ratio > 0.0 && ratio.is_finite() && ratio.max(1.0 / ratio) > SIZES;
    is_other.then(|| {
        format!(
            "before the fit the model gives {} times what the record has of {}: {}?",
            significant(ratio),
            model.outputs[output].name,
            are_right(model, output)
        )
    })
}

/// What to look at where a model does not come near an output.
fn are_right(model: &Model, output: usize) -> String {
    let inputs = model.inputs.iter().filter(|input| input.rate_of.is_none());
    let inputs: Vec<String> =
        inputs.map(|input| format!("{} in {}", input.column, input.unit.text)).collect();
    let of_inputs = match inputs.is_empty() {
        true => String::new(),
        false => format!(", of the inputs ({})", inputs.join(", ")),
    };
    let output = &model.outputs[output];
    format!(
        "are units, scales and signs right, of column {} in {}{of_inputs} and of the numbers of the model",
        output.column, output.unit.text
    )
}

/// What the model says at its first values, output by output.
fn simulated(model: &Model, record: &MeasuredRecord) -> Option<Vec<Vec<f64>>> {
    let program = Program::new(model, &[]).ok()?;
    let fitting = Fitting::new(model, program, std::slice::from_ref(record), &[]);
    let predicted = fitting.residuals(&fitting.start()).ok()?.pop()?;
    Some(predicted.into_iter().map(|[_, predicted]| predicted).collect())
}

/// The record with an input's column as the output's, and the other way round; `None` where they are not sampled alike.
fn exchange(record: &MeasuredRecord, input: usize, output: usize) -> Option<MeasuredRecord> {
    if record.rows.len() != record.sampled_s.len() || record.thinning.is_some() {
        return None;
    }
    let measured: Vec<f64> = record.outputs[output].iter().copied().collect::<Option<_>>()?;
    let mut exchanged = record.clone();
    exchanged.outputs[output] = record.inputs[input].iter().copied().map(Some).collect();
    exchanged.inputs[input] = measured;
    Some(exchanged)
}

/// Correlation of what is said and what was measured; 0 where one of them does not move.
fn correlation(predicted: &[f64], measured: &[Option<f64>]) -> f64 {
    let pairs =
        predicted.iter().zip(measured).filter_map(|(predicted, measured)| Some((*predicted, (*measured)?)));
    let (predicted, measured): (Vec<f64>, Vec<f64>) =
        pairs.filter(|(predicted, _)| predicted.is_finite()).unzip();
    if predicted.len() < 2 {
        return 0.0;
    }
    let [(m, v), (n, w)] = [mean_and_variance(&predicted), mean_and_variance(&measured)];
    let products: f64 = predicted.iter().zip(&measured).map(|(x, y)| (x - m) * (y - n)).sum();
    let scale = (v * w).sqrt() * (predicted.len() as f64 - 1.0);
    if scale > 0.0 { products / scale } else { 0.0 }
}

/// Outputs whose residual under the fitted model is larger than about their mean, or nearly as large.
pub(super) fn beyond_reach(fitted: &Fitted<'_>) -> Vec<String> {
    let fitting = &fitted.fitting;
    let of_output = |(output, rms_si): (usize, f64)| {
        let of_model = &fitting.model.outputs[output];
        let measured =
            fitting.records.iter().flat_map(|record| record.outputs[output].iter().flatten().copied());
        let measured: Vec<f64> = measured.collect();
        let signal_si = mean_and_variance(&measured).1.sqrt();
        let unit = &of_model.unit;
        let [rms, signal] = [rms_si, signal_si].map(|value| significant(value / unit.factor));
        let much = if rms_si > signal_si { "more" } else { "nearly as much" };
        let than = if rms_si > signal_si { "than" } else { "as" };
        (signal_si > 0.0 && rms_si > NEARLY_ALL * signal_si).then(|| {
            format!(
                "the fitted model leaves {much} of {} ({rms} {} rms) {than} its mean would ({signal}), and explains nothing of \
                 it: {}?",
                of_model.name,
                unit.text,
                are_right(fitting.model, output)
            )
        })
    };
    fitted.rms_si().into_iter().enumerate().filter_map(of_output).collect()
}
