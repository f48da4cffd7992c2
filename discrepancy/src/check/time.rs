//! Time: an empty or short record, repeated and jumping time, the period, lost rows, holes, jitter.
//!
//! Rows on the longest increasing subsequence of times are good, which separates a single wrong stamp from a clock that was set
//! back. Source of the chain: Fredman 1975, Discrete Math. 11(1), longest growing subsequence.

use super::grid::period_s;
use super::notes::Notes;
use crate::gridded_record::{HELD_LONGEST, SHORTEST};
use model_fit::SPARSEST;
use model_fit::stats::quantile;
use plant::{Axis, PERIOD_S};
use records::{Channel, Signal};

/// Shortest record of the rig, s.
const SHORTEST_S: f64 = SHORTEST as f64 * PERIOD_S;
/// Fewest rows of a foreign record.
pub(crate) const FEWEST_ROWS: usize = 50;
/// Rows missing in a row that are a hole and not lost samples; a command is held over the latter.
const HOLE: usize = HELD_LONGEST + 1;
const HOLES_LISTED: usize = 20;
/// Part of a period by which times must differ to be two.
const SAME: f64 = 0.01;
/// Share of lost rows beyond which nothing is left to use.
const MOST_LOST: f64 = 0.5;
/// Share of rows with a time that cannot be, beyond which it is the clock and no single stamp.
const MOST_JUMPING: f64 = 0.01;
/// Holes, in units of the rows that there are, that no record has: the stamp beyond is wrong.
const FARTHEST: f64 = SPARSEST as f64 - 1.0;
/// Spread of sampling instants around their grid, in periods, that is reported, and that spoils speeds.
const JITTER: [f64; 2] = [0.02, 0.25];

pub(super) fn check(notes: &mut Notes) {
    let record = notes.record;
    if record.is_empty() {
        return notes.add_time("empty", None, true, "there is no row of data: record again");
    }
    let of_rig = Axis::ALL.into_iter().any(|axis| notes.is_of_rig(axis));
    let times = record.time_s();
    let Some(period) = period_s(times) else {
        return notes.add_time("too-short", Some(0), true, "time never grows: record again");
    };
    order(notes, period);
    let nominal = record.nominal_period_s.or(of_rig.then_some(PERIOD_S)).unwrap_or(period);
    let ratio = period / nominal;
    if !(0.9..=1.1).contains(&ratio) && unit_of_time(notes, ratio) {
        return;
    }
    let length_s =
        times.iter().copied().fold(f64::MIN, f64::max) - times.iter().copied().fold(f64::MAX, f64::min);
    let short = if of_rig { length_s < SHORTEST_S - 1.5 * nominal } else { times.len() < FEWEST_ROWS };
    if short {
        let least = if of_rig {
            format!("{SHORTEST_S} s are needed")
        } else {
            format!("{FEWEST_ROWS} rows are needed")
        };
        let text = format!("{} rows over {length_s:.3} s are too short: at least {least}", times.len());
        notes.add_time("too-short", Some(0), true, &text);
    }
    if !(0.9..=1.1).contains(&ratio) {
        // Commands act over a whole period; a slower record misses commands.
        let fatal = of_rig && !(0.45..=3.5).contains(&ratio);
        let text = format!(
            "the sampling period is {:.4} ms and not {:.4} ms: {}",
            1e3 * period,
            1e3 * nominal,
            if fatal { "record at the rig's period" } else { "periods without a row are left open" }
        );
        notes.add_time("wrong-period", Some(0), fatal, &text);
    }
    lost(notes, period);
    jitter(notes, period);
    absent(notes);
}

/// Reports a period that is off by the factor between two units of time.
fn unit_of_time(notes: &mut Notes, ratio: f64) -> bool {
    let units = [(1e3, "ms"), (1e6, "us"), (1e9, "ns"), (1.0 / 60.0, "min")];
    let Some((factor, unit)) = units.into_iter().find(|(factor, _)| (0.9..=1.1).contains(&(ratio / factor)))
    else {
        return false;
    };
    let text = format!("time reads as {unit}: divide it by {factor} so that it is in s");
    notes.add_time("wrong-unit", Some(0), true, &text);
    true
}

