//! Facts that stand as a text in the files of a run: one type writes the text and reads it again, and programs decide on it.
//!
//! A text that this version does not write is kept as it is, so every text comes back unchanged.

/// Implements what serde needs for a type with `Display` and `From<&str>` that stands as a string in a file. A missing text is
/// the empty one.
macro_rules! stored_as_text {
    ($($name:ty),+ $(,)?) => {$(
        impl Default for $name {
            fn default() -> Self {
                Self::from("")
            }
        }

        impl From<String> for $name {
            fn from(text: String) -> Self {
                Self::from(text.as_str())
            }
        }

        impl From<$name> for String {
            fn from(fact: $name) -> Self {
                fact.to_string()
            }
        }
    )+};
}

pub(crate) use stored_as_text;

#[cfg(test)]
mod tests {
    use crate::Machine;
    use crate::machine::{
        BuildProfile, FrequencyPolicy, Governor, Hypervisor, HypervisorSign, InterruptRoute, SharedCores,
        ThrottlingState,
    };
    use serde::Serialize;
    use serde::de::DeserializeOwned;
    use serde_json::{Value, json};
    use std::fmt::{Debug, Display};

    /// Texts that no type writes, or that one writes and the others do not know.
    const FOREIGN: [&str; 12] = [
        "",
        "none",
        "unknown",
        "not by this version",
        "governor performance",
        "may come: 3-5",
        "CPUs that share a core",
        "no CPUs share a core (control: on",
        "on",
        "on: 0950 us of each 1000 us",
        "off: by somebody",
        "profile debug",
    ];

    fn text_and_fact_agree<T>(facts: &[(&str, T)], other: impl Fn(String) -> T)
    where
        T: Clone + Debug + PartialEq + Display + Serialize + DeserializeOwned + for<'a> From<&'a str>,
    {
        for (text, fact) in facts {
            assert_eq!((T::from(text), fact.to_string().as_str()), (fact.clone(), *text));
            assert_eq!(serde_json::to_value(fact).unwrap(), json!(text));
            assert_eq!(serde_json::from_value::<T>(json!(text)).unwrap(), *fact);
        }
        for text in FOREIGN {
            let fact = T::from(text);
            assert_eq!(fact.to_string(), text);
            let is_known = facts.iter().any(|(known, _)| text.starts_with(known));
            assert!(is_known || fact == other(text.to_owned()), "{fact:?}");
        }
    }

    #[test]
    fn frequency_policies_come_back_from_their_text() {
        let policy = |governor, range: &str| FrequencyPolicy::Policy {
            cpus: "CPUs 0,1".into(),
            governor,
            range: range.into(),
        };
        let facts = [
            ("no cpufreq: whoever sets the frequency is not in this kernel", FrequencyPolicy::no_cpufreq()),
            (
                "CPUs 0,1: governor performance, driver x, 800 to 3000 MHz",
                policy(Governor::Performance, ", driver x, 800 to 3000 MHz"),
            ),
            ("CPUs 0,1: governor unknown", policy(Governor::Other("unknown".into()), "")),
        ];
        text_and_fact_agree(&facts, FrequencyPolicy::Other);
    }

    #[test]
    fn interrupts_and_shared_cores_come_back_from_their_text() {
        let route = |allowed: Option<&str>, routed: Option<&str>| InterruptRoute::Known {
            allowed: allowed.map(str::to_owned),
            routed: routed.map(str::to_owned),
        };
        let routes = [
            ("may come: none; do come: none", route(None, None)),
            ("may come: 1,3-5; do come: none", route(Some("1,3-5"), None)),
            ("may come: 4; do come: 4 ttyS0, 5 virtio0", route(Some("4"), Some("4 ttyS0, 5 virtio0"))),
        ];
        text_and_fact_agree(&routes, InterruptRoute::Other);
        let control = |control: &str| Some(control.to_owned());
        let cores = ["0,2", "3,4"].map(str::to_owned).to_vec();
        let shared = [
            ("no CPUs share a core (control: off)", SharedCores::NoneShared { control: control("off") }),
            (
                "CPUs that share a core: 0,2; 3,4 (control: on)",
                SharedCores::Shared { cores: cores.clone(), control: control("on") },
            ),
            ("CPUs that share a core: 0,2; 3,4", SharedCores::Shared { cores, control: None }),
        ];
        text_and_fact_agree(&shared, SharedCores::Other);
    }

