//! What the page shows: everything that was heard of the run that goes on, from its telemetry and from the bus.

use super::chains;
use super::columns::{COLUMNS, Layout, Source};
use super::light::Light;
use super::minute::{Minute, SetUp};
use super::rhythm::Rhythm;
use super::rows::{Rows, SPACING_CYCLES};
use super::wire::{News, Wire};
use protocol::can::CanFrame;
use runlog::candump::FrameRecord;
use runlog::telemetry::Packet;
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

/// Messages that are kept for who comes later.
const MESSAGES_KEPT: usize = 200;
/// Of overruns fewer, so that a bad machine's thousands hide nothing else.
const OVERRUNS_KEPT: u64 = 20;
/// Seconds for which overruns are counted one by one.
const OVERRUN_SECONDS: usize = 60;
const SECOND_CYCLES: u64 = 1000;
/// Kinds of events that a person has to look at, and those that end or stop something.
const WARNINGS: [&str; 7] =
    ["skipped", "command-stale", "link-refused", "link-given-up", "weights-refused", "malformed", "fault"];
const ERRORS: [&str; 5] = ["emergency-stop", "two-sources", "second-rig", "not-finite", "bus-lost"];

#[derive(Default)]
pub struct View {
    /// The run's folder, if it was named at the command line.
    folder: Option<PathBuf>,
    description: Value,
    layout: Layout,
    /// Whether cycles come by telemetry, and not by the bus alone.
    pub telemetry: bool,
    cycle: Option<u64>,
    pub wire: Wire,
    pub rows: Rows,
    pub rhythm: Rhythm,
    pub minute: Minute,
    light: Light,
    claim: Value,
    overruns: u64,
    recent_overruns: VecDeque<u64>,
    skipped: u64,
    records_lost: u64,
    faults: BTreeMap<u64, Value>,
    /// As the telemetry tells it.
    set_up: SetUp,
    messages: VecDeque<Value>,
    fresh: Vec<Value>,
}

/// What only the server knows of the state.
#[derive(Clone, Copy, Debug, Default)]
pub struct Audience {
    /// Listeners to events.
    pub viewers: usize,
    pub missed: u64,
    /// Milliseconds since the start of the program.
    pub now_ms: u64,
}

impl View {
    /// Nothing heard yet.
    pub fn new(folder: Option<&Path>) -> Self {
        Self { folder: folder.map(Path::to_path_buf), light: Light::new(folder), ..Self::default() }
    }

    /// Takes a packet of the telemetry, save an answer, which is the server's.
    pub fn packet(&mut self, packet: Packet) {
        match packet {
            Packet::Description(text) => self.describe(&text),
            Packet::Cycle(cycle, values) => self.take_cycle(cycle, &values),
            Packet::Event(text) => self.event(&text),
            Packet::Histogram(line) => {
                if let Err(error) = self.rhythm.take(&line) {
                    self.tell("warning", &format!("a histogram of the telemetry cannot be read: {error}"));
                }
            }
            Packet::Loss(records) => {
                self.records_lost = records;
                let text = format!("{records} records of the telemetry did not come here");
                self.tell(
                    "warning",
                    &format!("{text}: what is broken and how much was skipped may be out of date"),
                );
            }
            Packet::Answer(_) => {}
        }
    }

    /// A run begins, or is joined. The emulator tells what happened in it before; what was of another run would be taken for this
    /// one's.
    fn describe(&mut self, text: &str) {
        let description: Value = serde_json::from_str(text).unwrap_or_default();
        let out = description["out"].as_str().map(PathBuf::from);
        let folder = self.folder.clone().or(out);
        let mut wire = std::mem::take(&mut self.wire);
        wire.begin_anew();
        let (setup, untold) = (&description["setup"], &description["untold"]);
        let columns = description["columns"].as_array().into_iter().flatten();
        let named = columns.filter_map(|column| Some((column["table"].as_str()?, column["name"].as_str()?)));
        *self = Self {
            layout: Layout::new(named),
            light: Light::new(folder.as_deref()),
            set_up: SetUp {
                linked: setup["linked"].as_bool().unwrap_or_default(),
                added_mass_kg: setup["added_mass_kg"].as_f64().unwrap_or_default(),
            },
            overruns: untold["overruns"].as_u64().unwrap_or_default(),
            skipped: untold["skipped"].as_u64().unwrap_or_default(),
            telemetry: true,
            wire,
            ..Self::new(self.folder.as_deref())
        };
        self.description = description;
    }

