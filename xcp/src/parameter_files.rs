//! Work of the slaves outside the 1 ms path: files of parameter sets, and messages. It runs in the recorder's thread.
//!
//! A set is stored to `controller-drive-parameters.toml` or `controller-load-parameters.toml` of the run's folder, and loaded
//! from there; no other file is read or written on a client's behalf.

use axis_control::node::Change;
use axis_control::parameter_set;
use axis_control::program::Variable;
use crossbeam_channel::{Receiver, Sender};
use nominal::Axis;
use std::path::{Path, PathBuf};

/// A port's request or report to the worker; `cycle` is the rig's cycle that was answered last.
#[derive(Debug)]
pub enum PortMessage {
    /// A client changed a parameter.
    Changed {
        /// Axis of the port.
        axis: Axis,
        /// The rig's cycle.
        cycle: u64,
        /// Place in the list of variables.
        place: usize,
        /// New value, in the unit of the variable.
        value: f64,
    },
    /// A client unlocked writing.
    Unlocked {
        /// Axis of the port.
        axis: Axis,
        /// The rig's cycle.
        cycle: u64,
    },
    /// A client sent a wrong key.
    WrongKey {
        /// Axis of the port.
        axis: Axis,
        /// The rig's cycle.
        cycle: u64,
    },
    /// A client asks to store the parameters.
    Store {
        /// Axis of the port.
        axis: Axis,
        /// Their values, in the order of the variables.
        values: Vec<f64>,
    },
    /// A client asks to load the stored parameters.
    Load {
        /// Axis of the port.
        axis: Axis,
    },
}

/// A copy of the parameters that the worker returns to its port.
#[derive(Debug)]
pub struct ParameterCopy {
    /// The values; the port reuses the allocation.
    pub values: Vec<f64>,
    /// Whether the file was written.
    pub stored: bool,
}

/// An axis with an XCP port, as the worker needs it.
pub struct AxisParameters {
    /// Axis of the port.
    pub axis: Axis,
    /// Variables of its program, in the program's order.
    pub variables: Vec<Variable>,
    /// Their values at the start.
    pub values: Vec<f64>,
    /// Queue that returns copies of the parameters to the port.
    pub returned: Sender<ParameterCopy>,
}

/// Stores and loads parameter sets for the ports, and reports their messages; it runs outside the 1 ms path.
pub struct ParameterFileWorker {
    messages: Receiver<PortMessage>,
    axes: Vec<AxisParameters>,
    changes: Sender<Change>,
    folder: PathBuf,
}

impl ParameterFileWorker {
    /// A worker for these axes. `folder` is the run's folder; loaded values go to `changes`.
    pub fn new(
        messages: Receiver<PortMessage>,
        axes: Vec<AxisParameters>,
        changes: Sender<Change>,
        folder: &Path,
    ) -> Self {
        Self { messages, axes, changes, folder: folder.into() }
    }

    /// Processes the messages that wait; the recorder's thread calls it in each of its rounds.
    pub fn poll(&mut self) {
        let messages = self.messages.clone();
        for message in messages.try_iter() {
            match message {
                PortMessage::Changed { axis, cycle, place, value } => {
                    let name = self
                        .parameters_of(axis)
                        .and_then(|axis_parameters| axis_parameters.variables.get(place))
                        .map(|found| &found.name);
                    let name = name.map_or("?", String::as_str);
                    protocol::say!(
                        "controller: cycle {cycle}: {}.{name} is {value} now, by XCP",
                        axis.name()
                    );
                }
                PortMessage::Unlocked { axis, cycle } => {
                    protocol::say!("controller: cycle {cycle}: XCP of the {} axis is unlocked", axis.name());
                }
                PortMessage::WrongKey { axis, cycle } => {
                    protocol::say!(
                        "controller: cycle {cycle}: a wrong key to XCP of the {} axis",
                        axis.name()
                    );
                }
                PortMessage::Store { axis, values } => self.store(axis, values),
                PortMessage::Load { axis } => match self.load(axis) {
                    Ok(count) => {
                        protocol::say!(
                            "controller: {count} parameters of the {} axis loaded, by XCP",
                            axis.name()
                        )
                    }
                    Err(problem) => protocol::say!("controller: {problem}; the numbers in use stay"),
                },
            }
        }
    }

    fn parameters_of(&self, axis: Axis) -> Option<&AxisParameters> {
        self.axes.iter().find(|axis_parameters| axis_parameters.axis == axis)
    }

    /// The file that stores a set.
    fn path(&self, axis: Axis) -> PathBuf {
        self.folder.join(format!("controller-{}-parameters.toml", axis.name()))
    }

    fn store(&self, axis: Axis, values: Vec<f64>) {
        let Some(axis_parameters) = self.parameters_of(axis) else { return };
        let path = self.path(axis);
        let text = parameter_set::text(axis, &axis_parameters.variables, &values);
        // Written to a temporary file and renamed, so that no reader sees half a set.
        let part = path.with_extension("toml.part");
        let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, &path));
        match &written {
            Ok(()) => {
                protocol::say!(
                    "controller: parameters of the {} axis stored in {}",
                    axis.name(),
                    path.display()
                )
            }
            Err(error) => protocol::say!("controller: cannot write {}: {error}", path.display()),
        }
        // A port that has ended needs no copy.
        let _ = axis_parameters.returned.send(ParameterCopy { values, stored: written.is_ok() });
    }

    /// Queues all values of the stored set and returns their number; on an error it queues none, except where the queue is full.
    fn load(&self, axis: Axis) -> Result<usize, String> {
        let Some(axis_parameters) = self.parameters_of(axis) else { return Ok(0) };
        let settings = parameter_set::read(&self.path(axis)).map_err(|error| error.to_string())?;
        let mut changes = Vec::new();
        for setting in settings {
            let reported = |problem: String| format!("{}{}.{problem}", setting.place, axis.name());
            let place = axis_parameters
                .variables
                .iter()
                .position(|variable| setting.axis == axis && variable.name == setting.name)
                .ok_or_else(|| reported(format!("{}: no such variable here", setting.name)))?;
            let parameter = &axis_parameters.variables[place].parameter;
            if parameter.at_start_only && setting.value == axis_parameters.values[place] {
                continue;
            }
            let value = parameter.check_change(setting.value).map_err(|error| reported(error.to_string()))?;
            changes.push(Change { axis, place, value });
        }
        let count = changes.len();
        for change in changes {
            self.changes.try_send(change).map_err(|_| "too many changes at a time".to_owned())?;
        }
        Ok(count)
    }
}
