//! The numbers of rig-model.md, and of the effects that a rig has switched on, each in SI by a conversion written here.
//!
//! An effect that is off has the number at which its law is the baseline; where the law has no such number, it is an `Option`.

use plant::RigParameters;

pub(crate) const STROKE: f64 = 0.5;
pub(crate) const AREA: [f64; 2] = [1963.5e-6, 1649.3e-6];
pub(crate) const P_NORMAL: f64 = 101_325.0;
pub(crate) const P_ATMOSPHERE: f64 = 101_325.0;
pub(crate) const P_EXHAUST: f64 = 101_325.0;
pub(crate) const P_SUPPLY: f64 = 7.0e5;
pub(crate) const TAU_VALVE: f64 = 1.6e-3;
pub(crate) const TAU_FLOW: f64 = 8e-3;
pub(crate) const F_STATIC: f64 = 35.0;
pub(crate) const F_SLIDING: f64 = 26.0;
pub(crate) const VISCOUS: f64 = 1100.0;
pub(crate) const MASS: [f64; 2] = [5.0, 1.5];
pub(crate) const CARRIAGE: f64 = 3.5;
pub(crate) const GAS: f64 = 287.0;
pub(crate) const C_V: f64 = 718.0;
pub(crate) const C_P: f64 = 1005.0;
pub(crate) const T_WALL: f64 = 293.15;
pub(crate) const OPENING: [f64; 6] = [0.0, 0.03, 0.2, 0.5, 0.8, 1.0];
pub(crate) const KV_SUPPLY: [f64; 6] = [0.0, 0.0, 0.115, 0.36, 0.60, 0.66];
pub(crate) const KV_EXHAUST: [f64; 6] = [0.0, 0.0, 0.095, 0.30, 0.52, 0.58];

#[derive(Debug, Clone)]
pub(crate) struct AxisNumbers {
    pub(crate) critical_ratio: f64,
    pub(crate) bend: f64,
    pub(crate) edge_ratio: f64,
    pub(crate) dead_zone: f64,
    pub(crate) play: f64,
    pub(crate) null_offset: f64,
    pub(crate) floor: f64,
    /// Natural frequency, rad/s, and damping.
    pub(crate) second_order: Option<[f64; 2]>,
    pub(crate) dead_time: f64,
    pub(crate) line_drop: f64,
    pub(crate) cracking: f64,
    /// K_V of the orifice in series.
    pub(crate) series_kv: f64,
    /// K_V in units of the exhaust edge's, volume.
    pub(crate) silencer: Option<[f64; 2]>,
    pub(crate) heat: Option<f64>,
    pub(crate) dead_volume: f64,
    /// k of piston, of the seals of chambers a and b.
    pub(crate) leak: [f64; 3],
    pub(crate) stribeck: Option<[f64; 2]>,
    pub(crate) bristle_stiffness: Option<f64>,
    pub(crate) asymmetry: f64,
    pub(crate) pressure_slope: f64,
    /// Bump, centre, width, slope, ripple, pitch.
    pub(crate) friction_over_x: [f64; 6],
    pub(crate) inclination: f64,
    /// Spring, ripple, pitch.
    pub(crate) force_over_x: [f64; 3],
    /// K_V, length, stiffness.
    pub(crate) cushion: Option<[f64; 3]>,
    /// Position, force, pressure a, pressure b.
    pub(crate) lag: [f64; 4],
    pub(crate) gain: [f64; 4],
    pub(crate) offset: [f64; 4],
    pub(crate) skew: [f64; 4],
}

#[derive(Debug, Clone)]
pub(crate) struct Numbers {
    pub(crate) axes: [AxisNumbers; 2],
    pub(crate) gap: f64,
    pub(crate) stiffness: f64,
    pub(crate) damping: f64,
    /// Droop, volume.
    pub(crate) droop: Option<[f64; 2]>,
}

impl AxisNumbers {
    fn baseline() -> Self {
        AxisNumbers {
            critical_ratio: 0.5,
            bend: 0.0,
            edge_ratio: 0.0,
            dead_zone: 0.0,
            play: 0.0,
            null_offset: 0.0,
            floor: 0.0,
            second_order: None,
            dead_time: 0.0,
            line_drop: 0.0,
            cracking: 0.0,
            series_kv: f64::INFINITY,
            silencer: None,
            heat: None,
            dead_volume: 20e-6,
            leak: [0.0; 3],
            stribeck: None,
            bristle_stiffness: None,
            asymmetry: 0.0,
            pressure_slope: 0.0,
            friction_over_x: [0.0, 0.25, 0.05, 0.0, 0.0, 0.05],
            inclination: 0.0,
            force_over_x: [0.0, 0.0, 0.05],
            cushion: None,
            lag: [0.0; 4],
            gain: [0.0; 4],
            offset: [0.0; 4],
            skew: [0.0; 4],
        }
    }
}

