//! declared: a term that a file declares as an expression, for what the catalogue lacks.
//!
//! ```text
//! force   = f(x, v, p_a, p_b, u, s, t, F)             along the axis' own extension, N
//! flow    = f(x, v, p_a, p_b, u, s, t, F) g(p) / rho   into a chamber; f in kg/s
//! reading = truth + f(x, v, p_a, p_b, u, s, t, F)      of a sensor, m, N or Pa
//! g(p)    = p / p_exhaust for f < 0, 2 - p / p_supply for f > 0, within 0 to 1
//! ```
//!
//! x extension of the axis, m; v its rate, m/s; p_a, p_b absolute pressures of its chambers, Pa; u command, s spool, -1 to 1;
//! t time since the plant began, s; F what its force sensor should show, N; rho density at normal conditions, kg/m^3. Extension
//! and pressures are those at the midpoint of a step; v, u, s and t those at its beginning, since the force itself decides on the
//! speed after. Terms of one target add up.
//!
//! F in a force or a flow is that of the end of the substep before: the sensor of the drive shows the carriage's acceleration,
//! which the force itself decides on, so that F of the same instant would be an algebraic loop. Resolved step by step, the loop
//! converges where a force changes by less than (moved mass)/(carriage and weights) N for each N of F; beyond it swings between
//! the bounds of a force. The load's sensor shows contact and hand alone: no loop.
//!
//! A term may keep values from step to step ([`super::remembered`]), and is then over them too.
//!
//! Every expression is proven finite over [`VARIABLES`] and the ranges of its parameters before it acts; a variable beyond its
//! range counts as the end of it. Force and flow are held at the largest that a table may have, so that no slope makes a step run
//! away.
//!
//! It is no effect of the catalogue: `[[terms]]` of a rig file holds it, and `[[suspects]]` of a file beside one holds terms that
//! may be missing.
//!
//! A term may read curves of its file, straight between their points and level beyond them ([`expression::curve`]).
//!
//! Properties: the value of its expression; two terms are their sum; nothing is allocated.
//!
//! Source: the file that declares it.

use super::remembered::{MemoryLaw, MemoryVariable, renew};
use super::sheet::{Element, Part, Place, PlaceKind};
use super::tabulated::{AxisConditions, MOST_FLOW_NL_PER_MIN, MOST_FORCE_N, neither_empties_nor_bursts};
use crate::parameters::table::Unit;
use crate::parameters::{ParameterError, RigParameters};
use crate::state::Axis;
use expression::curve::Table;
use expression::formula::{Formula, Variable};
use expression::units::Dimension;
use std::ops::Range;

/// Parameters of a term at most.
pub const MOST_PARAMETERS: usize = 6;
/// Values that a term keeps at most.
pub const MOST_REMEMBERED: usize = 2;
/// Terms of a file at most.
pub const MOST_TERMS: usize = 32;
/// What expressions are over: name, unit, least and largest value.
pub const VARIABLES: [(&str, &str, [f64; 2]); 8] = [
    ("x", "m", [0.0, 10.0]),
    ("v", "m/s", [-1e3, 1e3]),
    ("p_a", "Pa", [1.0, 1e8]),
    ("p_b", "Pa", [1.0, 1e8]),
    ("u", "1", [-1.0, 1.0]),
    ("s", "1", [-1.0, 1.0]),
    ("t", "s", [0.0, 1e7]),
    ("F", "N", [-1e6, 1e6]),
];
/// Place of F among them.
pub(crate) const SENSOR_FORCE: usize = VARIABLES.len() - 1;
/// Specific gas constant of air, J/(kg K).
const GAS_J_PER_KG_K: f64 = 287.0;

/// What a term adds to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// Force on the piston.
    Force,
    /// Flow into chamber a.
    FlowA,
    /// Flow into chamber b.
    FlowB,
    /// Reading of the position sensor.
    Position,
    /// Reading of the force sensor.
    ForceReading,
    /// Reading of the pressure sensor of chamber a.
    PressureA,
    /// Reading of the pressure sensor of chamber b.
    PressureB,
}

impl Target {
    /// The places that a term may act on.
    pub const ALL: [Target; 7] = [
        Target::Force,
        Target::FlowA,
        Target::FlowB,
        Target::Position,
        Target::ForceReading,
        Target::PressureA,
        Target::PressureB,
    ];

    /// As in `drive.force`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Target::Force => "force",
            Target::FlowA => "flow-a",
            Target::FlowB => "flow-b",
            Target::Position => "position-reading",
            Target::ForceReading => "force-reading",
            Target::PressureA => "pressure-a-reading",
            Target::PressureB => "pressure-b-reading",
        }
    }

    /// Unit of the expression.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Target::Force | Target::ForceReading => "N",
            Target::FlowA | Target::FlowB => "kg/s",
            Target::Position => "m",
            Target::PressureA | Target::PressureB => "Pa",
        }
    }

    /// Chamber or sensor that it belongs to.
    #[must_use]
    pub const fn element(self) -> Option<Element> {
        match self {
            Target::Force => None,
            Target::FlowA | Target::PressureA => Some(Element::A),
            Target::FlowB | Target::PressureB => Some(Element::B),
            Target::Position => Some(Element::Position),
            Target::ForceReading => Some(Element::Force),
        }
    }

    /// The places that it is one of.
    #[must_use]
    pub const fn kind(self) -> PlaceKind {
        match self {
            Target::Force => PlaceKind::Axis,
            Target::FlowA | Target::FlowB => PlaceKind::Chamber,
            _ => PlaceKind::Channel,
        }
    }
}

