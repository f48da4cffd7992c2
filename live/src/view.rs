//! The data of the run in progress, from its telemetry and from the bus.

use super::chains;
use super::columns::{COLUMNS, Column, Layout, Source};
use super::light::{ClaimMonitor, Judgement};
use super::minute::RecentRecord;
use super::rhythm::LatencyHistograms;
use super::rows::{Rows, SPACING_CYCLES};
use super::state::{ActiveFault, Level, Message, State, Timing};
use super::wire::{Wire, WireEvent};
use crate::push_newest;
use runlog::candump::FrameRecord;
use runlog::cycle_tables::MEASURED;
use runlog::event::{EventKind, FaultChange};
use runlog::telemetry::{Description, EventMessage, FaultEntry, Packet, SetUp};
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

/// Messages kept for later clients.
const MESSAGES_KEPT: usize = 200;
/// Overruns among them; the limit keeps other messages visible on a bad machine.
const OVERRUNS_KEPT: u64 = 20;
/// Seconds for which overruns are counted per second.
const OVERRUN_SECONDS: usize = 60;
const SECOND_CYCLES: u64 = 1000;

#[derive(Default)]
pub(crate) struct View {
    /// The run's folder, if it was named at the command line.
    folder: Option<PathBuf>,
    /// `None` before the telemetry sends one.
    description: Option<Description>,
    layout: Layout,
    /// Whether cycles come by telemetry rather than by the bus alone.
    pub telemetry: bool,
    cycle: Option<u64>,
    pub wire: Wire,
    pub rows: Rows,
    pub latencies: LatencyHistograms,
    pub recent_record: RecentRecord,
    claim_monitor: ClaimMonitor,
    claim: Option<Judgement>,
    overruns: u64,
    recent_overruns: VecDeque<u64>,
    skipped: u64,
    records_lost: u64,
    /// Active faults by number.
    faults: BTreeMap<u16, ActiveFault>,
    /// Set-up of the rig in the newest cycle, from the telemetry.
    pub set_up: SetUp,
    messages: VecDeque<Message>,
    unsent_messages: Vec<Message>,
}

/// Numbers of the state that only the server has.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ServerStatus {
    /// Number of subscribers to events.
    pub viewers: usize,
    pub missed: u64,
    /// Milliseconds since the start of the program.
    pub now_ms: u64,
}

impl View {
    /// A view before the first frame and packet; `folder` is the run's, if it is known.
    pub(crate) fn new(folder: Option<&Path>) -> Self {
        Self {
            folder: folder.map(Path::to_path_buf),
            claim_monitor: ClaimMonitor::new(folder),
            ..Self::default()
        }
    }

    /// Processes a packet of the telemetry; answers go to the server instead.
    pub(crate) fn packet(&mut self, packet: Packet) {
        match packet {
            Packet::Description(text) => self.describe(&text),
            Packet::Cycle(cycle, values) => self.take_cycle(cycle, &values),
            Packet::Event(text) => match serde_json::from_str(&text) {
                Ok(event) => self.event(event),
                Err(error) => self.warn(&format!("an event of the telemetry cannot be read: {error}")),
            },
            Packet::Histogram(line) => {
                if let Err(error) = self.latencies.take(&line) {
                    self.warn(&format!("a histogram of the telemetry cannot be read: {error}"));
                }
            }
            Packet::Loss(records) => {
                self.records_lost = records;
                let text = format!("{records} telemetry records were lost on the way");
                self.warn(&format!("{text}: active faults and counts of skipped cycles may be out of date"));
            }
            Packet::Answer(_) => {}
        }
    }

    /// A run begins, or is joined. Data of another run is discarded; the emulator sends what happened earlier in this one.
    fn describe(&mut self, text: &str) {
        let read = serde_json::from_str::<Description>(text);
        let known = read.as_ref().cloned().unwrap_or_default();
        let folder = self.folder.clone().or_else(|| folder_of(&known));
        let mut wire = std::mem::take(&mut self.wire);
        wire.reset();
        let named = known.columns.iter().map(|column| (column.table, column.name.as_str()));
        *self = Self {
            layout: Layout::new(named),
            claim_monitor: ClaimMonitor::new(folder.as_deref()),
            set_up: known.setup,
            overruns: known.dropped_events.overruns,
            skipped: known.dropped_events.skipped,
            telemetry: true,
            wire,
            description: read.as_ref().ok().cloned(),
            ..Self::new(self.folder.as_deref())
        };
        if let Err(error) = read {
            self.warn(&format!("the description of the telemetry cannot be read: {error}"));
        }
    }

    fn take_cycle(&mut self, cycle: u64, values: &[f64]) {
        self.cycle = Some(cycle);
        let measured = self.layout.measured(values);
        self.recent_record.cycle(cycle, measured);
        if !cycle.is_multiple_of(SPACING_CYCLES) {
            return;
        }
        self.add_row(cycle, &measured, values);
    }

