//! Commands of `discrepancy` on a model file that fit nothing: a page of its equations, and what it says beside a record.

use std::fs;
use std::path::PathBuf;
use system_tests::discrepancy::discrepancy;
use system_tests::exit::{BAD_INPUT, GOOD};

const MODEL: &str = "[inputs.u]\nunit = \"V\"\n[parameters]\nrate = { unit = \"1/s\", value = 2 }\n\
                     [states.x]\nunit = \"V\"\nstart = 0\nderivative = \"rate*(u - x)\"\n\
                     [outputs.y]\nunit = \"V\"\nvalue = \"x\"\n";

#[test]
fn a_model_file_is_set_on_a_page_and_simulated_beside_a_record() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str, text: &str| -> PathBuf {
        let path = folder.path().join(name);
        fs::write(&path, text).expect("a file");
        path
    };
    let model = file("lag.toml", MODEL);
    // 1 - exp(-2 t) behind a step of 1 V.
    let value = |row: i32| 1.0 - (-0.2 * f64::from(row)).exp();
    let rows: String = (0..20).map(|row| format!("{},1,{}\n", f64::from(row) * 0.1, value(row))).collect();
    let record = file("record.csv", &format!("t_s,u,y\n{rows}"));

    let page = folder.path().join("lag.html");
    discrepancy(&[&"explain", &model, &"--html", &page]).expect_code(GOOD).expect_stdout(&["rate"]);
    let page = fs::read_to_string(page).expect("a page");
    assert!(page.contains("<math") && page.contains("</html>") && !page.contains("http://"), "{page}");
    let over = discrepancy(&[&"explain", &model, &"--html", &model]).expect_code(BAD_INPUT);
    over.expect_stderr(&["it is read here: name another"]);
    assert_eq!(fs::read_to_string(&model).expect("the model file"), MODEL);

    let out = folder.path().join("simulated.csv");
    discrepancy(&[&"simulate", &model, &"--record", &record, &"--out", &out]).expect_code(GOOD);
    let table = fs::read_to_string(&out).expect("a table");
    assert!(table.starts_with("t_s,u,y,y_model\n"), "{table}");
    for (row, line) in table.lines().skip(1).enumerate() {
        let said: f64 = line.rsplit(',').next().and_then(|cell| cell.parse().ok()).expect("a number");
        // The tolerance of a step's error is 1e-6 of the size, and a step's error dies out.
        assert!((said - value(row as i32)).abs() < 1e-5, "{line}");
    }
    let again = discrepancy(&[&"simulate", &model, &"--record", &record, &"--out", &out]);
    again.expect_code(BAD_INPUT).expect_stderr(&["there is a file already"]);
}
