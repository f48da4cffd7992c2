//! Functional form of the hidden effects of a recipe: that of the catalogue, or one of two others for the same phenomenon.

/// The form of the catalogue, one close to it, and one that the catalogue's best fit explains only in part.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Form {
    #[default]
    /// The law of the catalogue, which the plant has too.
    Catalogue,
    /// The best fit of the catalogue's law leaves about a hundredth of the squared signature.
    Near,
    /// The best fit of the catalogue's law leaves 10 to 40 % of it, where `docs/record-maker.md` states no other share.
    Far,
}

/// Drift of an offset: its period, s, and the relative amplitude in the near form.
const DRIFT_S: f64 = 13.0;
const NEAR_DRIFT: f64 = 0.15;

impl Form {
    /// All forms.
    pub const ALL: [Form; 3] = [Form::Catalogue, Form::Near, Form::Far];

    /// Name on the command line and in `truth.json`.
    pub const fn name(self) -> &'static str {
        match self {
            Form::Catalogue => "catalogue",
            Form::Near => "near",
            Form::Far => "far",
        }
    }

    /// Whether it is not the form of the catalogue.
    pub const fn is_foreign(self) -> bool {
        !matches!(self, Form::Catalogue)
    }

    pub(super) const fn is_far(self) -> bool {
        matches!(self, Form::Far)
    }

    /// Selects the number of this form.
    #[inline(always)]
    pub(super) const fn of(self, [catalogue, near, far]: [f64; 3]) -> f64 {
        match self {
            Form::Catalogue => catalogue,
            Form::Near => near,
            Form::Far => far,
        }
    }

    /// Factor on the catalogue's number for one of two sides (chambers, directions): 1, or in the far form `share` more on the
    /// first and less on the second.
    #[inline(always)]
    pub(super) const fn side(self, is_first: bool, share: f64) -> f64 {
        match self {
            Form::Far => 1.0 + if is_first { share } else { -share },
            _ => 1.0,
        }
    }

    /// Factor of the slow drift of an offset at a time, 1 on average; relative amplitude `far` in the far form.
    pub(super) fn drift(self, time_s: f64, far: f64) -> f64 {
        let share = self.of([0.0, NEAR_DRIFT, far]);
        if share == 0.0 {
            return 1.0;
        }
        1.0 + share * libm::sin(std::f64::consts::TAU * time_s / DRIFT_S + 0.7)
    }
}
