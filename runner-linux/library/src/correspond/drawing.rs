//! A matching as a picture (SVG): both pictures side by side with their nested hulls, the matched corners joined, and the
//! quads of the layers in the colour of what became of them. Everything tells more when pointed at.

use svg::Document;
use svg::node::element::{Group, Polygon, Rectangle, Style, Title};

use super::Corners;
use super::fate::{Judge, LayerQuadFate, QuadFate};
use super::finding::Finding;
use super::matching::{FoundBy, Matched, Matching};
use super::text::headline;
use crate::order;
use crate::report::data_uri;
use crate::report::overlay::{
    FONT, INK, MARGIN, NIGHT, PALE, PANEL, Place, circle, line_of_text, picture, rectangle, segment,
};
use crate::report::phrase;

const HEAD: f32 = 92.0;
/// Longer side of each picture.
const SIDE: f32 = 640.0;
const LEGEND_LINE: f32 = 19.0;
/// What is under the pointer stands out.
const STYLE: &str = "polygon.quad:hover{fill-opacity:.6;stroke-opacity:1}g.match:hover line{stroke-opacity:1;stroke-width:2.5}\
                     polygon.layer:hover{stroke-opacity:1;stroke-width:2.5}";

/// What is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Drawing<'a> {
    /// The corners of the first and the second picture.
    pub corners: [&'a Corners; 2],
    /// How they were matched.
    pub matching: &'a Matching,
    /// What is said about it.
    pub finding: &'a Finding,
    /// What became of each quad.
    pub judge: &'a Judge<'a>,
}

const fn found_colour(found_by: FoundBy) -> &'static str {
    match found_by {
        FoundBy::Layers => "#ffd34d",
        FoundBy::Arrangements => "#5aa9ff",
        FoundBy::Both => "#4ade9b",
        FoundBy::Map => "#d98ae0",
    }
}

const fn found_says(found_by: FoundBy) -> &'static str {
    match found_by {
        FoundBy::Layers => "found by quads of layers",
        FoundBy::Arrangements => "found by local arrangements",
        FoundBy::Both => "found by both",
        FoundBy::Map => "where what was found expects it",
    }
}

const fn fate_colour(fate: QuadFate) -> &'static str {
    match fate {
        QuadFate::Matched => "#4ade9b",
        QuadFate::Contradicts => "#ff5f6d",
        QuadFate::Off => "#ff9f4d",
        QuadFate::Unverified => "#d98ae0",
        QuadFate::Unlike => "#8593a8",
        QuadFate::Thin => "#5c6880",
    }
}