    /// Adds a row of the charts; `values` are those of the telemetry, none without it.
    fn add_row(&mut self, cycle: u64, measured: &[Option<f64>; MEASURED.len()], values: &[f64]) {
        let on_bus_pa = self.wire.status.map(|status| status.supply_pressure_pa);
        let supply_pa = self.layout.supply_pa(values).or(on_bus_pa);
        let of = |(place, column): (usize, &Column)| match &column.source {
            Source::Measured(index) => measured[*index],
            Source::Truth(_, factor) => self.layout.truth(place, *factor, values),
            Source::Supply => supply_pa,
            Source::Controller(..) => None,
        };
        let row: Vec<_> = COLUMNS.iter().enumerate().map(of).collect();
        self.rows.add(cycle, &row);
    }

    pub(crate) fn frame(&mut self, record: FrameRecord, now_ms: u64) {
        self.recent_record.frame(record);
        match self.wire.take(&record.frame, now_ms) {
            Some(WireEvent::ChainValues(axis, cycle, values)) => {
                self.rows.add_chain_values(axis, cycle, values)
            }
            Some(WireEvent::Cycle(cycle, anew)) if !self.telemetry => self.row_of_bus(cycle, anew),
            _ => {}
        }
    }

    /// Adds a row from the bus, without telemetry.
    fn row_of_bus(&mut self, cycle: u64, anew: bool) {
        if anew {
            self.rows = Rows::default();
        }
        self.cycle = Some(cycle);
        let measured = self.wire.measured;
        self.add_row(cycle, &measured, &[]);
    }

    fn event(&mut self, EventMessage { cycle, kind, text }: EventMessage) {
        let level = level(&kind);
        let is_skip = matches!(kind, EventKind::Skipped { .. });
        match kind {
            EventKind::Skipped { cycles } => {
                self.overruns += 1;
                self.skipped += cycles;
                self.recent_overruns.push_back(cycle);
            }
            EventKind::Linked => self.change(cycle, SetUp { linked: true, ..self.set_up }),
            EventKind::Unlinked => self.change(cycle, SetUp { linked: false, ..self.set_up }),
            EventKind::Weights { added_mass_kg } => {
                self.change(cycle, SetUp { added_mass_kg, ..self.set_up });
            }
            EventKind::Fault(mark) if mark.what == FaultChange::Begins => {
                self.faults.insert(mark.number, mark.into());
            }
            EventKind::Fault(mark) => {
                self.faults.remove(&mark.number);
            }
            _ => {}
        }
        self.add_message(cycle, level, &text, !is_skip || self.overruns <= OVERRUNS_KEPT);
    }

    fn change(&mut self, cycle: u64, set_up: SetUp) {
        if set_up != self.set_up {
            self.set_up = set_up;
            self.recent_record.change(cycle);
        }
    }

    /// A warning of the page itself, at the newest cycle.
    fn warn(&mut self, text: &str) {
        self.add_message(self.cycle.unwrap_or_default(), Level::Warning, text, true);
    }

    fn add_message(&mut self, cycle: u64, level: Level, text: &str, is_kept: bool) {
        let message = Message { t_s: cycle as f64 / 1000.0, level, text: text.to_owned() };
        if is_kept {
            push_newest(&mut self.messages, MESSAGES_KEPT, message.clone());
        }
        self.unsent_messages.push(message);
    }

    /// The messages since the last call.
    pub(crate) fn take_messages(&mut self) -> Vec<Message> {
        std::mem::take(&mut self.unsent_messages)
    }

    /// Updates that are due once a second.
    pub(crate) fn update_each_second(&mut self) {
        let newest = self.cycle.unwrap_or_default();
        self.recent_overruns
            .retain(|cycle| newest.saturating_sub(*cycle) < OVERRUN_SECONDS as u64 * SECOND_CYCLES);
        self.claim = Some(self.claim_monitor.judge(newest, self.skipped));
    }

    pub(crate) fn run_folder(&self) -> Option<PathBuf> {
        self.folder.clone().or_else(|| self.description.as_ref().and_then(folder_of))
    }

    /// Overruns in each of the last seconds, the current one last.
    fn overruns_by_second(&self) -> Vec<u64> {
        let second = |cycle: u64| cycle / SECOND_CYCLES;
        let now = second(self.cycle.unwrap_or_default());
        let mut counts = vec![0; OVERRUN_SECONDS];
        for cycle in &self.recent_overruns {
            // An event reported ahead of its cycle belongs to the current second.
            let ago = now.saturating_sub(second(*cycle)) as usize;
            if let Some(count) = counts.iter_mut().rev().nth(ago) {
                *count += 1;
            }
        }
        counts
    }

