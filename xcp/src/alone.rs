//! A slave without bus and controller, for fuzzing and for packets by hand.

use crate::a2l::{self, AxisDescription};
use crate::image::{Image, ParameterActions};
use crate::lock::Lock;
use crate::slave::Slave;
use axis_control::program::file::Source;
use nominal::{Axis, RigParameters};

/// Accepts every write and has no effect.
impl ParameterActions for () {
    fn set(&mut self, _place: usize, _value: f64) {}

    fn store(&mut self, _values: &[f64]) -> bool {
        true
    }

    fn load(&mut self) -> bool {
        true
    }
}

/// A slave over the program that holds the drive's valve shut, locked with `secret`; without a secret it is never unlocked.
///
/// # Panics
/// When that program or its A2L file cannot be made: a bug.
pub fn slave(secret: Option<&[u8]>) -> Slave {
    let source = Source::shut();
    let program = source
        .program(Axis::Drive, &RigParameters::baseline(), false)
        .unwrap_or_else(|error| panic!("the program that holds a valve shut: {error}"));
    let described =
        AxisDescription { axis: Axis::Drive, title: &source.title, variables: program.variables() };
    let description = a2l::description(&described).unwrap_or_else(|error| panic!("{error}"));
    let image = Image::new(description.bytes, program.variables().to_vec(), program.values());
    Slave::new(image, description.texts, Lock::new(secret.map(<[u8]>::to_vec), [0; 16]), 1)
}
