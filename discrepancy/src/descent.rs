//! The loop of Gauss-Newton, whose callers know how to linearise and to search along a step.

/// Steps to iterates of less loss, until `step` finds none, one lowers it by less than `converged`, or `steps` are done.
pub(crate) fn descend<P>(
    start: P,
    steps: usize,
    converged: f64,
    loss: impl Fn(&P) -> f64,
    mut step: impl FnMut(&P) -> Option<P>,
) -> P {
    let mut point = start;
    for _ in 0..steps {
        let Some(next) = step(&point) else { break };
        let fall = loss(&point) - loss(&next);
        point = next;
        if fall < converged {
            break;
        }
    }
    point
}
