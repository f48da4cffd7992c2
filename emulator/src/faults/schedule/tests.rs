//! When faults begin and end.

use super::*;
use plant::scene::HandForces;
use plant::{RigParameters, Setup};

struct Bench {
    schedule: FaultSchedule,
    plant: Plant,
    sensors: Sensors,
    inputs: Inputs,
}

impl Bench {
    fn new(script: &str, by_hand: bool) -> Self {
        let rig = RigParameters::baseline();
        let script = FaultScript::from_toml(script, "test").unwrap();
        let setup = Setup { carriage_position_m: 0.25, linked: true, ..Setup::default() };
        Self {
            schedule: FaultSchedule::new(Some(&script), by_hand, None),
            plant: Plant::new(&rig, &setup).unwrap(),
            sensors: Sensors::new(&rig, 1),
            inputs: Inputs { valve: [0.5, 0.0], ..Inputs::default() },
        }
    }

    /// Cycles up to `end`, and what began and ended when.
    fn run(&mut self, from: u64, end: u64) -> Vec<(u64, u16, &'static str)> {
        let mut reported = Vec::new();
        for cycle in from..end {
            let Self { schedule, plant, sensors, inputs } = self;
            let broken = FaultTargets { plant, sensors, inputs };
            schedule.begin_cycle(cycle, broken, |mark| reported.push((cycle, mark.number, mark.what.name())));
            schedule.overlay.hands.put_into(&mut self.inputs);
            self.plant.step(&self.inputs);
        }
        reported
    }

    fn by_hand(
        &mut self,
        act: impl FnOnce(&mut FaultSchedule, FaultTargets<'_>, &mut dyn FnMut(Mark)),
    ) -> Vec<FaultChange> {
        let mut reported = Vec::new();
        let Self { schedule, plant, sensors, inputs } = self;
        act(schedule, FaultTargets { plant, sensors, inputs }, &mut |mark| reported.push(mark.what));
        reported
    }
}

#[test]
fn faults_begin_and_end_by_time_and_the_plant_is_whole_again() {
    let mut bench = Bench::new(
        "[[fault]]\nname = \"valve-dead\"\nat = \"drive\"\nfrom_s = 0.01\nto_s = 0.03\n\
         [[fault]]\nname = \"valve-offset\"\nat = \"load\"\noffset = 0.1\nfrom_s = 0.02\nfor_s = 0.02\n",
        false,
    );
    assert!(bench.schedule.possible);
    let reported = bench.run(0, 50);
    assert_eq!(reported, [(10, 1, "begins"), (20, 2, "begins"), (30, 1, "ends"), (40, 2, "ends")]);
    assert_eq!(bench.schedule.overlay, Overlay::default());
    assert!(!bench.schedule.busy && bench.schedule.active() == 0);
    let sent: Vec<_> = std::iter::from_fn(|| bench.schedule.pending_marks.pop_front()).collect();
    assert_eq!(sent, [(1, true), (2, true), (1, false), (2, false)]);
}

#[test]
fn a_condition_begins_a_fault_once_and_one_that_never_holds_is_reported() {
    let mut bench = Bench::new(
        "[[fault]]\nname = \"valve-dead\"\nat = \"drive\"\nwhen = \"drive.position_m\"\nabove = 0.26\nfor_s = 0.05\n\
         [[fault]]\nname = \"valve-dead\"\nat = \"load\"\nwhen = \"drive.position_m\"\nbelow = 0.1\nto_s = 0.2\n",
        false,
    );
    let reported = bench.run(0, 1000);
    let [(began, 1, "begins"), (ended, 1, "ends"), (200, 2, "never-began")] = reported[..] else {
        panic!("{reported:?}")
    };
    assert_eq!(ended, began + 50);
    assert!(bench.plant.state().axes[0].extension_m > 0.26);
}

#[test]
fn an_end_stop_is_hit_and_rods_part_once() {
    let mut bench = Bench::new(
        "[[fault]]\nname = \"mechanical-unlink\"\nfrom_s = 0.01\n\
         [[fault]]\nname = \"end-stop-hit\"\nat = \"load\"\nfrom_s = 0.02\n",
        false,
    );
    // Against the air that a shut valve traps, 3000 N would not do.
    bench.inputs.valve[1] = 1.0;
    let reported = bench.run(0, 2000);
    let [(10, 1, "begins"), (20, 2, "begins"), (hit, 2, "ends")] = reported[..] else {
        panic!("{reported:?}")
    };
    assert!(!bench.plant.linked());
    assert!(hit < 1000, "{hit}");
    assert_eq!(bench.schedule.overlay.hands, HandForces::default(), "let go");
}

#[test]
fn people_break_and_mend_and_are_refused_when_they_cannot() {
    let mut bench = Bench::new("", true);
    let stuck = Fault::new("valve-stuck", Some("drive"), &[]).unwrap();
    let lost = Fault::new("bus-loss", None, &[]).unwrap();
    let changes = bench.by_hand(|schedule, broken, on_mark| schedule.break_by_hand(lost, broken, on_mark));
    assert_eq!(changes, [FaultChange::Refused]);
    let changes = bench.by_hand(|schedule, broken, on_mark| schedule.break_by_hand(stuck, broken, on_mark));
    assert_eq!(changes, [FaultChange::Begins]);
    assert_eq!(bench.schedule.active(), 1);
    assert_eq!(bench.by_hand(|schedule, broken, on_mark| schedule.mend(Some(&lost), broken, on_mark)), []);
    let changes = bench.by_hand(|schedule, broken, on_mark| schedule.mend(Some(&stuck), broken, on_mark));
    assert_eq!(changes, [FaultChange::Ends]);
    for _ in 0..MOST_BY_HAND {
        bench.by_hand(|schedule, broken, on_mark| schedule.break_by_hand(stuck, broken, on_mark));
    }
    let changes = bench.by_hand(|schedule, broken, on_mark| schedule.break_by_hand(stuck, broken, on_mark));
    assert_eq!(changes, [FaultChange::Refused]);
    assert_eq!(
        bench.by_hand(|schedule, broken, on_mark| schedule.mend(None, broken, on_mark)).len(),
        MOST_BY_HAND
    );
    assert_eq!(bench.schedule.overlay, Overlay::default());
}