    fn take_cycle(&mut self, cycle: u64, values: &[f64]) {
        self.cycle = Some(cycle);
        let measured = self.layout.measured(values);
        self.minute.cycle(cycle, measured);
        if !cycle.is_multiple_of(SPACING_CYCLES) {
            return;
        }
        let supply_pa = self.layout.supply_pa(values).or(self.supply_on_bus_pa());
        let row: Vec<_> = COLUMNS
            .iter()
            .enumerate()
            .map(|(place, column)| match &column.source {
                Source::Measured(index) => measured[*index],
                Source::Truth(_, factor) => self.layout.truth(place, *factor, values),
                Source::Supply => supply_pa,
                Source::Said(..) => None,
            })
            .collect();
        self.rows.add(cycle, &row);
    }

    pub fn frame(&mut self, record: FrameRecord, now_ms: u64) {
        self.minute.frame(record);
        match self.wire.take(&record.frame, now_ms) {
            Some(News::Said(axis, cycle, values)) => self.rows.hear(axis, cycle, values),
            Some(News::Cycle(cycle, anew)) if !self.telemetry => self.row_of_bus(cycle, anew),
            _ => {}
        }
    }

    /// A row without telemetry: what the bus tells.
    fn row_of_bus(&mut self, cycle: u64, anew: bool) {
        if anew {
            self.rows = Rows::default();
        }
        self.cycle = Some(cycle);
        let measured = self.wire.measured();
        let of = |source: &Source| match source {
            Source::Measured(index) => measured[*index],
            Source::Supply => self.supply_on_bus_pa(),
            Source::Truth(..) | Source::Said(..) => None,
        };
        let row: Vec<_> = COLUMNS.iter().map(|column| of(&column.source)).collect();
        self.rows.add(cycle, &row);
    }

    fn supply_on_bus_pa(&self) -> Option<f64> {
        self.wire.status().map(|status| status.supply_pressure_pa)
    }

    fn event(&mut self, text: &str) {
        let Ok(event) = serde_json::from_str::<Value>(text) else { return };
        let cycle = event["cycle"].as_u64().unwrap_or_default();
        let (kind, of) = match &event["kind"] {
            Value::Object(kind) => kind.iter().next().map_or(("", &Value::Null), |(kind, of)| (kind, of)),
            kind => (kind.as_str().unwrap_or_default(), &Value::Null),
        };
        match kind {
            "skipped" => {
                self.overruns += 1;
                self.skipped += of["cycles"].as_u64().unwrap_or_default();
                self.recent_overruns.push_back(cycle);
            }
            "linked" => self.change(cycle, SetUp { linked: true, ..self.set_up }),
            "unlinked" => self.change(cycle, SetUp { linked: false, ..self.set_up }),
            "weights" => {
                let added_mass_kg = of["added_mass_kg"].as_f64().unwrap_or(self.set_up.added_mass_kg);
                self.change(cycle, SetUp { added_mass_kg, ..self.set_up });
            }
            "fault" => {
                let number = of["number"].as_u64().unwrap_or_default();
                if of["what"] == "begins" {
                    let fault = json!({ "name": of["fault"], "place": of["at"], "values": of["numbers"], "cause": of["cause"] });
                    self.faults.insert(number, fault);
                } else {
                    self.faults.remove(&number);
                }
            }
            _ => {}
        }
        let level = if ERRORS.contains(&kind) {
            "error"
        } else if WARNINGS.contains(&kind) {
            "warning"
        } else {
            "info"
        };
        let is_kept = kind != "skipped" || self.overruns <= OVERRUNS_KEPT;
        self.say(cycle, level, event["text"].as_str().unwrap_or(kind), is_kept);
    }

