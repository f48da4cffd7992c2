//! What each effect adds to, balance by balance, in the order in which it is summed.
//!
//! A balance is a baseline value and one named term for each effect that acts on it. A term is a function of the state and of
//! the balances above it, never of another term of its own balance: switching an effect off changes the sum by exactly its
//! field, and what is off adds 0.
//!
//! `added` is the sum of the terms that stand in their effects' files alone (`Effect::open_term`), in the order of the catalogue.
//! A term has a name here where it needs memory, a flow that is solved for, or its place in the order of the sum.
//!
//! Baselines and laws: rig-model.md; terms: the file of each effect.

/// The terms of a balance, for those who list them.
pub(crate) trait Balance {
    /// Name, as in the columns of `truth.csv`.
    const NAME: &'static str;
    /// Unit of baseline and terms, as a column of `truth.csv` ends with it.
    const UNIT: &'static str;

    /// Tells each term by the name of its effect, in the order of the sum.
    fn each(&self, tell: &mut dyn FnMut(&'static str, f64));
}

/// A struct of named terms with its sum, their names and their unit.
macro_rules! balance {
    ($(#[$doc:meta])* $name:ident $title:literal in $unit:literal = $baseline:ident $(+ $term:ident)*) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub(crate) struct $name { $(pub(crate) $term: f64,)* }

        impl $name {
            /// Baseline and all terms.
            #[inline(always)]
            #[allow(dead_code)] // one is only reported: the spool's own law integrates what it sums
            pub(crate) fn sum(&self, $baseline: f64) -> f64 { $baseline $(+ self.$term)* }
        }

        impl Balance for $name {
            const NAME: &'static str = $title;
            const UNIT: &'static str = $unit;

            fn each(&self, tell: &mut dyn FnMut(&'static str, f64)) { $(tell(stringify!($term), self.$term);)* }
        }
    };
}

balance!(/** The command as it reaches the valve. */
    Arriving "arriving" in "opening" = command + command_dead_time + valve_offset);
balance!(/** Where the spool is sent, -1 to 1 after clamping. */
    Target "target" in "opening" = arriving + valve_hysteresis);
balance!(/** How fast the spool would move. */
    SpoolRate "spool_rate" in "per_s" = lag + spool_second_order);
balance!(/** How fast the spool moves. */
    LimitedRate "limited_rate" in "per_s" = rate + spool_rate_limit);
balance!(/** How far the edges are open, by sign. */
    Opening "opening" in "opening" = spool + valve_dead_zone + added);
balance!(/** K_V of an edge at an opening; the floor of the leakage is under what the characteristic leaves. */
    Characteristic "characteristic" in "m3_per_h" = table + valve_characteristic);
balance!(/** K_V of an edge with its floor. */
    Edge "edge" in "m3_per_h" = characteristic + valve_null_leakage);
balance!(/** Pressure behind the supply edges. */
    SupplySide "supply_side" in "Pa" = node + supply_droop);
balance!(/** Pressure behind the exhaust edges of an axis. */
    ExhaustSide "exhaust_side" in "Pa" = exhaust + silencer_back_pressure);
balance!(/** Pressure at the valve's port of a chamber, at the flow that passes it. */
    Port "port" in "Pa" = chamber + line_resistance + check_valve_restriction + end_cushion);
balance!(/** Normal flow that leaves the valve for a chamber. */
    PortFlow "port_flow" in "m3_per_s" = valve + critical_pressure_ratio);
balance!(/** Normal flow that enters the line of a chamber's lag. */
    LineFlow "line_flow" in "m3_per_s" = port + line_delay);
balance!(/** Normal flow into a chamber, beside the valve's. */
    Leakage "leakage" in "m3_per_s" = nothing + piston_leakage + rod_leakage + tabulated + declared + added);
balance!(/** Rate of a chamber's stored air p V, beside p_N times the flow. */
    AirRate "air_rate" in "W" = nothing + heat_exchange);
balance!(/** Dead volume of a chamber. */
    DeadSpace "dead_space" in "m3" = file + dead_volume);
balance!(/** Sliding friction level in one direction, without sign, not below 0. */
    SlidingLevel "sliding_level" in "N" = file
    + stribeck_friction + friction_asymmetry + pressure_dependent_friction + position_dependent_friction
    + added);
balance!(/** Break-away level in one direction, not below the sliding level at rest. */
    BreakAwayLevel "break_away_level" in "N" = file + friction_asymmetry
    + pressure_dependent_friction + position_dependent_friction + rest_time_dependent_break_away + added);
balance!(/** Viscous friction in one direction. */
    Viscous "viscous" in "N_s_per_m" = file + friction_asymmetry);
balance!(/** Friction where bristles take the place of stick and slip, along the axis's extension. */
    Bristles "bristles" in "N" = nothing + presliding);
balance!(/** Force on the piston along its own extension, beside air, hand, contact and friction. */
    Force "force" in "N" = nothing
    + inclination + position_dependent_force + end_cushion + tabulated + declared + added);
balance!(/** Gap of the linkage. */
    Gap "gap" in "m" = file + coupling_backlash);
balance!(/** Stiffness of the linkage. */
    Stiffness "stiffness" in "N_per_m" = file + coupling_compliance);
balance!(/** Damping of the linkage. */
    Damping "damping" in "N_s_per_m" = file + coupling_compliance);
balance!(/** What a position sensor shows, before noise and steps. */
    PositionReading "position_reading" in "m" = truth
    + time_skew + position_sensor_lag + position_sensor_gain + position_sensor_offset + declared_reading + added);
balance!(/** What a force sensor shows, before noise and steps. */
    ForceReading "force_reading" in "N" = truth
    + time_skew + force_sensor_gain + force_sensor_offset + declared_reading + added);
balance!(/** What a pressure sensor shows, before noise and steps. */
    PressureReading "pressure_reading" in "Pa" = truth
    + time_skew + pressure_sensor_lag + pressure_sensor_gain + pressure_sensor_offset + declared_reading + added);
