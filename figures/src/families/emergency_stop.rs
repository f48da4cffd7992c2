//! The first emergency stop of a run: way and time to standstill, the air in the chambers while they are shut, and the way back.
//!
//! The supply shows all of it: it falls from the trip on, the check valves shut below their pilot pressure, and it rises again
//! from the release on. Source: rig-model.md, Emergency stop.

use super::{Family, Figures};
use crate::record::Record;
use crate::series::{Series, Span};

/// Slower is standstill, when it lasts.
const STANDSTILL_M_PER_S: f64 = 0.001;
const LASTS_S: f64 = 0.1;
/// A fall of the supply by this share from one row to the next belongs to the discharge.
const FALLS_SHARE: f64 = 1e-6;
/// A supply that has recovered, by the pressure before the trip.
const RECOVERED: f64 = 0.95;
/// How long the position is looked at once the valves are commanded again.
const RESTART_S: f64 = 0.2;
/// Stored air of the four chambers.
const CHAMBERS: [&str; 4] =
    ["drive_stored_air_a_J", "drive_stored_air_b_J", "load_stored_air_a_J", "load_stored_air_b_J"];

pub(super) const FAMILY: Family = Family {
    title: "emergency stop (the first of the run, from truth.csv)",
    definitions: definitions! {
        stop_speed_m_per_s: "m/s", Run,
            "speed of the carriage at the trip: the instant from which the supply falls";
        stop_time_s: "s", Run,
            "from the trip until the carriage stays below 1 mm/s for 0.1 s; only when it moved at the \
             trip";
        stop_way_m: "m", Run, "way from the trip to that standstill, both signs";
        stop_way_to_turn_m: "m", Run, "way from the trip until the carriage first turns back or stands still";
        check_valves_shut_after_s: "s", Run, "from the trip until the check valves are shut";
        air_mass_change_while_shut_ratio: "1", Run,
            "largest relative change of the stored air p V of any chamber while the check valves are shut";
        release_jump_m: "m", Run,
            "largest change of the drive's position from the opening of the check valves until the valves \
             are commanded again, 0.2 s at most";
        restart_jump_m: "m", Run,
            "largest change of the drive's position in the 0.2 s after its valve is commanded again";
        supply_recovery_s: "s", Run,
            "from the release until the supply is back at 95 % of its pressure before the trip";
    },
    compute,
};

/// When the first emergency stop of the run was tripped.
pub(crate) fn first_trip_s(record: &Record) -> Option<f64> {
    Some(trip_s(record.truth.numbers("supply_pressure_Pa"), first_shut(record)?.from_s))
}

/// The first stretch in which the check valves are shut.
fn first_shut(record: &Record) -> Option<Span> {
    record.truth.numbers("check_valves_shut").stretches(|flag| flag != 0.0).first().copied()
}

fn compute(record: &Record, figures: &mut Figures) {
    let Some(shut) = &first_shut(record) else { return };
    let supply = record.truth.numbers("supply_pressure_Pa");
    let trip_s = trip_s(supply, shut.from_s);
    figures.put("check_valves_shut_after_s", Some(shut.from_s - trip_s));
    stop(record, trip_s, figures);
    let changes = CHAMBERS.iter().filter_map(|name| {
        let air = record.truth.numbers(name).within(shut);
        let first = *air.values().first()?;
        air.map(|air| air / first - 1.0).largest()
    });
    figures.put("air_mass_change_while_shut_ratio", changes.reduce(f64::max));
    let end_s = supply.span().map_or(shut.to_s, |span| span.to_s);
    if end_s - shut.to_s > 1.5 * supply.period_s() {
        way_back(record, &Span { from_s: shut.to_s, to_s: end_s }, figures);
        recovery(supply, trip_s, shut, figures);
    }
}

/// The last instant before the supply's fall that shut the valves.
fn trip_s(supply: &Series, shut_s: f64) -> f64 {
    let before = supply.within(&Span { from_s: 0.0, to_s: shut_s });
    let mut later = before.iter().rev();
    let Some(mut last) = later.next() else { return shut_s };
    for (time, pressure) in later {
        if pressure < last.1 * (1.0 + FALLS_SHARE) {
            break;
        }
        last = (time, pressure);
    }
    last.0
}

fn stop(record: &Record, trip_s: f64, figures: &mut Figures) {
    let after = Span { from_s: trip_s, to_s: f64::INFINITY };
    let velocity = record.truth.numbers("drive_rod_velocity_m_per_s").within(&after);
    let position = record.truth.numbers("drive_position_m");
    let (Some(start), Some(speed)) = (position.at(trip_s), velocity.at(trip_s)) else { return };
    figures.put("stop_speed_m_per_s", Some(speed.abs()));
    if speed.abs() < STANDSTILL_M_PER_S {
        return;
    }
    let slow = velocity.stretches(|velocity| velocity.abs() < STANDSTILL_M_PER_S);
    let rest_s = slow.iter().find(|span| span.length_s() >= LASTS_S - 1e-6).map(|span| span.from_s);
    let way = |time_s: f64| position.at(time_s).map(|place| (place - start).abs());
    figures.put("stop_time_s", rest_s.map(|time| time - trip_s));
    figures.put("stop_way_m", rest_s.and_then(way));
    let turn_s = velocity.first_time(|velocity| velocity * speed <= 0.0);
    let turn_s = turn_s.into_iter().chain(rest_s).reduce(f64::min);
    figures.put("stop_way_to_turn_m", turn_s.and_then(way));
}

