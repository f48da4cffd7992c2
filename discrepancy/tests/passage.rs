//! A neighbour of a rig is simulated only where it differs, and shows the same as if it were simulated everywhere.

use crate::record::gridded;
use discrepancy::windows::Windows;
use plant::effects::tabulated::{Balance, Tabulated, Variable};
use plant::{Axis, RigParameters};
use std::cell::Cell;

const AT: [f64; 5] = [0.05, 0.15, 0.25, 0.35, 0.45];

/// A force over the extension, one point of it moved by `more_n`.
fn rig(point: usize, more_n: f64) -> RigParameters {
    let mut value = vec![3.0, -8.0, 12.0, 0.0, 5.0];
    value[point] += more_n;
    let table = Tabulated {
        axis: Axis::Drive,
        balance: Balance::Force,
        variable: Variable::Extension,
        at: AT.to_vec(),
        value,
    };
    RigParameters::baseline().with_tabulated(&[table]).expect("a table of the rig")
}

#[test]
fn a_point_of_a_table_changes_nothing_in_windows_that_do_not_reach_it() {
    let baseline = RigParameters::baseline();
    let gridded = gridded(&baseline, &baseline);
    let windows = Windows::new(&gridded, &baseline);
    let passage = windows.reference_run(&rig(0, 0.0));
    assert_eq!(passage.simulated, windows.simulate_coarsely(&rig(0, 0.0)));

    let mut skipped = 0;
    for point in 0..AT.len() {
        let before = if point == 0 { f64::NEG_INFINITY } else { AT[point - 1] };
        let after = AT.get(point + 1).copied().unwrap_or(f64::INFINITY);
        let differing = Cell::new(0);
        let sparse = windows.simulate_where(&rig(point, 1.0), &passage, |reach| {
            let meets = reach.overlaps(Axis::Drive, Variable::Extension, [before, after]);
            differing.set(differing.get() + usize::from(meets));
            meets
        });
        let whole = windows.simulate_coarsely(&rig(point, 1.0));
        skipped += windows.count() - differing.get();
        // A lag that began elsewhere is all that may differ: nothing beside what the point itself changes.
        let change = |one: &[f64], other: &[f64]| {
            one.iter().zip(other).map(|(one, other)| (one - other).powi(2)).sum::<f64>().sqrt()
        };
        assert!(change(&sparse, &whole) <= 1e-2 * change(&whole, &passage.simulated), "point {point}");
    }
    assert!(skipped > windows.count(), "{skipped} windows of five times {}", windows.count());
}

#[test]
fn what_remembers_is_simulated_everywhere() {
    let baseline = RigParameters::baseline();
    let gridded = gridded(&baseline, &baseline);
    let windows = Windows::new(&gridded, &baseline);
    let plays = |point: usize, more_n: f64| {
        rig(point, more_n)
            .with_effect("valve-hysteresis", "drive", &[("half_width_percent", 1.0)])
            .expect("numbers of the sheet")
    };
    let passage = windows.reference_run(&plays(2, 0.0));
    let everywhere = windows.simulate_coarsely(&plays(2, 1.0));
    assert_eq!(windows.simulate_where(&plays(2, 1.0), &passage, |_| false), everywhere);
}
