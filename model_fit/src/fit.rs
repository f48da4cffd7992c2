//! The fit of a model to records: its output error, weighed by the noise of each output, by the one Gauss-Newton.
//!
//! ```text
//!   loss = sum over outputs of  rss / (noise^2 + model_error^2)        where the noise is known
//!                               n ln(rss / n + model_error^2)          where it is estimated
//!        + sum over priors of   ((p - value) / tolerance)^2
//! ```
//! A step that is refused is shortened by damping [Levenberg 1944]: the fraction f adds 1/f - 1 to the scaled normal matrix. The
//! normal equations are kept for each block of time, so that a fit without a block needs no other simulation.
//!
//! Sources: Ljung, System Identification, 2nd edition, 7.2 (output error), 15.3 (concentrated likelihood); Björck 1996, 9.

use super::cuts::RowBlocks;
use super::normal::{Normal, solved};
use super::record::MeasuredRecord;
use crate::estimator::{Convergence, Estimator, Iterate, Options, Step};
use model::{Direction, Failure, Inputs, Model, Parameter, Program, Simulator, Start, Unit};
use nalgebra::{DMatrix, DVector};

/// Numbers that a record hardly tells apart make a narrow valley, which bends: between no damping and one that ends all motion
/// along it there are some decades.
pub(super) const OPTIONS: Options = Options {
    steps: 80,
    absolute_tolerance: 0.1,
    relative_tolerance: 0.0,
    fractions: &[1.0, 0.999_999, 0.999_99, 0.9999, 0.999, 0.99, 0.9, 0.6, 0.25, 0.1, 0.03, 0.01, 1e-3, 1e-4],
};
/// What a sample adds to the fall of the loss that counts: a change of the residual by half of it, relatively.
const TOLERANCE_PER_SAMPLE: f64 = 1e-4;
/// Share of the predicted reduction of the loss from which a step is taken without another.
const SUFFICIENT_REDUCTION_RATIO: f64 = 0.75;
/// Noise of an output is at least this share of its size: a fit without a residual has no likelihood.
const LEAST_NOISE: f64 = 1e-9;

/// Shortest time constant of a library over the period of the samples.
const FASTEST: f64 = 0.25;

/// Steps that a simulation within a fit may take: so many times those at the start of the fit, and so many for each sample. A
/// suspect that makes the equations blow up in some corner of its range would cost minutes there.
const STEPS_OF_START: usize = 10;
const STEPS_OF_SAMPLE: usize = 30;

/// A fitted number by its indices: of the parameter or state, then of the record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnknownId {
    /// A parameter, of all records.
    Shared(usize),
    /// A parameter of one record.
    PerRecord(usize, usize),
    /// The start of a state in one record.
    Start(usize, usize),
}

/// A number that is fitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unknown {
    pub(crate) id: UnknownId,
    pub(crate) start_si: f64,
    pub(crate) range_si: [f64; 2],
    /// What is known of it: value and standard deviation.
    pub(crate) prior_si: Option<[f64; 2]>,
}

/// A model with some suspects, and records.
#[derive(Clone)]
pub(crate) struct Fitting<'a> {
    pub(crate) model: &'a Model,
    pub(crate) program: Program,
    pub(crate) records: &'a [MeasuredRecord],
    pub(crate) unknowns: Vec<Unknown>,
    /// Rows of each record that count.
    in_score: Vec<std::ops::Range<usize>>,
    /// Values of what is not fitted: parameters of each record, and starts of its states.
    parameters_si: Vec<Vec<f64>>,
    starts_si: Vec<Vec<f64>>,
    memories_si: Vec<f64>,
    /// Least variance of each output.
    floor: Vec<f64>,
    /// Steps that the simulation of a record may take.
    most_steps: usize,
}

/// Residuals and predictions of each output of a record.
pub(crate) type OutputSeries = Vec<[Vec<f64>; 2]>;

#[derive(Clone, Debug)]
pub(crate) struct Point {
    pub(crate) values_si: Vec<f64>,
    pub(crate) loss: f64,
    /// Sum of squares of each output.
    pub(crate) squares: Vec<f64>,
    is_at_bound: bool,
    /// Steps of its longest simulation.
    pub(crate) steps: usize,
}

impl Iterate for Point {
    fn loss(&self) -> f64 {
        self.loss
    }

