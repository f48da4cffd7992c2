//! A Unix socket as a file, for this user alone: its folder, its lock, and the listener that lets peers in.
//!
//! The socket is guarded by a lock file beside it: whoever holds the lock may remove a stale socket; a second host is
//! refused. The lock goes with the process that holds it, however it ends. The embedded bus and the telemetry have one each.

use rustix::fs::{FlockOperation, Mode, OFlags};
use rustix::io::Errno;
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags};
use rustix::process::Uid;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt};
use std::path::{Path, PathBuf};

/// Connections that wait to be accepted.
const BACKLOG: i32 = 64;

pub use rustix::net::SocketType;

/// Why a socket's file cannot be taken into service.
#[derive(Debug, thiserror::Error)]
pub enum SocketFileError {
    /// Another process serves there; it holds this lock.
    #[error("another process serves there (lock file {0})")]
    Taken(String),
    /// The folder is not this user's alone.
    #[error("{0}")]
    NotPrivate(io::Error),
    /// Error of the system.
    #[error(transparent)]
    System(#[from] io::Error),
}

/// The socket's file, taken into service; goes with the value.
pub struct SocketFile {
    listener: OwnedFd,
    /// Held for the moment in which the process has no descriptor left; `None` when not even this could be had again.
    spare: Option<OwnedFd>,
    path: PathBuf,
    // Last, so that the lock outlives the socket file, which `drop` removes.
    _lock: OwnedFd,
}

impl SocketFile {
    /// Makes folder, lock and socket of this type at `path`. With `private`, a folder that is there must be this user's alone:
    /// for paths that anybody can foresee.
    ///
    /// # Errors
    /// [`SocketFileError`].
    pub fn bind(path: &Path, socket_type: SocketType, private: bool) -> Result<Self, SocketFileError> {
        if let Some(folder) = path.parent() {
            make_private(folder)?;
            if private {
                check_private(folder, rustix::process::getuid()).map_err(SocketFileError::NotPrivate)?;
            }
        }
        let (lock, lock_path) = open_beside(path, ".lock")?;
        if rustix::fs::flock(&lock, FlockOperation::NonBlockingLockExclusive).is_err() {
            return Err(SocketFileError::Taken(lock_path.display().to_string()));
        }
        let listener = listen(path, socket_type)?;
        Ok(Self { listener, spare: spare(), path: path.into(), _lock: lock })
    }

    /// The next peer that waits, non-blocking; `None` when none does, or none can be taken.
    ///
    /// With no descriptor left, the spare one is given up to take the peer and turn it away at once: it sees its end and tries
    /// again, and the listener does not stay readable, which would keep the host turning without rest.
    pub fn accept(&mut self) -> Option<OwnedFd> {
        loop {
            match rustix::net::accept_with(&self.listener, SocketFlags::CLOEXEC | SocketFlags::NONBLOCK) {
                Ok(peer) => {
                    self.spare = self.spare.take().or_else(spare);
                    return Some(peer);
                }
                Err(Errno::MFILE | Errno::NFILE) => {
                    self.spare.take()?;
                    let turned_away =
                        rustix::net::accept_with(&self.listener, SocketFlags::CLOEXEC).map(drop);
                    self.spare = spare();
                    // The kernel looks for a descriptor first: nobody may have waited.
                    turned_away.ok()?;
                }
                Err(Errno::CONNABORTED | Errno::INTR) => {}
                Err(_) => return None,
            }
        }
    }
}

impl AsFd for SocketFile {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.listener.as_fd()
    }
}

