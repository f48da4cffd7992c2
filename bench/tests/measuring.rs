//! Probe and ping-pong as processes: what they leave behind, however they end.

use protocol::bus::WireOptions;
use protocol::bus::host::Host;
use realtime::{Clock, Instant, MonotonicClock, Request};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const MS: u64 = 1_000_000;

fn bench(line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bench"));
    command.args(line.split_whitespace()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn run(line: &str) -> Output {
    bench(line).output().expect("the program starts")
}

fn reported(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn signal(child: &Child, signal: Signal) {
    kill_process(Pid::from_child(child), signal).expect("it runs");
}

/// A CPU that this process may use: the last, as the first has the more to do.
fn a_cpu() -> usize {
    let allowed = rustix::thread::sched_getaffinity(None).expect("an affinity");
    (0..rustix::thread::CpuSet::MAX_CPU).rfind(|&cpu| allowed.is_set(cpu)).expect("at least one")
}

/// The probe on one CPU, watching.
fn probe(table: &Path, gap_us: u64) -> Child {
    let line = format!("probe --gap-us {gap_us} --cpus {} --out {}", a_cpu(), table.display());
    let mut child = bench(&line).spawn().expect("the program starts");
    let mut output = BufReader::new(child.stderr.take().expect("stderr is piped"));
    let mut first = String::new();
    output.read_line(&mut first).expect("it says that it watches");
    assert!(first.contains("probe watches"), "{first}");
    child
}

/// Rows of the table, each as numbers.
fn gaps(table: &Path) -> Vec<[u64; 4]> {
    let text = std::fs::read_to_string(table).expect("the table is there");
    assert!(text.ends_with('\n'), "whole lines only: {text}");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("cpu,from_ns,to_ns,another_ran"));
    let row = |line: &str| -> [u64; 4] {
        let values: Vec<u64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        values.try_into().expect("four columns")
    };
    lines.map(row).collect()
}

/// Gaps that cover all of this stretch.
fn covering(gaps: &[[u64; 4]], from: Instant, to: Instant) -> Vec<[u64; 4]> {
    let covers = |gap: &&[u64; 4]| gap[1] <= from.as_nanos() && gap[2] >= to.as_nanos();
    gaps.iter().filter(covers).copied().collect()
}

#[test]
fn a_stopped_probe_shows_a_gap_that_is_none_of_the_machines() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("probe.csv");
    let probe = probe(&table, 100);
    signal(&probe, Signal::STOP);
    // The signal takes a moment to arrive.
    std::thread::sleep(Duration::from_millis(20));
    let stopped = MonotonicClock.now();
    std::thread::sleep(Duration::from_millis(20));
    let until = MonotonicClock.now();
    signal(&probe, Signal::CONT);
    std::thread::sleep(Duration::from_millis(100));
    signal(&probe, Signal::TERM);
    let ended = probe.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(130), "interrupted with everything saved");
    let table = reported(&ended.stdout);
    assert!(table.contains("stood still") && table.contains("another thread ran"), "{table}");
    let found = covering(&gaps(&folder.path().join("probe.csv")), stopped, until);
    let [[cpu, from_ns, to_ns, another_ran]] = found[..] else { panic!("one gap, not {found:?}") };
    assert_eq!(cpu as usize, a_cpu());
    assert!(to_ns - from_ns >= 20 * MS);
    assert_eq!(another_ran, 1, "the machine did not stand still");
}

#[test]
fn a_thread_that_takes_the_cpu_shows_as_another_that_ran() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("probe.csv");
    let probe = probe(&table, 1000);
    // As root with real-time priority; for others any thread takes the CPU from an idle one all the same.
    let busy = std::thread::spawn(|| {
        let priority = rustix::process::geteuid().is_root().then_some(50);
        let wish = Request { fifo_priority: priority, cpu: Some(a_cpu()), ..Request::default() };
        assert_eq!(realtime::acquire(&wish).refusals, []);
        let from = MonotonicClock.now();
        let until = from + Duration::from_millis(30);
        while MonotonicClock.now() < until {
            std::hint::spin_loop();
        }
        (from, until)
    });
    let (from, until) = busy.join().unwrap();
    std::thread::sleep(Duration::from_millis(200));
    signal(&probe, Signal::TERM);
    assert_eq!(probe.wait_with_output().unwrap().status.code(), Some(130));
    let gaps = gaps(&table);
    // Without real-time priority the probe may get a moment in between: most of the stretch is what counts.
    let length = |gap: &[u64; 4]| gap[2].min(until.as_nanos()).saturating_sub(gap[1].max(from.as_nanos()));
    let longest = gaps.iter().max_by_key(|gap| length(gap)).expect("there are gaps");
    assert!(length(longest) >= 10 * MS, "{longest:?} of {gaps:?}");
    assert_eq!(longest[3], 1, "{longest:?}");
}

