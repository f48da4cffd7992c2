//! Frames from the wire: 16 bytes of anything are no frame, none of `rig.dbc`, or one that encodes to the same bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use protocol::can::CanFrame;
use protocol::frames::Frame;

fuzz_target!(|bytes: [u8; 16]| {
    let Some(frame) = CanFrame::from_bytes(&bytes) else { return };
    match Frame::decode(&frame) {
        Ok(decoded) => {
            let encoded = decoded.encode().expect("what was decoded is in range");
            assert_eq!(encoded, frame, "{decoded:?}");
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
