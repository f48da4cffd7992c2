//! The foreign side: opening a library, reading its descriptor, calling its functions. All unsafe code of the controller.
//!
//! Assumptions of the `// SAFETY:` comments, which cannot be proved here:
//! - *The header.* A library promises what `airbench_algorithm.h` says: texts end in a zero, tables are as long as they say,
//!   functions take these arguments and keep no pointer. Nobody can check that from outside.
//! - *The trial.* So a library is opened in this process only after a child has opened, asked and run it (`child.rs`);
//!   what a child does not survive never gets here. A library that behaves differently the second time is beyond it.
//! - *No unloading.* A library stays until the process ends, so that its texts, tables and functions live as long
//!   as anything here; also it may have started threads or registered handlers.
#![allow(unsafe_code)] // foreign functions and pointers; nothing else in the controller is

use crate::check;
use crate::interface::{
    Create, Descriptor, Destroy, Entry, INTERFACE_VERSION, LONGEST_TEXT, MOST_PARAMETERS, NominalRig,
    ParameterEntry, Reset, Step,
};
use crate::refusal::RefusalReason;
use crate::{Description, StageReport};
use algorithms::algorithm::AlgorithmInput;
use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
use settings::parameters::Parameter;
use std::error::Error;
use std::ffi::{c_char, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;
use std::ptr::NonNull;

const ENTRY: &[u8] = b"airbench_algorithm_entry\0";

pub(super) struct CheckedLibrary {
    pub(super) description: Description,
    create: Create,
    functions: Functions,
}

/// Functions of the library that an instance calls.
#[derive(Clone, Copy)]
struct Functions {
    destroy: Destroy,
    reset: Reset,
    step: Step,
}

/// An instance of a foreign algorithm.
pub(super) struct Instance {
    state: NonNull<c_void>,
    functions: Functions,
    /// Length of the slices that its functions read.
    parameter_count: usize,
}

// SAFETY: the header says that an instance may be used by one thread after the other; `Instance` is neither Copy nor
// Sync, and its functions take it by `&mut`, so never by two at a time.
unsafe impl Send for Instance {}

/// Opens the library at `path`, which must contain a `/`, and reads what it offers.
pub(super) fn open(path: &Path, report_stage: StageReport<'_>) -> Result<CheckedLibrary, RefusalReason> {
    report_stage("loading it");
    // SAFETY: its initialisers run here; a child has run them before (the trial). RTLD_NOW: a function that is missing
    // shows now and not in a step.
    let library = unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map_err(not_loaded)?;
    let library = ManuallyDrop::new(library);
    check::arithmetic()?;
    // SAFETY: the symbol has this type by the header; an address of 0 is None.
    let entry = unsafe { library.get::<Entry>(ENTRY) }
        .ok()
        .and_then(|symbol| *symbol)
        .ok_or(RefusalReason::NoEntry)?;
    report_stage("airbench_algorithm_entry");
    // SAFETY: the header's signature; tried by the child.
    let descriptor = unsafe { entry(INTERFACE_VERSION) };
    // SAFETY: what the entry returned.
    let descriptor = unsafe { read_descriptor(descriptor) }?;
    // SAFETY: version and size are those of the header, so its fields mean what the header says.
    unsafe { check_descriptor(&descriptor) }
}

/// dlopen's own words, without those of the crate around them.
fn not_loaded(error: libloading::Error) -> RefusalReason {
    RefusalReason::NotLoaded(error.source().map_or_else(|| error.to_string(), ToString::to_string))
}

/// A copy of the descriptor, once its version and size are right.
///
/// # Safety
/// `pointer` is NULL or points to two 32-bit numbers, version and size, and to a descriptor if they are right.
unsafe fn read_descriptor(pointer: *const Descriptor) -> Result<Descriptor, RefusalReason> {
    if pointer.is_null() {
        return Err(RefusalReason::NoDescriptor);
    }
    if !pointer.is_aligned() {
        return Err(RefusalReason::BadAddress("descriptor"));
    }
    // SAFETY: every version begins with these two numbers, and the caller says that they are there.
    let [version, size] = unsafe { pointer.cast::<[u32; 2]>().read() };
    if version != INTERFACE_VERSION {
        return Err(RefusalReason::Version(version));
    }
    if size as usize != size_of::<Descriptor>() {
        return Err(RefusalReason::Size(size));
    }
    // SAFETY: not NULL, aligned, and of the size that it says itself.
    Ok(unsafe { pointer.read() })
}

/// Everything of a descriptor, checked.
///
/// # Safety
/// The pointers of `descriptor` are NULL or what the header says.
unsafe fn check_descriptor(descriptor: &Descriptor) -> Result<CheckedLibrary, RefusalReason> {
    let null = |what: &str| RefusalReason::Null(what.to_owned());
    let create = descriptor.create.ok_or_else(|| null("create"))?;
    let functions = Functions {
        destroy: descriptor.destroy.ok_or_else(|| null("destroy"))?,
        reset: descriptor.reset.ok_or_else(|| null("reset"))?,
        step: descriptor.step.ok_or_else(|| null("step"))?,
    };
    // SAFETY: texts of the descriptor, by the caller's promise.
    let (name, about) = unsafe { (text(descriptor.name, "its name")?, text(descriptor.about, "about")?) };
    if name.trim().is_empty() {
        return Err(RefusalReason::text("its name", "is empty; give it one"));
    }
    let controls = check::quantity(descriptor.controls)?;
    // SAFETY: the table of the descriptor, by the caller's promise.
    let parameters = unsafe { read_parameters(descriptor) }?;
    check::table(&parameters)?;
    Ok(CheckedLibrary { description: Description { name, about, controls, parameters }, create, functions })
}

/// The parameters in owned texts.
///
/// # Safety
/// As for [`check_descriptor`].
unsafe fn read_parameters(descriptor: &Descriptor) -> Result<Vec<Parameter>, RefusalReason> {
    let (table, count) = (descriptor.parameters, descriptor.parameter_count);
    if count > MOST_PARAMETERS {
        return Err(RefusalReason::TooMany(count));
    }
    if count > 0 && table.is_null() {
        return Err(RefusalReason::Null("parameters".to_owned()));
    }
    if !table.is_aligned() {
        return Err(RefusalReason::BadAddress("table of parameters"));
    }
    let read = |place: usize| {
        let what = |part: &str| format!("parameter {}'s {part}", place + 1);
        // SAFETY: not NULL, aligned, and the library says that it has so many entries; their texts are texts.
        unsafe {
            let ParameterEntry { name, unit, least, most, default_value, meaning } = table.add(place).read();
            Ok(Parameter {
                name: text(name, &what("name"))?.into(),
                unit: text(unit, &what("unit"))?.into(),
                least,
                most,
                default: default_value,
                meaning: text(meaning, &what("meaning"))?.into(),
                whole: false,
                at_start_only: false,
            })
        }
    };
    (0..count as usize).map(read).collect()
}

/// An owned copy of a foreign text.
///
/// # Safety
/// `pointer` is NULL or points to bytes up to a zero, or to more than [`LONGEST_TEXT`] of them.
unsafe fn text(pointer: *const c_char, what: &str) -> Result<String, RefusalReason> {
    if pointer.is_null() {
        return Err(RefusalReason::Null(what.to_owned()));
    }
    let mut bytes = Vec::new();
    for place in 0..=LONGEST_TEXT {
        // SAFETY: no byte before this one was the zero, so it is still part of the text.
        match unsafe { pointer.add(place).cast::<u8>().read() } {
            0 => return String::from_utf8(bytes).map_err(|_| RefusalReason::text(what, "is not UTF-8")),
            byte => bytes.push(byte),
        }
    }
    Err(RefusalReason::too_long(what))
}

impl Instance {
    /// Makes an instance for a rig of these nominal numbers.
    pub(super) fn create(library: &CheckedLibrary, rig: &NominalRig) -> Result<Self, RefusalReason> {
        // SAFETY: the header's signature; `rig` lives until it returns, and may not be kept.
        let state = unsafe { (library.create)(rig) };
        let state = NonNull::new(state).ok_or(RefusalReason::NotCreated)?;
        let parameter_count = library.description.parameters.len();
        Ok(Self { state, functions: library.functions, parameter_count })
    }

    /// Begins anew.
    ///
    /// # Panics
    /// When `parameters` are not as many as its table has: the function would read beyond them.
    pub(super) fn reset(&mut self, input: &AlgorithmInput, parameters: &[f64]) {
        assert_eq!(parameters.len(), self.parameter_count, "a value for each parameter of the table");
        // SAFETY: the header's signature; `state` came from create and is not destroyed yet; as many values as the table.
        unsafe { (self.functions.reset)(self.state.as_ptr(), input, parameters.as_ptr()) }
    }

    /// The wanted velocity of the axis's rod, m/s, unchecked.
    ///
    /// # Panics
    /// As [`Instance::reset`].
    pub(super) fn step(&mut self, input: &AlgorithmInput, parameters: &[f64]) -> f64 {
        assert_eq!(parameters.len(), self.parameter_count, "a value for each parameter of the table");
        // SAFETY: as in `reset`.
        unsafe { (self.functions.step)(self.state.as_ptr(), input, parameters.as_ptr()) }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: `state` came from create, and is used by nobody after this.
        unsafe { (self.functions.destroy)(self.state.as_ptr()) }
    }
}
