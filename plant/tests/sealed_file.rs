//! A file with effects alone: what it switches on comes on top of the rig's own, and nothing else may stand in it.

use plant::RigParameters;

const ONE: &str = "[effects.piston-leakage.drive]\nleakage_nl_per_min = 2.5\n";

fn rig() -> RigParameters {
    RigParameters::baseline()
}

fn refused(text: &str) -> String {
    rig().with_effects_of(text, "my-sealed.toml").expect_err("it is refused").to_string()
}

#[test]
fn an_empty_file_changes_nothing() {
    for text in ["", "\n", "# nothing\n", "[effects]\n"] {
        assert_eq!(rig().with_effects_of(text, "sealed.toml"), Ok(rig()));
    }
}

#[test]
fn a_file_says_what_a_rig_file_says() {
    let sealed = rig().with_effects_of(ONE, "sealed.toml").expect("good");
    let called = rig().with_effect("piston-leakage", "drive", &[("leakage_nl_per_min", 2.5)]);
    assert_eq!(sealed, called.expect("good"));
}

#[test]
fn effects_of_both_files_act_and_at_one_place_the_sealed_one_counts() {
    let unsealed = rig()
        .with_effect("piston-leakage", "drive", &[("leakage_nl_per_min", 9.0)])
        .and_then(|rig| rig.with_effect("inclination", "load", &[("force_n", 5.0)]))
        .expect("good");
    let both = unsealed.with_effects_of(ONE, "sealed.toml").expect("good");
    let found: Vec<(&str, f64)> =
        both.effects().iter().map(|effect| (effect.name, effect.numbers[0])).collect();
    assert_eq!(found, [("piston-leakage", 2.5), ("inclination", 5.0)]);
}

#[test]
fn the_numbers_of_the_rig_stay_those_of_its_file() {
    let text = "[effects.dead-volume.drive]\nvolume_cm3 = 50\n[effects.dead-volume.load]\nvolume_cm3 = 60\n\
                [effects.coupling-backlash.linkage]\ngap_mm = 2\n";
    let sealed = rig().with_effects_of(text, "sealed.toml").expect("good");
    assert_eq!((sealed.cylinder(), sealed.linkage()), (rig().cylinder(), rig().linkage()));
    assert_eq!(sealed.without_effects(), rig());
}

#[test]
fn anything_but_effects_is_refused_with_file_line_and_key() {
    for (text, unknown) in [
        (format!("{ONE}[supply]\npressure_bar = 7\n"), "3: unknown key supply"),
        ("seed = 3\n".to_owned(), "1: unknown key seed"),
    ] {
        let message = format!("my-sealed.toml:{unknown}; allowed is effects, tables, terms");
        assert_eq!(refused(&text), message);
    }
    assert!(refused("[effects\n").starts_with("my-sealed.toml:1: not TOML: "));
    assert!(refused("\n[effects.piston-leakage.drive]\nleakage_nl_per_min = 51\n").starts_with(
        "my-sealed.toml:3: effects.piston-leakage.drive.leakage_nl_per_min = 51 is out of range; allowed: 0 to 50 Nl/min"
    ));
}
