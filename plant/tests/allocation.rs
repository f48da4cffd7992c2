//! A step, a sample and a look at the truth allocate nothing: counted by the allocator itself.

#![allow(unsafe_code)] // an allocator that counts can only be an unsafe impl

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use plant::effects::declared::Target;
use plant::effects::tabulated::{Balance, Tabulated, Variable};
use plant::faults::{AxisFaults, Faults, SensorFault, SupplyFault, ValveFault};
use plant::{Axis, Batch, Inputs, People, Plant, RigParameters, Scene, Sensors, Setup};

thread_local! {
    /// Allocations of this thread; the test harness has threads of its own.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes to the system's allocator unchanged; counting touches a thread-local without a destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Something of every kind is broken.
fn broken() -> (Faults, [[SensorFault; 4]; 2]) {
    let axis = AxisFaults {
        valve: ValveFault { offset: 0.1, limit: 0.9, lag_s: 0.01, ..ValveFault::default() },
        friction_factor: 1.5,
        added_mass_kg: 2.0,
        leakage_m3_per_s: [1e-4; 2],
        burst_kv_m3_per_h: [0.01, 0.0],
    };
    let supply = Some(SupplyFault { pressure_pa: 6e5, time_constant_s: 0.1 });
    let sensor = SensorFault { noise: 0.1, dropout: 0.01, spike: 1.0, gain: 1.1, ..SensorFault::default() };
    (Faults { axes: [axis; 2], supply }, [[sensor; 4]; 2])
}

/// Periods of a rig with everything in them that can happen; looks at truth, terms and sensors in each.
fn periods_allocate_nothing(rig: &RigParameters) {
    let mut plant = Plant::new(rig, &Setup { linked: true, ..Setup::default() }).expect("good");
    let mut sensors = Sensors::new(rig, 1);
    plant.expect_faults();
    let (faults, of_sensors) = broken();
    let counted = ALLOCATIONS.with(Cell::get);
    assert!(counted > 0, "the counter counts");
    let mut sum = 0.0;
    for k in 0..3000 {
        match k {
            1000 => plant.trip_emergency_stop(),
            1500 => plant.release_emergency_stop(),
            2000 => plant.unlink(),
            200 | 2200 => {
                plant.set_faults(&faults);
                sensors.set_faults(&of_sensors);
            }
            700 | 2700 => {
                plant.set_faults(&Faults::default());
                sensors.set_faults(&Default::default());
            }
            _ => (),
        }
        let u = if k / 300 % 2 == 0 { 1.0 } else { -1.0 };
        let inputs = Inputs { valve: [u, -0.5 * u], ..Inputs::default() };
        sum += sensors.sample(&plant, &inputs)[0].position.value + plant.truth(&inputs).values()[0];
        sum += plant.terms(&inputs).values().iter().map(|value| value.abs()).sum::<f64>();
        plant.step(&inputs);
    }
    assert_eq!(ALLOCATIONS.with(Cell::get), counted);
    assert!(sum > 0.0);
}

#[test]
fn a_period_allocates_nothing() {
    periods_allocate_nothing(&RigParameters::baseline());
}

#[test]
fn a_period_with_all_effects_allocates_nothing() {
    let mut rig = RigParameters::baseline();
    for sheet in plant::effects::SHEETS {
        for place in sheet.place.names() {
            let numbers: Vec<_> = sheet.keys.iter().map(|key| (key.name, key.drawn[1])).collect();
            rig = rig.with_effect(sheet.name, &place, &numbers).expect("drawn numbers are allowed");
        }
    }
    let tables = Balance::ALL.map(|balance| Tabulated {
        axis: Axis::Load,
        balance,
        variable: Variable::Velocity,
        at: vec![-1.0, 0.0, 1.0],
        value: vec![1.0, 0.0, -1.0],
    });
    let mut rig = rig.with_tabulated(&tables).expect("allowed");
    for term in declared().terms() {
        rig = rig.with_term(term);
    }
    periods_allocate_nothing(&rig);
}

/// A rig with a term of every target, over all variables.
fn declared() -> RigParameters {
    let over = "(x/1[m] + sin(v/1[m/s]) + u + tanh(s) + max(p_a, p_b)/1[MPa] + t/1[s] + F/1[kN] + bump(u))";
    let terms = Axis::ALL.into_iter().flat_map(|axis| Target::ALL.map(|target| (axis, target)));
    let terms: String = terms
        .map(|(axis, target)| {
            let place = format!("{}.{}", axis.name(), target.name());
            format!(
                "[[terms]]\nname = \"{}\"\nplace = \"{place}\"\nadd = \"1e-5[{}]*{over}\"\n",
                target.name(),
                target.unit()
            )
        })
        .collect();
    let table = "[tables.bump]\nx = [-1, 0, 1]\ny = [0, 2, 1]\n";
    let text = format!("{}{terms}{table}", RigParameters::BASELINE_TOML);
    RigParameters::from_toml(&text, "rig.toml").unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_period_with_declared_terms_allocates_nothing() {
    let rig = declared();
    assert_eq!(rig.terms().len(), 14);
    periods_allocate_nothing(&rig);
}

#[test]
fn a_batch_allocates_nothing_in_a_step() {
    let rig = RigParameters::baseline();
    let mut plants = vec![Plant::new(&rig, &Setup { linked: true, ..Setup::default() }).expect("good"); 11];
    plants[4].expect_faults();
    let mut batch = Batch::new(plants);
    let (faults, _) = broken();
    let counted = ALLOCATIONS.with(Cell::get);
    let mut inputs = [Inputs::default(); 11];
    for k in 0..2000 {
        match k {
            300 => batch.plant_mut(3).trip_emergency_stop(),
            700 => batch.plant_mut(4).set_faults(&faults),
            900 => batch.plant_mut(5).unlink(),
            _ => (),
        }
        for (i, inputs) in inputs.iter_mut().enumerate() {
            inputs.valve = if (k + 50 * i) / 300 % 2 == 0 { [1.0, -0.5] } else { [-1.0, 0.5] };
        }
        batch.step(&inputs);
    }
    assert_eq!(ALLOCATIONS.with(Cell::get), counted);
    assert!(batch.plants()[3].check_valves_shut());
}

#[test]
fn people_allocate_nothing_in_a_cycle() {
    let text = "[[rig.hand]]\non = \"carriage\"\nfrom_s = 0\nto_s = 2\nguide_to_m = 0.2\n\
                [[rig.event]]\nat_s = 0.5\ndo = \"emergency-stop\"\n[[rig.event]]\nat_s = 1\ndo = \"release\"\n\
                [[rig.event]]\nat_s = 1\ndo = \"link\"\nuntil_s = 1.5\n\
                [[rig.event]]\nat_s = 1.2\ndo = \"weights\"\nadded_mass_kg = 5\n";
    let rig = RigParameters::baseline();
    let scene = Scene::from_toml(text, "e.toml", &rig).expect("good");
    let mut plant = Plant::new(&rig, &scene.setup()).expect("good");
    let mut people = People::new(&scene);
    let counted = ALLOCATIONS.with(Cell::get);
    let mut reported = 0;
    for cycle in 0..2000 {
        let mut inputs = Inputs::default();
        people.begin_cycle(cycle, &mut plant, |_| reported += 1).put_into(&mut inputs);
        reported += usize::from(people.rig_call(cycle).is_some());
        plant.step(&inputs);
    }
    assert_eq!(ALLOCATIONS.with(Cell::get), counted);
    assert!(reported > 5, "{reported} things happened");
}
