//! Runs that never were, for tests: regular rows of a rig and a controller, and what is done to them.

use super::files::RunFiles;
use super::json_files::{ControllerFile, RunFile, SummaryFile};
use super::samples::Samples;
use protocol::periods::CYCLE_NS;
use realtime::VitalCounts;
use runlog::conditions::Conditions;
use runlog::timing::{CycleTiming, Exchange};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// When cycle 0 was due.
pub(crate) const START_NS: u64 = 1_000_000_000_000;
/// Sensors on their way.
pub(crate) const TO_CONTROLLER_NS: u64 = 9_000;
/// A command on its way.
pub(crate) const TO_RIG_NS: u64 = 7_000;
/// CPUs of both processes.
pub(crate) const CPUS: [u64; 2] = [0, 1];

/// An undisturbed run with rows of both processes, what they counted, and no files.
pub(crate) fn run(cycles: u64) -> RunFiles {
    let mut run = RunFiles { whole: true, folder: "made-up".into(), ..RunFiles::default() };
    let (rig, controller) = (0..cycles).map(both).unzip();
    run.rows = BTreeMap::from([("emulator".into(), rig), ("controller".into(), controller)]);
    run.summary = SummaryFile::of(json!({
        "cycles": cycles, "skipped": 0, "overruns": 0, "frames_lost_at_rig": 0, "records_dropped": 0, "passed": true,
        "drive_commands": { "lost": 0 }, "load_commands": { "lost": 0 },
        "bus": { "dropped_on_receive": 0 },
        "bus_host": { "frames": 9 * cycles, "injected_loss": {}, "peers": [
            { "name": "process 1", "frames_received": 5 * cycles, "dropped_at_queue": {} },
            { "name": "process 2", "frames_received": 4 * cycles, "dropped_at_queue": {} },
        ] },
    }));
    let dma = "/dev/cpu_dma_latency held at 0 us";
    let granted = [dma, "memory locked, current and future", "pinned to CPU 0", "SCHED_FIFO priority 80"];
    run.run = RunFile::of(json!({
        "started_unix_s": 1.79e9, "realtime_granted": granted, "realtime_refused": [], "counts_allocations": false,
        "emulator_command_line": ["emulator", "run"],
        "machine": { "kernel": "Linux version 6.1.0-rt (x) #1 SMP PREEMPT_RT", "processors": 2,
            "preemption": { "model": "PREEMPT_RT" }, "hypervisor": "none", "clock_source": "tsc", "isolated": "0-1",
            "frequency_governors": ["CPUs 0,1: governor performance, driver x, 800 to 3000 MHz"],
            "smt": "no CPUs share a core (control: off)", "rt_throttling": { "about": "off" },
            "interrupts": { "CPU 0": "may come: none; do come: none", "CPU 1": "may come: none; do come: none" },
            "memory": { "swap_used_kib": 0 }, "build": { "profile": "release, opt-level 3" } },
    }));
    let granted = [dma, "memory locked, current and future", "pinned to CPU 1", "SCHED_FIFO priority 80"];
    let controller = ControllerFile::of(json!({
        "realtime_granted": granted, "axes": { "drive": { "sensors_lost": 0 }, "load": { "sensors_lost": 0 } },
        "bus": { "dropped_on_receive": 0 },
    }));
    run.controllers.extend(controller.map(|file| ("controller".to_owned(), file)));
    run.conditions = Some(Conditions {
        load_generator: Some("none, idle machine".into()),
        group: Some("a".into()),
        ..Conditions::default()
    });
    run
}

pub(crate) fn edit_summary(run: &mut RunFiles, change: impl FnOnce(&mut Value)) {
    let mut json = run.summary.take().map(|file| file.json).unwrap_or_default();
    change(&mut json);
    run.summary = SummaryFile::of(json);
}

pub(crate) fn edit_run(run: &mut RunFiles, change: impl FnOnce(&mut Value)) {
    let mut json = run.run.take().map(|file| file.json).unwrap_or_default();
    change(&mut json);
    run.run = RunFile::of(json);
}

pub(crate) fn edit_controller(run: &mut RunFiles, change: impl FnOnce(&mut Value)) {
    let mut json = run.controllers.remove("controller").map(|file| file.json).unwrap_or_default();
    change(&mut json);
    run.controllers.extend(ControllerFile::of(json).map(|file| ("controller".to_owned(), file)));
}