impl Drop for SocketFile {
    fn drop(&mut self) {
        // Gone already is as good as removed.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The right to be the next who serves at a path that several processes would take by themselves; goes with the value.
pub struct Reservation {
    _lock: OwnedFd,
}

impl Reservation {
    /// Reserves `path`; `None` when a process serves there or has reserved it, or its folder is not this user's alone.
    ///
    /// Who binds the socket without asking is not kept from it: what it then meets is [`SocketFileError::Taken`].
    #[must_use]
    pub fn of(path: &Path, socket_type: SocketType) -> Option<Self> {
        let folder = path.parent()?;
        make_private(folder).ok()?;
        check_private(folder, rustix::process::getuid()).ok()?;
        let (lock, _) = open_beside(path, ".reserved").ok()?;
        rustix::fs::flock(&lock, FlockOperation::NonBlockingLockExclusive).ok()?;
        (!is_served(path, socket_type)).then_some(Self { _lock: lock })
    }
}

/// Whether a process listens at `path`. Its lock is not tried, since a host that begins in that moment would find it taken.
fn is_served(path: &Path, socket_type: SocketType) -> bool {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let connected = rustix::net::socket_with(AddressFamily::UNIX, socket_type, flags, None)
        .and_then(|socket| rustix::net::connect(&socket, &SocketAddrUnix::new(path)?));
    !matches!(connected, Err(Errno::NOENT | Errno::CONNREFUSED))
}

fn spare() -> Option<OwnedFd> {
    rustix::fs::open("/dev/null", OFlags::RDONLY | OFlags::CLOEXEC, Mode::empty()).ok()
}

/// Makes the folder for this user alone; one that exists is left as it is.
fn make_private(folder: &Path) -> io::Result<()> {
    if folder.exists() {
        return Ok(());
    }
    std::fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)
}

/// Refuses a folder that somebody else made or may write.
fn check_private(folder: &Path, user: Uid) -> io::Result<()> {
    let found = std::fs::symlink_metadata(folder)?;
    let problem = if !found.is_dir() {
        "is no folder"
    } else if found.uid() != user.as_raw() {
        "belongs to another user"
    } else if found.mode() & 0o022 != 0 {
        "can be written by others"
    } else {
        return Ok(());
    };
    Err(io::Error::new(io::ErrorKind::PermissionDenied, format!("{} {problem}", folder.display())))
}

/// Opens the file to lock, whose name ends in `ending`.
fn open_beside(path: &Path, ending: &str) -> io::Result<(OwnedFd, PathBuf)> {
    // Added, not in place of an extension: buses `rig.a` and `rig.b` are two.
    let mut lock_path = path.as_os_str().to_owned();
    lock_path.push(ending);
    let lock_path = PathBuf::from(lock_path);
    let flags = OFlags::CREATE | OFlags::RDWR | OFlags::CLOEXEC | OFlags::NOFOLLOW;
    let lock = rustix::fs::open(&lock_path, flags, Mode::RUSR | Mode::WUSR)?;
    Ok((lock, lock_path))
}

fn listen(path: &Path, socket_type: SocketType) -> io::Result<OwnedFd> {
    // We hold the lock, so a socket file that is still there belongs to a host that is gone. Anything else stays.
    match std::fs::symlink_metadata(path) {
        Ok(found) if found.file_type().is_socket() => std::fs::remove_file(path)?,
        Ok(_) => {
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, "the path is taken by another file"));
        }
        Err(_) => {}
    }
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let listener = rustix::net::socket_with(AddressFamily::UNIX, socket_type, flags, None)?;
    rustix::net::bind(&listener, &SocketAddrUnix::new(path)?)?;
    rustix::fs::chmod(path, Mode::RUSR | Mode::WUSR)?;
    rustix::net::listen(&listener, BACKLOG)?;
    Ok(listener)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::process::getuid;
    use std::fs::Permissions;
    use std::os::unix::fs::PermissionsExt;

    fn problem(folder: &Path, user: Uid) -> String {
        check_private(folder, user).unwrap_err().to_string()
    }

    #[test]
    fn a_path_is_reserved_by_one_and_by_nobody_where_a_process_serves() {
        let place = tempfile::tempdir().unwrap();
        std::fs::set_permissions(place.path(), Permissions::from_mode(0o700)).unwrap();
        let path = place.path().join("bus0");
        let reserve = || Reservation::of(&path, SocketType::SEQPACKET);
        let first = reserve();
        assert!(first.is_some() && reserve().is_none());
        // Who has reserved it, or a process of his, binds it.
        let served = SocketFile::bind(&path, SocketType::SEQPACKET, true).unwrap();
        drop(first);
        assert!(reserve().is_none());
        drop(served);
        assert!(reserve().is_some());
        // A socket that a killed host left behind.
        let listener = listen(&path, SocketType::SEQPACKET).unwrap();
        drop(listener);
        assert!(path.exists() && reserve().is_some());
        std::fs::set_permissions(place.path(), Permissions::from_mode(0o770)).unwrap();
        assert!(reserve().is_none());
    }

    #[test]
    fn a_default_folder_that_others_made_or_may_write_is_refused() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("airbench");
        make_private(&folder).unwrap();
        check_private(&folder, getuid()).unwrap();
        let another = Uid::from_raw(getuid().as_raw() + 1);
        assert!(problem(&folder, another).ends_with("airbench belongs to another user"));
        for mode in [0o720, 0o702] {
            std::fs::set_permissions(&folder, Permissions::from_mode(mode)).unwrap();
            assert!(problem(&folder, getuid()).ends_with("can be written by others"), "{mode:o}");
        }
        // A link would lead wherever its maker likes, later too.
        let link = place.path().join("link");
        std::os::unix::fs::symlink(place.path(), &link).unwrap();
        assert!(problem(&link, getuid()).ends_with("is no folder"));
    }
}