    fn is_at_bound(&self) -> bool {
        self.is_at_bound
    }
}

/// Least time constant that samples show, s. A shorter one changes nothing that is measured, and makes the equations stiff.
fn fastest_s(records: &[MeasuredRecord]) -> f64 {
    let period_s = |record: &MeasuredRecord| {
        let length_s = record.sampled_s[record.sampled_s.len() - 1] - record.sampled_s[0];
        length_s / (record.sampled_s.len() - 1) as f64
    };
    FASTEST * records.iter().map(period_s).fold(f64::INFINITY, f64::min)
}

/// Values of all parameters before a fit, with those that are known of a record.
fn known(model: &Model, record: &MeasuredRecord) -> Vec<f64> {
    // Reading a record refuses one that is not listed.
    let known = |one: &Parameter| one.known_si(&record.file).unwrap_or(one.values_si[0]);
    model.parameters.iter().map(known).collect()
}

impl<'a> Fitting<'a> {
    /// Everything that the model leaves open, with these suspects.
    pub(crate) fn new(
        model: &'a Model,
        program: Program,
        records: &'a [MeasuredRecord],
        suspects: &[usize],
    ) -> Self {
        let mut unknowns = Vec::new();
        for index in model.parameters_of(suspects).filter(|index| !model.parameters[*index].is_fixed) {
            let parameter = &model.parameters[index];
            let mut range_si = parameter.range_si;
            if parameter.is_bound_by_samples {
                range_si[0] = range_si[0].max(fastest_s(records)).min(range_si[1]);
            }
            let unknown = |id| Unknown {
                id,
                start_si: parameter.values_si[0].clamp(range_si[0], range_si[1]),
                range_si,
                prior_si: parameter.tolerance_si.map(|tolerance| [parameter.values_si[0], tolerance]),
            };
            if parameter.is_per_record {
                unknowns
                    .extend((0..records.len()).map(|record| unknown(UnknownId::PerRecord(index, record))));
            } else {
                unknowns.push(unknown(UnknownId::Shared(index)));
            }
        }
        for state in program.states() {
            if let Start::Fitted { guess_si, range_si } = model.states[*state].start {
                let unknown = |record| Unknown {
                    id: UnknownId::Start(*state, record),
                    start_si: guess_si,
                    range_si,
                    prior_si: None,
                };
                unknowns.extend((0..records.len()).map(unknown));
            }
        }
        let first = |record: &MeasuredRecord, start: Start| match start {
            Start::Known { value_si } | Start::Fitted { guess_si: value_si, .. } => value_si,
            Start::Record { output } => {
                record.outputs[output].iter().flatten().next().copied().unwrap_or(0.0)
            }
            Start::Input { input } => record.inputs[input].first().copied().unwrap_or(0.0),
        };
        let starts_si = records
            .iter()
            .map(|record| model.states.iter().map(|state| first(record, state.start)).collect())
            .collect();
        let floor = (0..model.outputs.len()).map(|output| {
            let values: Vec<f64> =
                records.iter().flat_map(|record| record.outputs[output].iter().flatten().copied()).collect();
            let size = values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64;
            let declared = model.outputs[output].model_error_si;
            declared * declared + (LEAST_NOISE * LEAST_NOISE * size).max(f64::MIN_POSITIVE)
        });
        Self {
            model,
            program,
            records,
            unknowns,
            in_score: records.iter().map(|record| 0..record.time_s.len()).collect(),
            parameters_si: records.iter().map(|record| known(model, record)).collect(),
            starts_si,
            memories_si: model.memories.iter().map(|memory| memory.start_si).collect(),
            floor: floor.collect(),
            most_steps: usize::MAX,
        }
    }

    /// The same on other records: what all records share is that of a fit, what each has is left open. Only so many rows count.
    pub(crate) fn frozen(
        fitted: &Fitting<'a>,
        point: &Point,
        records: &'a [MeasuredRecord],
        suspects: &[usize],
        rows: usize,
    ) -> Self {
        let mut other = Self::new(fitted.model, fitted.program.clone(), records, suspects);
        for (unknown, value) in fitted.unknowns.iter().zip(&point.values_si) {
            if let UnknownId::Shared(index) = unknown.id {
                other.parameters_si.iter_mut().for_each(|parameters| parameters[index] = *value);
            }
        }
        other.unknowns.retain(|unknown| !matches!(unknown.id, UnknownId::Shared(_)));
        for (range, record) in other.in_score.iter_mut().zip(records) {
            *range = 0..rows.min(record.time_s.len());
        }
        other
    }

