//! Steps from a sample to the next one, by either method.

use super::memories::StepPoint;
use super::{MOST_STEPS, STAGES, Simulator, failure, put};
use crate::failure::Failure;
use crate::file::Solver;
use crate::inputs::{Hold, Inputs};

/// Its coefficients [HNW 1993, table 5.2].
const A: [[f64; 6]; STAGES] = [
    [0.0; 6],
    [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
    [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
    [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
    [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
    [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
const C: [f64; STAGES] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
/// Difference of the two orders.
const E: [f64; STAGES] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339_200.0, 22.0 / 525.0, -1.0 / 40.0];
/// Share of the step that the error would allow, and bounds of its change [HNW 1993, II.4].
const SAFETY: f64 = 0.9;
const SHRINK: f64 = 0.2;
const GROW: f64 = 5.0;
/// The shortest step over the distance of two samples. It is taken whatever its error, which is that of a jump within it, or of a
/// state that leaves 0 by a power of time: its error over its change does not fall with the step.
pub(super) const SHORTEST: f64 = 1e-6;
/// Of a time less a delay, over both.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Most such steps with an error between two samples. Two go over a jump, and some twenty lead a chain of six states away from 0;
/// equations that jump to and fro at a level need a million.
const MOST_SHORTEST: usize = 200;

/// A value within a step from those at its ends and their changes over it, were they even [HNW 1993, II.6, eq. 6.7].
pub(super) fn cubic([from, to]: [f64; 2], [head, end]: [f64; 2], share: f64) -> f64 {
    let bent = (1.0 - 2.0 * share) * (to - from) + (share - 1.0) * head + share * end;
    (1.0 - share) * from + share * to + share * (share - 1.0) * bent
}

impl Simulator<'_> {
    /// From a sample to the next one.
    pub(super) fn advance(&mut self, inputs: &Inputs<'_>, row: usize) -> Result<(), Failure> {
        let (from_s, to_s) = (inputs.time_s[row], inputs.time_s[row + 1]);
        if self.steps >= self.most_steps {
            return Err(Failure::Steps { time_s: from_s });
        }
        if self.x.is_empty() && self.memory.is_empty() {
            self.steps += 1;
            return Ok(());
        }
        if row == 0 || self.program.holds.contains(&Hold::Zero) {
            // An input that jumps at the sample.
            self.renew(inputs, (row, from_s));
        }
        let mut from_s = from_s;
        loop {
            let ends_s = self.next_return(inputs, row, [from_s, to_s]);
            self.advance_to(inputs, row, [from_s, ends_s])?;
            if ends_s >= to_s {
                return Ok(());
            }
            from_s = ends_s;
        }
    }

    /// Within the distance of two samples.
    fn advance_to(
        &mut self,
        inputs: &Inputs<'_>,
        row: usize,
        [from_s, to_s]: [f64; 2],
    ) -> Result<(), Failure> {
        match self.program.solver {
            Solver::Fixed { step_s } => {
                // A step that is longer by a rounding error is no step more.
                let steps = ((to_s - from_s) / step_s - 1e-9).ceil().max(1.0);
                if steps > MOST_STEPS as f64 {
                    return Err(Failure::Steps { time_s: from_s });
                }
                let length_s = (to_s - from_s) / steps;
                self.steps += steps as usize;
                self.release(inputs, (row, from_s));
                for step in 0..steps as usize {
                    let ends_s = from_s + length_s * (step + 1) as f64;
                    self.fixed_step(inputs, (row, from_s + length_s * step as f64), length_s, ends_s)?;
                }
                Ok(())
            }
            Solver::Adaptive { relative_tolerance } => {
                self.adapt(inputs, row, [from_s, to_s], relative_tolerance)
            }
        }
    }

    /// The rates at the head of a step, which are finite at the start of a record or its equation is wrong.
    fn first_stage(&mut self, inputs: &Inputs<'_>, row: usize, time_s: f64) -> Result<(), Failure> {
        self.stage(inputs, row, time_s, 0, false);
        let width = self.width();
        let lost = (0..self.largest.len()).find(|place| !self.stages[0][place * width].is_finite());
        match lost {
            Some(place) => {
                let (name, where_it_is) = &self.program.names.states[place];
                Err(failure(time_s == inputs.time_s[0], name, where_it_is, time_s))
            }
            None => Ok(()),
        }
    }

    /// A step of the fixed method, in parts where friction stops or breaks away within it.
    fn fixed_step(
        &mut self,
        inputs: &Inputs<'_>,
        (row, from_s): (usize, f64),
        length_s: f64,
        ends_s: f64,
    ) -> Result<(), Failure> {
        let (mut time_s, mut step_s) = (from_s, length_s);
        for _ in 0..MOST_STEPS {
            self.first_stage(inputs, row, time_s)?;
            self.attempt(inputs, (row, time_s), step_s);
            let Some(event) = self.event(inputs, (row, time_s), step_s) else {
                self.keep(step_s);
                core::mem::swap(&mut self.x, &mut self.tried);
                return self.finish_step(inputs, row, ends_s);
            };
            time_s += self.switch(inputs, (row, time_s), step_s, event)?;
            step_s = ends_s - time_s;
            self.steps += 1;
            if step_s <= 0.0 {
                return Ok(());
            }
        }
        Err(Failure::Steps { time_s: from_s })
    }

    /// What a step of Runge-Kutta 4 leads to, from the rates at its head.
    pub(super) fn classical(&mut self, inputs: &Inputs<'_>, (row, time_s): (usize, f64), step_s: f64) {
        for (stage, share) in [(1, 0.5), (2, 0.5), (3, 1.0)] {
            for ((tried, x), rate) in self.tried.iter_mut().zip(&self.x).zip(&self.stages[stage - 1]) {
                *tried = x + step_s * share * rate;
            }
            self.stage(inputs, row, time_s + share * step_s, stage, true);
        }
        let [first, second, third, fourth, ..] = &self.stages;
        for (index, (tried, x)) in self.tried.iter_mut().zip(&self.x).enumerate() {
            *tried = x + step_s / 6.0 * (first[index] + 2.0 * (second[index] + third[index]) + fourth[index]);
        }
        if !self.direction.is_empty() || !self.history.is_empty() {
            self.stage(inputs, row, time_s + step_s, STAGES - 1, true);
        }
    }

    /// What a step of Dormand-Prince leads to, from the rates at its head.
    pub(super) fn dormand_prince(&mut self, inputs: &Inputs<'_>, (row, time_s): (usize, f64), step_s: f64) {
        for stage in 1..STAGES {
            self.tried.fill(0.0);
            for (weight, before) in A[stage][..stage.min(6)].iter().zip(&self.stages) {
                for (sum, rate) in self.tried.iter_mut().zip(before) {
                    *sum += weight * rate;
                }
            }
            for (tried, x) in self.tried.iter_mut().zip(&self.x) {
                *tried = x + step_s * *tried;
            }
            self.stage(inputs, row, time_s + C[stage] * step_s, stage, true);
        }
    }

    fn adapt(
        &mut self,
        inputs: &Inputs<'_>,
        row: usize,
        [from_s, to_s]: [f64; 2],
        tolerance: f64,
    ) -> Result<(), Failure> {
        let mut time_s = from_s;
        let shortest_s = SHORTEST * (inputs.time_s[row + 1] - inputs.time_s[row]);
        let mut shortest = 0;
        self.release(inputs, (row, time_s));
        self.first_stage(inputs, row, time_s)?;
        for _ in 0..MOST_STEPS.min(self.most_steps - self.steps) {
            self.steps += 1;
            let left_s = to_s - time_s;
            let wished_s = if self.step_s > 0.0 { self.step_s } else { left_s };
            // The last step ends on the sample, and no sliver is left behind it.
            let is_last = wished_s >= 0.999 * left_s || left_s <= shortest_s;
            let step_s = if is_last { left_s } else { wished_s.min(0.5 * left_s).max(shortest_s) };
            let unread = if self.attempt(inputs, (row, time_s), step_s) { 0.0 } else { f64::INFINITY };
            let error = self.error(step_s).max(self.remember(inputs, (row, time_s), step_s));
            let error = error.max(unread) / tolerance;
            let factor = if error > 0.0 { SAFETY * libm::pow(error, -0.2) } else { GROW };
            let factor = if factor.is_nan() { SHRINK } else { factor.clamp(SHRINK, GROW) };
            let is_good = error <= 1.0 || error.is_finite() && step_s <= shortest_s;
            if is_good && error > 1.0 {
                shortest += 1;
                if shortest > MOST_SHORTEST {
                    break;
                }
            }
            if is_good && let Some(event) = self.event(inputs, (row, time_s), step_s) {
                self.forget();
                time_s += self.switch(inputs, (row, time_s), step_s, event)?;
                if time_s >= to_s {
                    return Ok(());
                }
                self.stage(inputs, row, time_s, 0, false);
                continue;
            }
            if is_good {
                self.step_s = if is_last { self.step_s.max(step_s * factor) } else { step_s * factor };
                time_s = if is_last { to_s } else { time_s + step_s };
                self.keep(step_s);
                core::mem::swap(&mut self.x, &mut self.tried);
                self.finish_step(inputs, row, time_s)?;
                if is_last {
                    return Ok(());
                }
                if self.memory.is_empty() {
                    self.stages.swap(0, STAGES - 1);
                } else {
                    self.stage(inputs, row, time_s, 0, false);
                }
            } else {
                self.forget();
                if step_s <= shortest_s {
                    return Err(self.lost(time_s));
                }
                self.step_s = step_s * factor.min(1.0);
            }
        }
        Err(Failure::Steps { time_s: from_s })
    }

    /// Largest error of a step over the scale of its state.
    fn error(&self, step_s: f64) -> f64 {
        let width = self.width();
        let mut worst: f64 = 0.0;
        for place in 0..self.largest.len() {
            let at = place * width;
            let error: f64 = E.iter().zip(&self.stages).map(|(weight, stage)| weight * stage[at]).sum();
            let relative = (step_s * error).abs() / self.error_scale(place, step_s);
            worst = if relative.is_nan() { f64::INFINITY } else { worst.max(relative) };
            if worst.is_infinite() {
                return worst;
            }
        }
        worst
    }

    /// Scale of a state for the step-size control: its largest size so far, or its change in the step that was tried where that
    /// is more.
    pub(super) fn error_scale(&self, place: usize, step_s: f64) -> f64 {
        let at = place * self.width();
        let moved = (step_s * self.stages[0][at]).abs().max((self.tried[at] - self.x[at]).abs());
        self.largest[place].max(moved).max(f64::MIN_POSITIVE)
    }

    /// Rates at a stage, from `tried` or `x`.
    pub(super) fn stage(&mut self, inputs: &Inputs<'_>, row: usize, time_s: f64, stage: usize, tried: bool) {
        self.stage_at(inputs, (row, time_s), stage, if tried { StepPoint::End } else { StepPoint::Start });
    }

    pub(super) fn stage_at(
        &mut self,
        inputs: &Inputs<'_>,
        instant: (usize, f64),
        stage: usize,
        at: StepPoint,
    ) {
        let program = self.program;
        let x = match at {
            StepPoint::Start => &self.x,
            StepPoint::Middle => &self.middle,
            StepPoint::End => &self.tried,
        };
        put(program, &mut self.rates, inputs, instant, x);
        let rounding_s = (ROUNDING * (instant.1.abs() + self.longest_delay_s)).max(f64::MIN_POSITIVE);
        self.history.set_boundary_offset(if at == StepPoint::Start { rounding_s } else { -rounding_s });
        program.tapes.rates.evaluate(&mut self.rates, inputs, &self.history);
        let width = self.width();
        for place in 0..program.tapes.states.len() {
            let register = program.tapes.rates.result(place);
            let rate = &mut self.stages[stage][place * width..(place + 1) * width];
            rate[0] = self.rates.value(register);
            rate[1..].copy_from_slice(self.rates.slope(register));
        }
    }

    /// Finishes an accepted step: checks that all is finite, and renews sizes and memories.
    pub(super) fn finish_step(
        &mut self,
        inputs: &Inputs<'_>,
        row: usize,
        time_s: f64,
    ) -> Result<(), Failure> {
        let width = self.width();
        for place in 0..self.largest.len() {
            let value = self.x[place * width];
            if !value.is_finite() {
                return Err(self.lost(time_s));
            }
            self.largest[place] = self.largest[place].max(value.abs());
        }
        if !self.memory.is_empty() {
            self.renew(inputs, (row, time_s));
            self.keep_memories();
            self.release(inputs, (row, time_s));
        }
        Ok(())
    }

    /// The first state that is not finite, or whose rate is not.
    fn lost(&self, time_s: f64) -> Failure {
        let width = self.width();
        let is_lost = |place: &usize| {
            !self.x[place * width].is_finite()
                || self.stages.iter().any(|stage| !stage[place * width].is_finite())
        };
        let place = (0..self.largest.len()).find(is_lost).unwrap_or(0);
        let (name, where_it_is) = &self.program.names.states[place];
        failure(false, name, where_it_is, time_s)
    }
}
