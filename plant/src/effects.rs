//! The catalogue: what the baseline leaves out and a real servo-pneumatic axis has; one file for each effect.
//!
//! All are off unless a rig file switches them on by name and place, as `[effects.piston-leakage.drive]`. A new effect is one
//! file and one line in the list below.
//!
//! Source: effects.md, the catalogue of physical effects; each file names its own.

mod acting;
mod actuation;
mod air;
pub mod draw;
mod first_order;
mod flows;
mod friction;
pub(crate) mod laminar_gap;
mod memory;
mod node;
mod over_stroke;
mod readings;
mod replaced;
pub mod sheet;
mod sums;
pub mod tabulated;
mod terms;

use crate::parameters::RigParameters;
use crate::state::Axis;
pub(crate) use acting::Effects;
pub(crate) use replaced::{dead_volumes_m3, linkage};
use sheet::{Effect, Element, Part, Place, PlaceKind, Sheet, Switched};
use tabulated::{Balance, Tables};
pub(crate) use terms::Term;
pub use terms::Terms;

/// What an effect is kept in, by the kind of its place: of one axis, `Axis` once, `Chamber` for a and b, `Channel` for position,
/// force, a and b.
macro_rules! slot {
    ($type:ty, Axis) => { Option<$type> };
    ($type:ty, Chamber) => { [Option<$type>; 2] };
    ($type:ty, Channel) => { [Option<$type>; 4] };
    ($type:ty, Linkage) => { Option<$type> };
    ($type:ty, Supply) => { Option<$type> };
}

macro_rules! put {
    ($slot:expr, $place:expr, $effect:expr, Axis) => {
        $slot = Some($effect)
    };
    ($slot:expr, $place:expr, $effect:expr, Linkage) => {
        $slot = Some($effect)
    };
    ($slot:expr, $place:expr, $effect:expr, Supply) => {
        $slot = Some($effect)
    };
    ($slot:expr, $place:expr, $effect:expr, Chamber) => {
        $slot[chamber($place)] = Some($effect)
    };
    ($slot:expr, $place:expr, $effect:expr, Channel) => {
        $slot[channel($place)] = Some($effect)
    };
}

macro_rules! is_in {
    ($slot:expr, $element:expr, Chamber) => {
        match $element {
            Some(Element::B) => $slot[1].is_some(),
            _ => $slot[0].is_some(),
        }
    };
    ($slot:expr, $element:expr, Channel) => {
        match $element {
            Some(Element::Force) => $slot[1].is_some(),
            Some(Element::A) => $slot[2].is_some(),
            Some(Element::B) => $slot[3].is_some(),
            _ => $slot[0].is_some(),
        }
    };
    ($slot:expr, $element:expr, $kind:ident) => {
        $slot.is_some()
    };
}

macro_rules! catalogue {
    ($($module:ident: $type:ident, $kind:ident;)*) => {
        $(mod $module;)*
        $(use $module::$type;)*

        /// The effects of one axis that are switched on; those of linkage and supply stand with the drive's.
        #[derive(Debug, Clone, Default)]
        pub(crate) struct AxisEffects {
            $(pub(crate) $module: slot!($type, $kind),)*
            /// Terms of no effect, from tables.
            pub(crate) tabulated: Tables,
        }

        /// The data sheets of all effects, in the order of the catalogue.
        pub const SHEETS: &[Sheet] = &[$($type::SHEET),*];

        impl AxisEffects {
            fn switch_on(&mut self, switched: &Switched, numbers: &[f64], rig: &RigParameters) {
                $(if switched.name == $type::SHEET.name {
                    put!(self.$module, switched.place, $type::new(numbers, rig), $kind);
                })*
            }

            /// Whether the effect of this module is on, at this element where it is one of an element.
            pub(crate) fn is_on(&self, module: &str, element: Option<Element>) -> bool {
                match module {
                    $(stringify!($module) => is_in!(self.$module, element, $kind),)*
                    "tabulated" => self.tabulated.adds(balance_of(element)),
                    _ => false,
                }
            }
        }
    };
}

#[rustfmt::skip] // a list of one line for each effect
catalogue! {
    critical_pressure_ratio: CriticalPressureRatio, Axis;
    valve_characteristic: ValveCharacteristic, Axis;
    valve_dead_zone: ValveDeadZone, Axis;
    valve_hysteresis: ValveHysteresis, Axis;
    valve_offset: ValveOffset, Axis;
    valve_null_leakage: ValveNullLeakage, Axis;
    spool_second_order: SpoolSecondOrder, Axis;
    spool_rate_limit: SpoolRateLimit, Axis;
    line_delay: LineDelay, Axis;
    line_resistance: LineResistance, Axis;
    check_valve_restriction: CheckValveRestriction, Axis;
    silencer_back_pressure: SilencerBackPressure, Axis;
    supply_droop: SupplyDroop, Supply;
    command_dead_time: CommandDeadTime, Axis;
    heat_exchange: HeatExchange, Axis;
    dead_volume: DeadVolume, Axis;
    piston_leakage: PistonLeakage, Axis;
    rod_leakage: RodLeakage, Chamber;
    stribeck_friction: StribeckFriction, Axis;
    presliding: Presliding, Axis;
    friction_asymmetry: FrictionAsymmetry, Axis;
    pressure_dependent_friction: PressureDependentFriction, Axis;
    position_dependent_friction: PositionDependentFriction, Axis;
    inclination: Inclination, Axis;
    position_dependent_force: PositionDependentForce, Axis;
    rest_time_dependent_break_away: RestTimeDependentBreakAway, Axis;
    coupling_backlash: CouplingBacklash, Linkage;
    coupling_compliance: CouplingCompliance, Linkage;
    end_cushion: EndCushion, Axis;
    position_sensor_lag: PositionSensorLag, Axis;
    position_sensor_offset: PositionSensorOffset, Axis;
    position_sensor_gain: PositionSensorGain, Axis;
    pressure_sensor_lag: PressureSensorLag, Chamber;
    pressure_sensor_offset: PressureSensorOffset, Chamber;
    pressure_sensor_gain: PressureSensorGain, Chamber;
    force_sensor_offset: ForceSensorOffset, Axis;
    force_sensor_gain: ForceSensorGain, Axis;
    time_skew: TimeSkew, Channel;
}

