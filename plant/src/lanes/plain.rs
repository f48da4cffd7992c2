//! Both axes as two numbers of their own: what a loop over rigs is written with, and all that other machines have.

use super::{Axes, Choice};
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

const SIGN: u64 = 1 << 63;

/// A number for each axis: drive, load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain([f64; 2]);

/// Yes or no for each axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlainMask([bool; 2]);

impl Plain {
    #[inline(always)]
    fn each(self, what: impl Fn(f64) -> f64) -> Self {
        Plain([what(self.0[0]), what(self.0[1])])
    }

    #[inline(always)]
    fn with(self, other: Self, what: impl Fn(f64, f64) -> f64) -> Self {
        Plain([what(self.0[0], other.0[0]), what(self.0[1], other.0[1])])
    }

    #[inline(always)]
    fn against(self, other: Self, is: impl Fn(f64, f64) -> bool) -> PlainMask {
        PlainMask([is(self.0[0], other.0[0]), is(self.0[1], other.0[1])])
    }
}

impl Axes for Plain {
    type Mask = PlainMask;

    #[inline(always)]
    fn new(drive: f64, load: f64) -> Self {
        Plain([drive, load])
    }

    #[inline(always)]
    fn drive(self) -> f64 {
        self.0[0]
    }

    #[inline(always)]
    fn load(self) -> f64 {
        self.0[1]
    }

    #[inline(always)]
    fn reciprocal(self) -> Self {
        self.each(|a| 1.0 / a)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.each(f64::sqrt)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.each(f64::abs)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn with_sign_of(self, sign: Self) -> Self {
        self.with(sign, |a, sign| f64::from_bits(a.to_bits() | sign.to_bits() & SIGN))
    }

    #[inline(always)]
    fn less(self, other: Self) -> PlainMask {
        self.against(other, |a, b| a < b)
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> PlainMask {
        self.against(other, |a, b| a <= b)
    }

    #[inline(always)]
    fn differs(self, other: Self) -> PlainMask {
        self.against(other, |a, b| a != b)
    }

    #[inline(always)]
    fn where_true(self, mask: PlainMask) -> Self {
        mask.choose(self, Plain::both(0.0))
    }
}

impl Choice<Plain> for PlainMask {
    #[inline(always)]
    fn new(yes: [bool; 2]) -> Self {
        PlainMask(yes)
    }

    #[inline(always)]
    fn choose(self, yes: Plain, no: Plain) -> Plain {
        let one = |axis: usize| if self.0[axis] { yes.0[axis] } else { no.0[axis] };
        Plain([one(0), one(1)])
    }

    #[inline(always)]
    fn any(self) -> bool {
        self.0[0] | self.0[1]
    }
}

macro_rules! number {
    ($trait:ident, $method:ident) => {
        impl $trait for Plain {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(other, $trait::$method)
            }
        }
    };
}
number!(Add, add);
number!(Sub, sub);
number!(Mul, mul);

impl Neg for Plain {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(Neg::neg)
    }
}

macro_rules! truth {
    ($trait:ident, $method:ident) => {
        impl $trait for PlainMask {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                PlainMask([self.0[0].$method(other.0[0]), self.0[1].$method(other.0[1])])
            }
        }
    };
}
truth!(BitAnd, bitand);
truth!(BitOr, bitor);

impl Not for PlainMask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        PlainMask([!self.0[0], !self.0[1]])
    }
}
