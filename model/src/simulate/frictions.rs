//! Dry friction that sticks and slips: the instants at which it stops and breaks away, and what they do to derivatives.
//!
//! ```text
//!   slides, direction d = 1 or -1:   F = d * sliding                 until v = 0
//!   holds, direction 0:              F = H, so that v' = 0           until |H| > breakaway, and then d = sign(H)
//!   at v = 0:                        holds if |H| <= breakaway, else d = sign(H)
//!   H = -a/c  from  v' = a + c F, which the equation of the speed says; a positive F brakes, c < 0
//! ```
//! Within a step d is constant, so that the equations are smooth; a step within which one of the conditions comes true is taken
//! again up to that instant. Derivatives S jump there, since the instant moves with what is fitted:
//!
//! ```text
//!   S+ = S- + (f- - f+) dt/dp      dt/dp = -h_p / h'      h = v, or |H| - breakaway; h' along the motion before
//! ```
//! A break-away force is seen in the instants of breaking away alone. A jump of an input breaks away at a sample, whatever is
//! fitted.
//!
//! Sources: Karnopp 1985, J. Dyn. Sys., Meas., Control 107 (the force that holds); Hiskens, Pai 2000, IEEE Trans. Circuits and
//! Systems I 47(2), eq. 38 (jump of sensitivities).

use super::steps::cubic;
use super::{STAGES, Simulator, put};
use crate::failure::Failure;
use crate::inputs::Inputs;

/// Results of the guards' tape for each friction.
const GUARDS: usize = 3;
/// Shares of a step at which event functions are evaluated: a speed may touch 0 and come back.
const LOOKED_AT: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
/// Halvings of a step in the search of an instant, which then is good to 1e-12 of it.
const HALVINGS: usize = 40;
/// Corrections of an instant with the step itself, which is better than the curve between its ends.
const CORRECTIONS: usize = 3;
/// A correction of an instant that is not worth another step, over the step that was tried.
const CORRECTED: f64 = 1e-9;
/// Share of a step over which the rate of an event function is computed by central differences.
const DIFFERENCE: f64 = 1e-3;

/// A friction that stops or breaks away within a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Event {
    friction: usize,
    /// Share of the step.
    share: f64,
}