/// [`VARIABLES`] for an expression.
pub(crate) fn variables() -> Vec<Variable<'static>> {
    VARIABLES
        .iter()
        .map(|(name, unit, range)| Variable { name, dimension: dimension(unit), range: *range })
        .collect()
}

pub(crate) fn dimension(unit: &str) -> Dimension {
    expression::units::Unit::parse(unit).map(|unit| unit.dimension).expect("a unit of this module")
}

/// A number of a declared term.
#[derive(Debug, Clone, PartialEq)]
pub struct Number {
    /// Its name in the expression.
    pub name: String,
    /// Its unit, as the file writes it.
    pub unit: expression::units::Unit,
    /// Its value, in the unit of the file; of a suspect the value at which it is off.
    pub value: f64,
    /// Least and largest value, in the unit of the file.
    pub range: [f64; 2],
    /// How large it is where the term matters, in the unit of the file, if the file says so.
    pub prior: Option<f64>,
}

/// A term as a file declares it, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    /// What reports call it.
    pub name: String,
    /// Axis that it acts on.
    pub axis: Axis,
    /// What it adds to.
    pub target: Target,
    /// As the rig file writes it.
    pub add: String,
    pub(crate) numbers: Vec<Number>,
    /// What it keeps from step to step, in the order of the file.
    pub memory: Vec<MemoryVariable>,
    /// Curves that its expressions read.
    pub(crate) tables: Vec<Table>,
    /// Effects or suspects that are known to do the same.
    pub twins: Vec<String>,
    pub(crate) formula: Formula,
}

impl Declared {
    /// Axis and target, as in the file.
    #[must_use]
    pub fn place(&self) -> String {
        format!("{}.{}", self.axis.name(), self.target.name())
    }

    /// Its numbers, in the order of the file.
    #[must_use]
    pub fn numbers(&self) -> &[Number] {
        &self.numbers
    }

    /// Its place, as of an effect: the axis of a force, the chamber of a flow, the sensor of a reading.
    #[must_use]
    pub fn at(&self) -> Place {
        let part = if self.axis == Axis::Drive { Part::Drive } else { Part::Load };
        Place { part, element: self.target.element() }
    }

    /// Whether two stand for one term, with whatever numbers.
    #[must_use]
    pub fn is_same(&self, other: &Declared) -> bool {
        self.name == other.name && self.at() == other.at()
    }

    /// Its value, in SI, at these values of [`VARIABLES`], where the plant begins there.
    #[must_use]
    pub fn value(&self, at: &[f64; VARIABLES.len()]) -> f64 {
        let kept: Vec<f64> = self.memory.iter().map(|one| one.law().begin(at)).collect();
        self.value_keeping(at, &kept)
    }

    /// Its value, in SI, at these values of [`VARIABLES`] and of what it keeps.
    pub(crate) fn value_keeping(&self, at: &[f64; VARIABLES.len()], kept: &[f64]) -> f64 {
        value(&self.formula, at, kept)
    }

    /// The same with other values of its numbers, in the units of the file.
    ///
    /// # Errors
    /// [`ParameterError`] for a value out of its range, and for another number of them.
    pub fn with(&self, values: &[f64]) -> Result<Self, ParameterError> {
        let mut changed = self.clone();
        if values.len() != self.numbers.len() {
            let message = format!("{} numbers for the {} of {}", values.len(), self.numbers.len(), self.name);
            return Err(ParameterError::of_term(&self.name, &message));
        }
        for (number, value) in changed.numbers.iter_mut().zip(values) {
            let [least, most] = number.range;
            if !(least..=most).contains(value) {
                let message = format!("{} = {value}: allowed are {least} to {most}", number.name);
                return Err(ParameterError::of_term(&self.name, &message));
            }
            number.value = *value;
        }
        changed.set_formulas();
        Ok(changed)
    }

    /// Takes the values of the numbers over into the expressions.
    pub(crate) fn set_formulas(&mut self) {
        let values_si = self.values_si();
        self.formula.set(&values_si);
        self.memory.iter_mut().for_each(|one| one.set(&values_si));
    }

    fn values_si(&self) -> Vec<f64> {
        self.numbers.iter().map(|number| number.value * number.unit.factor).collect()
    }
}

/// Values of an axis at an instant that expressions of terms read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TermInputs<'a> {
    pub(crate) conditions: &'a AxisConditions,
    pub(crate) command: f64,
    pub(crate) time_s: f64,
    /// What the force sensor should show, N; in a step that of the end of the substep before.
    pub(crate) sensor_force_n: f64,
    /// What the axis' terms keep, SI, in the order of [`DeclaredTerms::begin`].
    pub(crate) kept: &'a [f64],
}

