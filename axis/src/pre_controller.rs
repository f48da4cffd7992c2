//! Pre-controller: the sensors of a cycle scaled into the axis's own extension and filtered, velocity and acceleration made.
//!
//! ```text
//!   xi = x                      drive            F_n = first-order low-pass at f, a_n = 1 - exp(-2 pi f T)
//!   xi = L - (x - offset)       load             y += a_n (in - y)
//!
//!   v = two low-passes of (xi - xi_last) / T     dv/dt = two low-passes of (v - v_last) / T
//!   force, pressures: one low-pass each          xi itself is not filtered: a lag there costs phase where it hurts most
//! ```
//!
//! T is the time between the two samples that there are: cycles that the rig skipped pass for the filters too.

use algorithms::algorithm::AlgorithmInput;
use nominal::Axis;
use protocol::frames::Sensors;
use settings::parameters::declare;
use std::f64::consts::TAU;

settings::parameters! {
    /// Period and filters of the pre-controller.
    pub struct Parameters {
        every_cycles: crate::program::EVERY_CYCLES,
        velocity_filter_hz: declare("Hz", [1.0, 400.0], 60.0, "cut-off of each of the two low-passes of the velocity"),
        acceleration_filter_hz: declare("Hz", [1.0, 400.0], 30.0, "cut-off of each of the two low-passes of the acceleration"),
        force_filter_hz: declare("Hz", [1.0, 400.0], 200.0, "cut-off of the force's low-pass"),
        pressure_filter_hz: declare("Hz", [1.0, 400.0], 200.0, "cut-off of the pressures' low-passes"),
    }
}

/// From rig coordinates to the extension of an axis's rod, and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    axis: Axis,
    stroke_m: f64,
    /// Known offset of the position sensor, m: reading less position. 0 until the positions of both axes were matched.
    pub offset_m: f64,
}

impl Geometry {
    /// An axis of this stroke, with a sensor that is taken at its word.
    pub(crate) fn new(axis: Axis, stroke_m: f64) -> Self {
        Self { axis, stroke_m, offset_m: 0.0 }
    }

    /// +1 when the axis's rod extends in the rig's +x, else -1.
    pub(crate) fn direction(&self) -> f64 {
        match self.axis {
            Axis::Drive => 1.0,
            Axis::Load => -1.0,
        }
    }

    /// Extension of the axis's rod at a rig coordinate, m.
    pub(crate) fn extension_m(&self, position_m: f64) -> f64 {
        match self.axis {
            Axis::Drive => position_m,
            Axis::Load => self.stroke_m - position_m,
        }
    }

