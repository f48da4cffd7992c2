//! The checks: the contract of the bus, compared with what the controller sent.
//!
//! Source: `bench/docs/check-controller.md`, a section for each check; the contract is `protocol/rig.dbc` and
//! `docs/buses.md`.

use super::cli::{CheckPace, ConformanceArguments};
use super::observer::{MalformedCommand, ObservedFrame, ReceivedFrame};
use crate::junit::Case;
use crate::soak::model::{Check, CheckResult};
use protocol::commands::STALE_AFTER_CYCLES;
use protocol::periods::CYCLE_NS;
use std::collections::BTreeMap;
use std::ops::Range;

/// Cycles within which an emergency stop must shut the valve: two of the rig's status.
const STOP_WITHIN_CYCLES: u64 = 20;
/// Cycles without sensors after which a valve must be shut: the 50 ms of the contract, and two ticks for controllers that count
/// by them.
const LOSS_WITHIN_CYCLES: u64 = 70;
/// Largest age of most commands: sensors are answered before the next ones, or one cycle late.
const USUAL_AGE_CYCLES: u64 = 1;
/// Share of the commands that a check on most of them requires.
const JUDGED_QUANTILE: f64 = 0.99;

pub(super) struct Phase<'a> {
    /// Cycles whose sensors were sent, with their stamps; `None` where this process disturbed the timing.
    pub(super) cycles: &'a [(u64, Option<u64>)],
    /// Frames received in them.
    pub(super) received: &'a [ReceivedFrame],
}

impl Phase<'_> {
    fn commands(&self) -> impl Iterator<Item = (&ReceivedFrame, f64, Option<u64>, Option<u8>)> {
        self.received.iter().filter_map(|received| match received.frame {
            ObservedFrame::Command { opening, age, step } => Some((received, opening, age, step)),
            _ => None,
        })
    }

    fn malformed(&self, wrong: MalformedCommand) -> usize {
        self.received.iter().filter(|received| received.frame == ObservedFrame::Malformed(wrong)).count()
    }
}

pub(super) fn case(class: &str, name: &str, result: CheckResult, detail: String) -> Case {
    Case {
        class: format!("controller.{class}"),
        time_s: 0.0,
        check: Check { name: name.into(), result, detail },
    }
}

fn kept(holds: bool) -> CheckResult {
    if holds { CheckResult::Passed } else { CheckResult::Failed }
}

/// Regular operation: the checks that need observation alone.
pub(super) fn regular(phase: &Phase<'_>, arguments: &ConformanceArguments) -> Vec<Case> {
    let commands = phase.commands().count();
    let mut cases = vec![every_cycle("regular", phase, arguments)];
    for (name, wrong, what) in [
        ("length", MalformedCommand::Length, "other than 5 bytes"),
        ("checksum", MalformedCommand::Checksum, "a wrong checksum"),
        ("reserved-bits", MalformedCommand::Reserved, "bits that no signal covers"),
        ("range", MalformedCommand::Range, "an opening beyond -2047 to 2047 counts"),
    ] {
        let malformed = phase.malformed(wrong);
        let detail = format!("{malformed} commands with {what}, {commands} good ones");
        cases.push(case("regular", name, kept(malformed == 0 && commands > 0), detail));
    }
    cases.extend([counter(phase), command_age(phase), identifiers(phase)]);
    cases.extend(timing(phase, arguments));
    cases
}

pub(super) fn every_cycle(class: &str, phase: &Phase<'_>, arguments: &ConformanceArguments) -> Case {
    let cycles = phase.cycles.len();
    let mut counts = BTreeMap::new();
    for (received, _, age, _) in phase.commands() {
        if let Some(age) = age {
            *counts.entry(received.cycle - age).or_insert(0_usize) += 1;
        }
    }
    let count = |cycle: &u64| counts.get(cycle).copied().unwrap_or(0);
    let missing: Vec<u64> =
        phase.cycles.iter().map(|(cycle, _)| *cycle).filter(|cycle| count(cycle) == 0).collect();
    let twice = phase.cycles.iter().filter(|(cycle, _)| count(cycle) > 1).count();
    let allowed = match arguments.pace {
        CheckPace::Real => (arguments.missing * cycles as f64).floor() as usize,
        _ => 0,
    };
    let first = missing.first().map_or(String::new(), |cycle| format!(", the first being cycle {cycle}"));
    let detail = format!(
        "of {cycles} cycles {} without an answer{first}, {twice} with more than one; {allowed} of each are allowed",
        missing.len()
    );
    case(class, "every-cycle", kept(missing.len() <= allowed && twice <= allowed && cycles > 0), detail)
}