fn both(cycle: u64) -> (CycleTiming, CycleTiming) {
    let due_ns = START_NS + cycle * CYCLE_NS;
    let quiet = |cpu| VitalCounts { voluntary_switches: 1, run_delay_ns: 800, cpu, ..VitalCounts::default() };
    // Some spread, so that percentiles differ.
    let woke_ns = due_ns + 10_000 + cycle * 37 % 5_000;
    let sent_ns = woke_ns + 4_000;
    let answer_ns = sent_ns + TO_CONTROLLER_NS + 12_000;
    // The command that acts now answers the cycle before.
    let arrived_ns = answer_ns - CYCLE_NS + TO_RIG_NS;
    let answered = Exchange { sensors_ns: sent_ns, command_ns: arrived_ns, answers: cycle.wrapping_sub(1) };
    let answered = if cycle == 0 { Exchange { command_ns: 0, answers: 0, ..answered } } else { answered };
    let rig = CycleTiming {
        cycle,
        skipped: 0,
        due_ns,
        woke_ns,
        receive_ns: 1_000,
        step_ns: 3_000,
        send_ns: 4_000,
        done_ns: woke_ns + 8_000,
        drive: shifted(answered, cycle),
        load: shifted(answered, cycle),
        vitals: quiet(CPUS[0]),
    };
    let came_ns = sent_ns + TO_CONTROLLER_NS;
    let answer = Exchange { sensors_ns: came_ns, command_ns: answer_ns, answers: cycle };
    let controller = CycleTiming {
        due_ns: came_ns,
        woke_ns: came_ns + 5_000,
        done_ns: answer_ns + 1_000,
        drive: answer,
        load: answer,
        vitals: quiet(CPUS[1]),
        ..rig
    };
    (rig, controller)
}

/// The spread of wake-ups makes the answer of the cycle before arrive a little earlier or later.
fn shifted(reported: Exchange, cycle: u64) -> Exchange {
    if cycle == 0 {
        return reported;
    }
    let spread = |cycle: u64| cycle * 37 % 5_000;
    Exchange { command_ns: reported.command_ns + spread(cycle - 1) - spread(cycle), ..reported }
}

/// Makes a process wake this late in a cycle, missing those in between, and gives the row of its first cycle after.
pub(crate) fn stall<'a>(
    run: &'a mut RunFiles,
    process: &str,
    cycle: u64,
    late_ns: u64,
) -> &'a mut CycleTiming {
    let missed = late_ns / CYCLE_NS;
    let at_rig = process == "emulator";
    for (name, rows) in &mut run.rows {
        if at_rig || name == process {
            rows.retain(|row| row.cycle < cycle || row.cycle >= cycle + missed);
            // A controller never has the sensors that a rig did not send.
            let next =
                rows.iter_mut().find(|row| row.cycle == cycle + missed).expect("cycles after the stall");
            next.skipped = if at_rig { missed } else { 0 };
        }
    }
    let rows = run.rows.get_mut(process).expect("a process with rows");
    let row = rows.iter_mut().find(|row| row.cycle == cycle + missed).expect("cycles after the stall");
    let by_ns = (late_ns - missed * CYCLE_NS).saturating_sub(row.woke_ns - row.due_ns);
    row.woke_ns += by_ns;
    row.done_ns += by_ns;
    row
}

/// A run in which a process woke this late in a cycle.
pub(crate) fn stalled(cycles: u64, process: &str, cycle: u64, late_ns: u64) -> RunFiles {
    let mut run = run(cycles);
    stall(&mut run, process, cycle, late_ns);
    run
}

/// Makes the work of a cycle longer, and gives its row.
pub(crate) fn slow<'a>(run: &'a mut RunFiles, process: &str, cycle: u64, by_ns: u64) -> &'a mut CycleTiming {
    let rows = run.rows.get_mut(process).expect("a process with rows");
    let row = rows.iter_mut().find(|row| row.cycle == cycle).expect("the cycle");
    row.step_ns += by_ns;
    row.done_ns += by_ns;
    row
}

/// Puts a reference with these samples beside a run.
pub(crate) fn reference(run: &mut RunFiles, samples: Samples) {
    run.reference = Some(super::reference::Reference {
        command_line: "cyclictest -p 80 -a 0 -i 1000".into(),
        whole_us: false,
        samples,
        beyond_histogram: 0,
    });
}

/// Writes the files of a run into a folder, as the processes would.
pub(crate) fn write(run: &RunFiles, folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    let write = |name: &str, json: &Value| std::fs::write(folder.join(name), json.to_string()).unwrap();
    run.summary.iter().for_each(|file| write("summary.json", &file.json));
    run.run.iter().for_each(|file| write("run.json", &file.json));
    write("conditions.json", &json!(run.conditions));
    run.controllers.iter().for_each(|(process, file)| write(&format!("{process}.json"), &file.json));
    for (process, rows) in &run.rows {
        let mut table = Vec::new();
        runlog::timing::write_head(&mut table).unwrap();
        rows.iter().for_each(|row| runlog::timing::write_row(&mut table, row).unwrap());
        std::fs::write(folder.join(format!("{process}-timing.csv")), table).unwrap();
    }
}
