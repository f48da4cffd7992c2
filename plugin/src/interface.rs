//! The C interface's layout: the structures of `include/airbench_algorithm.h`, field by field.
//!
//! The header is the truth for authors of libraries; a test has the C compiler print its sizes and offsets and compares
//! them with those here. `airbench_ready` is [`AlgorithmInput`] itself.

use algorithms::algorithm::AlgorithmInput;
use nominal::RigParameters;
use std::ffi::{c_char, c_void};

/// `AIRBENCH_INTERFACE_VERSION`.
pub const INTERFACE_VERSION: u32 = 1;
/// `AIRBENCH_MOST_PARAMETERS`.
pub(super) const MOST_PARAMETERS: u32 = 64;
/// `AIRBENCH_LONGEST_TEXT`, bytes.
pub(super) const LONGEST_TEXT: usize = 255;
/// `AIRBENCH_POSITION`.
pub(super) const POSITION: u32 = 1;
/// `AIRBENCH_FORCE`.
pub(super) const FORCE: u32 = 2;

// A field that is added to what every algorithm gets changes the interface: then its version grows and the header follows.
const _: () = assert!(size_of::<AlgorithmInput>() == 14 * size_of::<f64>() && INTERFACE_VERSION == 1);

/// `airbench_algorithm_entry`; None is a symbol whose address is 0.
pub(super) type Entry = Option<unsafe extern "C" fn(u32) -> *const Descriptor>;

/// `struct airbench_rig`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NominalRig {
    stroke_m: f64,
    piston_area_m2: f64,
    annulus_area_m2: f64,
    dead_volume_m3: f64,
    drive_mass_kg: f64,
    carriage_mass_kg: f64,
    load_mass_kg: f64,
    added_mass_limit_kg: f64,
    break_away_force_n: f64,
    sliding_force_n: f64,
    viscous_n_s_per_m: f64,
    supply_pressure_pa: f64,
    exhaust_pressure_pa: f64,
    atmospheric_pressure_pa: f64,
    normal_pressure_pa: f64,
    gas_temperature_k: f64,
}

impl From<&RigParameters> for NominalRig {
    fn from(rig: &RigParameters) -> Self {
        let (supply, cylinder, mass, friction) = (rig.supply(), rig.cylinder(), rig.mass(), rig.friction());
        Self {
            stroke_m: cylinder.stroke_m,
            piston_area_m2: cylinder.piston_area_m2,
            annulus_area_m2: cylinder.annulus_area_m2,
            dead_volume_m3: cylinder.dead_volume_m3,
            drive_mass_kg: mass.drive_kg,
            carriage_mass_kg: mass.carriage_kg,
            load_mass_kg: mass.load_kg,
            added_mass_limit_kg: mass.added_limit_kg,
            break_away_force_n: friction.break_away_force_n,
            sliding_force_n: friction.sliding_force_n,
            viscous_n_s_per_m: friction.viscous_n_s_per_m,
            supply_pressure_pa: supply.pressure_pa,
            exhaust_pressure_pa: supply.exhaust_pressure_pa,
            atmospheric_pressure_pa: supply.atmospheric_pressure_pa,
            normal_pressure_pa: rig.gas().normal_pressure_pa,
            gas_temperature_k: rig.gas().temperature_k,
        }
    }
}

/// `struct airbench_parameter`.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct ParameterEntry {
    pub(super) name: *const c_char,
    pub(super) unit: *const c_char,
    pub(super) least: f64,
    pub(super) most: f64,
    pub(super) default_value: f64,
    pub(super) meaning: *const c_char,
}

/// `struct airbench_algorithm`; a function that is None is NULL in the library.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct Descriptor {
    pub(super) interface_version: u32,
    pub(super) struct_size: u32,
    pub(super) name: *const c_char,
    pub(super) about: *const c_char,
    pub(super) controls: u32,
    pub(super) parameter_count: u32,
    pub(super) parameters: *const ParameterEntry,
    pub(super) create: Option<Create>,
    pub(super) destroy: Option<Destroy>,
    pub(super) reset: Option<Reset>,
    pub(super) step: Option<Step>,
}

