//! One substep of a group of rigs: a loop over its lanes that the compiler makes wide.
//!
//! The body is [`Integrator::substep`], the one that a single rig is moved by, over two plain numbers instead of a register. It
//! has no branch that the compiler cannot turn into a choice, no call and no dependence from lane to lane. The same loop is
//! compiled for wider registers too, and which of them is taken is found out when the program runs: none of them fuses or
//! reorders anything, so all give the same bits.

use super::columns::{HeldColumns, StateColumns, WIDTH};
use crate::integrator::Integrator;
use crate::integrator::laws::Baseline;

/// Registers that the lanes of a batch go through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Registers {
    /// What the program was compiled for: two lanes in SSE2 on x86-64.
    Plain,
    /// Four lanes, AVX2.
    Avx2,
    /// Eight lanes, AVX-512 with the parts F, BW, DQ and VL.
    Avx512,
}

impl Registers {
    /// All that there are, the narrowest first.
    pub const ALL: [Registers; 3] = [Registers::Plain, Registers::Avx2, Registers::Avx512];

    /// Whether this machine has them.
    #[must_use]
    pub fn are_there(self) -> bool {
        match self {
            Registers::Plain => true,
            #[cfg(target_arch = "x86_64")]
            Registers::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Registers::Avx512 => {
                // What masks of eight lanes want besides; all but the oldest machines have it with the first.
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// Fewer rigs of a group than these are faster by themselves. Measured, see `docs/integration.md`.
    pub(super) fn worthwhile(self) -> usize {
        match self {
            Registers::Plain => 6,
            Registers::Avx2 => 4,
            Registers::Avx512 => 3,
        }
    }

    /// The widest that this machine has.
    #[must_use]
    pub fn widest() -> Self {
        Self::ALL.into_iter().rev().find(|registers| registers.are_there()).unwrap_or(Registers::Plain)
    }
}

/// A substep of all lanes from `from` to `to`; `like` fixes the layout of an integrator.
///
/// # Panics
/// Never: the registers must be there, which whoever chose them has asserted.
#[allow(unsafe_code)] // a function for wider registers must not run where they are not
pub(super) fn substep(
    registers: Registers,
    like: &Integrator,
    fixed: &HeldColumns,
    from: &StateColumns,
    to: &mut StateColumns,
) {
    match registers {
        Registers::Plain => all_lanes(like, fixed, from, to),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a batch takes no registers that the machine does not have ([`Registers::are_there`]).
        Registers::Avx2 => unsafe { in_avx2(like, fixed, from, to) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Registers::Avx512 => unsafe { in_avx512(like, fixed, from, to) },
        #[cfg(not(target_arch = "x86_64"))]
        _ => all_lanes(like, fixed, from, to),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn in_avx2(like: &Integrator, fixed: &HeldColumns, from: &StateColumns, to: &mut StateColumns) {
    all_lanes(like, fixed, from, to);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn in_avx512(like: &Integrator, fixed: &HeldColumns, from: &StateColumns, to: &mut StateColumns) {
    all_lanes(like, fixed, from, to);
}

#[inline(always)]
fn all_lanes(like: &Integrator, fixed: &HeldColumns, from: &StateColumns, to: &mut StateColumns) {
    for lane in 0..WIDTH {
        let of = fixed.laws(lane, like);
        let (lanes, supply_pa) = from.get(lane);
        let ((next, end_pa), corner) =
            of.substep(&Baseline, (&lanes, supply_pa), fixed.held(lane), 0, &mut ());
        to.set(lane, &next, end_pa);
        to.set_corner(lane, corner);
    }
}
