//! The numbers of an integrator in another form: see [`Form`].

use super::{Integrator, Span};
use crate::lanes::Form;

impl Integrator {
    /// What a smooth substep needs, in another form.
    ///
    /// Parts of a substep are made by the integrator itself, one rig at a time: the fine span of another form is not its own.
    #[inline(always)]
    pub(crate) fn formed<P: Copy, F: Form<P>>(&self, form: &mut F) -> Integrator<P> {
        let coarse = self.coarse.formed(form);
        Integrator {
            valve: self.valve.formed(form),
            chambers: self.chambers.formed(form),
            motion: self.motion.formed(form),
            linkage: self.linkage.formed(form),
            supply: self.supply.formed(form),
            atmospheric_pa: form.one(self.atmospheric_pa),
            file_dead_volume_m3: form.one(self.file_dead_volume_m3),
            substeps: self.substeps,
            fine: coarse.clone(),
            coarse,
        }
    }
}

impl Span {
    #[inline(always)]
    fn formed<P, F: Form<P>>(&self, form: &mut F) -> Span<P> {
        Span {
            span_s: form.one(self.span_s),
            spool_to_middle: form.pair(self.spool_to_middle),
            spool_to_end: form.pair(self.spool_to_end),
            lag: self.lag.formed(form),
            motion_to_middle: self.motion_to_middle.formed(form),
            motion_to_end: self.motion_to_end.formed(form),
            supply_to_middle: self.supply_to_middle.formed(form),
            supply_to_end: self.supply_to_end.formed(form),
        }
    }
}
