//! Confusion matrices of truth and answer.

use crate::campaign::Campaign;
use crate::merge::Results;
use pagekit::grid::Grid;
use pagekit::page::escaped;

/// The matrices that the campaign's file asks for.
pub(super) fn section(campaign: &Campaign, results: &Results) -> String {
    let mut text = String::new();
    for [truth, answer] in &campaign.file.confusion {
        let (Some(rows), Some(columns)) = (labels(results, truth), labels(results, answer)) else { continue };
        let mut counts = vec![vec![0_u64; columns.known.len()]; rows.known.len()];
        for (row, column) in rows.places.iter().zip(&columns.places) {
            counts[*row][*column] += 1;
        }
        let right: u64 = rows
            .known
            .iter()
            .enumerate()
            .filter_map(|(row, word)| {
                Some(counts[row][columns.known.iter().position(|other| other == word)?])
            })
            .sum();
        let head =
            std::iter::once(format!("{truth} \\ {answer}")).chain(columns.known.iter().cloned()).collect();
        let line = |(word, counts): (&String, &Vec<u64>)| {
            let cells =
                counts.iter().map(|count| if *count == 0 { "·".to_owned() } else { count.to_string() });
            std::iter::once(word.clone()).chain(cells).collect()
        };
        let rows = rows.known.iter().zip(&counts).map(line).collect();
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
struct Labels {
    known: Vec<String>,
    places: Vec<usize>,
}

fn labels(results: &Results, name: &str) -> Option<Labels> {
    let words: Vec<String> = match results.words(name) {
        Some(words) => words.places.iter().map(|place| words.known[*place as usize].clone()).collect(),
        None => results.numbers(name)?.iter().map(ToString::to_string).collect(),
    };
    let mut known = words.clone();
    known.sort();
    known.dedup();
    // Each word is among those that are known.
    let places = words.iter().filter_map(|word| known.binary_search(word).ok()).collect();
    Some(Labels { known, places })
}
