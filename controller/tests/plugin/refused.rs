//! Libraries that are refused when they are loaded, each with its words.

use crate::build::{Libraries, trier, trier_with};
use nominal::RigParameters;
use plugin::{describe, load_tried_by, probe};
use std::process::Command;
use std::time::Duration;

/// What is wrong, as options of the compiler, and words that the refusal must hold.
const TABLE: &[(&str, &[&str], &[&str])] = &[
    ("wrong version", &["-DVERSION=7"], &["version 7", "airbench version 1", "build it again"]),
    ("wrong size", &["-DSIZE=40"], &["struct_size of 40 bytes, 72 are right"]),
    ("no descriptor", &["-DAT_ENTRY=return NULL;"], &["airbench_algorithm_entry(1) returned NULL"]),
    (
        "descriptor at an odd address",
        &["-DAT_ENTRY=return (const void *)((const char *)&algorithm + 1);"],
        &["descriptor stands at an address"],
    ),
    ("no symbol", &["-DENTRY_NAME=another_entry"], &["exports no symbol airbench_algorithm_entry"]),
    ("hidden symbol", &["-DENTRY_NAME=hidden", "-fvisibility=hidden"], &["exports no symbol"]),
    ("a function that is nowhere", &["-DAT_STEP=nowhere();"], &["does not load it", "nowhere"]),
    ("crash in the entry", &["-DAT_ENTRY=CRASH"], &["SIGSEGV", "during: airbench_algorithm_entry"]),
    ("crash in create", &["-DAT_CREATE=CRASH"], &["SIGSEGV", "during: create"]),
    ("abort in create", &["-DAT_CREATE=abort();"], &["SIGABRT", "during: create"]),
    ("crash in a step", &["-DSTEP_NUMBER=7", "-DAT_STEP=CRASH"], &["SIGSEGV", "during: step 7"]),
    ("crash in destroy", &["-DAT_DESTROY=CRASH"], &["SIGSEGV", "during: destroy"]),
    ("crash at the end", &["-DAT_END=CRASH"], &["SIGSEGV", "during: its clean-up"]),
    ("exit in the entry", &["-DAT_ENTRY=SAY_AND_EXIT"], &["exit status: 0", "it said: no licence"]),
    ("exit in a step", &["-DAT_STEP=exit(3);"], &["exit status: 3", "during: step 1"]),
    ("no instance", &["-DAT_CREATE=return NULL;"], &["create returned NULL"]),
    ("NaN at once", &["-DAT_STEP=return NAN;"], &["step 1 of the trial returned NaN"]),
    (
        "infinity in the trial",
        &["-DSTEP_NUMBER=100", "-DAT_STEP=return INFINITY;"],
        &["step 100 of the trial returned inf"],
    ),
    ("default out of range", &["-DDEFAULT=3.0"], &["first = 3", "allowed is 0 to 2"]),
    ("default NaN", &["-DDEFAULT=NAN"], &["first = NaN"]),
    ("range without end", &["-DLEAST=-INFINITY"], &["range -inf to 2", "finite"]),
    ("range upside down", &["-DLEAST=2.5"], &["range 2.5 to 2"]),
    ("one name twice", &["-DSECOND=\"first\""], &["two parameters 'first'"]),
    ("no name for a parameter", &["-DSECOND=NULL"], &["parameter 2's name is NULL"]),
    ("an empty name", &["-DSECOND=\"\""], &["parameter 2's name '' is empty"]),
    ("a name that is no key", &["-DSECOND=\"a b\""], &["'a b' is no key"]),
    ("a name that is taken", &["-DSECOND=\"every_cycles\""], &["'every_cycles' has another meaning"]),
    ("a name that is no text", &["-DNAME=\"\\xff\""], &["its name is not UTF-8"]),
    ("no name", &["-DNAME=NULL"], &["its name is NULL"]),
    ("too many parameters", &["-DCOUNT=65"], &["65 parameters", "at most 64"]),
    ("controls nothing known", &["-DCONTROLS=3"], &["controls = 3", "AIRBENCH_FORCE"]),
    ("no step", &["-DSTEP=NULL"], &["step is NULL"]),
    ("other arithmetic", &["-ffast-math"], &["rounds numbers", "-ffast-math"]),
];

/// As every use does: through `load`, that is, by a child and with the file's name in the message.
fn refusal(library: &std::path::Path) -> String {
    match load_tried_by(&trier(), library, &RigParameters::baseline()) {
        Ok(_) => "it was loaded".to_owned(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn every_bad_library_is_refused_in_words_that_say_what_is_wrong() {
    for (case, options, words) in TABLE {
        let libraries = Libraries::new();
        let library = libraries.hostile(options);
        let refusal = refusal(&library);
        for word in [library.to_str().expect("text")].iter().chain(*words) {
            assert!(refusal.contains(word), "{case}: '{word}' is missing in: {refusal}");
        }
    }
}

#[test]
fn the_same_library_with_nothing_wrong_is_taken() {
    let libraries = Libraries::new();
    let description = probe(&libraries.hostile(&[])).unwrap();
    assert_eq!((description.name.as_str(), description.parameters.len()), ("hostile", 2));
    // A library may print in its trial; much of it blocks nobody.
    assert_eq!(describe(&trier(), &libraries.hostile(&["-DAT_CREATE=FLOOD"])).unwrap(), description);
}

#[test]
fn a_library_that_hangs_is_given_up_after_the_limit() {
    let libraries = Libraries::new();
    let library = libraries.hostile(&["-DAT_ENTRY=HANG"]);
    let trier = trier_with(Duration::from_millis(1500));
    let refusal = load_tried_by(&trier, &library, &RigParameters::baseline()).err().unwrap().to_string();
    assert!(refusal.contains("did not return within 1.5s, during: airbench_algorithm_entry"), "{refusal}");
}

#[test]
fn a_file_that_is_no_library_and_a_missing_one_are_refused() {
    let libraries = Libraries::new();
    let text = libraries.place("text.so");
    std::fs::write(&text, "not a library").unwrap();
    let reported = refusal(&text);
    assert!(reported.contains("does not load it") && reported.contains("text.so"), "{reported}");
    let reported = refusal(&libraries.place("missing.so"));
    assert!(reported.contains("missing.so") && reported.contains("No such file"), "{reported}");
}

#[test]
fn a_trier_that_knows_nothing_of_libraries_refuses_all() {
    let libraries = Libraries::new();
    let library = libraries.hostile(&[]);
    let other = plugin::TrialRunner { program: "/bin/true".into(), ..trier() };
    let reported = load_tried_by(&other, &library, &RigParameters::baseline()).err().unwrap().to_string();
    assert!(reported.contains("'/bin/true' cannot try libraries"), "{reported}");
}

#[test]
fn the_command_prints_what_a_library_offers_or_refuses_it_with_2() {
    let libraries = Libraries::new();
    let check = |library: &std::path::Path| {
        let output = Command::new(trier().program).arg("check-library").arg(library).output().expect("runs");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let (code, out, err) = check(&libraries.example());
    assert_eq!((code, err.as_str()), (Some(0), ""));
    for words in ["position-pi", "controls  position", "gain_per_s", "time in which the integral follows"] {
        assert!(out.contains(words), "{out}");
    }
    let (code, out, err) = check(&libraries.hostile(&["-DAT_CREATE=CRASH"]));
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.starts_with("controller: library '") && err.contains("SIGSEGV"), "{err}");
}
