//! The embedded bus over real sockets: one host in a thread of its own, peers as programs open them, raw clients for what
//! no peer of ours would send.
//!
//! Nothing here depends on speed. That a frame does *not* come is shown by a later frame, the fence, which comes first.

mod barrier;
mod echo;
mod losses;
mod malformed;
mod peers;
mod socket_file;
mod support;
