//! A controller in C as a customer would write it, `tests/firmware`, and how well it positions.
//!
//! It keeps no table of its own: what it does is read off the bus, and its set-point is computed a second time here.

use crate::binaries::workspace;
use crate::foreign_python::{light_path, python, tools_path};
use crate::records::count;
use protocol::can::CanFrame;
use protocol::frames::{ECHO_RANGE, Frame, MainChainState};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Largest dynamic and static error that it may have, m: the bounds of controller/experiments/point-to-point.toml.
const DYNAMIC_M: f64 = 0.004;
/// The same at rest.
const STATIC_M: f64 = 0.0004;
/// Largest rounding of a set-point that it reports, m.
const SET_POINT_M: f64 = 2e-5;

/// The places between which it moves, m, and its times, in cycles.
const PLACES_M: [f64; 2] = [0.1, 0.4];
const MOVE_CYCLES: u64 = 3000;
const REST_CYCLES: u64 = 1000;
/// How often it moves out and back; the first time with the chamber pressures of the start.
pub const REPETITIONS: u64 = 2;
/// The last part of a rest, over which the static error is averaged (bus.md, A run's folder).
const STATIC_CYCLES: u64 = 200;
/// Cycles without an answer, in real time, by which a machine that stands still holds the loop up; and how many cycles after it
/// are left out of the errors: some ten times the loop's lag.
const HELD_UP_CYCLES: u64 = 20;
const RECOVERY_CYCLES: u64 = 500;

/// Builds it into `folder`, as its Makefile does for a customer, warnings being errors; gives the folder. `options` are those of
/// make, such as the target `elf`.
pub fn build(folder: &Path, options: &[&str]) -> PathBuf {
    let mut make = Command::new("make");
    make.arg("-C").arg(workspace().join("tests/firmware")).args(options);
    make.env("PATH", tools_path())
        .env("PYTHONPATH", light_path())
        .arg(format!("BUILD={}", folder.display()))
        .arg(format!("PYTHON={}", python().display()));
    let built = make.output().expect("make is installed");
    assert!(
        built.status.success(),
        "the firmware does not build:\n{}",
        String::from_utf8_lossy(&built.stderr)
    );
    folder.into()
}

#[derive(Debug, Default)]
pub struct Positioned {
    /// Largest difference of set-point and position sensor while the set-point moves, m.
    pub position_error_dynamic_m: f64,
    /// Largest of the mean differences over the last 0.2 s of each rest, m.
    pub position_error_static_m: f64,
    /// Largest difference between the set-points that it reported and those that are computed here, m.
    pub set_point_error_m: f64,
    /// Set-points that it reported during the experiment.
    pub set_points: usize,
    /// Cycles of the experiment whose sensors crossed the bus, and that are in the errors.
    pub cycles: usize,
    /// Cycles that are left out, since the machine had held the loop up.
    pub left_out: usize,
    /// Rests with cycles in the static error.
    pub rests: usize,
}

impl Positioned {
    pub fn keeps_the_bounds(&self) -> bool {
        self.set_point_error_m < SET_POINT_M
            && self.position_error_dynamic_m < DYNAMIC_M
            && self.position_error_static_m < STATIC_M
    }

    /// Holds that the whole of so many repetitions in lockstep is within the bounds, by the errors of a real loop.
    #[track_caller]
    pub fn expect_whole(&self, repetitions: usize, least_set_points: usize) {
        eprintln!("{self:?}");
        assert_eq!((self.cycles, self.left_out), (8000 * repetitions, 0));
        assert!(self.set_points > least_set_points && self.keeps_the_bounds(), "{self:?}");
        assert!(self.position_error_dynamic_m > 5e-4, "a real loop has errors: {self:?}");
    }
}

/// Holds that the rig took a command in each cycle of a run in lockstep.
#[track_caller]
pub fn expect_every_cycle_answered(summary: &Value) {
    assert_eq!((count(summary, "/frames_malformed"), count(summary, "/stale_commands")), (0, 0));
    assert_eq!(count(summary, "/drive_commands/accepted"), count(summary, "/cycles"));
    for what in ["lost", "late", "duplicate", "breaks", "refused_stale"] {
        assert_eq!(count(summary, &format!("/drive_commands/{what}")), 0, "{what}");
    }
}

/// Reads off the frames of a run that ended after so many repetitions how it positioned. What a machine that stood still did to
/// the loop is left out, and reported.
pub fn positioned(frames: &[CanFrame], repetitions: u64) -> Positioned {
    let done = positioned_where_it_ran(frames, repetitions);
    assert_eq!(done.rests as u64, 2 * repetitions, "all rests are there");
    done
}

