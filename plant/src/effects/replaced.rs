//! Numbers of the rig file that effects put others in place of: there is one law, and one number in it.

use super::AxisEffects;
use super::sums::{Damping, DeadSpace, Gap, Stiffness};
use crate::parameters::{LinkageParameters, RigParameters};

/// Dead volume of each axis' chambers, m^3: the file's, or what an effect puts in its place.
pub(crate) fn dead_volumes_m3(rig: &RigParameters) -> [f64; 2] {
    let file = rig.cylinder().dead_volume_m3;
    AxisEffects::of(rig).map(|axis| {
        DeadSpace { dead_volume: axis.dead_volume.map_or(0.0, |effect| effect.term(file)) }.sum(file)
    })
}

/// Numbers of the linkage: the file's, or what effects put in their place.
pub(crate) fn linkage(rig: &RigParameters) -> LinkageParameters {
    let file = *rig.linkage();
    let (gap, stiffness, damping) = linkage_terms(&AxisEffects::of(rig)[0], &file);
    LinkageParameters {
        gap_m: gap.sum(file.gap_m),
        stiffness_n_per_m: stiffness.sum(file.stiffness_n_per_m),
        damping_n_s_per_m: damping.sum(file.damping_n_s_per_m),
    }
}

pub(super) fn linkage_terms(on: &AxisEffects, file: &LinkageParameters) -> (Gap, Stiffness, Damping) {
    let compliance = on.coupling_compliance;
    (
        Gap { coupling_backlash: on.coupling_backlash.map_or(0.0, |effect| effect.term(file.gap_m)) },
        Stiffness {
            coupling_compliance: compliance
                .map_or(0.0, |effect| effect.stiffness_term(file.stiffness_n_per_m)),
        },
        Damping {
            coupling_compliance: compliance.map_or(0.0, |effect| effect.damping_term(file.damping_n_s_per_m)),
        },
    )
}