    /// The same with all rows.
    pub(crate) fn with_all_rows(self) -> Self {
        Self { in_score: self.records.iter().map(|record| 0..record.time_s.len()).collect(), ..self }
    }

    /// Rows that count of each record.
    pub(crate) fn rows(&self, record: usize) -> std::ops::Range<usize> {
        self.in_score[record].clone()
    }

    /// Measured samples of an output that count.
    pub(crate) fn count(&self, output: usize) -> f64 {
        let measured = |(record, rows): (&MeasuredRecord, &std::ops::Range<usize>)| {
            record.outputs[output][rows.clone()].iter().flatten().count()
        };
        self.records.iter().zip(&self.in_score).map(measured).sum::<usize>() as f64
    }

    /// Variance of an output's residual as the loss takes it.
    pub(crate) fn variance(&self, output: usize, squares: f64) -> f64 {
        match self.model.outputs[output].noise_si {
            Some(noise_si) => noise_si * noise_si + self.floor[output],
            None => squares / self.count(output).max(1.0) + self.floor[output],
        }
    }

    fn loss(&self, values_si: &[f64], squares: &[f64]) -> f64 {
        let outputs: f64 = squares
            .iter()
            .enumerate()
            .map(|(output, squares)| match self.model.outputs[output].noise_si {
                Some(_) => squares / self.variance(output, *squares),
                None => self.count(output) * self.variance(output, *squares).ln(),
            })
            .sum();
        let priors = self.unknowns.iter().zip(values_si);
        let priors = priors.filter_map(|(unknown, value)| {
            unknown.prior_si.map(|[expected, tolerance]| ((value - expected) / tolerance).powi(2))
        });
        outputs + priors.sum::<f64>()
    }

    /// Simulates a record; `sink` gets row, output, value and derivatives by the unknowns of that record. Returns its steps.
    pub(super) fn simulate(
        &self,
        record: usize,
        values_si: &[f64],
        with_slopes: bool,
        mut sink: impl FnMut(usize, usize, f64, &[f64]),
    ) -> Result<usize, Failure> {
        let mut parameters = self.parameters_si[record].clone();
        let mut starts = self.starts_si[record].clone();
        let mut directions = Vec::new();
        for place in self.of_record(record) {
            let value = values_si[place];
            directions.push(match self.unknowns[place].id {
                UnknownId::Shared(index) | UnknownId::PerRecord(index, _) => {
                    parameters[index] = value;
                    Direction::Parameter(index)
                }
                UnknownId::Start(state, _) => {
                    starts[state] = value;
                    Direction::Start(state)
                }
            });
        }
        let measured = &self.records[record];
        let end = measured.samples_of(self.in_score[record].end);
        let inputs = Inputs { time_s: &measured.sampled_s[..end], samples_si: &measured.inputs };
        let directions = if with_slopes { directions.as_slice() } else { &[] };
        let mut simulator = Simulator::new(&self.program, directions).within(self.most_steps);
        let values = [parameters.as_slice(), &starts, &self.memories_si];
        let Some(filter) = &measured.thinning else {
            let mut place = 0;
            simulator.run(&inputs, values, |sample, output, value, slopes| {
                while measured.rows.get(place).is_some_and(|row| *row < sample) {
                    place += 1;
                }
                if measured.rows.get(place) == Some(&sample) {
                    sink(place, output, value, slopes);
                }
            })?;
            return Ok(simulator.steps);
        };
        // Values and derivatives of all samples go through the filter of what was measured.
        let width = 1 + directions.len();
        let mut columns = vec![Vec::with_capacity(end); measured.outputs.len() * width];
        simulator.run(&inputs, values, |_, output, value, slopes| {
            let all = std::iter::once(&value).chain(slopes).zip(&mut columns[output * width..]);
            all.for_each(|(value, column)| column.push(*value));
        })?;
        let columns: Vec<Vec<f64>> = columns.iter().map(|column| filter.zero_phase(column)).collect();
        let mut slopes = vec![0.0; directions.len()];
        for (place, sample) in measured.rows.iter().enumerate() {
            for (output, columns) in columns.chunks(width).enumerate() {
                for (slope, column) in slopes.iter_mut().zip(&columns[1..]) {
                    *slope = column[*sample];
                }
                sink(place, output, columns[0][*sample], &slopes);
            }
        }
        Ok(simulator.steps)
    }

