//! Description of the run for viewers: the run, parameters of the rig, columns, possible faults.
//!
//! Its form is [`runlog::telemetry::Description`].

use crate::cli::RunArguments;
use crate::faults::listing;
use crate::inputs::Inputs;
use plant::Truth;
use runlog::cycle_tables::MEASURED;
use runlog::run_folder::SCHEMA_VERSION;
use runlog::telemetry::{Column, Description, DroppedEvents, Experiment, RigFigures, Table};
use settings::unit_of;
use std::path::Path;

pub(crate) struct RunFacts<'a> {
    /// Command line of the emulator.
    pub arguments: &'a RunArguments,
    pub inputs: &'a Inputs,
    /// Columns of `truth.csv` after those of the baseline.
    pub terms: &'a [String],
    /// Start of the run's clock, s since 1970; `None` in lockstep.
    pub started_unix_s: Option<f64>,
}

impl RunFacts<'_> {
    /// Whether viewers get values of the truth. Sealed effects must appear in `truth.csv` alone.
    pub(crate) fn with_truth(&self) -> bool {
        !self.inputs.sealed
    }

    fn columns(&self) -> Vec<Column> {
        let of = |table, name: &str| Column { table, name: name.to_owned(), unit: unit(name).to_owned() };
        let measured = MEASURED.into_iter().map(|name| of(Table::Measurement, name));
        let truth = Truth::COLUMNS.into_iter().chain(self.terms.iter().map(String::as_str));
        let truth = truth.filter(|_| self.with_truth()).map(|name| of(Table::Truth, name));
        measured.chain(truth).collect()
    }
}

pub(crate) fn description(run: &RunFacts<'_>) -> Description {
    let RunFacts { arguments, inputs, started_unix_s, .. } = run;
    let (cylinder, supply, mass) = (inputs.rig.cylinder(), inputs.rig.supply(), inputs.rig.mass());
    let out = std::path::absolute(&arguments.out).unwrap_or_else(|_| arguments.out.clone());
    Description {
        schema_version: SCHEMA_VERSION,
        pace: arguments.pace.to_string(),
        bus: arguments.bus.to_string(),
        seed: arguments.seed,
        started_unix_s: *started_unix_s,
        out: out.to_string_lossy().into_owned(),
        experiment: arguments.experiment.as_deref().map(|file| experiment(file, inputs)),
        console: arguments.console,
        sealed: inputs.sealed,
        columns: run.columns(),
        rig: RigFigures {
            stroke_m: cylinder.stroke_m,
            piston_area_m2: cylinder.piston_area_m2,
            annulus_area_m2: cylinder.annulus_area_m2,
            supply_pressure_pa: supply.pressure_pa,
            exhaust_pressure_pa: supply.exhaust_pressure_pa,
            atmospheric_pressure_pa: supply.atmospheric_pressure_pa,
            drive_mass_kg: mass.drive_kg,
            carriage_mass_kg: mass.carriage_kg,
            load_mass_kg: mass.load_kg,
            added_mass_limit_kg: mass.added_limit_kg,
            gap_m: inputs.rig.linkage().gap_m,
            force_range_n: inputs.rig.sensors().force_range_n,
        },
        setup: inputs.set_up(),
        faults: listing::faults(),
        dropped_events: DroppedEvents::default(),
    }
}

fn experiment(file: &Path, inputs: &Inputs) -> Experiment {
    // The emulator uses `[rig]` alone; the controllers check the rest.
    let table: Option<toml::Table> = inputs.experiment_toml.as_deref().and_then(|text| text.parse().ok());
    let title = table.as_ref().and_then(|table| table.get("title")?.as_str());
    Experiment {
        name: file.file_stem().map(|name| name.to_string_lossy().into_owned()),
        title: title.map(str::to_owned),
    }
}

/// Unit of a column, from the end of its name; `1` for a dimensionless number.
fn unit(column: &str) -> &'static str {
    unit_of(column).unwrap_or("1")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_of_the_baseline_has_its_unit() {
        let plain: Vec<_> = Truth::COLUMNS.into_iter().filter(|name| unit(name) == "1").collect();
        assert_eq!(plain, ["drive_spool", "load_spool", "check_valves_shut"]);
        assert_eq!(unit("drive_flow_a_m3_per_s"), "m^3/s");
        assert_eq!(unit("drive_position_m"), "m");
        assert_eq!(unit("load_rod_velocity_m_per_s"), "m/s");
    }
}
