//! Algorithms from shared libraries: whatever a library says of itself is taken as a good algorithm or refused.
//!
//! The library is a real one (`plugin/library.c`) that is opened, asked and run as every other; its descriptor is cut out of the
//! fuzzer's bytes. In this process, as the trial's child does it.
#![no_main]

use plugin;
use libfuzzer_sys::fuzz_target;
use libloading::Library;
use std::path::Path;
use std::sync::OnceLock;

type Set = unsafe extern "C" fn(*const u8, usize);

const LIBRARY: &str = env!("FUZZED_LIBRARY");

fuzz_target!(|bytes: &[u8]| {
    static OPENED: OnceLock<Library> = OnceLock::new();
    // SAFETY: our own library, without initialisers.
    let library = OPENED.get_or_init(|| unsafe { Library::new(LIBRARY) }.expect("build.rs has made it"));
    // SAFETY: it has this type there.
    let set = unsafe { library.get::<Set>(b"fuzz_set\0") }.expect("it has it");
    // SAFETY: it reads as many bytes as it is given.
    unsafe { set(bytes.as_ptr(), bytes.len()) };
    match plugin::probe(Path::new(LIBRARY)) {
        Ok(description) => {
            for parameter in &description.parameters {
                assert!(parameter.least < parameter.most && parameter.check(parameter.default).is_ok());
            }
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
