//! python-can on the embedded bus: its own back-to-back tests, ours of `python/tests`, and the example of a job for a hosted
//! runner.

use std::process::Command;
use system_tests::foreign_python::of;
use system_tests::{CompletedProcess, Running, shipped_programs, turn, workspace};

/// Lines of `pytest -v` that end in a word such as PASSED.
fn ended_so(ended: &CompletedProcess, word: &str) -> Vec<String> {
    let lines = ended.stdout.lines().filter(|line| line.contains(&format!(" {word}")));
    lines.map(|line| line.split_whitespace().next().expect("a name").to_owned()).collect()
}

#[test]
fn python_cans_own_tests_and_ours_pass_on_the_embedded_bus() {
    let mut pytest = Command::new(of("hil"));
    // CI leaves out what measures the machine, by python-can's own switch.
    pytest.args(["-m", "pytest", "-v", "-p", "no:cacheprovider", "--color=no"]).env("CI", "1");
    let python = workspace().join("python");
    // Those of the rig are `python_rig.rs`'s.
    pytest.arg(&python).arg("--ignore").arg(python.join("tests/rig"));
    pytest.env("AIRBENCH_BIN_DIR", shipped_programs());
    let ended = Running::start("pytest", &mut pytest).wait().expect_code(0);
    let (passed, skipped) = (ended_so(&ended, "PASSED"), ended_so(&ended, "SKIPPED"));
    assert!(ended_so(&ended, "FAILED").is_empty());
    // Two of time, and two that python-can skips everywhere, in both classes.
    assert_eq!(skipped.len(), 8, "{skipped:?}");
    let theirs = passed.iter().filter(|name| name.contains("test_back2back.py")).count();
    assert_eq!(theirs, 26, "{passed:?}");
    for kind in ["TestBack2Back", "TestThreadSafe"] {
        for test in
            ["standard_message", "extended_message", "remote_message", "unique_message_instances", "fileno"]
        {
            let name = format!("{kind}::test_{test}");
            assert!(passed.iter().any(|line| line.ends_with(&name)), "{name}: {passed:?}");
        }
    }
    assert!(passed.iter().any(|line| line.ends_with("TestThreadSafe::test_concurrent_writes")));
    assert!(passed.len() - theirs >= 9, "{passed:?}");
}

#[test]
fn the_example_of_a_job_tests_can_software_at_a_rig_without_root_or_vcan() {
    let _machine = turn::take();
    let folder = workspace().join("docs/examples/python-can");
    let workflow = std::fs::read_to_string(folder.join("workflow.yml")).expect("the workflow");
    let commands: Vec<_> = workflow.lines().filter_map(|line| line.trim().strip_prefix("run: ")).collect();
    assert_eq!(
        commands,
        ["airbench/docs/examples/python-can/job.sh airbench"],
        "what is run here is what it runs"
    );
    assert!(workflow.contains("path: airbench\n") && workflow.contains("runs-on: ubuntu-24.04"));
    let mut job = Command::new(folder.join("job.sh"));
    job.arg(workspace()).env("PYTHON", of("hil")).env("AIRBENCH_BIN_DIR", shipped_programs());
    Running::start("job.sh", &mut job).wait().expect_code(0).expect_stdout(&["2 passed"]);
}
