//! Two numbers side by side, one for each axis, so that both axes cost what one costs.
//!
//! Laws are written once, over [`Axes`]. There are two of it: [`Pair`] in a register, for one rig at a time, and [`Plain`]
//! in two numbers of their own, for a loop over many rigs that the compiler makes wide ([`crate::Batch`]). Add, multiply,
//! divide and square root round alike in every width (IEEE 754) and the rest only chooses, so the bits do not depend on
//! which of the two it is.
//!
//! A mask ([`Choice`]) is the answer to a comparison, axis by axis. Choosing by mask costs no branch, so the two axes may
//! decide differently and nothing can be guessed wrongly.

#[cfg(target_arch = "x86_64")]
mod pair;
mod plain;

use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

#[cfg(target_arch = "x86_64")]
pub(crate) use pair::{Mask, Pair};
pub(crate) use plain::Plain;
#[cfg(not(target_arch = "x86_64"))]
pub(crate) use plain::{Plain as Pair, PlainMask as Mask};

/// A number for each axis: drive, load.
pub(crate) trait Axes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// Yes or no for each axis.
    type Mask: Choice<Self>;

    fn new(drive: f64, load: f64) -> Self;
    fn drive(self) -> f64;
    fn load(self) -> f64;
    fn reciprocal(self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    /// The lesser of the two; `other` where they do not compare.
    fn min(self, other: Self) -> Self;
    /// The greater of the two; `other` where they do not compare.
    fn max(self, other: Self) -> Self;
    /// Its own size with the sign of `sign`; `self` must not be negative.
    fn with_sign_of(self, sign: Self) -> Self;
    fn less(self, other: Self) -> Self::Mask;
    fn at_most(self, other: Self) -> Self::Mask;
    fn differs(self, other: Self) -> Self::Mask;
    /// Its own where the mask says yes, 0 elsewhere.
    fn where_true(self, mask: Self::Mask) -> Self;

    #[inline(always)]
    fn both(value: f64) -> Self {
        Self::new(value, value)
    }

    #[inline(always)]
    fn to_array(self) -> [f64; 2] {
        [self.drive(), self.load()]
    }

    /// Sum over both axes.
    #[inline(always)]
    fn sum(self) -> f64 {
        self.drive() + self.load()
    }
}

/// Yes or no for each axis.
pub(crate) trait Choice<N>:
    Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// Yes or no for drive and load.
    fn new(yes: [bool; 2]) -> Self;
    /// `yes` where true, `no` where false.
    fn choose(self, yes: N, no: N) -> N;
    fn any(self) -> bool;
}

/// Takes the numbers of a rig's laws to another form, one after the other in the order of their structures: into the columns
/// of a batch, and out of them for a lane.
pub(crate) trait Form<P> {
    fn pair(&mut self, pair: Pair) -> P;
    fn one(&mut self, number: f64) -> f64;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn each_operation_acts_axis_by_axis<P: Axes>() {
        let (a, b) = (P::new(-2.0, 9.0), P::new(4.0, 3.0));
        assert_eq!((a + b).to_array(), [2.0, 12.0]);
        assert_eq!((a - b).to_array(), [-6.0, 6.0]);
        assert_eq!((a * b).to_array(), [-8.0, 27.0]);
        assert_eq!((-a).to_array(), [2.0, -9.0]);
        assert_eq!(a.abs().to_array(), [2.0, 9.0]);
        assert_eq!(b.reciprocal().to_array(), [0.25, 1.0 / 3.0]);
        assert_eq!(b.sqrt().to_array(), [2.0, 3.0_f64.sqrt()]);
        assert_eq!(a.min(b).to_array(), [-2.0, 3.0]);
        assert_eq!(a.max(b).to_array(), [4.0, 9.0]);
        assert_eq!(b.with_sign_of(a).to_array(), [-4.0, 3.0]);
        assert_eq!(a.sum(), 7.0);
    }

    fn a_mask_chooses_axis_by_axis<P: Axes>() {
        let (a, b) = (P::new(1.0, 5.0), P::new(2.0, 5.0));
        assert_eq!(a.less(b).choose(a, P::both(0.5)).to_array(), [1.0, 0.5]);
        assert_eq!((!a.less(b)).choose(a, P::both(0.5)).to_array(), [0.5, 5.0]);
        assert_eq!(a.where_true(a.at_most(b) & a.differs(b)).to_array(), [1.0, 0.0]);
        assert!(a.less(b).any() && !b.less(a).any());
        assert!((a.differs(b) | b.less(a)).any());
    }

    #[test]
    fn a_pair_and_two_plain_numbers_are_alike() {
        each_operation_acts_axis_by_axis::<Pair>();
        each_operation_acts_axis_by_axis::<Plain>();
        a_mask_chooses_axis_by_axis::<Pair>();
        a_mask_chooses_axis_by_axis::<Plain>();
    }

    #[test]
    fn numbers_that_do_not_compare_are_chosen_alike() {
        let bits = |numbers: [f64; 2]| numbers.map(f64::to_bits);
        for (a, b) in [(f64::NAN, 1.0), (1.0, f64::NAN), (0.0, -0.0), (-0.0, 0.0)] {
            let (pairs, plains) = ([Pair::both(a), Pair::both(b)], [Plain::both(a), Plain::both(b)]);
            assert_eq!(
                bits(pairs[0].min(pairs[1]).to_array()),
                bits(plains[0].min(plains[1]).to_array()),
                "{a} {b}"
            );
            assert_eq!(
                bits(pairs[0].max(pairs[1]).to_array()),
                bits(plains[0].max(plains[1]).to_array()),
                "{a} {b}"
            );
            assert_eq!(pairs[0].differs(pairs[1]).any(), plains[0].differs(plains[1]).any(), "{a} {b}");
        }
    }
}
