//! What a latency report says, before it becomes a page: this is `report.json`, schema `airbench-latency-report` version 1.
//!
//! Times are ns in whole numbers where they were measured, s where a person reads them against a run; every key has its unit.
//! Nothing is NaN: what was not measured is null or missing from its list.

use super::resolution::Verdict;
use realtime::ArrivalFigures;
/// In ns; null when nothing was measured, or too little for that percentile to differ from the maximum.
pub use realtime::Percentiles as PercentilesNs;
use runlog::timing_recorder::CommandAges;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name of the schema, in [`Report::schema`].
pub const SCHEMA: &str = "airbench-latency-report";
/// Goes up when a key changes its meaning or goes.
pub const SCHEMA_VERSION: u32 = 1;

/// What a report says: `report.json`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA`].
    pub schema: String,
    /// [`SCHEMA_VERSION`] of the program that made it.
    pub schema_version: u32,
    /// Heading of the report.
    pub title: String,
    /// When the report was made, s since 1970.
    pub made_unix_s: f64,
    /// May these figures be quoted as latencies of this machine, and what was left uncontrolled.
    pub claim: Claim,
    /// Where and how it was measured.
    pub conditions: Conditions,
    /// All runs together: distributions added up, the reference's too.
    pub distributions: Vec<Distribution>,
    /// Ours against the reference, pair by pair.
    pub ratios: Vec<Ratio>,
    /// The worst events of all runs, worst first, ten at most.
    pub worst: Vec<Event>,
    /// What disturbed the runs, the most telling first; empty when nothing was found.
    pub findings: Vec<Finding>,
    /// The runs one by one; other parts name a run by its place here, from 0.
    pub runs: Vec<RunPart>,
    /// Groups of runs side by side, when several were compared.
    pub comparison: Option<Comparison>,
    /// The bounds of the threshold file, if one was given.
    pub bounds: Vec<BoundResult>,
}

/// Whether the runs support a latency claim.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Claim {
    /// Whether they do.
    pub supported: bool,
    /// The verdict in a sentence.
    pub sentence: String,
    /// Why not, or what weakens it, a sentence each.
    pub reasons: Vec<String>,
    /// What another machine or another hour may do differently, a sentence each.
    pub not_controlled: Vec<String>,
}

/// Where and how it was measured.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Conditions {
    /// Facts of machine, kernel, limits and build, in the order in which they are shown.
    pub machine: Vec<Fact>,
    /// Command line of each process, and the command that measured.
    pub command_lines: Vec<Fact>,
    /// What the system granted and refused.
    pub privileges: Vec<Fact>,
    /// The load generator with its settings; null when none was reported.
    pub load_generator: Option<String>,
    /// The reference with its command line; null without one.
    pub reference: Option<String>,
    /// Why there is no reference, if there is none.
    pub reference_missing_because: Option<String>,
    /// Whether the spin-gap probe watched the machine.
    pub probe: bool,
}

/// A name and what stands behind it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fact {
    /// Such as `kernel` or `preemption: model`.
    pub name: String,
    /// Its value; those of runs that differ are joined by semicolons.
    pub value: String,
}

/// Where a distribution comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    #[default]
    /// The rig's process.
    Emulator,
    /// A controller's process.
    Controller,
    /// Both, joined on one clock.
    Joined,
    /// Measured by another program in the same session.
    Reference,
}

/// A distribution of lengths of time.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Distribution {
    /// Tag in the `.hlog`, such as `emulator-wakeup`.
    pub name: String,
    /// Which process measured it.
    pub source: Source,
    /// What it is, in words.
    pub about: String,
    /// Percentiles of all runs together, ns.
    pub percentiles_ns: PercentilesNs,
    /// Bins on a logarithmic axis, those that are not empty, rising.
    pub bins: Vec<Bin>,
    /// The largest value of each second.
    pub maxima: Vec<Maximum>,
}

impl Distribution {
    /// Its tag; a reference says that it is one.
    pub(crate) fn shown_name(&self) -> String {
        match self.source {
            Source::Reference => format!("{} (reference)", self.name),
            _ => self.name.clone(),
        }
    }
}

/// Samples between two lengths of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bin {
    /// Lower end, ns, included.
    pub from_ns: u64,
    /// Upper end, ns, not included.
    pub to_ns: u64,
    /// Number of samples.
    pub count: u64,
}

/// The largest value of a second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Maximum {
    /// Place of the run in [`Report::runs`].
    pub run: usize,
    /// Second of the run, from 0.
    pub second: u64,
    /// The largest value, ns.
    pub max_ns: u64,
}

