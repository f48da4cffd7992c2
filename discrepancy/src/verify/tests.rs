//! Held-out figures of models that are known to be right, wrong or unchanged.

use super::*;
use crate::gridded_record::AxisState;
use crate::next::divergence::noise_with_rounding;
use crate::windows::{Windows, first_state};
use plant::{Inputs, Plant, Sensors};

/// A record of 3 s made by a rig: the drive, out and back by half-open valves, with its sensors' noise.
fn record(rig: &RigParameters, baseline: &RigParameters, seed: u64) -> GriddedRecord {
    record_over(3000, rig, baseline, seed)
}

pub(crate) fn record_over(
    periods: usize,
    rig: &RigParameters,
    baseline: &RigParameters,
    seed: u64,
) -> GriddedRecord {
    let mut record = GriddedRecord {
        name: "made".to_owned(),
        measured: [true, false],
        inputs: vec![Inputs::default(); periods],
        smoothed_states: vec![[AxisState { extension_m: 0.1, ..AxisState::default() }; 2]],
        noise: [noise_with_rounding(baseline), [0.0; CHANNELS]],
        excluded_periods: vec![false; periods],
        ..GriddedRecord::default()
    };
    for (period, inputs) in record.inputs.iter_mut().enumerate() {
        inputs.valve[0] =
            plant::quantise_valve(0.5 * (period as f64 * 1e-3 * std::f64::consts::TAU / 0.75).sin());
    }
    let mut plant = Plant::in_state(rig, &first_state(&record, rig)).unwrap();
    let mut sampled = Sensors::new(rig, seed);
    record.smoothed_states.clear();
    for inputs in &record.inputs {
        let axis = plant.truth(inputs).axes[0];
        let reading = sampled.sample(&plant, inputs)[0];
        let samples = [reading.position, reading.force, reading.pressure_a, reading.pressure_b]
            .map(|reading| Some(reading.value));
        record.samples.push([samples, [None; CHANNELS]]);
        let point = AxisState {
            extension_m: axis.position_m,
            rod_velocity_m_per_s: axis.rod_velocity_m_per_s,
            alternative_velocity_m_per_s: None,
            pressures_pa: [axis.pressure_a_pa, axis.pressure_b_pa],
        };
        record.smoothed_states.push([point, AxisState::default()]);
        plant.step(inputs);
    }
    record
}

fn judged(before: &RigParameters, after: &RigParameters, record: &GriddedRecord) -> Verified {
    verify(before, after, record, &mut |_| ())
}

fn inclined(rig: &RigParameters, force_n: f64) -> RigParameters {
    rig.with_effect("inclination", "drive", &[("force_n", force_n)]).unwrap()
}

#[test]
fn where_nothing_is_missing_nothing_changes() {
    let rig = RigParameters::baseline();
    let verified = judged(&rig, &rig, &record(&rig, &rig, 1));
    let seen = &verified.verification;
    assert!(!seen.confirmed);
    assert_eq!(seen.chi2_before.to_bits(), seen.chi2_after.to_bits());
    assert!(seen.chi2_null[0] < 1.0 && 1.0 < seen.chi2_null[1], "{:?}", seen.chi2_null);
    // Four sevenths of a per cent of spread on each side of the range: 30 windows hold 1 % of it.
    assert!((seen.chi2_after - 1.0).abs() < 0.06, "{}", seen.chi2_after);
    assert_eq!(seen.physical, Vec::<String>::new());
    for (signal, misfit) in &verified.misfit {
        assert_eq!(misfit.closed, None, "{signal}: {misfit:?}");
        assert_eq!(misfit.before.to_bits(), misfit.after.to_bits(), "{signal}");
    }
    assert_eq!(verified.misfit.len(), CHANNELS);
    assert_eq!(seen.free_run_nrmse_percent.len(), CHANNELS);
}

#[test]
fn the_true_model_closes_the_gap_and_a_wrong_sign_does_not() {
    let rig = RigParameters::baseline();
    let truth = inclined(&rig, 20.0);
    let record = record(&truth, &rig, 2);
    let verified = judged(&rig, &truth, &record);
    let seen = &verified.verification;
    assert!(seen.confirmed, "{seen:?}");
    let closed: Vec<f64> = verified.misfit.values().filter_map(|misfit| misfit.closed).collect();
    assert!(!closed.is_empty() && closed.iter().all(|closed| *closed > 0.95), "{:?}", verified.misfit);
    let run = seen.free_run_nrmse_percent["drive_position_m"];
    assert!(run.after < 0.2 * run.before, "{run:?}");
    let white = seen.whiteness["drive_position_m"];
    assert!(white.before > 0.3 && white.after.abs() < 0.1, "{white:?}");

    let wrong = judged(&rig, &inclined(&rig, -20.0), &record);
    assert!(!wrong.verification.confirmed);
    assert!(wrong.verification.chi2_after > wrong.verification.chi2_before);
}

#[test]
fn windows_that_one_model_alone_gets_wrong_count_and_faults_of_the_record_do_not() {
    let sums = |at: usize, sum: f64| {
        Power::new(&(0..60).map(|k| if k == at { sum } else { 100.0 }).collect::<Vec<_>>(), &[100.0; 60], 1)
    };
    let ratio = |models: [Power; 2]| {
        let misfit = signal_misfit(&models, 0, 1.0, 0.01);
        misfit.after / misfit.before
    };
    assert_eq!(ratio([sums(7, 1e5), sums(7, 2e5)]), 1.0, "a spike of the sensor");
    assert!(ratio([sums(7, 100.0), sums(7, 1e5)]) > 4.0, "the extended model alone");
    assert!(ratio([sums(7, 1e5), sums(7, 100.0)]) < 0.25, "the rig file alone");
}

