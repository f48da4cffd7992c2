//! dev
use discrepancy::{check, course::Course, records, windows::Windows};
use plant::RigParameters;
use std::time::Instant;
fn main() {
    for folder in std::env::args().skip(1) {
        let rig =
            RigParameters::from_toml(&std::fs::read_to_string(format!("{folder}/rig.toml")).unwrap(), "rig")
                .unwrap();
        let rec = records::read(format!("{folder}/train.csv").as_ref(), &Default::default()).unwrap();
        let c = check::check(&rec, &rig);
        let course = Course::of(&rec, &c, &rig).unwrap();
        let t = Instant::now();
        let w = Windows::new(&course, &rig);
        let t1 = t.elapsed();
        let t = Instant::now();
        let s = w.simulate(&rig);
        let t2 = t.elapsed();
        let t = Instant::now();
        let r = w.residual(&s);
        let t3 = t.elapsed();
        let f = w.freedom();
        let rows = w.rows();
        let mut chi: Vec<f64> =
            r.chunks(rows).zip(&f).map(|(r, f)| r.iter().map(|x| x * x).sum::<f64>() / f).collect();
        let all = chi.iter().sum::<f64>() / chi.len() as f64;
        let worst = chi
            .iter()
            .enumerate()
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map(|(i, c)| (w.starts()[i], *c))
            .unwrap();
        let lanes: Vec<f64> = (0..w.lanes().len())
            .map(|l| {
                let v: Vec<f64> = r.iter().skip(l).step_by(w.lanes().len()).copied().collect();
                (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64)
            })
            .collect();
        chi.sort_by(f64::total_cmp);
        print!("jit {:.6} mem {:.2?} ", course.jitter_s, course.memory);
        println!(
            "{} n={} mean {:.3} median {:.3} p95 {:.3} worst {:?} lanes {:.3?}  {:?} {:?} {:?}",
            &folder[folder.len() - 3..],
            chi.len(),
            all,
            chi[chi.len() / 2],
            chi[chi.len() * 95 / 100],
            worst,
            lanes,
            t1,
            t2,
            t3
        );
    }
}