/// Ours against a reference over several pairs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Ratio {
    /// Such as `emulator-wakeup p50 / cyclictest p50`.
    pub name: String,
    /// Each pair: ours, reference, in ns.
    pub pairs_ns: Vec<(u64, u64)>,
    /// Median of the pairs' ratios.
    pub median: f64,
    /// Interval of the median, from its order statistics; null with fewer pairs than six.
    pub interval: Option<(f64, f64)>,
    /// Confidence of that interval, such as 0.979 for the second and ninth of ten.
    pub confidence: Option<f64>,
}

/// Why something was late or lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// The rig's process was stopped and continued by a signal.
    EmulatorStopped,
    /// A controller's process was.
    ControllerStopped,
    /// Another thread of the same or higher priority had the CPU.
    CpuContention,
    /// The thread had to wait for pages.
    PageFaults,
    /// A peer does not read its queue.
    SlowListener,
    /// Frames were lost on the wire.
    FrameLoss,
    /// The wall clock was stepped; nothing followed from it.
    ClockStep,
    /// The machine stood still: no thread of it ran, the operating system's own interrupts included.
    MachineStoodStill,
    /// Nothing that was recorded explains it.
    #[default]
    Unexplained,
    /// Something was late or missed and nothing of it was recorded, or nothing shows whether anything was.
    Unknown,
}

/// One late cycle, or several in a row.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Event {
    /// Place of the run in [`Report::runs`].
    pub run: usize,
    /// Which process: `emulator`, `controller`, `controller-drive`, `controller-load`.
    pub process: String,
    /// The rig's cycle in which it began.
    pub cycle: u64,
    /// When, s from cycle 0.
    pub at_s: f64,
    /// How late it woke at worst, ns.
    pub late_ns: u64,
    /// How much later than usual it was done after waking, ns.
    pub slow_ns: u64,
    /// Cycles that it missed.
    pub skipped: u64,
    /// What caused it.
    pub cause: Cause,
    /// What happened and why, in a sentence.
    pub sentence: String,
    /// What speaks for it, and what against, a sentence each.
    pub evidence: Vec<String>,
    /// Cycles of both processes around it, by process.
    #[serde(rename = "around")]
    pub nearby_cycles: BTreeMap<String, Vec<NearbyCycle>>,
    /// Gaps that the probe saw around it, by time.
    pub probe: Vec<ProbeGap>,
    /// How long it was ready and waited for a CPU, over all its cycles, ns.
    #[serde(default)]
    pub waited_ns: u64,
    /// Whether something shows that the machine ran meanwhile.
    #[serde(default)]
    pub machine_ran: bool,
    /// The flight recorder's dump of it, a folder within the run's.
    #[serde(default)]
    pub dump: Option<String>,
    /// Frames in that dump by identifier, in hexadecimal digits.
    #[serde(default)]
    pub frames: BTreeMap<String, u64>,
    /// What the rig noted within 10 ms of it.
    #[serde(default)]
    pub rig_events: Vec<String>,
}

/// One cycle near an event, times against the event's due time.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct NearbyCycle {
    /// The rig's cycle.
    pub cycle: u64,
    /// Due, us from the event's due time.
    pub due_us: f64,
    /// Wake-up latency, us.
    pub late_us: f64,
    /// From waking to the end of the work, us.
    pub execution_us: f64,
    /// Time that it waited for the CPU, us.
    pub run_delay_us: f64,
    /// Page faults, minor and major.
    pub faults: u64,
    /// Times that the thread was taken from its CPU.
    pub involuntary_switches: u64,
    /// CPU that it ran on.
    pub cpu: u64,
}

/// A gap that a spinning thread saw.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProbeGap {
    /// CPU of the spinning thread.
    pub cpu: u64,
    /// Its beginning, us from the event's due time.
    pub from_us: f64,
    /// Its length, us.
    pub length_us: f64,
    /// Whether another thread had that CPU; if not, the CPU itself stood still.
    pub another_ran: bool,
}

/// Something that disturbed the runs.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Finding {
    /// What it was.
    pub cause: Cause,
    /// How often, in events or frames.
    pub count: u64,
    /// Lateness and slowness that it explains, over all events, ns.
    #[serde(default)]
    pub explained_ns: u64,
    /// Whether machines do this by themselves, as far as was seen; then it is not named as what was done to the runs.
    #[serde(default)]
    pub by_itself: bool,
    /// What was found, in a sentence.
    pub sentence: String,
}

