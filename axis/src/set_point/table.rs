//! Table: a trajectory from a CSV file, linear or smooth between its points.
//!
//! ```text
//!   time_s,position_m        or time_s,force_N; other columns are passed over, lines that begin with # too
//!   0.0,0.1
//!   0.5,0.25
//! ```
//!
//! Times begin at 0 and grow; positions begin where the row stands. Smooth is a piecewise cubic through the points whose rate at
//! a point is the harmonic mean of the slopes on either side (0 at a turn and at both ends), so that it never leaves the span of
//! two neighbouring points; position and rate are continuous, the acceleration jumps at the points.
//!
//! Source: Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300 (the mean, here unweighted).

use super::law::{BOTH, Extent, Kind, Law, ProfilePoint, SegmentReader};
use algorithms::algorithm::Quantity;
use runlog::run_folder::read_text;
use settings::SettingsError;
use std::path::Path;
use std::sync::Arc;

pub(super) const KIND: Kind =
    Kind { name: "table", about: "a trajectory from a CSV file", serves: BOTH, read };

const TIME: &str = "time_s";
/// The columns of values, and what they are.
const COLUMNS: [(&str, Quantity); 2] = [("position_m", Quantity::Position), ("force_N", Quantity::Force)];
/// How far the first position may be off the place where the row stands: below what a sensor shows.
const START_TOLERANCE_M: f64 = 1e-5;
const MOST_POINTS: usize = 1_000_000;

fn read(reader: &mut SegmentReader<'_, '_>) -> Result<Arc<dyn Law>, SettingsError> {
    let file = reader.section.needed_text("file", "the CSV file, relative to the experiment's folder")?;
    let path = reader.section.sibling_path(&file.text);
    let smooth = reader.section.choice("interpolation", &[("linear", false), ("smooth", true)])?;
    let reported = |problem: String| reader.section.wrong_at("file", &format!("file: {problem}"));
    let (quantity, points) = points_of(&path).map_err(reported)?;
    let (unit, most) = (reader.scale.unit(), reader.scale.most());
    if quantity != reader.scale.quantity {
        let column = COLUMNS.iter().find(|(_, of)| *of == reader.scale.quantity).map_or("", |(name, _)| name);
        return Err(reported(format!("{}:1: column {column} is missing", path.display())));
    }
    let outside = points.iter().find(|point| !(0.0..=most).contains(&point.value));
    if let Some(Point { line, value, .. }) = outside {
        let problem = format!("{}:{line}: {value} {unit}; allowed is 0 to {most} {unit}", path.display());
        return Err(reported(problem));
    }
    let Point { line, value, .. } = points[0];
    if quantity == Quantity::Position && (value - reader.from).abs() > START_TOLERANCE_M {
        let (path, from) = (path.display(), reader.from);
        return Err(reported(format!("{path}:{line}: begins at {value} m, where the axis is at {from} m")));
    }
    Ok(Arc::new(Table::new(&points, smooth)))
}

/// Quantity of the file's values, by its header; for a row that begins with a table.
pub(super) fn quantity_of(path: &Path) -> Option<Quantity> {
    points_of(path).ok().map(|(quantity, _)| quantity)
}

struct Point {
    line: usize,
    time_s: f64,
    value: f64,
}

fn points_of(path: &Path) -> Result<(Quantity, Vec<Point>), String> {
    let text = read_text(path).map_err(|error| error.to_string())?;
    let name = path.display();
    let mut lines =
        (1..).zip(text.lines()).filter(|(_, line)| !line.starts_with('#') && !line.trim().is_empty());
    let (line, head) =
        lines.next().ok_or_else(|| format!("{name}:1: is empty; {TIME} and a column are needed"))?;
    let names: Vec<&str> = head.split(',').map(str::trim).collect();
    let column = |wanted: &str| names.iter().position(|name| *name == wanted);
    let time = column(TIME).ok_or_else(|| format!("{name}:{line}: column {TIME} is missing"))?;
    let values = COLUMNS.iter().find_map(|(name, quantity)| Some((column(name)?, *quantity)));
    let (value, quantity) = values
        .ok_or_else(|| format!("{name}:{line}: column {} or {} is missing", COLUMNS[0].0, COLUMNS[1].0))?;
    let mut points: Vec<Point> = Vec::new();
    for (line, row) in lines {
        let field = |column: usize| {
            let text = row.split(',').nth(column).unwrap_or_default().trim();
            let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| format!("{name}:{line}: {} = '{text}' is no number", names[column]))
        };
        let (time_s, value) = (field(time)?, field(value)?);
        match points.last() {
            None if time_s != 0.0 => return Err(format!("{name}:{line}: time_s = {time_s}; it begins at 0")),
            Some(last) if time_s <= last.time_s => {
                return Err(format!(
                    "{name}:{line}: time_s = {time_s} s; allowed is above {} s",
                    last.time_s
                ));
            }
            _ => points.push(Point { line, time_s, value }),
        }
    }
    if (2..=MOST_POINTS).contains(&points.len()) {
        return Ok((quantity, points));
    }
    Err(format!("{name}: {} points; allowed is 2 to {MOST_POINTS}", points.len()))
}

