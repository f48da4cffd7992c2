//! Laws of a rig from the effects of a recipe.

use super::axis::{AirLaws, Axis};
use super::coupling::Coupling;
use super::motion::{Motion, MotionLaws};
use super::numbers::Numbers;
use super::port::{Node, PortLaws, Ports};
use super::rig::Rig;
use super::sensing::SensingLaws;
use super::valve::{Valve, ValveLaws};
use super::{Hidden, MakeError, Recipe};
use plant::effects::sheet::{Element, Part, PlaceKind, Sheet};

/// Travel time per length of line, s/m.
const LINE_S_PER_M: f64 = 2.9e-3;

/// Laws of one axis while they are collected.
#[derive(Default)]
struct Laws {
    valve: ValveLaws,
    port: PortLaws,
    air: AirLaws,
    motion: MotionLaws,
    sensing: SensingLaws,
    silencer: Option<[f64; 2]>,
    late_s: f64,
}

/// The rig of a recipe, and the sensor laws of both axes.
pub(super) fn rig(
    recipe: &Recipe,
    mut numbers: Numbers,
    steps_per_ms: usize,
) -> Result<(Rig, [SensingLaws; 2]), MakeError> {
    let form = recipe.form;
    let foreign = form.is_foreign();
    let mut laws = [Laws::default(), Laws::default()];
    for laws in &mut laws {
        laws.valve.form = form;
        laws.port.form = form;
        laws.air.form = form;
        laws.motion.form = form;
        laws.sensing.form = form;
    }
    let mut supply = None;
    let (mut worn, mut hertz) = (false, false);
    let background = recipe.background.iter().flat_map(|background| &background.effects);
    for hidden in recipe.hidden.iter().chain(background) {
        let n = si(hidden)?;
        check_place(recipe, hidden)?;
        match hidden.name {
            "supply-droop" if n[0] > 0.0 => supply = Some([n[0], n[1]]),
            "supply-droop" => {}
            "coupling-backlash" => (numbers.gap_m, worn) = (n[0], foreign && n[0] > 0.0),
            "coupling-compliance" => {
                (numbers.stiffness_n_per_m, numbers.damping_n_s_per_m, hertz) = (n[0], n[1], foreign);
            }
            _ => laws[usize::from(hidden.place.part == Part::Load)].switch_on(hidden, &n)?,
        }
    }
    let axes = [0, 1].map(|axis| {
        let laws = &laws[axis];
        let silencer = laws.silencer.map(|silencer| Node::silencer(&numbers, silencer, form));
        let valve = Valve::new(&numbers, laws.valve.clone());
        let ports = Ports::new(&numbers, laws.port.clone());
        let motion = Motion::new(&numbers, axis, laws.motion.clone());
        Axis::new(&numbers, valve, ports, silencer, laws.air.clone(), motion)
    });
    let rig = Rig {
        axes,
        active: plant::Axis::ALL.map(|axis| recipe.both_axes || axis == recipe.axis),
        coupling: (recipe.both_axes && !recipe.unlinked).then_some(Coupling {
            gap_m: numbers.gap_m,
            stiffness_n_per_m: numbers.stiffness_n_per_m,
            damping_n_s_per_m: numbers.damping_n_s_per_m,
            worn,
            hertz,
            form,
        }),
        supply: supply.map(|droop| Node::supply(&numbers, droop, form)),
        late_s: [laws[0].late_s, laws[1].late_s],
        form,
        first_order: recipe.background.is_some(),
        steps_per_ms,
    };
    Ok((rig, laws.map(|laws| laws.sensing)))
}

pub(super) fn sheet(hidden: &Hidden) -> Result<&'static Sheet, MakeError> {
    let unknown = || MakeError::UnknownEffect { name: hidden.name.to_owned() };
    plant::effects::sheet(hidden.name).ok_or_else(unknown)
}

/// The numbers of an effect in SI, checked against its sheet.
fn si(hidden: &Hidden) -> Result<Vec<f64>, MakeError> {
    let sheet = sheet(hidden)?;
    let good = sheet.keys.len() == hidden.numbers.len()
        && sheet.keys.iter().zip(&hidden.numbers).all(|(key, n)| (key.min..=key.max).contains(n));
    if !good {
        let range = |key: &plant::effects::sheet::EffectKey| format!("{} {}", key.name, key.range());
        let allowed = sheet.keys.iter().map(range).collect::<Vec<_>>().join(", ");
        return Err(MakeError::Numbers { name: hidden.name, numbers: hidden.numbers.clone(), allowed });
    }
    Ok(sheet.keys.iter().zip(&hidden.numbers).map(|(key, number)| key.unit.to_si(*number)).collect())
}

