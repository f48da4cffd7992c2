//! The rig's timing: the distributions of every process, round trips, ages of commands, steps of the wall clock.
//!
//! In real time only.

use crate::event::Event;
use crate::exchange::{AxisCycle, RoundTrip, TimingRecord};
use plant::Axis;
use protocol::frames::{MessageSpec, RIG_STATUS};
use realtime::stages::ExtraHistogram;
use realtime::{Percentiles, WallClockStep, WallClockStepDetector};
use runlog::candump::FrameRecord;
use runlog::process::Process;
use runlog::timing::CycleTiming;
use runlog::timing_recorder::{CommandAges, TimingFigures, TimingRecorder, TimingSetup};
use std::collections::VecDeque;
use std::io;

/// Name of this process in tags and folders.
pub(crate) const PROCESS: &str = Process::Emulator.name();
/// Most steps of the wall clock that are kept.
const MOST_STEPS: usize = 100;

/// The timing of a run, for `summary.json`; empty in simulated time.
#[derive(Clone, Debug, Default)]
pub(crate) struct RigTimingReport {
    /// Stages, arrivals, the kernel's counters, the flight recorder.
    pub timing: TimingFigures,
    /// From sending the sensors to receiving the command, drive and load.
    pub round_trip_ns: [Percentiles; 2],
    /// Age of commands when they begin to act, drive and load.
    pub command_age_ns: [Percentiles; 2],
    /// Cycles sent, by the age in cycles of the command in effect.
    pub command_age_cycles: CommandAges,
    pub wall_clock_steps: Vec<WallClockStep>,
}

pub(crate) struct RigTiming {
    pub(super) recorder: TimingRecorder,
    round_trip: [ExtraHistogram; 2],
    /// Round trips of cycles whose rows are still to come.
    trips: VecDeque<RoundTrip>,
    command_age: [ExtraHistogram; 2],
    ages: CommandAges,
    wall_clock: WallClockStepDetector,
    steps: Vec<WallClockStep>,
}

impl RigTiming {
    pub(crate) fn create(setup: TimingSetup) -> io::Result<Self> {
        let mut recorder = TimingRecorder::create(setup)?;
        let round_trip = Axis::ALL.map(|axis| recorder.account.add(&format!("{}-round-trip", axis.name())));
        let command_age = Axis::ALL.map(|axis| recorder.account.add(&format!("{}-command-age", axis.name())));
        Ok(Self {
            recorder,
            round_trip,
            trips: VecDeque::new(),
            command_age,
            ages: CommandAges::default(),
            wall_clock: WallClockStepDetector::begin(),
            steps: Vec::new(),
        })
    }

    pub(crate) fn timing(&mut self, record: &TimingRecord) -> io::Result<()> {
        match record {
            TimingRecord::Cycle { row, axes } => self.cycle(row, axes),
            TimingRecord::Stopped { first, skipped, late_ns, woke_ns } => {
                self.recorder.missed(*first, *skipped, *late_ns, *woke_ns);
                Ok(())
            }
        }
    }

    fn cycle(&mut self, row: &CycleTiming, axes: &[AxisCycle; 2]) -> io::Result<()> {
        // The row comes first: it ends the interval of the cycles before it.
        let written = self.recorder.row(row);
        self.record_trips(row.cycle);
        for (axis, cycle) in axes.iter().enumerate() {
            if let Some(ns) = cycle.age_ns(row.due_ns) {
                self.recorder.account.record_extra(self.command_age[axis], ns);
            }
            if cycle.age_cycles > 0 {
                let ages = if axis == 0 { &mut self.ages.drive } else { &mut self.ages.load };
                *ages.entry(cycle.age_cycles).or_default() += 1;
            }
        }
        written
    }

    /// Takes a round trip, which is recorded with the row of its cycle and so belongs to its interval.
    pub(crate) fn round_trip(&mut self, trip: RoundTrip) {
        self.trips.push_back(trip);
    }

    /// Records the round trips up to this cycle.
    fn record_trips(&mut self, cycle: u64) {
        while let Some(RoundTrip { axis, ns, .. }) = self.trips.pop_front_if(|trip| trip.cycle <= cycle) {
            self.recorder.account.record_extra(self.round_trip[axis], ns);
        }
    }

    pub(crate) fn frame(&mut self, record: &FrameRecord) {
        let spec = record.frame.standard_id().and_then(MessageSpec::by_id);
        self.recorder.frame(*record, spec.is_some_and(|spec| spec.sender != RIG_STATUS.sender));
    }

    /// Takes an event: a fault freezes the flight recorder.
    pub(crate) fn event(&mut self, event: &Event) {
        if event.kind.is_fault() {
            self.recorder.fault(event.cycle, self.recorder.newest_done());
        }
    }

    /// Periodic work at `now`, after everything was taken; `asked` when a signal requested a dump.
    pub(crate) fn poll(&mut self, now: realtime::Instant, asked: bool) -> io::Result<()> {
        if asked {
            self.recorder.signal(now);
        }
        let step = self.wall_clock.look();
        self.steps.extend(step.filter(|_| self.steps.len() < MOST_STEPS));
        self.recorder.advance(now)
    }

    /// Writes everything and returns the statistics, also after a failure.
    pub(crate) fn finish(mut self, now: realtime::Instant) -> (RigTimingReport, io::Result<()>) {
        self.record_trips(u64::MAX);
        let written = self.recorder.finish(now);
        let of =
            |extras: [ExtraHistogram; 2]| extras.map(|extra| self.recorder.account.extra_percentiles(extra));
        let report = RigTimingReport {
            timing: self.recorder.figures(),
            round_trip_ns: of(self.round_trip),
            command_age_ns: of(self.command_age),
            command_age_cycles: self.ages,
            wall_clock_steps: self.steps,
        };
        (report, written)
    }
}

#[cfg(test)]
mod tests;