    pub(crate) fn at(&self, values_si: Vec<f64>) -> Result<Point, Failure> {
        let mut squares = vec![0.0; self.model.outputs.len()];
        let mut steps = 0;
        for record in 0..self.records.len() {
            let (outputs, rows) = (&self.records[record].outputs, self.rows(record));
            let of_record = self.simulate(record, &values_si, false, |row, output, value, _| {
                if let Some(measured) = outputs[output][row].filter(|_| rows.contains(&row)) {
                    squares[output] += (measured - value).powi(2);
                }
            })?;
            steps = steps.max(of_record);
        }
        let loss = self.loss(&values_si, &squares);
        let mut ends = self.unknowns.iter().zip(&values_si);
        let is_at_bound = ends.any(|(unknown, value)| unknown.range_si.contains(value));
        Ok(Point { values_si, loss, squares, is_at_bound, steps })
    }

    pub(crate) fn start(&self) -> Vec<f64> {
        self.unknowns.iter().map(|unknown| unknown.start_si).collect()
    }

    /// Unknowns that a record is simulated with, in the order of its directions.
    pub(super) fn of_record(&self, record: usize) -> Vec<usize> {
        let is_mine = |place: &usize| match self.unknowns[*place].id {
            UnknownId::Shared(_) => true,
            UnknownId::PerRecord(_, of) | UnknownId::Start(_, of) => of == record,
        };
        (0..self.unknowns.len()).filter(is_mine).collect()
    }

    /// What people call a number.
    pub(crate) fn name_of(&self, unknown: &Unknown) -> String {
        let record = |record: usize| &self.records[record].name;
        let Model { parameters, states, .. } = self.model;
        match unknown.id {
            UnknownId::Shared(index) => parameters[index].name.clone(),
            UnknownId::PerRecord(index, of) => format!("{} of {}", parameters[index].name, record(of)),
            UnknownId::Start(state, of) => format!("start of {} in {}", states[state].name, record(of)),
        }
    }

    /// The term or suspect that it belongs to.
    pub(crate) fn suspect_of(&self, unknown: &Unknown) -> Option<usize> {
        match unknown.id {
            UnknownId::Shared(index) | UnknownId::PerRecord(index, _) => self.model.parameters[index].suspect,
            UnknownId::Start(state, _) => self.model.states[state].suspect,
        }
    }

