//! Time: clocks, the periodic loop, priority and pinning, histograms of lateness.
//!
//! This crate knows when something is due and how late it came, and nothing of what is done then: no bus, no plant,
//! no protocol. Whoever runs a cycle brings the work; the loop brings the deadline and the statistics.
//!
//! ```text
//!  Clock ──────────► PeriodicLoop ──────────► LoopStatistics ──► percentiles (summary.json)
//!  real or virtual   deadline n = start + n T  three Recorders     write_hlog  (*.hlog)
//!                         │ rows, by a queue
//!                         ▼
//!  a thread of normal priority: StageAccount ──► *.hlog, second by second;  FlightRecorder ──► what happened around an event
//!
//!  acquire(Request): FIFO, one CPU, locked memory, no deep sleep; each refusal is a warning with a remedy
//! ```
//!
//! | file | holds |
//! |---|---|
//! | [`clock`] | [`Instant`], the trait [`Clock`], the system's monotonic clock, a virtual one for tests |
//! | [`periodic`] | the loop, its re-arm rule, what happens on an overrun |
//! | [`histogram`] | recorders that never allocate, percentiles, HdrHistogram logs |
//! | [`stages`] | when the stages of a cycle happened, and their histograms |
//! | [`interval_log`] | an HdrHistogram log that grows by a second at a time |
//! | [`arrivals`] | intervals, gaps and bursts of a cyclic frame |
//! | [`flight`] | the ring of the last seconds, and what is taken out of it |
//! | [`vitals`] | page faults, switches, run delay and CPU of the real-time thread |
//! | [`wall_clock`] | whether somebody set the time of day |
//! | [`privileges`] | what the thread asks of the system, what it got, what was refused and how to get it |
//! | [`machine`] | facts of the machine: kernel, processors, interrupts, memory, limits, build |
//! | [`signals`] | Ctrl-C, SIGTERM, SIGUSR1 and SIGCONT as values |
//! | [`allocations`] | an allocator that counts, for the proof that a cycle allocates nothing |
//!
//! ```
//! use realtime::{OverrunPolicy, PeriodicConfig, PeriodicLoop, VirtualClock, Clock};
//! use std::time::Duration;
//!
//! let clock = VirtualClock::new();
//! let config = PeriodicConfig { period: Duration::from_millis(1), policy: OverrunPolicy::Stop, spin: None };
//! let start = clock.now() + Duration::from_millis(5);
//! let mut periodic = PeriodicLoop::new(&clock, config, start);
//! for _ in 0..1000 {
//!     let cycle = periodic.next_cycle().expect("the virtual clock is never late");
//!     // … the work of cycle.index …
//!     periodic.end_of_work();
//! }
//! assert_eq!(periodic.statistics.wakeup_ns.percentiles().max, Some(0));
//! ```

#![warn(missing_docs)] // an interface of other crates

pub mod allocations;
pub mod arrivals;
pub mod clock;
mod deflate;
pub mod flight;
pub mod histogram;
pub mod interval_log;
pub mod machine;
pub mod periodic;
pub mod privileges;
pub mod signals;
pub mod stages;
mod virtual_clock;
pub mod vitals;
pub mod wall_clock;

pub use arrivals::{ArrivalFigures, Arrivals};
pub use clock::{Clock, Instant, MonotonicClock, VirtualClock};
pub use flight::{FlightRecorder, Lateness, Severity, Stamped, Trigger};
pub use histogram::{Percentiles, Recorder, write_hlog, write_intervals};
pub use interval_log::IntervalLog;
pub use machine::Machine;
pub use periodic::{
    ConfigError, Cycle, LoopStatistics, Overrun, OverrunPolicy, PeriodicConfig, PeriodicLoop, UnknownPolicy,
};
pub use privileges::{Grant, Grants, Refusal, Request, acquire};
pub use signals::{Continued, Freeze, Interrupt};
pub use stages::{CycleStages, StageAccount, StageFigures};
pub use vitals::{VitalCounts, VitalTotals, VitalsReader};
pub use wall_clock::{WallClockStep, WallClockStepDetector};
