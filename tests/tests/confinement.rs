//! What the programs touch that is not theirs: no file outside the folders they are given, no socket beyond this machine.
//!
//! strace lists the files, system call by system call, so that one that is written and removed again counts, too.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use system_tests::{Pace, Program, Running, SHORT, Scene, run_both, text, turn, xcp};

/// System calls that make, change or remove something in a file system.
const CALLS: &str = "open,openat,openat2,creat,mkdir,mkdirat,rename,renameat,renameat2,link,linkat,symlink,symlinkat,unlink,\
    unlinkat,rmdir,truncate,chmod,fchmodat,?fchmodat2,chown,fchownat,mknod,mknodat,bind";

/// What the kernel shows as files, and is none.
const NO_FILES: [&str; 2] = ["/dev/", "/proc/"];

/// The shell line that has strace write what a program does into a file.
fn traced(log: &Path) -> String {
    format!("exec strace -f -qq -e signal=none -e trace={CALLS} -o {} \"$0\" \"$@\"", log.display())
}

/// Paths that a traced program wrote to, made or removed.
fn written(log: &Path) -> BTreeSet<PathBuf> {
    let text = text(log);
    assert!(text.contains("openat"), "{} tells of no file at all", log.display());
    let changes = |line: &&str| {
        let opens = line.contains("open(") || line.contains("openat(") || line.contains("openat2(");
        !opens || ["O_WRONLY", "O_RDWR", "O_CREAT"].iter().any(|flag| line.contains(flag))
    };
    let paths = |line: &str| line.split('"').skip(1).step_by(2).map(PathBuf::from).collect::<Vec<_>>();
    text.lines().filter(changes).flat_map(paths).collect()
}

#[test]
fn nothing_is_written_outside_the_folders_that_are_given() {
    let scene = Scene::new(SHORT);
    let faults = scene.write(
        "faults.toml",
        "[[fault]]\nname = \"valve-slow\"\nat = \"drive\"\nfrom_s = 0.6\nfor_s = 0.05\n",
    );
    let config = xcp::config(&scene);
    let logs = [scene.path("emulator.strace"), scene.path("controller.strace")];
    run_both(
        &scene
            .emulator(Pace::Lockstep)
            .with(&format!("--faults {}", faults.display()))
            .after_shell(&traced(&logs[0])),
        &scene
            .controller(Pace::Lockstep)
            .with(&format!("--xcp {}", config.display()))
            .after_shell(&traced(&logs[1])),
    );
    let folder = scene.path("");
    for log in logs {
        let written = written(&log);
        assert!(written.iter().any(|path| path.starts_with(&folder)), "{written:?}");
        let allowed = |path: &&PathBuf| {
            path.starts_with(&folder) || NO_FILES.iter().any(|prefix| path.starts_with(prefix))
        };
        let outside: Vec<_> = written.iter().filter(|path| !allowed(path)).collect();
        assert!(outside.is_empty(), "{}: {outside:?}", log.display());
    }
}

/// Addresses at which a process listens for TCP, as the kernel writes them: in hexadecimal, the port behind a colon.
fn listens(process: &Running) -> Vec<String> {
    let folder = format!("/proc/{}/fd", process.number());
    let links = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{folder}: {error}"));
    let sockets: BTreeSet<String> = links
        .filter_map(|link| fs::read_link(link.ok()?.path()).ok())
        .filter_map(|target| {
            Some(target.to_str()?.strip_prefix("socket:[")?.trim_end_matches(']').to_owned())
        })
        .collect();
    let lines =
        ["/proc/net/tcp", "/proc/net/tcp6"].map(|table| fs::read_to_string(table).unwrap_or_default());
    let listening = lines.iter().flat_map(|text| text.lines()).filter_map(|line| {
        // Number, local address, remote address, state (0A: listening), …, inode.
        let fields: Vec<_> = line.split_whitespace().collect();
        (fields.get(3) == Some(&"0A") && sockets.contains(*fields.get(9)?)).then(|| fields[1].to_owned())
    });
    listening.collect()
}

#[test]
fn rig_and_controllers_listen_nowhere_and_the_gateway_on_loopback_alone() {
    let scene = Scene::new(SHORT);
    let config = xcp::config(&scene);
    let _machine = turn::take();
    let emulator = scene.emulator(Pace::Real).with("--seconds 60").start();
    let controller =
        scene.controller(Pace::Real).with(&format!("--repeat --xcp {}", config.display())).start();
    scene.wait_for_rows("emulator", 100);
    // No --listen: what it does by default.
    let mut gateway = Program::Bench.start(&[&"gateway", &"--bus", &scene.url()]);
    gateway.wait_for("Ctrl-C ends it");
    assert_eq!(listens(&emulator), Vec::<String>::new());
    assert_eq!(listens(&controller), Vec::<String>::new());
    // 127.0.0.1:29536.
    assert_eq!(listens(&gateway), ["0100007F:7360"]);
}
