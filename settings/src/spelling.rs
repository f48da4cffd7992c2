//! The word that was meant by one that is misspelt.

/// The known word of least edit distance, if that is at most a third of its length.
pub(crate) fn nearest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let distances = known.iter().map(|known| (edits(name, known), *known));
    let (edits, known) = distances.min_by_key(|(edits, _)| *edits)?;
    (3 * edits <= known.chars().count()).then_some(known)
}

/// Letters that are to be put in, left out or changed to get from one word to another [Levenshtein 1966].
pub(crate) fn edits(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (above, letter) in from.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], above + 1);
        for (place, other) in to.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = row[place + 1];
            row[place + 1] = changed.min(diagonal + 1).min(row[place] + 1);
        }
    }
    row[to.len()]
}