impl Numbers {
    /// The numbers of a rig; `None` if it has an effect that is none of a smooth ordinary differential equation.
    pub(crate) fn of(rig: &RigParameters) -> Option<Self> {
        let baseline = AxisNumbers::baseline();
        let mut numbers = Numbers {
            axes: [baseline.clone(), baseline],
            gap: 0.2e-3,
            stiffness: 2e6,
            damping: 2e3,
            droop: None,
        };
        for effect in rig.effects() {
            let place = effect.place.to_string();
            let axis = &mut numbers.axes[usize::from(place.starts_with("load"))];
            let channel = match place.split('.').nth(1) {
                Some("force") => 1,
                Some("a") => 2,
                Some("b") => 3,
                _ => 0,
            };
            let n = &effect.numbers;
            let leak = |litres_per_minute: f64| litres_per_minute * 1e-3 / 60.0 / (36e10 - 1e10);
            match effect.name {
                "critical-pressure-ratio" => axis.critical_ratio = n[0],
                "valve-characteristic" => (axis.bend, axis.edge_ratio) = (n[0] * 1e-2, n[1] * 1e-2),
                "valve-dead-zone" => axis.dead_zone = n[0] * 1e-2,
                "valve-hysteresis" => axis.play = n[0] * 1e-2,
                "valve-offset" => axis.null_offset = n[0] * 1e-2,
                "valve-null-leakage" => axis.floor = n[0] * 1e-2,
                "spool-second-order" => axis.second_order = Some([std::f64::consts::TAU * n[0], n[1]]),
                "line-resistance" => axis.line_drop = n[0] * 1e5,
                "check-valve-restriction" => {
                    axis.cracking = n[0] * 1e5;
                    axis.series_kv = if n[1] >= 100.0 { f64::INFINITY } else { n[1] };
                }
                "silencer-back-pressure" => axis.silencer = Some([n[0], n[1] * 1e-6]),
                "supply-droop" => numbers.droop = Some([n[0] * 1e5, n[1] * 1e-6]),
                "command-dead-time" => axis.dead_time = n[0] * 1e-3,
                "heat-exchange" => axis.heat = Some(n[0]),
                "dead-volume" => axis.dead_volume = n[0] * 1e-6,
                "piston-leakage" => axis.leak[0] = leak(n[0]),
                "rod-leakage" => axis.leak[channel - 1] = leak(n[0]),
                "stribeck-friction" => axis.stribeck = Some([n[0] * 1e-3, n[1]]),
                "presliding" => axis.bristle_stiffness = Some(n[0]),
                "friction-asymmetry" => axis.asymmetry = n[0] * 1e-2,
                "pressure-dependent-friction" => axis.pressure_slope = n[0] * 1e-5,
                "position-dependent-friction" => {
                    axis.friction_over_x = [n[0], n[1] * 1e-3, n[2] * 1e-3, n[3], n[4], n[5] * 1e-3];
                }
                "inclination" => axis.inclination = n[0],
                "position-dependent-force" => axis.force_over_x = [n[0], n[1], n[2] * 1e-3],
                "coupling-backlash" => numbers.gap = n[0] * 1e-3,
                "coupling-compliance" => (numbers.stiffness, numbers.damping) = (n[0], n[1]),
                "end-cushion" => axis.cushion = Some([n[0], n[1] * 1e-3, n[2]]),
                "position-sensor-lag" | "pressure-sensor-lag" => axis.lag[channel] = n[0] * 1e-3,
                "position-sensor-gain" | "pressure-sensor-gain" => axis.gain[channel] = n[0] * 1e-2,
                "force-sensor-gain" => axis.gain[1] = n[0] * 1e-2,
                "position-sensor-offset" => axis.offset[0] = n[0] * 1e-3,
                "pressure-sensor-offset" => axis.offset[channel] = n[0] * 1e2,
                "force-sensor-offset" => axis.offset[1] = n[0],
                "time-skew" => axis.skew[channel] = n[0] * 1e-3,
                _ => return None,
            }
        }
        Some(numbers)
    }
}
