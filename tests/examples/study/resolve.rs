//! The command that runs what a program proposes to measure next.

use crate::cli::ResolveArguments;
use crate::{Done, PAGE, committed, program, say, told};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use system_tests::study::campaign::{Campaign, make_record};
use system_tests::study::document;
use system_tests::study::folder::{Study, write_whole};
use system_tests::study::resolve::{self, Table};

pub(crate) fn resolve(arguments: &ResolveArguments, stop: &AtomicBool) -> Done {
    let study = Study::open(&arguments.out)?;
    let limit = Duration::from_secs_f64(arguments.time_limit.max(0.001));
    if let Some(path) = &arguments.program {
        let program = program(path, &arguments.arguments, limit)?;
        let campaign = Campaign {
            study: &study,
            program: Some(&program),
            label: &arguments.label,
            make: &make_record,
            without: None,
            only: &arguments.only,
            jobs: arguments.jobs,
            keep_truth: false,
            drop_records: false,
            least_free_mib: arguments.least_free,
            stop,
            say: &say,
        };
        told(resolve::run(&campaign, &program)?);
    }
    let table = Table::of(&study, &arguments.label)?;
    let text = table.markdown();
    let path = |extension: &str| study.root.join(format!("resolve-{}.{extension}", arguments.label));
    write_whole(&path("json"), format!("{:#}\n", serde_json::json!(table)).as_bytes())?;
    write_whole(&path("md"), text.as_bytes())?;
    if arguments.write {
        document::put(&committed(PAGE), "resolve", &text)?;
    }
    say(&format!("\n{text}"));
    say(&path("json").display().to_string());
    Ok(())
}
