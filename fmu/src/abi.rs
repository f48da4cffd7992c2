//! The C interface of FMI 2.0: the only place with foreign pointers; no panic crosses it.
//!
//! Each function is a few lines around [`Simulation`]: it turns pointers into slices, catches a panic, writes a refusal to the
//! importer's log and returns a status. After a panic the instance is dead: every further call returns `fmi2Fatal`.
//!
//! Premises of the `// SAFETY:` comments, which cannot be proved here:
//! - *The standard.* An importer promises that a component came from `fmi2Instantiate` and was not freed, that it is used by one
//!   thread at a time, that arrays are as long as it says, and that strings end in a zero. Null is checked.
//! - *The logger* is C with variable arguments; a `%` of a message is doubled, since it is a format.
//!
//! Source: FMI 2.0.4, sections 2.1 and 4.2; `fmi2FunctionTypes.h`.
#![allow(unsafe_code)] // foreign pointers and exported names; nothing else in the crate is
#![allow(missing_docs, non_snake_case)] // the names and their meaning are the standard's

mod optional;

use crate::description;
use crate::simulation::{Refusal, Simulation};
use plant::RigParameters;
use std::ffi::{CStr, CString, c_char, c_double, c_int, c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::ptr::null_mut;

/// `fmi2Status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub(crate) enum Status {
    Ok = 0,
    Warning = 1,
    Discard = 2,
    Error = 3,
    Fatal = 4,
}

