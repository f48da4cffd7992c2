//! One expression over named variables, with its numbers: checked once, computed on the stack.
//!
//! ```text
//!   text ──► tree ──► names and dimensions ──► proven finite over all ranges ──► tape ──► value(variables)
//! ```
//! A variable beyond its range counts as the end of it, so that what was proven holds for every state. Only a state that is no
//! number gives a value that is none.

use crate::bounds::{Range, bounds};
use crate::compile::Compile;
use crate::curve::Table;
use crate::dimensions::{Dimensions, Measure};
use crate::grammar::{ExpressionError, Kind, Node, NodeId, Nodes, Result};
use crate::tape::{Builder, Code, LeafLayout, Register, Tape};
use crate::units::Dimension;

/// Registers of a formula at most: names, numbers and operations.
pub(crate) const MOST_REGISTERS: usize = 96;

/// A variable or a parameter of a formula.
#[derive(Clone, Copy, Debug)]
pub struct Variable<'a> {
    /// Its name in the expression; empty where a parameter has taken it.
    pub name: &'a str,
    /// Powers of the base units.
    pub dimension: Dimension,
    /// Its smallest and largest value, in SI.
    pub range: Range,
}

/// The names that an expression may use.
#[derive(Clone, Copy, Debug)]
pub struct SymbolTable<'a> {
    /// Values that change over a run.
    pub variables: &'a [Variable<'a>],
    /// Values that are constant over a run.
    pub parameters: &'a [Variable<'a>],
    /// Curves that it may read.
    pub tables: &'a [Table],
}

/// A compiled expression with the values of its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    tape: Tape,
    /// Ranges of the variables that stand in it; `None` for the others.
    ranges: Vec<Option<Range>>,
    /// Registers before an evaluation: parameters and constants.
    registers: [f64; MOST_REGISTERS],
    parameters: usize,
    /// Smallest and largest value that it can have over all ranges.
    pub(crate) bounds: Range,
    /// Names of the tables that it reads.
    tables: Vec<String>,
}

impl Formula {
    /// Compiles an expression that begins at byte `at` of its file and must have a dimension.
    ///
    /// # Errors
    /// [`ExpressionError`] with the byte of the file: no expression, an unknown name, another dimension, too long, or not proven
    /// finite.
    pub fn compile(
        (text, at): (&str, usize),
        symbols: SymbolTable<'_>,
        (wanted, what): (Dimension, &str),
    ) -> Result<Self> {
        let mut nodes = Nodes::default();
        let root = nodes.parse(text, at)?;
        let is_called = |table: &&Table| {
            nodes.tree(root).any(|node| matches!(&node.kind, Kind::Call(name, _) if *name == table.name))
        };
        let tables: Vec<Table> = symbols.tables.iter().filter(is_called).cloned().collect();
        let (has_tables, symbols) = (!symbols.tables.is_empty(), SymbolTable { tables: &tables, ..symbols });
        let SymbolTable { variables, parameters, .. } = symbols;
        let leaves =
            LeafLayout { inputs: variables.len(), parameters: parameters.len(), ..LeafLayout::default() };
        let mut compiler = FormulaCompiler { nodes, symbols, has_tables, builder: Builder::new(leaves) };
        compiler.expression(root, (), wanted, (at, what))?;
        let of = |name: &str| match compiler.place(name) {
            Some(place) => compiler.variable(place).range,
            None => [std::f64::consts::PI; 2],
        };
        let bounds = bounds(&compiler.nodes, root, &of, &tables)?;
        let is_read = |variable: &Variable<'_>| {
            let is_it = |node: &Node| matches!(&node.kind, Kind::Name(name) if name == variable.name);
            compiler.nodes.tree(root).any(is_it).then_some(variable.range)
        };
        let ranges = variables.iter().map(is_read).collect();
        let result = Compile::node(&mut compiler, root, ())?;
        let tape = compiler.builder.tape(&[result], tables.iter().map(|table| table.curve.clone()).collect());
        if tape.registers() > MOST_REGISTERS {
            let why = format!("more than {MOST_REGISTERS} names, numbers and operations in one expression");
            return Err(ExpressionError::new(at, why));
        }
        let mut registers = [0.0; MOST_REGISTERS];
        tape.begin(&mut registers);
        Ok(Self {
            tape,
            ranges,
            registers,
            parameters: parameters.len(),
            bounds,
            tables: tables.into_iter().map(|table| table.name).collect(),
        })
    }

    /// Sets the values of its parameters, in SI.
    ///
    /// # Panics
    /// For another number of values than it has parameters.
    pub fn set(&mut self, values: &[f64]) {
        assert_eq!(values.len(), self.parameters, "one value for each parameter");
        for (index, value) in values.iter().enumerate() {
            self.registers[self.tape.leaves.parameter(index) as usize] = *value;
        }
    }

    /// Its value, in SI; `variables` are as many as it was compiled with.
    #[must_use]
    pub fn value(&self, variables: &[f64]) -> f64 {
        let mut registers = self.registers;
        for (index, (value, range)) in variables.iter().zip(&self.ranges).enumerate() {
            if let Some([least, most]) = range {
                registers[self.tape.leaves.input(index) as usize] = value.clamp(*least, *most);
            }
        }
        self.tape.compute(&mut registers)
    }

    /// Whether it calls the table of this name.
    #[must_use]
    pub fn reads_table(&self, name: &str) -> bool {
        self.tables.iter().any(|table| table == name)
    }

    /// Whether the variable of this place stands in it.
    #[must_use]
    pub fn reads(&self, variable: usize) -> bool {
        self.ranges[variable].is_some()
    }
}

