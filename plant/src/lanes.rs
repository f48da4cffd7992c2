//! Two numbers side by side, one for each axis, so that both axes cost what one costs.
//!
//! Every x86-64 machine has the SSE2 registers that hold such a pair, and add, multiply, divide and square
//! root on them round exactly as on single numbers (IEEE 754), so the bits do not depend on this file. Other
//! machines get the same operations one after the other.
//!
//! A [`Mask`] is the answer to a comparison, lane by lane. Choosing by mask costs no branch, so the two axes may
//! decide differently and nothing can be guessed wrongly.

use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

/// A number for each axis: drive, load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair(imp::Pair);

/// Yes or no for each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask(imp::Pair);

impl Pair {
    #[inline(always)]
    pub(crate) fn new(drive: f64, load: f64) -> Self {
        Pair(imp::new(drive, load))
    }

    #[inline(always)]
    pub(crate) fn both(value: f64) -> Self {
        Pair(imp::new(value, value))
    }

    #[inline(always)]
    pub(crate) fn drive(self) -> f64 {
        imp::first(self.0)
    }

    #[inline(always)]
    pub(crate) fn load(self) -> f64 {
        imp::second(self.0)
    }

    #[inline(always)]
    pub(crate) fn to_array(self) -> [f64; 2] {
        [self.drive(), self.load()]
    }

