//! The A2L file, read again: it says of every number what its table says, and where the slave has it.

use super::*;
use crate::alone;
use crate::image::Image;
use algorithms::SHIPPED;
use axis_control::program::Program;
use axis_control::program::file::Source;
use nominal::RigParameters;

fn program(axis: Axis, algorithm: &str) -> Program {
    let text = format!(
        "title = \"t\"\n[algorithm]\nname = \"{algorithm}\"\n[giving-way]\nname = \"force-manual\"\n"
    );
    let source = Source { path: "p.toml".into(), title: "t".into(), text };
    source.program(axis, &RigParameters::baseline(), false).unwrap()
}

fn read(text: &str) -> Module {
    let (file, warnings) = a2lfile::load_from_string(text, None, true).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    file.project.module[0].clone()
}

#[test]
fn the_file_of_every_shipped_program_says_what_the_tables_say() {
    for kind in SHIPPED {
        for axis in Axis::ALL {
            let program = program(axis, kind.name);
            let variables = program.variables();
            let title = "with \"quotes\" and\na second line";
            let module = read(&text(&AxisDescription { axis, title, variables }).unwrap());
            let image = Image::new(Vec::new(), variables.to_vec(), program.values());
            for (variable, value) in variables.iter().zip(program.values()) {
                let name = format!("{}.{}", axis.name(), variable.name.replace('-', "_"));
                let made = module.characteristic.iter().find(|made| made.get_name() == name).unwrap();
                let parameter = &variable.parameter;
                assert_eq!([made.lower_limit, made.upper_limit], [parameter.least, parameter.most], "{name}");
                assert_eq!(made.read_only.is_some(), parameter.at_start_only, "{name}");
                let mut bytes = [0; 8];
                image.read(made.address, &mut bytes).unwrap();
                assert_eq!(f64::from_le_bytes(bytes), *value, "{name} at its address");
            }
            for (signal, at) in SIGNALS.iter().zip(0..) {
                let name = format!("{}.{}", axis.name(), signal.about.name);
                let made = module.measurement.iter().find(|made| made.get_name() == name).unwrap();
                assert_eq!(made.ecu_address.as_ref().unwrap().address, SIGNAL + NARROW * at, "{name}");
                assert_eq!(made.datatype, data_type(signal.format), "{name}");
            }
        }
    }
}

#[test]
fn the_identification_is_another_when_a_table_is() {
    let program = program(Axis::Drive, "position-p");
    let of = |axis, variables: &[Variable]| epk(&AxisDescription { axis, title: "t", variables });
    let same = of(Axis::Drive, program.variables());
    assert_eq!(of(Axis::Drive, program.variables()), same);
    assert_ne!(of(Axis::Load, program.variables()), same);
    assert_ne!(of(Axis::Drive, &program.variables()[1..]), same);
    let mut other = program.variables().to_vec();
    other[0].parameter.most += 1.0;
    assert_ne!(of(Axis::Drive, &other), same);
}

#[test]
fn the_slave_hands_out_what_the_file_says_of_it() {
    let slave = alone::slave(None);
    let description = &slave.image.description;
    let file = String::from_utf8(description.to_vec()).unwrap();
    let module = read(&file[file.find("ASAP2_VERSION").unwrap()..]);
    let about = module.mod_par.unwrap();
    let address = about.addr_epk[0].address;
    let epk = about.epk.unwrap().identifier;
    let mut bytes = vec![0; epk.len()];
    slave.image.read(address, &mut bytes).unwrap();
    assert_eq!(bytes, epk.as_bytes());
}