/// What happens to the position once the check valves are open again.
fn way_back(record: &Record, open: &Span, figures: &mut Figures) {
    let position = record.truth.numbers("drive_position_m");
    let largest_change = |span: &Span| {
        let start = position.at(span.from_s)?;
        position.within(span).map(|place| place - start).largest()
    };
    let commanded_s = record.measured.numbers("drive_valve").within(open).first_time(|valve| valve != 0.0);
    let until_s = commanded_s.unwrap_or(f64::INFINITY).min(open.from_s + RESTART_S);
    figures.put("release_jump_m", largest_change(&Span { from_s: open.from_s, to_s: until_s + 1e-3 }));
    let restart = commanded_s.map(|from_s| Span { from_s, to_s: from_s + RESTART_S });
    figures.put("restart_jump_m", restart.as_ref().and_then(largest_change));
}

fn recovery(supply: &Series, trip_s: f64, shut: &Span, figures: &mut Figures) {
    let least =
        supply.within(shut).iter().reduce(|least, other| if other.1 <= least.1 { other } else { least });
    let (Some((release_s, _)), Some(before)) = (least, supply.at(trip_s)) else { return };
    let after = supply.within(&Span { from_s: release_s, to_s: f64::INFINITY });
    let back_s = after.first_time(|pressure| pressure >= RECOVERED * before);
    figures.put("supply_recovery_s", back_s.map(|time| time - release_s));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::made::{each_ms, table};

    const ATMOSPHERE_PA: f64 = 101_325.0;
    const SUPPLY_PA: f64 = 700_000.0;

    fn supply(time: f64) -> f64 {
        let low =
            |time: f64| ATMOSPHERE_PA + (SUPPLY_PA - ATMOSPHERE_PA) * (-(time - 1.0).max(0.0) / 0.05).exp();
        if time < 3.0 { low(time) } else { SUPPLY_PA + (low(3.0) - SUPPLY_PA) * (-(time - 3.0) / 0.3).exp() }
    }

    /// Trips at 1 s at 0.5 m/s, braked by 2.5 m/s^2; released at 3 s, commanded again at 4 s.
    fn record(leak: f64) -> Record {
        let shut = |time: f64| supply(time) < 250_000.0;
        let velocity = |time: f64| (0.5 - 2.5 * (time - 1.0).max(0.0)).max(0.0);
        let place = |time: f64| {
            let braking = (time - 1.0).clamp(0.0, 0.2);
            0.1 + 0.5 * time.min(1.0) + 0.5 * braking - 1.25 * braking * braking
                + 0.01 * (time - 4.0).max(0.0)
        };
        let each = |law: &dyn Fn(f64) -> f64| each_ms(0.0, 5.0, law);
        let air = |time: f64| 60.0 * (1.0 + if time > 2.0 { leak } else { 0.0 });
        let truth = table(&[
            ("supply_pressure_Pa", &each(&supply)),
            ("check_valves_shut", &each(&|time| f64::from(shut(time)))),
            ("drive_rod_velocity_m_per_s", &each(&velocity)),
            ("drive_position_m", &each(&place)),
            ("drive_stored_air_a_J", &each(&|_| 50.0)),
            ("load_stored_air_b_J", &each(&air)),
        ]);
        let valve = |time: f64| if (1.0..4.0).contains(&time) { 0.0 } else { 0.3 };
        Record { truth, measured: table(&[("drive_valve", &each(&valve))]), ..Record::default() }
    }

    #[test]
    fn way_and_time_to_standstill_are_those_of_even_braking() {
        let figures = super::super::of(&record(0.0));
        let figure = |name: &str| figures.get(name).unwrap_or_else(|| panic!("{name} is absent"));
        assert!((figure("stop_speed_m_per_s") - 0.5).abs() < 1e-9);
        // v / a = 0.2 s, less 0.4 ms for the last mm/s; v^2 / 2a = 50 mm.
        assert!((figure("stop_time_s") - 0.2).abs() < 2e-3);
        assert!((figure("stop_way_m") - 0.05).abs() < 1e-5);
        assert!((figure("stop_way_to_turn_m") - 0.05).abs() < 1e-5);
        assert_eq!(figure("air_mass_change_while_shut_ratio"), 0.0);
        // tau ln of the ratio of overpressures, seen within a sample.
        let shut_s = 0.05 * ((SUPPLY_PA - ATMOSPHERE_PA) / (250_000.0 - ATMOSPHERE_PA)).ln();
        assert!((figure("check_valves_shut_after_s") - shut_s).abs() < 1.5e-3);
        let back_s = 0.3 * ((SUPPLY_PA - ATMOSPHERE_PA) / (0.05 * SUPPLY_PA)).ln();
        assert!((figure("supply_recovery_s") - back_s).abs() < 2e-3);
        assert!(figure("release_jump_m") < 1e-12);
        assert!((figure("restart_jump_m") - 0.002).abs() < 2e-5);
    }

    #[test]
    fn air_that_leaks_is_seen() {
        let figures = super::super::of(&record(-0.003));
        assert!((figures.get("air_mass_change_while_shut_ratio").unwrap() - 0.003).abs() < 1e-9);
    }

    #[test]
    fn a_run_without_a_trip_has_no_figures_of_one() {
        let truth = table(&[
            ("supply_pressure_Pa", &each_ms(0.0, 1.0, |_| SUPPLY_PA)),
            ("check_valves_shut", &each_ms(0.0, 1.0, |_| 0.0)),
        ]);
        assert_eq!(super::super::of(&Record { truth, ..Record::default() }).iter().count(), 0);
    }
}
