//! What is known of an effect before it is switched on: its name, where it can be, its keys with units and ranges.
//!
//! The reader of rig files, the drawing of sealed rigs, the study and the documents all read these sheets, so that each
//! range stands in one place: the file of its effect.

use std::fmt;

use super::friction::FrictionConditions;
use super::tabulated::AxisConditions;
use crate::parameters::RigParameters;
use crate::parameters::table::Unit;

/// The data sheet of an effect.
#[derive(Debug, Clone, Copy)]
pub struct Sheet {
    /// Name in rig files and reports, as `piston-leakage`.
    pub name: &'static str,
    /// Group of the catalogue.
    pub group: Group,
    /// Where it can be switched on.
    pub place: PlaceKind,
    /// The laws of an axis that it changes; an axis steps by the baseline's laws but for those of the effects on it.
    pub laws: &'static [Law],
    /// The change to the baseline in a sentence.
    pub law: &'static str,
    /// Where law and range come from.
    pub source: &'static str,
    /// Its numbers; the first one is its amplitude.
    pub keys: &'static [EffectKey],
    /// Whether traces are nonlinear in the amplitude.
    pub nonlinear_in_amplitude: bool,
    /// Whether the first number alone makes it this effect.
    pub defined_by_first: bool,
    /// Whether the states from which linked rods start depend on it: screening underrates it, with states estimated without it.
    pub moves_start_states: bool,
    /// Values of the second number that screening tries beside the default, as differences to it in widths of `drawn`.
    pub also_screened: &'static [f64],
    /// Whether the plant keeps something of it from step to step.
    pub has_memory: bool,
    /// Motion that excites it.
    pub excited_by: Excitation,
    /// The error of a sensor that the first number is; the sensor, where the place names none.
    pub sensor_error: Option<(SensorError, Option<Element>)>,
    /// Measurements by hand that discriminate it from its twins.
    pub distinguished_by: &'static [ManualMeasurement],
}

impl Sheet {
    /// What most effects have alike.
    pub const USUAL: Sheet = Sheet {
        name: "",
        group: Group::Motion,
        place: PlaceKind::Axis,
        laws: &[],
        law: "",
        source: "",
        keys: &[],
        nonlinear_in_amplitude: false,
        defined_by_first: false,
        moves_start_states: false,
        also_screened: &[],
        has_memory: false,
        excited_by: Excitation::Any,
        sensor_error: None,
        distinguished_by: &[],
    };

    /// The place of this kind that a rig file calls so, as `drive` or `drive.a`.
    #[must_use]
    pub fn place_named(&self, name: &str) -> Option<Place> {
        self.place.places().iter().copied().find(|place| place.to_string() == name)
    }
}

/// One number of an effect, in the file's unit.
#[derive(Debug, Clone, Copy)]
pub struct EffectKey {
    /// Name in the rig file, ending in its unit.
    pub name: &'static str,
    /// Unit of the value in the file.
    pub unit: Unit,
    /// Smallest value that a file may hold.
    pub min: f64,
    /// Largest value that a file may hold.
    pub max: f64,
    /// Smallest and largest magnitude that occur on axes of this kind: what sealed rigs and studies draw from.
    pub drawn: [f64; 2],
    /// Whether the drawn magnitude gets either sign.
    pub signed: bool,
    /// Value when the file is silent; without one the file must hold the key.
    pub default: Option<f64>,
    /// Value at which the rig is the baseline; `None` for a number that only shapes the effect, or when there is none.
    pub neutral: Option<f64>,
    /// What the number is.
    pub meaning: &'static str,
}

impl EffectKey {
    /// What most numbers have alike: from 0, where the rig is the baseline, of one sign, and asked for.
    pub(super) const USUAL: EffectKey = EffectKey {
        name: "",
        unit: Unit::One,
        min: 0.0,
        max: f64::NAN,
        drawn: [f64::NAN; 2],
        signed: false,
        default: None,
        neutral: Some(0.0),
        meaning: "",
    };

    /// The allowed values in words, as `0 to 10 %`.
    #[must_use]
    pub fn range(&self) -> String {
        format!("{} to {} {}", self.min, self.max, self.unit.name()).trim_end().to_owned()
    }
}