impl TermInputs<'_> {
    /// In the order of [`VARIABLES`].
    pub(super) fn values(&self) -> [f64; VARIABLES.len()] {
        let AxisConditions { extension_m, velocity_m_per_s, spool, pressure_pa: [a, b] } = *self.conditions;
        [extension_m, velocity_m_per_s, a, b, self.command, spool, self.time_s, self.sensor_force_n]
    }
}

/// The value of an expression of a term.
fn value(formula: &Formula, at: &[f64; VARIABLES.len()], kept: &[f64]) -> f64 {
    let mut all = [0.0; VARIABLES.len() + MOST_REMEMBERED];
    all[..VARIABLES.len()].copy_from_slice(at);
    all[VARIABLES.len()..][..kept.len()].copy_from_slice(kept);
    formula.value(&all[..VARIABLES.len() + kept.len()])
}

/// A declared term of an axis.
#[derive(Debug, Clone)]
struct ActiveTerm {
    target: Target,
    formula: Formula,
    /// Range of its memory variables among those of its axis.
    kept: Range<usize>,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct DeclaredTerms {
    terms: Vec<ActiveTerm>,
    laws: Vec<MemoryLaw>,
    /// Whether a force, a flow or what is kept is over the force sensor.
    pub(crate) follows_sensor: bool,
    kg_per_m3: f64,
    exhaust_pa: f64,
    supply_pa: f64,
}

impl DeclaredTerms {
    pub(crate) fn of(rig: &RigParameters, axis: Axis) -> Self {
        let (mut terms, mut laws) = (Vec::new(), Vec::new());
        let mut follows_sensor = false;
        for term in rig.terms().iter().filter(|term| term.axis == axis) {
            let first = laws.len();
            laws.extend(term.memory.iter().map(MemoryVariable::law));
            let (target, formula) = (term.target, term.formula.clone());
            let in_step = target.kind() != PlaceKind::Channel && formula.reads(SENSOR_FORCE);
            follows_sensor |= in_step || term.memory.iter().any(MemoryVariable::reads_sensor_force);
            terms.push(ActiveTerm { target, formula, kept: first..laws.len() });
        }
        DeclaredTerms {
            terms,
            laws,
            follows_sensor,
            kg_per_m3: rig.gas().normal_pressure_pa / (GAS_J_PER_KG_K * rig.gas().temperature_k),
            exhaust_pa: rig.supply().exhaust_pressure_pa,
            supply_pa: rig.supply().pressure_pa,
        }
    }

    pub(crate) fn any(&self) -> bool {
        !self.terms.is_empty()
    }

    pub(crate) fn adds(&self, target: Target) -> bool {
        self.terms.iter().any(|term| term.target == target)
    }

    /// Whether any adds to a flow.
    pub(crate) fn adds_air(&self) -> bool {
        self.adds(Target::FlowA) || self.adds(Target::FlowB)
    }

    /// Whether any keeps a value.
    pub(crate) fn remembers(&self) -> bool {
        !self.laws.is_empty()
    }

    /// What they keep where the plant begins, at these [`VARIABLES`].
    pub(crate) fn begin(&self, values: &[f64; VARIABLES.len()]) -> Vec<f64> {
        self.laws.iter().map(|law| law.begin(values)).collect()
    }

    /// Renews it at the end of a substep.
    pub(crate) fn renew(&self, values: &[f64; VARIABLES.len()], step_s: f64, kept: &mut [f64]) {
        for term in self.terms.iter().filter(|term| !term.kept.is_empty()) {
            renew(&self.laws[term.kept.clone()], values, step_s, &mut kept[term.kept.clone()]);
        }
    }

    /// Force along the axis's extension, N.
    pub(crate) fn force(&self, at: &TermInputs<'_>) -> f64 {
        self.sum(Target::Force, at).clamp(-MOST_FORCE_N, MOST_FORCE_N)
    }

    /// Flow into a chamber, m^3/s.
    pub(crate) fn flow(&self, chamber: usize, at: &TermInputs<'_>) -> f64 {
        let most = Unit::NormalLitrePerMinute.to_si(MOST_FLOW_NL_PER_MIN);
        let flow = self.sum([Target::FlowA, Target::FlowB][chamber], at) / self.kg_per_m3;
        let pressure_pa = at.conditions.pressure_pa[chamber];
        neither_empties_nor_bursts(flow.clamp(-most, most), pressure_pa, [self.exhaust_pa, self.supply_pa])
    }

    /// What a sensor shows beside the truth, in SI.
    pub(crate) fn reading(&self, target: Target, at: &TermInputs<'_>) -> f64 {
        self.sum(target, at)
    }

    fn sum(&self, target: Target, at: &TermInputs<'_>) -> f64 {
        let mut sum = 0.0;
        for term in self.terms.iter().filter(|term| term.target == target) {
            sum += value(&term.formula, &at.values(), &at.kept[term.kept.clone()]);
        }
        sum
    }
}
