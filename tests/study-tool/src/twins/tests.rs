//! What an oracle tells apart, which starts are refused, one certificate from start to end, and what counts as told apart.

use super::certificate::{in_experiment, probability, with_noise};
use super::search::{Refusal, twin_of};
use super::tables::{Case, FirstAnswer, Table, first};
use super::*;
use crate::SCHEMA_VERSION;
use crate::draws::twins::{Start, start};
use crate::judge::tests::{TAKEN, draw, reported};
use crate::program::{Execution, ProgramEnd};
use crate::resolve::Outcome;
use discrepancy::next::menu::{Entry, MENU};

fn entry() -> &'static Entry {
    MENU.iter().find(|entry| entry.name == "shut-and-hold").unwrap()
}

fn with(effect: &str, key: &str, number: f64) -> RigParameters {
    RigParameters::baseline().with_effect(effect, "drive", &[(key, number)]).unwrap()
}

#[test]
fn a_rig_is_distinguished_from_itself_by_chance_and_from_a_very_different_one_always() {
    let one = with("piston-leakage", "leakage_nl_per_min", 5.0);
    let same = in_experiment(entry(), [&one, &one], Axis::Drive).unwrap();
    assert_eq!((same, probability(same)), (0.0, 0.5));
    let other = with("valve-offset", "offset_percent", 2.0);
    let far = in_experiment(entry(), [&one, &other], Axis::Drive).unwrap();
    assert!(probability(far) > 0.999_999, "{far}");
    // The load's record tells nothing but rounding.
    let load = in_experiment(entry(), [&one, &other], Axis::Load).unwrap();
    assert!(load < 1e-3, "{load}");
}

#[test]
fn noise_brings_two_rigs_nearer_by_its_size() {
    let rigs = [("piston-leakage", "leakage_nl_per_min", 0.3), ("piston-leakage", "leakage_nl_per_min", 0.4)];
    let distance = |noise: f64| {
        let [one, other] =
            rigs.map(|(effect, key, number)| with_noise(&with(effect, key, number), noise).unwrap());
        in_experiment(entry(), [&one, &other], Axis::Drive).unwrap()
    };
    let ratio = distance(1.0) / distance(8.0);
    // Rounding stays, and the noise in the loop moves the commands a little.
    assert!((6.5..8.5).contains(&ratio), "{ratio}");
}

#[test]
fn an_oracle_is_right_as_often_as_the_normal_distribution_says() {
    for (distance, share) in [(0.0, 0.5), (1.049, 0.7), (2.563, 0.9)] {
        assert!((probability(distance) - share).abs() < 1e-3, "{distance}");
    }
}

fn start_of(effect: &str) -> (usize, Start) {
    let mut all = (0..).filter_map(|number| Some((number, start(31, number)?)));
    all.find(|(_, start)| start.recipe.hidden[0].name == effect).unwrap()
}

#[test]
fn an_effect_that_no_other_resembles_is_refused() {
    let (number, start) = start_of("force-sensor-offset");
    assert!(matches!(twin_of(&start, number), Err(Refusal::NoRival | Refusal::NotAlike | Refusal::NotSeen)));
}