impl Drawing<'_> {
    /// The drawing as the text of an SVG file, which needs nothing beside it.
    pub fn to_svg(&self) -> String {
        let places = self.places();
        let quads = self.judge.quads();
        let rows = quad_legend(&quads).len().max(4) as f32;
        let bottom = HEAD + places.iter().map(|place| place.height).fold(0.0, f32::max);
        let size = [places[1].x + places[1].width + MARGIN, bottom + 24.0 + (rows + 1.0) * LEGEND_LINE];
        let mut document = Document::new()
            .set("viewBox", format!("0 0 {:.0} {:.0}", size[0], size[1]))
            .set("width", format!("{:.0}", size[0]))
            .set("height", format!("{:.0}", size[1]))
            .set("font-family", FONT)
            .add(Style::new(STYLE))
            .add(Rectangle::new().set("width", "100%").set("height", "100%").set("fill", NIGHT))
            .add(self.caption());
        for side in [0, 1] {
            document = document.add(self.ground(side, places[side])).add(self.layers(side, places[side]));
        }
        document = document.add(self.quads(&quads, places)).add(self.matches(places));
        for side in [0, 1] {
            document = document.add(self.stars(side, places[side]));
        }
        format!("{}\n", document.add(self.legend(&quads, bottom + 34.0, places[1].x)))
    }

    fn places(&self) -> [Place; 2] {
        let place = |corners: &Corners, x: f32| {
            let [width, height] = corners.size_px.map(|side| side.max(1) as f32);
            let scale = SIDE / width.max(height);
            Place { x, y: HEAD, width: width * scale, height: height * scale, scale }
        };
        let first = place(self.corners[0], MARGIN);
        [first, place(self.corners[1], first.x + first.width + MARGIN)]
    }

    fn point(&self, side: usize, place: Place, corner: u16) -> [f32; 2] {
        let corner = self.corners[side].places.get(usize::from(corner)).copied().unwrap_or_default();
        place.point(corner.to_pixels())
    }

    fn caption(&self) -> Group {
        let files = self.corners.map(|corners| phrase::printable(&corners.name)).join("  ·  ");
        let colour = if self.finding.correspondences.is_empty() { "#ff8f6b" } else { "#4ade9b" };
        let checked = self.finding.checked.map(|checked| {
            format!("  ·  {} right, {} wrong of {} common corners", checked.right, checked.wrong, checked.common)
        });
        Group::new()
            .add(Rectangle::new().set("x", MARGIN).set("y", 20).set("width", 5).set("height", 56).set("fill", colour))
            .add(line_of_text(&headline(self.finding), 34.0, 40.0, 18.0, INK).set("font-weight", 600))
            .add(line_of_text(&(files + &checked.unwrap_or_default()), 34.0, 64.0, 13.0, PALE))
    }

    fn ground(&self, side: usize, place: Place) -> Group {
        match &self.corners[side].picture {
            // Darkened, so that what is drawn on it stands out.
            Some(image) => Group::new()
                .add(picture(place, data_uri::jpeg(&image.clone().scaled_to(SIDE as usize))))
                .add(rectangle(place).set("fill", NIGHT).set("fill-opacity", 0.45)),
            None => Group::new().add(rectangle(place).set("fill", PANEL).set("rx", 6)),
        }
    }

    /// Outermost layers bright, inner ones darker.
    fn layers(&self, side: usize, place: Place) -> Group {
        let layers = &self.matching.nested[side].layers;
        let mut group = Group::new().set("class", "layers").set("fill", "none");
        for (number, layer) in layers.iter().enumerate() {
            let depth = number as f32 / layers.len().max(1) as f32;
            let points = layer.iter().map(|&vertex| self.point(side, place, vertex));
            let title = format!("layer {number}: {} vertices", layer.len());
            group = group.add(
                polygon(points)
                    .set("class", "layer")
                    .set("stroke", "#cfe0ff")
                    .set("stroke-opacity", format!("{:.2}", 0.75 - 0.5 * depth))
                    .set("stroke-width", if number % 2 == 0 { 1.4 } else { 0.8 })
                    .add(Title::new(title)),
            );
        }
        group
    }

    fn quads(&self, quads: &[LayerQuadFate], places: [Place; 2]) -> Group {
        let mut group = Group::new().set("class", "quads");
        // Many on top of one another would hide the picture.
        let faint = (40.0 / quads.len().max(1) as f32).min(1.0);
        // The matched ones last, on top.
        let mut order: Vec<&LayerQuadFate> = quads.iter().collect();
        order::sort_by_key(&mut order, |quad| core::cmp::Reverse(quad.fate));
        for quad in order {
            let title = self.quad_title(quad);
            let sides = [Some(quad.vertices), quad.partners];
            for (side, vertices) in sides.into_iter().enumerate() {
                let Some(vertices) = vertices else { continue };
                let opacity = match quad.fate {
                    QuadFate::Matched => 0.30,
                    QuadFate::Contradicts | QuadFate::Off | QuadFate::Unverified => 0.13 * faint,
                    QuadFate::Unlike | QuadFate::Thin => 0.05 * faint,
                };
                let points = vertices.iter().map(|&vertex| self.point(side, places[side], vertex));
                group = group.add(
                    polygon(points)
                        .set("class", "quad")
                        .set("fill", fate_colour(quad.fate))
                        .set("fill-opacity", format!("{opacity:.3}"))
                        .set("stroke", fate_colour(quad.fate))
                        .set("stroke-opacity", format!("{:.3}", opacity * 2.0))
                        .add(Title::new(title.clone())),
                );
            }
        }
        group
    }

    fn quad_title(&self, quad: &LayerQuadFate) -> String {
        let names = |side: usize, vertices: [u16; 4]| {
            vertices.map(|vertex| self.corners[side].number(vertex).to_string()).join(" ")
        };
        let partners = quad.partners.map(|partners| format!(" like {}", names(1, partners)));
        format!(
            "quad {} of layer {}{}: {}",
            names(0, quad.vertices),
            quad.layer,
            partners.unwrap_or_default(),
            quad.fate.says()
        )
    }

    fn matches(&self, places: [Place; 2]) -> Group {
        let mut group = Group::new().set("class", "matches").set("stroke-linecap", "round");
        let strength = if self.matching.pairs.len() > 80 { 0.25 } else { 0.45 };
        for (matched, title) in self.matching.pairs.iter().zip(self.match_titles()) {
            let from = self.point(0, places[0], matched.pair.first);
            let to = self.point(1, places[1], matched.pair.second);
            let line = segment(from, to)
                .set("stroke", found_colour(matched.found_by))
                .set("stroke-width", 1)
                .set("stroke-opacity", strength);
            group = group.add(Group::new().set("class", "match").add(Title::new(title)).add(line));
        }
        group
    }

    fn match_titles(&self) -> impl Iterator<Item = String> {
        self.finding.correspondences.iter().map(|found| {
            let layer = |layer: Option<u16>| layer.map_or_else(|| "within".to_owned(), |layer| layer.to_string());
            let shift = found.shift.map(|shift| format!(", shift +{shift}")).unwrap_or_default();
            let residual = found.residual_px.map(|px| format!(", residual {px:.2} px")).unwrap_or_default();
            let [a, b] = found.layers.map(layer);
            format!(
                "{} is {}: layer {a} to {b}{shift}{residual}, found by {}",
                found.first, found.second, found.found_by
            )
        })
    }

    /// All corners: the matched ones filled.
    fn stars(&self, side: usize, place: Place) -> Group {
        let corners = self.corners[side];
        let mut matched: Vec<Option<&Matched>> = vec![None; corners.places.len()];
        for one in &self.matching.pairs {
            let corner = if side == 0 { one.pair.first } else { one.pair.second };
            matched[usize::from(corner)] = Some(one);
        }
        let mut stars = Group::new().set("class", "corners");
        for (corner, matched) in (0_u16..).zip(matched) {
            let at = self.point(side, place, corner);
            let star = match matched {
                Some(one) => circle(at, 3.4).set("fill", found_colour(one.found_by)).set("stroke", NIGHT),
                None => circle(at, 2.6).set("fill", NIGHT).set("fill-opacity", 0.4).set("stroke", "#9fb0c8"),
            };
            let state = if matched.is_some() { "matched" } else { "not matched" };
            stars = stars.add(star.add(Title::new(format!("corner {}, {state}", corners.number(corner)))));
        }
        stars
    }

    fn legend(&self, quads: &[LayerQuadFate], top: f32, right: f32) -> Group {
        let mut group = Group::new();
        let all = phrase::count(quads.len(), "quad");
        let mut lines =
            vec![(MARGIN, 0, None, format!("{all} of four vertices in a row, in the first picture's layers"))];
        for (row, (fate, count)) in (1..).zip(quad_legend(quads)) {
            lines.push((MARGIN, row, Some(fate_colour(fate)), format!("{count} {}", fate.says())));
        }
        let pairs = &self.matching.pairs;
        lines.push((right, 0, None, format!("{} corners joined", pairs.len())));
        for (row, found_by) in (1..).zip([FoundBy::Layers, FoundBy::Arrangements, FoundBy::Both, FoundBy::Map]) {
            let count = pairs.iter().filter(|matched| matched.found_by == found_by).count();
            lines.push((right, row, Some(found_colour(found_by)), format!("{count} {}", found_says(found_by))));
        }
        for (x, row, colour, text) in lines {
            let y = top + row as f32 * LEGEND_LINE;
            match colour {
                Some(colour) => {
                    group = group.add(circle([x + 5.0, y - 4.0], 4.5).set("fill", colour));
                    group = group.add(line_of_text(&text, x + 17.0, y, 12.0, PALE));
                }
                None => group = group.add(line_of_text(&text, x, y, 13.0, INK)),
            }
        }
        group
    }
}

/// The fates that occur, with how often.
fn quad_legend(quads: &[LayerQuadFate]) -> Vec<(QuadFate, usize)> {
    let count = |fate| (fate, quads.iter().filter(|quad| quad.fate == fate).count());
    QuadFate::ALL.map(count).into_iter().filter(|(_, count)| *count > 0).collect()
}

fn polygon(points: impl Iterator<Item = [f32; 2]>) -> Polygon {
    let points: Vec<String> = points.map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    Polygon::new().set("points", points.join(" ")).set("stroke-linejoin", "round")
}
