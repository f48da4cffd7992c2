//! Whether sensors of an axis are new, late or a duplicate, by the low 4 bits of their cycle and their content.

use protocol::frames::{ALIVE_RANGE, Sensors};

/// Sensors at most so many cycles older than the newest of their axis may be late ones; beyond, they are new, after a long gap.
const LATEST: u64 = 3;

/// How a frame of sensors relates to the earlier ones of its axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SensorArrival {
    Newer,
    /// It arrives after newer ones.
    Late,
    /// Counter and content equal those of a received one.
    Duplicate,
}

/// The newest sensors of an axis, as far back as their counter tells them apart.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RecentSensors {
    /// By counter; `None` where they did not come.
    frames: [Option<Sensors>; ALIVE_RANGE as usize],
    newest: Option<u64>,
}

impl RecentSensors {
    /// Takes a frame in.
    ///
    /// A counter that seems to be behind is a late frame only where one is missing. Else so many frames were lost that the
    /// counter came round.
    pub(super) fn take(&mut self, sensors: &Sensors) -> SensorArrival {
        let alive = u64::from(sensors.alive) % ALIVE_RANGE;
        let Some(newest) = self.newest else {
            self.newest = Some(alive);
            self.frames[alive as usize] = Some(*sensors);
            return SensorArrival::Newer;
        };
        let ahead = (ALIVE_RANGE + alive - newest) % ALIVE_RANGE;
        let place = &mut self.frames[alive as usize];
        if ahead == 0 || ahead >= ALIVE_RANGE - LATEST {
            match place {
                Some(known) if known == sensors => return SensorArrival::Duplicate,
                None => {
                    *place = Some(*sensors);
                    return SensorArrival::Late;
                }
                Some(_) => {}
            }
        }
        let round = if ahead == 0 { ALIVE_RANGE } else { ahead };
        for missing in newest + 1..newest + round {
            self.frames[(missing % ALIVE_RANGE) as usize] = None;
        }
        self.frames[alive as usize] = Some(*sensors);
        self.newest = Some(alive);
        SensorArrival::Newer
    }
}
