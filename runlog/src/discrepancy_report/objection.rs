//! Finding on the held-out record that contradicts a report: headline, words and exit code follow it.

use super::{Report, Verdict, Verification};

/// How the held-out record contradicts a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldOutFinding {
    /// A signal gets worse with the extended model.
    Worse,
    /// The finding does not improve it significantly; of something outside the catalogue, to which no law was added, the rig file
    /// leaves no more than noise.
    NotConfirmed,
    /// It shows something, and the training records nothing that is missing.
    SomethingMissing,
    /// The finding is confirmed, and more is missing there.
    MoreMissing,
}

impl Report {
    /// Whether the rig file explains the records as it is, insignificant changes of its parameters aside.
    #[must_use]
    pub fn is_rig_file_enough(&self) -> bool {
        self.verdict == Verdict::NothingMissing && self.small.is_empty()
    }

    /// How the held-out record contradicts the report; `None` where it does not, without one, and of records that cannot be used.
    #[must_use]
    pub fn held_out_finding(&self) -> Option<HeldOutFinding> {
        let held_out = self.verification.as_ref().filter(|_| self.verdict != Verdict::BadData)?;
        let found = !self.is_rig_file_enough();
        match () {
            () if held_out.worse => Some(HeldOutFinding::Worse),
            () if found && !self.is_confirmed(held_out) => Some(HeldOutFinding::NotConfirmed),
            () if held_out.more_missing => {
                Some(if found { HeldOutFinding::MoreMissing } else { HeldOutFinding::SomethingMissing })
            }
            () => None,
        }
    }

    /// Whether the held-out record supports the finding. That something is missing which no law describes is a finding about the
    /// rig file: the extended model then has fitted parameters alone, which that very thing pulls from where they are right.
    fn is_confirmed(&self, held_out: &Verification) -> bool {
        let has_law =
            self.verdict != Verdict::OutsideCatalogue || self.outside.as_ref().is_some_and(|one| one.added);
        if has_law { held_out.confirmed } else { held_out.chi2_before > held_out.chi2_null[1] }
    }
}