impl AxisEffects {
    /// The effects of both axes that a rig has switched on.
    pub(crate) fn of(rig: &RigParameters) -> [AxisEffects; 2] {
        let mut axes = [AxisEffects::default(), AxisEffects::default()];
        for switched in rig.effects() {
            let sheet = sheet(switched.name).expect("the reader knows the effect");
            let numbers: Vec<f64> = sheet
                .keys
                .iter()
                .zip(&switched.numbers)
                .map(|(key, number)| key.unit.to_si(*number))
                .collect();
            axes[usize::from(switched.place.part == Part::Load)].switch_on(switched, &numbers, rig);
        }
        for (own, axis) in axes.iter_mut().zip(Axis::ALL) {
            own.tabulated = Tables::of(rig, axis);
        }
        axes
    }
}

/// Which laws of an axis have effects in them; what has none goes by the baseline's.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Touched {
    /// From command to spool.
    pub(crate) spool: bool,
    /// What passes the ports, and what the air in the chambers does.
    pub(crate) air: bool,
    /// Friction.
    pub(crate) friction: bool,
    /// What sensors show of the past.
    pub(crate) sensors: bool,
}

impl AxisEffects {
    /// Which laws of this axis have effects in them, itself or by the supply.
    fn touched(&self, supply_droop: bool) -> Touched {
        let passage = self.critical_pressure_ratio.is_some()
            || self.valve_characteristic.is_some()
            || self.valve_dead_zone.is_some()
            || self.valve_null_leakage.is_some()
            || self.line_delay.is_some()
            || self.line_resistance.is_some()
            || self.check_valve_restriction.is_some()
            || self.silencer_back_pressure.is_some()
            || self.end_cushion.is_some();
        Touched {
            spool: self.valve_hysteresis.is_some()
                || self.valve_offset.is_some()
                || self.spool_second_order.is_some()
                || self.spool_rate_limit.is_some()
                || self.command_dead_time.is_some(),
            air: passage || self.adds_air() || supply_droop,
            friction: self.stribeck_friction.is_some()
                || self.presliding.is_some()
                || self.friction_asymmetry.is_some()
                || self.pressure_dependent_friction.is_some()
                || self.position_dependent_friction.is_some()
                || self.rest_time_dependent_break_away.is_some(),
            sensors: self.position_sensor_lag.is_some()
                || self.pressure_sensor_lag.iter().any(Option::is_some)
                || self.time_skew.iter().any(Option::is_some),
        }
    }

    /// Whether something but the valve's flow changes the air in the chambers.
    pub(crate) fn adds_air(&self) -> bool {
        self.heat_exchange.is_some()
            || self.piston_leakage.is_some()
            || self.rod_leakage.iter().any(Option::is_some)
            || self.tabulated.adds_air()
    }
}

/// The sheet of an effect by its name.
#[must_use]
pub fn sheet(name: &str) -> Option<&'static Sheet> {
    SHEETS.iter().find(|sheet| sheet.name == name)
}

/// The balance of tables at a chamber, or at none.
fn balance_of(element: Option<Element>) -> Balance {
    match element {
        Some(Element::A) => Balance::FlowA,
        Some(Element::B) => Balance::FlowB,
        _ => Balance::Force,
    }
}

fn chamber(place: Place) -> usize {
    usize::from(place.element == Some(Element::B))
}

/// In the order of a measurement's columns.
fn channel(place: Place) -> usize {
    match place.element {
        Some(Element::Position) | None => 0,
        Some(Element::Force) => 1,
        Some(Element::A) => 2,
        Some(Element::B) => 3,
    }
}

impl Sheet {
    /// The place of this kind that a rig file calls so, as `drive` or `drive.a`.
    #[must_use]
    pub fn place_named(&self, name: &str) -> Option<Place> {
        self.place.places().iter().copied().find(|place| place.to_string() == name)
    }
}

impl PlaceKind {
    /// The names of its places.
    #[must_use]
    pub fn names(self) -> Vec<String> {
        self.places().iter().map(Place::to_string).collect()
    }
}

#[cfg(test)]
mod tests;
