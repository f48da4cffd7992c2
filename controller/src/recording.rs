//! `controller-drive.csv` and `controller-load.csv`: the internal values of a controller, a row for each recorded cycle.
//!
//! A separate thread polls the queues, so that the 1 ms path wakes no thread.

use crate::reload::Reloader;
use crate::report::axis_of;
use crate::timing::queues::TimingQueues;
use algorithms::guard::HangDetector;
use axis_control::axis::AxisRecord;
use axis_control::node::NodeEvent;
use crossbeam_channel::{Receiver, TryRecvError};
use nominal::Axis;
use protocol::frames::MainChainState;
use runlog::run_folder::{LineFile, controller_csv};
use runlog::timing_recorder::TimingFigures;
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, Instant};
use xcp::parameter_files::ParameterFileWorker;

const POLL_PERIOD: Duration = Duration::from_millis(4);
const FLUSH_PERIOD: Duration = Duration::from_millis(200);

pub(crate) struct Tables {
    tables: Vec<(Axis, LineFile)>,
}

impl Tables {
    pub(crate) fn create(folder: &Path, axes: &[Axis]) -> io::Result<Self> {
        let tables = axes.iter().map(|axis| {
            let mut table = LineFile::create(&folder.join(controller_csv(axis_of(*axis))))?;
            writeln!(table.lines(), "{}", head())?;
            Ok((*axis, table))
        });
        Ok(Self { tables: tables.collect::<io::Result<_>>()? })
    }

    pub(crate) fn write(&mut self, record: &AxisRecord) -> io::Result<()> {
        let Some((_, table)) = self.tables.iter_mut().find(|(axis, _)| *axis == record.axis) else {
            return Ok(());
        };
        let out = table.lines();
        write!(out, "{}.{:03}", record.cycle / 1000, record.cycle % 1000)?;
        for column in &AxisRecord::CHAINS {
            write!(out, ",{}", (column.state)(record))?;
        }
        for column in &AxisRecord::NUMBERS {
            match (column.value)(record) {
                Some(value) if column.exponent => write!(out, ",{value:?}")?,
                Some(value) => write!(out, ",{value}")?,
                None => write!(out, ",")?,
            }
        }
        writeln!(out)?;
        table.write_when_full()
    }

    pub(crate) fn write_out(&mut self) -> io::Result<()> {
        self.tables.iter_mut().try_for_each(|(_, table)| table.write_out())
    }
}

fn head() -> String {
    let chains = AxisRecord::CHAINS.map(|column| column.name);
    let numbers = AxisRecord::NUMBERS.map(|column| column.name);
    [&["time_s"][..], &chains[..], &numbers[..]].concat().join(",")
}

pub(crate) struct Writer {
    pub(crate) tables: Tables,
    pub(crate) records: Receiver<AxisRecord>,
    pub(crate) news: Receiver<NodeEvent>,
    /// Poller of the program files, with `--watch`.
    pub(crate) reloader: Option<Reloader>,
    /// Worker for parameter files, with `--xcp`.
    pub(crate) parameter_files: Option<ParameterFileWorker>,
    /// Queues of the stopwatch and their recorder, in real time.
    pub(crate) timing: Option<TimingQueues>,
}

/// Results of the writer when the senders of its queues are gone.
pub(crate) struct WriterResult {
    pub(crate) reported: Vec<NodeEvent>,
    pub(crate) failure: Option<String>,
    pub(crate) timing: Option<TimingFigures>,
}