/// Rows whose time repeats or goes back.
fn order(notes: &mut Notes, period_s: f64) {
    let same_s = SAME * period_s;
    let record = notes.record;
    let times = record.time_s();
    let mut kept = growing(times, same_s);
    leave_far_ends_out(times, &mut kept, FARTHEST * times.len() as f64 * period_s);
    let mut repeated = Vec::new();
    let mut jumping = Vec::new();
    for row in 0..times.len() {
        if !kept[row] {
            let neighbour = |other: Option<usize>| other.and_then(|other| times.get(other));
            let same = |other: Option<usize>| {
                neighbour(other).is_some_and(|other| (other - times[row]).abs() <= same_s)
            };
            let twin = same(row.checked_sub(1)) || same(Some(row + 1));
            if twin {
                repeated.push(row)
            } else {
                jumping.push(row)
            }
            record.channels().for_each(|channel| notes.leave_out(channel, row));
        }
    }
    if let Some(first) = repeated.first() {
        let text = format!("{} rows repeat the time of a neighbour: they are left out", repeated.len());
        notes.add_time("repeated-time", Some(*first), repeated.len() * 2 > times.len(), &text);
    }
    if let Some(first) = jumping.first() {
        let fatal = jumping.len() as f64 > MOST_JUMPING * times.len() as f64;
        let text = format!(
            "time jumps: {:.6} s is not between its neighbours, {} rows in all: {}",
            times[*first],
            jumping.len(),
            if fatal { "cut the file there, or mend their time" } else { "they are left out" }
        );
        notes.add_time("jumping-time", Some(*first), fatal, &text);
    }
}

/// Takes rows out of a growing chain that lie beyond a hole longer than any record has, at its end or its beginning.
fn leave_far_ends_out(times: &[f64], kept: &mut [bool], farthest_s: f64) {
    let rows: Vec<usize> = (0..times.len()).filter(|row| kept[*row]).collect();
    let hole = |pair: &[usize]| times[pair[1]] - times[pair[0]] > farthest_s;
    let most = (MOST_JUMPING * times.len() as f64) as usize;
    let Some(at) = rows.windows(2).position(hole) else { return };
    if rows.len() - at - 1 <= most.max(1) {
        rows[at + 1..].iter().for_each(|row| kept[*row] = false);
    } else if at < most.max(1) {
        rows[..=at].iter().for_each(|row| kept[*row] = false);
    }
}

/// Whether each value belongs to the longest chain that grows by more than `same`; of equal neighbours the last.
fn growing(values: &[f64], same: f64) -> Vec<bool> {
    let mut ends: Vec<usize> = Vec::new();
    let mut before = vec![usize::MAX; values.len()];
    for (at, value) in values.iter().enumerate() {
        let length = ends.partition_point(|end| values[*end] + same < *value);
        before[at] = if length == 0 { usize::MAX } else { ends[length - 1] };
        if length == ends.len() { ends.push(at) } else { ends[length] = at }
    }
    let mut kept = vec![false; values.len()];
    let mut at = ends.last().copied().unwrap_or(usize::MAX);
    while at != usize::MAX {
        kept[at] = true;
        at = before[at];
    }
    kept
}

