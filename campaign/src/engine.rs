//! Makes the missing parts on several cores and reports progress.
//!
//! Each part depends on the campaign and its number alone, so that their order does not matter. A part is written as soon as it
//! is done: a start that is killed loses the parts in progress and nothing else.

use crate::campaign::{Campaign, CampaignError};
use crate::outcome::Outcome;
use crate::parts::{PartError, WriteError};
use crate::shard::Shard;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Least time between two lines of progress.
const PROGRESS_PERIOD: Duration = Duration::from_secs(2);

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StartReport {
    /// Runs that this start did.
    pub runs: u64,
    /// Simulated time of these runs, s.
    pub simulated_s: f64,
    /// Time that the start took on the wall clock, s.
    pub wall_s: f64,
    /// Parts of this shard that are still missing.
    pub missing: u64,
}

/// Why a start ended early; parts that were written stay.
#[derive(Debug, thiserror::Error)]
pub(crate) enum EngineError {
    /// A run that cannot be made.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// An existing part of another campaign or program.
    #[error(transparent)]
    Part(#[from] PartError),
    /// A part that cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("no threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// One start of a campaign, or of one of its shards.
pub(crate) struct Start<'a> {
    pub campaign: &'a Campaign,
    pub out: &'a Path,
    /// The share of this start.
    pub shard: Shard,
    pub jobs: usize,
    /// Set from outside to end the start.
    pub stop: &'a AtomicBool,
    /// Takes a line of progress every few seconds.
    pub say: &'a (dyn Fn(&str) + Sync),
}

impl Start<'_> {
    /// Makes the missing parts of its shard.
    ///
    /// # Errors
    /// The first [`EngineError`]; parts in progress stay missing.
    pub(crate) fn run(&self) -> Result<StartReport, EngineError> {
        let parts = &self.campaign.parts;
        let of_shard: Vec<u64> = (0..parts.count()).filter(|part| self.shard.holds(*part)).collect();
        let missing = self.missing(&of_shard)?;
        let runs_of = |list: &[u64]| list.iter().map(|part| parts.runs_of(*part).count() as u64).sum::<u64>();
        let todo = runs_of(&missing);
        (self.say)(&self.announcement(runs_of(&of_shard), missing.len(), todo));
        let tried = self.try_first(&missing, todo)?;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.jobs.max(1)).build()?;
        let progress = Progress::new(todo, self.say);
        let failed = Mutex::new(None);
        pool.install(|| {
            // One part at a time, so that no core idles while another has a queue.
            missing.par_iter().with_max_len(1).for_each(|part| {
                if self.is_over(&failed) {
                    return;
                }
                if let Err(error) = self.part(*part, tried.as_ref(), &progress, &failed) {
                    failed.lock().expect("no holder panics").get_or_insert(error);
                }
            });
        });
        match failed.into_inner().expect("no holder panics") {
            Some(error) => Err(error),
            None => Ok(progress.report(self.missing(&of_shard)?.len() as u64)),
        }
    }

    /// The parts among `parts` that are absent or unreadable.
    ///
    /// # Errors
    /// [`PartError`] for a part of another campaign or program, which is not overwritten.
    fn missing(&self, parts: &[u64]) -> Result<Vec<u64>, PartError> {
        let mut missing = Vec::new();
        for part in parts {
            match self.campaign.parts.read(self.out, *part) {
                Ok(Some(_)) => {}
                Ok(None) => missing.push(*part),
                Err(PartError::Unreadable { path, what }) => {
                    (self.say)(&format!("{path}: {what}; it is made again"));
                    missing.push(*part);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(missing)
    }

    fn announcement(&self, shard_runs: u64, parts: usize, todo: u64) -> String {
        let of_shard = if self.shard == Shard::WHOLE {
            String::new()
        } else {
            format!(", {shard_runs} of them in shard {}", self.shard)
        };
        format!(
            "{} runs ({} combinations, {} draws){of_shard}; {todo} to do in {parts} parts, {} at once",
            self.campaign.parts.runs, self.campaign.points.combinations, self.campaign.file.draws, self.jobs
        )
    }

    /// Makes the first missing run of an experiment, to estimate the total time. How long a command takes is unknown; there the
    /// first completed run gives the estimate.
    fn try_first(&self, missing: &[u64], todo: u64) -> Result<Option<(u64, Outcome)>, EngineError> {
        let (Some(first), Some(_)) = (missing.first(), self.campaign.experiment()) else { return Ok(None) };
        let run = self.campaign.parts.runs_of(*first).start;
        let began = Instant::now();
        let outcome = self.campaign.run(&self.campaign.points.point(run), self.stop)?;
        let at_once = self.jobs.clamp(1, missing.len()) as f64;
        let expected_s = began.elapsed().as_secs_f64() * todo as f64 / at_once;
        (self.say)(&format!("expected: {}", duration_text(expected_s)));
        Ok(outcome.map(|outcome| (run, outcome)))
    }

    fn is_over(&self, failed: &Mutex<Option<EngineError>>) -> bool {
        self.stop.load(Ordering::Relaxed) || failed.lock().expect("no holder panics").is_some()
    }

    fn part(
        &self,
        part: u64,
        tried: Option<&(u64, Outcome)>,
        progress: &Progress<'_>,
        failed: &Mutex<Option<EngineError>>,
    ) -> Result<(), EngineError> {
        let mut rows = String::new();
        for run in self.campaign.parts.runs_of(part) {
            // An incomplete part is not written, so that its other runs are not needed.
            if self.is_over(failed) {
                return Ok(());
            }
            let point = self.campaign.points.point(run);
            let outcome = match tried {
                Some((tried, outcome)) if *tried == run => Some(outcome.clone()),
                _ => self.campaign.run(&point, self.stop)?,
            };
            // The signal that stops this process may have ended the run's programs too; their outcome is no result then.
            let Some(outcome) = outcome.filter(|_| !self.stop.load(Ordering::Relaxed)) else { return Ok(()) };
            rows += &self.campaign.row(&point, &outcome);
            progress.ran(outcome.simulated_s);
        }
        Ok(self.campaign.parts.write(self.out, part, &rows)?)
    }
}

/// Counters behind the lines of progress.
struct Progress<'a> {
    todo: u64,
    began: Instant,
    runs: AtomicU64,
    simulated_ms: AtomicU64,
    reported: Mutex<Instant>,
    say: &'a (dyn Fn(&str) + Sync),
}

impl<'a> Progress<'a> {
    fn new(todo: u64, say: &'a (dyn Fn(&str) + Sync)) -> Self {
        let began = Instant::now();
        Self {
            todo,
            began,
            runs: AtomicU64::new(0),
            simulated_ms: AtomicU64::new(0),
            reported: Mutex::new(began),
            say,
        }
    }

    fn ran(&self, simulated_s: f64) {
        self.simulated_ms.fetch_add((simulated_s * 1e3).round() as u64, Ordering::Relaxed);
        let runs = self.runs.fetch_add(1, Ordering::Relaxed) + 1;
        let mut reported = self.reported.lock().expect("no holder panics");
        if runs == 1 || reported.elapsed() >= PROGRESS_PERIOD {
            *reported = Instant::now();
            let wall_s = self.began.elapsed().as_secs_f64();
            let left_s = wall_s / runs as f64 * (self.todo - runs) as f64;
            (self.say)(&format!("{runs}/{} runs, {} left", self.todo, duration_text(left_s)));
        }
    }

    fn report(&self, missing: u64) -> StartReport {
        StartReport {
            runs: self.runs.load(Ordering::Relaxed),
            simulated_s: self.simulated_ms.load(Ordering::Relaxed) as f64 * 1e-3,
            wall_s: self.began.elapsed().as_secs_f64(),
            missing,
        }
    }
}

/// A duration in s, min, h or days.
pub(crate) fn duration_text(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..60 => format!("{seconds:.0} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        3600..172_800 => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
        _ => format!("{:.1} days", seconds / 86_400.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_printed_in_the_units_that_people_use() {
        let reported = [0.4, 59.0, 60.0, 3599.0, 3600.0, 90_000.0, 864_000.0].map(duration_text);
        assert_eq!(
            reported,
            ["0 s", "59 s", "1 min 00 s", "59 min 59 s", "1 h 00 min", "25 h 00 min", "10.0 days"]
        );
    }
}
