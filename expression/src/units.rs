//! Units: their dimension, and their size in SI.
//!
//! ```text
//!   N s/m      = kg / s            a blank or * multiplies, / divides by the next factor alone
//!   V^0.5/s    = sqrt(V) / s       an exponent is a number
//!   J/(kg K)   = m^2 / (s^2 K)     brackets group
//!   mm, kPa    prefixes p n u m c k M G of units that take one
//! ```
//! Exponents are kept in twelfths, so that square, cube and fourth roots are exact. A unit with an offset (degrees Celsius)
//! has none of this form and is refused.
//!
//! Source: BIPM, The International System of Units, 9th edition, 2019.

use std::fmt;

/// Base units of the exponents, in their order.
const BASE: [&str; 7] = ["kg", "m", "s", "A", "K", "mol", "cd"];
/// Exponents are kept in this part of one.
const PART: f64 = 12.0;
/// Largest exponent, in parts of one.
const MOST: i32 = 64 * 12;

/// Exponents of the base units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Dimension([i16; 7]);

/// A unit: so many of the SI unit of a dimension.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// As it is written.
    pub text: String,
    /// Exponents of its base units.
    pub dimension: Dimension,
    /// SI units in one of it.
    pub factor: f64,
}

/// What is no unit: where in its text, from 0, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnitError {
    /// Byte of the text.
    pub at: usize,
    /// Message without the place.
    pub why: String,
}

impl Dimension {
    /// Of a pure number.
    pub const NONE: Self = Self([0; 7]);
    /// Of a second.
    pub const TIME: Self = Self([0, 0, 12, 0, 0, 0, 0]);

    /// Of a product: exponents are added, and limited to 64 in magnitude.
    #[must_use]
    pub fn times(self, other: Self) -> Self {
        self.combined(other, 1)
    }

    /// Of a quotient: exponents are subtracted, and limited to 64 in magnitude.
    #[must_use]
    pub fn over(self, other: Self) -> Self {
        self.combined(other, -1)
    }

    fn combined(self, other: Self, sign: i32) -> Self {
        let mut sum = self.0;
        for (sum, other) in sum.iter_mut().zip(other.0) {
            *sum = (i32::from(*sum) + sign * i32::from(other)).clamp(-MOST, MOST) as i16;
        }
        Self(sum)
    }

    /// Of a power; `None` where an exponent is no twelfth, or too large.
    #[must_use]
    pub fn to_the(self, power: f64) -> Option<Self> {
        let mut powers = self.0;
        for exponent in &mut powers {
            let exact = f64::from(*exponent) * power;
            if (exact - exact.round()).abs() > 1e-9 || exact.is_nan() || exact.abs() > f64::from(MOST) {
                return None;
            }
            *exponent = exact.round() as i16;
        }
        Some(Self(powers))
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::NONE {
            return formatter.write_str("1");
        }
        let mut is_first = true;
        for (name, exponent) in BASE.iter().zip(self.0).filter(|(_, exponent)| *exponent != 0) {
            let space = if is_first { "" } else { " " };
            is_first = false;
            match f64::from(exponent) / PART {
                1.0 => write!(formatter, "{space}{name}")?,
                exponent => write!(formatter, "{space}{name}^{}", (exponent * 1e4).round() / 1e4)?,
            }
        }
        Ok(())
    }
}

impl Unit {
    /// The unit of a pure number.
    #[must_use]
    pub fn one() -> Self {
        Self { text: "1".into(), dimension: Dimension::NONE, factor: 1.0 }
    }

    /// Reads a unit.
    ///
    /// # Errors
    /// [`UnitError`] with the place of what is none.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        Self::read(text).map_err(|wrong| {
            let right = with_powers(text);
            match right != text && Self::read(&right).is_ok() {
                true => {
                    UnitError { why: format!("a power of a unit is written with ^: write {right}"), ..wrong }
                }
                false => wrong,
            }
        })
    }

    fn read(text: &str) -> Result<Self, UnitError> {
        let mut reader = Reader { text, at: 0 };
        let (dimension, factor) = reader.product(0)?;
        reader.skip_blanks();
        if reader.at < text.len() {
            return Err(reader.wrong("a unit ends here".into()));
        }
        if !(factor.is_finite() && factor > 0.0) {
            return Err(UnitError { at: 0, why: "this unit is too large or too small".into() });
        }
        Ok(Self { text: text.trim().into(), dimension, factor })
    }
}

/// A unit as people write it, `N/mm2`, `m**2`, `m³`, with `^` before its exponents.
#[must_use]
pub fn with_powers(text: &str) -> String {
    let mut right = String::with_capacity(text.len() + 2);
    let text = text.replace("**", "^");
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '²' => right.push_str("^2"),
            '³' => right.push_str("^3"),
            _ => right.push(character),
        }
        let is_power = characters.peek().is_some_and(|next| next.is_ascii_digit() || *next == '-');
        if character.is_alphabetic() && is_power {
            right.push('^');
        }
    }
    right
}