    /// The properties of the run that do not change.
    pub(crate) fn description(&self, control: bool) -> Value {
        let described = self.description.as_ref();
        let column = |column: &Column| json!({ "name": column.name, "unit": column.unit });
        json!({
            "schema_version": runlog::run_folder::SCHEMA_VERSION,
            "experiment": described.and_then(|run| run.experiment.as_ref()),
            "pace": described.map(|run| &run.pace),
            "sealed": described.map(|run| run.sealed),
            "console": described.map(|run| run.console),
            "run_folder": self.run_folder(),
            "control": control,
            "telemetry": { "connected": self.telemetry },
            "spacing_s": SPACING_CYCLES as f64 / 1000.0,
            "columns": COLUMNS.iter().map(column).collect::<Vec<_>>(),
            "rig": described.map(|run| &run.rig),
            "chains": chains::diagrams(),
            "faults": described.map_or(&[][..], |run| &run.faults).iter().map(fault_form).collect::<Vec<_>>(),
        })
    }

    pub(crate) fn state(&self, server_status: ServerStatus) -> State {
        let status = self.wire.status;
        State {
            cycle: self.cycle,
            t_s: self.cycle.map(|cycle| cycle as f64 / 1000.0),
            last: self.rows.newest(),
            emergency_stop: self.wire.emergency_stop(server_status.now_ms),
            linked: status.map_or(self.set_up.linked, |status| status.linked),
            check_valves_shut: status.map(|status| status.check_valves_shut),
            weights_kg: self.set_up.added_mass_kg,
            chains: self.wire.chains(server_status.now_ms),
            faults_active: self.faults.values().cloned().collect(),
            bus: self.wire.load(),
            timing: Timing {
                percentiles: self.latencies.percentiles(),
                overruns: self.overruns,
                overruns_by_second: self.overruns_by_second(),
                skipped: self.skipped,
            },
            claim: self.claim.clone(),
            viewers: server_status.viewers,
            dropped: server_status.missed,
            telemetry_records_lost: self.records_lost,
            messages: None,
        }
    }

    /// The state with the last messages, for a new client.
    pub(crate) fn state_with_messages(&self, server_status: ServerStatus) -> State {
        State { messages: Some(self.messages.iter().cloned().collect()), ..self.state(server_status) }
    }
}

/// Folder of the run, if the description names one.
fn folder_of(description: &Description) -> Option<PathBuf> {
    Some(&description.out).filter(|out| !out.is_empty()).map(PathBuf::from)
}

/// Events that need attention are warnings; those that end or stop something are errors.
fn level(kind: &EventKind) -> Level {
    match kind {
        EventKind::EmergencyStop
        | EventKind::TwoSources(_)
        | EventKind::SecondRig { .. }
        | EventKind::NotFinite
        | EventKind::BusLost => Level::Error,
        EventKind::Skipped { .. }
        | EventKind::CommandStale(_)
        | EventKind::LinkRefused
        | EventKind::LinkGivenUp
        | EventKind::WeightsRefused
        | EventKind::Malformed { .. }
        | EventKind::Fault(_) => Level::Warning,
        EventKind::CommandFresh(_)
        | EventKind::OneSource(_)
        | EventKind::EmergencyStopReleased
        | EventKind::EmergencyStopStillHeld
        | EventKind::Linked
        | EventKind::Unlinked
        | EventKind::Weights { .. }
        | EventKind::ConsoleHand { .. }
        | EventKind::BusBack => Level::Info,
    }
}