    /// Sum over both axes.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        self.drive() + self.load()
    }

    #[inline(always)]
    pub(crate) fn reciprocal(self) -> Self {
        Pair(imp::div(imp::new(1.0, 1.0), self.0))
    }

    #[inline(always)]
    pub(crate) fn sqrt(self) -> Self {
        Pair(imp::sqrt(self.0))
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Pair(imp::min(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Pair(imp::max(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Pair(imp::and_not(imp::new(-0.0, -0.0), self.0))
    }

    /// This pair's size with the sign of `sign`; `self` must not be negative.
    #[inline(always)]
    pub(crate) fn with_sign_of(self, sign: Self) -> Self {
        Pair(imp::or(self.0, imp::and(imp::new(-0.0, -0.0), sign.0)))
    }

    #[inline(always)]
    pub(crate) fn less(self, other: Self) -> Mask {
        Mask(imp::less(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn at_most(self, other: Self) -> Mask {
        Mask(imp::at_most(self.0, other.0))
    }

    #[inline(always)]
    pub(crate) fn differs(self, other: Self) -> Mask {
        Mask(imp::differs(self.0, other.0))
    }

    /// This pair where the mask says yes, 0 elsewhere.
    #[inline(always)]
    pub(crate) fn where_true(self, mask: Mask) -> Self {
        Pair(imp::and(mask.0, self.0))
    }
}

impl Mask {
    /// Yes or no for drive and load.
    #[inline(always)]
    pub(crate) fn new(yes: [bool; 2]) -> Self {
        Pair::new(f64::from(u8::from(yes[0])), f64::from(u8::from(yes[1]))).differs(Pair::both(0.0))
    }

    /// `yes` where true, `no` where false.
    #[inline(always)]
    pub(crate) fn choose(self, yes: Pair, no: Pair) -> Pair {
        Pair(imp::or(imp::and(self.0, yes.0), imp::and_not(self.0, no.0)))
    }

    #[inline(always)]
    pub(crate) fn any(self) -> bool {
        imp::any(self.0)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $type:ident, $function:ident) => {
        impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                $type(imp::$function(self.0, other.0))
            }
        }
    };
}
operator!(Add, add, Pair, add);
operator!(Sub, sub, Pair, sub);
operator!(Mul, mul, Pair, mul);
operator!(BitAnd, bitand, Mask, and);
operator!(BitOr, bitor, Mask, or);

impl Neg for Pair {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Pair(imp::xor(imp::new(-0.0, -0.0), self.0))
    }
}

impl Not for Mask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Mask(imp::and_not(self.0, imp::new(imp::TRUE, imp::TRUE)))
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)] // the intrinsics are unsafe to call only where SSE2 may be absent; x86-64 always has it
mod imp {
    use std::arch::x86_64::*;

    pub(super) type Pair = __m128d;

    /// All bits set, as a comparison gives it.
    pub(super) const TRUE: f64 = f64::from_bits(u64::MAX);

    #[inline(always)]
    pub(super) fn new(first: f64, second: f64) -> Pair {
        // SAFETY: SSE2 is part of x86-64.
        unsafe { _mm_set_pd(second, first) }
    }

    #[inline(always)]
    pub(super) fn first(a: Pair) -> f64 {
        // SAFETY: SSE2 is part of x86-64.
        unsafe { _mm_cvtsd_f64(a) }
    }

    #[inline(always)]
    pub(super) fn second(a: Pair) -> f64 {
        // SAFETY: SSE2 is part of x86-64.
        unsafe { _mm_cvtsd_f64(_mm_unpackhi_pd(a, a)) }
    }

    #[inline(always)]
    pub(super) fn sqrt(a: Pair) -> Pair {
        // SAFETY: SSE2 is part of x86-64.
        unsafe { _mm_sqrt_pd(a) }
    }

    #[inline(always)]
    pub(super) fn any(a: Pair) -> bool {
        // SAFETY: SSE2 is part of x86-64.
        unsafe { _mm_movemask_pd(a) != 0 }
    }

    macro_rules! two {
        ($($name:ident = $intrinsic:ident;)*) => {$(
            #[inline(always)]
            pub(super) fn $name(a: Pair, b: Pair) -> Pair {
                // SAFETY: SSE2 is part of x86-64.
                unsafe { $intrinsic(a, b) }
            }
        )*};
    }
    two! {
        add = _mm_add_pd; sub = _mm_sub_pd; mul = _mm_mul_pd; div = _mm_div_pd;
        min = _mm_min_pd; max = _mm_max_pd;
        and = _mm_and_pd; or = _mm_or_pd; xor = _mm_xor_pd; and_not = _mm_andnot_pd;
        less = _mm_cmplt_pd; at_most = _mm_cmple_pd; differs = _mm_cmpneq_pd;
    }
}

#[cfg(not(target_arch = "x86_64"))]
mod imp {
    pub(super) type Pair = [f64; 2];

    pub(super) const TRUE: f64 = f64::from_bits(u64::MAX);

    pub(super) fn new(first: f64, second: f64) -> Pair {
        [first, second]
    }

    pub(super) fn first(a: Pair) -> f64 {
        a[0]
    }

    pub(super) fn second(a: Pair) -> f64 {
        a[1]
    }

    pub(super) fn sqrt(a: Pair) -> Pair {
        a.map(f64::sqrt)
    }

    pub(super) fn any(a: Pair) -> bool {
        a[0].to_bits() >> 63 != 0 || a[1].to_bits() >> 63 != 0
    }

    fn truth(yes: bool) -> f64 {
        if yes { TRUE } else { 0.0 }
    }

    macro_rules! two {
        ($($name:ident = |$a:ident, $b:ident| $body:expr;)*) => {$(
            pub(super) fn $name(a: Pair, b: Pair) -> Pair {
                let one = |$a: f64, $b: f64| -> f64 { $body };
                [one(a[0], b[0]), one(a[1], b[1])]
            }
        )*};
    }
    two! {
        add = |a, b| a + b; sub = |a, b| a - b; mul = |a, b| a * b; div = |a, b| a / b;
        min = |a, b| if a < b { a } else { b }; max = |a, b| if a > b { a } else { b };
        and = |a, b| f64::from_bits(a.to_bits() & b.to_bits());
        or = |a, b| f64::from_bits(a.to_bits() | b.to_bits());
        xor = |a, b| f64::from_bits(a.to_bits() ^ b.to_bits());
        and_not = |a, b| f64::from_bits(!a.to_bits() & b.to_bits());
        less = |a, b| truth(a < b); at_most = |a, b| truth(a <= b); differs = |a, b| truth(a != b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_operation_acts_lane_by_lane() {
        let (a, b) = (Pair::new(-2.0, 9.0), Pair::new(4.0, 3.0));
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

    #[test]
    fn a_mask_chooses_lane_by_lane() {
        let (a, b) = (Pair::new(1.0, 5.0), Pair::new(2.0, 5.0));
        assert_eq!(a.less(b).choose(a, Pair::both(0.5)).to_array(), [1.0, 0.5]);
        assert_eq!((!a.less(b)).choose(a, Pair::both(0.5)).to_array(), [0.5, 5.0]);
        assert_eq!(a.where_true(a.at_most(b) & a.differs(b)).to_array(), [1.0, 0.0]);
        assert!(a.less(b).any() && !b.less(a).any());
        assert!((a.differs(b) | b.less(a)).any());
    }
}
