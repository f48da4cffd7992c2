//! Reads what a segment left in its folder: reports of its programs, the frame log, and the peers of the bus.

use super::EMULATOR;
use super::account::{self, Counts, FrameAccount, Gaps, Participant, PeerCounts, Wire};
use super::frame_log::{self, FrameLog, known_name};
use super::model::Figures;
use super::plan::SegmentSpec;
use super::segment::Outcome;
use protocol::bus::host::HostReport;
use runlog::Axis;
use runlog::controller_report::{AxisReport, ControllerReport};
use runlog::process::Process;
use runlog::run_folder::{BUS_LOG, FileError, RUN_JSON, SUMMARY_JSON, read_json};
use runlog::summary::{ProcessReport, RunDescription, Summary};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// The files of a segment; defaults for missing ones.
pub(super) struct SegmentFiles {
    pub summary: Summary,
    /// `run.json`; the machine as it stands, which goes into `soak.json`.
    pub run: RunDescription,
    pub machine: Value,
    /// `controller*.json` by its name.
    pub controllers: BTreeMap<String, ControllerReport>,
    /// The common part of `summary.json` and each `controller*.json`, by process.
    pub reports: BTreeMap<String, ProcessReport>,
    /// `bus.log`, or why it cannot be read.
    pub log: Result<FrameLog, String>,
    /// Files that exist but cannot be read or do not fit their types, each with the reason; their content is unknown.
    pub damaged: Vec<String>,
}

/// Reads a file; returns the default for a missing file, and for an invalid one, which goes to `damaged`.
fn read_if_any<T: Default>(
    path: &Path,
    damaged: &mut Vec<String>,
    read: impl FnOnce(&Path) -> Result<T, FileError>,
) -> T {
    if path.try_exists().is_ok_and(|exists| !exists) {
        return T::default();
    }
    read(path).unwrap_or_else(|error| {
        damaged.push(error.to_string());
        T::default()
    })
}

/// Counts by the names of identifiers, unknown ones added up.
pub(super) fn counts(by_name: impl IntoIterator<Item = (String, u64)>) -> Counts {
    let mut counts = Counts::default();
    by_name.into_iter().for_each(|(id, frames)| counts.add(&known_name(&id), frames));
    counts
}

impl SegmentFiles {
    pub(super) fn read(spec: &SegmentSpec, folder: &Path) -> Self {
        let controllers = Process::controllers(spec.two_processes).iter();
        let controllers = controllers.map(|process| (process.name(), folder.join(process.report())));
        let (summary, run) = (folder.join(SUMMARY_JSON), folder.join(RUN_JSON));
        let reports = controllers.clone().chain([(EMULATOR, summary.clone())]);
        let log = folder.join(BUS_LOG);
        let mut damaged = Vec::new();
        Self {
            summary: read_if_any(&summary, &mut damaged, Summary::read),
            machine: read_if_any(&run, &mut damaged, read_json::<RunDescription<Value, Value>>).machine,
            run: read_if_any(&run, &mut damaged, read_json),
            reports: reports
                .map(|(name, path)| (name.to_owned(), read_if_any(&path, &mut damaged, read_json)))
                .collect(),
            controllers: controllers
                .map(|(name, path)| (name.to_owned(), read_if_any(&path, &mut damaged, read_json)))
                .collect(),
            damaged,
            log: frame_log::read(&log).map_err(|error| format!("{}: {error}", log.display())),
        }
    }

    /// The account, or why there is none.
    ///
    /// # Errors
    /// A sentence with the damaged file, the missing report, or the duplicate peer.
    pub(super) fn account(&self, outcome: &Outcome) -> Result<FrameAccount, String> {
        if let Some(damaged) = self.damaged.first() {
            return Err(format!("no account: {damaged}"));
        }
        // The controllers first.
        let mut names = self.reports.iter().filter(|(_, report)| report.bus.is_none()).map(|(name, _)| name);
        if let Some(name) = names.next() {
            return Err(format!("no account: {name} left no report"));
        }
        let mut participants = vec![self.rig()];
        participants.extend(self.controllers.iter().map(|(name, reported)| self.controller(name, reported)));
        let Some(host) = &self.summary.bus_host else {
            let mut account = account::close(&participants, None);
            let sent: u64 = participants.iter().map(|participant| participant.sent.total()).sum();
            if let Some(by_interface) = outcome.sent_by_interface.filter(|by_interface| *by_interface != sent)
            {
                account.broken.push(format!("{sent} frames sent, the interface counted {by_interface}"));
            }
            return Ok(account);
        };
        let wire = self.wire(host, outcome, &mut participants)?;
        Ok(account::close(&participants, Some(&wire)))
    }

    fn rig(&self) -> Participant {
        let counters = self.log.as_ref().map(|log| log.counters.clone()).unwrap_or_default();
        let axes = [("110", &self.summary.drive_commands), ("111", &self.summary.load_commands)];
        let gaps = axes.iter().filter_map(|(id, commands)| {
            let (first, last) = *counters.get(*id)?;
            let pauses = commands.expired + commands.refused_stale + commands.breaks;
            Some(((*id).to_owned(), Gaps::Commands { lost: commands.lost, first, last, pauses }))
        });
        Participant { gaps: gaps.collect(), ..self.participant(EMULATOR) }
    }

