//! The axis controllers behind a CAN bus.
