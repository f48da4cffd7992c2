//! The rig behind a CAN bus, in real time.
