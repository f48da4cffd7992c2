//! People at the rig: what an experiment's `[rig]` may say, and what hands and buttons do to a plant.

use plant::scene::{Action, Guidance, HandAction, HandForces, Outcome};
use plant::{Inputs, People, Plant, RigParameters, Scene, SceneError, State};

fn scene(text: &str) -> Scene {
    Scene::from_toml(text, "e.toml", &RigParameters::baseline()).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(text: &str) -> SceneError {
    Scene::from_toml(text, "e.toml", &RigParameters::baseline()).expect_err(text)
}

/// What a scene comes to.
struct PlayedScene {
    /// Plant at the start of each cycle, with the scripted forces over it.
    samples: Vec<(State, HandForces)>,
    reported: Vec<(u64, Outcome)>,
    plant: Plant,
}

/// Plays a scene for so many cycles with these valve commands.
fn play(scene: &Scene, cycles: u64, valve: impl Fn(u64) -> [f64; 2]) -> PlayedScene {
    let mut plant = Plant::new(&RigParameters::baseline(), &scene.setup()).expect("a checked setup");
    let mut people = People::new(scene);
    let (mut samples, mut reported) = (Vec::new(), Vec::new());
    for cycle in 0..cycles {
        let forces = people.begin_cycle(cycle, &mut plant, |outcome| reported.push((cycle, outcome)));
        samples.push((*plant.state(), forces));
        let mut inputs = Inputs { valve: valve(cycle), ..Inputs::default() };
        forces.put_into(&mut inputs);
        plant.step(&inputs);
    }
    PlayedScene { samples, reported, plant }
}

fn shut(_: u64) -> [f64; 2] {
    [0.0, 0.0]
}

fn eye_m(state: &State) -> f64 {
    0.5 - state.axes[1].extension_m
}

#[test]
fn an_event_at_a_position_waits_for_the_carriage_from_its_time_on() {
    let text = "[rig]\ncarriage_position_m = 0.1\n[[rig.event]]\nat_s = 0.05\nat_position_m = 0.2\ndo = \"emergency-stop\"\n\
                [[rig.event]]\nat_s = 0.1\ndo = \"weights\"\nadded_mass_kg = 5\n";
    let played = play(&scene(text), 1000, |_| [1.0, 0.0]);
    let Some((cycle, Outcome::Stopped)) = played.reported.last().copied() else {
        panic!("{:?}", played.reported)
    };
    assert_eq!(played.reported[0], (100, Outcome::Weights { added_mass_kg: 5.0 }), "nothing waits for it");
    let place_m = |cycle: u64| played.samples[cycle as usize].0.axes[0].extension_m;
    assert!(place_m(cycle - 1) < 0.2 && place_m(cycle) >= 0.2, "{cycle}");
    // Beyond the place already: it is passed on the way back, and here there is none.
    let late = text.replace("0.05", "0.5");
    assert_eq!(play(&scene(&late), 1000, |_| [1.0, 0.0]).reported.len(), 1);
}

// Reading the section [rig] of an experiment file.

#[test]
fn without_a_rig_section_all_is_default_and_other_tables_are_not_looked_at() {
    assert_eq!(scene(""), Scene::default());
    let read =
        scene("title = \"t\"\n[drive]\nanything = 1\n[rig]\ncarriage_position_m = 0.25\nlinked = true\n");
    assert_eq!(read, Scene { carriage_position_m: 0.25, linked: true, ..Scene::default() });
}

#[test]
fn defaults_of_hands_and_events_are_filled_in() {
    let read = scene(
        "[rig]\n[[rig.hand]]\non = \"carriage\"\nfrom_s = 0\nto_s = 1\nforce_n = 60\n\
         [[rig.hand]]\non = \"load-eye\"\nfrom_s = 1.0\nto_s = 1.5\nguide_to_m = 0.3\n\
         [[rig.event]]\nat_s = 2\ndo = \"weights\"\nadded_mass_kg = 5\n[[rig.event]]\nat_s = 1\ndo = \"link\"\n",
    );
    assert_eq!(read.hand[0].action, HandAction::Push { force_n: 60.0, ramp_s: 0.05 });
    let HandAction::Guide { guidance, .. } = read.hand[1].action else { panic!("{:?}", read.hand[1]) };
    let Guidance { travel_s, stiffness_n_per_m, damping_n_s_per_m, most_n } = guidance;
    // A hand that is on for half a second travels no longer.
    assert_eq!((travel_s, stiffness_n_per_m, damping_n_s_per_m, most_n), (0.5, 2000.0, 60.0, 150.0));
    assert_eq!(read.event[0].action, Action::Weights { added_mass_kg: 5.0 });
    assert_eq!(read.event[1].action, Action::Link { until_s: None });
}

#[test]
fn a_bad_scene_is_refused_with_file_line_key_value_and_range() {
    let whole: [(&str, &[&str]); 7] = [
        ("[rig]\ncarriage_position_m = 0.6", &["e.toml:2: rig.carriage_position_m = 0.6", "0 to 0.5 m"]),
        ("[rig]\nadded_mass_kg = nan", &["e.toml:2: rig.added_mass_kg = NaN", "0 to 20 kg"]),
        (
            "[rig]\nlinkd = true",
            &["e.toml:2: ", "unknown key rig.linkd", "carriage_position_m", "did you mean linked?"],
        ),
        ("[rig]\nlinked = 1", &["e.toml:2: rig.linked = 1", "true or false"]),
        ("[rig\n", &["e.toml:1: not TOML: "]),
        ("[[rig.hand]]\non = \"elbow\"", &["e.toml:2: rig.hand[1].on", "elbow", "carriage", "load-eye"]),
        (
            "[[rig.event]]\nat_s = 1\ndo = \"jump\"",
            &["e.toml:3: rig.event[1].do", "jump", "emergency-stop", "weights"],
        ),
    ];
    let of_a_hand: [(&str, &[&str]); 8] = [
        ("to_s = 1\nforce_n = 5", &["e.toml:4: rig.hand[1].to_s = 1", "after from_s = 1"]),
        ("to_s = 2\nforce_n = 2001", &["e.toml:5: rig.hand[1].force_n = 2001", "-2000 to 2000 N"]),
        ("to_s = 2\nforce_n = nan", &["e.toml:5: rig.hand[1].force_n = NaN", "-2000 to 2000 N"]),
        ("to_s = 2", &["e.toml:2: rig.hand", "force_n, guide_to_m"]),
        ("to_s = 2\nforce_n = 5\nguide_to_m = 0.1", &["e.toml:2: rig.hand", "one of"]),
        ("to_s = 2\nforce_n = 5\nmost_n = 9", &["e.toml:6: rig.hand[1].most_n = 9", "guide_to_m"]),
        ("to_s = 2\nguide_to_m = 0.1\nramp_s = 1", &["e.toml:6: rig.hand[1].ramp_s = 1", "force_n"]),
        ("to_s = 2\nguide_to_m = -0.1", &["e.toml:5: rig.hand[1].guide_to_m = -0.1", "0 to 0.5 m"]),
    ];
    let of_an_event: [(&str, &[&str]); 2] = [
        ("\"weights\"", &["e.toml:1: rig.event[1].added_mass_kg is missing", "0 to 20 kg"]),
        ("\"unlink\"\nuntil_s = 3", &["e.toml:4: rig.event[1].until_s = 3", "\"link\" alone"]),
    ];
    let hand = |text| format!("[[rig.hand]]\non = \"load-eye\"\nfrom_s = 1\n{text}");
    let event = |text| format!("[[rig.event]]\nat_s = 1\ndo = {text}");
    let whole = whole.map(|(text, words)| (text.to_owned(), words));
    let of_a_hand = of_a_hand.map(|(text, words)| (hand(text), words));
    let of_an_event = of_an_event.map(|(text, words)| (event(text), words));
    for (text, words) in whole.into_iter().chain(of_a_hand).chain(of_an_event) {
        let message = refused(&text).to_string();
        for word in words {
            assert!(message.contains(word), "'{word}' is missing for\n{text}\nin\n{message}");
        }
    }
}

#[test]
fn a_scene_is_serialised_with_the_keys_of_its_file() {
    let read = scene(
        "[[rig.hand]]\non = \"load-eye\"\nfrom_s = 0\nto_s = 1\nforce_n = 60\n\
         [[rig.event]]\nat_s = 2\ndo = \"emergency-stop\"\n[[rig.event]]\nat_s = 3\ndo = \"link\"\nuntil_s = 4\n",
    );
    let json = serde_json::to_value(&read).expect("plain values");
    let hand = r#"{"on":"load-eye","from_s":0.0,"to_s":1.0,"force_n":60.0,"ramp_s":0.05}"#;
    assert_eq!(json["hand"][0], serde_json::from_str::<serde_json::Value>(hand).expect("JSON"));
    assert_eq!(json["event"][0]["do"], "emergency-stop");
    assert_eq!((&json["event"][1]["do"], &json["event"][1]["until_s"]), (&"link".into(), &4.0.into()));
}

// Hands.

#[test]
fn a_push_ramps_in_and_out_and_acts_on_its_part_alone() {
    let scene =
        scene("[[rig.hand]]\non = \"carriage\"\nfrom_s = 0.1\nto_s = 0.3\nforce_n = 30\nramp_s = 0.05\n");
    let played = play(&scene, 400, shut);
    let force = |ms: usize| played.samples[ms].1;
    for (ms, expected_n) in
        [(99, 0.0), (100, 0.0), (125, 15.0), (150, 30.0), (249, 30.0), (275, 15.0), (300, 0.0)]
    {
        // Quotients of whole milliseconds: a rounding or two.
        assert!((force(ms).carriage_n - expected_n).abs() < 1e-12, "{ms} ms: {:?}", force(ms));
        assert_eq!(force(ms).load_eye_n, 0.0);
    }
}

#[test]
fn hands_that_act_at_a_time_add_up() {
    let hand = "[[rig.hand]]\non = \"load-eye\"\nfrom_s = 0\nto_s = 1\nramp_s = 0\nforce_n = ";
    let played = play(&scene(&format!("{hand}10\n{hand}-25\n")), 10, shut);
    assert_eq!(played.samples[5].1, HandForces { carriage_n: 0.0, load_eye_n: -15.0 });
}

const GUIDED: &str = "[rig]\ncarriage_position_m = 0.25\n[[rig.hand]]\non = \"carriage\"\nfrom_s = 0.1\n\
                      to_s = 6.0\nguide_to_m = 0.26\ntravel_s = 2.0\nstiffness_n_per_m = 20000\nmost_n = 150\n";

#[test]
fn a_guiding_hand_brings_a_part_to_its_target_and_never_pulls_harder_than_it_can() {
    let played = play(&scene(GUIDED), 6000, shut);
    let most_n = played.samples.iter().map(|(_, force)| force.carriage_n.abs()).fold(0.0, f64::max);
    assert!(most_n > 30.0 && most_n <= 150.0, "{most_n} N");
    let x_m = played.plant.state().axes[0].extension_m;
    // It stops where k (x_target - x) is friction (35 N) and the trapped air's spring: 4.5 kN/m over 1 cm, 45 N; over 20 kN/m.
    assert!((x_m - 0.26).abs() < 80.0 / 20_000.0, "{x_m} m");
    let beyond = played.samples.iter().map(|(state, _)| state.axes[0].extension_m).fold(0.0, f64::max);
    assert!(beyond < 0.2601, "it does not overshoot: {beyond} m");
}

#[test]
fn trapped_air_holds_a_part_against_the_hand_at_its_limit() {
    let scene = scene(
        "[rig]\ncarriage_position_m = 0.25\n[[rig.hand]]\non = \"carriage\"\nfrom_s = 0\nto_s = 4\nguide_to_m = 0.4\n",
    );
    let played = play(&scene, 4000, shut);
    let (state, force) = played.samples[3999];
    let most_n = Guidance::default().most_n;
    assert_eq!(force.carriage_n, most_n);
    let x_m = state.axes[0].extension_m;
    // Air springs of both chambers, p A^2 / V each: some 4.5 kN/m, against 150 N less friction of 26 N: 28 mm.
    assert!((0.265..0.29).contains(&x_m), "{x_m} m");
    let held = played.samples.iter().all(|(_, force)| force.carriage_n.abs() <= most_n);
    assert!(held);
}

#[test]
fn a_hand_starts_from_where_the_part_is_when_it_is_put_on() {
    let text = "[rig]\n[[rig.hand]]\non = \"load-eye\"\nfrom_s = 1.0\nto_s = 2.0\nguide_to_m = 0.2\n";
    // The load comes out until then.
    let played = play(&scene(text), 2000, |cycle| [0.0, if cycle < 600 { 0.3 } else { 0.0 }]);
    let (before, at) = (played.samples[999].1, played.samples[1000]);
    assert_eq!(before, HandForces::default());
    assert!(eye_m(&at.0) < 0.45, "{} m", eye_m(&at.0));
    // The target stands on the part: what is left is the damping of 60 N s/m at the speed with which it still comes out.
    assert_eq!(at.1.load_eye_n, 60.0 * at.0.axes[1].rod_velocity_m_per_s);
    assert!(played.samples[1600].1.load_eye_n < 0.0, "it pulls towards 0.2 m");
}

// Buttons and pin.

#[test]
fn events_act_in_their_cycle_in_the_order_of_their_times() {
    let text = "[rig]\nlinked = true\n[[rig.event]]\nat_s = 0.3\ndo = \"release\"\n\
                [[rig.event]]\nat_s = 0.1\ndo = \"emergency-stop\"\n[[rig.event]]\nat_s = 0.2\ndo = \"unlink\"\n\
                [[rig.event]]\nat_s = 0.2\ndo = \"weights\"\nadded_mass_kg = 3\n\
                [[rig.event]]\nat_s = 0.2\ndo = \"link\"\n[[rig.event]]\nat_s = 0\ndo = \"release\"\n";
    let played = play(&scene(text), 400, shut);
    let expected = [
        (100, Outcome::Stopped),
        (200, Outcome::Unlinked),
        (200, Outcome::Weights { added_mass_kg: 3.0 }),
        (200, Outcome::Linked),
        (300, Outcome::Released),
    ];
    assert_eq!(played.reported, expected);
    let stopped = |ms: usize| played.samples[ms].0.emergency_stop;
    assert_eq!([99, 100, 299, 300].map(stopped), [false, true, true, false]);
}

/// The load passes the carriage at 0.3 m, and the pin is wiggled until `until_s`.
fn passing(until_s: f64) -> PlayedScene {
    let text = format!(
        "[rig]\ncarriage_position_m = 0.3\n[[rig.event]]\nat_s = 0.2\ndo = \"link\"\nuntil_s = {until_s}\n"
    );
    play(&scene(&text), 4000, |_| [0.0, 0.16])
}

#[test]
fn a_link_is_tried_until_the_eye_passes_the_gap() {
    let played = passing(3.9);
    let [(cycle, Outcome::Linked)] = played.reported[..] else { panic!("{:?}", played.reported) };
    let (state, _) = &played.samples[cycle as usize];
    let distance_m = eye_m(state) - state.axes[0].extension_m;
    assert!(cycle > 300 && distance_m.abs() <= 1e-4, "linked in cycle {cycle} at {distance_m} m");
    assert!(played.plant.linked());
}

#[test]
fn a_link_that_never_succeeded_is_reported_once_when_its_time_is_up() {
    let played = passing(0.25);
    assert_eq!(played.reported, [(250, Outcome::LinkGivenUp)]);
    assert!(!played.plant.linked());
    let once = scene("[[rig.event]]\nat_s = 0.2\ndo = \"link\"\n");
    assert_eq!(play(&once, 300, shut).reported, [(200, Outcome::LinkRefused)]);
}

#[test]
fn parting_the_rods_ends_the_tries_at_linking_them() {
    let text =
        "[[rig.event]]\nat_s = 0.1\ndo = \"link\"\nuntil_s = 1\n[[rig.event]]\nat_s = 0.2\ndo = \"unlink\"\n";
    let expected = [(200, Outcome::LinkGivenUp), (200, Outcome::Unlinked)];
    assert_eq!(play(&scene(text), 1500, shut).reported, expected);
}

/// Valve of a load that yields to whoever pushes it: some 1.5 mm/s for each newton, over the valve's dead band of 3 %.
fn yielding(force_n: f64) -> f64 {
    if force_n.abs() < 5.0 { 0.0 } else { -(0.03 + 0.002 * force_n.abs()).min(1.0).copysign(force_n) }
}

#[test]
fn the_linkage_is_made_and_broken_by_hand_when_the_load_yields() {
    let scene = scene(
        "[rig]\ncarriage_position_m = 0.35\n[[rig.hand]]\non = \"load-eye\"\nfrom_s = 0.2\nto_s = 4\nguide_to_m = 0.33\n\
         travel_s = 3\n[[rig.event]]\nat_s = 0.5\ndo = \"link\"\nuntil_s = 4\n[[rig.event]]\nat_s = 5\ndo = \"unlink\"\n",
    );
    let rig = RigParameters::baseline();
    let mut plant = Plant::new(&rig, &scene.setup()).expect("a checked setup");
    let mut people = People::new(&scene);
    let mut reported = Vec::new();
    for cycle in 0..5500 {
        let forces = people.begin_cycle(cycle, &mut plant, |outcome| reported.push((cycle, outcome)));
        let mut inputs = Inputs::default();
        forces.put_into(&mut inputs);
        inputs.valve[1] = plant::quantise_valve(yielding(plant.truth(&inputs).axes[1].sensor_force_n));
        plant.step(&inputs);
    }
    let [(linked, Outcome::Linked), (5000, Outcome::Unlinked)] = reported[..] else { panic!("{reported:?}") };
    assert!((1000..4000).contains(&linked), "cycle {linked}");
}

// Determinism.

#[test]
fn a_scene_played_twice_is_equal_to_the_bit() {
    let text = format!(
        "{GUIDED}[[rig.hand]]\non = \"load-eye\"\nfrom_s = 0.2\nto_s = 3\nforce_n = -70\n\
         [[rig.event]]\nat_s = 1\ndo = \"emergency-stop\"\n[[rig.event]]\nat_s = 1.5\ndo = \"release\"\n\
         [[rig.event]]\nat_s = 0.5\ndo = \"link\"\nuntil_s = 3\n"
    );
    let valve = |cycle: u64| [0.0, if cycle > 2000 { 0.2 } else { 0.0 }];
    let [one, other] = [(); 2].map(|()| play(&scene(&text), 4000, valve));
    assert_eq!(one.reported, other.reported);
    assert_eq!(one.samples, other.samples);
}
