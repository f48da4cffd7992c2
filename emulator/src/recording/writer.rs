//! The thread that empties the queues into the run's folder and prints events.
//!
//! It polls, so that the rig loop never wakes it. Files grow by whole lines and are written five times a second: a killed
//! process leaves files that can be read to their last line. When a write fails (a full disk, a missing folder), the run is
//! asked to end, and what was written stays.

use super::rig_timing::{RigTiming, RigTimingReport};
use super::{Records, batch};
use crate::event::{Event, EventKind};
use crate::faults::mark;
use crate::pace::Shared;
use crate::telemetry::Telemetry;
use plant::Truth;
use realtime::{Clock, MonotonicClock};
use runlog::candump::{self, FrameRecord};
use runlog::cycle_tables::CycleTables;
use runlog::run_folder::{BUS_LOG, FAULTS_CSV, LineFile};
use runlog::telemetry::{DroppedEvents, SetUp};
use runlog::timing_recorder::TimingSetup;
use std::collections::HashMap;
use std::io::{self, Write};
use std::mem::{Discriminant, discriminant};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Period of the polls of the queues.
const POLL_PERIOD: Duration = Duration::from_millis(4);
/// Longest time that a line stays in memory.
const FLUSH_PERIOD: Duration = Duration::from_millis(200);
/// Events of a kind that are printed, and that are kept for the summary.
const EVENTS_REPORTED: usize = 100;
const EVENTS_KEPT: usize = 1000;
/// Late wake-ups that are printed.
const SKIPS_REPORTED: usize = 10;
/// Time that a frame waits for frames that were read later but arrived earlier: longer than any usual stall.
const FRAME_DELAY_NS: u64 = 250_000_000;

/// Properties of the run for the writer.
#[derive(Default)]
pub(crate) struct WriterSetup {
    /// The run's folder, which exists.
    pub folder: PathBuf,
    /// Interface name in `bus.log`.
    pub interface: String,
    /// Offset from the run's clock to the time stamps of `bus.log`, ns.
    pub epoch_offset_ns: u64,
    /// Set-up at the start, for the comment line of `measurement.csv`.
    pub set_up: SetUp,
    /// Names of the plant's terms, the last columns of `truth.csv` and of no other file.
    pub terms: Vec<String>,
    /// Whether faults are possible; they have a table then.
    pub faults: bool,
    /// Set-up of the timing; `None` in lockstep.
    pub timing: Option<TimingSetup>,
    /// Stream of rows and frames to viewers.
    pub telemetry: Option<Telemetry>,
}

#[derive(Debug, Default)]
pub(crate) struct WriterReport {
    /// Rows in `measurement.csv` and `truth.csv`.
    pub rows: u64,
    /// The first events of each kind.
    pub events: Vec<Event>,
    pub event_count: u64,
    pub timing: RigTimingReport,
}

/// The open files of a run.
pub(crate) struct Writer {
    setup: WriterSetup,
    bus_log: LineFile,
    tables: CycleTables,
    faults: Option<LineFile>,
    timing: Option<RigTiming>,
    pending: Vec<FrameRecord>,
    reported: HashMap<Discriminant<EventKind>, usize>,
    dropped_events: DroppedEvents,
    report: WriterReport,
}

impl Writer {
    /// Opens the files and writes their heads.
    pub(crate) fn create(mut setup: WriterSetup) -> io::Result<Self> {
        let open = |name: &str| LineFile::create(&setup.folder.join(name));
        let bus_log = open(BUS_LOG)?;
        let truth = Truth::COLUMNS.into_iter().chain(setup.terms.iter().map(String::as_str));
        let tables = CycleTables::create(&setup.folder, setup.set_up, truth)?;
        let mut faults = setup.faults.then(|| open(FAULTS_CSV)).transpose()?;
        if let Some(faults) = &mut faults {
            writeln!(faults.lines(), "{}", mark::COLUMNS)?;
        }
        let timing = setup.timing.take().map(RigTiming::create).transpose()?;
        Ok(Self {
            setup,
            bus_log,
            tables,
            faults,
            timing,
            pending: Vec::new(),
            reported: HashMap::new(),
            dropped_events: DroppedEvents::default(),
            report: WriterReport::default(),
        })
    }

