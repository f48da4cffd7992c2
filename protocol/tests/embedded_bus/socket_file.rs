//! The socket's file and its lock: whose it is, who may use it, and who may remove it.

use super::support::*;
use protocol::bus::host::Host;
use protocol::bus::{BusError, WireOptions};
use std::fs;
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::UnixListener;

fn mode(path: &std::path::Path) -> u32 {
    fs::symlink_metadata(path).unwrap().permissions().mode() & 0o777
}

#[test]
fn the_socket_is_for_its_user_alone_and_goes_with_its_host() {
    let place = Place::new();
    let folder = place.folder.path().join("a/b");
    let path = folder.join("bus0");
    let host = RunningHost::plain(&path);
    assert!(fs::symlink_metadata(&path).unwrap().file_type().is_socket());
    assert_eq!((mode(&path), mode(&folder)), (0o600, 0o700));
    assert!(is_served(&path));
    host.stop();
    assert!(!path.exists());
    assert!(!is_served(&path));
}

#[test]
fn a_socket_that_a_dead_host_left_is_taken_over() {
    let place = Place::new();
    // Closing a listener leaves its file, just as a host that was killed does.
    drop(UnixListener::bind(place.socket()).unwrap());
    assert!(place.socket().exists() && !is_served(&place.socket()));
    let host = RunningHost::plain(&place.socket());
    let [mut one, mut two] = connected(&place.socket());
    one.send(&numbered(1, 1)).unwrap();
    assert_eq!(next_frame(two.as_mut()).0, numbered(1, 1));
    host.stop();
}

#[test]
fn a_live_host_is_neither_replaced_nor_disturbed() {
    let (place, host, [mut one, mut two]) = served();
    let Err(BusError::HostExists { lock, .. }) = Host::bind(&place.socket(), WireOptions::default(), None)
    else {
        panic!("a second host was let in");
    };
    assert_eq!(lock, place.folder.path().join("bus0.lock").display().to_string());
    one.send(&numbered(1, 1)).unwrap();
    assert_eq!(next_frame(two.as_mut()).0, numbered(1, 1));
    assert_eq!((one.counters().disconnects, two.counters().disconnects), (0, 0));
    host.stop();
    // The lock went with its holder, though its file is still there.
    assert!(place.folder.path().join("bus0.lock").exists());
    RunningHost::plain(&place.socket()).stop();
}

#[test]
fn a_file_that_is_no_socket_is_refused_and_kept() {
    let place = Place::new();
    fs::write(place.socket(), "precious").unwrap();
    let Err(error) = Host::bind(&place.socket(), WireOptions::default(), None) else {
        panic!("a host was bound over a regular file");
    };
    assert!(
        matches!(error, BusError::Open { .. }) && error.to_string().contains("taken by another file"),
        "{error}"
    );
    assert_eq!(fs::read_to_string(place.socket()).unwrap(), "precious");
}

#[test]
fn buses_whose_names_differ_after_a_dot_do_not_share_a_lock() {
    let place = Place::new();
    let hosts = ["rig.one", "rig.two", "rig"].map(|name| RunningHost::plain(&place.folder.path().join(name)));
    for host in hosts {
        host.stop();
    }
}
