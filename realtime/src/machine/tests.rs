//! Machines that stand in a folder: what is read, and what is said of what is missing.

use super::*;
use flate2::Compression;
use flate2::write::GzEncoder;
use std::fs;
use std::io::Write;
use tempfile::TempDir;

fn machine_of(files: &[(&str, &str)]) -> (TempDir, Machine) {
    let folder = tempfile::tempdir().unwrap();
    for (path, text) in files {
        write(&folder, path, text.as_bytes());
    }
    let machine = Machine::below(folder.path(), "0123456789ab");
    (folder, machine)
}

fn write(folder: &TempDir, path: &str, bytes: &[u8]) {
    let path = folder.path().join(path);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

const VERSION: &str = "proc/version";
const DYNAMIC: &str = "Linux version 6.1.0 (gcc 12) #1 SMP PREEMPT_DYNAMIC Debian\n";
const CPU: &str = "sys/devices/system/cpu";

/// Files, the model, and a part of the name of its source.
type Case<'a> = (&'a [(&'a str, &'a str)], &'a str, &'a str);

fn preemption(files: &[(&str, &str)]) -> (String, String) {
    let Preemption { model, told_by } = machine_of(files).1.preemption;
    (model, told_by)
}

#[test]
fn the_preemption_model_is_read_from_the_first_file_that_has_it() {
    let debug = ("sys/kernel/debug/sched/preempt", "none voluntary (full) lazy\n");
    let command_line = ("proc/cmdline", "quiet preempt=voluntary ro");
    let config = ("boot/config-6.1.0", "# CONFIG_PREEMPT_NONE is not set\nCONFIG_PREEMPT_VOLUNTARY=y\n");
    let release = ("proc/sys/kernel/osrelease", "6.1.0\n");
    let cases: [Case<'_>; 8] = [
        (
            &[("sys/kernel/realtime", "1\n"), (VERSION, "Linux 6"), debug],
            "PREEMPT_RT",
            "/sys/kernel/realtime",
        ),
        (&[(VERSION, "Linux 6 #1 SMP PREEMPT_RT Debian")], "PREEMPT_RT", "/proc/version"),
        (
            &[("sys/kernel/realtime", "0"), (VERSION, DYNAMIC), debug, command_line],
            "full",
            "debug/sched/preempt",
        ),
        (&[(VERSION, DYNAMIC), command_line, release, config], "voluntary", "/proc/cmdline"),
        (&[(VERSION, DYNAMIC), release, config], "voluntary", "PREEMPT_DYNAMIC"),
        (&[(VERSION, "Linux 6 #1 SMP"), release, config], "voluntary", "/boot/config-6.1.0"),
        (&[(VERSION, "Linux 5 #1 SMP PREEMPT Fri")], "full", "/proc/version"),
        (&[(VERSION, DYNAMIC)], "unknown", "debugfs"),
    ];
    for (files, model, source) in cases {
        let (got, told_by) = preemption(files);
        assert_eq!(got, model, "{files:?}");
        assert!(told_by.contains(source), "{told_by}");
    }
}

#[test]
fn the_packed_configuration_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed
        .write_all(b"CONFIG_PREEMPT_NONE=y\n# CONFIG_PREEMPT is not set\nCONFIG_PREEMPT_DYNAMIC=y\n")
        .unwrap();
    write(&folder, "proc/config.gz", &packed.finish().unwrap());
    write(&folder, VERSION, DYNAMIC.as_bytes());
    let reported = Machine::below(folder.path(), "0123456789ab").preemption;
    assert_eq!(reported.model, "none");
    assert!(reported.told_by.ends_with("/proc/config.gz"), "{}", reported.told_by);
}

