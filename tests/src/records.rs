//! The files of a run, read as strictly as they are promised: whole lines, every field, nothing half.

use protocol::can::CanFrame;
use runlog::timing::{self, CycleTiming};
use serde_json::Value;
use std::path::Path;

pub fn json(path: &Path) -> Value {
    serde_json::from_str(&text(path)).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A number that is counted in a JSON file, by its path of keys.
#[track_caller]
pub fn count(value: &Value, pointer: &str) -> u64 {
    value
        .pointer(pointer)
        .and_then(Value::as_u64)
        .unwrap_or_else(|| panic!("no count {pointer} in {value:#}"))
}

/// A count by identifier, 0 where the identifier is not in the table.
#[track_caller]
pub fn count_of_id(table: &Value, id: &str) -> u64 {
    let table = table.as_object().unwrap_or_else(|| panic!("no table by identifier: {table}"));
    table.get(id).map_or(0, |count| count.as_u64().expect("a count"))
}

/// The entry of a list in a JSON file whose `key` is `value`.
#[track_caller]
pub fn find<'a>(list: &'a Value, key: &str, value: &str) -> &'a Value {
    let entries = list.as_array().unwrap_or_else(|| panic!("no list: {list:#}"));
    let found = entries.iter().find(|entry| entry[key] == value);
    found.unwrap_or_else(|| panic!("no {key} {value} in {list:#}"))
}

/// Sensors with this identifier that found no room at a process, which a machine under load kept from its work.
pub fn dropped_at_queue(summary: &Value, process: u32, id: &str) -> u64 {
    let peer = find(&summary["bus_host"]["peers"], "name", &format!("process {process}"));
    count_of_id(&peer["dropped_at_queue"], id)
}

pub fn same(one: &Path, other: &Path) -> bool {
    let read =
        |path: &Path| std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    read(one) == read(other)
}

/// Holds that files of two folders are the same to the byte; of one that is not `what` is said, such as `differs`.
#[track_caller]
pub fn expect_same(one: &Path, other: &Path, files: &[&str], what: &str) {
    for file in files {
        assert!(same(&one.join(file), &other.join(file)), "{file} {what}");
    }
}

pub fn timing_rows(path: &Path) -> Vec<CycleTiming> {
    timing::read(&text(path)).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[derive(Debug)]
pub struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads a table that was closed properly.
    pub fn read(path: &Path) -> Self {
        let text = text(path);
        assert!(text.ends_with('\n'), "{}: the last line is cut: {:?}", path.display(), text.lines().last());
        Self::parse(path, &text)
    }

    /// Reads a table whose writer was killed: up to its last whole line.
    pub fn read_to_last_whole_line(path: &Path) -> Self {
        let text = text(path);
        Self::parse(path, &text[..=text.rfind('\n').expect("at least the head")])
    }

    fn parse(path: &Path, text: &str) -> Self {
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#'));
        let (_, head) = lines.next().unwrap_or_else(|| panic!("{} is empty", path.display()));
        let columns: Vec<String> = head.split(',').map(str::to_owned).collect();
        let row = |(index, line): (usize, &str)| {
            let numbers: Option<Vec<f64>> = line.split(',').map(|field| field.parse().ok()).collect();
            numbers
                .filter(|numbers| numbers.len() == columns.len())
                .unwrap_or_else(|| panic!("{}:{}: no row: {line:?}", path.display(), index + 1))
        };
        Self { rows: lines.map(row).collect(), columns }
    }

    pub fn column(&self, name: &str) -> Vec<f64> {
        let index = self.columns.iter().position(|column| column == name);
        let index = index.unwrap_or_else(|| panic!("no column {name} in {:?}", self.columns));
        self.rows.iter().map(|row| row[index]).collect()
    }

    pub fn names(&self) -> &[String] {
        &self.columns
    }

    pub fn len(&self) -> usize {
        self.rows.len()
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Holds that row k is that of cycle k, from 0 on without a hole.
    #[track_caller]
    pub fn expect_no_hole(&self) {
        for (row, time_s) in self.column("time_s").into_iter().enumerate() {
            assert_eq!((time_s * 1000.0).round() as usize, row, "row {row} is that of {time_s} s");
        }
    }
}

/// Holds that a table, whatever its fields, consists of whole lines. Returns how many rows it has.
#[track_caller]
pub fn expect_whole_lines(path: &Path) -> usize {
    let text = text(path);
    assert!(text.ends_with('\n'), "{}: the last line is cut: {:?}", path.display(), text.lines().last());
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let fields = |line: &str| line.split(',').count();
    let head = fields(lines.next().expect("a head"));
    lines.inspect(|line| assert_eq!(fields(line), head, "{}: {line:?}", path.display())).count()
}

/// The frames of a `bus.log`, each line checked for candump's form.
pub fn bus_log(path: &Path) -> Vec<CanFrame> {
    let text = text(path);
    assert!(text.is_empty() || text.ends_with('\n'), "{}: the last line is cut", path.display());
    log_lines(path, &text)
}

/// The frames of a `bus.log` whose writer was killed, up to the last whole line.
pub fn bus_log_to_last_whole_line(path: &Path) -> Vec<CanFrame> {
    let text = text(path);
    log_lines(path, &text[..text.rfind('\n').map_or(0, |end| end + 1)])
}

fn log_lines(path: &Path, text: &str) -> Vec<CanFrame> {
    let lines = text.lines().enumerate();
    lines
        .map(|(index, line)| {
            log_line(line).unwrap_or_else(|| panic!("{}:{}: {line:?}", path.display(), index + 1))
        })
        .collect()
}

/// `(0000000001.234567) bus0 120#0011`; extended identifiers have eight digits, remote frames an R for data.
fn log_line(line: &str) -> Option<CanFrame> {
    let (stamp, rest) = line.strip_prefix('(')?.split_once(") ")?;
    let (seconds, fraction) = stamp.split_once('.')?;
    let digits = |text: &str, count| text.len() == count && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(seconds, 10) || !digits(fraction, 6) {
        return None;
    }
    let (id, data) = rest.strip_prefix("bus0 ")?.split_once('#')?;
    let number = u32::from_str_radix(id, 16).ok()?;
    let number = match id.len() {
        3 => number,
        8 => number | protocol::can::EXTENDED_FLAG,
        _ => return None,
    };
    if let Some(length) = data.strip_prefix('R') {
        let known = length.is_empty() || length.parse::<u8>().is_ok_and(|length| length <= 8);
        return known.then(|| CanFrame::from_raw(number | protocol::can::REMOTE_FLAG, &[]));
    }
    let byte = |at: usize| u8::from_str_radix(data.get(at..at + 2)?, 16).ok();
    let bytes: Vec<u8> = (0..data.len()).step_by(2).map(byte).collect::<Option<_>>()?;
    (bytes.len() <= 8).then(|| CanFrame::from_raw(number, &bytes))
}

pub fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