    /// Unit in which the model file writes an unknown.
    pub(crate) fn unit_of(&self, unknown: &Unknown) -> &'a Unit {
        match unknown.id {
            UnknownId::Shared(index) | UnknownId::PerRecord(index, _) => &self.model.parameters[index].unit,
            UnknownId::Start(state, _) => &self.model.states[state].unit,
        }
    }

    /// Normal equations of each block of a partition and output; the last are those of rows that judge nothing.
    pub(crate) fn normals(&self, values_si: &[f64], cut: &RowBlocks) -> Result<Vec<Vec<Normal>>, Failure> {
        let count = self.model.outputs.len();
        let mut blocks = vec![vec![Normal::zero(self.unknowns.len()); count]; cut.blocks + 1];
        for record in 0..self.records.len() {
            let (measured, rows) = (&self.records[record].outputs, self.rows(record));
            let mine = self.of_record(record);
            self.simulate(record, values_si, true, |row, output, value, slope| {
                let Some(measured) = measured[output][row].filter(|_| rows.contains(&row)) else { return };
                let normal = &mut blocks[cut.block_of[record][row]][output];
                let residual = measured - value;
                normal.squares += residual * residual;
                for (i, place) in mine.iter().enumerate() {
                    normal.right_side[*place] += slope[i] * residual;
                    for (j, other) in mine.iter().enumerate().take(i + 1) {
                        normal.matrix[(*place, *other)] += slope[i] * slope[j];
                    }
                }
            })?;
        }
        for normal in blocks.iter_mut().flatten() {
            let upper = normal.matrix.transpose();
            let diagonal = DMatrix::from_diagonal(&normal.matrix.diagonal());
            normal.matrix += upper - diagonal;
        }
        Ok(blocks)
    }

    /// Normal equations of all blocks with their weights, and the priors.
    pub(crate) fn sum(&self, normals: &[Vec<Normal>], point: &Point) -> Normal {
        let mut sum = Normal::zero(self.unknowns.len());
        for block in normals {
            for (output, normal) in block.iter().enumerate() {
                sum.add(normal, 1.0 / self.variance(output, point.squares[output]));
            }
        }
        for (place, unknown) in self.unknowns.iter().enumerate() {
            if let Some([expected, tolerance]) = unknown.prior_si {
                sum.matrix[(place, place)] += tolerance.powi(-2);
                sum.right_side[place] += (expected - point.values_si[place]) / tolerance.powi(2);
            }
        }
        sum
    }

    /// The same where no simulation takes many more steps than at this point.
    pub(super) fn near(&self, point: &Point) -> Self {
        let samples = self.records.iter().map(|record| record.sampled_s.len()).max().unwrap_or(0);
        let most_steps = STEPS_OF_START * point.steps + STEPS_OF_SAMPLE * samples;
        Fitting { most_steps: self.most_steps.min(most_steps), ..self.clone() }
    }

    /// Fits from a starting point within the ranges in at most so many steps.
    pub(crate) fn fit(&self, start: Vec<f64>, steps: usize) -> Result<(Point, Convergence), Failure> {
        let start = self.at(start)?;
        let here = self.near(&start);
        let samples: f64 = (0..self.model.outputs.len()).map(|output| self.count(output)).sum();
        let absolute_tolerance = OPTIONS.absolute_tolerance + TOLERANCE_PER_SAMPLE * samples;
        let options = Options { steps, absolute_tolerance, ..OPTIONS };
        let cut = self.blocks_in_time();
        Ok(Estimator::new(options).descend(start, |estimator, point| {
            let Ok(normals) = here.normals(&point.values_si, &cut) else { return Step::Impossible };
            let sum = here.sum(&normals, point);
            let predicted_reduction = sum.right_side.dot(&here.step(&sum, &point.values_si, 0.0));
            match here.best_step(estimator, point, &sum, predicted_reduction) {
                Some(best) => Step::Accepted(best),
                None => Step::Refused { predicted_reduction },
            }
        }))
    }

    /// The damped step with the least loss: shorter ones are tried until one is worse than the one before. One that has most of
    /// the predicted reduction is taken as it is [Conn, Gould, Toint 2000, Trust-Region Methods, 6.1].
    fn best_step(
        &self,
        estimator: &mut Estimator,
        point: &Point,
        sum: &Normal,
        predicted_reduction: f64,
    ) -> Option<Point> {
        let mut best: Option<Point> = None;
        for fraction in OPTIONS.fractions {
            let step = self.step(sum, &point.values_si, 1.0 / fraction - 1.0);
            let moved = point.values_si.iter().zip(&step).zip(&self.unknowns);
            let moved = moved.map(|((value, step), unknown)| {
                (value + step).clamp(unknown.range_si[0], unknown.range_si[1])
            });
            estimator.count();
            let tried = self.at(moved.collect()).ok();
            let least = best.as_ref().map_or(point.loss, |best| best.loss);
            match tried.filter(|tried| tried.loss < least) {
                Some(better)
                    if point.loss - better.loss >= SUFFICIENT_REDUCTION_RATIO * predicted_reduction =>
                {
                    return Some(better);
                }
                Some(better) => best = Some(better),
                None if best.is_some() => break,
                None => {}
            }
        }
        best
    }

    /// The step of damped normal equations; a number at the end of its range does not leave it.
    fn step(&self, normal: &Normal, values_si: &[f64], damping: f64) -> DVector<f64> {
        let mut is_free = vec![true; values_si.len()];
        loop {
            let step = solved(normal, &is_free, damping);
            let leaves = (0..values_si.len()).find(|place| {
                let [least, most] = self.unknowns[*place].range_si;
                is_free[*place]
                    && (values_si[*place] <= least && step[*place] < 0.0
                        || values_si[*place] >= most && step[*place] > 0.0)
            });
            match leaves {
                Some(place) => is_free[place] = false,
                None => return step,
            }
        }
    }
}
