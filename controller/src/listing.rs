//! Lists of all algorithms and parameters.

use crate::cli::{A2lArguments, OneAxis};
use crate::run::RunError;
use algorithms::SHIPPED;
use axis_control::axis::AxisController;
use axis_control::chains::{force, matching, settled};
use axis_control::setup::{FileArguments, Inputs, Mode};
use axis_control::{parameter_set, post_controller, pre_controller};
use nominal::Axis;
use protocol::exit::Exit;
use settings::parameters::Parameter;
use std::io::{self, Write};
use xcp::a2l::{self, AxisDescription};

pub(crate) fn print() -> Exit {
    // A closed pipe, as of `| head`, is no error.
    let _ = write(&mut io::stdout().lock());
    Exit::Good
}

/// Prints the parameters of the axes of the experiment, as a parameter set.
pub(crate) fn print_parameters(files: &FileArguments) -> Result<Exit, RunError> {
    let inputs = Inputs::read(files)?;
    let mut texts = Vec::new();
    for axis in Axis::ALL.into_iter().filter(|axis| inputs.programs[axis.index()].is_some()) {
        let controller = controller(&inputs, axis)?;
        let program = &controller.program;
        texts.push(parameter_set::text(axis, program.variables(), program.values()));
    }
    // A closed pipe, as of `| head`, is no error.
    let _ = write!(io::stdout(), "{}", texts.join("\n"));
    Ok(Exit::Good)
}

pub(crate) fn print_a2l(arguments: &A2lArguments) -> Result<Exit, RunError> {
    let inputs = Inputs::read(&arguments.files)?;
    let axis = match arguments.axis {
        OneAxis::Drive => Axis::Drive,
        OneAxis::Load => Axis::Load,
    };
    let controller = controller(&inputs, axis)?;
    let described = AxisDescription {
        axis,
        title: &inputs.program_title(axis),
        variables: controller.program.variables(),
    };
    let text = a2l::text(&described).map_err(RunError::input)?;
    let _ = writeln!(io::stdout(), "{text}");
    Ok(Exit::Good)
}

fn controller(inputs: &Inputs, axis: Axis) -> Result<AxisController, RunError> {
    Ok(inputs.controller(axis, Mode { partner_needed: false, real_time: false, forever: false })?)
}

fn write(out: &mut impl Write) -> io::Result<()> {
    for kind in SHIPPED {
        let controls = kind.controls.name();
        writeln!(out, "[algorithm] name = \"{}\"   controls {controls}\n{}", kind.name, kind.about)?;
        table(out, kind.parameters)?;
    }
    let tasks: [(&str, &[Parameter]); 5] = [
        ("pre-controller", pre_controller::Parameters::TABLE),
        ("post-controller", post_controller::Parameters::TABLE),
        (force::TABLE, force::Parameters::TABLE),
        (matching::TABLE, matching::Parameters::TABLE),
        (settled::TABLE, settled::Bounds::TABLE),
    ];
    for (name, parameters) in tasks {
        writeln!(out, "[{name}]")?;
        table(out, parameters)?;
    }
    Ok(())
}

fn table(out: &mut impl Write, parameters: &[Parameter]) -> io::Result<()> {
    for Parameter { name, unit, least, most, default, meaning, .. } in parameters {
        writeln!(out, "  {name:28} {unit:9} {least:8} to {most:<8} default {default:<8} {meaning}")?;
    }
    writeln!(out)
}
