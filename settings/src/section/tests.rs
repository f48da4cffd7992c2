//! Tests of the reader of sections.

use super::*;
use crate::parameters::declare;
use crate::spelling::edits;

#[test]
fn a_column_is_that_of_the_character_within_the_text() {
    let text = "a = 1\n\"ä\" = \"x + y\"\nc = \"\"\"\n  z\"\"\"\nd = [1, 2.5]\ne = [1, inf]";
    let source = Source::parse(text, Path::new("f.toml")).map(Source::with_columns).expect("TOML");
    let mut section = source.root();
    assert_eq!(section.keys(), ["a", "ä", "c", "d", "e"]);
    let place = |text: Text, offset: usize| source.wrong_from(text.at + offset, "no").to_string();
    let first = section.text("ä").expect("a text").expect("there");
    assert_eq!(place(first, 4), "f.toml:2:12: no");
    let second = section.text("c").expect("a text").expect("there");
    assert_eq!(place(second, 2), "f.toml:4:3: no");
    assert_eq!(section.numbers("d"), Ok(vec![1.0, 2.5]));
    assert_eq!((section.numbers("a"), section.numbers("none")), (Ok(vec![1.0]), Ok(vec![])));
    let message = section.numbers("e").unwrap_err().to_string();
    assert!(message.starts_with("f.toml:6:5: e = [1, inf]; allowed is a finite number"), "{message}");
}

#[test]
fn an_unknown_key_is_refused_with_the_one_that_is_written_alike() {
    let source = Source::parse("[paramters]\na = 1", Path::new("f.toml")).expect("TOML");
    let known = ["parameters", "outputs", "rows"];
    let message = source.root().allow(&known).unwrap_err().to_string();
    let expected =
        "f.toml:1: unknown key paramters; allowed is parameters, outputs, rows: did you mean parameters?";
    assert_eq!(message, expected);
    for (name, meant) in [("output", Some("outputs")), ("row", Some("rows")), ("rowing", None), ("x", None)] {
        assert_eq!(nearest(name, &known), meant, "{name}");
    }
    assert_eq!([edits("kitten", "sitting"), edits("", "ab"), edits("ab", "ba")], [3, 2, 2]);
}

#[test]
fn a_whole_number_is_exact_beyond_what_a_float_holds() {
    let source = Source::parse("a = 9007199254740993\nb = 0x10\nc = 2.0", Path::new("f.toml")).expect("TOML");
    let mut section = source.root();
    assert_eq!(section.whole("a", [0, u64::MAX]), Ok(Some(9_007_199_254_740_993)));
    assert_eq!((section.whole("b", [1, 16]), section.whole("none", [1, 16])), (Ok(Some(16)), Ok(None)));
    for (key, place, written) in [("b", 2, "b = 0x10"), ("c", 3, "c = 2.0")] {
        let message = section.whole(key, [1, 15]).unwrap_err().to_string();
        assert_eq!(message, format!("f.toml:{place}: {written}; allowed is a whole number, 1 to 15"));
    }
}

#[test]
fn a_table_that_is_left_out_has_no_keys_and_its_errors_the_line_of_the_table_around_it() {
    let source = Source::parse("x = 1\n[a]\nb = 1", Path::new("f.toml")).expect("TOML");
    let mut outer = source.root().needed_section("a", "one").expect("there");
    let mut inner = outer.section_or_empty("none").expect("empty");
    assert_eq!((inner.path(), inner.keys().len(), inner.finish()), ("a.none", 0, Ok(())));
    let message = inner.needed_text("c", "a name").unwrap_err().to_string();
    assert!(message.starts_with("f.toml:2: a.none.c is missing: a name"), "{message}");
    let message = source.root().needed_section("d", "another").map(|_| ()).unwrap_err().to_string();
    assert!(message.starts_with("f.toml:1: [d] is missing: another; the keys here are"), "{message}");
}

#[test]
fn a_whole_number_has_no_fraction_and_no_sign() {
    let source = Source::parse("a = 3\nb = 2.5\nc = -1", Path::new("file.toml")).expect("TOML");
    let mut section = source.root();
    let mut read = |name| section.whole_or_default(&Parameter::new((name, ""), [-10.0, 10.0], 1.0, "count"));
    assert_eq!(read("a"), Ok(3));
    for (name, line) in [("b", 2), ("c", 3)] {
        let message = read(name).unwrap_err().to_string();
        assert!(message.starts_with(&format!("file.toml:{line}: {name} = ")), "{message}");
        assert!(message.contains("allowed is a whole number"), "{message}");
    }
}

crate::parameters! {
    /// Two numbers of a table.
    struct Pair {
        first_s: declare("s", [0.0, 9.0], 1.0, "first"),
        second: declare("", [0.0, 9.0], 2.0, "second").whole(),
    }
}

#[test]
fn parameters_are_those_of_the_file_or_the_defaults_and_checked() {
    let source =
        Source::parse("second = 3\nfirst_s = 10\n[a]\nsecond = 3", Path::new("f.toml")).expect("TOML");
    let mut section = source.root().needed_section("a", "one").expect("there");
    assert_eq!(section.parameters(), Ok(Pair { first_s: 1.0, second: 3.0 }));
    assert_eq!(section.finish(), Ok(()));
    let message = source.root().parameters::<Pair>().unwrap_err().to_string();
    assert_eq!(message, "f.toml:2: first_s = 10 s; allowed is 0 to 9 s");
}
