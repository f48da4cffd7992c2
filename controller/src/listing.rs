//! The list of all algorithms and of all parameters, for people.

use crate::algorithm::Quantity;
use crate::algorithms::SHIPPED;
use crate::chains::{force, matching, settled};
use crate::parameters::Parameter;
use crate::{post_controller, pre_controller};
use protocol::exit::Exit;
use std::io::{self, Write};

/// Prints the list.
#[must_use]
pub fn print() -> Exit {
    // A closed pipe is the reader's wish.
    let _ = write(&mut io::stdout().lock());
    Exit::Good
}

fn write(out: &mut impl Write) -> io::Result<()> {
    for kind in SHIPPED {
        let controls = match kind.controls {
            Quantity::Position => "position",
            Quantity::Force => "force",
        };
        writeln!(out, "[algorithm] name = \"{}\"   controls {controls}\n{}", kind.name, kind.about)?;
        table(out, kind.parameters)?;
    }
    let tasks: [(&str, &[Parameter]); 5] = [
        ("pre-controller", &pre_controller::PARAMETERS),
        ("post-controller", &post_controller::PARAMETERS),
        (force::TABLE, force::PARAMETERS),
        (matching::TABLE, matching::PARAMETERS),
        (settled::TABLE, settled::PARAMETERS),
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