/// The counter goes up by one with each command.
fn counter(phase: &Phase<'_>) -> Case {
    let steps: Vec<u8> = phase.commands().filter_map(|(_, _, _, step)| step).collect();
    let breaks = steps.iter().filter(|step| **step != 1).count();
    let example =
        steps.iter().find(|step| **step != 1).map_or(String::new(), |step| format!(", such as by {step}"));
    let detail = format!("of {} steps {breaks} were not by one{example}", steps.len());
    case("regular", "counter", kept(breaks == 0 && !steps.is_empty()), detail)
}

/// Commands answer cycles that were sent, and are fresh.
fn command_age(phase: &Phase<'_>) -> Case {
    let mut ages: Vec<u64> = Vec::new();
    let mut never_sent = 0;
    for (_, _, age, _) in phase.commands() {
        match age {
            // Half of the echo's range: a greater age means a cycle that was not sent yet.
            Some(age) if age < protocol::frames::ECHO_RANGE / 2 => ages.push(age),
            _ => never_sent += 1,
        }
    }
    ages.sort_unstable();
    let (most, oldest) = (quantile(&ages, JUDGED_QUANTILE), ages.last().copied());
    let holds = never_sent == 0
        && most.is_some_and(|age| age <= USUAL_AGE_CYCLES)
        && oldest.is_some_and(|age| age <= STALE_AFTER_CYCLES);
    let reported = |age: Option<u64>| age.map_or("none".into(), |age| age.to_string());
    let detail = format!(
        "age in cycles: 99 % at most {}, oldest {} ({USUAL_AGE_CYCLES} and {STALE_AFTER_CYCLES} are allowed); {never_sent} \
         echoed a cycle that was never sent",
        reported(most),
        reported(oldest)
    );
    case("regular", "command-age", kept(holds), detail)
}

/// It sends only its own frames, in the form of rig.dbc.
fn identifiers(phase: &Phase<'_>) -> Case {
    let mut others = phase.received.iter().filter_map(|received| match &received.frame {
        ObservedFrame::NotPermitted(frame) => Some(frame),
        _ => None,
    });
    let (first, more) = (others.next(), others.count());
    let detail = match first {
        None => "only frames whose sender in rig.dbc is this controller".into(),
        Some(frame) => {
            format!("{} frames that are malformed or of another sender, the first {frame}", more + 1)
        }
    };
    case("regular", "identifiers", kept(first.is_none()), detail)
}

/// Cycle time, its spread, and the response time; in real time only.
fn timing(phase: &Phase<'_>, arguments: &ConformanceArguments) -> [Case; 2] {
    if arguments.pace != CheckPace::Real {
        return ["cycle-time", "response"].map(|name| {
            case("regular", name, CheckResult::Skipped, "simulated time: check it with --pace real".into())
        });
    }
    let stamps: BTreeMap<u64, Option<u64>> = phase.cycles.iter().copied().collect();
    let quiet = |cycle: u64| stamps.get(&cycle).copied().flatten();
    let (mut spreads, mut periods, mut responses) = (Vec::new(), Vec::new(), Vec::new());
    let mut last: Option<(u64, u64)> = None;
    for (received, _, age, _) in phase.commands() {
        let Some(answered) = age.and_then(|age| received.cycle.checked_sub(age)) else { continue };
        if let Some(sent_ns) = quiet(answered) {
            responses.push(received.stamp_ns.saturating_sub(sent_ns));
            if let Some((cycle, stamp_ns)) = last.filter(|(cycle, _)| *cycle + 1 == answered)
                && quiet(cycle).is_some()
            {
                let period_ns = received.stamp_ns.saturating_sub(stamp_ns);
                periods.push(period_ns);
                spreads.push(period_ns.abs_diff(CYCLE_NS));
            }
        }
        last = Some((answered, received.stamp_ns));
    }
    spreads.sort_unstable();
    responses.sort_unstable();
    let us = |ns: Option<u64>| ns.map_or("none".into(), |ns| format!("{:.1}", ns as f64 / 1000.0));
    let mean_ns = (!periods.is_empty()).then(|| periods.iter().sum::<u64>() / periods.len() as u64);
    let disturbed = phase.cycles.iter().filter(|(_, stamp)| stamp.is_none()).count();
    let left_out = format!("{disturbed} cycles left out, in which the machine delayed the check");
    let spread = quantile(&spreads, JUDGED_QUANTILE);
    let cycle_time = format!(
        "mean {} us, 99 % within {} us of 1 ms ({} are allowed), largest deviation {} us; {left_out}",
        us(mean_ns),
        us(spread),
        arguments.spread_us,
        us(spreads.last().copied())
    );
    let response = quantile(&responses, JUDGED_QUANTILE);
    let answered = format!(
        "from sensors to command: median {} us, 99 % within {} us ({} are allowed), longest {} us; {left_out}",
        us(quantile(&responses, 0.5)),
        us(response),
        arguments.response_us,
        us(responses.last().copied())
    );
    let within = |ns: Option<u64>, us: u64| kept(ns.is_some_and(|ns| ns <= us * 1000));
    [
        case("regular", "cycle-time", within(spread, arguments.spread_us), cycle_time),
        case("regular", "response", within(response, arguments.response_us), answered),
    ]
}

