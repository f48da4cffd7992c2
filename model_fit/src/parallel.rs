//! Independent computations on all cores of the pool, their results in the order of the items.
//!
//! `rayon` sees closures behind a pointer here and is compiled once. Each use of its generic iterators is 5000 lines of LLVM IR.

use rayon::prelude::*;
use std::ops::Range;
use std::sync::Mutex;

/// `compute` of each item.
pub fn map<'i, I: Sync, T: Send>(items: &'i [I], compute: impl Fn(&'i I) -> T + Sync) -> Vec<T> {
    map_range(0..items.len(), |at| compute(&items[at]))
}

/// `compute` of both items.
pub fn map_pair<I: Sync, T: Send>(pair: [&I; 2], compute: impl Fn(&I) -> T + Sync) -> [T; 2] {
    let mut results = map(&pair, |item| compute(item)).into_iter();
    pair.map(|_| results.next().expect("one for each"))
}

/// `compute` of each number of a range.
pub fn map_range<T: Send>(range: Range<usize>, compute: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let results: Vec<Mutex<Option<T>>> = range.clone().map(|_| Mutex::new(None)).collect();
    for_each(range.len(), &|at| {
        let result = compute(range.start + at);
        *results[at].lock().expect("each is locked once") = Some(result);
    });
    let result =
        |cell: Mutex<Option<T>>| cell.into_inner().expect("no lock is held").expect("each is computed");
    results.into_iter().map(result).collect()
}

fn for_each(count: usize, compute: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(compute);
}
