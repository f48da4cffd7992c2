//! Runs an empty loop for some seconds and prints how late it was, to be compared with cyclictest.
//!
//! ```text
//! cargo run --release -p realtime --example jitter -- --seconds 10 --fifo 80 --cpu 1 --lock-memory --dma-latency
//! ```
//! What is printed is a figure of this machine in these seconds. The second line is the cyclictest command that asks
//! for the same, to be run right after: p50 and p99 compare, the maximum belongs to the machine.

#![allow(clippy::print_stdout, reason = "this program is there to print")]

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use realtime::{
    Clock, LoopStatistics, MonotonicClock, OverrunPolicy, PeriodicConfig, PeriodicLoop, Request, acquire,
    write_hlog,
};

const USAGE: &str = "\
jitter [--seconds 5] [--period-us 1000] [--policy catch-up|stop] [--spin-us N]
       [--fifo 1..99] [--cpu N] [--lock-memory] [--dma-latency] [--timer-slack] [--hlog FILE]";

struct Options {
    seconds: f64,
    config: PeriodicConfig,
    request: Request,
    hlog: Option<PathBuf>,
}

fn main() -> ExitCode {
    match options(std::env::args().skip(1)).and_then(|options| run(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("jitter: {error}\n{USAGE}");
            ExitCode::from(2)
        }
    }
}

fn run(options: &Options) -> Result<(), Box<dyn Error>> {
    let Options { seconds, config, request, hlog } = options;
    let cycles = (seconds / config.period.as_secs_f64()).round() as u64;
    println!("{cycles} cycles of {:?}, policy {}, spin {:?}", config.period, config.policy, config.spin);
    println!("compare: {}", cyclictest_for(request, config, cycles));

    let grants = acquire(request);
    grants.granted.iter().for_each(|line| println!("granted: {line}"));
    grants.refusals.iter().for_each(|refusal| println!("warning: {refusal}"));

    let started = SystemTime::now().duration_since(UNIX_EPOCH)?;
    let clock = MonotonicClock;
    let mut periodic = PeriodicLoop::new(clock, *config, clock.now() + Duration::from_millis(10));
    let stopped = loop {
        match periodic.next_cycle() {
            Ok(cycle) => {
                periodic.end_of_work();
                if cycle.index + 1 >= cycles {
                    break None;
                }
            }
            Err(overrun) => break Some(overrun),
        }
    };
    drop(grants);
    if let Some(overrun) = stopped {
        println!("{overrun}");
    }
    report(&periodic.statistics);
    if let Some(path) = hlog {
        let LoopStatistics { wakeup_ns, execution_ns, period_error_ns, .. } = &periodic.statistics;
        let parts = [
            ("wakeup_ns", wakeup_ns.histogram()),
            ("execution_ns", execution_ns.histogram()),
            ("period_error_ns", period_error_ns.histogram()),
        ];
        write_hlog(path, &parts, started.as_secs_f64(), Duration::try_from_secs_f64(*seconds)?)?;
    }
    Ok(())
}

fn report(statistics: &LoopStatistics) {
    let LoopStatistics { cycles, skipped, overruns, late_completions, .. } = statistics;
    println!("cycles {cycles}, skipped {skipped}, overruns {overruns}, late completions {late_completions}");
    println!("wake-up latency  {}", statistics.wakeup_ns.percentiles());
    println!("execution time   {}", statistics.execution_ns.percentiles());
    println!("period error     {}", statistics.period_error_ns.percentiles());
}

/// cyclictest holds /dev/cpu_dma_latency at 0 by itself.
fn cyclictest_for(request: &Request, config: &PeriodicConfig, cycles: u64) -> String {
    let mut command = format!("cyclictest -q -t1 -i{} -l{cycles} -h5000", config.period.as_micros());
    if let Some(priority) = request.fifo_priority {
        command += &format!(" -p{priority} --policy=fifo");
    }
    if let Some(cpu) = request.cpu {
        command += &format!(" -a{cpu}");
    }
    if request.lock_memory {
        command += " -m";
    }
    command
}

fn options(mut arguments: impl Iterator<Item = String>) -> Result<Options, Box<dyn Error>> {
    let mut config =
        PeriodicConfig { period: Duration::from_millis(1), policy: OverrunPolicy::CatchUp, spin: None };
    let mut request = Request::default();
    let (mut seconds, mut hlog) = (5.0, None);
    while let Some(name) = arguments.next() {
        match name.as_str() {
            "--seconds" => seconds = value(&name, &mut arguments)?,
            "--period-us" => config.period = Duration::from_micros(value(&name, &mut arguments)?),
            "--policy" => config.policy = value(&name, &mut arguments)?,
            "--spin-us" => config.spin = Some(Duration::from_micros(value(&name, &mut arguments)?)),
            "--fifo" => request.fifo_priority = Some(value(&name, &mut arguments)?),
            "--cpu" => request.cpu = Some(value(&name, &mut arguments)?),
            "--lock-memory" => request.lock_memory = true,
            "--dma-latency" => request.dma_latency = true,
            "--timer-slack" => request.timer_slack = true,
            "--hlog" => hlog = Some(value(&name, &mut arguments)?),
            _ => return Err(format!("option {name:?} is not known").into()),
        }
    }
    config.check()?;
    if !(seconds > 0.0 && seconds <= 86_400.0) {
        return Err(format!("--seconds {seconds}: allowed is more than 0 and at most a day").into());
    }
    Ok(Options { seconds, config, request, hlog })
}

fn value<T: FromStr>(name: &str, arguments: &mut impl Iterator<Item = String>) -> Result<T, Box<dyn Error>>
where
    T::Err: Error + 'static,
{
    let text = arguments.next().ok_or_else(|| format!("{name} needs a value"))?;
    text.parse().map_err(|error: T::Err| format!("{name} {text}: {error}").into())
}
