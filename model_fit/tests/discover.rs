//! A term that no suspect of the file describes, found by the search of terms; records by another integrator.
//!
//! ```text
//!   1.2 v' = force - 50 x - 1.3 v - hidden(x, v, low)        x' = v        low' = (x - low)/0.8 s
//! ```

use crate::closing::{self, close_with, file, number, random};
use crate::model_files::OSCILLATOR;
use model_fit::{ClosedModel, DiscoveredTerm, Search, Verdict, read};

/// The plant of the tests of model files, with one suspect that does not describe what is hidden here.
fn oscillator() -> String {
    let (plant, _) = OSCILLATOR.split_once("[[suspects]]").expect("it has some");
    plant.to_owned()
        + "[[suspects]]\nname = \"offset\"\nplace = \"position\"\nadd = \"o\"\n"
        + "parameters.o = { unit = \"mm\", value = 1, range = [-100, 100] }\n"
}

/// 16 s at 50 Hz by 40 steps of leapfrog between two samples, noise of about 0.4 mm, a force that jumps.
fn record(mut seed: u64, hidden: fn(f64, f64, f64) -> f64) -> String {
    let mut random = || random(&mut seed);
    let mut text = "t_s,force_N,x_mm\n".to_owned();
    let (mut x, mut v, mut low, mut force) = (0.0, 0.0, 0.0, 0.0);
    for row in 0..800 {
        if row % 35 == 0 {
            force = 24.0 * random();
        }
        text += &format!("{},{force},{}\n", f64::from(row) * 0.02, x * 1e3 + random() + random());
        for _ in 0..40 {
            let rate = |x: f64, v: f64| (force - 50.0 * x - 1.3 * v - hidden(x, v, low)) / 1.2;
            v += 2.5e-4 * rate(x, v);
            x += 5e-4 * v;
            v += 2.5e-4 * rate(x, v);
            low += 5e-4 * (x - low) / 0.8;
        }
    }
    text
}

fn closed(search: Search, hidden: fn(f64, f64, f64) -> f64) -> ClosedModel {
    let folder = tempfile::tempdir().unwrap();
    let records = [1, 3].map(|seed| record(seed, hidden));
    closing::closed(folder.path(), ("oscillator.toml", &oscillator()), records, search)
}

fn is_in_the_equation_of_v(term: &DiscoveredTerm, variables: &str) {
    let found = (term.place.as_str(), term.variables.join(","));
    assert_eq!(found, ("equation of v", variables.to_owned()), "{term:?}");
}

/// The residual without it is correlated over the whole record; straight lines alone call it a constant.
#[test]
fn a_strong_spring_on_one_side_is_placed_with_its_variable() {
    let report = closed(Search::Never, |x, _, _| 60.0 * x.max(0.0)).report;
    let located = report.located.expect("most of what is left");
    assert_eq!((located.place.as_str(), located.variables.join(",")), ("equation of v", "x".to_owned()));
    assert!(located.share > 0.9, "{located:?}");
}

#[test]
fn a_product_that_no_suspect_describes_is_found_with_its_variables_and_written() {
    let folder = tempfile::tempdir().unwrap();
    // A damper that grips away from the middle; nobody asks for a search.
    let closed = closed(Search::MoreThanNoise, |x, v, _| 60.0 * x * x * v);
    let report = &closed.report;
    assert_eq!((report.verdict, report.confirmed), (Verdict::OutsideCatalogue, Some(true)), "{report:#?}");
    let term = &report.discovered[0];
    is_in_the_equation_of_v(term, "x,v");
    assert!(term.stability >= 0.6 && closed.page.contains("What a search found"), "{term:?}");
    assert!(closed.page.contains("± 2 standard errors of its numbers"), "what it looks like");
    // The formula says it, and the residual is noise.
    assert!(report.adequate && report.located.is_some(), "{:?}", report.located);
    assert!(!closed.page.contains("Where it comes from"));
    let extended = file(folder.path(), "extended.toml", &closed.extended.unwrap());
    let extended = read(&extended).unwrap_or_else(|error| panic!("{error}"));
    let found = extended.suspects.iter().position(|one| one.is_term && one.name == term.name).unwrap();
    let k = extended.parameters.iter().find(|one| one.suspect == Some(found)).unwrap();
    assert!(k.values_si[0] < 0.0, "it brakes: {k:?}");
}

#[test]
fn a_term_with_memory_is_found_as_such() {
    // The spring is the harder, the further it was out on one side of late.
    let report = closed(Search::NothingNamed, |x, _, low| 60.0 * low * x).report;
    assert_eq!((report.verdict, report.confirmed), (Verdict::OutsideCatalogue, Some(true)), "{report:#?}");
    let term = &report.discovered[0];
    is_in_the_equation_of_v(term, "x");
    let [lag, k] = ["lag_found", "k_found"].map(|name| number(&report, name));
    let error = lag.standard_error.unwrap();
    assert!((lag.value - 0.8).abs() < 4.0 * error + 0.01, "{lag:?}");
    assert!(k.standard_error.is_some_and(|error| error < 0.1 * k.value.abs()));
}

#[test]
fn nothing_is_found_where_nothing_is_missing() {
    let report = closed(Search::NothingNamed, |_, _, _| 0.0).report;
    assert_eq!((report.verdict, report.discovered.len()), (Verdict::NothingMissing, 0), "{report:#?}");
    assert!(report.notes.iter().any(|note| note.contains("0 taken")), "{:?}", report.notes);
}

#[test]
fn nothing_is_searched_where_it_is_switched_off_or_noise_is_left() {
    let missed = closed(Search::Never, |x, v, _| 60.0 * x * x * v);
    assert!(missed.page.contains("Where it comes from"), "{:?}", missed.report.located);
    let report = missed.report;
    assert!(report.discovered.is_empty() && report.notes.is_empty(), "{report:#?}");
    assert_eq!((report.verdict, report.adequate), (Verdict::OutsideCatalogue, false), "{report:#?}");
    let report = closed(Search::MoreThanNoise, |_, _, _| 0.0).report;
    assert_eq!(report.verdict, Verdict::NothingMissing, "{report:#?}");
    assert!(report.discovered.is_empty() && report.notes.is_empty(), "{report:#?}");
}

/// A search simulates hundreds of times; 107 000 steps each are minutes.
#[test]
fn a_search_that_takes_minutes_is_not_made_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let model = "[fit]\nstarts = 0\n[solver]\nmethod = \"fixed\"\nstep_s = 1.83e-4\n[inputs.u]\n[parameters]\n\
                 k = { unit = \"1/s\", value = 0.3 }\n[states.x]\nstart = 2\nderivative = \"k*(u - x)\"\n\
                 [outputs.y]\nvalue = \"x\"\n";
    // x' = -x^3/2 from 2.
    let row = |row: u32| format!("{},0,{}\n", 0.5 * f64::from(row), (0.25 + 0.5 * f64::from(row)).powf(-0.5));
    let model = file(folder.path(), "decay.toml", model);
    let rows: String = (0..40).map(row).collect();
    let train = file(folder.path(), "train.csv", &format!("t_s,u,y\n{rows}"));
    let report = close_with(&model, (&[train], &[]), Search::MoreThanNoise, &mut |_| {}).unwrap().report;
    assert_eq!((report.verdict, report.adequate), (Verdict::OutsideCatalogue, false), "{report:#?}");
    assert!(report.discovered.is_empty());
    let said = "nothing was searched: a simulation has 10";
    assert!(report.notes.iter().any(|note| note.starts_with(said)), "{:?}", report.notes);
}
