//! Data of the system about processes, files and interfaces.

use super::memory::Sample;
use std::path::Path;

/// Memory of a process; `None` when it has ended. With `pss` the kernel walks all pages and locks the address space briefly, so
/// it is sampled rarely.
pub(super) fn memory(pid: u32, at_s: f64, pss: bool) -> Option<Sample> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let pss_kib = pss
        .then(|| std::fs::read_to_string(format!("/proc/{pid}/smaps_rollup")).ok())
        .flatten()
        .and_then(|text| kib(&text, "Pss:"));
    // A zombie has a status without memory.
    Some(Sample { at_s, rss_kib: kib(&status, "VmRSS:")?, peak_rss_kib: kib(&status, "VmHWM:")?, pss_kib })
}

fn kib(text: &str, key: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(key))?.split_whitespace().next()?.parse().ok()
}

/// Bytes of all files in a folder, recursively.
pub(super) fn folder_bytes(folder: &Path) -> u64 {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    let bytes = entries.filter_map(Result::ok).map(|entry| match entry.file_type() {
        Ok(kind) if kind.is_dir() => folder_bytes(&entry.path()),
        Ok(_) => entry.metadata().map_or(0, |data| data.len()),
        Err(_) => 0,
    });
    bytes.sum()
}

/// Free bytes for this user on the disk of a folder; `None` when the system does not report them.
pub(super) fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail * disk.f_frsize)
}

/// Frames sent by an interface since it exists; `None` when the system does not report them.
pub(super) fn sent_by_interface(interface: &str) -> Option<u64> {
    let path = format!("/sys/class/net/{interface}/statistics/tx_packets");
    std::fs::read_to_string(path).ok()?.trim().parse().ok()
}

/// Number of sockets that receive all frames of a CAN interface, error frames apart; `None` without CAN in the kernel.
pub(super) fn listeners(interface: &str) -> Option<usize> {
    let list = std::fs::read_to_string("/proc/net/can/rcvlist_all").ok()?;
    Some(list.lines().filter(|line| line.split_whitespace().next() == Some(interface)).count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_has_memory_and_one_that_is_not_has_none() {
        let sample = memory(std::process::id(), 1.5, true).unwrap();
        assert!(sample.rss_kib > 100 && sample.peak_rss_kib >= sample.rss_kib / 2, "{sample:?}");
        assert_eq!(sample.at_s, 1.5);
        assert_eq!(memory(u32::MAX, 0.0, false), None);
    }

    #[test]
    fn bytes_of_a_folder_are_those_of_all_files_in_it() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("below")).unwrap();
        std::fs::write(folder.path().join("a"), [0; 10]).unwrap();
        std::fs::write(folder.path().join("below/b"), [0; 5]).unwrap();
        assert_eq!(folder_bytes(folder.path()), 15);
        assert_eq!(folder_bytes(Path::new("/nowhere")), 0);
        assert!(free_bytes(folder.path()).is_some());
    }
}
