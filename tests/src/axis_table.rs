//! `controller-drive.csv` and `controller-load.csv`: states of chains by name, and numbers that may be absent.

use crate::records;
use std::path::Path;

#[derive(Debug)]
pub struct AxisTable {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl AxisTable {
    /// Reads a table up to its last whole line; the process that wrote it may have been killed.
    pub fn read(path: &Path) -> Self {
        let text = records::text(path);
        let whole = &text[..=text.rfind('\n').expect("at least the head")];
        let fields = |line: &str| -> Vec<String> { line.split(',').map(str::to_owned).collect() };
        let mut lines = whole.lines();
        let columns = fields(lines.next().expect("a head"));
        let rows: Vec<_> = lines.map(fields).collect();
        for (row, cells) in rows.iter().enumerate() {
            assert_eq!(cells.len(), columns.len(), "{}: row {row}: {cells:?}", path.display());
        }
        Self { columns, rows }
    }

    pub fn texts(&self, name: &str) -> Vec<&str> {
        let place = self.columns.iter().position(|column| column == name);
        let place = place.unwrap_or_else(|| panic!("no column {name} in {:?}", self.columns));
        self.rows.iter().map(|row| row[place].as_str()).collect()
    }

    /// A column of numbers; where there is none, not a number.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let number = |text: &str| match text {
            "" => f64::NAN,
            text => text.parse().unwrap_or_else(|_| panic!("{name}: {text} is no number")),
        };
        self.texts(name).into_iter().map(number).collect()
    }

    /// The rig's cycle of each row.
    pub fn cycles(&self) -> Vec<usize> {
        self.numbers("time_s").into_iter().map(|time_s| (time_s * 1000.0).round() as usize).collect()
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// First row from `from` on in which the chain of column `chain` is in `state`.
    #[track_caller]
    pub fn first(&self, chain: &str, state: &str, from: usize) -> usize {
        let states = self.texts(chain);
        let found = states.iter().skip(from).position(|one| *one == state);
        found.map(|place| place + from).unwrap_or_else(|| {
            panic!("{chain} is never {state} from row {from} on, but {:?}", self.states(chain))
        })
    }

    /// The states of a chain in their order, each once for each time that it was entered.
    pub fn states(&self, chain: &str) -> Vec<&str> {
        let mut states = self.texts(chain);
        states.dedup();
        states
    }
}
