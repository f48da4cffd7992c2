//! Experiment files, as the rig (`[rig]`) and as the controllers read them.
#![no_main]

use axis_control::experiment::Experiment;
use libfuzzer_sys::fuzz_target;
use plant::{RigParameters, Scene};
use std::path::Path;
use std::sync::OnceLock;

fuzz_target!(|text: &str| {
    static RIG: OnceLock<RigParameters> = OnceLock::new();
    let rig = RIG.get_or_init(RigParameters::baseline);
    if let Err(error) = Scene::from_toml(text, "experiment.toml", rig) {
        assert!(!error.to_string().is_empty());
    }
    // Tables of set-points are read beside the file; there is no such folder.
    match Experiment::from_toml(text, Path::new("/nonexistent/experiment.toml"), rig.cylinder().stroke_m) {
        Ok(experiment) => assert!(experiment.duration_s().is_finite()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