struct FormulaCompiler<'a> {
    nodes: Nodes,
    /// Of the tables those that it reads.
    symbols: SymbolTable<'a>,
    has_tables: bool,
    builder: Builder,
}

impl FormulaCompiler<'_> {
    /// The place of a name among variables and parameters.
    fn place(&self, name: &str) -> Option<usize> {
        self.symbols.variables.iter().chain(self.symbols.parameters).position(|one| one.name == name)
    }

    fn variable(&self, place: usize) -> &Variable<'_> {
        let SymbolTable { variables, parameters, .. } = self.symbols;
        variables.get(place).unwrap_or_else(|| &parameters[place - variables.len()])
    }

    fn table(&self, name: &str) -> Option<usize> {
        self.symbols.tables.iter().position(|table| table.name == name)
    }

    fn unknown(&self, name: &str, at: usize) -> ExpressionError {
        let names = self.symbols.variables.iter().chain(self.symbols.parameters).map(|one| one.name);
        let symbols: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
        ExpressionError::new(at, format!("'{name}' is unknown here; known are pi, {}", symbols.join(", ")))
    }
}

impl Dimensions for FormulaCompiler<'_> {
    type Scope = ();

    fn at(&self, place: NodeId) -> Node {
        self.nodes.get(place).clone()
    }

    fn named(&mut self, name: &str, at: usize, (): ()) -> Result<Measure> {
        match self.place(name) {
            Some(place) => Ok(Some(self.variable(place).dimension)),
            None if name == "pi" => Ok(Some(Dimension::NONE)),
            None => Err(self.unknown(name, at)),
        }
    }

    fn arguments(&self, name: &str) -> Option<usize> {
        self.table(name).map(|_| 1)
    }

    fn functions(&self) -> &'static str {
        if self.has_tables { ", and the tables" } else { "" }
    }

    fn called(&mut self, name: &str, measures: &[Measure], at: usize) -> Result<Measure> {
        let table = self.table(name).ok_or_else(|| self.unknown(name, at))?;
        let Table { from, to, .. } = &self.symbols.tables[table];
        match measures[0] {
            Some(given) if given != from.dimension => {
                let [wanted, given] = [from.dimension, given].map(|one| self.in_units(one));
                Err(ExpressionError::new(at, format!("{name} is over {wanted}, and this is in {given}")))
            }
            _ => Ok(Some(to.dimension)),
        }
    }
}

