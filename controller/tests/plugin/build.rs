//! Builds libraries with the system's C compiler, as a user does.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use plugin::{TRIAL_LIMIT, TrialRunner};

pub(crate) struct Libraries(tempfile::TempDir);

impl Libraries {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    pub(crate) fn place(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The shipped example, built with the options that its head names.
    pub(crate) fn example(&self) -> PathBuf {
        let source = in_crate("examples-c/position_pi.c");
        let head = fs::read_to_string(&source).expect("the example");
        let line = head
            .lines()
            .find_map(|line| line.strip_prefix(" * gcc "))
            .expect("its head says how to build it");
        let options = line.split(' ').take_while(|word| *word != "-I");
        let library = self.place("position_pi.so");
        compile(Command::new("gcc").args(options), &source, &library);
        library
    }

    /// The hostile library with `options`, such as `-DVERSION=7`; under a name of its own, because the system takes a second
    /// library of a name for the first.
    pub(crate) fn hostile(&self, options: &[&str]) -> PathBuf {
        let before = fs::read_dir(self.0.path()).expect("a folder").count();
        let library = self.place(&format!("hostile-{before}.so"));
        let mut compiler = Command::new("gcc");
        // Bad code is what they are for: no warnings.
        compiler.args(["-std=c11", "-w", "-fPIC", "-shared"]).args(options);
        compile(&mut compiler, &in_crate("tests/plugin/hostile.c"), &library);
        library
    }
}

fn in_crate(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn compile(compiler: &mut Command, source: &Path, library: &Path) {
    let command = compiler.arg("-I").arg(in_crate("include")).arg(source).arg("-o").arg(library).arg("-lm");
    let output = command.output().expect("gcc");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// The controller that was built with these tests.
pub(crate) fn trier() -> TrialRunner {
    trier_with(TRIAL_LIMIT)
}

pub(crate) fn trier_with(limit: Duration) -> TrialRunner {
    TrialRunner { program: env!("CARGO_BIN_EXE_controller").into(), limit }
}
