//! Optional functions of the standard that this FMU does not offer; and the status of steps, which are complete when they
//! return.

use super::{Status, on};
use std::ffi::{c_char, c_double, c_int, c_uint, c_void};

/// `fmi2LastSuccessfulTime` and `fmi2Terminated` of `fmi2StatusKind`.
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

/// Functions that report the unset attribute of modelDescription.xml, from `name(further arguments) attribute`.
macro_rules! not_offered {
    ($($name:ident($($argument:ident: $kind:ty),*) $attribute:literal;)*) => {$(
        #[unsafe(no_mangle)]
        extern "C" fn $name(component: *mut c_void, $($argument: $kind),*) -> Status {
            unsupported(component, $attribute)
        }
    )*};
}

not_offered! {
    fmi2SerializedFMUstateSize(_state: *mut c_void, _size: *mut usize) "canSerializeFMUstate";
    fmi2SerializeFMUstate(_state: *mut c_void, _bytes: *mut c_char, _size: usize) "canSerializeFMUstate";
    fmi2DeSerializeFMUstate(_bytes: *const c_char, _size: usize, _state: *mut *mut c_void) "canSerializeFMUstate";
    fmi2GetDirectionalDerivative(
        _unknowns: *const c_uint, _unknown_count: usize, _knowns: *const c_uint, _known_count: usize,
        _known_differentials: *const c_double, _unknown_differentials: *mut c_double
    ) "providesDirectionalDerivative";
    fmi2SetRealInputDerivatives(
        _references: *const c_uint, _count: usize, _orders: *const c_int, _values: *const c_double
    ) "canInterpolateInputs";
    fmi2GetRealOutputDerivatives(
        _references: *const c_uint, _count: usize, _orders: *const c_int, _values: *mut c_double
    ) "maxOutputDerivativeOrder";
    fmi2CancelStep() "canRunAsynchronuously";
}

fn unsupported(component: *mut c_void, attribute: &str) -> Status {
    on(component, |instance| {
        instance
            .log
            .write(Status::Error, &format!("not supported: modelDescription.xml does not set {attribute}"));
        Ok(Status::Error)
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetStatus(component: *mut c_void, _kind: c_int, _value: *mut Status) -> Status {
    on(component, |_| Ok(Status::Discard))
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetRealStatus(component: *mut c_void, kind: c_int, value: *mut c_double) -> Status {
    on(component, |instance| {
        // SAFETY: the importer's variable.
        match (kind, unsafe { value.as_mut() }) {
            (LAST_SUCCESSFUL_TIME, Some(value)) => *value = instance.simulation.time_s(),
            _ => return Ok(Status::Discard),
        }
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetIntegerStatus(component: *mut c_void, _kind: c_int, _value: *mut c_int) -> Status {
    on(component, |_| Ok(Status::Discard))
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetBooleanStatus(component: *mut c_void, kind: c_int, value: *mut c_int) -> Status {
    on(component, |_| {
        // SAFETY: the importer's variable.
        match (kind, unsafe { value.as_mut() }) {
            (TERMINATED, Some(value)) => *value = 0,
            _ => return Ok(Status::Discard),
        }
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetStringStatus(
    component: *mut c_void,
    _kind: c_int,
    _value: *mut *const c_char,
) -> Status {
    on(component, |_| Ok(Status::Discard))
}
