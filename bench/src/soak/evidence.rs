//! What a segment left in its folder, read: reports of its programs, the frame log, and who was who on the bus.

use super::account::{self, Account, Counts, Gaps, Party, Seen, Wire};
use super::frame_log::{self, FrameLog, known_name};
use super::model::Figures;
use super::plan::Spec;
use super::segment::Outcome;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// The files of a segment, null where there is none.
pub struct Evidence {
    /// `summary.json`.
    pub summary: Value,
    /// `run.json`.
    pub run: Value,
    /// `controller*.json` by its name.
    pub controllers: BTreeMap<String, Value>,
    /// `bus.log`, or why it cannot be read.
    pub log: Result<FrameLog, String>,
}

fn read_json(path: &Path) -> Value {
    std::fs::read(path).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
}

/// Counts of a JSON object, unknown identifiers together.
#[must_use]
pub fn counts(value: &Value) -> Counts {
    let mut counts = Counts::default();
    for (id, frames) in value.as_object().into_iter().flatten() {
        counts.add(&known_name(id), frames.as_u64().unwrap_or(0));
    }
    counts
}

fn number(value: &Value, pointer: &str) -> Option<u64> {
    value.pointer(pointer).and_then(Value::as_u64)
}

impl Evidence {
    /// Reads what is in `folder`.
    #[must_use]
    pub fn read(spec: &Spec, folder: &Path) -> Self {
        let names: &[&str] =
            if spec.two_processes { &["controller-drive", "controller-load"] } else { &["controller"] };
        let controllers =
            names.iter().map(|name| ((*name).to_owned(), read_json(&folder.join(format!("{name}.json")))));
        let log = folder.join("bus.log");
        Self {
            summary: read_json(&folder.join("summary.json")),
            run: read_json(&folder.join("run.json")),
            controllers: controllers.collect(),
            log: frame_log::read(&log).map_err(|error| format!("{}: {error}", log.display())),
        }
    }

    /// The account, or why there is none.
    ///
    /// # Errors
    /// A sentence that says who left no report, or was on the bus twice.
    pub fn account(&self, outcome: &Outcome) -> Result<Account, String> {
        let reports = self.controllers.iter().chain([(&"emulator".to_owned(), &self.summary)]).find_map(
            |(name, told)| {
                told["bus"]["sent_by_id"].is_null().then(|| format!("no account: {name} left no report"))
            },
        );
        if let Some(why) = reports {
            return Err(why);
        }
        let mut parties = vec![self.rig()];
        parties.extend(self.controllers.iter().map(|(name, told)| controller(name, told)));
        let host = &self.summary["bus_host"];
        if host.is_null() {
            let mut account = account::close(&parties, None);
            let sent: u64 = parties.iter().map(|party| party.sent.total()).sum();
            if let Some(by_interface) = outcome.sent_by_interface.filter(|by_interface| *by_interface != sent)
            {
                account.broken.push(format!("{sent} frames sent, the interface counted {by_interface}"));
            }
            return Ok(account);
        }
        let wire = self.wire(host, outcome, &mut parties)?;
        Ok(account::close(&parties, Some(&wire)))
    }

    fn rig(&self) -> Party {
        let counters = self.log.as_ref().map(|log| log.counters.clone()).unwrap_or_default();
        let axes = [("110", "drive_commands"), ("111", "load_commands")];
        let gaps = axes.iter().filter_map(|(id, key)| {
            let commands = &self.summary[*key];
            let lost = commands["lost"].as_u64()?;
            let (first, last) = *counters.get(*id)?;
            let times = |key: &str| commands[key].as_u64().unwrap_or(0);
            let pauses = times("expired") + times("refused_stale") + times("breaks");
            Some(((*id).to_owned(), Gaps::Commands { lost, first, last, pauses }))
        });
        Party { gaps: gaps.collect(), ..party("emulator", &self.summary) }
    }

    /// Each peer of the host goes to its process.
    fn wire(&self, host: &Value, outcome: &Outcome, parties: &mut [Party]) -> Result<Wire, String> {
        let mut wire = Wire {
            injected: counts(&host["injected_loss"]),
            passed: counts(&host["on_wire"]),
            ..Wire::default()
        };
        for node in host["wire_time"]["nodes"].as_array().into_iter().flatten() {
            wire.never_sent.add_all(&counts(&node["dropped_at_full_queue"]));
            wire.never_sent.add_all(&counts(&node["dropped_in_bus_off"]));
        }
        for peer in host["peers"].as_array().into_iter().flatten() {
            let seen = Seen {
                taken: counts(&peer["received_by_id"]),
                before: counts(&peer["before_it_came"]),
                delivered: counts(&peer["delivered"]),
                dropped: counts(&peer["dropped_at_queue"]),
                missed_in_bus_off: counts(&peer["missed_in_bus_off"]),
                after: counts(&peer["after_it_left"]),
            };
            let is_of = |party: &&mut Party| {
                let pid = outcome.exits.get(&party.name).map(|(pid, ..)| format!("process {pid}"));
                pid.is_some() && peer["name"].as_str() == pid.as_deref()
            };
            match parties.iter_mut().find(is_of) {
                Some(party) if party.seen.is_some() => {
                    return Err(format!("no account: {} lost the bus and came back", party.name));
                }
                Some(party) => party.seen = Some(seen),
                None => wire.others.push(seen),
            }
        }
        Ok(wire)
    }

    /// Figures of the run.
    #[must_use]
    pub fn figures(&self) -> Figures {
        let drive = self.drive();
        let axes = self.controllers.values().filter_map(|told| told["axes"].as_object()).flatten();
        let controllers_sent =
            self.controllers.values().filter_map(|told| number(told, "/bus/sent")).sum::<u64>();
        Figures {
            cycles: number(&self.summary, "/cycles"),
            skipped: number(&self.summary, "/skipped"),
            overruns: number(&self.summary, "/overruns"),
            stale_commands: number(&self.summary, "/stale_commands"),
            frames_sent: number(&self.summary, "/bus/sent").unwrap_or(0) + controllers_sent,
            position_error_dynamic_m: drive["position_error_dynamic_m"].as_f64(),
            position_error_static_m: drive["position_error_static_m"].as_f64(),
            repetitions: axes.filter_map(|(_, axis)| axis["repetitions_done"].as_u64()).min(),
        }
    }

    /// What the drive's controller told.
    #[must_use]
    pub fn drive(&self) -> &Value {
        let of = |told: &'_ Value| !told["axes"]["drive"].is_null();
        self.controllers.values().find(|told| of(told)).map_or(&Value::Null, |told| &told["axes"]["drive"])
    }
}

fn party(name: &str, told: &Value) -> Party {
    Party {
        name: name.into(),
        sent: counts(&told["bus"]["sent_by_id"]),
        refused: counts(&told["bus"]["dropped_on_send_by_id"]),
        received: counts(&told["bus"]["received_by_id"]),
        overflow: number(told, "/bus/dropped_on_receive").unwrap_or(0),
        ..Party::default()
    }
}

fn controller(name: &str, told: &Value) -> Party {
    let gaps = [("drive", "120"), ("load", "121")].iter().filter_map(|(axis, id)| {
        let axis = &told["axes"][*axis];
        let (lost, before) =
            (axis["sensors_lost"].as_u64()?, axis["sensors_missed_before_first_tick"].as_u64()?);
        Some(((*id).to_owned(), Gaps::Sensors { lost, before }))
    });
    Party { gaps: gaps.collect(), ..party(name, told) }
}