    /// Assigns each peer of the host to its process.
    fn wire(
        &self,
        host: &HostReport,
        outcome: &Outcome,
        participants: &mut [Participant],
    ) -> Result<Wire, String> {
        let mut wire = Wire {
            injected: counts(host.injected_loss.by_name()),
            passed: counts(host.on_wire.by_name()),
            ..Wire::default()
        };
        for node in host.wire_time.iter().flat_map(|wire_time| &wire_time.nodes) {
            wire.never_sent.add_all(&counts(node.dropped_at_full_queue.by_name()));
            wire.never_sent.add_all(&counts(node.dropped_in_bus_off.by_name()));
        }
        for peer in &host.peers {
            let host_counts = PeerCounts {
                taken: counts(peer.received_by_id.by_name()),
                before: counts(peer.before_it_came.by_name()),
                delivered: counts(peer.delivered.by_name()),
                dropped: counts(peer.dropped_at_queue.by_name()),
                missed_in_bus_off: counts(peer.missed_in_bus_off.by_name()),
                after: counts(peer.after_it_left.by_name()),
            };
            let is_of = |participant: &&mut Participant| {
                let pid = outcome.exits.get(&participant.name).map(|(pid, ..)| format!("process {pid}"));
                pid.as_ref() == Some(&peer.name)
            };
            match participants.iter_mut().find(is_of) {
                Some(participant) if participant.host_counts.is_some() => {
                    return Err(format!("no account: {} lost the bus and came back", participant.name));
                }
                Some(participant) => participant.host_counts = Some(host_counts),
                None => wire.others.push(host_counts),
            }
        }
        Ok(wire)
    }

    pub(super) fn figures(&self) -> Figures {
        let axes = self.controllers.values().flat_map(|reported| reported.axes.values());
        let drive = self.drive();
        let summary = &self.summary;
        let has_bus_counters = self.reports.get(EMULATOR).is_some_and(|report| report.bus.is_some());
        Figures {
            cycles: summary.cycles,
            skipped: summary.skipped,
            overruns: has_bus_counters.then_some(summary.overruns),
            stale_commands: has_bus_counters.then_some(summary.stale_commands),
            frames_sent: self.reports.values().filter_map(|report| report.bus).map(|bus| bus.sent).sum(),
            position_error_dynamic_m: drive.and_then(|drive| drive.position_error_dynamic_m),
            position_error_static_m: drive.and_then(|drive| drive.position_error_static_m),
            repetitions: axes.filter_map(|axis| axis.repetitions_done).min().map(u64::from),
        }
    }

    pub(super) fn drive(&self) -> Option<&AxisReport> {
        self.controllers.values().find_map(|reported| reported.axes.get("drive"))
    }

    fn participant(&self, name: &str) -> Participant {
        let bus = self.reports.get(name).and_then(|report| report.bus).unwrap_or_default();
        Participant {
            name: name.into(),
            sent: counts(bus.sent_by_id.by_name()),
            refused: counts(bus.dropped_on_send_by_id.by_name()),
            received: counts(bus.received_by_id.by_name()),
            overflow: bus.dropped_on_receive,
            ..Participant::default()
        }
    }

    fn controller(&self, name: &str, reported: &ControllerReport) -> Participant {
        let sensors = [(Axis::Drive, "120"), (Axis::Load, "121")].into_iter();
        let gaps = sensors.filter_map(|(axis, id)| {
            let axis = reported.axes.get(axis.name())?;
            let (lost, before) = (axis.sensors_lost?, axis.sensors_missed_before_first_tick?);
            Some((id.to_owned(), Gaps::Sensors { lost, before }))
        });
        Participant { gaps: gaps.collect(), ..self.participant(name) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_report_is_named_and_a_missing_one_is_not_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let spec = SegmentSpec::default();
        std::fs::write(folder.path().join("controller.json"), "{}").unwrap();
        assert!(SegmentFiles::read(&spec, folder.path()).damaged.is_empty());

        // A number where a text belongs: bounds would come from a run that nobody has read.
        std::fs::write(folder.path().join("run.json"), r#"{"experiment_toml": 5}"#).unwrap();
        let damaged = SegmentFiles::read(&spec, folder.path()).damaged;
        assert!(!damaged.is_empty() && damaged.iter().all(|why| why.contains("run.json")), "{damaged:?}");

        // There, and no file.
        std::fs::remove_file(folder.path().join("run.json")).unwrap();
        std::fs::create_dir(folder.path().join("summary.json")).unwrap();
        let damaged = SegmentFiles::read(&spec, folder.path()).damaged;
        assert!(!damaged.is_empty() && damaged.iter().all(|why| why.contains("summary.json")), "{damaged:?}");
    }
}
