//! The table of what must show when an effect is left out: complete, the same for people and machines, of variables that exist.

use discrepancy::locate::VARIABLES;
use plant::effects::SHEETS;
use std::collections::BTreeMap;
use std::path::Path;

const BALANCES: [&str; 5] = ["flow-a", "flow-b", "force", "force-sensor", "linkage"];

#[test]
fn the_expected_table_has_every_effect_and_the_page_says_the_same() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate stands in the workspace");
    let text = |path: &str| std::fs::read_to_string(root.join(path)).expect("tracked");
    let table: BTreeMap<String, BTreeMap<String, Vec<String>>> =
        serde_json::from_str(&text("tests/study/outside-expected.json"))
            .expect("effect: balances, variables");
    let page = text("discrepancy/docs/outside-expected.md");
    let mut names: Vec<&str> = SHEETS.iter().map(|sheet| sheet.name).collect();
    names.sort_unstable();
    assert_eq!(table.keys().map(String::as_str).collect::<Vec<_>>(), names);
    for (effect, expected) in &table {
        let (balances, variables) = (&expected["balances"], &expected["variables"]);
        let is_balance = |balance: &String| BALANCES.contains(&balance.as_str());
        assert!(balances.iter().all(is_balance), "{effect}: {balances:?}");
        let is_variable = |variable: &String| {
            variable == "constant" || VARIABLES.iter().any(|known| known.name == variable)
        };
        assert!(!variables.is_empty() && variables.iter().all(is_variable), "{effect}: {variables:?}");
        let listed: Vec<String> =
            variables.iter().map(|variable| format!("`{}`", variable.replace('|', "\\|"))).collect();
        let row = format!("| {effect} | {} | {} |", balances.join(", "), listed.join(", "));
        assert!(page.contains(&row), "the page lacks: {row}");
    }
}
