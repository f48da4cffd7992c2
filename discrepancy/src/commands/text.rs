//! What the commands print: verdict, effects and numbers in a few lines.

use crate::report::{HeldOutFinding, NamedEffect, Quantity, Report, decimals};
use std::fmt::Write as _;

/// The verdict and the names in a few lines.
pub(super) fn in_words(report: &Report) -> String {
    let mut text = format!("{}\n", report.summary);
    for named in &report.named {
        let _ = writeln!(text, "  {}", effect_in_words(named));
        for other in &named.alternatives {
            let _ = writeln!(text, "    or {}", effect_in_words(other));
        }
    }
    for small in &report.small {
        let _ = writeln!(text, "  smaller: {}", effect_in_words(small));
    }
    for quantity in &report.parameters {
        let _ = writeln!(text, "  {}", quantity_in_words(quantity));
    }
    if let Some(tests) = &report.significance {
        let _ = writeln!(text, "  {}", tests.in_words());
    }
    if let Some(objection) = report.held_out_finding() {
        let how = match objection {
            HeldOutFinding::Worse => "gets worse with it",
            HeldOutFinding::NotConfirmed => "does not confirm it",
            HeldOutFinding::SomethingMissing => "shows that something is missing",
            HeldOutFinding::MoreMissing => "shows that more is missing",
        };
        let _ = writeln!(text, "  the held-out record {how}");
    }
    for (signal, misfit) in &report.misfit {
        if let Some(closed) = misfit.closed {
            let _ = writeln!(text, "  {signal}: {:.1} % of the gap to the noise closed", closed * 100.0);
        }
    }
    text
}

fn effect_in_words(named: &NamedEffect) -> String {
    let numbers: Vec<String> = named.parameters.iter().map(quantity_in_words).collect();
    format!("{} {}: {}", named.effect, named.place, numbers.join(", "))
}

/// Four digits that count.
pub(super) fn significant(value: f64) -> String {
    let magnitude = if value == 0.0 { 0.0 } else { value.abs().log10().floor() };
    format!("{value:.digits$}", digits = (3.0 - magnitude).clamp(0.0, 12.0) as usize)
}

/// `leakage_nl_per_min = 2.513 +- 0.041 Nl/min`: rounded to the second digit of the standard error.
pub(super) fn quantity_in_words(quantity: &Quantity) -> String {
    let value = match quantity.standard_error.filter(|error| *error > 0.0) {
        Some(error) => {
            let digits = decimals(error);
            format!("{:.digits$} +- {error:.digits$}", quantity.value)
        }
        None => significant(quantity.value),
    };
    format!("{} = {value} {}", quantity.name, quantity.unit).trim_end().to_owned()
}