impl Writer {
    /// Writes rows and prints events until the senders are gone. `failed` is called when nothing can be written any more;
    /// `hung`, which does not return, when an algorithm does not return, after everything was written.
    pub(crate) fn run(self, failed: impl Fn(), hung: impl Fn()) -> WriterResult {
        let Self { mut tables, records, news, mut reloader, mut parameter_files, mut timing } = self;
        let mut reported = Vec::new();
        let mut last_flush = Instant::now();
        let mut failure: Option<String> = None;
        let mut detector = HangDetector::default();
        loop {
            let mut finished = false;
            // At most the rows that wait now, so that events are not delayed where rows arrive faster than they are written.
            for _ in 0..=records.len() {
                match records.try_recv() {
                    Ok(record) if failure.is_none() => {
                        failure = tables.write(&record).err().map(|error| error.to_string());
                    }
                    Ok(_) => {}
                    Err(gone) => finished = gone == TryRecvError::Disconnected,
                }
            }
            reloader.iter_mut().for_each(Reloader::poll);
            parameter_files.iter_mut().for_each(ParameterFileWorker::poll);
            for item in news.try_iter() {
                protocol::say!("controller: {}", sentence(item));
                if let (NodeEvent::State { state: MainChainState::Fault, cycle, .. }, Some(timing)) =
                    (item, &mut timing)
                {
                    timing.fault(cycle);
                }
                reported.push(item);
            }
            if let Some(timing) = &mut timing {
                note(&mut failure, if finished { timing.finish() } else { timing.poll() });
            }
            if detector.is_hung() {
                // The process ends here, so that a failure of the last write cannot be reported.
                let _ = tables.write_out();
                let _ = timing.as_mut().map(TimingQueues::finish);
                hung();
            }
            if finished || last_flush.elapsed() > FLUSH_PERIOD {
                last_flush = Instant::now();
                note(&mut failure, tables.write_out());
                note(&mut failure, timing.as_mut().map_or(Ok(()), |timing| timing.recorder.write_out()));
            }
            if let Some(failure) = &failure {
                protocol::say!("controller: cannot write {failure}; free space or choose another --out");
                failed();
            }
            if finished || failure.is_some() {
                return WriterResult {
                    reported,
                    failure,
                    timing: timing.map(|timing| timing.recorder.figures()),
                };
            }
            std::thread::sleep(POLL_PERIOD);
        }
    }
}

fn note(failure: &mut Option<String>, written: io::Result<()>) {
    if let (None, Err(error)) = (&failure, written) {
        *failure = Some(error.to_string());
    }
}

pub(crate) fn sentence(news: NodeEvent) -> String {
    match news {
        NodeEvent::State { axis, state, cycle, cause } => {
            format!("cycle {cycle}: {} {state}: {cause}", axis.name())
        }
        NodeEvent::RigRestarted => "the rig restarted; starting over".into(),
        NodeEvent::BusLost => "the bus is gone; trying to come back".into(),
        NodeEvent::BusBack => "the bus is back".into(),
        NodeEvent::SensorsSilent => "no sensors for 0.2 s; waiting for the rig".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axis_control::set_point::{ForceSetPoint, SetPoint};
    use protocol::frames::{EmergencyStopChainState, ForceChainState, MatchingChainState};

    #[test]
    fn a_row_has_a_cell_for_each_column_and_an_empty_one_for_a_set_point_that_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let mut tables = Tables::create(folder.path(), &[Axis::Drive]).unwrap();
        let by_position = AxisRecord {
            axis: Axis::Drive,
            cycle: 12_034,
            main: MainChainState::Experiment,
            force_chain: ForceChainState::Idle,
            matching: MatchingChainState::Matched,
            emergency_stop: EmergencyStopChainState::Ready,
            set_position: Some(SetPoint { velocity_m_per_s: 1e-7, moving: true, ..SetPoint::at_rest(0.25) }),
            set_force: None,
            position_m: 0.125,
            velocity_m_per_s: 1e-7,
            force_n: -3.0,
            wanted_velocity_m_per_s: -2e-7,
            opening: 0.5,
            enabled: true,
        };
        let by_force = AxisRecord {
            cycle: 12_035,
            set_position: None,
            set_force: Some(ForceSetPoint::at_rest(100.0)),
            velocity_m_per_s: 0.0,
            enabled: false,
            ..by_position
        };
        tables.write(&by_position).unwrap();
        tables.write(&by_force).unwrap();
        tables.write(&AxisRecord { axis: Axis::Load, ..by_force }).unwrap();
        tables.write_out().unwrap();
        assert_eq!(
            std::fs::read_to_string(folder.path().join("controller-drive.csv")).unwrap(),
            "time_s,main_chain,force_chain,matching_chain,emergency_stop_chain,set_position_m,set_velocity_m_per_s,\
             set_force_N,position_m,velocity_m_per_s,force_N,wanted_velocity_m_per_s,opening,enabled,moving\n\
             12.034,experiment,idle,matched,ready,0.25,0.0000001,,0.125,1e-7,-3,-2e-7,0.5,1,1\n\
             12.035,experiment,idle,matched,ready,,,100,0.125,0.0,-3,-2e-7,0.5,0,0\n"
        );
    }
}