    /// Writes until the senders are gone and the queues are empty.
    pub(crate) fn run(mut self, records: &Records, shared: &Shared) -> WriterReport {
        let mut last_flush = Instant::now();
        loop {
            // Checked before draining: what was sent before the senders ended is drained below, and in the next rounds.
            let gone = records.senders_gone();
            let mut drained = self.drain(records).and_then(|()| self.judge(records, shared));
            let finished = gone && records.are_taken();
            if finished {
                drained = drained.and_then(|()| self.write_frames(0));
            }
            let flushed = if finished || last_flush.elapsed() > FLUSH_PERIOD {
                last_flush = Instant::now();
                self.flush()
            } else {
                Ok(())
            };
            let mut written = drained.and(flushed);
            if finished || written.is_err() {
                written = written.and(self.finish_timing());
            }
            self.serve();
            if let Err(error) = written {
                self.fail(&error, shared);
                return self.report;
            }
            if finished {
                return self.report;
            }
            if !gone {
                std::thread::sleep(POLL_PERIOD);
            }
        }
    }

    fn drain(&mut self, records: &Records) -> io::Result<()> {
        for record in batch(&records.cycles) {
            if let Some(telemetry) = &mut self.setup.telemetry {
                telemetry.cycle(&record);
            }
            self.report.rows += 1;
            self.tables.write(record.cycle, record.measured(), record.known_to_simulation())?;
        }
        for record in batch(&records.frames) {
            if let Some(timing) = &mut self.timing {
                timing.frame(&record);
            }
            self.pending.push(record);
        }
        self.write_frames(FRAME_DELAY_NS)?;
        for event in batch(&records.events) {
            self.report_event(event)?;
        }
        Ok(())
    }

    /// Records the time stamps.
    fn judge(&mut self, records: &Records, shared: &Shared) -> io::Result<()> {
        let asked = shared.freeze.take();
        let Some(timing) = &mut self.timing else { return Ok(()) };
        for record in batch(&records.timings) {
            // Those of a cycle were queued before its row.
            batch(&records.round_trips).for_each(|round_trip| timing.round_trip(round_trip));
            timing.timing(&record)?;
        }
        batch(&records.round_trips).for_each(|round_trip| timing.round_trip(round_trip));
        timing.poll(MonotonicClock.now(), asked)
    }

    fn serve(&mut self) {
        let Some(telemetry) = &mut self.setup.telemetry else { return };
        if let Some(timing) = &mut self.timing {
            telemetry.histograms(&timing.recorder.account.take_copy());
        }
        telemetry.serve(&self.report.events, self.dropped_events);
    }

    fn finish_timing(&mut self) -> io::Result<()> {
        let Some(timing) = self.timing.take() else { return Ok(()) };
        let (report, written) = timing.finish(MonotonicClock.now());
        self.report.timing = report;
        written
    }

    /// Writes the frames that are older than the newest by `delay_ns`, in the order of their stamps. A command is read a cycle
    /// after its arrival, and later after a stall, while a log must be in the order of time.
    fn write_frames(&mut self, delay_ns: u64) -> io::Result<()> {
        // Stable: frames of one stamp keep the order of the queue.
        self.pending.sort_by_key(|record| record.stamp_ns);
        let Some(newest) = self.pending.last() else { return Ok(()) };
        let until_ns = newest.stamp_ns.saturating_sub(delay_ns);
        let ready = self.pending.partition_point(|record| record.stamp_ns <= until_ns);
        let (interface, offset) = (&self.setup.interface, self.setup.epoch_offset_ns);
        for record in self.pending.drain(..ready) {
            candump::write_line(self.bus_log.lines(), interface, offset, &record)?;
            self.bus_log.write_when_full()?;
        }
        Ok(())
    }