fn check_place(recipe: &Recipe, hidden: &Hidden) -> Result<(), MakeError> {
    let kind = sheet(hidden)?.place;
    let refuse = |rule| Err(MakeError::Place { name: hidden.name, place: hidden.place, rule });
    if !kind.places().contains(&hidden.place) {
        return refuse("it is none of the places of its sheet");
    }
    let is_measured = match hidden.place.part {
        Part::Drive => recipe.both_axes || recipe.axis == plant::Axis::Drive,
        Part::Load => recipe.both_axes || recipe.axis == plant::Axis::Load,
        Part::Linkage => recipe.both_axes && !recipe.unlinked,
        Part::Supply => true,
    };
    if !is_measured {
        let linkage = kind == PlaceKind::Linkage;
        return refuse(if linkage {
            "the linkage is seen with both_axes alone, and linked"
        } else {
            "this axis is not recorded; choose the other one, or both_axes"
        });
    }
    Ok(())
}

impl Laws {
    /// Adds one effect of an axis; `n` are its numbers in SI in the order of the sheet.
    fn switch_on(&mut self, hidden: &Hidden, n: &[f64]) -> Result<(), MakeError> {
        let chamber = usize::from(hidden.place.element == Some(Element::B));
        let channel = match hidden.place.element {
            Some(Element::Position) | None => 0,
            Some(Element::Force) => 1,
            Some(Element::A) => 2,
            Some(Element::B) => 3,
        };
        match hidden.name {
            "critical-pressure-ratio" => self.valve.critical_ratio = Some(n[0]),
            "valve-characteristic" => (self.valve.bend, self.valve.edge_ratio) = (n[0], n[1]),
            "valve-dead-zone" => self.valve.dead_zone = n[0],
            "valve-hysteresis" => self.valve.play = n[0],
            "valve-offset" => self.valve.offset = n[0],
            "valve-null-leakage" => self.valve.null_leakage = n[0],
            "spool-second-order" => self.valve.second_order = Some([n[0], n[1]]),
            "spool-rate-limit" => self.valve.rate_per_s = Some(n[0]),
            "line-delay" => self.air.line_delay_s = LINE_S_PER_M * n[0],
            "line-resistance" => self.port.line_drop_pa = n[0],
            "check-valve-restriction" => self.port.check_valve = Some([n[0], n[1]]),
            "silencer-back-pressure" => self.silencer = Some([n[0], n[1]]),
            "command-dead-time" => self.late_s = n[0],
            "heat-exchange" => self.air.heat_w_per_m2_k = Some(n[0]),
            "dead-volume" => self.air.dead_volume_m3 = Some(n[0]),
            "piston-leakage" => self.air.piston_leakage = n[0],
            "rod-leakage" => self.air.rod_leakage[chamber] = n[0],
            "stribeck-friction" => self.motion.stribeck = Some([n[0], n[1]]),
            "presliding" => self.motion.presliding = Some(n[0]),
            "friction-asymmetry" => self.motion.asymmetry = n[0],
            "pressure-dependent-friction" => self.motion.pressure_slope = n[0],
            "position-dependent-friction" => {
                self.motion.friction_over_way = Some([n[0], n[1], n[2], n[3], n[4], n[5]]);
            }
            "inclination" => self.motion.inclination_n = n[0],
            "position-dependent-force" => self.motion.force_over_way = Some([n[0], n[1], n[2]]),
            "rest-time-dependent-break-away" => self.motion.rest_growth = Some([n[0], n[1]]),
            "end-cushion" => {
                self.port.cushion = Some([n[0], n[1]]);
                self.motion.stop_n_per_m = Some(n[2]);
            }
            "position-sensor-lag" => self.sensing.lag_s[0] = n[0],
            "position-sensor-offset" => self.sensing.offset[0] = n[0],
            "position-sensor-gain" => self.sensing.gain[0] = n[0],
            "pressure-sensor-lag" => self.sensing.lag_s[2 + chamber] = n[0],
            "pressure-sensor-offset" => self.sensing.offset[2 + chamber] = n[0],
            "pressure-sensor-gain" => self.sensing.gain[2 + chamber] = n[0],
            "force-sensor-offset" => self.sensing.offset[1] = n[0],
            "force-sensor-gain" => self.sensing.gain[1] = n[0],
            "time-skew" => self.sensing.age_s[channel] = n[0],
            _ => return Err(MakeError::UnknownEffect { name: hidden.name.to_owned() }),
        }
        Ok(())
    }
}
