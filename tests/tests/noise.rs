//! Ten thousand frames of noise a second while the loop runs, in real time: counted, and never obeyed.
//!
//! How much of the loop's time it costs is measured by `scripts/noise`.

use system_tests::noise::{self, PER_SECOND};

const SECONDS: u32 = 4;

#[test]
fn no_opening_acts_that_no_controller_sent() {
    let with = noise::run(SECONDS, PER_SECOND, 1);
    assert!(with.sent.frames > 20_000, "{with:?}");
    assert!(with.openings.acted > 3000, "{with:?}");
    assert_eq!(with.openings.not_sent, 0, "{with:?}");
    assert!(with.openings.shut == 0 || with.stale > 0, "shut, and no command was stale: {with:?}");
    // The last ones may come after the rig's end.
    assert!(with.malformed > 0 && with.malformed <= with.sent.malformed, "{with:?}");
    assert!(with.unknown <= with.sent.frames - with.sent.malformed, "{with:?}");
}