/// Deepest brackets of a unit.
const DEEPEST: usize = 8;

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl Reader<'_> {
    fn wrong(&self, why: String) -> UnitError {
        UnitError { at: self.at, why }
    }

    fn next(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn skip_blanks(&mut self) {
        while self.next().is_some_and(char::is_whitespace) {
            self.at += self.next().map_or(0, char::len_utf8);
        }
    }

    fn take(&mut self, wanted: char) -> bool {
        let is_there = self.next() == Some(wanted);
        if is_there {
            self.at += wanted.len_utf8();
        }
        is_there
    }

    fn word(&mut self, is_part: impl Fn(char) -> bool) -> String {
        let word: String = self.text[self.at..].chars().take_while(|character| is_part(*character)).collect();
        self.at += word.len();
        word
    }

    fn product(&mut self, depth: usize) -> Result<(Dimension, f64), UnitError> {
        let (mut dimension, mut factor) = self.power(depth)?;
        loop {
            self.skip_blanks();
            let divides = match self.next() {
                Some('/') => true,
                Some('*' | '·') => false,
                None | Some(')') => return Ok((dimension, factor)),
                Some(_) => {
                    let (more, times) = self.power(depth)?;
                    (dimension, factor) = (dimension.times(more), factor * times);
                    continue;
                }
            };
            self.at += self.next().map_or(0, char::len_utf8);
            let (more, times) = self.power(depth)?;
            (dimension, factor) = if divides {
                (dimension.over(more), factor / times)
            } else {
                (dimension.times(more), factor * times)
            };
        }
    }

    fn power(&mut self, depth: usize) -> Result<(Dimension, f64), UnitError> {
        self.skip_blanks();
        let start = self.at;
        let (dimension, factor) = if self.take('(') {
            if depth == DEEPEST {
                return Err(self.wrong(format!("more than {DEEPEST} brackets within each other")));
            }
            let inner = self.product(depth + 1)?;
            if !self.take(')') {
                return Err(self.wrong("a bracket is not closed".into()));
            }
            inner
        } else {
            self.factor()?
        };
        self.skip_blanks();
        if !self.take('^') {
            return Ok((dimension, factor));
        }
        let number = self.word(|character| "+-.0123456789".contains(character));
        let exponent: Option<f64> = number.parse().ok();
        let power =
            exponent.and_then(|exponent| Some((dimension.to_the(exponent)?, libm::pow(factor, exponent))));
        power.ok_or_else(|| UnitError {
            at: start,
            why: format!("'{number}' is no exponent that a unit can have"),
        })
    }

    fn factor(&mut self) -> Result<(Dimension, f64), UnitError> {
        if self.take('1') {
            return Ok((Dimension::NONE, 1.0));
        }
        if self.take('%') {
            return Ok((Dimension::NONE, 0.01));
        }
        let start = self.at;
        let name = self.word(|character| character.is_alphabetic() || character == '°');
        named(&name).ok_or_else(|| {
            let what = if name.is_empty() {
                "a unit is missing here".into()
            } else if ["degC", "°C", "degF", "°F"].contains(&name.as_str()) {
                format!("'{name}' has an offset: write K, for a difference or for an absolute temperature")
            } else {
                format!("'{name}' is no unit")
            };
            UnitError { at: start, why: format!("{what}; known are SI units, bar, min, h, deg, l, %, 1") }
        })
    }
}