#[test]
fn processors_are_read_with_their_frequency_idle_states_and_interrupts() {
    let (_folder, machine) = machine_of(&[
        ("proc/cpuinfo", "processor\t: 0\nmodel name\t: Example 9000\nflags\t\t: fpu sse2\n"),
        ("proc/self/status", "Name:\temulator\nCpus_allowed_list:\t1-2\n"),
        (&format!("{CPU}/online"), "0-3\n"),
        (&format!("{CPU}/isolated"), "\n"),
        (&format!("{CPU}/nohz_full"), "(null)\n"),
        (&format!("{CPU}/cpu0/topology/thread_siblings_list"), "0-1\n"),
        (&format!("{CPU}/cpu1/topology/thread_siblings_list"), "0-1\n"),
        (&format!("{CPU}/cpu10/topology/thread_siblings_list"), "10\n"),
        (&format!("{CPU}/smt/control"), "on\n"),
        (&format!("{CPU}/cpufreq/policy0/affected_cpus"), "0 1\n"),
        (&format!("{CPU}/cpufreq/policy0/scaling_governor"), "powersave\n"),
        (&format!("{CPU}/cpufreq/policy0/scaling_driver"), "intel_pstate\n"),
        (&format!("{CPU}/cpufreq/policy0/scaling_min_freq"), "800000\n"),
        (&format!("{CPU}/cpufreq/policy0/scaling_max_freq"), "4200000\n"),
        (&format!("{CPU}/cpuidle/current_driver"), "intel_idle\n"),
        (&format!("{CPU}/cpuidle/current_governor"), "menu\n"),
        (&format!("{CPU}/cpu0/cpuidle/state0/name"), "POLL\n"),
        (&format!("{CPU}/cpu0/cpuidle/state0/latency"), "0\n"),
        (&format!("{CPU}/cpu0/cpuidle/state1/name"), "C6\n"),
        (&format!("{CPU}/cpu0/cpuidle/state1/latency"), "133\n"),
        (&format!("{CPU}/cpu0/cpuidle/state1/disable"), "1\n"),
        ("proc/irq/default_smp_affinity", "1,00000003\n"),
        ("proc/irq/9/smp_affinity_list", "0-1\n"),
        ("proc/irq/9/effective_affinity_list", "1\n"),
        ("proc/irq/10/smp_affinity_list", "0\n"),
        ("proc/irq/10/effective_affinity_list", "0\n"),
        (
            "proc/interrupts",
            "   CPU0 CPU1\n  9:  0  7  IO-APIC 4-edge ttyS0\nLOC: 1 2 Local timer interrupts\n",
        ),
    ]);
    assert_eq!(machine.processor, "Example 9000");
    assert_eq!((machine.processors_online.as_str(), machine.processors_allowed.as_str()), ("0-3", "1-2"));
    assert_eq!(machine.processors, 4);
    assert_eq!((machine.isolated.as_str(), machine.nohz_full.as_str()), ("none", "none"));
    assert_eq!(machine.smt.to_string(), "CPUs that share a core: 0-1 (control: on)");
    assert_eq!(
        machine.frequency_governors,
        ["CPUs 0,1: governor powersave, driver intel_pstate, 800 to 4200 MHz"].map(FrequencyPolicy::from)
    );
    assert!(
        matches!(&machine.frequency_governors[0], FrequencyPolicy::Policy { cpus, .. } if cpus == "CPUs 0,1")
    );
    assert_eq!(machine.idle_driver, "driver intel_idle, governor menu");
    assert_eq!(machine.idle_states, ["POLL: 0 us to leave", "C6: 133 us to leave, disabled"]);
    assert_eq!(machine.interrupts_default, "0-1,32");
    let interrupts = [
        ("CPU 0", "may come: 9-10; do come: none"),
        ("CPU 1", "may come: 9; do come: 9 ttyS0"),
        ("CPU 10", "may come: none; do come: none"),
    ];
    let reported = machine.interrupts.iter().map(|(cpu, route)| (cpu.as_str(), route.to_string()));
    assert!(reported.eq(interrupts.map(|(cpu, route)| (cpu, route.to_owned()))));
    assert_eq!(machine.hypervisor, Hypervisor::Absent);
}

