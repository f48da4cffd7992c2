//! Where and how it was measured, as facts: each name with the value that all runs share, or those that they do not.

use super::add_new;
use super::files::{EMULATOR, RunFiles};
use super::json_files::RunFacts;
use super::model::{Conditions, Fact};
use realtime::Grant;
use serde_json::Value;

/// Values of a fact that are shown when runs differ.
const VALUES_SHOWN: usize = 3;

/// The conditions of all runs together: a fact that differs has the values of all, up to three.
pub fn conditions(runs: &[RunFiles]) -> Conditions {
    let one_of = |of: fn(&runlog::conditions::Conditions) -> Option<String>| {
        runs.iter().filter_map(|run| run.conditions.as_ref()).find_map(of)
    };
    let reference = runs.iter().find_map(|run| run.reference.as_ref());
    let reported_command =
        reference.map(|reported| reported.command_line.clone()).filter(|line| !line.is_empty());
    let with_resolution = |line: String| match reference {
        Some(reported) if reported.whole_us => format!("{line} (whole us, the fraction left out)"),
        _ => line,
    };
    Conditions {
        machine: machine(runs),
        command_lines: command_lines(runs),
        privileges: privileges(runs),
        load_generator: one_of(|reported| reported.load_generator.clone()),
        reference: reference
            .and(reported_command.or_else(|| one_of(|reported| reported.reference_command.clone())))
            .map(with_resolution),
        reference_missing_because: reference.is_none().then(|| {
            let none_found = "no run has a cyclictest.json; scripts/latency makes one beside each run";
            one_of(|reported| reported.reference_missing_because.clone()).unwrap_or_else(|| none_found.into())
        }),
        probe: runs.iter().any(|run| run.gaps.is_some() || run.circumstances().probe),
    }
}

/// Collects the values of facts by name, in the order of their first appearance.
#[derive(Default)]
struct FactCollector(Vec<(String, Vec<String>)>);

impl FactCollector {
    fn add(&mut self, name: &str, value: &str) {
        let place = self.0.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.0.push((name.to_owned(), Vec::new()));
            self.0.len() - 1
        });
        add_new(&mut self.0[place].1, value.to_owned());
    }

    fn into_facts(self) -> Vec<Fact> {
        let reported = |(name, mut values): (String, Vec<String>)| {
            let more = values.len().saturating_sub(VALUES_SHOWN);
            values.truncate(VALUES_SHOWN);
            if more > 0 {
                values.push(format!("and {more} more"));
            }
            Fact { name, value: values.join("; ") }
        };
        self.0.into_iter().map(reported).collect()
    }
}

/// Everything under `machine` of run.json, nested objects flattened, and the build.
fn machine(runs: &[RunFiles]) -> Vec<Fact> {
    let mut facts = FactCollector::default();
    for run in runs {
        if let Some(file) = &run.run {
            flatten(&mut facts, "", &file.json["machine"]);
        }
        if let Some(files) = run.circumstances().uncommitted_files {
            facts.add("uncommitted files", &files.to_string());
        }
        if let Some(file) = &run.run {
            let RunFacts { emulator_version, counts_allocations, bus, pace } = &file.facts;
            for (name, value) in [
                ("emulator version", emulator_version),
                ("counts allocations", counts_allocations),
                ("bus", bus),
                ("pace", pace),
            ] {
                value.iter().for_each(|value| facts.add(name, &text(value)));
            }
        }
        for (process, reported) in
            run.controller_reports().filter(|(_, reported)| !reported.version.is_empty())
        {
            facts.add(&format!("{process} version"), &reported.version);
        }
    }
    facts.into_facts()
}

fn flatten(facts: &mut FactCollector, name: &str, value: &Value) {
    match value {
        Value::Object(parts) => {
            for (key, part) in parts {
                let key = key.replace('_', " ");
                let name = if name.is_empty() { key } else { format!("{name}: {key}") };
                flatten(facts, &name, part);
            }
        }
        Value::Null if name.is_empty() => {}
        value => facts.add(name, &text(value)),
    }
}

fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "unknown".into(),
        Value::Array(parts) => parts.iter().map(text).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

fn command_lines(runs: &[RunFiles]) -> Vec<Fact> {
    let mut facts = FactCollector::default();
    for run in runs {
        let emulator = run.description().map(|description| (EMULATOR, &description.emulator_command_line));
        let controllers = run.controller_reports().map(|(process, report)| (process, &report.command_line));
        let lines =
            emulator.into_iter().chain(controllers).map(|(process, words)| (process, words.join(" ")));
        lines.filter(|(_, line)| !line.is_empty()).for_each(|(process, line)| facts.add(process, &line));
        if let Some(command) = run.circumstances().command {
            facts.add("measured by", &command);
        }
        for (name, command) in &run.ping_pong.commands {
            facts.add(&format!("ping-pong {name}"), command);
        }
    }
    facts.into_facts()
}

fn privileges(runs: &[RunFiles]) -> Vec<Fact> {
    let mut facts = FactCollector::default();
    for run in runs {
        let emulator = run
            .description()
            .map(|description| (EMULATOR, &description.realtime_granted, &description.realtime_refused));
        let controllers = run.controller_reports();
        let controllers = controllers
            .map(|(process, report)| (process, &report.realtime_granted, &report.realtime_refused));
        for (process, granted, refused) in emulator.into_iter().chain(controllers) {
            let granted: Vec<String> = granted.iter().map(Grant::to_string).collect();
            for (list, word) in [(&granted, "granted"), (refused, "refused")] {
                if !list.is_empty() {
                    facts.add(&format!("{process}, {word}"), &list.join(", "));
                }
            }
        }
    }
    facts.into_facts()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up;

    #[test]
    fn machine_facts_are_flattened_and_reported_once() {
        let reported = conditions(&[made_up::run(10), made_up::run(10)]);
        let value = |name: &str| {
            reported.machine.iter().find(|fact| fact.name == name).map(|fact| fact.value.as_str())
        };
        assert_eq!(value("preemption: model"), Some("PREEMPT_RT"));
        assert_eq!(value("processors"), Some("2"));
        assert_eq!(reported.command_lines[0].value, "emulator run");
        assert!(reported.privileges.iter().any(|fact| fact.name == "controller, granted"));
        let mut run = made_up::run(10);
        let circumstances = run.conditions.as_mut().unwrap();
        circumstances.command = Some("scripts/latency --pairs 2".into());
        circumstances.uncommitted_files = Some(3);
        let with = conditions(&[run]);
        assert!(with.command_lines.iter().any(|fact| fact.value == "scripts/latency --pairs 2"));
        assert!(with.machine.iter().any(|fact| fact.name == "uncommitted files" && fact.value == "3"));
        assert!(reported.reference.is_none() && reported.reference_missing_because.is_some());
    }

    #[test]
    fn facts_that_differ_are_all_reported() {
        let mut other = made_up::run(10);
        made_up::edit_run(&mut other, |file| file["machine"]["kernel"] = "another".into());
        let reported = conditions(&[made_up::run(10), other]);
        let kernel = reported.machine.iter().find(|fact| fact.name == "kernel").unwrap();
        assert!(kernel.value.ends_with("; another"), "{kernel:?}");
    }

    #[test]
    fn a_reference_in_whole_us_says_so() {
        let mut run = made_up::run(10);
        made_up::reference(&mut run, [13_000].into_iter().collect());
        run.reference.as_mut().unwrap().whole_us = true;
        let reported = conditions(&[run]).reference.unwrap();
        assert!(reported.starts_with("cyclictest -p 80") && reported.contains("whole us"), "{reported}");
    }
}