/// The same, of which a machine that stood still may have left nothing.
pub fn positioned_where_it_ran(frames: &[CanFrame], repetitions: u64) -> Positioned {
    let experiment_cycles = repetitions * 2 * (MOVE_CYCLES + REST_CYCLES);
    let mut trace = BusTrace::default();
    frames.iter().filter_map(|frame| Frame::decode(frame).ok()).for_each(|frame| trace.take(&frame));
    let began = trace.began.expect("it told that its experiment began");
    let mut done = Positioned::default();
    let mut rests: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    for (cycle, position_m) in trace.positions_m.range(began..began + experiment_cycles) {
        let (set_point_m, part, within) = set_point(cycle - began);
        let error_m = (set_point_m - position_m).abs();
        if trace.held_up.range(cycle.saturating_sub(RECOVERY_CYCLES)..=*cycle).count() > 0 {
            done.left_out += 1;
            continue;
        }
        done.cycles += 1;
        if within < MOVE_CYCLES {
            done.position_error_dynamic_m = done.position_error_dynamic_m.max(error_m);
        } else if within >= MOVE_CYCLES + REST_CYCLES - STATIC_CYCLES {
            rests.entry(part).or_default().push(error_m);
        }
    }
    done.rests = rests.len();
    let means = rests.values().map(|errors_m| errors_m.iter().sum::<f64>() / errors_m.len() as f64);
    done.position_error_static_m = means.fold(0.0, f64::max);
    for (cycle, reported_m) in trace.set_points_m.range(began + 1..began + experiment_cycles) {
        done.set_point_error_m = done.set_point_error_m.max((set_point(cycle - began).0 - reported_m).abs());
        done.set_points += 1;
    }
    done
}

/// The Bestehorn sinoid out, a rest, and back, a rest: set-point in m, which of all moves, and the cycle within it.
fn set_point(cycle: u64) -> (f64, u64, u64) {
    let (part, within) = (cycle / (MOVE_CYCLES + REST_CYCLES), cycle % (MOVE_CYCLES + REST_CYCLES));
    let (from_m, to_m) = if part % 2 == 0 { (PLACES_M[0], PLACES_M[1]) } else { (PLACES_M[1], PLACES_M[0]) };
    let z = within.min(MOVE_CYCLES) as f64 / MOVE_CYCLES as f64;
    (from_m + (to_m - from_m) * (z - libm::sin(TAU * z) / TAU), part, within)
}

/// Frames by the rig's cycles, skipped ones included, as far as they can be known from the bus.
#[derive(Default)]
struct BusTrace {
    cycle: u64,
    /// In lockstep frames of a cycle are sorted by identifier, and commands come first; in real time they come last, as they
    /// are sent.
    lockstep: bool,
    /// The cycle that the last command answers.
    answered: u64,
    /// Cycles that were answered, or should have been, after the loop was held up.
    held_up: BTreeSet<u64>,
    /// What waits for its command.
    waiting: Vec<Frame>,
    began: Option<u64>,
    positions_m: BTreeMap<u64, f64>,
    set_points_m: BTreeMap<u64, f64>,
}

impl BusTrace {
    fn take(&mut self, frame: &Frame) {
        match frame {
            Frame::Tick(tick) => (self.cycle, self.lockstep) = (u64::from(tick.cycle), tick.lockstep),
            Frame::DriveSensors(sensors) => {
                self.cycle += u64::from(sensors.alive).wrapping_sub(self.cycle) & 0xF;
                self.positions_m.insert(self.cycle, sensors.position_m);
            }
            Frame::DriveValveCommand(command) => {
                let age = self.cycle.wrapping_sub(u64::from(command.echo)) % ECHO_RANGE;
                let answered = self.cycle.saturating_sub(age);
                if answered - self.answered.min(answered) > HELD_UP_CYCLES || age > HELD_UP_CYCLES {
                    self.held_up.insert(self.cycle);
                }
                self.answered = answered;
                std::mem::take(&mut self.waiting).iter().for_each(|frame| self.take_report(frame));
            }
            reported if self.lockstep => self.take_report(reported),
            reported => self.waiting.push(*reported),
        }
    }

    /// Processes a report on the cycle that it answers.
    fn take_report(&mut self, reported: &Frame) {
        match reported {
            Frame::DriveChainStatus(status) if status.main_chain == MainChainState::Experiment => {
                self.began.get_or_insert(self.answered);
            }
            Frame::DriveChainValues(values) => {
                self.set_points_m.insert(self.answered, values.position_set_point_m);
            }
            _ => {}
        }
    }
}