/// A fault of the table with the texts from which the page makes a form.
fn fault_form(fault: &FaultEntry) -> Value {
    let parameters = fault.keys.iter().map(|key| {
        json!({
            "name": key.name, "unit": key.unit, "low": key.min, "high": key.max,
            "default": key.default, "whole": key.whole, "about": key.meaning,
        })
    });
    json!({
        "name": fault.fault,
        "group": fault.group,
        "about": fault.about,
        "places": fault.places,
        "parameters": parameters.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::{Frame, Tick};
    use runlog::telemetry::DroppedEvents;

    fn described(view: &mut View, dropped_events: DroppedEvents) {
        let setup = SetUp { linked: false, added_mass_kg: 1.0 };
        let description = Description { setup, dropped_events, ..Description::default() };
        view.packet(Packet::Description(description.to_json()));
    }

    fn event(view: &mut View, cycle: u64, kind: &Value) {
        view.packet(Packet::Event(json!({ "cycle": cycle, "kind": kind, "text": "so" }).to_string()));
    }

    fn state(view: &View) -> Value {
        json!(view.state_with_messages(ServerStatus::default()))
    }

    #[test]
    fn another_run_begins_with_nothing_of_the_one_before_but_counts_of_frames() {
        let mut view = View::new(None);
        described(&mut view, DroppedEvents::default());
        event(&mut view, 5000, &json!("emergency-stop"));
        event(&mut view, 5000, &json!({ "skipped": { "cycles": 3 } }));
        let tick = Tick { cycle: 5000, skipped: 3, catch_up: false, lockstep: false, ending: false };
        let frame = Frame::Tick(tick).encode().unwrap();
        view.frame(FrameRecord { stamp_ns: 0, frame }, 900);
        view.wire.turn(1000);
        assert_eq!(state(&view)["messages"].as_array().map(Vec::len), Some(2));
        described(&mut view, DroppedEvents::default());
        let state = state(&view);
        assert_eq!((&state["messages"], &state["timing"]["skipped"]), (&json!([]), &json!(0)));
        assert_eq!(state["bus"]["frames_per_s"]["Tick"], 1.0, "the bus is as full as it was");
        assert_eq!(view.wire.totals().map(|(_, count)| count).sum::<u64>(), 1);
        assert_eq!(state["chains"], json!({ "drive": null, "load": null }), "of controllers that are silent");
        let none = json!({ "p50": null, "p90": null, "p99": null, "p999": null, "max": null, "count": 0 });
        assert_eq!((&state["timing"]["wake_up"], &state["timing"]["round_trip"]), (&none, &none));
    }

    #[test]
    fn who_comes_late_counts_what_the_emulator_kept_no_event_of() {
        let mut view = View::new(None);
        described(&mut view, DroppedEvents { overruns: 1500, skipped: 4000 });
        view.packet(Packet::Cycle(61_500, Vec::new()));
        for cycle in [1000, 2000, 60_900, 61_100, 61_200] {
            event(&mut view, cycle, &json!({ "skipped": { "cycles": 2 } }));
        }
        let timing = &state(&view)["timing"];
        assert_eq!((&timing["overruns"], &timing["skipped"]), (&json!(1505), &json!(4010)));
        let mut by_second = vec![0; OVERRUN_SECONDS];
        // Of the seconds 2 to 61, the first, the last but one and the last.
        (by_second[0], by_second[58], by_second[59]) = (1, 1, 2);
        assert_eq!(timing["overruns_by_second"], json!(by_second));
    }

    #[test]
    fn the_set_up_is_that_of_the_newest_change() {
        let mut view = View::new(None);
        described(&mut view, DroppedEvents::default());
        assert_eq!(view.set_up, SetUp { linked: false, added_mass_kg: 1.0 });
        event(&mut view, 10, &json!("linked"));
        event(&mut view, 20, &json!({ "weights": { "added_mass_kg": 2.5 } }));
        assert_eq!(view.set_up, SetUp { linked: true, added_mass_kg: 2.5 });
        event(&mut view, 30, &json!("unlinked"));
        assert_eq!(state(&view)["linked"], false);
    }

    #[test]
    fn a_fault_is_shown_from_its_beginning_to_its_end() {
        let mut view = View::new(None);
        let mark = |number: u16, what: &str| {
            json!({ "fault": {
                "number": number, "what": what, "fault": "leak", "at": "drive.a", "numbers": { "gap_mm2": 0.5 },
                "cause": "console",
            } })
        };
        event(&mut view, 10, &mark(1, "begins"));
        event(&mut view, 10, &mark(2, "refused"));
        let shown =
            json!([{ "name": "leak", "place": "drive.a", "values": { "gap_mm2": 0.5 }, "cause": "console" }]);
        assert_eq!(state(&view)["faults_active"], shown);
        assert_eq!(state(&view)["messages"][0], json!({ "t_s": 0.01, "level": "warning", "text": "so" }));
        event(&mut view, 20, &mark(1, "ends"));
        assert_eq!(state(&view)["faults_active"], json!([]));
    }

    #[test]
    fn what_cannot_be_read_is_a_warning() {
        let mut view = View::new(None);
        event(&mut view, 10, &json!("not-known"));
        view.packet(Packet::Description("{".into()));
        let texts: Vec<_> = view.take_messages().into_iter().map(|message| message.text).collect();
        assert!(matches!(&texts[..], [text] if text.contains("description")), "{texts:?}");
        event(&mut view, 10, &json!("not-known"));
        let message = &view.take_messages()[0];
        assert!(message.level == Level::Warning && message.text.contains("not-known"), "{message:?}");
    }

    #[test]
    fn lost_records_are_reported() {
        let mut view = View::new(None);
        described(&mut view, DroppedEvents::default());
        view.packet(Packet::Loss(7));
        let message = &state(&view)["messages"][0];
        assert_eq!(message["level"], "warning");
        assert!(message["text"].as_str().unwrap().starts_with("7 telemetry records"), "{message}");
    }
}
