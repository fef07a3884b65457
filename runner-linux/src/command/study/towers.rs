//! `daymark study towers`: the thesis' experiment (7.1, 7.2) on the eight towers of `daymark-fixtures`.
#![allow(missing_docs)]
use super::{CommandError, Outcome};
use crate::classify::align::{Align, base_from_test};
use crate::classify::cloud::Cloud;
use crate::classify::error::{Comparison, compare};
use crate::classify::towers::*;
use daymark_core::mesh::SubdivisionLevel;
use daymark_fixtures::{Light, Tower};
use rayon::prelude::*;
#[derive(Debug, clap::Args)]
pub struct Args {
    #[arg(long, default_value_t = 4)]
    levels: u8,
    #[arg(long, default_value_t = 0.5)]
    noise: f64,
    #[arg(long, default_value_t = 1)]
    seeds: u64,
    #[arg(long)]
    light: Option<String>,
    #[arg(long, default_value_t = 0.6)]
    reach: f64,
    #[arg(long, default_value = "centered")]
    align: String,
}
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let t = std::time::Instant::now();
    let towers = Tower::eight();
    let level = SubdivisionLevel::new(args.levels).unwrap();
    let light = match args.light.as_deref() { Some("evening") => Light::evening(), Some("overcast") => Light::overcast(), _ => Light::morning() };
    let bases: Vec<Cloud> = towers.iter().map(|tower| {
        let v = TowerViews::new(tower, &BASE_ANGLES, &Conditions { light: Light::morning(), seed: 50 + u64::from(tower.number), farther: 1.0 }, true);
        let m = v.model(args.noise, 999);
        eprintln!("base {} points {} tri {} refused {:?} dropped {:?} unseen {}", tower.number, m.surface.vertices.len(), m.surface.triangles.len(), m.refused, m.dropped, m.shown.iter().filter(|s| s.is_none()).count());
        let c = Cloud::of_dense(&m.dense(level, v.views(), v.stations()).unwrap());
        eprintln!("   dense {} dev {}", c.positions.len(), c.deviation);
        c
    }).collect();
    eprintln!("{:?}", t.elapsed());
    let align = match args.align.as_str() { "frame" => Align::Frame, "similarity" => Align::Similarity, _ => Align::Centered };
    for tower in &towers {
        let v = TowerViews::new(tower, &TEST_ANGLES, &Conditions { light, seed: 150 + u64::from(tower.number), farther: 1.1 }, false);
        let m = v.model(args.noise, 7);
        let test = Cloud::of_dense(&m.dense(level, v.views(), v.stations()).unwrap());
        let cs: Vec<Comparison> = bases.par_iter().map(|base| compare(&test, base, base_from_test(&test, base, align, None), args.reach)).collect();
        let rms: Vec<String> = cs.iter().map(|c| format!("{:6.3}", c.shape.one_sided.sqrt())).collect();
        let own = cs[tower.number as usize - 1].shape.one_sided.sqrt();
        let wrong = cs.iter().enumerate().filter(|(i, _)| *i != tower.number as usize - 1).map(|(_, c)| c.shape.one_sided.sqrt()).fold(9e9, f64::min);
        let int: Vec<String> = cs.iter().map(|c| c.intensity.map_or("  -  ".into(), |i| format!("{:5.2}", i.free))).collect();
        let [lo, hi] = test.extent();
        println!("{} pts {} dev {:.3} size {:.1} | {} | ratio {:.2} share {:.4} | {} | shift {:.2?}", tower.number, test.positions.len(), test.deviation, (hi-lo).norm(), rms.join(" "), wrong / own, own/(hi-lo).norm(), int.join(" "), cs[tower.number as usize - 1].base_from_test.translation.as_slice());
    }
    eprintln!("{:?}", t.elapsed());
    Ok(Outcome::Done)
}
