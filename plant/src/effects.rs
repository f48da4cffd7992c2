//! The catalogue: what the baseline leaves out and a real servo-pneumatic axis has; one file for each effect.
//!
//! All are off unless a rig file switches them on by name and place, as `[effects.piston-leakage.drive]`. In
//! `plant/src`, a new effect is one file and one line in the list below; `example.rs`, which only tests see, is added that way.
//! What else it needs is in CONTRIBUTING.md.
//!
//! Source: effects.md, the catalogue of physical effects; each file names its own.

mod acting;
mod actuation;
mod air;
pub mod declared;
pub mod draw;
mod first_order;
mod flows;
mod friction;
pub(crate) mod laminar_gap;
mod memory;
mod node;
mod over_stroke;
mod readings;
pub mod remembered;
mod replaced;
mod sensor_force;
pub mod sheet;
mod sums;
pub mod tabulated;
mod terms;

use crate::parameters::RigParameters;
use crate::state::Axis;
pub(crate) use acting::Effects;
use declared::{DeclaredTerms, Target};
pub(crate) use friction::Friction;
pub(crate) use replaced::{dead_volumes_m3, linkage};
pub(crate) use sheet::OpenBalance;
use sheet::{ActiveEffect, Effect, Element, Law, Part, Place, PlaceKind, Sheet};
use tabulated::{Balance, Tables};
pub(crate) use terms::Term;
pub use terms::Terms;

/// What an effect is kept in, by the kind of its place: of one axis, `Axis` once, `Chamber` for a and b, `Channel` for position,
/// force, a and b.
macro_rules! slot {
    ($type:ty, Chamber) => { [Option<$type>; 2] };
    ($type:ty, Channel) => { [Option<$type>; 4] };
    ($type:ty, $kind:ident) => { Option<$type> };
}

/// The slot of an element.
macro_rules! at {
    ($slot:expr, $element:expr, Chamber) => {
        $slot[chamber($element)]
    };
    ($slot:expr, $element:expr, Channel) => {
        $slot[channel($element)]
    };
    ($slot:expr, $element:expr, $kind:ident) => {
        $slot
    };
}

/// Whether an effect is on at any element.
macro_rules! any {
    ($slot:expr, Chamber) => {
        $slot.iter().any(Option::is_some)
    };
    ($slot:expr, Channel) => {
        $slot.iter().any(Option::is_some)
    };
    ($slot:expr, $kind:ident) => {
        $slot.is_some()
    };
}

