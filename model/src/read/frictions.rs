//! Reads `[friction]`: dry friction that sticks and slips, of the model or of a suspect.

use super::{Reader, named, unit};
use crate::file::{Expression, Friction};
use crate::units::Unit;
use settings::{Result, Section};

/// Most frictions of a file: the equation of each speed is compiled once more for what holds it.
const MOST: usize = 20;

impl Reader<'_> {
    pub(super) fn frictions(&mut self, parent: &mut Section<'_>, suspect: Option<usize>) -> Result<()> {
        for (name, mut section) in named(parent, "friction")? {
            self.is_new(&name, suspect, &section)?;
            let unit = unit(&mut section, self.source)?;
            let velocity = section.needed_text("velocity", "the state that it holds at rest")?;
            let sliding = section.needed_text("sliding", "its force while it slides, an expression")?;
            let sliding = self.expression(sliding)?;
            let breakaway = match section.text("breakaway")? {
                Some(text) => self.expression(text)?,
                None => sliding.clone(),
            };
            section.finish()?;
            self.friction((name, unit), (&velocity.text, velocity.at), [sliding, breakaway], suspect)?;
        }
        Ok(())
    }

    /// A friction of this name and unit on a state, which stands `at` a place of the file.
    pub(super) fn friction(
        &mut self,
        (name, unit): (String, Unit),
        (state, at): (&str, usize),
        [sliding, breakaway]: [Expression; 2],
        suspect: Option<usize>,
    ) -> Result<()> {
        let model = &self.model;
        let is_seen = |of: Option<usize>| of.is_none() || of == suspect;
        let Some(velocity) = model.states.iter().position(|one| one.name == state && is_seen(one.suspect))
        else {
            let all = model.states.iter().filter(|one| is_seen(one.suspect)).map(|one| one.name.as_str());
            let all = all.collect::<Vec<_>>().join(", ");
            let why = format!("velocity: '{state}' is no state; friction holds one of {all}");
            return Err(self.source.wrong_from(at, &why));
        };
        if let Some(other) = model.frictions.iter().find(|one| one.velocity == velocity) {
            let why = format!(
                "velocity: {} holds {state} already; a state has one friction: let a suspect change its sliding and breakaway",
                other.name
            );
            return Err(self.source.wrong_from(at, &why));
        }
        if model.frictions.len() >= MOST {
            return Err(self.source.wrong_from(at, &format!("more than {MOST} frictions in one file")));
        }
        self.model.frictions.push(Friction { name, unit, velocity, sliding, breakaway, suspect });
        Ok(())
    }
}