/// Points with the rate at each, and from each to the next when it is linear.
#[derive(Debug)]
struct Table {
    times_s: Box<[f64]>,
    values: Box<[f64]>,
    /// Rate at each point; `None`: linear.
    rates: Option<Box<[f64]>>,
}

impl Table {
    fn new(points: &[Point], smooth: bool) -> Self {
        let slope = |pair: &[Point]| (pair[1].value - pair[0].value) / (pair[1].time_s - pair[0].time_s);
        let slopes: Vec<f64> = points.windows(2).map(slope).collect();
        let harmonic = |pair: &[f64]| {
            let same_way = pair[0] * pair[1] > 0.0;
            if same_way { 2.0 * pair[0] * pair[1] / (pair[0] + pair[1]) } else { 0.0 }
        };
        let inner = slopes.windows(2).map(harmonic);
        let rates = smooth.then(|| std::iter::once(0.0).chain(inner).chain([0.0]).collect());
        let times_s = points.iter().map(|point| point.time_s).collect();
        Self { times_s, values: points.iter().map(|point| point.value).collect(), rates }
    }
}

impl Law for Table {
    fn at(&self, time_s: f64) -> ProfilePoint {
        let next = self.times_s.partition_point(|time| *time <= time_s).clamp(1, self.times_s.len() - 1);
        let [begin_s, end_s] = [self.times_s[next - 1], self.times_s[next]];
        let [from, to] = [self.values[next - 1], self.values[next]];
        let (length_s, way) = (end_s - begin_s, to - from);
        let z = ((time_s - begin_s) / length_s).clamp(0.0, 1.0);
        let moving = way != 0.0;
        let Some(rates) = &self.rates else {
            return ProfilePoint { value: from + way * z, rate: way / length_s, acceleration: 0.0, moving };
        };
        // Hermite: x = from + way (3 z^2 - 2 z^3) + T (r0 (z^3 - 2 z^2 + z) + r1 (z^3 - z^2)).
        let [r0, r1] = [rates[next - 1] * length_s, rates[next] * length_s];
        let value = from + z * (r0 + z * (3.0 * way - 2.0 * r0 - r1 + z * (r0 + r1 - 2.0 * way)));
        let rate = r0 + z * (2.0 * (3.0 * way - 2.0 * r0 - r1) + z * 3.0 * (r0 + r1 - 2.0 * way));
        let acceleration = 2.0 * (3.0 * way - 2.0 * r0 - r1) + z * 6.0 * (r0 + r1 - 2.0 * way);
        ProfilePoint {
            value,
            rate: rate / length_s,
            acceleration: acceleration / (length_s * length_s),
            moving,
        }
    }

    fn extent(&self) -> Extent {
        let last = self.values.len() - 1;
        let least = self.values.iter().copied().fold(f64::INFINITY, f64::min);
        let reach = [least, self.values.iter().copied().fold(f64::NEG_INFINITY, f64::max)];
        Extent { duration_s: self.times_s[last], end: self.values[last], reach }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Experiment, SetPoints};
    use crate::set_point::{Actual, ForceSource, Motion};

