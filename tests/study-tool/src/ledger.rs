//! The ledger of seeds: which were opened, with which program, and what was changed afterwards.
//!
//! ```text
//! seed < 100        development: thresholds may be chosen on its draws
//! any other seed    SHA-256 of the frozen program's sources, entered as [[fresh]] before its first draw is made
//! opened            by a draw, a figure or a failure: development from then on, for every later program; the frozen one may
//!                   continue with unseen draws; figures of later openings are listed beside those of the first
//! ```
//!
//! Worlds and twins of a seed use different random streams ([`crate::draws`]): each opening states which it saw.
//!
//! A figure measured on draws whose failures had been read before is optimistic by an unknown amount. The ledger makes that
//! visible; it cannot prevent draws with another copy of this program.

use crate::compare::{grid, reported};
use crate::folder::{FolderError, read};
use crate::interval::Rate;
use serde::Deserialize;
use std::fmt::Write;
use std::path::Path;
use toml::value::Datetime;

/// Seeds below this one are development seeds.
pub(crate) const FIRST_FRESH_SEED: u64 = 100;

/// Entered and opened seeds, as `tests/study/evidence/ledger.toml` holds them.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ledger {
    #[serde(default)]
    pub(crate) fresh: Vec<FreshSeed>,
    #[serde(default)]
    pub(crate) opening: Vec<Opening>,
}

/// A seed that was entered before its first draw.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FreshSeed {
    pub(crate) seed: u64,
    /// Of the sources of the judged program, in hexadecimal; the seed is its first 13 digits.
    pub(crate) sha256: String,
    pub(crate) commit: String,
    pub(crate) date: Datetime,
}

/// One run of a study whose results were seen.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Opening {
    pub(crate) seed: u64,
    pub(crate) study: String,
    pub(crate) date: Datetime,
    pub(crate) commit: String,
    /// Of the program's executable, as in its results; absent where several were judged.
    pub(crate) crc32: Option<String>,
    pub(crate) command: String,
    /// What was changed after the results were read.
    pub(crate) after: String,
    /// Name and `count/of`.
    pub(crate) figures: Vec<(String, Count)>,
}

/// `202/218`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Count {
    pub(crate) count: usize,
    pub(crate) of: usize,
}