    fn change(&mut self, cycle: u64, set_up: SetUp) {
        if set_up != self.set_up {
            self.set_up = set_up;
            self.minute.change(cycle);
        }
    }

    /// A message of the page's own, at the run's newest moment.
    pub fn tell(&mut self, level: &str, text: &str) {
        self.say(self.cycle.unwrap_or_default(), level, text, true);
    }

    fn say(&mut self, cycle: u64, level: &str, text: &str, is_kept: bool) {
        let message = json!({ "t_s": cycle as f64 / 1000.0, "level": level, "text": text });
        if is_kept {
            self.messages.push_back(message.clone());
            if self.messages.len() > MESSAGES_KEPT {
                self.messages.pop_front();
            }
        }
        self.fresh.push(message);
    }

    /// Messages that are new since this was asked the last time.
    pub fn take_messages(&mut self) -> Vec<Value> {
        std::mem::take(&mut self.fresh)
    }

    /// What is due once a second.
    pub fn second(&mut self) {
        let newest = self.cycle.unwrap_or_default();
        self.recent_overruns
            .retain(|cycle| newest.saturating_sub(*cycle) < OVERRUN_SECONDS as u64 * SECOND_CYCLES);
        self.claim = self.light.judge(newest, self.skipped);
    }

    pub fn run_folder(&self) -> Option<PathBuf> {
        self.folder.clone().or_else(|| self.description["out"].as_str().map(PathBuf::from))
    }

    /// How the rig is set up in the newest cycles.
    pub fn set_up(&self) -> SetUp {
        self.set_up
    }

    /// Overruns in each of the last seconds, the one that goes on last.
    fn overruns_by_second(&self) -> Vec<u64> {
        let second = |cycle: u64| cycle / SECOND_CYCLES;
        let now = second(self.cycle.unwrap_or_default());
        let mut counts = vec![0; OVERRUN_SECONDS];
        for cycle in &self.recent_overruns {
            // One that is reported ahead of its cycle is of the second that goes on.
            let ago = now.saturating_sub(second(*cycle)) as usize;
            if let Some(count) = counts.iter_mut().rev().nth(ago) {
                *count += 1;
            }
        }
        counts
    }

    /// What does not change while a run goes on.
    pub fn description(&self, control: bool) -> Value {
        let described = &self.description;
        let column = |column: &super::columns::Column| json!({ "name": column.name, "unit": column.unit });
        json!({
            "schema_version": runlog::run_folder::SCHEMA_VERSION,
            "experiment": described["experiment"],
            "pace": described["pace"],
            "sealed": described["sealed"],
            "console": described["console"],
            "run_folder": self.run_folder(),
            "control": control,
            "telemetry": { "connected": self.telemetry },
            "spacing_s": SPACING_CYCLES as f64 / 1000.0,
            "columns": COLUMNS.iter().map(column).collect::<Vec<_>>(),
            "rig": described["rig"],
            "chains": chains::diagrams(),
            "faults": faults(&described["faults"]),
        })
    }

    pub fn state(&self, audience: Audience) -> Value {
        let status = self.wire.status();
        let mut timing = self.rhythm.percentiles();
        if let Value::Object(timing) = &mut timing {
            timing.insert("overruns".into(), self.overruns.into());
            timing.insert("overruns_by_second".into(), self.overruns_by_second().into());
            timing.insert("skipped".into(), self.skipped.into());
        }
        json!({
            "cycle": self.cycle,
            "t_s": self.cycle.map(|cycle| cycle as f64 / 1000.0),
            "last": self.rows.newest(),
            "emergency_stop": self.wire.emergency_stop(audience.now_ms),
            "linked": status.map_or(self.set_up.linked, |status| status.linked),
            "check_valves_shut": status.map(|status| status.check_valves_shut),
            "weights_kg": self.set_up.added_mass_kg,
            "chains": self.wire.chains(audience.now_ms),
            "faults_active": self.faults.values().collect::<Vec<_>>(),
            "bus": self.wire.load(),
            "timing": timing,
            "claim": self.claim,
            "viewers": audience.viewers,
            "dropped": audience.missed,
            "telemetry_records_lost": self.records_lost,
        })
    }