macro_rules! catalogue {
    ($($(#[$when:meta])* $module:ident: $type:ident, $kind:ident;)*) => {
        $($(#[$when])* mod $module;)*
        $($(#[$when])* use $module::$type;)*

        /// The effects of one axis that are switched on; those of linkage and supply stand with the drive's.
        #[derive(Debug, Clone, Default)]
        pub(crate) struct AxisEffects {
            $($(#[$when])* pub(crate) $module: slot!($type, $kind),)*
            /// Terms of no effect, from tables.
            pub(crate) tabulated: Tables,
            /// Terms that a file declares.
            pub(crate) declared: DeclaredTerms,
        }

        /// Every data sheet, that of the tests' example too.
        const ALL_SHEETS: &[Sheet] = &[$($(#[$when])* $type::SHEET),*];

        impl AxisEffects {
            fn switch_on(&mut self, switched: &ActiveEffect, numbers: &[f64], rig: &RigParameters) {
                $($(#[$when])*
                if switched.name == $type::SHEET.name {
                    at!(self.$module, switched.place.element, $kind) = Some($type::new(numbers, rig));
                })*
            }

            /// Whether the effect of this module is on, at this element where it is one of an element.
            pub(crate) fn is_on(&self, module: &str, element: Option<Element>) -> bool {
                match module {
                    $($(#[$when])* stringify!($module) => at!(self.$module, element, $kind).is_some(),)*
                    "tabulated" => self.tabulated.adds(balance_of(element)),
                    "declared" => self.declared.adds(target_of(element, false)),
                    "declared_reading" => self.declared.adds(target_of(element, true)),
                    _ => false,
                }
            }

            /// Calls `each` with the laws of every effect that is on.
            fn each_law(&self, mut each: impl FnMut(Law)) {
                $($(#[$when])*
                if any!(self.$module, $kind) {
                    $type::SHEET.laws.iter().for_each(|law| each(*law));
                })*
            }

            /// Calls `each` with module and term of every effect that adds to an open balance.
            #[inline(always)]
            pub(crate) fn each_term(&self, balance: &OpenBalance<'_>, mut each: impl FnMut(&'static str, f64)) {
                let _element = balance.element(); // not read where all effects are of an axis
                $($(#[$when])*
                if let Some(term) = at!(self.$module, _element, $kind).as_ref().and_then(|on| on.open_term(balance)) {
                    each(stringify!($module), term);
                })*
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
    #[cfg(test)] example: Example, Axis;
}

/// The data sheets of all effects, in the order of the catalogue.
#[cfg(not(test))]
pub const SHEETS: &[Sheet] = ALL_SHEETS;
/// The same without the tests' example, which stands last.
#[cfg(test)]
pub const SHEETS: &[Sheet] = ALL_SHEETS.split_last().expect("the example is there").1;

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
        for (effects, axis) in axes.iter_mut().zip(Axis::ALL) {
            effects.tabulated = Tables::of(rig, axis);
            effects.declared = DeclaredTerms::of(rig, axis);
        }
        axes
    }
}

/// Which laws of an axis have effects in them; the others are the baseline's.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct ChangedLaws {
    pub(crate) spool: bool,
    pub(crate) air: bool,
    pub(crate) stored_air: bool,
    pub(crate) friction: bool,
    pub(crate) force: bool,
    pub(crate) past_readings: bool,
}

impl ChangedLaws {
    /// By the sheets of the effects of both axes, and their tables.
    pub(crate) fn of(on: &[AxisEffects; 2]) -> [ChangedLaws; 2] {
        let mut both = [ChangedLaws::default(); 2];
        for (axis, effects) in on.iter().enumerate() {
            effects.each_law(|law| match law {
                Law::Spool => both[axis].spool = true,
                Law::Air => both[axis].air = true,
                Law::Supply => both.iter_mut().for_each(|axis| axis.air = true),
                Law::StoredAir => (both[axis].air, both[axis].stored_air) = (true, true),
                Law::Friction => both[axis].friction = true,
                Law::Force => both[axis].force = true,
                Law::PastReadings => both[axis].past_readings = true,
            });
            if effects.tabulated.adds_air() || effects.declared.adds_air() {
                (both[axis].air, both[axis].stored_air) = (true, true);
            }
            both[axis].force |=
                effects.tabulated.adds(Balance::Force) || effects.declared.adds(Target::Force);
        }
        both
    }
}

impl AxisEffects {
    /// The sum of the terms of an open balance.
    #[inline(always)]
    pub(crate) fn added(&self, balance: OpenBalance<'_>) -> f64 {
        let mut sum = 0.0;
        self.each_term(&balance, |_, term| sum += term);
        sum
    }
}

/// Whether effects change constants and what sensors show at an instant, and nothing else.
fn act_in_no_step(on: &[AxisEffects; 2], changed_laws: &[ChangedLaws; 2]) -> bool {
    let declared = on.iter().any(|on| on.declared.any());
    !declared && changed_laws.iter().all(|laws| *laws == ChangedLaws::default())
}

/// Whether the baseline's laws move a plant of this rig: nothing is added to it, or what changes constants and readings alone.
#[must_use]
pub fn leave_laws_alone(rig: &RigParameters) -> bool {
    let on = AxisEffects::of(rig);
    act_in_no_step(&on, &ChangedLaws::of(&on))
}

/// The sheet of an effect by its name.
#[must_use]
pub fn sheet(name: &str) -> Option<&'static Sheet> {
    ALL_SHEETS.iter().find(|sheet| sheet.name == name)
}

/// The balance of tables at a chamber, or at none.
fn balance_of(element: Option<Element>) -> Balance {
    match element {
        Some(Element::A) => Balance::FlowA,
        Some(Element::B) => Balance::FlowB,
        _ => Balance::Force,
    }
}

/// The target of declared terms at an element, of a reading or of a balance before it.
fn target_of(element: Option<Element>, is_reading: bool) -> Target {
    let here = |target: &Target| {
        let of_reading = target.kind() == PlaceKind::Channel;
        of_reading == is_reading && target.element() == element
    };
    Target::ALL.into_iter().find(here).unwrap_or(Target::Force)
}

fn chamber(element: Option<Element>) -> usize {
    usize::from(element == Some(Element::B))
}

/// In the order of a measurement's columns.
fn channel(element: Option<Element>) -> usize {
    match element {
        Some(Element::Position) | None => 0,
        Some(Element::Force) => 1,
        Some(Element::A) => 2,
        Some(Element::B) => 3,
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
