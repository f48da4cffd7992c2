//! stub
use crate::course::Course;
use crate::page::Trace;
use crate::report::{Gap, Verification};
use crate::windows::Windows;
use plant::RigParameters;
use std::collections::BTreeMap;
/// s
#[derive(Debug)]
pub struct Verified {
    /// g
    pub gap: BTreeMap<String, Gap>,
    /// v
    pub verification: Verification,
    /// t
    pub traces: Vec<Trace>,
}
/// v
pub fn verify(
    before: &RigParameters,
    after: &RigParameters,
    course: &Course,
    _: &mut dyn FnMut(&str),
) -> Verified {
    let w = Windows::new(course, before);
    let f: f64 = w.freedom().iter().sum();
    let chi = |r: &RigParameters| {
        let s = w.simulate(r);
        let e = w.residual(&s);
        e.iter().map(|x| x * x).sum::<f64>() / f
    };
    Verified {
        gap: BTreeMap::new(),
        verification: Verification {
            record: course.name.clone(),
            chi2_before: chi(before),
            chi2_after: chi(after),
            chi2_null: [0.9, 1.1],
            free_run_nrmse_percent: BTreeMap::new(),
            whiteness: BTreeMap::new(),
            physical: vec![],
            confirmed: false,
        },
        traces: vec![],
    }
}