#[test]
fn memory_limits_and_load_are_read() {
    let (_folder, machine) = machine_of(&[
        ("proc/meminfo", "MemTotal: 2000 kB\nMemAvailable: 1500 kB\nSwapTotal: 100 kB\nSwapFree: 60 kB\n"),
        ("proc/sys/vm/swappiness", "60\n"),
        ("sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never\n"),
        (
            "proc/self/limits",
            "Max open files            1024  4096  files\nMax locked memory   8388608  8388608  bytes\n\
             Max realtime priority     99  99 \n",
        ),
        ("proc/loadavg", "0.50 0.40 0.30 1/100 4242\n"),
        ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
        ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
    ]);
    let memory = &machine.memory;
    assert_eq!((memory.total_kib, memory.available_kib), (Some(2000), Some(1500)));
    assert_eq!((memory.swap_total_kib, memory.swap_used_kib), (Some(100), Some(40)));
    assert_eq!(memory.transparent_huge_pages, "always [madvise] never");
    let Limits { rtprio, memlock, nofile } = &machine.limits;
    assert_eq!([rtprio, memlock, nofile], ["99", "8388608", "1024"]);
    assert_eq!(machine.load_average, "0.50 0.40 0.30");
    assert_eq!(machine.rt_throttling.about.to_string(), "on: 950000 us of each 1000000 us");
}

#[test]
fn every_sign_of_a_hypervisor_counts() {
    let clock_sources = "sys/devices/system/clocksource/clocksource0/available_clocksource";
    for (path, text, sign) in [
        ("proc/cpuinfo", "flags\t\t: fpu hypervisor sse2\n", "flag 'hypervisor'"),
        ("sys/hypervisor/type", "xen\n", "xen"),
        (clock_sources, "tsc kvm-clock\n", "kvm-clock"),
        ("sys/class/dmi/id/sys_vendor", "QEMU\n", "QEMU"),
    ] {
        let found = machine_of(&[(path, text)]).1.hypervisor;
        assert!(found.is_present() && found.to_string().contains(sign), "{found}");
    }
    let bare = machine_of(&[("sys/class/dmi/id/sys_vendor", "LENOVO\n"), (clock_sources, "tsc hpet\n")]).1;
    assert_eq!(bare.hypervisor, Hypervisor::Absent);
    assert_eq!(bare.hypervisor.to_string(), "none");
}

#[test]
fn what_is_missing_says_so_with_its_file() {
    let (_folder, machine) = machine_of(&[]);
    assert_eq!(
        machine.clock_source,
        "unknown: /sys/devices/system/clocksource/clocksource0/current_clocksource: No such file or directory"
    );
    let no_cpufreq = "no cpufreq: whoever sets the frequency is not in this kernel";
    assert_eq!(machine.frequency_governors, [no_cpufreq].map(FrequencyPolicy::from));
    assert_eq!(machine.frequency_governors[0].to_string(), no_cpufreq);
    assert_eq!(machine.idle_driver, "no cpuidle");
    assert_eq!(machine.rt_throttling.runtime_us, None);
    for text in [&machine.processor, &machine.load_average, &machine.limits.rtprio, &machine.preemption.model]
    {
        assert!(text.starts_with("unknown"), "{text}");
    }
    let json = serde_json::to_value(&machine).unwrap();
    assert_eq!(json["memory"]["total_kib"], serde_json::Value::Null);
}

#[test]
fn this_machine_is_read_whole() {
    let machine = Machine::read("0123456789ab");
    for text in
        [&machine.kernel_release, &machine.processor, &machine.processors_online, &machine.load_average]
    {
        assert!(!text.starts_with("unknown"), "{machine:?}");
    }
    assert_eq!(machine.build.commit, "0123456789ab");
    assert!(machine.build.rustc.starts_with("rustc "), "{}", machine.build.rustc);
    assert!(machine.memory.total_kib > Some(0));
    assert!(!machine.interrupts.is_empty());
}
