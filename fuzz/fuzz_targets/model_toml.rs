//! Model files: any text is refused with line and column, or makes a model that is evaluated, alone and with each suspect.
#![no_main]

use libfuzzer_sys::fuzz_target;
use model::{Direction, Inputs, Model, Program, Simulator, Solver, Start};
use std::path::Path;

/// Operations of a model that is integrated over an interval, too.
const SMALL: usize = 40;

fuzz_target!(|text: &str| {
    let model = match Model::parse(text, Path::new("m.toml")) {
        Ok(model) => model,
        Err(error) => {
            let message = error.to_string();
            let mut parts = message.split(':');
            assert_eq!(parts.next(), Some("m.toml"), "{message}");
            // What is no TOML at all has its place in the words of the reader.
            let place = parts.next().map(|part| part.parse::<usize>().is_ok());
            assert!(place == Some(true) || message.contains("TOML parse error"), "{message}");
            return;
        }
    };
    let start = |start: Start| match start {
        Start::Known { value_si } | Start::Fitted { guess_si: value_si, .. } => value_si,
        Start::Record { .. } | Start::Input { .. } => 0.5,
    };
    let parameters: Vec<f64> = model.parameters.iter().map(|parameter| parameter.values_si[0]).collect();
    let starts: Vec<f64> = model.states.iter().map(|state| start(state.start)).collect();
    let memories: Vec<f64> = model.memories.iter().map(|memory| memory.start_si).collect();
    let samples = vec![vec![0.5, -0.25]; model.inputs.len()];
    let each = (0..model.suspects.len()).take(8).map(|suspect| vec![suspect]);
    for suspects in std::iter::once(Vec::new()).chain(each) {
        let program = Program::new(&model, &suspects).expect("all suspects together were compiled");
        let is_short =
            program.operations() > SMALL || matches!(model.solver, Solver::Fixed { step_s } if step_s < 1e-5);
        let time_s = [0.0, 1e-3];
        let inputs = Inputs { time_s: &time_s[..if is_short { 1 } else { 2 }], samples_si: &samples };
        let directions: Vec<Direction> = (0..parameters.len()).take(3).map(Direction::Parameter).collect();
        let mut simulator = Simulator::new(&program, &directions);
        // A model that does not go on is an answer; a panic is none.
        let _ = simulator.run(&inputs, [&parameters, &starts, &memories], |_, _, value, slope| {
            assert!(value.is_finite() && slope.len() == directions.len());
        });
    }
});
