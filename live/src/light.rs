//! The light: whether the run so far supports a latency claim, by the rules of the report.
//!
//! `no`: a rule is violated that the rest of the run can hardly satisfy. `doubtful`: no rule is violated, but something is
//! missing; without a reference interleaved with the runs this remains to the end, as in the report. `yes`: the report would
//! support the claim. Missed cycles count by their share of the run so far, as in the report: the light may return to `yes`
//! when the share falls, and the count is shown beside it.

use latency::claim::{self, CycleCount};
use latency::conditions::conditions;
use latency::files::RunFiles;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The files of the run that the rules need.
#[derive(Debug, Default)]
pub(crate) struct ClaimMonitor {
    folder: Option<PathBuf>,
    run: RunFiles,
}

/// State of the light.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Judgement {
    pub supported: Support,
    pub reasons: Vec<String>,
}

/// Whether the run so far supports a latency claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Support {
    Yes,
    No,
    Doubtful,
}

impl ClaimMonitor {
    /// For the run in this folder.
    pub(crate) fn new(folder: Option<&Path>) -> Self {
        Self { folder: folder.map(Path::to_path_buf), run: RunFiles::default() }
    }

    /// Judges the run after `cycles` cycles, of which `skipped` were skipped.
    pub(crate) fn judge(&mut self, cycles: u64, skipped: u64) -> Judgement {
        // The emulator writes run.json after acquiring its privileges, which is after it accepts viewers.
        let is_known = self.folder.as_deref().is_some_and(|folder| self.run.read_description(folder));
        if !is_known {
            let reason = "What the emulator was granted is not known: its run.json was not found.";
            return Judgement { supported: Support::Doubtful, reasons: vec![reason.to_owned()] };
        }
        let conditions = conditions(std::slice::from_ref(&self.run));
        let interim = claim::interim_claim(&self.run, &conditions, CycleCount { cycles, skipped });
        let supported = match (interim.against.is_empty(), interim.missing.is_empty()) {
            (false, _) => Support::No,
            (true, false) => Support::Doubtful,
            (true, true) => Support::Yes,
        };
        Judgement { supported, reasons: [interim.against, interim.missing].concat() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn judged(run: &Value, skipped: u64) -> Judgement {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("run.json"), run.to_string()).unwrap();
        ClaimMonitor::new(Some(folder.path())).judge(10_000, skipped)
    }

    #[test]
    fn what_speaks_against_a_claim_puts_it_out_and_what_is_missing_makes_it_doubtful() {
        let granted =
            json!(["SCHED_FIFO priority 80", "memory locked, current and future", "pinned to CPU 0"]);
        let run = json!({ "realtime_granted": granted, "machine": { "build": { "profile": "release" } } });
        assert_eq!(judged(&run, 10).supported, Support::Doubtful);
        let missed = judged(&run, 11);
        assert_eq!(missed.supported, Support::No);
        assert!(missed.reasons[0].contains("missed 0.1 %"), "{missed:?}");
        assert_eq!(judged(&json!({ "realtime_granted": [] }), 0).supported, Support::No);
        assert_eq!(ClaimMonitor::new(None).judge(1, 0).supported, Support::Doubtful);
    }
}