#[test]
fn a_probe_ends_by_itself_and_one_that_is_killed_leaves_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("probe.csv");
    let ended = run(&format!("probe --seconds 0.2 --out {}", table.display()));
    assert_eq!(ended.status.code(), Some(0), "{}", reported(&ended.stderr));
    gaps(&table);

    let probe = probe(&table, 100);
    signal(&probe, Signal::STOP);
    std::thread::sleep(Duration::from_millis(30));
    signal(&probe, Signal::CONT);
    // The writer's turn comes twenty times a second; here it has to come through other tests.
    let until = MonotonicClock.now() + Duration::from_secs(10);
    while gaps(&table).iter().all(|gap| gap[2] - gap[1] < 10 * MS) {
        assert!(MonotonicClock.now() < until, "nothing was written while it ran");
        std::thread::sleep(Duration::from_millis(10));
    }
    signal(&probe, Signal::KILL);
    let _ = probe.wait_with_output();
    assert!(!gaps(&table).is_empty());
}

#[test]
fn wrong_command_lines_are_refused_with_what_would_be_right() {
    for (line, hint) in [
        ("probe", "--out"),
        ("probe --out /proc/nope/probe.csv", "--out"),
        ("probe --out /dev/null --cpus all", "0-3,8"),
        ("probe --out /dev/null --cpus 9999", "online are"),
        ("probe --out /dev/null --gap-us 0", "1..=1000000"),
        ("probe --out /dev/null --seconds 0", "above 0"),
        ("ping-pong", "--bus"),
        ("ping-pong --socketpair --bus can://vcan0", "cannot be used with"),
        ("ping-pong --socketpair --priority 99", "1..=98"),
        ("ping-pong --bus vcan0", "can://IFACE"),
    ] {
        let ended = run(line);
        let output = reported(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{line}: {output}");
        assert!(output.contains(hint), "{line}: {output}");
    }
}

/// 0.2 s at a ping each millisecond.
const SHORT: &str = "--seconds 0.2 --no-realtime";

#[test]
fn a_ping_pong_counts_each_ping_on_both_lines_and_adds_its_figures_to_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let (json, hlog, socket) =
        (folder.path().join("ping-pong.json"), folder.path().join("p.hlog"), folder.path().join("bus0"));
    let host = Host::bind(&socket, WireOptions::default(), None).unwrap();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| host.serve(&stop));
        for line in ["--socketpair".to_owned(), format!("--bus unix://{}", socket.display())] {
            let (json, hlog) = (json.display(), hlog.display());
            let ended = run(&format!("ping-pong {line} {SHORT} --json {json} --out {hlog}"));
            // Told apart from a test that fails while the host serves for ever.
            if ended.status.code() != Some(0) {
                stop.store(true, Ordering::Relaxed);
            }
            assert_eq!(ended.status.code(), Some(0), "{}", reported(&ended.stderr));
            assert!(reported(&ended.stdout).contains("round trip: p50"), "{}", reported(&ended.stdout));
        }
        stop.store(true, Ordering::Relaxed);
    });
    let reported: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    for name in ["socketpair", "bus"] {
        let figures = &reported[name];
        let count = |key: &str| figures[key].as_u64().unwrap();
        assert_eq!(count("sent") + count("skipped"), 200, "{figures}");
        assert_eq!((count("sent"), count("lost")), (count("answered"), 0), "{figures}");
        assert_eq!(count("count"), count("answered"));
        assert!(count("p50") > 0 && count("p50") <= count("max"));
        assert!(reported["commands"][name].as_str().unwrap().contains("ping-pong"));
    }
    assert!(reported["socketpair"]["to_arrival_ns"].is_null());
    let bus = &reported["bus"];
    assert!(bus["to_arrival_ns"]["p50"].as_u64() <= bus["p50"].as_u64(), "{bus}");
    assert!(std::fs::read_to_string(hlog).unwrap().contains("Tag=ping-pong-bus,"));
}

#[test]
fn a_bus_without_a_host_is_reported_with_the_remedy_and_a_strange_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    let ended = run(&format!("ping-pong {SHORT} --bus unix://{}/nobody", folder.path().display()));
    let output = reported(&ended.stderr);
    assert_eq!(ended.status.code(), Some(3), "{output}");
    assert!(output.contains("emulator bus") && output.contains("which is down"), "{output}");

    let strange = folder.path().join("notes.json");
    std::fs::write(&strange, "precious").unwrap();
    let ended = run(&format!("ping-pong {SHORT} --socketpair --json {}", strange.display()));
    assert_eq!(ended.status.code(), Some(2), "{}", reported(&ended.stderr));
    assert_eq!(std::fs::read_to_string(&strange).unwrap(), "precious");
}

#[test]
fn an_interrupted_ping_pong_saves_its_figures_and_leaves_nobody_behind() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("ping-pong.json");
    let line = format!("ping-pong --socketpair --seconds 60 --no-realtime --json {}", json.display());
    let child = bench(&line).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    let children = format!("/proc/{0}/task/{0}/children", child.id());
    let pong = std::fs::read_to_string(children).unwrap_or_default().trim().to_owned();
    signal(&child, Signal::TERM);
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(130), "{}", reported(&ended.stderr));
    let text = std::fs::read_to_string(&json).unwrap();
    assert!(text.contains("\"socketpair\""), "{text}");
    assert!(pong.is_empty() || !Path::new("/proc").join(&pong).exists(), "process {pong} stayed");
}