    /// Rig coordinate at an extension of the axis's rod, m.
    pub(crate) fn position_m(&self, extension_m: f64) -> f64 {
        // Each axis's map is its own inverse.
        self.extension_m(extension_m)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct LowPass {
    /// Cut-off frequency and period that `share` was computed for.
    cut_off_hz: f64,
    period_s: f64,
    share: f64,
    value: f64,
}

impl LowPass {
    fn at(value: f64) -> Self {
        Self { value, ..Self::default() }
    }

    fn step(&mut self, sample: f64, cut_off_hz: f64, period_s: f64) -> f64 {
        if cut_off_hz != self.cut_off_hz || period_s != self.period_s {
            self.share = 1.0 - libm::exp(-TAU * cut_off_hz * period_s);
            (self.cut_off_hz, self.period_s) = (cut_off_hz, period_s);
        }
        self.value += self.share * (sample - self.value);
        self.value
    }
}

#[derive(Clone, Copy, Debug)]
struct Memory {
    extension_m: f64,
    velocity: [LowPass; 2],
    acceleration: [LowPass; 2],
    force: LowPass,
    pressures: [LowPass; 2],
}

/// Task that scales and filters the sensors, with the state of its filters.
#[derive(Clone, Debug)]
pub(crate) struct PreController {
    pub(crate) geometry: Geometry,
    memory: Option<Memory>,
}

impl PreController {
    /// A task without a sample.
    pub(crate) fn new(geometry: Geometry) -> Self {
        Self { geometry, memory: None }
    }

    /// Takes another offset of the position sensor, m; no velocity comes of it.
    pub(crate) fn set_offset(&mut self, offset_m: f64) {
        let shift_m = self.geometry.direction() * (self.geometry.offset_m - offset_m);
        self.geometry.offset_m = offset_m;
        if let Some(memory) = &mut self.memory {
            memory.extension_m += shift_m;
        }
    }

    /// Forgets all samples: what comes next is taken at its word.
    pub(crate) fn reset(&mut self) {
        self.memory = None;
    }

    /// Forgets all samples and the offset: they were another rig's.
    pub(crate) fn restart(&mut self) {
        self.memory = None;
        self.geometry.offset_m = 0.0;
    }

    /// Takes the sensors that came `period_s` after the last ones, and fills in what was measured of `input`.
    pub(crate) fn step(
        &mut self,
        sensors: &Sensors,
        period_s: f64,
        parameters: &Parameters,
        input: &mut AlgorithmInput,
    ) {
        let extension_m = self.geometry.extension_m(sensors.position_m - self.geometry.offset_m);
        let memory = self.memory.get_or_insert_with(|| Memory {
            extension_m,
            velocity: [LowPass::default(); 2],
            acceleration: [LowPass::default(); 2],
            force: LowPass::at(sensors.force_n),
            pressures: [LowPass::at(sensors.pressure_a_pa), LowPass::at(sensors.pressure_b_pa)],
        });
        let last_velocity = memory.velocity[1].value;
        let slope = (extension_m - std::mem::replace(&mut memory.extension_m, extension_m)) / period_s;
        let velocity = twice(&mut memory.velocity, slope, parameters.velocity_filter_hz, period_s);
        let slope = (velocity - last_velocity) / period_s;
        input.position_m = extension_m;
        input.velocity_m_per_s = velocity;
        input.acceleration_m_per_s2 =
            twice(&mut memory.acceleration, slope, parameters.acceleration_filter_hz, period_s);
        input.force_n = memory.force.step(sensors.force_n, parameters.force_filter_hz, period_s);
        let pressure_hz = parameters.pressure_filter_hz;
        let [a, b] = &mut memory.pressures;
        input.pressure_a_pa = a.step(sensors.pressure_a_pa, pressure_hz, period_s);
        input.pressure_b_pa = b.step(sensors.pressure_b_pa, pressure_hz, period_s);
    }
}

fn twice(filters: &mut [LowPass; 2], sample: f64, cut_off_hz: f64, period_s: f64) -> f64 {
    let [first, second] = filters;
    second.step(first.step(sample, cut_off_hz, period_s), cut_off_hz, period_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(position_m: f64) -> Sensors {
        Sensors { position_m, ..Sensors::default() }
    }

    #[test]
    fn a_steady_motion_has_its_velocity_and_no_acceleration() {
        for (axis, direction) in [(Axis::Drive, 1.0), (Axis::Load, -1.0)] {
            let mut pre = PreController::new(Geometry::new(axis, 0.5));
            let mut input = AlgorithmInput::default();
            (0..1000).for_each(|ms| {
                pre.step(&at(0.1 + 0.2 * f64::from(ms) * 1e-3), 1e-3, &Parameters::default(), &mut input);
            });
            // 1 s is 190 time constants of the slowest filter.
            assert!((input.velocity_m_per_s - direction * 0.2).abs() < 1e-9, "{axis:?}");
            assert!(input.acceleration_m_per_s2.abs() < 1e-6, "{axis:?}");
        }
    }

    #[test]
    fn the_first_sample_is_taken_at_its_word() {
        let mut pre = PreController::new(Geometry::new(Axis::Drive, 0.5));
        let mut input = AlgorithmInput::default();
        let sensors = Sensors { position_m: 0.3, force_n: 50.0, pressure_a_pa: 4e5, ..Sensors::default() };
        pre.step(&sensors, 1e-3, &Parameters::default(), &mut input);
        assert_eq!((input.position_m, input.velocity_m_per_s), (0.3, 0.0));
        assert_eq!((input.force_n, input.pressure_a_pa), (50.0, 4e5));
    }

    #[test]
    fn another_offset_makes_no_velocity() {
        let mut pre = PreController::new(Geometry::new(Axis::Load, 0.5));
        let mut input = AlgorithmInput::default();
        pre.step(&at(0.3), 1e-3, &Parameters::default(), &mut input);
        pre.set_offset(0.8e-3);
        pre.step(&at(0.3), 1e-3, &Parameters::default(), &mut input);
        assert!(input.velocity_m_per_s.abs() < 1e-12 && (input.position_m - 0.2008).abs() < 1e-12);
    }
}