/// A run of a report: its counts and percentiles.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RunPart {
    /// Its folder as it was named.
    pub folder: String,
    /// Group that it is compared in; `all` when nobody named one.
    pub group: String,
    /// When it began, s since 1970; 0 when it is not reported.
    pub started_unix_s: f64,
    /// Its length, s.
    pub duration_s: f64,
    /// Figures that are counts: cycles, skipped, frames lost and the like, by their keys in summary.json.
    pub counts: BTreeMap<String, u64>,
    /// Frames that did not come as they should.
    #[serde(default)]
    pub frame_faults: FrameFaults,
    /// Cycles sent, by the age in cycles of the command that acted; empty when it was not counted.
    #[serde(default)]
    pub command_ages: CommandAges,
    /// Percentiles of each distribution of this run, the reference beside it included.
    pub percentiles_ns: BTreeMap<String, PercentilesNs>,
    /// Gaps and bursts of each cyclic frame at each receiver.
    pub arrivals: Vec<ArrivalRow>,
    /// Whether the emulator's verdict was good.
    pub passed: bool,
    /// What this run's folder does not hold, or holds damaged, and what the report therefore does not say.
    #[serde(default)]
    pub lacks: Vec<String>,
}

/// Frames of a run that did not come as they should, by receiver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameFaults {
    /// Commands, at the rig.
    pub rig: FrameFaultCounts,
    /// Those of all controllers' processes together.
    pub controllers: FrameFaultCounts,
}

/// Frames that did not come to a receiver as they should; null where it did not count them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameFaultCounts {
    /// Frames that never came, by gaps in their counters.
    pub lost: Option<u64>,
    /// Commands accepted too late to act in their cycle, or sensors that came after newer ones.
    pub late: Option<u64>,
    /// Frames that came again.
    pub duplicate: Option<u64>,
    /// Frames that are not as `rig.dbc` says.
    pub malformed: Option<u64>,
}

/// How regularly a cyclic frame came.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ArrivalRow {
    /// Who received it: `emulator`, `controller`.
    pub receiver: String,
    /// What it counted of the frame.
    #[serde(flatten)]
    pub figures: ArrivalFigures,
}

/// Groups of runs side by side.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Comparison {
    /// Names of the groups, the first being what the others are held against.
    pub groups: Vec<String>,
    /// A row for each figure that all groups have.
    pub rows: Vec<ComparisonRow>,
}

/// One figure over the groups.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ComparisonRow {
    /// Such as `emulator-wakeup p99`.
    pub figure: String,
    /// A cell for each group, in the order of [`Comparison::groups`].
    pub cells: Vec<ComparisonCell>,
}

/// A figure in a group.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ComparisonCell {
    /// Median over the group's runs, ns.
    pub median_ns: u64,
    /// Least and largest over the group's runs, ns.
    pub range_ns: (u64, u64),
    /// Change of the median against the first group, %; null in the first.
    pub change_percent: Option<f64>,
    /// Whether that is beyond the noise of repeated runs; null when there are too few to tell.
    pub beyond_noise: Option<bool>,
}

/// A bound and whether it was kept. One on a ratio is judged by the interval of its median, all others by their value.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BoundResult {
    /// Figure as the threshold file names it.
    pub figure: String,
    /// Its value; null when it was not measured, which breaks the bound.
    pub value: Option<f64>,
    /// Least value that keeps the bound, in the figure's unit; null without one.
    pub min: Option<f64>,
    /// Largest value that keeps the bound, in the figure's unit; null without one.
    pub max: Option<f64>,
    /// Whether it was kept; false too when that is not resolved.
    pub kept: bool,
    /// Interval of a ratio's median; null for other figures, and with fewer than six pairs.
    #[serde(default)]
    pub interval: Option<(f64, f64)>,
    /// Whether the interval lies on one side of the bound, so that it is kept or broken.
    #[serde(default = "decided")]
    pub resolved: bool,
    /// Pairs that would resolve it, see [`super::resolution`]; null when it is resolved, or when no number would.
    #[serde(default)]
    pub pairs_to_resolve: Option<u64>,
}

/// Reports of before were decided by the value alone.
fn decided() -> bool {
    true
}

impl BoundResult {
    /// Kept, broken, or neither.
    pub fn verdict(&self) -> Verdict {
        match (self.resolved, self.kept) {
            (false, _) => Verdict::NotResolved { pairs: self.pairs_to_resolve },
            (true, true) => Verdict::Kept,
            (true, false) => Verdict::Broken,
        }
    }
}