    /// Prints and keeps the event. Each kind has its own quota: on a bad machine thousands of late wake-ups and stale commands
    /// must not hide other events.
    fn report_event(&mut self, event: Event) -> io::Result<()> {
        self.report.event_count += 1;
        if let Some(telemetry) = &mut self.setup.telemetry {
            telemetry.event(&event);
        }
        if let (Some(faults), EventKind::Fault(mark)) = (&mut self.faults, &event.kind) {
            mark.write(faults.lines(), event.cycle)?;
        }
        if let Some(timing) = &mut self.timing {
            timing.event(&event);
        }
        let late = matches!(event.kind, EventKind::Skipped { .. });
        let most_reported = if late { SKIPS_REPORTED } else { EVENTS_REPORTED };
        let reported = self.reported.entry(discriminant(&event.kind)).or_default();
        *reported += 1;
        if *reported <= EVENTS_KEPT {
            self.report.events.push(event);
        } else if let EventKind::Skipped { cycles } = event.kind {
            self.dropped_events.overruns += 1;
            self.dropped_events.skipped += cycles;
        }
        if *reported < most_reported {
            protocol::say!("emulator: {event}");
        } else if *reported == most_reported {
            protocol::say!("emulator: {event}; further ones of this kind stand in summary.json only");
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.bus_log.write_out()?;
        self.tables.write_out()?;
        self.faults.as_mut().map_or(Ok(()), LineFile::write_out)?;
        self.timing.as_mut().map_or(Ok(()), |timing| timing.recorder.write_out())
    }

    fn fail(&mut self, error: &io::Error, shared: &Shared) {
        let folder = self.setup.folder.display();
        protocol::say!(
            "emulator: cannot write to {folder}: {error}; free space or choose another --out, what was written stays"
        );
        // One file failed; the others may still be written.
        for file in [&mut self.bus_log].into_iter().chain(self.tables.files()).chain(&mut self.faults) {
            let _ = file.write_out();
        }
        shared.output_failed.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::queues;
    use plant::{CycleRecord, Inputs, Plant, RigParameters, Scene, Sensors};
    use runlog::Axis;
    use runlog::cycle_tables::MEASURED;
    use std::path::Path;

    fn writer_into(folder: &Path) -> Writer {
        let setup =
            WriterSetup { folder: folder.to_owned(), interface: "can0".to_owned(), ..WriterSetup::default() };
        Writer::create(setup).unwrap()
    }

    fn at_start() -> CycleRecord {
        let rig = RigParameters::baseline();
        let plant = Plant::new(&rig, &Scene::default().setup()).unwrap();
        let inputs = Inputs { valve: [0.25, -0.5], ..Inputs::default() };
        CycleRecord {
            cycle: 0,
            valve: inputs.valve,
            readings: Sensors::new(&rig, 1).sample(&plant, &inputs),
            truth: plant.truth(&inputs),
            terms: plant.terms(&inputs),
        }
    }

    #[test]
    fn each_measured_value_has_its_column() {
        let record = at_start();
        assert_eq!(MEASURED.len(), record.measured().count());
        for (name, value) in MEASURED.into_iter().zip(record.measured()) {
            let (axis, column) = name.split_once('_').unwrap();
            let axis = usize::from(axis == Axis::Load.name());
            let readings = &record.readings[axis];
            let expected = match column {
                "valve" => record.valve[axis],
                "position_m" => readings.position.value,
                "force_N" => readings.force.value,
                "pressure_a_Pa" => readings.pressure_a.value,
                "pressure_b_Pa" => readings.pressure_b.value,
                _ => panic!("{name} is new"),
            };
            assert_eq!(value, expected, "{name}");
        }
    }

    #[test]
    fn a_rig_faster_than_the_disk_does_not_keep_its_events_waiting() {
        const MOST: u64 = 200_000;
        let record = at_start();
        let (mut recorder, records) = queues(false);
        let news = recorder.events.clone();
        recorder.event(Event { cycle: 0, kind: EventKind::BusLost });
        let mut taken = 0;
        while !recorder.is_full() {
            recorder.cycle(record.clone());
            taken += 1;
        }
        let rig = std::thread::spawn(move || {
            while taken < MOST && !news.is_empty() {
                let lost = recorder.dropped;
                recorder.cycle(record.clone());
                taken += 1 - (recorder.dropped - lost);
            }
            taken
        });
        let folder = tempfile::tempdir().unwrap();
        let written = writer_into(folder.path()).run(&records, &Shared::default());
        let taken = rig.join().unwrap();
        assert!(taken < MOST, "{taken} cycles were written before the event");
        assert_eq!((written.rows, written.event_count), (taken, 1), "and all that came is written");
    }

    #[test]
    fn however_often_one_kind_comes_it_hides_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = writer_into(folder.path());
        let often = EVENTS_KEPT as u64 + 10;
        for cycle in 0..often {
            for kind in [EventKind::Skipped { cycles: 3 }, EventKind::CommandStale(Axis::Drive)] {
                writer.report_event(Event { cycle, kind }).unwrap();
            }
        }
        let rare = Event { cycle: often, kind: EventKind::BusLost };
        writer.report_event(rare).unwrap();
        assert_eq!(writer.report.event_count, 2 * often + 1);
        assert_eq!(
            (writer.report.events.len(), writer.report.events.last()),
            (2 * EVENTS_KEPT + 1, Some(&rare))
        );
        assert_eq!(
            writer.dropped_events,
            DroppedEvents { overruns: 10, skipped: 30 },
            "counted for who comes late"
        );
    }
}