pub(super) type Create = unsafe extern "C" fn(*const NominalRig) -> *mut c_void;
pub(super) type Destroy = unsafe extern "C" fn(*mut c_void);
pub(super) type Reset = unsafe extern "C" fn(*mut c_void, *const AlgorithmInput, *const f64);
pub(super) type Step = unsafe extern "C" fn(*mut c_void, *const AlgorithmInput, *const f64) -> f64;

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;
    use std::process::Command;

    /// A line `struct airbench_ready position_m 8` for the structure's size and each field, and the C program that prints it.
    macro_rules! layout {
        ($rust:ident, $c:literal: $($field:ident)*) => {{
            let fields = [$((stringify!($field), offset_of!($rust, $field))),*];
            let reported = [("size", size_of::<$rust>())].into_iter().chain(fields);
            let lines: String = reported.map(|(name, bytes)| format!("{} {name} {bytes}\n", $c)).collect();
            let mut program = format!("printf(\"{} size %zu\\n\", sizeof(struct {}));\n", $c, $c);
            for (name, _) in fields {
                program += &format!("printf(\"{} {name} %zu\\n\", offsetof(struct {}, {name}));\n", $c, $c);
            }
            (fields.len(), lines, program)
        }};
    }

    #[test]
    fn the_header_lays_everything_out_as_rust_does() {
        let layouts = [
            layout!(AlgorithmInput, "airbench_ready": period_s position_m velocity_m_per_s acceleration_m_per_s2 force_n
                pressure_a_pa pressure_b_pa supply_pressure_pa set_position_m set_velocity_m_per_s
                set_acceleration_m_per_s2 set_force_n set_force_rate_n_per_s applied_velocity_m_per_s),
            layout!(NominalRig, "airbench_rig": stroke_m piston_area_m2 annulus_area_m2 dead_volume_m3 drive_mass_kg
                carriage_mass_kg load_mass_kg added_mass_limit_kg break_away_force_n sliding_force_n viscous_n_s_per_m
                supply_pressure_pa exhaust_pressure_pa atmospheric_pressure_pa normal_pressure_pa gas_temperature_k),
            layout!(ParameterEntry, "airbench_parameter": name unit least most default_value meaning),
            layout!(Descriptor, "airbench_algorithm": interface_version struct_size name about controls
                parameter_count parameters create destroy reset step),
        ];
        assert_eq!(
            layouts[0].0 * size_of::<f64>(),
            size_of::<AlgorithmInput>(),
            "every field of AlgorithmInput stands above"
        );
        assert_eq!(layouts[1].0 * size_of::<f64>(), size_of::<NominalRig>(), "every field of the rig");

        let folder = tempfile::tempdir().expect("a folder");
        let (source, program) = (folder.path().join("layout.c"), folder.path().join("layout"));
        let constants = [
            ("INTERFACE_VERSION", INTERFACE_VERSION as usize),
            ("MOST_PARAMETERS", MOST_PARAMETERS as usize),
            ("LONGEST_TEXT", LONGEST_TEXT),
            ("POSITION", POSITION as usize),
            ("FORCE", FORCE as usize),
        ];
        let mut text =
            "#include \"airbench_algorithm.h\"\n#include <stddef.h>\n#include <stdio.h>\nint main(void) {\n"
                .to_owned();
        let mut expected = String::new();
        for (name, value) in constants {
            text += &format!("printf(\"{name} %u\\n\", AIRBENCH_{name});\n");
            expected += &format!("{name} {value}\n");
        }
        for (_, lines, prints) in layouts {
            expected += &lines;
            text += &prints;
        }
        std::fs::write(&source, text + "return 0; }\n").expect("writes");
        let include = concat!("-I", env!("CARGO_MANIFEST_DIR"), "/../controller/include");
        let mut compiler = Command::new("cc");
        let compiled = compiler.args(["-std=c11", "-Wall", "-Wextra", "-Werror", include, "-o"]);
        assert!(compiled.arg(&program).arg(&source).status().expect("a C compiler").success());
        let output = Command::new(&program).output().expect("runs");
        assert_eq!(String::from_utf8(output.stdout).expect("text"), expected);
    }
}