/// Declares the numbers of an effect, each by a field in SI and its [`EffectKey`]: a struct with these fields, `KEYS` for its
/// sheet, and `of`, which reads the struct from numbers in their order.
macro_rules! effect_numbers {
    ($(#[$about:meta])* $visibility:vis struct $name:ident { $($field:ident: $key:expr,)+ }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        $visibility struct $name { $($visibility $field: f64,)+ }

        impl $name {
            const KEYS: &'static [EffectKey] = &[$($key),+];

            fn of(numbers: &[f64]) -> Self {
                let &[$($field),+] = numbers else {
                    panic!("{} numbers for {} keys", numbers.len(), Self::KEYS.len())
                };
                Self { $($field),+ }
            }
        }
    };
}
pub(super) use effect_numbers;

/// Groups of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// Valve, lines, silencer, supply.
    Flow,
    /// What the air in the chambers does.
    Chamber,
    /// Forces and friction.
    Motion,
    /// What sensors make of the truth.
    Sensor,
}

/// Laws of an axis that have a baseline form and one with effects. Algebraic readings have one form only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// From command to spool.
    Spool,
    /// Flow through the ports.
    Air,
    /// The supply pressure of both axes.
    Supply,
    /// The stored air of a chamber, beside the valve's flow.
    StoredAir,
    /// Friction.
    Friction,
    /// Forces on the piston beside air, hand, contact and friction.
    Force,
    /// Readings that depend on earlier instants.
    PastReadings,
}

/// Motions that excite effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Excitation {
    /// Any stroke.
    Any,
    /// Slow enough for friction to matter.
    Creeping,
    /// Fast enough for the exhausts to be below the speed of sound, where the pressure behind them counts.
    Fast,
    /// From near an end, where a chamber is small.
    NearEnd,
    /// Into an end.
    IntoEnd,
    /// Linked rods that press and pull.
    LinkedRods,
}

/// Errors of a sensor that shows y(t) = (1 + g) x(t - d) + o of x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorError {
    /// d; smooth motion takes a lag for it.
    Delay,
    /// g.
    Gain,
    /// o.
    Offset,
}

/// Manual measurements, for effects that no experiment discriminates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ManualMeasurement {
    /// Both chambers at the atmosphere, a gauge at the supply.
    Venting,
    /// A known angle of the rig.
    Tilting,
    /// A weight on the force sensor.
    KnownWeight,
    /// A second, faster position sensor.
    PositionSensor,
    /// A fast pressure sensor at a chamber's port.
    PortPressure,
    /// The position of the spool.
    SpoolSignal,
    /// The piston locked for minutes, ports plugged, supply shut.
    LockedHold,
    /// A chamber filled and vented, the piston locked.
    ConstantVolume,
    /// The piston at both ends of its stroke.
    PressedEnds,
    /// The rods apart.
    Uncoupling,
    /// A force gauge at the vented piston.
    Pulling,
}

/// Where effects of a kind can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaceKind {
    /// `drive` or `load`.
    Axis,
    /// One chamber or its sensor: `drive.a`, `drive.b`, `load.a`, `load.b`.
    Chamber,
    /// One channel of the measurement: `drive.position`, `drive.force`, `drive.a`, `drive.b`, and those of the load.
    Channel,
    /// `linkage`.
    Linkage,
    /// `supply`, of both axes.
    Supply,
}

impl PlaceKind {
    /// All places of the kind.
    #[must_use]
    pub fn places(self) -> &'static [Place] {
        use Element::{A, B, Force, Position};
        use Part::{Drive, Linkage, Load, Supply};
        const fn at(part: Part, element: Option<Element>) -> Place {
            Place { part, element }
        }
        match self {
            PlaceKind::Axis => const { &[at(Drive, None), at(Load, None)] },
            PlaceKind::Chamber => {
                const { &[at(Drive, Some(A)), at(Drive, Some(B)), at(Load, Some(A)), at(Load, Some(B))] }
            }
            PlaceKind::Channel => {
                const {
                    &[
                        at(Drive, Some(Position)),
                        at(Drive, Some(Force)),
                        at(Drive, Some(A)),
                        at(Drive, Some(B)),
                        at(Load, Some(Position)),
                        at(Load, Some(Force)),
                        at(Load, Some(A)),
                        at(Load, Some(B)),
                    ]
                }
            }
            PlaceKind::Linkage => const { &[at(Linkage, None)] },
            PlaceKind::Supply => const { &[at(Supply, None)] },
        }
    }
}

