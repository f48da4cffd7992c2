//! What the kernel says of itself: its preemption model.

use super::Machine;
use super::files::Root;
use flate2::read::GzDecoder;
use serde::{Deserialize, Serialize};
use std::io::Read;

/// How the kernel lets an urgent thread take the CPU.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Preemption {
    /// `PREEMPT_RT`, `full`, `lazy`, `voluntary`, `none`, or `unknown`.
    pub model: String,
    /// Source of the value, or why there is none.
    pub told_by: String,
}

/// The model in which almost all of the kernel can be preempted, by its name here and in the kernel's version.
const PREEMPT_RT: &str = "PREEMPT_RT";

/// Kernel options of the models, in the order in which they are looked for.
const MODEL_OPTIONS: [(&str, &str); 5] = [
    ("CONFIG_PREEMPT_RT=y", PREEMPT_RT),
    ("CONFIG_PREEMPT=y", "full"),
    ("CONFIG_PREEMPT_LAZY=y", "lazy"),
    ("CONFIG_PREEMPT_VOLUNTARY=y", "voluntary"),
    ("CONFIG_PREEMPT_NONE=y", "none"),
];

impl Preemption {
    pub(super) fn read(root: &Root) -> Self {
        let found = |model: &str, told_by: &str| Self { model: model.into(), told_by: told_by.into() };
        let version = root.text("proc/version").unwrap_or_default();
        if root.number("sys/kernel/realtime") == Some(1) {
            return found(PREEMPT_RT, "/sys/kernel/realtime");
        }
        if version.contains(PREEMPT_RT) || version.contains("PREEMPT RT") {
            return found(PREEMPT_RT, "/proc/version");
        }
        // The file holds all modes and marks the one in use: "none voluntary (full) lazy".
        let debug = root.text("sys/kernel/debug/sched/preempt").unwrap_or_default();
        if let Some(mode) =
            debug.split_whitespace().find_map(|word| word.strip_prefix('(')?.strip_suffix(')'))
        {
            return found(mode, "/sys/kernel/debug/sched/preempt");
        }
        let dynamic = version.contains("PREEMPT_DYNAMIC");
        let command_line = root.text("proc/cmdline").unwrap_or_default();
        let asked =
            command_line.split_whitespace().filter_map(|word| word.strip_prefix("preempt=")).next_back();
        if let (true, Some(mode)) = (dynamic, asked) {
            return found(mode, "preempt= in /proc/cmdline of a kernel with PREEMPT_DYNAMIC");
        }
        if let Some((model, file)) = configured(root) {
            let how = if dynamic {
                "default of a kernel with PREEMPT_DYNAMIC, which /sys/kernel/debug/sched/preempt may have changed since; "
            } else {
                ""
            };
            return found(model, &format!("{how}{file}"));
        }
        if dynamic {
            return found(
                "unknown",
                "PREEMPT_DYNAMIC without preempt= in /proc/cmdline; /sys/kernel/debug/sched/preempt cannot be read (mount \
                 debugfs, be root), and no configuration of the kernel can",
            );
        }
        if version.split_whitespace().any(|word| word == "PREEMPT") {
            return found("full", "/proc/version");
        }
        found("unknown", "/proc/version does not tell, and no configuration of the kernel can be read")
    }
}

impl Machine {
    /// Whether the kernel is one with PREEMPT_RT. Older records lack the preemption model and name it in the kernel's version.
    #[must_use]
    pub fn is_preempt_rt(&self) -> bool {
        [&self.preemption.model, &self.kernel].iter().any(|text| text.contains(PREEMPT_RT))
    }
}

/// The model that the kernel was configured with, and the file that it was read from.
fn configured(root: &Root) -> Option<(&'static str, String)> {
    let packed = root.bytes("proc/config.gz").and_then(|packed| {
        let mut text = String::new();
        GzDecoder::new(packed.as_slice()).read_to_string(&mut text).ok()?;
        Some((text, "/proc/config.gz".to_owned()))
    });
    let plain = || {
        let path = format!("boot/config-{}", root.text("proc/sys/kernel/osrelease")?);
        Some((root.text(&path)?, format!("/{path}")))
    };
    let (text, file) = packed.or_else(plain)?;
    let is_set = |option: &str| text.lines().any(|line| line == option);
    MODEL_OPTIONS.iter().find(|(option, _)| is_set(option)).map(|(_, model)| (*model, file))
}