fn lost(notes: &mut Notes, period_s: f64) {
    let times = notes.record.time_s();
    let rows: Vec<usize> = (0..times.len())
        .filter(|row| !notes.record.channels().all(|channel| notes.is_left_out(channel, *row)))
        .collect();
    let (mut singles, mut first, mut holes, mut missing) = (0, None, Vec::new(), 0);
    for pair in rows.windows(2) {
        let step = ((times[pair[1]] - times[pair[0]]) / period_s).round();
        if step < 2.0 {
            continue;
        }
        let gone = step as usize - 1;
        missing += gone;
        if gone < HOLE {
            singles += gone;
            first = first.or(Some(pair[1]));
        } else {
            holes.push((pair[1], gone));
        }
    }
    let all = rows.len() + singles;
    let share = singles as f64 / all.max(1) as f64;
    if let Some(first) = first {
        let fatal = share > MOST_LOST;
        let text = format!(
            "{singles} rows of {all} ({:.2} %) are lost one by one: {}",
            1e2 * share,
            if fatal {
                "too many, record again"
            } else {
                "they are left open, and the command before goes on"
            }
        );
        notes.add_time("lost-samples", Some(first), fatal, &text);
    }
    // A record with a pause is as good as its parts.
    let fatal = missing as f64 > FARTHEST * rows.len() as f64;
    for (row, gone) in holes.iter().take(HOLES_LISTED) {
        let text = format!(
            "a hole of {:.1} ms before {:.3} s: {}",
            1e3 * period_s * *gone as f64,
            times[*row],
            if fatal { "mend the time, or cut the file there" } else { "nothing is simulated across it" }
        );
        notes.add_time("gap", Some(*row), fatal, &text);
    }
    if let Some((row, _)) = holes.get(HOLES_LISTED) {
        let rest: usize = holes[HOLES_LISTED..].iter().map(|(_, gone)| gone).sum();
        let text = format!(
            "{} more holes of {:.1} ms in all",
            holes.len() - HOLES_LISTED,
            1e3 * period_s * rest as f64
        );
        notes.add_time("gap", Some(*row), fatal, &text);
    }
}

/// Standard deviation of the sampling instants.
fn jitter(notes: &mut Notes, period_s: f64) {
    let times = notes.record.time_s();
    // Half the distance between the 16 % and 84 % quantiles is a standard deviation; that of a difference has two instants in it.
    let mut steps: Vec<f64> = times
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / period_s)
        .filter(|step| (0.0..1.7).contains(step))
        .collect();
    let [Some(low), Some(high)] = [quantile(&mut steps, 0.16), quantile(&mut steps, 0.84)] else { return };
    let std_periods = 0.5 * (high - low) / std::f64::consts::SQRT_2;
    let jitter_ms = 1e3 * std_periods * period_s;
    if std_periods > JITTER[1] {
        let text = format!(
            "the rows come irregularly, by {jitter_ms:.3} ms rms: speeds taken from them are as uncertain"
        );
        notes.add_time("irregular-sampling", Some(0), false, &text);
    } else if std_periods > JITTER[0] {
        notes.add_time(
            "jitter",
            Some(0),
            false,
            &format!("the rows jitter by {jitter_ms:.3} ms rms: that is borne"),
        );
    }
}

fn absent(notes: &mut Notes) {
    let record = notes.record;
    for channel in record.channels() {
        let absent = (0..record.len()).filter(|row| record.value(channel, *row).is_none()).count();
        // The node's pressure is sent every ten cycles and not simulated.
        if absent == 0 || channel == Channel::SupplyPressure {
            continue;
        }
        let row = (0..record.len()).find(|row| record.value(channel, *row).is_none());
        let share = absent as f64 / record.len() as f64;
        let fatal = share > MOST_LOST && !matches!(channel, Channel::Of(_, Signal::AppliedForce));
        let text = format!(
            "{absent} values of {} ({:.2} %) are absent: {}",
            record.len(),
            1e2 * share,
            if fatal { "too many, record again" } else { "they are left open" }
        );
        notes.add("absent-values", channel, row, fatal, &text);
    }
}

#[cfg(test)]
mod tests {
    use super::growing;

    #[test]
    fn a_stamp_that_leaps_ahead_is_alone_in_being_wrong() {
        assert_eq!(growing(&[0.0, 1.0, 99.0, 2.0, 3.0], 0.0), [true, true, false, true, true]);
        assert_eq!(growing(&[0.0, 1.0, -5.0, 2.0, 3.0], 0.0), [true, true, false, true, true]);
    }

    #[test]
    fn of_equal_stamps_the_last_stays() {
        assert_eq!(growing(&[0.0, 1.0, 1.0, 2.0], 0.0), [true, false, true, true]);
        assert!(growing(&[], 0.0).is_empty());
    }
}
