//! Creates both sides of the timing of a run before its threads start.

use super::queues::TimingQueues;
use super::{Stopwatch, TimingSenders};
use crate::cli::RunArguments;
use crate::report;
use crate::run::RunError;
use crossbeam_channel::bounded;
use realtime::{Clock, Freeze, Instant, MonotonicClock};
use runlog::flight_dump::FrameLogFormat;
use runlog::timing_recorder::{Activation, TimingRecorder, TimingSetup};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Capacity of the queue of samples: 16 s of cycles, and as many overtaken sensors.
const MEASURED_QUEUE: usize = 32 * 1024;
/// Capacity of the queue of frames, some eight for each of those cycles.
const FRAME_QUEUE: usize = 128 * 1024;
/// Interface name in the log of the embedded bus.
const EMBEDDED_INTERFACE: &str = "bus0";

/// Start of a run on the clocks of its files.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RunStart {
    pub(crate) unix_s: f64,
    /// The start on the monotonic clock.
    pub(crate) at: Instant,
    /// Offset from the monotonic clock to ns since 1970.
    pub(crate) epoch_offset_ns: u64,
}

impl RunStart {
    pub(crate) fn now() -> Self {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let at = MonotonicClock.now();
        let epoch_offset_ns = (unix.as_nanos() as u64).saturating_sub(at.as_nanos());
        Self { unix_s: unix.as_secs_f64(), at, epoch_offset_ns }
    }
}

/// The stopwatch of the loop, and the queues of the recorder's thread.
pub(crate) fn begin(
    arguments: &RunArguments,
    started: &RunStart,
    freeze: Freeze,
) -> Result<(Stopwatch<MonotonicClock>, TimingQueues), RunError> {
    let (measured_sender, measured) = bounded(MEASURED_QUEUE);
    let (frame_sender, frames) = bounded(FRAME_QUEUE);
    let senders = TimingSenders { measured: measured_sender, frames: frame_sender };
    let interface = arguments.bus.interface().unwrap_or(EMBEDDED_INTERFACE);
    let recorder = TimingRecorder::create(TimingSetup {
        folder: arguments.files.out.clone(),
        process: report::process(arguments.axis.list()),
        activation: Activation::OnArrival,
        full_timing: arguments.full_timing,
        flight_late: (!arguments.no_flight).then(|| Duration::from_micros(arguments.flight_late_us)),
        log: FrameLogFormat { interface: interface.into(), epoch_offset_ns: started.epoch_offset_ns },
        started_unix_s: started.unix_s,
        started: started.at,
        copies_lines: false,
    });
    let recorder = recorder.map_err(RunError::output)?;
    let queues = TimingQueues { measured, frames, freeze, recorder };
    Ok((Stopwatch::new(MonotonicClock, arguments.axis.list(), senders), queues))
}