impl TryFrom<String> for Count {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let parts =
            text.split_once('/').and_then(|(count, of)| Some((count.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((count, of)) if count <= of && of > 0 => Ok(Count { count, of }),
            _ => Err(format!("'{text}' is no count of so many, as 202/218")),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SeedError {
    #[error(
        "seed {0} is not in the ledger: seeds below {FIRST_FRESH_SEED} are for development; a fresh one comes from \
         `scripts/study seed` and is entered in tests/study/evidence/ledger.toml before its first draw"
    )]
    NotEntered(u64),
}

impl Ledger {
    /// Reads the ledger.
    ///
    /// # Errors
    /// [`FolderError`] when it cannot be read, has an unknown key, or a seed does not match its hash.
    pub fn read(path: &Path) -> Result<Self, FolderError> {
        let ledger: Ledger =
            toml::from_str(&read(path)?).map_err(|error| FolderError::content(path, error))?;
        if let Some(wrong) = ledger.fresh.iter().find(|fresh| seed_of(&fresh.sha256) != Some(fresh.seed)) {
            let what =
                format!("the seed of {} is {:?}, not {}", wrong.sha256, seed_of(&wrong.sha256), wrong.seed);
            return Err(FolderError::content(path, what));
        }
        Ok(ledger)
    }

    /// Refuses a seed whose draws may not be made.
    ///
    /// # Errors
    /// [`SeedError`] when the seed is neither for development nor entered.
    pub fn admit(&self, seed: u64) -> Result<(), SeedError> {
        let is_entered = || self.fresh.iter().any(|fresh| fresh.seed == seed);
        if seed < FIRST_FRESH_SEED || is_entered() { Ok(()) } else { Err(SeedError::NotEntered(seed)) }
    }

    /// The ledger in Markdown: every opening, every entered seed, and for each study of a seed its figures side by side, those
    /// of the first opening first.
    pub fn markdown(&self) -> String {
        let heads = [
            "seed",
            "study",
            "date",
            "commit",
            "program, CRC-32",
            "opened by",
            "what was changed afterwards",
        ];
        let openings = self.opening.iter().map(|opening| {
            let Opening { seed, study, date, commit, crc32, command, after, .. } = opening;
            let crc32 = crc32.clone().unwrap_or_default();
            vec![
                seed.to_string(),
                study.clone(),
                date.to_string(),
                commit.clone(),
                crc32,
                format!("`{command}`"),
                after.clone(),
            ]
        });
        let mut text = format!("## Openings\n\n{}", grid(&heads.map(str::to_owned), openings));
        text.push_str("\n## Seeds entered before their first draw\n\n");
        for fresh in &self.fresh {
            let FreshSeed { seed, sha256, commit, date } = fresh;
            let _ = writeln!(
                text,
                "- Seed {seed} was entered on {date} for the sources of {commit}, SHA-256\n  {sha256}."
            );
        }
        text.push_str("\n## First runs and later ones\n");
        let mut studies: Vec<(u64, &str)> = Vec::new();
        for opening in self.opening.iter().filter(|opening| !opening.figures.is_empty()) {
            if !studies.contains(&(opening.seed, &opening.study)) {
                studies.push((opening.seed, &opening.study));
            }
        }
        for (seed, study) in studies {
            let openings: Vec<_> = self
                .opening
                .iter()
                .filter(|opening| opening.seed == seed && opening.study == study)
                .collect();
            let mut heads = vec![format!("{study}, seed {seed}")];
            heads.extend(openings.iter().enumerate().map(|(at, opening)| {
                format!("{}, {}", if at == 0 { "first opening" } else { "opened again" }, opening.commit)
            }));
            let rows = openings[0].figures.iter().map(|(name, _)| {
                let cell = |opening: &&Opening| {
                    let found = opening.figures.iter().find(|(other, _)| other == name);
                    found.map_or(String::new(), |(_, Count { count, of })| reported(&Rate::new(*count, *of)))
                };
                let mut cells = vec![name.clone()];
                cells.extend(openings.iter().map(cell));
                cells
            });
            let _ = write!(text, "\n{}", grid(&heads, rows));
        }
        text
    }
}

/// The seed of a hash: its first 13 hexadecimal digits, which a JSON number holds exactly.
fn seed_of(sha256: &str) -> Option<u64> {
    let is_whole = sha256.len() == 64 && sha256.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_whole.then(|| u64::from_str_radix(&sha256[..13], 16).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "00000000000ff000000000000000000000000000000000000000000000000000";

    fn ledger(text: &str) -> Result<Ledger, FolderError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ledger.toml");
        std::fs::write(&path, text).unwrap();
        Ledger::read(&path)
    }

    fn opening(commit: &str, figure: &str) -> String {
        format!(
            "[[opening]]\nseed = 4\nstudy = \"s\"\ndate = 2026-11-23\ncommit = \"{commit}\"\ncommand = \"run\"\n\
             after = \"mended\"\nfigures = [[\"named\", \"{figure}\"]]\n"
        )
    }

    #[test]
    fn a_seed_is_for_development_or_entered_with_its_hash() {
        let text = format!("[[fresh]]\nseed = 255\nsha256 = \"{HASH}\"\ncommit = \"a\"\ndate = 2026-11-25\n");
        let fresh = ledger(&text).unwrap();
        assert_eq!(fresh.admit(99), Ok(()));
        assert_eq!(fresh.admit(255), Ok(()));
        assert_eq!(fresh.admit(256), Err(SeedError::NotEntered(256)));
        let chosen = ledger(&text.replace("255", "256")).unwrap_err().to_string();
        assert!(chosen.contains("Some(255), not 256"), "{chosen}");
    }

    #[test]
    fn the_page_shows_the_committed_ledger() {
        let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let table = Ledger::read(&tests.join("study/evidence/ledger.toml")).unwrap().markdown();
        let page = std::fs::read_to_string(tests.join("docs/seeds.md")).unwrap();
        assert!(page.contains(table.trim()), "run scripts/study ledger --write");
    }

    #[test]
    fn the_first_opening_stands_beside_later_ones_and_counts_are_counts() {
        let text = [opening("a", "9/10"), opening("b", "10/10")].concat();
        let page = ledger(&text).unwrap().markdown();
        let heads: Vec<&str> = page.lines().filter(|line| line.starts_with("## ")).collect();
        let wanted =
            ["## Openings", "## Seeds entered before their first draw", "## First runs and later ones"];
        assert_eq!(heads, wanted);
        assert!(page.contains("| s, seed 4 | first opening, a | opened again, b |"), "{page}");
        assert!(page.contains("| named | 9/10 (60 to 98 %) | 10/10 (72 to 100 %) |"), "{page}");
        for bad in ["11/10", "9 of 10", "0/0"] {
            assert!(ledger(&opening("a", bad)).unwrap_err().to_string().contains("no count"), "{bad}");
        }
        assert!(ledger("[[opened]]\n").unwrap_err().to_string().contains("opened"));
    }
}
