//! Fits the tail of the evidence of wrong views, which turns evidence into the probability of a false answer.
//!
//! ```text
//! cargo run --release --example calibrate -- --dataset DIR [--profile board] [--strangers FOLDER]... [--same A=B]...
//! ```
//!
//! Wrong pairs are made of the pictures that are enrolled: each gallery picture, and each picture below a folder of
//! strangers, is matched as a frame with every view of *other* buildings. Neither the queries nor the negatives take
//! part, so that `daymark evaluate` on the same dataset remains a test. Evidence above its 98 % quantile is fitted by
//! an exponential, `P(evidence > t) = exp(-(t - location) / scale)`: the scale is the mean excess, and the location
//! makes the fit meet the quantile. `--same A=B` tells of two names for one building that the manifest calls two.

use std::error::Error;
use std::path::{Path, PathBuf};

use clap::Parser;
use daymark::dataset::Dataset;
use daymark::engine::{Engine, FRAME_SIDE};
use daymark::enroll;
use daymark::picture::{GrayImage, read_gray};
use daymark::table_file::{LandmarkEntry, OwnedTable};
use daymark_core::evidence::EVIDENCE_UNIT;
use daymark_core::profile::Profile;
use daymark_core::table::{Kind, LandmarkTable};
use rayon::prelude::*;

/// Share of the wrong pairs below the fitted tail.
const QUANTILE: f64 = 0.98;

#[derive(Parser)]
struct Args {
    /// Folder with pictures and a manifest.json.
    #[arg(long)]
    dataset: PathBuf,
    /// Class of device: handheld or board.
    #[arg(long, default_value = "handheld")]
    profile: String,
    /// Folder with pictures of buildings that are not in the dataset.
    #[arg(long)]
    strangers: Vec<PathBuf>,
    /// Two names of one building, as A=B.
    #[arg(long)]
    same: Vec<String>,
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let args = Args::parse();
    let profile = Profile::ALL.into_iter().find(|profile| profile.name() == args.profile);
    let profile = profile.ok_or("--profile must be handheld or board")?;
    let dataset = Dataset::open(&args.dataset)?;
    let read = |path: &Path| read_gray(path).map(|picture| picture.scaled_to(FRAME_SIDE));

    let mut frames: Vec<(Option<String>, GrayImage)> = Vec::new();
    for building in &dataset.buildings {
        for picture in &building.gallery {
            frames.push((Some(building.name.clone()), read(&dataset.folder.join(picture))?));
        }
    }
    let enrolled: Vec<LandmarkEntry> = dataset
        .buildings
        .par_iter()
        .map(|building| {
            let own = frames.iter().filter(|(name, _)| name.as_deref() == Some(&building.name));
            let views = own.map(|(_, picture)| enroll::view(picture, profile)).collect::<Result<_, _>>()?;
            Ok(LandmarkEntry { name: building.name.clone(), kind: Kind::Building, position: None, views })
        })
        .collect::<Result<_, enroll::TooFewCorners>>()?;
    let bytes = OwnedTable { profile, landmarks: enrolled }.to_bytes()?;
    let table = LandmarkTable::open(&bytes)?.verified()?;
    for folder in &args.strangers {
        for path in pictures_below(folder)? {
            frames.push((None, read(&path)?));
        }
    }

    let same = |a: &str, b: &str| {
        let named = |pair: &String| pair.split_once('=').is_some_and(|pair| pair == (a, b) || pair == (b, a));
        dataset.same(a) == dataset.same(b) || args.same.iter().any(named)
    };
    let wrong: Vec<Vec<i32>> = frames
        .par_iter()
        .map(|(name, picture)| {
            let mut engine = Engine::new(profile);
            engine.extract(picture)?;
            let mut evidence = Vec::new();
            for number in 0..table.view_count() {
                let view = table.view(number)?;
                let landmark = table.landmark(view.landmark())?.name;
                if !name.as_deref().is_some_and(|name| same(name, landmark)) {
                    evidence.push(engine.explain(&view).map_or(i32::MIN, |(matched, _)| matched.evidence));
                }
            }
            Ok(evidence)
        })
        .collect::<Result<_, Box<dyn Error + Send + Sync>>>()?;
    let mut wrong: Vec<i32> = wrong.into_iter().flatten().collect();
    wrong.sort_unstable();

    let above = &wrong[(wrong.len() as f64 * QUANTILE) as usize..];
    let quantile = f64::from(above[0]);
    let scale = above.iter().map(|&evidence| f64::from(evidence) - quantile).sum::<f64>() / above.len() as f64;
    let location = quantile + scale * libm::log(1.0 - QUANTILE);
    let unit = f64::from(EVIDENCE_UNIT);
    println!("profile {}: {} wrong pairs, {} above the quantile", profile.name(), wrong.len(), above.len());
    println!(
        "location {location:.0}, scale {scale:.0} in 1/{EVIDENCE_UNIT}: {:.2} and {:.2}",
        location / unit,
        scale / unit
    );
    println!("the highest: {:?}", above.iter().rev().take(12).map(|e| e / EVIDENCE_UNIT).collect::<Vec<_>>());
    Ok(())
}

/// JPEG and PNG files below a folder, sorted.
fn pictures_below(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
        if path.is_dir() {
            found.extend(pictures_below(&path)?);
        } else if ["jpg", "jpeg", "png"].contains(&extension.as_str()) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}
