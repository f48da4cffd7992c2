//! dev
use discrepancy::{
    candidates::Candidate,
    check,
    course::Course,
    engine::Engine,
    parameters::*,
    records,
    refit::{Around, Placed, Refit, refit},
    screen::Columns,
};
use plant::RigParameters;
use rayon::prelude::*;
use std::time::Instant;
fn main() {
    let truth: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string("/tmp/dev6/draws.json").unwrap()).unwrap();
    let k: usize = std::env::var("K").ok().and_then(|s| s.parse().ok()).unwrap_or(10);
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
        let base = engine.simulate(&rig);
        let e0 = engine.residual(&base);
        let ones = [1.0; COUNT];
        let around = Around { columns: engine.parameter_columns(&rig, &ones), factors: ones };
        let t0 = t.elapsed();
        // parameters alone, in the simulator
        let mut par = around.clone();
        let mut pl = f64::INFINITY;
        let mut pf = ones;
        for _ in 0..4 {
            let Some(r) = refit(&engine, &par, &[], 0.0) else { break };
            if r.loss > pl - 0.5 {
                break;
            }
            pl = r.loss;
            pf = r.factors;
            par = Around { columns: engine.parameter_columns(&rig, &pf), factors: pf };
        }
        let cands = Candidate::all(courses[0].measured, courses[0].linked, &[]);
        let cols = Columns::new(&engine, cands);
        let t1 = t.elapsed();
        let (nothing, mut s) = cols.screen(&engine, &around, &e0, &[]);
        s.sort_by(|a, b| a.loss.total_cmp(&b.loss));
        let t2 = t.elapsed();
        let mut r: Vec<(String, Refit)> = s
            .iter()
            .take(k)
            .filter(|x| x.loss - s[0].loss < 0.6 * (nothing - s[0].loss).max(30.0))
            .collect::<Vec<_>>()
            .into_par_iter()
            .filter_map(|s| {
                refit(&engine, &around, &[s.start.clone()], 5.0).map(|r| (cols.candidates[s.at].name(), r))
            })
            .collect();
        r.sort_by(|a, b| a.1.loss.total_cmp(&b.1.loss));
        let t3 = t.elapsed();
        let hidden: Vec<String> = d["hidden"]
            .as_array()
            .unwrap()
            .iter()
            .map(|h| format!("{} {}", h["effect"].as_str().unwrap(), h["where"].as_str().unwrap()))
            .collect();
        let srank: Vec<_> =
            hidden.iter().map(|h| s.iter().position(|s| cols.candidates[s.at].name() == *h)).collect();
        let rrank: Vec<_> = hidden.iter().map(|h| r.iter().position(|s| s.0 == *h)).collect();
        let show = |p: &Placed| {
            p.candidate
                .numbers(&p.coordinates)
                .iter()
                .map(|n| format!("{n:.4}"))
                .collect::<Vec<_>>()
                .join(",")
        };
        println!(
            "#{number} {} {:?} {} {}{}{}{} wrong {}",
            d["kind"].as_str().unwrap(),
            hidden,
            d["hidden"].as_array().unwrap().iter().map(|h| h["numbers"].to_string()).collect::<String>(),
            if d["foreign_form"] == true { "FOREIGN " } else { "" },
            if d["coloured_noise"] == true { "COL " } else { "" },
            if d["both_axes"] == true { "BOTH " } else { "" },
            d["axis"].as_str().unwrap(),
            d["wrong_parameters"]
                .as_array()
                .unwrap()
                .iter()
                .map(|w| format!("{} {:.3} ", w["name"].as_str().unwrap(), w["factor"].as_f64().unwrap()))
                .collect::<String>()
        );
        println!(
            "   loss0 {:.0} nothing {nothing:.0} par {pl:.0} screen-rank {srank:?} refit-rank {rrank:?}  t {:.1} {:.1} {:.1} {:.1}",
            {
                let p = discrepancy::fit::Products::new(&e0, &[], engine.freedom(), engine.rows());
                p.fit(&[], &[]).loss
            },
            t0.as_secs_f64(),
            t1.as_secs_f64(),
            t2.as_secs_f64(),
            t3.as_secs_f64()
        );
        println!(
            "   screen: {}",
            s.iter()
                .take(4)
                .map(|s| format!("{} {:.0}", cols.candidates[s.at].name(), s.loss))
                .collect::<Vec<_>>()
                .join("; ")
        );
        for (n, r) in r.iter().take(4) {
            println!(
                "      {n} loss {:.0} [{}] se {:.3?} infl {:.1} z {:?}",
                r.loss,
                show(&r.placed[0]),
                &r.errors[..r.placed[0].coordinates.len()],
                r.inflation,
                r.placed[0].coordinates.iter().map(|z| (z * 1000.0).round() / 1000.0).collect::<Vec<_>>()
            );
        }
    }
}
