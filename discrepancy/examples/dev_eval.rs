//! dev
use discrepancy::{
    candidates::Candidate, check, course::Course, engine::Engine, name, parameters::*, records,
};
use plant::RigParameters;
use std::time::Instant;
fn main() {
    let truth: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string("/tmp/dev6/draws.json").unwrap()).unwrap();
    for number in std::env::args().skip(1) {
        let number: usize = number.parse().unwrap();
        let d = &truth["draws"][number];
        let folder = format!("/tmp/dev6rec/{number:03}");
        let t = Instant::now();
        let rig =
            RigParameters::from_toml(&std::fs::read_to_string(format!("{folder}/rig.toml")).unwrap(), "rig")
                .unwrap();
        let rec = records::read(format!("{folder}/train.csv").as_ref(), &Default::default()).unwrap();
        let c = check::check(&rec, &rig);
        let courses = vec![Course::of(&rec, &c, &rig).unwrap()];
        let engine = Engine::new(&courses, &rig);
        let cands = Candidate::all(courses[0].measured, courses[0].linked, &[]);
        let f = name::name(&engine, cands, &mut |_| ());
        let hidden: Vec<String> = d["hidden"]
            .as_array()
            .unwrap()
            .iter()
            .map(|h| format!("{} {}", h["effect"].as_str().unwrap(), h["where"].as_str().unwrap()))
            .collect();
        let named: Vec<String> = f.model.placed.iter().map(|p| p.candidate.name()).collect();
        let right = hidden.iter().all(|h| named.contains(h)) && named.len() == hidden.len();
        let show = |p: &discrepancy::refit::Placed| {
            p.candidate
                .numbers(&p.coordinates)
                .iter()
                .map(|n| format!("{n:.4}"))
                .collect::<Vec<_>>()
                .join(",")
        };
        println!(
            "{} #{number} {} hidden {:?} named {:?} {}{}{}{} t {:.1}",
            if right { "OK " } else { "BAD" },
            d["kind"].as_str().unwrap(),
            hidden,
            named,
            if d["foreign_form"] == true { "FOREIGN " } else { "" },
            if d["coloured_noise"] == true { "COL " } else { "" },
            if d["both_axes"] == true { "BOTH " } else { "" },
            d["axis"].as_str().unwrap(),
            t.elapsed().as_secs_f64()
        );
        println!(
            "     truth {} wrong {}",
            d["hidden"].as_array().unwrap().iter().map(|h| h["numbers"].to_string()).collect::<String>(),
            d["wrong_parameters"]
                .as_array()
                .unwrap()
                .iter()
                .map(|w| format!("{} {:.3} ", w["name"].as_str().unwrap(), w["factor"].as_f64().unwrap()))
                .collect::<String>()
        );
        println!(
            "     par {:.0} -> {:.0} thr {:.0} inadequate {} infl {:.1} factors {}",
            f.calibrated.fit.loss,
            f.model.loss,
            f.threshold,
            f.inadequate,
            f.model.inflation,
            f.model
                .factors
                .iter()
                .zip(&f.model.errors[f.model.errors.len() - COUNT..])
                .map(|(x, e)| format!("{:.4}±{:.4}", x, e))
                .collect::<Vec<_>>()
                .join(" ")
        );
        for (p, a) in f.model.placed.iter().zip(&f.alternatives) {
            println!(
                "     {} [{}] z {:?} se {:?} alt {:?}",
                p.candidate.name(),
                show(p),
                p.coordinates,
                &f.model.errors[..p.coordinates.len()],
                a.iter()
                    .map(|r| format!("{} {:.0}", r.placed.last().unwrap().candidate.name(), r.loss))
                    .collect::<Vec<_>>()
            );
        }
        for r in f.fitted.iter().take(3) {
            println!("       fitted {} {:.0} [{}]", r.placed[0].candidate.name(), r.loss, show(&r.placed[0]));
        }
    }
}
