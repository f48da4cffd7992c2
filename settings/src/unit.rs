//! Units in names: columns of a run's tables, figures and keys of files end with their unit, as `drive_position_m` does.

/// Ends of names in lower case, and their units; an end comes after those that end with it.
const UNITS: [(&str, &str); 19] = [
    ("_n_s_per_m", "N s/m"),
    ("_n_per_m", "N/m"),
    ("_m_per_s2", "m/s^2"),
    ("_m_per_s", "m/s"),
    ("_n_per_s", "N/s"),
    ("_pa_per_s", "Pa/s"),
    ("_m3_per_s", "m^3/s"),
    ("_m3_per_h", "m^3/h"),
    ("_per_s", "1/s"),
    ("_m2", "m^2"),
    ("_m3", "m^3"),
    ("_kg", "kg"),
    ("_pa", "Pa"),
    ("_j", "J"),
    ("_k", "K"),
    ("_n", "N"),
    ("_w", "W"),
    ("_m", "m"),
    ("_s", "s"),
];

/// Unit of a value by its name: SI, and m^3/h of K_V; `None` for a plain number.
///
/// Columns write a symbol as SI does (`supply_pressure_Pa`), figures and keys in lower case (`supply_pressure_pa`).
#[must_use]
pub fn unit_of(name: &str) -> Option<&'static str> {
    split(name).map(|(_, unit)| unit)
}

/// A name without the unit that [`unit_of`] finds.
#[must_use]
pub fn without_unit(name: &str) -> &str {
    split(name).map_or(name, |(quantity, _)| quantity)
}

/// Quantity and unit of a name that has a unit.
fn split(name: &str) -> Option<(&str, &'static str)> {
    UNITS.iter().find_map(|(end, unit)| {
        let (quantity, tail) = name.split_at_checked(name.len().checked_sub(end.len())?)?;
        tail.eq_ignore_ascii_case(end).then_some((quantity, *unit))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_the_unit_that_it_ends_with() {
        for (name, quantity, unit) in [
            ("drive_position_m", "drive_position", Some("m")),
            ("drive_rod_acceleration_m_per_s2", "drive_rod_acceleration", Some("m/s^2")),
            ("load_edge_flow_a_m3_per_s", "load_edge_flow_a", Some("m^3/s")),
            ("supply_pressure_Pa", "supply_pressure", Some("Pa")),
            ("supply_pressure_pa", "supply_pressure", Some("Pa")),
            (
                "drive_viscous_out_friction_asymmetry_N_s_per_m",
                "drive_viscous_out_friction_asymmetry",
                Some("N s/m"),
            ),
            (
                "linkage_stiffness_coupling_compliance_N_per_m",
                "linkage_stiffness_coupling_compliance",
                Some("N/m"),
            ),
            ("drive_limited_rate_spool_rate_limit_per_s", "drive_limited_rate_spool_rate_limit", Some("1/s")),
            ("drive_spool", "drive_spool", None),
            ("check_valves_shut", "check_valves_shut", None),
            ("größe", "größe", None),
            ("m", "m", None),
        ] {
            assert_eq!((unit_of(name), without_unit(name)), (unit, quantity), "{name}");
        }
    }

    #[test]
    fn no_end_hides_a_longer_one() {
        for (end, unit) in UNITS {
            assert_eq!(unit_of(&format!("x{end}")), Some(unit));
        }
    }
}
