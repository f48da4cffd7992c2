//! The thread that empties the queues into the run's folder and tells events to a person.
//!
//! It polls, so that the rig loop never wakes it. Files grow by whole lines and reach the disk five times a second: a
//! process that is killed leaves files that read to their last line. When a write fails (a full disk, a folder that
//! went away), the run is asked to end, and what was written stays.

use super::rig_timing::{RigTiming, RigTimingReport};
use super::{Records, a_turn};
use crate::event::{Event, EventKind};
use crate::faults::mark;
use crate::pace::Shared;
use crate::telemetry::Telemetry;
use plant::tables;
use realtime::{Clock, MonotonicClock};
use runlog::candump::{self, FrameRecord};
use runlog::run_folder::{BUS_LOG, FAULTS_CSV, LineFile, MEASUREMENT_CSV, TRUTH_CSV};
use runlog::telemetry::DroppedEvents;
use runlog::timing_recorder::TimingSetup;
use std::collections::HashMap;
use std::io::{self, Write};
use std::mem::{Discriminant, discriminant};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Pause between two looks at the queues.
const POLL_PERIOD: Duration = Duration::from_millis(4);
/// Longest time that a recorded line stays in memory.
const FLUSH_PERIOD: Duration = Duration::from_millis(200);
/// Events of a kind that are reported on the terminal, and kept for the summary.
const EVENTS_TOLD: usize = 100;
const EVENTS_KEPT: usize = 1000;
/// Late wake-ups that are reported, of which a bad machine makes thousands.
const SKIPS_TOLD: usize = 10;
/// How long a frame waits for those that were read later but arrived earlier: longer than any stall of note.
const FRAME_DELAY_NS: u64 = 250_000_000;

/// What the writer has to know of the run.
pub(crate) struct WriterSetup {
    /// The run's folder; it exists.
    pub folder: PathBuf,
    /// Interface name in `bus.log`.
    pub interface: String,
    /// What turns the run's clock into the time stamps of `bus.log`, in ns.
    pub epoch_offset_ns: u64,
    /// How the rig was set up, for the comment line of `measurement.csv`.
    pub linked: bool,
    /// Weights on the carriage, for the same line.
    pub added_mass_kg: f64,
    /// Names of the plant's terms, the last columns of `truth.csv` and of no other file.
    pub terms: Vec<String>,
    /// Whether there can be faults, which have a table of their own then.
    pub faults: bool,
    /// How to record the timing; `None` in lockstep.
    pub timing: Option<TimingSetup>,
    /// Where rows and frames go for viewers, besides the files.
    pub telemetry: Option<Telemetry>,
}

/// What the writer leaves behind.
#[derive(Debug, Default)]
pub(crate) struct WriterReport {
    /// Rows in `measurement.csv` and `truth.csv`.
    pub rows: u64,
    /// Lines in `bus.log`.
    pub frames: u64,
    /// The first events of each kind.
    pub events: Vec<Event>,
    pub event_count: u64,
    pub timing: RigTimingReport,
    /// Why writing stopped, if it did.
    pub failure: Option<String>,
}

