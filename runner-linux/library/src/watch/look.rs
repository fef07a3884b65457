//! One frame: judged, scaled, recognized, with the time that each took.

use std::fmt;
use std::time::{Duration, Instant};

use daymark_core::verdict::{FalseAnswer, Recognition, Verdict};

use super::quality::{Quality, quality};
use super::scene::Scene;
use super::table::{Landmark, LiveTable};
use crate::engine::{Engine, FRAME_SIDE};
use crate::lens_source::LensChoice;
use crate::near::PriorArgs;
use crate::observer::{Locating, Sighted};
use crate::output::record::TableFacts;
use crate::picture::GrayImage;

/// What a frame shows by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// What core says.
    pub recognition: Recognition,
    /// What the picture is like.
    pub quality: Quality,
    /// It is another scene than the frame before.
    pub new_scene: bool,
    /// Where the observer stands, if the frame alone shows a known landmark.
    pub observer: Option<Sighted>,
    /// How long it took.
    pub times: LookTimes,
}

/// How long looking at a frame took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LookTimes {
    /// Scaling and judging.
    pub prepare: Duration,
    /// Corners and signatures.
    pub features: Duration,
    /// Comparing with the table.
    pub matching: Duration,
    /// Finding out where the observer stands.
    pub position: Duration,
}

/// Whatever can look at a frame.
pub trait Look {
    /// Looks at a frame.
    ///
    /// # Errors
    /// What makes going on useless: a damaged table, a frame beyond every limit.
    fn look(&mut self, frame: GrayImage) -> Result<Seen, String>;

    /// A landmark by its number.
    fn landmark(&self, number: u32) -> Option<Landmark>;

    /// The number of the landmark of this name.
    fn number(&self, name: &str) -> Option<u32>;

    /// The table in use.
    fn facts(&self) -> TableFacts;

    /// Uses another table from now on.
    fn exchange(&mut self, table: LiveTable);

    /// The next frame has nothing to do with the one before.
    fn forget_scene(&mut self);
}

/// Looks with core's recognizer.
pub struct Recognizing {
    engine: Engine,
    table: LiveTable,
    scene: Scene,
    limit: FalseAnswer,
    locating: Locating,
    lens: LensChoice,
    prior: PriorArgs,
    reach_m: f64,
    /// Those of the table that are compared, if not all.
    views: Option<Vec<u32>>,
}

impl fmt::Debug for Recognizing {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Recognizing").finish_non_exhaustive()
    }
}

impl Recognizing {
    /// With a table; a frame alone is known if false with at most `limit`. A landmark is recognized from `reach_m` metres at
    /// most.
    pub fn new(table: LiveTable, limit: FalseAnswer, lens: LensChoice, prior: PriorArgs, reach_m: f64) -> Self {
        let views = near(&table, &prior, reach_m);
        Self {
            engine: Engine::new(table.table().profile()),
            table,
            scene: Scene::default(),
            limit,
            locating: Locating::new(),
            lens,
            prior,
            reach_m,
            views,
        }
    }
}

impl Look for Recognizing {
    fn look(&mut self, frame: GrayImage) -> Result<Seen, String> {
        let begin = Instant::now();
        let size = [frame.width, frame.height].map(|side| side as u32);
        let frame = frame.scaled_to(FRAME_SIDE);
        let (quality, new_scene) = (quality(&frame), self.scene.enter(&frame));
        let prepared = Instant::now();
        self.engine.extract(&frame).map_err(|error| error.to_string())?;
        let extracted = Instant::now();
        let mut table = self.table.table();
        let recognition = self
            .engine
            .recognize_among(&mut table, self.views.as_deref(), self.limit)
            .map_err(|error| error.to_string())?;
        let matched = Instant::now();
        let observer = match &recognition.verdict {
            Verdict::Known(answer) => {
                let lens = self.lens.lens(size[0], size[1], None).map_err(|error| error.to_string())?;
                let lens = lens.scaled_to(frame.width as u32, frame.height as u32);
                let observer = self.locating.observer(&mut self.engine, &table, answer, &lens, self.reach_m);
                let mut observer = observer.map_err(|error| error.to_string())?;
                observer.check(&self.prior);
                observer.fix
            }
            _ => None,
        };
        let times = LookTimes {
            prepare: prepared - begin,
            features: extracted - prepared,
            matching: matched - extracted,
            position: matched.elapsed(),
        };
        Ok(Seen { recognition, quality, new_scene, observer, times })
    }

    fn landmark(&self, number: u32) -> Option<Landmark> {
        self.table.landmark(number)
    }

    fn number(&self, name: &str) -> Option<u32> {
        self.table.number(name)
    }

    fn facts(&self) -> TableFacts {
        self.table.facts()
    }

    fn exchange(&mut self, table: LiveTable) {
        if table.table().profile() != self.table.table().profile() {
            self.engine = Engine::new(table.table().profile());
        }
        self.views = near(&table, &self.prior, self.reach_m);
        self.table = table;
    }

    fn forget_scene(&mut self) {
        self.scene.forget();
    }
}

/// The views that can be seen from where the observer is known to be. The table is verified, so its records can be read.
fn near(table: &LiveTable, prior: &PriorArgs, reach_m: f64) -> Option<Vec<u32>> {
    prior.views(&table.table(), reach_m).ok().flatten()
}