    fn read(csv: &str, keys: &str) -> Result<SetPoints, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("way.csv"), csv).unwrap();
        let text = format!(
            "title = 't'\n[drive]\nprogram = 'p'\nstart_m = 0.1\n[[drive.set-point]]\nlaw = 'table'\nfile = 'way.csv'\n{keys}"
        );
        let experiment = Experiment::from_toml(&text, &folder.path().join("e.toml"), 0.5);
        experiment.map(|experiment| experiment.drive.unwrap().set_points).map_err(|error| error.to_string())
    }

    const WAY: &str =
        "# measured\ntime_s,other,position_m\n0,x,0.1\n0.5,x,0.3\n1.0,x,0.35\n2.0,x,0.35\n2.5,x,0.2\n";

    fn motion(keys: &str) -> Motion {
        match read(WAY, keys) {
            Ok(SetPoints::Positions(motion)) => motion,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn linear_is_straight_between_its_points() {
        let motion = motion("");
        let point = motion.at(0.25);
        // Roundings of numbers below 1.
        assert!((point.position_m - 0.2).abs() < 1e-15 && (point.velocity_m_per_s - 0.4).abs() < 1e-15);
        assert!(point.moving && !motion.at(1.5).moving);
        assert_eq!((motion.duration_s(), motion.end_m()), (2.5, 0.2));
    }

    #[test]
    fn smooth_goes_through_its_points_without_leaving_their_span() {
        const STEP_S: f64 = 1e-6;
        let motion = motion("interpolation = \"smooth\"");
        for (time_s, position_m) in [(0.0, 0.1), (0.5, 0.3), (1.0, 0.35), (2.0, 0.35)] {
            assert!((motion.at(time_s).position_m - position_m).abs() < 1e-15);
        }
        for cycle in 1..2499 {
            let time_s = f64::from(cycle) * 1e-3;
            let [before, now, after] = [-STEP_S, 0.0, STEP_S].map(|off_s| motion.at(time_s + off_s));
            assert!((0.1..=0.35 + 1e-15).contains(&now.position_m), "{time_s} s: {now:?}");
            let slope = (after.position_m - before.position_m) / (2.0 * STEP_S);
            // At a point the acceleration jumps by less than 10 m/s^2: 10 times 1e-6 / 4.
            assert!((slope - now.velocity_m_per_s).abs() < 3e-6, "{time_s} s: {slope}, {now:?}");
            let at_point = cycle % 500 == 0;
            let slope = (after.velocity_m_per_s - before.velocity_m_per_s) / (2.0 * STEP_S);
            assert!(
                at_point || (slope - now.acceleration_m_per_s2).abs() < 1e-6,
                "{time_s} s: {slope}, {now:?}"
            );
        }
    }

    #[test]
    fn a_table_of_forces_makes_the_row_one_of_forces() {
        let Ok(SetPoints::Forces(profile)) = read("force_N,time_s\n10,0\n20,1\n", "") else {
            panic!("not a row of forces")
        };
        assert_eq!(ForceSource::new(profile).at(0.5, &Actual::default()).force_n, 15.0);
    }

    #[test]
    fn a_bad_table_is_refused_with_file_and_line() {
        for (csv, hints) in [
            ("", ["way.csv:1", "empty"]),
            ("time_s,x\n0,0.1\n1,0.2\n", ["way.csv:1", "position_m or force_N"]),
            ("t,position_m\n0,0.1\n1,0.2\n", ["way.csv:1", "column time_s is missing"]),
            ("time_s,position_m\n0,0.1\n1,a\n", ["way.csv:3", "position_m = 'a'"]),
            ("time_s,position_m\n0,0.1\n1\n", ["way.csv:3", "position_m = ''"]),
            ("time_s,position_m\n0,0.1\n1,nan\n", ["way.csv:3", "is no number"]),
            ("time_s,position_m\n0,0.1\n# c\n0,0.2\n", ["way.csv:4", "time_s = 0 s; allowed is above 0 s"]),
            ("time_s,position_m\n1,0.1\n2,0.2\n", ["way.csv:2", "begins at 0"]),
            ("time_s,position_m\n0,0.1\n1,0.6\n", ["way.csv:3", "0.6 m; allowed is 0 to 0.5 m"]),
            ("time_s,position_m\n0,0.2\n1,0.3\n", ["way.csv:2", "the axis is at 0.1 m"]),
            ("time_s,position_m\n0,0.1\n", ["way.csv: 1 points", "2 to 1000000"]),
        ] {
            let message = read(csv, "").unwrap_err();
            hints
                .iter()
                .for_each(|hint| assert!(message.contains(hint), "'{hint}' is missing in: {message}"));
            assert!(message.contains("e.toml:7: drive.set-point[1].file"), "{message}");
        }
        let message = read(WAY, "interpolation = \"cubic\"").unwrap_err();
        assert!(message.contains("linear, smooth"), "{message}");
    }

    #[test]
    fn a_missing_table_is_named() {
        let axis =
            "[drive]\nprogram = 'p'\nstart_m = 0.1\n[[drive.set-point]]\nlaw = 'table'\nfile = 'no.csv'\n";
        let text = &format!("title = 't'\n{axis}");
        let message = Experiment::from_toml(text, Path::new("e.toml"), 0.5).unwrap_err().to_string();
        assert!(message.contains("e.toml:7") && message.contains("cannot read no.csv"), "{message}");
    }
}