type Logger = unsafe extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, ...);

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub(crate) struct Callbacks {
    logger: Option<Logger>,
    allocate_memory: *const c_void,
    free_memory: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

/// `fmi2CoSimulation` of `fmi2Type`.
const CO_SIMULATION: c_int = 1;

/// An instance, as the importer holds it.
struct Component {
    simulation: Simulation,
    log: ImporterLog,
    dead: bool,
}

struct ImporterLog {
    name: CString,
    logger: Option<Logger>,
    environment: *mut c_void,
}

impl ImporterLog {
    fn write(&self, status: Status, text: &str) {
        let Some(logger) = self.logger else { return };
        let category = match status {
            Status::Ok | Status::Warning => c"logStatusWarning",
            Status::Discard | Status::Error => c"logStatusError",
            Status::Fatal => c"logStatusFatal",
        };
        let message = text.replace('%', "%%").replace('\0', " ");
        let Ok(message) = CString::new(message) else { return };
        // SAFETY: the importer's own function and environment; the texts live until it returns.
        unsafe {
            logger(self.environment, self.name.as_ptr(), status, category.as_ptr(), message.as_ptr());
        }
    }
}

/// Runs `work` on a component, if it exists and is alive.
fn on(component: *mut c_void, work: impl FnOnce(&mut Component) -> Result<Status, Refusal>) -> Status {
    // SAFETY: an importer hands in what `fmi2Instantiate` gave, to one thread at a time (see the head).
    let Some(component) = (unsafe { component.cast::<Component>().as_mut() }) else { return Status::Error };
    if component.dead {
        return Status::Fatal;
    }
    match catch_unwind(AssertUnwindSafe(|| work(component))) {
        Ok(Ok(status)) => status,
        Ok(Err(refusal)) => {
            component.log.write(Status::Error, &refusal.to_string());
            Status::Error
        }
        Err(_) => {
            component.dead = true;
            component
                .log
                .write(Status::Fatal, "a bug of the FMU: the instance cannot be used any more; free it");
            Status::Fatal
        }
    }
}

/// A slice of an importer's array; an empty one may be null.
fn slice<'a, T>(start: *const T, count: usize) -> &'a [T] {
    if count == 0 || start.is_null() {
        return &[];
    }
    // SAFETY: the array is as long as the importer says (see the head).
    unsafe { std::slice::from_raw_parts(start, count) }
}

fn slice_mut<'a, T>(start: *mut T, count: usize) -> &'a mut [T] {
    if count == 0 || start.is_null() {
        return &mut [];
    }
    // SAFETY: as above, and nobody else holds it during the call.
    unsafe { std::slice::from_raw_parts_mut(start, count) }
}

/// Passes the references and the destination of a `fmi2Get…` to `work`, if both are given.
fn get<V>(
    component: *mut c_void,
    (references, values, count): (*const c_uint, *mut V, usize),
    work: impl FnOnce(&mut Simulation, &[c_uint], &mut [V]) -> Result<(), Refusal>,
) -> Status {
    let (references, values) = (slice(references, count), slice_mut(values, count));
    let is_there = references.len() == count && values.len() == count;
    on_arrays(component, is_there, |simulation| work(simulation, references, values))
}

/// The same for a `fmi2Set…`, which only reads the values.
fn set<V>(
    component: *mut c_void,
    (references, values, count): (*const c_uint, *const V, usize),
    work: impl FnOnce(&mut Simulation, &[c_uint], &[V]) -> Result<(), Refusal>,
) -> Status {
    let (references, values) = (slice(references, count), slice(values, count));
    let is_there = references.len() == count && values.len() == count;
    on_arrays(component, is_there, |simulation| work(simulation, references, values))
}

fn on_arrays(
    component: *mut c_void,
    is_there: bool,
    work: impl FnOnce(&mut Simulation) -> Result<(), Refusal>,
) -> Status {
    on(component, |instance| {
        if !is_there {
            let why = "a null pointer in place of value references or values";
            instance.log.write(Status::Error, why);
            return Ok(Status::Error);
        }
        work(&mut instance.simulation).map(|()| Status::Ok)
    })
}

fn text(pointer: *const c_char) -> Option<String> {
    // SAFETY: a string of the importer ends in a zero (see the head).
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned())
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging(
    component: *mut c_void,
    _logging_on: c_int,
    _count: usize,
    _categories: *const *const c_char,
) -> Status {
    // Warnings and errors are always logged, and there are no lower levels.
    on(component, |_| Ok(Status::Ok))
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    _logging_on: c_int,
) -> *mut c_void {
    // SAFETY: the importer's structure, which it keeps for the life of the instance.
    let Some(callbacks) = (unsafe { callbacks.as_ref() }) else { return null_mut() };
    let name = text(name).and_then(|name| CString::new(name).ok()).unwrap_or_default();
    let log = ImporterLog { name, logger: callbacks.logger, environment: callbacks.environment };
    let made = catch_unwind(AssertUnwindSafe(|| instantiate(kind, text(guid), text(resources))));
    match made {
        Ok(Ok(simulation)) => Box::into_raw(Box::new(Component { simulation, log, dead: false })).cast(),
        Ok(Err(reason)) => {
            log.write(Status::Error, &reason);
            null_mut()
        }
        Err(_) => {
            log.write(Status::Fatal, "a bug of the FMU: there is no instance");
            null_mut()
        }
    }
}

fn instantiate(kind: c_int, guid: Option<String>, resources: Option<String>) -> Result<Simulation, String> {
    if kind != CO_SIMULATION {
        return Err("this FMU is for co-simulation: instantiate it with fmi2CoSimulation".into());
    }
    let resources = resources.ok_or("fmuResourceLocation is missing: the rig file lies there")?;
    let folder = folder_of(&resources).ok_or_else(|| {
        format!("fmuResourceLocation {resources}: give a file URI, as file:///tmp/plant/resources")
    })?;
    let file = folder.join(crate::RIG_FILE);
    let rig_toml =
        std::fs::read_to_string(&file).map_err(|error| format!("cannot read {}: {error}", file.display()))?;
    let rig = RigParameters::from_toml(&rig_toml, &file.display().to_string())
        .map_err(|error| error.to_string())?;
    let description = description::of(&rig, &rig_toml).map_err(|error| error.to_string())?;
    if guid.as_deref() != Some(description.guid.as_str()) {
        return Err(format!(
            "this FMU was put together from two builds, or its files were edited: its library wants guid {}, and was given {}; \
             export it anew with 'bench export-fmu'",
            description.guid,
            guid.as_deref().unwrap_or("none")
        ));
    }
    Simulation::new(rig).map_err(|error| error.to_string())
}

/// The folder of a file URI [RFC 8089], with or without an authority.
fn folder_of(uri: &str) -> Option<PathBuf> {
    let rest = uri.strip_prefix("file:")?;
    let path = match rest.strip_prefix("//") {
        Some(rest) => &rest[rest.find('/')?..],
        None => rest,
    };
    let (mut bytes, mut left) = (Vec::with_capacity(path.len()), path.as_bytes());
    while let Some((first, rest)) = left.split_first() {
        left = rest;
        match (first, rest) {
            (b'%', [high, low, ..]) => {
                let digit = |byte: &u8| char::from(*byte).to_digit(16);
                bytes.push((digit(high)? << 4 | digit(low)?) as u8);
                left = &rest[2..];
            }
            (byte, _) => bytes.push(*byte),
        }
    }
    String::from_utf8(bytes).ok().filter(|path| path.starts_with('/')).map(PathBuf::from)
}

#[unsafe(no_mangle)]
extern "C" fn fmi2FreeInstance(component: *mut c_void) {
    if !component.is_null() {
        // SAFETY: made by `fmi2Instantiate`, and freed once (see the head).
        drop(unsafe { Box::from_raw(component.cast::<Component>()) });
    }
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetupExperiment(
    component: *mut c_void,
    _tolerance_defined: c_int,
    _tolerance: c_double,
    start_s: c_double,
    _stop_defined: c_int,
    _stop_s: c_double,
) -> Status {
    on(component, |instance| instance.simulation.set_start(start_s).map(|()| Status::Ok))
}

/// Functions that lead from one mode to another.
macro_rules! changes_of_mode {
    ($($name:ident $work:ident;)*) => {$(
        #[unsafe(no_mangle)]
        extern "C" fn $name(component: *mut c_void) -> Status {
            on(component, |instance| instance.simulation.$work().map(|()| Status::Ok))
        }
    )*};
}

changes_of_mode! {
    fmi2EnterInitializationMode enter_initialisation;
    fmi2ExitInitializationMode exit_initialisation;
    fmi2Terminate terminate;
    fmi2Reset reset;
}

/// Functions that get or set values by their references, from `name(values) hands, work`.
macro_rules! by_references {
    ($($name:ident($values:ty) $hands:ident, $work:expr;)*) => {$(
        #[unsafe(no_mangle)]
        extern "C" fn $name(
            component: *mut c_void,
            references: *const c_uint,
            count: usize,
            values: $values,
        ) -> Status {
            $hands(component, (references, values, count), $work)
        }
    )*};
}

by_references! {
    fmi2GetReal(*mut c_double) get, Simulation::reals;
    fmi2GetInteger(*mut c_int) get, |instance, references, values| instance.integers(references, values);
    fmi2GetBoolean(*mut c_int) get, booleans;
    fmi2GetString(*mut *const c_char) no_strings, ();
    fmi2SetReal(*const c_double) set, Simulation::set_reals;
    fmi2SetInteger(*const c_int) set, Simulation::set_integers;
    fmi2SetBoolean(*const c_int) set, set_booleans;
    fmi2SetString(*const *const c_char) no_strings, ();
}

fn booleans(instance: &mut Simulation, references: &[c_uint], values: &mut [c_int]) -> Result<(), Refusal> {
    let mut flags = vec![false; values.len()];
    instance.booleans(references, &mut flags)?;
    values.iter_mut().zip(flags).for_each(|(value, flag)| *value = c_int::from(flag));
    Ok(())
}

fn set_booleans(instance: &mut Simulation, references: &[c_uint], values: &[c_int]) -> Result<(), Refusal> {
    let flags: Vec<_> = values.iter().map(|value| *value != 0).collect();
    instance.set_booleans(references, &flags)
}

/// No variable is a string.
fn no_strings<V>(
    component: *mut c_void,
    (references, _values, count): (*const c_uint, V, usize),
    (): (),
) -> Status {
    on(component, |_| match slice(references, count).first() {
        Some(first) => Err(Refusal::Reference(*first, "String")),
        None => Ok(Status::Ok),
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2DoStep(
    component: *mut c_void,
    at_s: c_double,
    step_s: c_double,
    _no_set_state_prior: c_int,
) -> Status {
    on(component, |instance| {
        let warning = instance.simulation.step(at_s, step_s)?;
        Ok(warning.map_or(Status::Ok, |warning| {
            instance.log.write(Status::Warning, &warning);
            Status::Warning
        }))
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetFMUstate(component: *mut c_void, state: *mut *mut c_void) -> Status {
    on(component, |instance| {
        // SAFETY: the importer's variable for a state (see the head).
        let Some(state) = (unsafe { state.as_mut() }) else { return Ok(null_state(instance)) };
        let kept = instance.simulation.clone();
        // SAFETY: null, or a state of this FMU that was not freed.
        match unsafe { state.cast::<Simulation>().as_mut() } {
            Some(before) => *before = kept,
            None => *state = Box::into_raw(Box::new(kept)).cast(),
        }
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetFMUstate(component: *mut c_void, state: *mut c_void) -> Status {
    on(component, |instance| {
        // SAFETY: a state of this FMU that was not freed.
        let Some(kept) = (unsafe { state.cast::<Simulation>().as_ref() }) else {
            return Ok(null_state(instance));
        };
        instance.simulation = kept.clone();
        Ok(Status::Ok)
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2FreeFMUstate(component: *mut c_void, state: *mut *mut c_void) -> Status {
    on(component, |_| {
        // SAFETY: the importer's variable for a state.
        let Some(state) = (unsafe { state.as_mut() }).filter(|state| !state.is_null()) else {
            return Ok(Status::Ok);
        };
        // SAFETY: made by `fmi2GetFMUstate`, and freed once: the variable is null afterwards.
        drop(unsafe { Box::from_raw(state.cast::<Simulation>()) });
        *state = null_mut();
        Ok(Status::Ok)
    })
}

fn null_state(instance: &Component) -> Status {
    instance.log.write(Status::Error, "a null pointer in place of an FMU state");
    Status::Error
}

#[cfg(test)]
mod tests;
