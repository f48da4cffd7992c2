//! The example of `docs/first-model.md`: what the page prints is what comes.

use crate::closing::close;
use std::path::Path;

#[test]
fn the_page_of_a_first_model_prints_what_comes() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let [file, train, test] =
        ["cart.toml", "cart-a.csv", "cart-b.csv"].map(|name| docs.join("first-model").join(name));
    let page = std::fs::read_to_string(docs.join("first-model.md")).unwrap();
    let report = close(&file, &[train], &[test]).unwrap().report;
    let mut lines = vec![format!("Cart: {}.", report.headline)];
    lines.extend(report.training.iter().chain(&report.held_out).map(|one| {
        format!(
            "{}: speed {:.4} mm/s rms with the model, {:.4} extended",
            one.record, one.rms_before, one.rms_after
        )
    }));
    for line in &lines {
        assert!(page.contains(line), "{line}");
    }
    let values: Vec<f64> = report.parameters.iter().map(|number| number.value).collect();
    for ((value, truth), error) in values.iter().zip([0.8, 1.2, 2.5]).zip([0.01, 0.2, 0.3]) {
        assert!((value - truth).abs() < error, "{values:?}");
    }
}
