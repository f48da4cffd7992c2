//! What bounds, figures and pictures take of an experiment file. The controllers check the rest of it.

use runlog::Axis;
use std::str::FromStr;
use toml::{Table, Value};

/// An experiment file; empty without one. A key of another type than it should have is as good as none.
#[derive(Clone, Debug, Default)]
pub struct Experiment(Table);

impl FromStr for Experiment {
    type Err = toml::de::Error;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        text.parse().map(Self)
    }
}

impl Experiment {
    /// Its title, which heads pages and pictures.
    pub fn title(&self) -> Option<&str> {
        self.0.get("title")?.as_str()
    }

    /// Its description of itself.
    pub fn about(&self) -> Option<&str> {
        self.0.get("about")?.as_str()
    }

    /// The program of this axis.
    pub fn program(&self, axis: Axis) -> Option<&str> {
        self.0.get(axis.name())?.get("program")?.as_str()
    }

    /// Names of the laws of the load's set-point, one for each of its segments that has a law.
    pub fn load_laws(&self) -> impl Iterator<Item = &str> {
        let segments = self.0.get("load").and_then(|load| load.get("set-point")).and_then(Value::as_array);
        segments.into_iter().flatten().filter_map(|segment| segment.get("law")?.as_str())
    }

    /// Its bounds, `[passed]`.
    ///
    /// # Errors
    /// What is wrong: it is no table.
    pub fn bounds(&self) -> Result<Table, &'static str> {
        self.0.get("passed").map_or_else(
            || Ok(Table::new()),
            |passed| passed.as_table().cloned().ok_or("[passed] is no table"),
        )
    }

    /// Its demands on the rig: initial state, mode, and the set-points of both axes.
    pub fn demands(&self) -> Table {
        // Without `start`: time begins with the experiment, whatever started it.
        const NO_DEMANDS: [&str; 3] = ["program", "change", "start"];
        let asked = ["rig", "run"].into_iter().chain(Axis::NAMES);
        let tables = asked.filter_map(|key| {
            let table = self.0.get(key)?.as_table()?;
            let kept = table.iter().filter(|(key, _)| !NO_DEMANDS.contains(&key.as_str()));
            let kept: Table = kept.map(|(key, value)| (key.clone(), value.clone())).collect();
            Some((key.to_owned(), Value::Table(kept)))
        });
        tables.collect()
    }
}
