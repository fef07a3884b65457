//! scratch
use daymark::{engine::*, enroll::select::select_corners, picture::*, simd::Processor, table_file::*, with_kernels};
use daymark_core::{profile::Profile, table::*, verdict::*};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;
fn main() {
    let dir = std::env::args().nth(1).unwrap();
    let dir = Path::new(&dir);
    let profile = if std::env::args().nth(2).as_deref() == Some("board") { Profile::Board } else { Profile::Handheld };
    let m: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(dir.join("manifest.json")).unwrap()).unwrap();
    let load = |p: &str| read_gray(&dir.join(p)).unwrap().shrunk_to(FRAME_SIDE);
    let cpu = Processor::detect();
    println!("{cpu:?}");
    let mut table = OwnedTable { profile, landmarks: vec![] };
    let t = Instant::now();
    let mut n = 0;
    for b in m["recognition"].as_array().unwrap() {
        let views = b["gallery"]
            .as_array()
            .unwrap()
            .iter()
            .map(|p| {
                n += 1;
                let i = load(p.as_str().unwrap());
                let f = with_kernels!(cpu, k => select_corners(k, &i, selection(profile)));
                ViewEntry { width: i.width as u16, height: i.height as u16, features: f }
            })
            .collect();
        table.landmarks.push(LandmarkEntry {
            name: b["building"].as_str().unwrap().into(),
            kind: Kind::Building,
            position: None,
            views,
        });
    }
    println!("enroll {:?} each {n}", t.elapsed() / n);
    let bytes = table.to_bytes().unwrap();
    println!("bytes/view {}", bytes.len() / n as usize);
    let mut t = LandmarkTable::open(&bytes).unwrap().verified().unwrap();
    let mut e = Engine::new(profile);
    let mut equiv: BTreeMap<String, String> = BTreeMap::new();
    for p in m["equivalent_buildings"].as_array().into_iter().flatten() {
        equiv.insert(p[1].as_str().unwrap().into(), p[0].as_str().unwrap().into());
    }
    let canon = |s: &str| equiv.get(s).cloned().unwrap_or(s.to_string());
    let (mut ext, mut rec) = (vec![], vec![]);
    let mut run = |p: &str| {
        let i = load(p);
        let a = Instant::now();
        e.extract(&i).unwrap();
        let b = Instant::now();
        let r = e.recognize(&mut t, FalseAnswer::ONE_PERCENT).unwrap();
        ext.push((b - a).as_secs_f64() * 1e3);
        rec.push(b.elapsed().as_secs_f64() * 1e6 / n as f64);
        let a = r.best;
        (
            a.map(|a| canon(t.landmark(a.landmark).unwrap().name)).unwrap_or_default(),
            a.map_or(-9999, |a| a.matched.evidence),
            a.map_or(1.0, |a| a.false_answer.probability()),
        )
    };
    let neg: Vec<_> =
        m["negatives"].as_array().unwrap().iter().map(|p| run(p.as_str().or(p["file"].as_str()).unwrap())).collect();
    let mut q = vec![];
    for b in m["recognition"].as_array().unwrap() {
        for p in b["queries"].as_array().unwrap() {
            let r = run(p.as_str().unwrap());
            q.push((canon(b["building"].as_str().unwrap()), r));
        }
    }
    for street in [None, Some(false), Some(true)] {
        let qs: Vec<_> = q.iter().filter(|(b, _)| street.is_none_or(|s| b.starts_with("sf_") == s)).collect();
        let right = qs.iter().filter(|(b, r)| *b == r.0).count();
        let worst = neg.iter().map(|r| r.1).chain(q.iter().filter(|(b, r)| *b != r.0).map(|(_, r)| r.1)).max().unwrap();
        let r0 = qs.iter().filter(|(b, r)| *b == r.0 && r.1 > worst).count();
        print!(
            "{street:?} n {} r@1 {:.3} r0fa {:.3} worst {:.1} |",
            qs.len(),
            right as f64 / qs.len() as f64,
            r0 as f64 / qs.len() as f64,
            worst as f64 / 160.0
        );
        for p in [0.1, 0.01, 0.001] {
            print!(
                " p{p}: neg {} right {} wrong {};",
                neg.iter().filter(|r| r.2 <= p).count(),
                qs.iter().filter(|(b, r)| *b == r.0 && r.2 <= p).count(),
                qs.iter().filter(|(b, r)| *b != r.0 && r.2 <= p).count()
            );
        }
        println!();
    }
    ext.sort_by(f64::total_cmp);
    rec.sort_by(f64::total_cmp);
    println!(
        "features ms median {:.3} view us median {:.1} mean {:.1}",
        ext[ext.len() / 2],
        rec[rec.len() / 2],
        rec.iter().sum::<f64>() / rec.len() as f64
    );
    let mut s: Vec<_> = neg.iter().map(|r| r.1 / 160).collect();
    s.sort();
    println!("neg top {:?}", &s[s.len() - 8..]);
}