/// A place at the rig where an effect is switched on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Place {
    /// Axis or joint.
    pub part: Part,
    /// Chamber or channel, for effects of one.
    pub element: Option<Element>,
}

/// Parts of the rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Part {
    /// The drive axis.
    Drive,
    /// The load axis.
    Load,
    /// What joins the axes.
    Linkage,
    /// What feeds both.
    Supply,
}

/// Elements of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Element {
    /// Cap-side chamber, its pressure sensor.
    A,
    /// Rod-side chamber, its pressure sensor.
    B,
    /// Position sensor.
    Position,
    /// Force sensor.
    Force,
}

impl Part {
    /// As in rig files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Part::Drive => "drive",
            Part::Load => "load",
            Part::Linkage => "linkage",
            Part::Supply => "supply",
        }
    }
}

impl Element {
    /// As in rig files and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Element::A => "a",
            Element::B => "b",
            Element::Position => "position",
            Element::Force => "force",
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.part.name())?;
        self.element.map_or(Ok(()), |element| write!(out, ".{}", element.name()))
    }
}

/// An effect switched on at one place, with its numbers in the file's units, in the order of its sheet's keys.
#[derive(Debug, Clone, PartialEq)]
pub struct ActiveEffect {
    /// Name of the effect.
    pub name: &'static str,
    /// Where it is.
    pub place: Place,
    /// One number for each key of its sheet.
    pub numbers: Vec<f64>,
}

/// An effect of the catalogue; its fields are the numbers of its sheet at one place, in SI.
pub(crate) trait Effect: Sized {
    const SHEET: Sheet;

    /// The effect at one place: `numbers` in SI, one for each key, already checked against the sheet.
    fn new(numbers: &[f64], rig: &RigParameters) -> Self;

    /// Its term of a balance, in SI; `None` for a balance that it does not act on.
    ///
    /// Terms that need memory, a flow that is solved for, or a fixed place in the order of a sum are named in `sums.rs` instead.
    #[inline(always)] // an effect without open terms costs nothing
    fn open_term(&self, _balance: &OpenBalance<'_>) -> Option<f64> {
        None
    }
}

/// A balance to which an effect adds from its own file, with what the term may depend on.
#[derive(Debug, Clone, Copy)]
#[allow(dead_code)] // no shipped effect reads all of it
pub(crate) enum OpenBalance<'a> {
    /// Opening of the edges, by the spool's position; laws: [`Law::Air`].
    Opening { spool: f64 },
    /// Normal flow into a chamber beside the valve's, m^3/s; laws: [`Law::StoredAir`].
    Leakage { chamber: usize, conditions: &'a AxisConditions },
    /// Sliding level at a speed, N; direction 1 extending, -1 retracting; laws: [`Law::Friction`]. A term over the speed is of
    /// second order in the step only where `Friction::middle_speed` knows its effect.
    SlidingLevel { at: &'a FrictionConditions, speed_m_per_s: f64, direction: f64 },
    /// Break-away level, N; laws: [`Law::Friction`].
    BreakAwayLevel { at: &'a FrictionConditions, direction: f64 },
    /// Force on the piston along its extension, N; laws: [`Law::Force`].
    Force(&'a AxisConditions),
    /// Reading of the position by its truth, m; laws: none.
    PositionReading { truth_m: f64 },
    /// Reading of the force by its truth, N; laws: none.
    ForceReading { truth_n: f64 },
    /// Reading of a pressure by its truth, Pa; laws: none.
    PressureReading { chamber: usize, truth_pa: f64 },
}

impl OpenBalance<'_> {
    /// The chamber or sensor it belongs to: effects of that element act on it, and those of the axis.
    pub(super) const fn element(&self) -> Option<Element> {
        match self {
            OpenBalance::Leakage { chamber, .. } | OpenBalance::PressureReading { chamber, .. } => {
                Some([Element::A, Element::B][*chamber])
            }
            OpenBalance::PositionReading { .. } => Some(Element::Position),
            OpenBalance::ForceReading { .. } => Some(Element::Force),
            _ => None,
        }
    }
}
