//! Confusion matrices of truth and answer.

use crate::campaign::Campaign;
use crate::merge::Results;
use pagekit::grid::Grid;
use pagekit::page::escaped;

/// The matrices that the campaign's file asks for.
pub(super) fn section(campaign: &Campaign, results: &Results) -> String {
    let mut text = String::new();
    for [truth, answer] in &campaign.file.confusion {
        let (Some((rows, of_row)), Some((columns, of_column))) =
            (labels(results, truth), labels(results, answer))
        else {
            continue;
        };
        let mut counts = vec![vec![0_u64; columns.len()]; rows.len()];
        for (row, column) in of_row.iter().zip(&of_column) {
            counts[*row][*column] += 1;
        }
        let of_both = |(row, word): (usize, &String)| Some(counts[row][columns.binary_search(word).ok()?]);
        let right: u64 = rows.iter().enumerate().filter_map(of_both).sum();
        let head = std::iter::once(format!("{truth} \\ {answer}")).chain(columns.iter().cloned()).collect();
        let line = |(word, counts): (&String, &Vec<u64>)| {
            let cells =
                counts.iter().map(|count| if *count == 0 { "·".to_owned() } else { count.to_string() });
            std::iter::once(word.clone()).chain(cells).collect()
        };
        let rows = rows.iter().zip(&counts).map(line).collect();
        text += &format!(
            "<h2>{} and {}</h2>\n<p>The same in {right} of {} runs.</p>\n{}",
            escaped(truth),
            escaped(answer),
            results.runs,
            Grid { head, rows }.html()
        );
    }
    text
}

/// The distinct values of a column, sorted, and the index of each run's value.
fn labels(results: &Results, name: &str) -> Option<(Vec<String>, Vec<usize>)> {
    let words: Vec<String> = match results.words(name) {
        Some(words) => words.places.iter().map(|place| words.known[*place as usize].clone()).collect(),
        None => results.numbers(name)?.iter().map(ToString::to_string).collect(),
    };
    let mut known = words.clone();
    known.sort();
    known.dedup();
    // Each word is among those that are known.
    let places = words.iter().filter_map(|word| known.binary_search(word).ok()).collect();
    Some((known, places))
}
