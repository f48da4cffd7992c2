//! The C interface as a hostile importer calls it: null, strangers, a bug behind it.

use super::*;
use std::sync::Mutex;

static LOGGED: Mutex<Vec<(Status, String)>> = Mutex::new(Vec::new());

/// An importer's logger. Rust cannot define one with variable arguments; on this machine's C interface the named ones are
/// passed the same way.
unsafe extern "C" fn log(
    _environment: *mut c_void,
    _name: *const c_char,
    status: Status,
    _category: *const c_char,
    message: *const c_char,
) {
    LOGGED.lock().unwrap().push((status, text(message).unwrap_or_default()));
}

type NonVariadicLogger =
    unsafe extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char);

fn callbacks() -> Callbacks {
    // SAFETY: no variable argument is passed, and the named ones travel alike.
    let logger = unsafe { std::mem::transmute::<NonVariadicLogger, Logger>(log) };
    let null = std::ptr::null();
    Callbacks {
        logger: Some(logger),
        allocate_memory: null,
        free_memory: null,
        step_finished: null,
        environment: null_mut(),
    }
}

fn component() -> *mut c_void {
    let simulation = Simulation::new(RigParameters::baseline()).unwrap();
    let Callbacks { logger, environment, .. } = callbacks();
    let log = ImporterLog { name: c"own".into(), logger, environment };
    Box::into_raw(Box::new(Component { simulation, log, dead: false })).cast()
}

#[test]
fn null_is_an_error_and_no_crash() {
    assert_eq!(fmi2DoStep(null_mut(), 0.0, 1e-3, 1), Status::Error);
    fmi2FreeInstance(null_mut());
    let instance = component();
    assert_eq!(fmi2GetReal(instance, std::ptr::null(), 1, null_mut()), Status::Error);
    assert_eq!(fmi2GetReal(instance, std::ptr::null(), 0, null_mut()), Status::Ok);
    assert_eq!(fmi2SetFMUstate(instance, null_mut()), Status::Error);
    assert_eq!(fmi2GetString(instance, [0].as_ptr(), 1, null_mut()), Status::Error);
    fmi2FreeInstance(instance);
    let nothing = std::ptr::null();
    assert!(fmi2Instantiate(nothing, CO_SIMULATION, nothing, nothing, std::ptr::null(), 0, 0).is_null());
    let callbacks = callbacks();
    assert!(fmi2Instantiate(nothing, CO_SIMULATION, nothing, nothing, &callbacks, 0, 0).is_null());
    assert!(
        LOGGED.lock().unwrap().iter().any(|(_, message)| message.contains("fmuResourceLocation is missing"))
    );
}

#[test]
fn a_panic_kills_the_instance_and_nothing_else() {
    let instance = component();
    assert_eq!(on(instance, |_| panic!("a bug")), Status::Fatal);
    assert_eq!(fmi2EnterInitializationMode(instance), Status::Fatal);
    fmi2FreeInstance(instance);
}

#[test]
fn refusals_reach_the_logger_and_percent_signs_are_no_formats() {
    let instance = component();
    assert_eq!(on(instance, |_| Err(Refusal::Time("100 % of it".into()))), Status::Error);
    let expected = (Status::Error, "100 %% of it".to_owned());
    assert!(LOGGED.lock().unwrap().contains(&expected));
    fmi2FreeInstance(instance);
}

#[test]
fn a_state_is_made_overwritten_and_freed_once() {
    let instance = component();
    let mut state = null_mut();
    assert_eq!(fmi2GetFMUstate(instance, &mut state), Status::Ok);
    let place = state;
    assert_eq!(
        (fmi2GetFMUstate(instance, &mut state), state),
        (Status::Ok, place),
        "overwritten, not leaked"
    );
    assert_eq!(fmi2SetFMUstate(instance, state), Status::Ok);
    for _ in 0..2 {
        assert_eq!((fmi2FreeFMUstate(instance, &mut state), state), (Status::Ok, null_mut()));
    }
    fmi2FreeInstance(instance);
}

#[test]
fn a_resource_location_is_a_file_uri_with_or_without_authority() {
    for (uri, path) in [
        ("file:///tmp/a%20b/resources", Some("/tmp/a b/resources")),
        ("file:/tmp/r", Some("/tmp/r")),
        ("file://localhost/tmp/r", Some("/tmp/r")),
        ("/tmp/r", None),
        ("file:r", None),
        ("file:///%zz", None),
        ("file:///tmp/%ff", None),
    ] {
        assert_eq!(folder_of(uri), path.map(PathBuf::from), "{uri}");
    }
    assert_eq!(folder_of("file:///tmp/100%"), Some("/tmp/100%".into()));
}
