//! A folder for the sockets of a run that only this user can read, and buses outside it.

use crate::FrontError;
use protocol::bus::BusUrl;
use protocol::socket_file::{Reservation, SocketType};
use std::fs::{self, DirBuilder};
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::path::PathBuf;

/// A folder for sockets that is removed with all its files on drop.
#[derive(Debug)]
pub(crate) struct PrivateFolder(pub(crate) PathBuf);

impl PrivateFolder {
    /// Below `$XDG_RUNTIME_DIR`, else below the temporary folder.
    pub(crate) fn make() -> Result<Self, FrontError> {
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").filter(|folder| !folder.is_empty());
        let above = runtime.map_or_else(std::env::temp_dir, PathBuf::from);
        for number in 0.. {
            let folder = above.join(format!("airbench.{}-{number}", std::process::id()));
            match DirBuilder::new().mode(0o700).create(&folder) {
                Ok(()) => return Ok(Self(folder)),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => {
                    let folder = folder.display();
                    return Err(FrontError::Input(format!("cannot make the folder {folder}: {error}")));
                }
            }
        }
        unreachable!("a number that no folder has")
    }

    /// URL of the embedded bus whose socket lies in the folder.
    pub(crate) fn bus(&self) -> String {
        format!("unix://{}/bus0", self.0.display())
    }
}

impl Drop for PrivateFolder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[derive(Default)]
pub(crate) struct RunBus {
    /// URL of the bus, `can://…` or `unix://…`.
    pub(crate) url: String,
    /// A folder for sockets, if the run has its own.
    pub(crate) private: Option<PrivateFolder>,
    /// Keeps other runs from taking the same bus by default.
    pub(crate) reservation: Option<Reservation>,
}

impl RunBus {
    /// The requested bus; else vcan0, when it is up and this is real time; else an embedded bus in a private folder.
    pub(crate) fn of_its_own(asked: Option<&str>, simulated_time: bool) -> Result<Self, FrontError> {
        match asked {
            Some(bus) => Ok(Self { url: bus.into(), ..Self::default() }),
            None if !simulated_time && vcan_usable() => {
                Ok(Self { url: "can://vcan0".into(), ..Self::default() })
            }
            None => {
                let private = PrivateFolder::make()?;
                Ok(Self { url: private.bus(), private: Some(private), reservation: None })
            }
        }
    }

    /// As [`RunBus::of_its_own`], but in real time the default embedded bus of the user, where other programs expect it, unless
    /// it is taken.
    pub(crate) fn for_others(asked: Option<&str>, simulated_time: bool) -> Result<Self, FrontError> {
        let bus = BusUrl::default_embedded();
        let reservation = match &bus {
            BusUrl::Unix { path, .. } if asked.is_none() && !simulated_time && !vcan_usable() => {
                Reservation::of(path, SocketType::SEQPACKET)
            }
            _ => None,
        };
        if reservation.is_none() {
            return Self::of_its_own(asked, simulated_time);
        }
        Ok(Self { url: bus.to_string(), private: None, reservation })
    }
}

/// Whether vcan0 (or any CAN interface of that name) is up: `/sys` has its type, 280 for CAN, and its flags, bit 0 for up.
fn vcan_usable() -> bool {
    let read = |file: &str| fs::read_to_string(format!("/sys/class/net/vcan0/{file}")).unwrap_or_default();
    let flags = u32::from_str_radix(read("flags").trim().trim_start_matches("0x"), 16).unwrap_or(0);
    read("type").trim() == "280" && flags & 1 == 1
}
