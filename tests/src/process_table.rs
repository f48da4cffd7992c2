//! The processes of this machine, as `/proc` lists them.

use std::fs;
use std::path::{Path, PathBuf};

/// Ticks of a second in `/proc`, on every Linux of x86 and ARM.
const USER_HZ: f64 = 100.0;

/// The line `stat` of a process or a thread.
#[derive(Clone, Debug)]
pub struct ProcessStat {
    pub number: u32,
    pub name: String,
    /// `R`, `S`, `T`, `Z` and the like, see proc(5).
    pub state: char,
    pub parent: u32,
    /// Processor time of user and system together, s.
    pub used_s: f64,
}

impl ProcessStat {
    /// Of the process with this number; `None` when there is none.
    pub fn of(number: u32) -> Option<Self> {
        Self::read(&Path::new("/proc").join(number.to_string()))
    }

    /// Of a folder `/proc/PID` or `/proc/PID/task/TID`.
    pub fn read(folder: &Path) -> Option<Self> {
        let stat = fs::read_to_string(folder.join("stat")).ok()?;
        // The name may hold anything, but ends with the last bracket.
        let (head, tail) = stat.rsplit_once(')')?;
        let (number, name) = head.split_once(" (")?;
        let fields: Vec<_> = tail.split_whitespace().collect();
        // utime and stime, the 14th and 15th of all fields; the state is the third.
        let ticks = |at: usize| fields.get(at - 3)?.parse::<f64>().ok();
        Some(Self {
            number: number.parse().ok()?,
            name: name.to_owned(),
            state: fields.first()?.chars().next()?,
            parent: fields.get(1)?.parse().ok()?,
            used_s: (ticks(14)? + ticks(15)?) / USER_HZ,
        })
    }

    /// All processes.
    pub fn all() -> impl Iterator<Item = Self> {
        folders().filter_map(|folder| Self::read(&folder))
    }

    /// Whether it runs, or can: one that has ended and that nobody has waited for is a zombie.
    pub fn is_alive(number: u32) -> bool {
        Self::of(number).is_some_and(|stat| stat.state != 'Z')
    }
}

/// Folders below `/proc` and command lines, with spaces between the arguments, of the processes whose command line holds `text`.
pub fn with_command_line(text: &str) -> impl Iterator<Item = (PathBuf, String)> {
    folders().filter_map(move |folder| {
        let line = fs::read(folder.join("cmdline")).ok()?;
        let line = String::from_utf8_lossy(&line).replace('\0', " ");
        line.contains(text).then_some((folder, line))
    })
}

fn folders() -> impl Iterator<Item = PathBuf> {
    let entries = fs::read_dir("/proc").expect("the kernel's list of processes").flatten();
    // `/proc/self` and the like name processes a second time.
    let is_number =
        |entry: &fs::DirEntry| entry.file_name().to_str().is_some_and(|name| name.parse::<u32>().is_ok());
    entries.filter(is_number).map(|entry| entry.path())
}