fn during<'a>(
    received: &'a [ReceivedFrame],
    window: &'a Range<u64>,
) -> impl Iterator<Item = &'a ReceivedFrame> {
    received.iter().filter(|received| window.contains(&received.cycle))
}

/// Last cycle with an open valve within a window; `None` when it stayed shut.
fn last_open(received: &[ReceivedFrame], window: Range<u64>) -> Option<u64> {
    let open = |received: &&ReceivedFrame| {
        window.contains(&received.cycle)
            && matches!(received.frame, ObservedFrame::Command { opening, .. } if opening != 0.0)
    };
    received.iter().rev().find(open).map(|received| received.cycle)
}

fn valve_shut(class: &str, received: &[ReceivedFrame], window: Range<u64>, within: u64) -> Case {
    let began = window.start;
    let last = last_open(received, window.clone());
    let after = last.map_or(0, |cycle| cycle - began + 1);
    let detail = format!(
        "the last command that opened the valve came in cycle {after} after it began ({within} are allowed); watched for {}",
        window.end - began
    );
    case(class, "valve-shut", kept(after <= within), detail)
}

/// After an emergency stop the valve is shut, and stays shut while the stop lasts.
pub(super) fn emergency_stop(received: &[ReceivedFrame], window: Range<u64>) -> Vec<Case> {
    vec![valve_shut("emergency-stop", received, window, STOP_WITHIN_CYCLES)]
}

/// Without sensors the controller shuts the valve and may trip the emergency stop. It sends no command with an invented echo,
/// then or when the sensors are `back`.
pub(super) fn sensor_loss(received: &[ReceivedFrame], window: Range<u64>, back: Range<u64>) -> Vec<Case> {
    let class = "sensor-loss";
    let [without, again] = [&window, &back].map(|window| {
        during(received, window)
            .filter(|received| matches!(received.frame, ObservedFrame::Command { age: None, .. }))
            .count()
    });
    let reported = during(received, &window)
        .find(|received| matches!(&received.frame, ObservedFrame::Stop(stop) if !stop.release));
    let reported = match reported {
        Some(received) => (
            CheckResult::Passed,
            format!(
                "tripped the emergency stop {} cycles after the last sensors",
                received.cycle - window.start + 1
            ),
        ),
        None => (
            CheckResult::Skipped,
            "did not trip the emergency stop: the rig does not require it, a partner may".into(),
        ),
    };
    vec![
        valve_shut(class, received, window.clone(), LOSS_WITHIN_CYCLES),
        case(
            class,
            "no-invented-echo",
            kept(without + again == 0),
            format!(
                "{} commands echoed a cycle whose sensors were never sent, {again} of them in the {} cycles after the loss",
                without + again,
                back.end - back.start
            ),
        ),
        case(class, "told", reported.0, reported.1),
    ]
}

/// Quantile of sorted values: the value at rank ⌈share · n⌉, which this share of them does not exceed; `None` of no values.
fn quantile(sorted: &[u64], share: f64) -> Option<u64> {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}