    /// The same, and the last messages, for who comes later.
    pub fn state_with_messages(&self, audience: Audience) -> Value {
        let mut state = self.state(audience);
        if let Value::Object(state) = &mut state {
            state.insert("messages".into(), json!(self.messages));
        }
        state
    }

    /// A frame that was sent from here.
    pub fn sent(&mut self, frame: CanFrame, stamp_ns: u64) {
        self.minute.frame(FrameRecord { stamp_ns, frame });
    }
}

/// The table of faults in the words of the page.
fn faults(listed: &Value) -> Value {
    let number = |key: &Value| {
        json!({
            "name": key["key"], "unit": key["unit"], "low": key["min"], "high": key["max"],
            "default": key["default"], "whole": key["whole"], "about": key["meaning"],
        })
    };
    let fault = |fault: &Value| {
        let numbers = fault["keys"].as_array().into_iter().flatten().map(number);
        json!({
            "name": fault["fault"],
            "group": fault["group"],
            "about": fault["about"],
            "places": fault["places"],
            "parameters": numbers.collect::<Vec<_>>(),
        })
    };
    listed.as_array().into_iter().flatten().map(fault).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::frames::{Frame, Tick};

    fn described(view: &mut View, more: &Value) {
        let mut description = json!({ "columns": [], "setup": { "linked": false, "added_mass_kg": 1.0 } });
        description["untold"] = more.clone();
        view.packet(Packet::Description(description.to_string()));
    }

    fn event(view: &mut View, cycle: u64, kind: &Value) {
        view.packet(Packet::Event(json!({ "cycle": cycle, "kind": kind, "text": "so" }).to_string()));
    }

    fn state(view: &View) -> Value {
        view.state_with_messages(Audience::default())
    }

    #[test]
    fn another_run_begins_with_nothing_of_the_one_before_but_counts_of_frames() {
        let mut view = View::new(None);
        described(&mut view, &Value::Null);
        event(&mut view, 5000, &json!("emergency-stop"));
        event(&mut view, 5000, &json!({ "skipped": { "cycles": 3 } }));
        let tick = Tick { cycle: 5000, skipped: 3, catch_up: false, lockstep: false, ending: false };
        let frame = Frame::Tick(tick).encode().unwrap();
        view.frame(FrameRecord { stamp_ns: 0, frame }, 900);
        view.wire.turn(1000);
        assert_eq!(state(&view)["messages"].as_array().map(Vec::len), Some(2));
        described(&mut view, &Value::Null);
        let state = state(&view);
        assert_eq!((&state["messages"], &state["timing"]["skipped"]), (&json!([]), &json!(0)));
        assert_eq!(state["bus"]["frames_per_s"]["Tick"], 1.0, "the bus is as full as it was");
        assert_eq!(view.wire.totals().map(|(_, count)| count).sum::<u64>(), 1);
    }

    #[test]
    fn who_comes_late_counts_what_the_emulator_kept_no_event_of() {
        let mut view = View::new(None);
        described(&mut view, &json!({ "overruns": 1500, "skipped": 4000 }));
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
        described(&mut view, &Value::Null);
        assert_eq!(view.set_up(), SetUp { linked: false, added_mass_kg: 1.0 });
        event(&mut view, 10, &json!("linked"));
        event(&mut view, 20, &json!({ "weights": { "added_mass_kg": 2.5 } }));
        assert_eq!(view.set_up(), SetUp { linked: true, added_mass_kg: 2.5 });
        event(&mut view, 30, &json!("unlinked"));
        assert_eq!(state(&view)["linked"], false);
    }

    #[test]
    fn lost_records_are_told() {
        let mut view = View::new(None);
        described(&mut view, &Value::Null);
        view.packet(Packet::Loss(7));
        let message = &state(&view)["messages"][0];
        assert_eq!(message["level"], "warning");
        assert!(message["text"].as_str().unwrap().starts_with("7 records"), "{message}");
    }
}