/// The open files of a run.
pub(crate) struct Writer {
    setup: WriterSetup,
    bus_log: LineFile,
    measurement: LineFile,
    truth: LineFile,
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
        let (bus_log, mut measurement, mut truth) =
            (open(BUS_LOG)?, open(MEASUREMENT_CSV)?, open(TRUTH_CSV)?);
        tables::write_measurement_head(measurement.lines(), setup.linked, setup.added_mass_kg)?;
        tables::write_truth_head(truth.lines(), &setup.terms)?;
        let mut faults = setup.faults.then(|| open(FAULTS_CSV)).transpose()?;
        if let Some(faults) = &mut faults {
            writeln!(faults.lines(), "{}", mark::COLUMNS)?;
        }
        let timing = setup.timing.take().map(RigTiming::create).transpose()?;
        Ok(Self {
            setup,
            bus_log,
            measurement,
            truth,
            faults,
            timing,
            pending: Vec::new(),
            reported: HashMap::new(),
            dropped_events: DroppedEvents::default(),
            report: WriterReport::default(),
        })
    }

    /// Writes until the sending ends are gone and the queues are empty.
    pub(crate) fn run(mut self, records: &Records, shared: &Shared) -> WriterReport {
        let mut last_flush = Instant::now();
        loop {
            // Asked before draining: what was sent before the ends went is drained below, and in the next rounds.
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
        for record in a_turn(&records.cycles) {
            if let Some(telemetry) = &mut self.setup.telemetry {
                telemetry.cycle(&record);
            }
            tables::write_measurement(self.measurement.lines(), &record)?;
            tables::write_truth(self.truth.lines(), &record)?;
            self.report.rows += 1;
            self.measurement.write_when_full()?;
            self.truth.write_when_full()?;
        }
        for record in a_turn(&records.frames) {
            if let Some(timing) = &mut self.timing {
                timing.frame(&record);
            }
            self.pending.push(record);
        }
        self.write_frames(FRAME_DELAY_NS)?;
        for event in a_turn(&records.events) {
            self.tell(event)?;
        }
        Ok(())
    }

    /// Takes what the loop measured, and does what follows from it.
    fn judge(&mut self, records: &Records, shared: &Shared) -> io::Result<()> {
        let asked = shared.freeze.take();
        let Some(timing) = &mut self.timing else { return Ok(()) };
        for record in a_turn(&records.timings) {
            // Those of a cycle were handed over before its row.
            a_turn(&records.round_trips).for_each(|round_trip| timing.round_trip(round_trip));
            timing.timing(&record)?;
        }
        a_turn(&records.round_trips).for_each(|round_trip| timing.round_trip(round_trip));
        timing.poll(MonotonicClock.now(), asked)
    }

    /// Lets viewers have what there is for them.
    fn serve(&mut self) {
        let Some(telemetry) = &mut self.setup.telemetry else { return };
        if let Some(timing) = &mut self.timing {
            telemetry.histograms(&timing.new_lines());
        }
        telemetry.serve(&self.report.events, self.dropped_events);
    }

    fn finish_timing(&mut self) -> io::Result<()> {
        let Some(timing) = self.timing.take() else { return Ok(()) };
        let (report, written) = timing.finish(MonotonicClock.now());
        self.report.timing = report;
        written
    }

    /// Writes the frames that are older than the newest by `delay_ns`, in the order of their stamps. A command is read a
    /// cycle after it arrived, and later after a stall; players of the log want time to go forward.
    fn write_frames(&mut self, delay_ns: u64) -> io::Result<()> {
        // Stable: frames of one stamp keep the order in which they were handed over.
        self.pending.sort_by_key(|record| record.stamp_ns);
        let Some(newest) = self.pending.last() else { return Ok(()) };
        let until_ns = newest.stamp_ns.saturating_sub(delay_ns);
        let ready = self.pending.partition_point(|record| record.stamp_ns <= until_ns);
        let (interface, offset) = (&self.setup.interface, self.setup.epoch_offset_ns);
        for record in self.pending.drain(..ready) {
            candump::write_line(self.bus_log.lines(), interface, offset, &record)?;
            self.report.frames += 1;
            self.bus_log.write_when_full()?;
        }
        Ok(())
    }

    /// Tells and keeps the event. Each kind has a quota of its own: on a bad machine late wake-ups and stale commands come by
    /// thousands, and must hide nothing else.
    fn tell(&mut self, event: Event) -> io::Result<()> {
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
        let most_told = if late { SKIPS_TOLD } else { EVENTS_TOLD };
        let reported = self.reported.entry(discriminant(&event.kind)).or_default();
        *reported += 1;
        if *reported <= EVENTS_KEPT {
            self.report.events.push(event);
        } else if let EventKind::Skipped { cycles } = event.kind {
            self.dropped_events.overruns += 1;
            self.dropped_events.skipped += cycles;
        }
        if *reported < most_told {
            protocol::say!("emulator: {event}");
        } else if *reported == most_told {
            protocol::say!("emulator: {event}; further ones of this kind stand in summary.json only");
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.bus_log.write_out()?;
        self.measurement.write_out()?;
        self.truth.write_out()?;
        self.faults.as_mut().map_or(Ok(()), LineFile::write_out)?;
        self.timing.as_mut().map_or(Ok(()), RigTiming::flush)
    }

    fn fail(&mut self, error: &io::Error, shared: &Shared) {
        let folder = self.setup.folder.display();
        let message = format!(
            "cannot write to {folder}: {error}; free space or choose another --out, what was written stays"
        );
        protocol::say!("emulator: {message}");
        self.report.failure = Some(message);
        // One file failed; what waits for the others may still find room.
        for file in
            [&mut self.bus_log, &mut self.measurement, &mut self.truth].into_iter().chain(&mut self.faults)
        {
            let _ = file.write_out();
        }
        shared.output_failed.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::queues;
    use plant::tables::CycleRecord;
    use plant::{Inputs, Plant, RigParameters, Scene, Sensors};
    use runlog::Axis;
    use std::path::Path;

    fn writer_into(folder: &Path) -> Writer {
        let setup = WriterSetup {
            folder: folder.to_owned(),
            interface: "can0".to_owned(),
            epoch_offset_ns: 0,
            linked: false,
            added_mass_kg: 0.0,
            terms: Vec::new(),
            faults: false,
            timing: None,
            telemetry: None,
        };
        Writer::create(setup).unwrap()
    }

    #[test]
    fn a_rig_faster_than_the_disk_does_not_keep_its_events_waiting() {
        const MOST: u64 = 200_000;
        let rig = RigParameters::baseline();
        let plant = Plant::new(&rig, &Scene::default().setup()).unwrap();
        let inputs = Inputs::default();
        let record = CycleRecord {
            cycle: 0,
            valve: inputs.valve,
            readings: Sensors::new(&rig, 1).sample(&plant, &inputs),
            truth: plant.truth(&inputs),
            terms: plant.terms(&inputs),
        };
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
                let lost = recorder.dropped();
                recorder.cycle(record.clone());
                taken += 1 - (recorder.dropped() - lost);
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
                writer.tell(Event { cycle, kind }).unwrap();
            }
        }
        let rare = Event { cycle: often, kind: EventKind::BusLost };
        writer.tell(rare).unwrap();
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
