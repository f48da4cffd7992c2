//! Reads `[inputs]` and `[rows]`: what is measured, what is made of it, and which of it counts.

use super::{Reader, named, one_or, scale, unit};
use crate::file::{Input, Smoothing};
use crate::inputs::Hold;
use crate::rows::Rows;
use crate::units::Dimension;
use settings::{Result, Section};

impl Reader<'_> {
    pub(super) fn inputs(&mut self, root: &mut Section<'_>) -> Result<()> {
        let mut rates = Vec::new();
        for (name, mut section) in named(root, "inputs")? {
            self.is_new(&name, None, &section)?;
            let rate_of = section.text("rate_of")?;
            if rate_of.is_some() && section.has("column") {
                return Err(
                    section.wrong_at("column", "column: it is the rate of another input, and has none")
                );
            }
            let column = section.text("column")?.map_or_else(|| name.clone(), |text| text.text);
            let (unit, scale) = (unit(&mut section, self.source)?, scale(&mut section)?);
            let hold = section.choice("hold", &[("zero", Hold::Zero), ("linear", Hold::Linear)])?;
            let smoothing = smoothing(&mut section)?;
            section.finish()?;
            rates.extend(rate_of.map(|of| (self.model.inputs.len(), of)));
            self.model.inputs.push(Input { name, column, scale, rate_of: None, smoothing, unit, hold });
        }
        for (input, of) in rates {
            let inputs = &mut self.model.inputs;
            // One that stands before it, so that no input is its own rate.
            let Some(from) = inputs[..input].iter().position(|other| other.name == of.text) else {
                let why = format!("'{}' is no input that stands before this one", of.text);
                return Err(self.source.wrong_from(of.at, &why));
            };
            if inputs[from].unit.dimension.over(Dimension::TIME) != inputs[input].unit.dimension {
                let why = format!("the unit of this input is not that of {} over a time", of.text);
                return Err(self.source.wrong_from(of.at, &why));
            }
            inputs[input].rate_of = Some(from);
        }
        Ok(())
    }

    pub(super) fn rows(&mut self, mut section: Section<'_>) -> Result<()> {
        let default = Rows::default();
        let whole = |section: &mut Section<'_>, key: &str, default: usize, most: f64| {
            one_or(section, key, default as f64, [1.0, most]).map(|value| value as usize)
        };
        let condition = section.text("where")?.map(|text| self.expression(text)).transpose()?;
        let mut folds = Vec::new();
        if let Some(mut over) = section.section("folds")? {
            for name in over.keys() {
                let text = over.needed_text(&name, "what folds go over, an expression of inputs")?;
                folds.push(self.expression(text)?);
            }
            over.finish()?;
        }
        self.model.rows = Rows {
            condition,
            every: whole(&mut section, "every", default.every, 1000.0)?,
            order: whole(&mut section, "order", default.order, 10.0)?,
            ripple_decibel: one_or(&mut section, "ripple_decibel", default.ripple_decibel, [1e-6, 3.0])?,
            edge: one_or(&mut section, "edge", default.edge, [1e-3, 1.0])?,
            ends_s: one_or(&mut section, "ends_s", 0.0, [0.0, 1e6])?,
            folds,
        };
        section.finish()
    }
}

/// How the samples of an input are smoothed.
fn smoothing(section: &mut Section<'_>) -> Result<Smoothing> {
    let low_pass_hz = one_or(section, "low_pass_hz", 0.0, [0.0, 1e9])?;
    let low_pass_order = one_or(section, "low_pass_order", 4.0, [1.0, 10.0])? as usize;
    let moving_average = one_or(section, "moving_average", 1.0, [1.0, 100_001.0])? as usize;
    if moving_average.is_multiple_of(2) {
        return Err(section.wrong_at("moving_average", "moving_average: allowed is an odd number of samples"));
    }
    Ok(Smoothing { low_pass_hz, low_pass_order, moving_average })
}