#[test]
fn a_hidden_leak_is_closed_by_itself() {
    let rig = RigParameters::baseline();
    let truth = rig.with_effect("rod-leakage", "drive.b", &[("leakage_nl_per_min", 20.0)]).unwrap();
    let verified = judged(&rig, &truth, &record(&truth, &rig, 3));
    assert!(verified.verification.confirmed, "{:?}", verified.verification);
    let closed: Vec<f64> = verified.misfit.values().filter_map(|misfit| misfit.closed).collect();
    assert!(!closed.is_empty() && closed.iter().all(|closed| *closed > 0.95), "{:?}", verified.misfit);
}

#[test]
fn traces_hold_the_whole_record_and_nothing_where_it_is_not_judged() {
    let rig = RigParameters::baseline();
    let mut record = record(&rig, &rig, 4);
    record.samples[555][0][2] = None;
    record.excluded_periods[1010] = true;
    let traces = judged(&rig, &rig, &record).traces;
    assert_eq!(traces.len(), CHANNELS);
    let pressure = traces.iter().find(|trace| trace.signal == "drive_pressure_a_Pa").unwrap();
    assert_eq!((pressure.time_s.len(), pressure.before.len()), (record.len(), record.len()));
    assert!(pressure.before[50].is_nan() && pressure.before[1050].is_nan());
    assert!(pressure.measured[555].is_nan() && pressure.after_residual[555].is_nan());
    assert!(!pressure.before[555].is_nan());
    assert!((pressure.before[700] - pressure.measured[700]).abs() < 8.0 * pressure.noise);
}

#[test]
fn a_law_over_time_goes_on_in_the_time_of_the_whole_record_where_a_part_is_searched() {
    let rig = RigParameters::baseline();
    let law = "[[terms]]\nname = \"fades\"\nplace = \"drive.force\"\nadd = \"-5[N/s]*t\"\n";
    let text = format!("{}{law}", RigParameters::BASELINE_TOML);
    let truth = RigParameters::from_toml(&text, "rig.toml").unwrap_or_else(|error| panic!("{error}"));
    let all = record_over(9600, &truth, &rig, 5);
    let part = all.thinned(0.5).expect("two blocks of four");
    let by_itself = GriddedRecord { blocks: Vec::new(), ..part.clone() };
    let whole = Windows::new(&all, &truth);
    let of_whole = whole.simulate(&truth);
    let since_start = |start: &usize| part.since_start(*start);
    // Largest difference from the windows of the whole record, in standard deviations of the noise.
    let difference = |record: &GriddedRecord| {
        let windows = Windows::new(record, &truth);
        let simulated = windows.simulate(&truth);
        let of_window = |(at, start): (usize, &usize)| {
            let place = whole.starts.iter().position(|other| *other == since_start(start)).expect("in both");
            let rows = windows.rows();
            let [one, other] = [&of_whole[place * rows..][..rows], &simulated[at * rows..][..rows]];
            one.iter().zip(other).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
        };
        let all: Vec<f64> = windows.starts.iter().enumerate().map(of_window).collect();
        assert_eq!(all.len(), 10);
        all.into_iter().fold(0.0, f64::max)
    };
    let [kept, lost] = [difference(&part), difference(&by_itself)];
    // What a window has not forgotten of the one before, against 12 to 24 N.
    assert!(kept < 3.0 && lost > 100.0, "{kept} {lost}");
}

#[test]
fn start_states_of_axes_that_do_not_act_on_each_other_are_perturbed_together() {
    let rig = RigParameters::baseline();
    let mut record = record(&rig, &rig, 6);
    // The load does what the drive does.
    record.measured = [true, true];
    record.noise[1] = record.noise[0];
    record.inputs.iter_mut().for_each(|inputs| inputs.valve[1] = inputs.valve[0]);
    record.samples.iter_mut().for_each(|samples| samples[1] = samples[0]);
    record.smoothed_states.iter_mut().for_each(|states| states[1] = states[0]);
    let together = Windows::new(&record, &rig).sensitivities();
    // A regulator that hardly gives way feeds both axes: each is perturbed by itself.
    let droop = [("droop_bar", 1e-6), ("volume_cm3", 1000.0)];
    let fed = rig.with_effect("supply-droop", "supply", &droop).unwrap();
    let alone = Windows::new(&record, &fed).sensitivities();
    assert_eq!(together.len(), alone.len());
    let norm = |column: &[f64]| column.iter().map(|value| value * value).sum::<f64>().sqrt();
    for (together, alone) in together.iter().zip(&alone) {
        assert_eq!([together.len(), alone.len()], [2 * AxisState::PERTURBATIONS.len(); 2]);
        for (one, other) in together.iter().zip(alone) {
            let difference: Vec<f64> = one.iter().zip(other).map(|(one, other)| one - other).collect();
            assert!(norm(&difference) < 0.02 * norm(other), "{} {}", norm(&difference), norm(other));
        }
    }
}