/// Name, exponents of kg, m, s, A, K, mol, cd, size, and whether it takes a prefix.
type Row = (&'static str, [i16; 7], f64, bool);

const ROWS: &[Row] = &[
    ("m", [0, 1, 0, 0, 0, 0, 0], 1.0, true),
    ("g", [1, 0, 0, 0, 0, 0, 0], 1e-3, true),
    ("s", [0, 0, 1, 0, 0, 0, 0], 1.0, true),
    ("A", [0, 0, 0, 1, 0, 0, 0], 1.0, true),
    ("K", [0, 0, 0, 0, 1, 0, 0], 1.0, true),
    ("mol", [0, 0, 0, 0, 0, 1, 0], 1.0, true),
    ("cd", [0, 0, 0, 0, 0, 0, 1], 1.0, false),
    ("N", [1, 1, -2, 0, 0, 0, 0], 1.0, true),
    ("Pa", [1, -1, -2, 0, 0, 0, 0], 1.0, true),
    ("bar", [1, -1, -2, 0, 0, 0, 0], 1e5, true),
    ("J", [1, 2, -2, 0, 0, 0, 0], 1.0, true),
    ("W", [1, 2, -3, 0, 0, 0, 0], 1.0, true),
    ("V", [1, 2, -3, -1, 0, 0, 0], 1.0, true),
    ("ohm", [1, 2, -3, -2, 0, 0, 0], 1.0, true),
    ("Ω", [1, 2, -3, -2, 0, 0, 0], 1.0, true),
    ("S", [-1, -2, 3, 2, 0, 0, 0], 1.0, true),
    ("F", [-1, -2, 4, 2, 0, 0, 0], 1.0, true),
    ("H", [1, 2, -2, -2, 0, 0, 0], 1.0, true),
    ("C", [0, 0, 1, 1, 0, 0, 0], 1.0, true),
    ("Wb", [1, 2, -2, -1, 0, 0, 0], 1.0, true),
    ("T", [1, 0, -2, -1, 0, 0, 0], 1.0, true),
    ("Hz", [0, 0, -1, 0, 0, 0, 0], 1.0, true),
    ("l", [0, 3, 0, 0, 0, 0, 0], 1e-3, true),
    ("L", [0, 3, 0, 0, 0, 0, 0], 1e-3, true),
    ("min", [0, 0, 1, 0, 0, 0, 0], 60.0, false),
    ("h", [0, 0, 1, 0, 0, 0, 0], 3600.0, false),
    ("rad", [0; 7], 1.0, true),
    ("deg", [0; 7], core::f64::consts::PI / 180.0, false),
    ("°", [0; 7], core::f64::consts::PI / 180.0, false),
];

const PREFIXES: [(&str, f64); 9] = [
    ("p", 1e-12),
    ("n", 1e-9),
    ("u", 1e-6),
    ("µ", 1e-6),
    ("m", 1e-3),
    ("c", 1e-2),
    ("k", 1e3),
    ("M", 1e6),
    ("G", 1e9),
];

fn named(name: &str) -> Option<(Dimension, f64)> {
    let whole = |row: &Row| (Dimension(row.1.map(|exponent| exponent * PART as i16)), row.2);
    if let Some(row) = ROWS.iter().find(|row| row.0 == name) {
        return Some(whole(row));
    }
    PREFIXES.iter().find_map(|(prefix, times)| {
        let rest = name.strip_prefix(prefix)?;
        let row = ROWS.iter().find(|row| row.3 && row.0 == rest)?;
        let (dimension, factor) = whole(row);
        Some((dimension, factor * times))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(text: &str) -> Unit {
        Unit::parse(text).unwrap_or_else(|error| panic!("{text}: {error:?}"))
    }

    #[test]
    fn a_unit_is_a_product_of_powers() {
        assert_eq!(unit("N s/m").dimension, unit("kg/s").dimension);
        assert_eq!(unit("J/(kg K)").dimension, unit("m^2 s^-2/K").dimension);
        assert_eq!(unit("V^0.5/s").dimension.times(unit("V^0.5 s").dimension), unit("V").dimension);
        assert_eq!(unit("ohm F").dimension, Dimension::TIME);
        assert_eq!((unit("mm").factor, unit("kPa").factor, unit("min").factor), (1e-3, 1e3, 60.0));
        assert_eq!((unit("%").factor, unit("1").factor), (0.01, 1.0));
        assert!((unit("l/min").factor - 1e-3 / 60.0).abs() < 1e-18);
        assert_eq!(unit("m/s/s").dimension, unit("m/s^2").dimension);
    }

    #[test]
    fn a_dimension_is_written_in_base_units() {
        assert_eq!(unit("N").dimension.to_string(), "kg m s^-2");
        assert_eq!(unit("%").dimension.to_string(), "1");
        assert_eq!(unit("m^0.5").dimension.to_string(), "m^0.5");
    }

    #[test]
    fn what_is_no_unit_is_refused_at_its_place() {
        for (text, at) in
            [("N sx", 2), ("", 0), ("m^x", 0), ("m)", 1), ("(m", 2), ("degC", 0), ("m^0.01", 0), ("m^1e9", 3)]
        {
            assert_eq!(Unit::parse(text).map_err(|error| error.at), Err(at), "{text}");
        }
        for (text, right) in [
            ("mm2", "mm^2"),
            ("N/mm2", "N/mm^2"),
            ("kg m-3", "kg m^-3"),
            ("cm³/s", "cm^3/s"),
            ("m/s**2", "m/s^2"),
        ] {
            let why = Unit::parse(text).unwrap_err().why;
            assert!(why.ends_with(&format!("write {right}")) && unit(right).factor > 0.0, "{text}: {why}");
        }
        let deep = format!("{}m", "(".repeat(10_000));
        assert!(Unit::parse(&deep).is_err_and(|error| error.why.contains("brackets")));
    }
}
