//! Physics of the servo-pneumatic rig: two axes, linkage, sensors.
