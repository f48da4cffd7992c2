//! The chains of the axis controllers as diagrams: their states, which `rig.dbc` names, and the edges between them.
//!
//! The edges are those of the diagrams at the heads of `axis/src/chains/*.rs`; a test compares every name with `rig.dbc`. A
//! transition from any state (a fault, an emergency stop, another phase of the main chain) is drawn from its most frequent
//! source state alone, to keep the diagram legible.

use super::state::ChainStates;
use protocol::frames::{ChainStatus, DRIVE_CHAIN_STATUS, Frame};
use serde_json::{Value, json};

/// A chain: its name, its signal in the status of an axis, and its edges.
struct Chain {
    name: &'static str,
    signal: &'static str,
    edges: &'static [(&'static str, &'static str)],
}

const CHAINS: [Chain; 4] = [
    Chain {
        name: "main",
        signal: "main_chain",
        edges: &[
            ("waiting-for-rig", "initial-positioning"),
            ("initial-positioning", "preparing"),
            ("preparing", "initial-force"),
            ("initial-force", "settling"),
            ("settling", "experiment"),
            ("experiment", "final-settling"),
            ("final-settling", "initial-positioning"),
            ("final-settling", "done"),
            ("experiment", "aborted"),
            ("experiment", "fault"),
            ("aborted", "initial-positioning"),
            ("fault", "initial-positioning"),
            ("experiment", "waiting-for-rig"),
        ],
    },
    Chain {
        name: "force",
        signal: "force_chain",
        edges: &[
            ("idle", "limited"),
            ("limited", "standstill"),
            ("standstill", "moving"),
            ("moving", "standstill"),
            ("standstill", "done"),
            ("limited", "fault"),
            ("idle", "initial-ramp"),
            ("initial-ramp", "load-profile"),
            ("load-profile", "idle"),
        ],
    },
    Chain {
        name: "matching",
        signal: "matching_chain",
        edges: &[
            ("idle", "waiting-for-rest"),
            ("waiting-for-rest", "averaging"),
            ("averaging", "waiting-for-rest"),
            ("averaging", "matched"),
            ("matched", "waiting-for-rest"),
            ("waiting-for-rest", "fault"),
            ("averaging", "fault"),
            ("waiting-for-rest", "idle"),
        ],
    },
    Chain {
        name: "emergency_stop",
        signal: "emergency_stop_chain",
        edges: &[
            ("ready", "tripped"),
            ("tripped", "waiting-for-release"),
            ("waiting-for-release", "recovering"),
            ("recovering", "ready"),
            ("recovering", "waiting-for-start"),
            ("waiting-for-start", "ready"),
            ("recovering", "tripped"),
            ("waiting-for-start", "tripped"),
        ],
    },
];

fn states(signal: &str) -> &'static [&'static str] {
    let spec = DRIVE_CHAIN_STATUS.signals.iter().find(|known| known.name == signal);
    spec.map_or(&[], |spec| spec.values)
}

/// All chains: `name`, `states`, `edges`.
pub(crate) fn diagrams() -> Value {
    let diagram =
        |chain: &Chain| json!({ "name": chain.name, "states": states(chain.signal), "edges": chain.edges });
    CHAINS.iter().map(diagram).collect()
}

/// The states of an axis by chain.
pub(crate) fn active(status: ChainStatus) -> ChainStates {
    let mut by_chain = ChainStates::new();
    // The signals of both axes have the same layout.
    Frame::DriveChainStatus(status).for_each_signal(|signal, value| {
        if let Some(chain) = CHAINS.iter().find(|chain| chain.signal == signal.name) {
            by_chain.insert(chain.name, signal.values.get(value as usize).copied());
        }
    });
    by_chain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_of_an_edge_is_one_of_the_wire_and_every_state_is_reached() {
        for chain in &CHAINS {
            let states = states(chain.signal);
            assert!(!states.is_empty(), "{}", chain.name);
            for state in chain.edges.iter().flat_map(|(from, to)| [from, to]) {
                assert!(states.contains(state), "{}: {state}", chain.name);
            }
            for state in states {
                let is_reached = chain.edges.iter().any(|(_, to)| to == state);
                assert!(is_reached, "{}: nothing leads to {state}", chain.name);
            }
        }
    }

    #[test]
    fn active_states_are_reported_by_name() {
        let frame = Frame::from_values(DRIVE_CHAIN_STATUS.id, &[5.0, 2.0, 3.0, 0.0, 1.0, 9.0, 0.0]);
        let Some(Frame::DriveChainStatus(status)) = frame else { panic!("{frame:?}") };
        let reported = active(status);
        assert_eq!(reported["main"], Some("experiment"));
        assert_eq!(reported["force"], Some("standstill"));
        assert_eq!(reported["matching"], Some("matched"));
        assert_eq!(reported["emergency_stop"], Some("ready"));
    }
}
