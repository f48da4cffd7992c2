//! A slave without bus and controller: for fuzzers, and for whoever tries packets by hand.

use crate::a2l::{self, Described};
use crate::image::{Image, ParameterActions};
use crate::lock::Lock;
use crate::slave::{Slave, SlaveParts};
use axis_control::program::file::Source;
use nominal::{Axis, RigParameters};

/// Nobody acts on what is written.
impl ParameterActions for () {
    fn set(&mut self, _place: usize, _value: f64) {}

    fn store(&mut self, _values: &[f64]) -> bool {
        true
    }

    fn load(&mut self) -> bool {
        true
    }
}

/// A slave over the program of an axis of which nothing is asked, behind this secret.
///
/// # Panics
/// When that program or its A2L file cannot be made: a bug.
pub fn slave(secret: Option<&[u8]>) -> Slave {
    let source = Source::shut();
    let program = source
        .program(Axis::Drive, &RigParameters::baseline(), false)
        .unwrap_or_else(|error| panic!("the program that holds a valve shut: {error}"));
    let described = Described { axis: Axis::Drive, title: &source.title, variables: program.variables() };
    let description = a2l::description(&described).unwrap_or_else(|error| panic!("{error}"));
    Slave::new(SlaveParts {
        image: Image::new(description.bytes, program.variables().to_vec(), program.values()),
        texts: description.texts,
        lock: Lock::new(secret.map(<[u8]>::to_vec), [0; 16]),
        daq_per_cycle: 1,
    })
}