impl Simulator<'_> {
    fn put_directions(&mut self) {
        for index in 0..self.direction.len() {
            let (direction, register) = (self.direction[index], self.program.held[index].1);
            for registers in self.all_registers() {
                registers.set(register, direction);
            }
        }
    }

    fn speed(&self, friction: usize) -> f64 {
        self.x[self.program.held[friction].0 * self.width()]
    }

    /// The force that holds a speed, and that at which it breaks away, at the states in `within`.
    fn guard(&mut self, inputs: &Inputs<'_>, instant: (usize, f64), friction: usize) -> [f64; GUARDS] {
        let guards = &self.program.tapes.guards;
        put(self.program, &mut self.plain_guards, inputs, instant, &self.within);
        guards.evaluate(&mut self.plain_guards, inputs, &self.history);
        core::array::from_fn(|place| self.plain_guards.value(guards.result(GUARDS * friction + place)))
    }

    /// The direction in which a speed that is 0 goes on.
    fn onward(&mut self, inputs: &Inputs<'_>, instant: (usize, f64), friction: usize) -> f64 {
        let [holding, breakaway, _] = self.guard(inputs, instant, friction);
        if holding.abs() > breakaway { holding.signum() } else { 0.0 }
    }

    fn states_at_head(&mut self) {
        let width = self.width();
        for (place, within) in self.within.iter_mut().enumerate() {
            *within = self.x[place * width];
        }
    }

    /// Directions at the first sample.
    ///
    /// # Errors
    /// A force that would drive its speed.
    pub(super) fn settle(&mut self, inputs: &Inputs<'_>) -> Result<(), Failure> {
        let instant = (0, inputs.time_s[0]);
        self.direction.fill(0.0);
        for friction in 0..self.direction.len() {
            self.states_at_head();
            let speed = self.speed(friction);
            let [.., braked] = self.guard(inputs, instant, friction);
            if braked.is_nan() || braked <= 0.0 {
                let (name, place) = self.program.names.frictions[friction].clone();
                return Err(Failure::Drives { place, name });
            }
            let onward = self.onward(inputs, instant, friction);
            self.direction[friction] = if speed == 0.0 { onward } else { speed.signum() };
        }
        self.put_directions();
        Ok(())
    }

    /// Re-evaluates stuck frictions after an input jump at a sample, or after a step that renewed memories. A speed that is held
    /// has no derivative.
    pub(super) fn release(&mut self, inputs: &Inputs<'_>, instant: (usize, f64)) {
        let width = self.width();
        for friction in 0..self.direction.len() {
            if self.direction[friction] == 0.0 {
                let place = self.program.held[friction].0;
                self.x[place * width..(place + 1) * width].fill(0.0);
                self.states_at_head();
                self.direction[friction] = self.onward(inputs, instant, friction);
                self.put_directions();
            }
        }
    }

    /// Event function: negative once the friction leaves its mode (sliding direction, or stick), at the states in `within`.
    fn event_function(&mut self, inputs: &Inputs<'_>, instant: (usize, f64), friction: usize) -> f64 {
        let direction = self.direction[friction];
        if direction != 0.0 {
            return direction * self.within[self.program.held[friction].0];
        }
        let [holding, breakaway, _] = self.guard(inputs, instant, friction);
        breakaway - holding.abs()
    }

    /// States within the step that was tried, by the cubic of its ends and their rates.
    fn interpolate(&mut self, step_s: f64, share: f64) {
        let width = self.width();
        for (place, within) in self.within.iter_mut().enumerate() {
            let at = place * width;
            let (from, to) = (self.x[at], self.tried[at]);
            let [head, end] = [0, STAGES - 1].map(|stage| step_s * self.stages[stage][at]);
            *within = cubic([from, to], [head, end], share);
        }
    }

    /// The first friction that stops or breaks away within the step that was tried.
    pub(super) fn event(
        &mut self,
        inputs: &Inputs<'_>,
        (row, time_s): (usize, f64),
        step_s: f64,
    ) -> Option<Event> {
        let mut first: Option<Event> = None;
        for friction in 0..self.direction.len() {
            let mut before = 0.0;
            let mut found = None;
            for share in LOOKED_AT {
                self.interpolate(step_s, share);
                if self.event_function(inputs, (row, time_s + share * step_s), friction) < 0.0 {
                    found = Some(share);
                    break;
                }
                before = share;
            }
            let Some(mut behind) = found else { continue };
            for _ in 0..HALVINGS {
                let middle = 0.5 * (before + behind);
                self.interpolate(step_s, middle);
                if self.event_function(inputs, (row, time_s + middle * step_s), friction) >= 0.0 {
                    before = middle;
                } else {
                    behind = middle;
                }
            }
            if first.is_none_or(|first| behind < first.share) {
                first = Some(Event { friction, share: behind });
            }
        }
        first
    }

    /// The event function at the end of the step that was tried, and its rate of change along the motion there.
    fn event_function_and_rate(
        &mut self,
        inputs: &Inputs<'_>,
        (row, time_s): (usize, f64),
        [length_s, step_s]: [f64; 2],
        friction: usize,
    ) -> [f64; 2] {
        let width = self.width();
        // Over the whole step: an instant at its head leaves nothing to difference.
        let [behind, at, ahead] = [-DIFFERENCE, 0.0, DIFFERENCE].map(|share| {
            for (place, within) in self.within.iter_mut().enumerate() {
                *within = self.tried[place * width] + share * step_s * self.stages[STAGES - 1][place * width];
            }
            self.event_function(inputs, (row, time_s + length_s + share * step_s), friction)
        });
        [at, (ahead - behind) / (2.0 * DIFFERENCE * step_s)]
    }

    /// Takes the step up to an event, and switches the friction. Returns how long the step was.
    pub(super) fn switch(
        &mut self,
        inputs: &Inputs<'_>,
        (row, time_s): (usize, f64),
        step_s: f64,
        Event { friction, share }: Event,
    ) -> Result<f64, Failure> {
        let mut length_s = share * step_s;
        let mut rate = 0.0;
        for correction in 0..=CORRECTIONS {
            self.attempt(inputs, (row, time_s), length_s);
            let found = self.event_function_and_rate(inputs, (row, time_s), [length_s, step_s], friction);
            rate = found[1];
            let late_s = found[0] / rate;
            let is_better = late_s.abs() > CORRECTED * step_s && late_s.abs() < 0.5 * length_s;
            if correction == CORRECTIONS || !is_better || length_s - late_s > step_s {
                break;
            }
            length_s -= late_s;
        }
        let _ = self.remember(inputs, (row, time_s), length_s);
        self.keep(length_s);
        core::mem::swap(&mut self.x, &mut self.tried);
        let instant = (row, time_s + length_s);
        let width = self.width();
        let place = self.program.held[friction].0;
        // Sensitivity of the event's instant to what is fitted.
        let direction = self.direction[friction];
        if direction == 0.0 {
            put(self.program, &mut self.guards, inputs, instant, &self.x);
            self.program.tapes.guards.evaluate(&mut self.guards, inputs, &self.history);
            let guards = &self.program.tapes.guards;
            let [holding, breakaway] = [0, 1].map(|result| guards.result(GUARDS * friction + result));
            let sign = self.guards.value(holding).signum();
            for (index, earlier) in self.earlier_s.iter_mut().enumerate() {
                *earlier =
                    (self.guards.slope(breakaway)[index] - sign * self.guards.slope(holding)[index]) / rate;
            }
            self.direction[friction] = sign;
        } else {
            for (index, earlier) in self.earlier_s.iter_mut().enumerate() {
                *earlier = direction * self.x[place * width + 1 + index] / rate;
            }
            self.x[place * width] = 0.0;
            self.states_at_head();
            self.direction[friction] = self.onward(inputs, instant, friction);
        }
        // Rates before, and behind with the other direction.
        self.stage(inputs, row, instant.1, 0, false);
        self.put_directions();
        self.stage(inputs, row, instant.1, 1, false);
        for state in 0..self.largest.len() {
            let jump = self.stages[0][state * width] - self.stages[1][state * width];
            for (index, earlier) in self.earlier_s.iter().enumerate() {
                let moved = jump * earlier;
                if moved.is_finite() {
                    self.x[state * width + 1 + index] -= moved;
                }
            }
        }
        if self.direction[friction] == 0.0 {
            self.x[place * width..(place + 1) * width].fill(0.0);
        }
        self.finish_step(inputs, row, instant.1)?;
        Ok(length_s)
    }
}
