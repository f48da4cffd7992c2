//! Which functional form the hidden effects of a recipe have: the catalogue's, or one of two others that mean the same.

/// The law's own form, one that lies near it, and one that its best fit explains only in part.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Form {
    #[default]
    Catalogue,
    /// The best fit of the catalogue's law leaves about a hundredth of the squared signature.
    Near,
    /// It leaves 10 to 40 %, where `docs/record-maker.md` says nothing else.
    Far,
}

/// Drift of an offset: its period, s, and the near form's share.
const DRIFT_S: f64 = 13.0;
const NEAR_DRIFT: f64 = 0.15;

impl Form {
    pub const ALL: [Form; 3] = [Form::Catalogue, Form::Near, Form::Far];

    /// As the command line and `truth.json` name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Form::Catalogue => "catalogue",
            Form::Near => "near",
            Form::Far => "far",
        }
    }

    /// Whether it is another form than the catalogue's.
    #[must_use]
    pub const fn is_foreign(self) -> bool {
        !matches!(self, Form::Catalogue)
    }

    pub(super) const fn is_far(self) -> bool {
        matches!(self, Form::Far)
    }

    /// The number of this form, of those of all forms.
    #[inline(always)]
    pub(super) const fn of(self, [catalogue, near, far]: [f64; 3]) -> f64 {
        match self {
            Form::Catalogue => catalogue,
            Form::Near => near,
            Form::Far => far,
        }
    }

    /// What one of two sides (chambers, directions) has of the catalogue's number: 1, or `share` more or less in the far form.
    #[inline(always)]
    pub(super) const fn side(self, is_first: bool, share: f64) -> f64 {
        match self {
            Form::Far => 1.0 + if is_first { share } else { -share },
            _ => 1.0,
        }
    }

    /// Slow drift of an offset at a time, 1 on average, by `far` in the far form.
    pub(super) fn drift(self, time_s: f64, far: f64) -> f64 {
        let share = self.of([0.0, NEAR_DRIFT, far]);
        if share == 0.0 {
            return 1.0;
        }
        1.0 + share * libm::sin(std::f64::consts::TAU * time_s / DRIFT_S + 0.7)
    }
}