impl Compile for FormulaCompiler<'_> {
    type Scope = ();

    fn at(&self, place: NodeId) -> Node {
        self.nodes.get(place).clone()
    }

    fn builder(&mut self) -> &mut Builder {
        &mut self.builder
    }

    fn named(&mut self, name: &str, _at: usize, (): ()) -> Result<Register> {
        let leaves = self.builder.leaves;
        Ok(match self.place(name) {
            Some(place) if place < self.symbols.variables.len() => leaves.input(place),
            Some(place) => leaves.parameter(place - self.symbols.variables.len()),
            None => self.builder.constant(std::f64::consts::PI),
        })
    }

    fn called(&mut self, name: &str, arguments: &[NodeId], _at: usize, (): ()) -> Result<Option<Register>> {
        let Some(table) = self.table(name) else { return Ok(None) };
        let operand = Compile::node(self, arguments[0], ())?;
        Ok(Some(self.builder.push(Code::Table(table as u16), &[operand])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Unit;

    fn dimension(unit: &str) -> Dimension {
        Unit::parse(unit).unwrap().dimension
    }

    fn compiled(text: &str) -> Result<Formula> {
        let variables = [
            Variable { name: "x", dimension: dimension("m"), range: [0.0, 1.0] },
            Variable { name: "v", dimension: dimension("m/s"), range: [-1e3, 1e3] },
        ];
        let parameters = [Variable { name: "c", dimension: dimension("N s/m"), range: [0.0, 200.0] }];
        let lift = Table::new(
            "lift".to_owned(),
            (vec![0.0, 500.0, 2000.0], Unit::parse("mm").unwrap()),
            (vec![0.0, 3.0, -1.0], Unit::parse("kN").unwrap()),
        );
        let tables = [lift.unwrap()];
        let symbols = SymbolTable { variables: &variables, parameters: &parameters, tables: &tables };
        Formula::compile((text, 100), symbols, (dimension("N"), "force"))
    }

    #[test]
    fn it_has_the_value_of_its_text_with_the_numbers_that_were_set() {
        let mut brake = compiled("-c*(1 + x/0.5[m])*v").unwrap();
        brake.set(&[10.0]);
        assert_eq!(brake.value(&[0.25, 2.0]), -10.0 * 1.5 * 2.0);
        brake.set(&[20.0]);
        assert_eq!(brake.value(&[0.25, 2.0]), -20.0 * 1.5 * 2.0);
        assert_eq!(brake.bounds, [-6e5, 6e5]);
        assert_eq!([0, 1].map(|place| brake.reads(place)), [true, true]);
        assert!(!compiled("c*v").unwrap().reads(0));
    }

    #[test]
    fn a_variable_beyond_its_range_counts_as_its_end_and_no_number_stays_one() {
        let mut brake = compiled("c*v").unwrap();
        brake.set(&[1.0]);
        assert_eq!(brake.value(&[0.0, 1e9]), 1e3);
        assert!(brake.value(&[0.0, f64::NAN]).is_nan());
        // What it does not read does not matter.
        assert_eq!(brake.value(&[f64::NAN, 2.0]), 2.0);
    }

    #[test]
    fn a_table_is_straight_between_its_points_and_bounded_where_it_is_read() {
        let lift = compiled("lift(x)").unwrap();
        assert_eq!(
            [0.25, 0.5, 1.0, 9.0].map(|x| lift.value(&[x, 0.0]).round()),
            [1500.0, 3000.0, 1667.0, 1667.0]
        );
        // x is 0 to 1 m, and the table goes on to 2 m.
        assert_eq!(lift.bounds, [0.0, 3000.0]);
        assert!(compiled("1[N^2]/lift(x)").unwrap_err().why.contains("may be 0 (0 to 3000)"));
        assert!(compiled("1[N^2]/lift(max(x, 0.1[m]))").is_ok());
        assert!(compiled("lift(c)").unwrap_err().why.contains("lift is over m, and this is in N s/m"));
        assert!(compiled("lift(x, x)").unwrap_err().why.contains("it takes 1"));
        assert!(compiled("lifts(x)").unwrap_err().why.contains("not, and the tables"));
    }

    #[test]
    fn what_cannot_run_is_refused_at_its_byte() {
        for (text, at, why) in [
            ("c*w", 102, "'w' is unknown here; known are pi, x, v, c"),
            ("c*x", 100, "force is in N, and this is in N s"),
            ("c*v/x*1[m]", 103, "divides by a value that may be 0 (0 to 1)"),
            ("c*v + exp(abs(v)/0.01[m/s])*1[N]", 106, "counts as not finite"),
            ("c*v*(", 105, "ends where a value should stand"),
            ("delay(v, 1)", 100, "'delay' is no function; known are abs, "),
        ] {
            let wrong = compiled(text).unwrap_err();
            assert!(wrong.at == at && wrong.why.contains(why), "{text}: {wrong:?}");
        }
        let long = (1..=90).map(|number| format!("{number}.5")).collect::<Vec<_>>().join(",");
        let wrong = compiled(&format!("c*v*min({long}, x/1[m], 1)")).unwrap_err();
        assert!(wrong.why.contains("more than 96"), "{wrong:?}");
    }
}
