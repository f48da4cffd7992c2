//! Ten viewers of the live page while the loop runs: a browser, eight that listen to events, and one that reads none.

use crate::launch::Pace;
use crate::onlooker::LivePage;
use crate::process::{PATIENCE, Running};
use crate::records::count;
use crate::scene::{RESTLESS, Scene};
use std::io::Read;
use std::net::TcpStream;
use std::process::Command;
use std::time::Duration;

/// Viewers that listen and read; with the browser and the one that stands still there are ten.
const LISTENERS: usize = 8;

#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    pub missed: u64,
    /// Its wake-ups that came late enough to be counted.
    pub overruns: u64,
    /// Median and 99th percentile of its wake-up, ns.
    pub wakeup_ns: [u64; 2],
    pub round_trip_p99_ns: u64,
    pub records_dropped: u64,
    /// Viewers that the page had when the run was half over.
    pub viewers: u64,
}

/// Runs rig and controllers in real time for so long, with the live page and ten viewers, or with neither.
pub fn run(seconds: u32, with: bool) -> Outcome {
    let scene = Scene::new(RESTLESS);
    let mut options = format!("--seconds {seconds}");
    if with {
        options += &format!(" --telemetry {}", scene.path("telemetry").display());
    }
    let (emulator, controller) = scene.start(Pace::Real, &options, "--repeat");
    let page = with.then(|| LivePage::open(&scene, ""));
    let clients = page.as_ref().map(|page| LivePageClients::start(&scene, page));
    scene.wait_for_rows("emulator", seconds as usize * 500);
    let viewers = page.as_ref().map_or(0, |page| count(&page.state(), "/viewers"));
    emulator.wait_within(Duration::from_secs(u64::from(seconds)) + PATIENCE).expect_code(0);
    controller.wait();
    drop(clients);
    if let Some(page) = page {
        page.close();
    }
    let summary = scene.summary();
    let of = |pointer: &str| count(&summary, pointer);
    Outcome {
        missed: of("/skipped"),
        overruns: of("/overruns"),
        wakeup_ns: [of("/wakeup_ns/p50"), of("/wakeup_ns/p99")],
        round_trip_p99_ns: of("/round_trip_ns/p99"),
        records_dropped: of("/records_dropped"),
        viewers,
    }
}

struct LivePageClients {
    _browser: Running,
    _still: TcpStream,
}

impl LivePageClients {
    fn start(scene: &Scene, page: &LivePage) -> Self {
        let mut command = Command::new("chromium");
        command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run"]);
        command.arg(format!("--user-data-dir={}", scene.path("browser").display()));
        command.arg("--remote-debugging-port=0").arg(format!("http://{}/", page.address));
        for _ in 0..LISTENERS {
            let mut stream = page.listen();
            // Each ends with its connection.
            std::thread::spawn(move || {
                let mut bytes = [0; 65536];
                while stream.read(&mut bytes).is_ok_and(|read| read > 0) {}
            });
        }
        Self { _browser: Running::start("chromium", &mut command), _still: page.listen() }
    }
}
