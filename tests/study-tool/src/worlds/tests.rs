//! Both worlds of a score whose truth is known.

use super::*;
use crate::score::tests::scored;

#[test]
fn a_program_that_tells_the_truth_is_right_in_both_worlds() {
    let mut score = scored("truth");
    for (at, case) in score.cases.iter_mut().enumerate() {
        case.background = at % 2 == 1;
        case.over_limit = vec![Some(20.0); case.over_limit.len()];
    }
    let table = Worlds::of(&score, None, &[], 100);
    assert_eq!(table.done, [score.cases.len(), 100]);
    let rate = |name: &str| table.rows.iter().find(|row| row.name == name).unwrap().rates;
    let [exact, background] = rate("one effect: name, place, nothing beside");
    assert!(
        exact.of > 10 && background.of > 10 && exact.count == exact.of && background.count == background.of
    );
    assert_eq!(rate("nothing hidden: a name, or no report").map(|rate| rate.count), [0, 0]);
    assert_eq!(rate("left out: no wrong name")[0].of, 0);
    assert_eq!(table.null_chi2_in_words(), "");
    let text = table.markdown();
    assert!(text.contains("of 100 draws") && text.lines().count() > 20, "{text}");
    for (count, said) in [(0, false), (3, true)] {
        score.without_classes = count;
        assert_eq!(Worlds::of(&score, None, &[], 100).markdown().contains("3 draws have no classes"), said);
    }
    assert!(text.contains("| none of 200 | not resolved (estimate reaches) |"), "{text}");
    assert!(text.contains("| reported |  |") && text.contains("| 94 % | no draw |"), "{text}");
}

#[test]
fn a_wrong_name_counts_in_its_own_world_alone() {
    let mut score = scored("truth");
    for case in &mut score.cases {
        case.over_limit = vec![Some(5.0); case.over_limit.len()];
        case.background = case.kind == Kind::Single;
    }
    let wrong = score.cases.iter_mut().find(|case| case.kind == Kind::Single && !case.foreign_form).unwrap();
    wrong.judgement.hidden[0].right = false;
    wrong.judgement.alone = false;
    let singles = score.cases.iter().filter(|case| case.kind == Kind::Single).count();
    let truth = Score { label: "other".to_owned(), ..scored("truth") };
    let table = Worlds::of(&score, None, &[truth], 100);
    let [exact, background] = table.rows[0].rates;
    assert_eq!((exact.of, background.of - background.count), (0, 1));
    // The other one tells the truth.
    assert_eq!(table.others[0].counts[1], [singles - 1, 0, 1, 0]);
    assert!(
        table.markdown().contains("*other* alone 1 (exact McNemar test: p = 1.00)"),
        "{}",
        table.markdown()
    );
}

#[test]
fn times_are_missed_by_one_draw_that_is_longer_and_by_a_median_that_is_resolved() {
    let mut score = scored("truth");
    for (at, case) in score.cases.iter_mut().enumerate() {
        case.background = at % 2 == 1;
        case.wall_s = if case.background { 20.0 } else { 10.0 };
    }
    let (all, slow) = (score.cases.len(), score.cases.iter().position(|case| case.background).unwrap());
    score.cases[slow].wall_s = 91.0;
    let text = |draws: usize| Worlds::of(&score, None, &[], draws).markdown();
    let row = |draws: usize, name: &str| {
        text(draws).lines().find(|line| line.starts_with(name)).unwrap_or_default().to_owned()
    };
    let median = "| median of the wall time | 10 s | 12 s | reached | 20 s | 15 s | missed with rehearsals |";
    assert_eq!(row(all + 1, "| median of the wall time"), median);
    let of_some = "| longest of the wall time | 10 s | 60 s | not resolved (estimate reaches) | 91 s | 90 s | missed with rehearsals |";
    assert_eq!(row(all + 1, "| longest of the wall time"), of_some);
    assert_eq!(
        row(all, "| longest of the wall time"),
        of_some.replace("not resolved (estimate reaches)", "reached")
    );
}

#[test]
fn the_exact_test_is_that_of_the_books() {
    // McNemar 1947 by the binomial distribution: 1 and 9 of 10 discordant pairs, 2 * 11 / 1024.
    assert!((mcnemar(1, 9) - 22.0 / 1024.0).abs() < 1e-12 && mcnemar(3, 3) == 1.0 && mcnemar(0, 0) == 1.0);
}

#[test]
fn the_size_of_the_background_is_that_of_nulls_without_wrong_parameters() {
    let mut score = scored("truth");
    for (case, chi2) in score.cases.iter_mut().zip([1.0, 2.0, 3.0, 4.0]) {
        (case.kind, case.background, case.wrong_parameters) = (Kind::Null, chi2 > 1.5, chi2 > 3.5);
        case.rig_file_chi2 = Some(chi2);
    }
    let words = Worlds::of(&score, None, &[], 100).null_chi2_in_words();
    assert!(words.contains("exact world 1.00 in the median (1.00 to 1.00, 1 draws)"), "{words}");
    assert!(words.contains("(2.00 to 3.00, 2 draws)"), "{words}");
}
