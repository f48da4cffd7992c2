//! dev
use discrepancy::{check, course::Course, parameters::PARAMETERS, records, verify::verify};
use plant::RigParameters;
fn main() {
    let draws: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string("/tmp/dev6/draws.json").unwrap()).unwrap();
    for number in std::env::args().skip(1) {
        let number: usize = number.parse().unwrap();
        let d = &draws["draws"][number];
        let folder = format!("/tmp/dev6rec/{number:03}");
        let base =
            RigParameters::from_toml(&std::fs::read_to_string(format!("{folder}/rig.toml")).unwrap(), "rig")
                .unwrap();
        let mut rig = base.clone();
        for w in d["wrong_parameters"].as_array().unwrap() {
            let p = PARAMETERS.iter().find(|p| w["name"] == p.name).unwrap();
            rig = p.scaled(&rig, w["factor"].as_f64().unwrap()).unwrap();
        }
        for h in d["hidden"].as_array().unwrap() {
            let n: Vec<(&str, f64)> = h["numbers"]
                .as_object()
                .unwrap()
                .iter()
                .map(|(k, v)| (k.as_str(), v.as_f64().unwrap()))
                .collect();
            rig = rig.with_effect(h["effect"].as_str().unwrap(), h["where"].as_str().unwrap(), &n).unwrap();
        }
        let rec = records::read(format!("{folder}/test.csv").as_ref(), &Default::default()).unwrap();
        let c = check::check(&rec, &base);
        let course = Course::of(&rec, &c, &base).unwrap();
        let t = std::time::Instant::now();
        let v = verify(&base, &rig, &course, &mut |_| ());
        let took = t.elapsed().as_secs_f64();
        let x = &v.verification;
        let inside = x.chi2_after >= x.chi2_null[0] && x.chi2_after <= x.chi2_null[1];
        println!(
            "#{number} {} {} {}{} wrong {} | chi2 {:.3} -> {:.4} [{:.4} {:.4}] {} conf {} phys {:?} mem {:.2?} jit {:.1e} t {took:.1}",
            d["hidden"][0]["effect"],
            d["axis"],
            if d["coloured_noise"] == true { "COL " } else { "" },
            if d["both_axes"] == true { "BOTH" } else { "" },
            d["wrong_parameters"].as_array().unwrap().len(),
            x.chi2_before,
            x.chi2_after,
            x.chi2_null[0],
            x.chi2_null[1],
            if inside { "IN" } else { "OUT" },
            x.confirmed,
            x.physical,
            course.memory,
            course.jitter_s
        );
        for (name, g) in &v.gap {
            println!(
                "    {name:22} {:.3} {:.3} floor {:.4e} closed {} white {:.2} {:.2} nrmse {:.2} {:.2}",
                g.before / g.floor,
                g.after / g.floor,
                g.floor,
                g.closed.map_or("-".into(), |c| format!("{c:.3}")),
                x.whiteness[name].before,
                x.whiteness[name].after,
                x.free_run_nrmse_percent[name].before,
                x.free_run_nrmse_percent[name].after
            );
        }
    }
}
