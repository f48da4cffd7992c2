//! A disk that is soon full.

use std::path::PathBuf;
use std::process::Command;

/// A disk of a few hundred KiB, gone with its value.
pub struct SmallDisk {
    pub path: PathBuf,
}

impl SmallDisk {
    /// A disk of `kib` KiB at `path`, which is made; `None` where nobody may mount one.
    pub fn mount(path: PathBuf, kib: u32) -> Option<Self> {
        std::fs::create_dir(&path).expect("the folder can be written");
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", &format!("size={kib}k"), "tmpfs"]).arg(&path);
        mount.output().is_ok_and(|done| done.status.success()).then_some(Self { path })
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // What cannot be unmounted now goes when its last user does.
        let _ = Command::new("umount").arg("-l").arg(&self.path).status();
    }
}