#[test]
fn a_twin_is_alike_in_its_record_and_apart_in_an_experiment() {
    let (number, start) = start_of("valve-dead-zone");
    let twin = twin_of(&start, number).unwrap();
    assert!(probability(twin.train_distance) <= 0.7 && twin.seen_distance >= 7.0, "{twin:?}");
    assert!(twin.best().is_some_and(|(_, distance)| probability(distance) >= 0.9), "{twin:?}");
    assert_ne!(twin.hidden.effect, twin.rival.effect);
    let names = [&twin.hidden.effect, &twin.rival.effect];
    assert!(names.contains(&&"valve-dead-zone".to_owned()) && twin.menu_distances.len() <= 8);

    let folder = tempfile::tempdir().unwrap();
    let refused = BTreeMap::from([("why".to_owned(), 3)]);
    let twins =
        Twins { schema_version: SCHEMA_VERSION, seed: 31, starts: 5, refused, twins: vec![twin.clone()] };
    twins.save(folder.path()).unwrap();
    assert_eq!(Twins::open(folder.path()).unwrap(), twins);
    let study = twins.study(folder.path());
    let [exact, beside] = &study.draws[..] else { panic!("one in each world") };
    assert_eq!(Recipe { background: None, ..beside.recipe.clone() }, exact.recipe);
    assert!(exact.recipe.background.is_none() && beside.recipe.background.is_some());

    let [records, truth] = ["records", "truth"].map(|name| folder.path().join(name));
    twins.make(0, &exact.recipe, &RigParameters::baseline(), [&records, &truth]).unwrap();
    let text = std::fs::read_to_string(records.join("measurement.csv")).unwrap();
    let rows = text.lines().filter(|line| line.starts_with(|first: char| first.is_ascii_digit())).count();
    assert_eq!(rows, twin.part.rows);

    let table = Table::of(&twins, folder.path(), "none").unwrap();
    assert!(
        table.cases.is_empty() && table.markdown().contains("told apart by the proposed experiment | none")
    );
}

/// A twin of which this was said at first, and then.
fn case(first: FirstAnswer, outcome: Option<Outcome>) -> Case {
    Case {
        number: 0,
        background: false,
        hidden: "valve-offset drive".to_owned(),
        rival: "valve-dead-zone drive".to_owned(),
        first,
        rival_named: first == FirstAnswer::Ambiguous,
        named: [Vec::new(), Vec::new()],
        experiment: None,
        certified: None,
        outcome,
        rival_left: false,
        problem: None,
        wall_s: 1.0,
    }
}

#[test]
fn the_target_is_of_all_twins_and_not_of_those_that_are_left_ambiguous() {
    let resolved = case(FirstAnswer::Ambiguous, Some(Outcome::Resolved));
    let others =
        [case(FirstAnswer::Right, None), case(FirstAnswer::NoName, None), case(FirstAnswer::NoName, None)];
    let cases = std::iter::once(resolved).chain(others).collect();
    let label = "ours".to_owned();
    let table = Table { schema_version: SCHEMA_VERSION, label, program: None, seed: 31, cases };
    let text = table.markdown();
    // Wilson's interval of 2 of 4 is 15 to 85 %.
    let all = "| of all: the right one named at the end | 2/4 (15 to 85 %) | 80 %: not resolved (estimate misses) \
               | none | 70 %: no draw |";
    assert!(text.contains(all), "{text}");
    assert!(
        text.contains("told apart by the proposed experiment | 1/1 (21 to 100 %) |  | none |  |"),
        "{text}"
    );
}

#[test]
fn what_is_said_at_first_is_one_of_seven() {
    let twin = draw(Kind::Single, &["inclination"]);
    let said = |verdict: &str, names: &[&str]| first(&twin, &TAKEN, &reported(verdict, names));
    assert_eq!(said("ambiguous", &["valve-offset@drive[inclination@drive]"]), FirstAnswer::Ambiguous);
    assert_eq!(said("named", &["inclination@drive"]), FirstAnswer::Right);
    assert_eq!(said("named", &["inclination@drive", "valve-offset@drive"]), FirstAnswer::NotAlone);
    assert_eq!(said("named", &["valve-offset@drive"]), FirstAnswer::Wrong);
    assert_eq!(said("ambiguous", &["valve-offset@drive[inclination@load]"]), FirstAnswer::TruthNotAmong);
    assert_eq!(said("nothing-missing", &[]), FirstAnswer::NoName);
    assert_eq!(said("bad-data", &[]), FirstAnswer::Error);
    let late = Execution { ended: ProgramEnd::TimedOut, ..TAKEN };
    assert_eq!(first(&twin, &late, &reported("named", &["inclination@drive"])), FirstAnswer::Error);
}
