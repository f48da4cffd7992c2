//! The numbers of a group of rigs as a structure of arrays: a column for each number, a place in it for each rig.

use crate::integrator::{HeldInputs, Integrator, Lanes};
use crate::lanes::{Axes, Form, Pair, Plain};

/// Rigs that go together: as many as a register of 512 bits holds; narrower ones take them in two or four parts.
pub(super) const WIDTH: usize = 8;

/// Numbers that a smooth substep takes from an integrator, and some that it takes along; a test counts them.
const CONSTANTS: usize = 98;

/// Pairs of a state, and the supply's pressure.
const PAIRS: usize = 7;

/// One number of each rig of a group.
type Column = [f64; WIDTH];

/// Constants and inputs, which do not change in a period.
#[derive(Debug, Clone)]
#[repr(align(64))] // a column is a line of the cache
pub(super) struct HeldColumns {
    constants: [Column; CONSTANTS],
    command: [Column; 2],
    hand: [Column; 2],
    /// 1 where it holds, 0 elsewhere.
    stopped: Column,
    linked: Column,
}

/// States, which a substep changes.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(super) struct StateColumns {
    pairs: [[Column; 2]; PAIRS],
    supply_pa: Column,
    /// Not 0 where the substep that led here may have a corner in it, and then it counts for nothing.
    corner: [u64; WIDTH],
}

impl HeldColumns {
    pub(super) fn new() -> Box<Self> {
        let none = [0.0; WIDTH];
        let (command, hand) = ([none; 2], [none; 2]);
        Box::new(HeldColumns { constants: [none; CONSTANTS], command, hand, stopped: none, linked: none })
    }

    /// Copies the laws of a rig into a lane.
    pub(super) fn set_laws(&mut self, lane: usize, of: &Integrator) {
        let mut writing = Writing { columns: &mut self.constants, lane, next: 0 };
        of.formed(&mut writing);
        debug_assert_eq!(writing.next, CONSTANTS);
    }

    pub(super) fn set_held(&mut self, lane: usize, held: &HeldInputs) {
        for axis in 0..2 {
            self.command[axis][lane] = held.command.to_array()[axis];
            self.hand[axis][lane] = held.hand.to_array()[axis];
        }
        self.stopped[lane] = f64::from(u8::from(held.stopped));
        self.linked[lane] = f64::from(u8::from(held.linked));
    }

    /// A lane without a rig does what another does.
    pub(super) fn shadow(&mut self, of: usize, lane: usize) {
        self.set_held(lane, &self.held(of));
    }

    /// The laws of one lane. `like` is any integrator: it fixes the order of the numbers.
    #[inline(always)]
    pub(super) fn laws(&self, lane: usize, like: &Integrator) -> Integrator<Plain> {
        like.formed(&mut Reading { columns: &self.constants, lane, next: 0 })
    }

    #[inline(always)]
    pub(super) fn held<P: Axes>(&self, lane: usize) -> HeldInputs<P> {
        HeldInputs {
            command: P::new(self.command[0][lane], self.command[1][lane]),
            hand: P::new(self.hand[0][lane], self.hand[1][lane]),
            stopped: self.stopped[lane] != 0.0,
            linked: self.linked[lane] != 0.0,
            stuck: [false; 2],
        }
    }
}

impl StateColumns {
    pub(super) fn new() -> Box<Self> {
        let none = [0.0; WIDTH];
        Box::new(StateColumns { pairs: [[none; 2]; PAIRS], supply_pa: none, corner: [0; WIDTH] })
    }

    #[inline(always)]
    pub(super) fn set<P: Axes>(&mut self, lane: usize, lanes: &Lanes<P>, supply_pa: f64) {
        for (columns, pair) in self.pairs.iter_mut().zip(lanes.to_pairs()) {
            columns[0][lane] = pair.drive();
            columns[1][lane] = pair.load();
        }
        self.supply_pa[lane] = supply_pa;
    }

    #[inline(always)]
    pub(super) fn get<P: Axes>(&self, lane: usize) -> (Lanes<P>, f64) {
        let pair = |i: usize| P::new(self.pairs[i][0][lane], self.pairs[i][1][lane]);
        let pairs = [pair(0), pair(1), pair(2), pair(3), pair(4), pair(5), pair(6)];
        (Lanes::from_pairs(pairs), self.supply_pa[lane])
    }

    /// A lane without a rig is where another is.
    pub(super) fn shadow(&mut self, of: usize, lane: usize) {
        let (lanes, supply_pa) = self.get::<Pair>(of);
        self.set(lane, &lanes, supply_pa);
    }

    #[inline(always)]
    pub(super) fn set_corner(&mut self, lane: usize, corner: bool) {
        self.corner[lane] = u64::from(corner);
    }

    pub(super) fn has_corners(&self) -> bool {
        self.corner.iter().fold(0, |any, corner| any | corner) != 0
    }

    pub(super) fn corner(&self, lane: usize) -> bool {
        self.corner[lane] != 0
    }
}

/// An integrator going into the columns.
struct Writing<'c> {
    columns: &'c mut [Column; CONSTANTS],
    lane: usize,
    next: usize,
}

impl Form<Pair> for Writing<'_> {
    fn pair(&mut self, pair: Pair) -> Pair {
        self.one(pair.drive());
        self.one(pair.load());
        pair
    }

    fn one(&mut self, number: f64) -> f64 {
        self.columns[self.next][self.lane] = number;
        self.next += 1;
        number
    }
}

/// An integrator coming out of the columns.
struct Reading<'c> {
    columns: &'c [Column; CONSTANTS],
    lane: usize,
    next: usize,
}

impl Form<Plain> for Reading<'_> {
    #[inline(always)]
    fn pair(&mut self, _: Pair) -> Plain {
        let drive = self.one(0.0);
        Plain::new(drive, self.one(0.0))
    }

    #[inline(always)]
    fn one(&mut self, _: f64) -> f64 {
        let number = self.columns[self.next][self.lane];
        self.next += 1;
        number
    }
}
