//! The figures at the top of a run's summary, which are of no family: errors of the position, and what the processes counted.

/// A figure at the top of a summary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopFigure {
    /// Its key in the summary, unit included.
    pub name: &'static str,
    /// Its unit; 1 for a count.
    pub unit: &'static str,
    /// Group that it belongs to.
    pub kind: Kind,
    /// Whether runs are compared by it too.
    pub is_compared: bool,
}

/// Group of a figure at the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The drive's motion; a rehearsal has it too.
    Position,
    /// What goes wrong between processes: none of it in a rehearsal, which has no bus and is never late.
    Fault,
    /// Another count of a run's processes.
    Count,
}

const fn position(name: &'static str) -> TopFigure {
    TopFigure { name, unit: "m", kind: Kind::Position, is_compared: true }
}

const fn fault(name: &'static str, is_compared: bool) -> TopFigure {
    TopFigure { name, unit: "1", kind: Kind::Fault, is_compared }
}

const fn count(name: &'static str) -> TopFigure {
    TopFigure { name, unit: "1", kind: Kind::Count, is_compared: false }
}

/// Those of the drive's motion.
pub const POSITIONS: [&str; 2] = ["position_error_dynamic_m", "position_error_static_m"];

/// The figures at the top, in the order in which they are listed.
pub const TOP: [TopFigure; 16] = [
    position(POSITIONS[0]),
    position(POSITIONS[1]),
    count("cycles"),
    fault("skipped", false),
    fault("overruns", true),
    count("late_completions"),
    count("frames_sent"),
    count("frames_received"),
    fault("frames_lost", true),
    count("frames_lost_at_rig"),
    count("frames_lost_at_controller"),
    fault("frames_malformed", false),
    fault("stale_commands", true),
    count("allocations_in_cycle"),
    fault("records_dropped", false),
    count("event_count"),
];

/// The figure of this name; `None` of a name that is not at the top.
pub fn find(name: &str) -> Option<&'static TopFigure> {
    TOP.iter().find(|figure| figure.name == name)
}
