//! Both axes in one SSE2 register, which every x86-64 machine has.

use super::{Axes, Choice};
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

/// A number for each axis: drive, load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair(imp::Pair);

/// Yes or no for each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mask(imp::Pair);

impl Axes for Pair {
    type Mask = Mask;

    #[inline(always)]
    fn new(drive: f64, load: f64) -> Self {
        Pair(imp::new(drive, load))
    }

    #[inline(always)]
    fn drive(self) -> f64 {
        imp::first(self.0)
    }

    #[inline(always)]
    fn load(self) -> f64 {
        imp::second(self.0)
    }

    #[inline(always)]
    fn reciprocal(self) -> Self {
        Pair(imp::div(imp::new(1.0, 1.0), self.0))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Pair(imp::sqrt(self.0))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Pair(imp::and_not(imp::new(-0.0, -0.0), self.0))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Pair(imp::min(self.0, other.0))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Pair(imp::max(self.0, other.0))
    }

    #[inline(always)]
    fn with_sign_of(self, sign: Self) -> Self {
        Pair(imp::or(self.0, imp::and(imp::new(-0.0, -0.0), sign.0)))
    }

    #[inline(always)]
    fn less(self, other: Self) -> Mask {
        Mask(imp::less(self.0, other.0))
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Mask {
        Mask(imp::at_most(self.0, other.0))
    }

    #[inline(always)]
    fn differs(self, other: Self) -> Mask {
        Mask(imp::differs(self.0, other.0))
    }

    #[inline(always)]
    fn where_true(self, mask: Mask) -> Self {
        Pair(imp::and(mask.0, self.0))
    }
}

impl Choice<Pair> for Mask {
    #[inline(always)]
    fn new(yes: [bool; 2]) -> Self {
        Pair::new(f64::from(u8::from(yes[0])), f64::from(u8::from(yes[1]))).differs(Pair::both(0.0))
    }

    #[inline(always)]
    fn choose(self, yes: Pair, no: Pair) -> Pair {
        Pair(imp::or(imp::and(self.0, yes.0), imp::and_not(self.0, no.0)))
    }

    #[inline(always)]
    fn any(self) -> bool {
        imp::any(self.0)
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $type:ident, $function:path) => {
        impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                $type($function(self.0, other.0))
            }
        }
    };
}
operator!(Add, add, Pair, imp::add);
operator!(Sub, sub, Pair, imp::sub);
operator!(Mul, mul, Pair, imp::mul);
operator!(BitAnd, bitand, Mask, imp::and);
operator!(BitOr, bitor, Mask, imp::or);

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