    #[test]
    fn throttling_and_profile_come_back_from_their_text() {
        let states = [
            ("off", ThrottlingState::Off),
            (
                "on: 950000 us of each 1000000 us",
                ThrottlingState::On { runtime_us: 950_000, period_us: 1_000_000 },
            ),
            ("without effect: all of each period", ThrottlingState::WithoutEffect),
            ("unknown: /proc/sys/kernel/sched_rt_runtime_us cannot be read", ThrottlingState::Unreadable),
        ];
        text_and_fact_agree(&states, ThrottlingState::Other);
        assert_eq!(ThrottlingState::from(FOREIGN[10]), ThrottlingState::Other(FOREIGN[10].into()));
        let settings = |level: &str| format!(", opt-level {level}");
        let profiles = [
            ("debug, opt-level 0", BuildProfile::Debug { settings: settings("0") }),
            ("release, opt-level 3", BuildProfile::Release { settings: settings("3") }),
            ("release", BuildProfile::Release { settings: String::new() }),
        ];
        text_and_fact_agree(&profiles, BuildProfile::Other);
        assert!(profiles[0].1.is_for_debugging() && !profiles[1].1.is_for_debugging());
    }

    #[test]
    fn a_hypervisor_comes_back_from_its_text_and_foreign_words_are_a_sign() {
        let signs = vec![
            HypervisorSign::CpuFlag,
            HypervisorSign::Kind("xen".into()),
            HypervisorSign::ClockSource("kvm-clock".into()),
            HypervisorSign::Dmi("QEMU Standard PC".into()),
        ];
        let facts = [
            ("none", Hypervisor::Absent),
            (
                "cpuinfo flag 'hypervisor'; /sys/hypervisor/type xen; clock source kvm-clock; DMI QEMU Standard PC",
                Hypervisor::Present(signs),
            ),
            ("unknown", Hypervisor::NotRecorded("unknown".into())),
            ("", Hypervisor::NotRecorded(String::new())),
        ];
        text_and_fact_agree(&facts, |text| Hypervisor::Present(vec![HypervisorSign::Other(text)]));
        for text in ["No", "FALSE", "None"] {
            assert_eq!(Hypervisor::from(text), Hypervisor::NotRecorded(text.into()));
        }
    }

    #[test]
    fn qemu_emulates_by_its_model_unless_kvm_is_below() {
        let machine = |processor: &str, hypervisor: &str, clock_sources: &str| Machine {
            processor: processor.into(),
            hypervisor: hypervisor.into(),
            clock_sources_available: clock_sources.into(),
            ..Machine::default()
        };
        let model = "QEMU Virtual CPU version 2.5+";
        assert!(machine("QEMU TCG CPU version 2.5+", "KVM", "tsc").is_emulated_by_qemu());
        assert!(machine(model, "cpuinfo flag 'hypervisor'", "tsc hpet").is_emulated_by_qemu());
        assert!(!machine("AMD EPYC", "none", "tsc").is_emulated_by_qemu());
        for (hypervisor, clock_sources) in
            [("KVM", "tsc"), ("clock source kvm-clock", "tsc"), ("none", "kvm-clock")]
        {
            assert!(!machine(model, hypervisor, clock_sources).is_emulated_by_qemu(), "{hypervisor}");
        }
    }

    #[test]
    fn a_machine_of_nobody_has_empty_texts() {
        let written = serde_json::to_value(Machine::default()).unwrap();
        for fact in [&written["smt"], &written["hypervisor"], &written["rt_throttling"]["about"]] {
            assert_eq!(*fact, Value::from(""));
        }
        assert_eq!(written["build"]["profile"], "");
        assert_eq!(serde_json::from_value::<Machine>(json!({})).unwrap(), Machine::default());
    }
}
