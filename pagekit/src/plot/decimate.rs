//! Long series made as short as a drawing can show: of each column the smallest and the largest value, so that no spike is lost.

/// Columns of a drawing; twice as many points at most.
pub const COLUMNS: usize = 500;

/// A column of a series: its middle, the smallest and the largest value in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Of its first value, s.
    pub time_s: f64,
    /// Smallest value, in the unit of the series.
    pub(crate) low: f64,
    /// Largest value.
    pub(crate) high: f64,
}

/// Pieces of a series without a gap: points where there are few, columns where there are many. Values that are not finite, and
/// pauses of more than [`PAUSE`] usual steps, end a piece.
pub fn columns(time_s: &[f64], values: &[f64], most: usize) -> Vec<Vec<Column>> {
    let points: Vec<(f64, f64)> = time_s.iter().copied().zip(values.iter().copied()).collect();
    let (Some(first), Some(last)) = (time_s.first(), time_s.last()) else { return Vec::new() };
    let count = points.len();
    let step_s = (last - first) / (count.max(2) - 1) as f64;
    let length_s = (last - first).max(f64::MIN_POSITIVE);
    let place = |time: f64| (((time - first) / length_s * most as f64) as usize).min(most.saturating_sub(1));
    let is_whole = |(time, value): &(f64, f64)| time.is_finite() && value.is_finite();
    let mut pieces: Vec<Vec<Column>> = Vec::new();
    let mut before: Option<(f64, usize)> = None;
    for point in &points {
        if !is_whole(point) {
            before = None;
            continue;
        }
        let (time, value) = *point;
        let bin = if count <= 2 * most { usize::MAX } else { place(time) };
        let joins = before.is_some_and(|(earlier, _)| time - earlier <= PAUSE * step_s.max(0.0));
        if !joins {
            pieces.push(Vec::new());
        }
        let shares = joins && bin != usize::MAX && before.is_some_and(|(_, column)| column == bin);
        before = Some((time, bin));
        let Some(piece) = pieces.last_mut() else { continue };
        match piece.last_mut().filter(|_| shares) {
            Some(column) => {
                column.low = column.low.min(value);
                column.high = column.high.max(value);
            }
            None => piece.push(Column { time_s: time, low: value, high: value }),
        }
    }
    pieces
}

/// Usual steps without a sample that break a line.
const PAUSE: f64 = 20.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_spike_is_lost_and_no_drawing_gets_more_points_than_it_can_show() {
        let time_s: Vec<f64> = (0..48_000).map(|ms| f64::from(ms) * 1e-3).collect();
        let mut values = vec![0.0; time_s.len()];
        (values[31_416], values[7]) = (7.0, -3.0);
        let pieces = columns(&time_s, &values, COLUMNS);
        assert_eq!(pieces.len(), 1);
        assert!(pieces[0].len() <= COLUMNS, "{}", pieces[0].len());
        assert!(pieces[0].iter().any(|column| column.high == 7.0));
        assert!(pieces[0].iter().any(|column| column.low == -3.0));
        assert!(pieces[0].is_sorted_by(|one, other| one.time_s < other.time_s));
    }

    #[test]
    fn what_is_missing_breaks_the_line_and_few_points_stay_as_they_are() {
        let time_s = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5];
        let pieces = columns(&time_s, &[1.0, 2.0, f64::NAN, 4.0, 5.0, 6.0], COLUMNS);
        assert_eq!(pieces.iter().map(Vec::len).collect::<Vec<_>>(), [2, 3]);
        assert!(columns(&[], &[], COLUMNS).is_empty());
        let far: Vec<f64> = (0..100).map(f64::from).chain((200..300).map(f64::from)).collect();
        assert_eq!(columns(&far, &[0.0; 200], COLUMNS).len(), 2);
    }
}
