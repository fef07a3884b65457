//! A finding as a picture (SVG): the stored view as a constellation, the frame with the corners that match it, and the
//! outline of the stored view where the frame shows it.

use svg::Document;
use svg::node::element::{Circle, ClipPath, Definitions, Group, Image, Line, Polygon, Rectangle, Text};

use super::data_uri;
use super::explain::{ExplainedCorner, Said, ViewExplanation};
use super::finding::{Finding, VerdictName};
use super::phrase;
use crate::picture::GrayImage;

pub(crate) const MARGIN: f32 = 20.0;
const HEAD: f32 = 92.0;
const FOOT: f32 = 40.0;
/// Connecting lines, at most: the strongest corners.
const LINES: usize = 40;
/// A smaller frame is drawn larger, with its longer side so long.
const LEAST_SIDE: f32 = 560.0;
/// The narrowest picture into which the caption fits.
const LEAST_WIDTH: f32 = 640.0;

pub(crate) const NIGHT: &str = "#0e1420";
pub(crate) const PANEL: &str = "#182131";
pub(crate) const INK: &str = "#eef2f8";
pub(crate) const PALE: &str = "#9fb0c8";
pub(crate) const FONT: &str = "system-ui, 'Segoe UI', 'Helvetica Neue', 'DejaVu Sans', sans-serif";

/// What is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Overlay<'a> {
    /// The frame.
    pub frame: &'a GrayImage,
    /// What is said about it.
    pub finding: &'a Finding,
    /// What the best view said, if any fits.
    pub best: Option<&'a ViewExplanation>,
    /// The picture of which the view was made, where it is at hand; a table does not hold it.
    pub stored_picture: Option<&'a GrayImage>,
}

/// The colour for what a corner said.
pub(super) const fn colour(said: Said) -> &'static str {
    match said {
        Said::Strong => "#ffd34d",
        Said::Fair => "#4ade9b",
        Said::Weak => "#5aa9ff",
        Said::Silent => "#8593a8",
        Said::Unlike => "#ff5f6d",
        Said::Missing => "#d98ae0",
    }
}

/// The colour of a verdict.
pub(super) const fn verdict_colour(verdict: VerdictName) -> &'static str {
    match verdict {
        VerdictName::Known => "#4ade9b",
        VerdictName::Ambiguous => "#ffd34d",
        VerdictName::Unknown | VerdictName::Unreadable => "#ff8f6b",
    }
}

/// Where a picture stands in the drawing, and how large.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) width: f32,
    pub(crate) height: f32,
    pub(crate) scale: f32,
}

impl Place {
    pub(crate) fn point(self, [x, y]: [f32; 2]) -> [f32; 2] {
        // A point of an image counts from the centre of its first pixel.
        [self.x + (x + 0.5) * self.scale, self.y + (y + 0.5) * self.scale]
    }
}

impl Overlay<'_> {
    /// The drawing as the text of an SVG file, which needs nothing beside it.
    pub fn to_svg(&self) -> String {
        let zoom = (LEAST_SIDE / self.frame.width.max(self.frame.height).max(1) as f32).max(1.0);
        let (width, height) = (self.frame.width as f32 * zoom, self.frame.height as f32 * zoom);
        let stored = self.best.map(|best| {
            let (w, h) = (f32::from(best.view_width_px.max(1)), f32::from(best.view_height_px.max(1)));
            let scale = (height / h).min(width / w);
            Place { x: MARGIN, y: HEAD + (height - h * scale) / 2.0, width: w * scale, height: h * scale, scale }
        });
        let left = stored.map_or(MARGIN, |place| place.x + place.width + MARGIN);
        let frame = Place { x: left, y: HEAD, width, height, scale: zoom };
        let whole = [(frame.x + width + MARGIN).max(LEAST_WIDTH), HEAD + height + FOOT];
        let mut document = Document::new()
            .set("viewBox", format!("0 0 {:.0} {:.0}", whole[0], whole[1]))
            .set("width", format!("{:.0}", whole[0]))
            .set("height", format!("{:.0}", whole[1]))
            .set("font-family", FONT)
            .add(Rectangle::new().set("width", "100%").set("height", "100%").set("fill", NIGHT))
            .add(Definitions::new().add(ClipPath::new().set("id", "frame").add(rectangle(frame))))
            .add(self.caption())
            .add(picture(frame, data_uri::png(self.frame)));
        if let (Some(place), Some(best)) = (stored, self.best) {
            let stars = match self.stored_picture {
                Some(image) => Group::new().add(picture(place, data_uri::jpeg(image))),
                None => Group::new().add(rectangle(place).set("fill", PANEL).set("rx", 6)),
            };
            let inside = Group::new()
                .set("clip-path", "url(#frame)")
                .add(outline(best, frame))
                .add(corners_in_frame(&best.corners, frame));
            document = document
                .add(stars)
                .add(constellation(&best.corners, place))
                .add(inside)
                .add(connections(&best.corners, place, frame))
                .add(legend(best, whole[1] - FOOT / 2.0 + 5.0));
        }
        format!("{document}\n")
    }

    fn caption(&self) -> Group {
        let finding = self.finding;
        let colour = verdict_colour(finding.verdict);
        let (title, second) = caption(finding);
        let file = phrase::printable(&finding.file);
        let rest = match &finding.runner_up {
            Some(other) => format!(
                "{file}  ·  {}  ·  runner-up {} with {:.1} bits",
                phrase::count(finding.corners, "corner"),
                other.landmark,
                other.evidence_bits
            ),
            None => format!("{file}  ·  {}", phrase::count(finding.corners, "corner")),
        };
        Group::new()
            .add(Rectangle::new().set("x", MARGIN).set("y", 20).set("width", 5).set("height", 56).set("fill", colour))
            .add(line_of_text(&title, 34.0, 38.0, 20.0, INK).set("font-weight", 600))
            .add(line_of_text(&second, 34.0, 58.0, 13.0, INK))
            .add(line_of_text(&rest, 34.0, 75.0, 12.0, PALE))
    }
}

/// The verdict in two lines.
pub(super) fn caption(finding: &Finding) -> (String, String) {
    let label = finding.verdict.label();
    match (&finding.landmark, &finding.best, &finding.reason) {
        (Some(name), Some(best), _) => (
            format!("{label}: {name}"),
            format!(
                "false with a probability of {}  ·  {:.1} bits of evidence from {}",
                phrase::probability(best.probability_false_answer),
                best.evidence_bits,
                phrase::count(usize::from(best.supporting_corners), "corner"),
            ),
        ),
        (_, _, Some(reason)) => (label.to_owned(), reason.message.clone()),
        _ => (label.to_owned(), String::new()),
    }
}

pub(crate) fn line_of_text(text: &str, x: f32, y: f32, size: f32, colour: &str) -> Text {
    Text::new(phrase::printable(text))
        .set("x", format!("{x:.1}"))
        .set("y", format!("{y:.1}"))
        .set("font-size", format!("{size:.0}"))
        .set("fill", colour)
}

pub(crate) fn rectangle(place: Place) -> Rectangle {
    Rectangle::new()
        .set("x", format!("{:.1}", place.x))
        .set("y", format!("{:.1}", place.y))
        .set("width", format!("{:.1}", place.width))
        .set("height", format!("{:.1}", place.height))
}

pub(crate) fn picture(place: Place, address: String) -> Image {
    Image::new()
        .set("x", format!("{:.1}", place.x))
        .set("y", format!("{:.1}", place.y))
        .set("width", format!("{:.1}", place.width))
        .set("height", format!("{:.1}", place.height))
        .set("preserveAspectRatio", "none")
        .set("href", address)
}

pub(crate) fn circle([x, y]: [f32; 2], radius: f32) -> Circle {
    Circle::new().set("cx", format!("{x:.1}")).set("cy", format!("{y:.1}")).set("r", format!("{radius:.1}"))
}

pub(crate) fn segment([x1, y1]: [f32; 2], [x2, y2]: [f32; 2]) -> Line {
    Line::new()
        .set("x1", format!("{x1:.1}"))
        .set("y1", format!("{y1:.1}"))
        .set("x2", format!("{x2:.1}"))
        .set("y2", format!("{y2:.1}"))
}

/// The corners of a view's border in the frame, in pixels; far away where the map leaves the plane.
pub(super) fn outline_points(width: u16, height: u16, frame_from_view: [[f32; 3]; 3]) -> [[f32; 2]; 4] {
    let map = daymark_core::transform::Homography(frame_from_view);
    let (right, bottom) = (f32::from(width) - 0.5, f32::from(height) - 0.5);
    [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]]
        .map(|corner| map.apply(corner).map(|p| p.clamp(-1e5, 1e5)))
}

fn outline(best: &ViewExplanation, frame: Place) -> Group {
    let points = outline_points(best.view_width_px, best.view_height_px, best.frame_from_view_px);
    let points = points.map(|point| frame.point(point)).map(|[x, y]| format!("{x:.1},{y:.1}")).join(" ");
    let polygon = |colour, width| {
        Polygon::new()
            .set("points", points.as_str())
            .set("fill", "none")
            .set("stroke", colour)
            .set("stroke-width", width)
            .set("stroke-linejoin", "round")
    };
    Group::new()
        .set("class", "outline")
        .add(polygon(NIGHT, 6.0).set("stroke-opacity", 0.55))
        .add(polygon("#ffffff", 2.5))
}

/// Size of a star: the level of its corner.
fn radius(corner: &ExplainedCorner) -> f32 {
    3.2 + 1.1 * f32::from(corner.level)
}

fn constellation(corners: &[ExplainedCorner], place: Place) -> Group {
    let mut stars = Group::new().set("class", "stored-corners");
    for corner in corners.iter().rev() {
        let star = circle(place.point(corner.in_view_px), radius(corner) * 0.8);
        stars = stars.add(if corner.evidence_bits > 0.0 {
            star.set("fill", colour(corner.said)).set("fill-opacity", 0.9)
        } else {
            star.set("fill", "none").set("stroke", colour(corner.said)).set("stroke-width", 1.2)
        });
    }
    stars
}

fn corners_in_frame(corners: &[ExplainedCorner], frame: Place) -> Group {
    let mut marks = Group::new().set("class", "matched-corners");
    for corner in corners.iter().rev() {
        let expected = frame.point(corner.expected_px);
        let colour = colour(corner.said);
        match corner.found_px.map(|found| frame.point(found)) {
            Some(found) if corner.evidence_bits > 0.0 => {
                let ring = |width: f32, colour| {
                    circle(found, radius(corner)).set("fill", "none").set("stroke", colour).set("stroke-width", width)
                };
                marks = marks
                    .add(ring(3.6, NIGHT).set("stroke-opacity", 0.55))
                    .add(ring(1.8, colour))
                    .add(segment(expected, found).set("stroke", colour).set("stroke-width", 1.4));
            }
            _ => {
                let [x, y] = expected;
                let arm = 3.0;
                for (from, to) in [([x - arm, y - arm], [x + arm, y + arm]), ([x - arm, y + arm], [x + arm, y - arm])] {
                    let stroke = segment(from, to).set("stroke", colour).set("stroke-width", 1.3);
                    marks = marks.add(stroke.set("stroke-opacity", 0.8));
                }
            }
        }
    }
    marks
}

fn connections(corners: &[ExplainedCorner], stored: Place, frame: Place) -> Group {
    let mut lines = Group::new().set("class", "matches").set("stroke-linecap", "round");
    for corner in corners.iter().filter(|corner| corner.evidence_bits > 0.0).take(LINES) {
        let Some(found) = corner.found_px else { continue };
        let width = 0.5 + corner.evidence_bits as f32 / 8.0;
        lines = lines.add(
            segment(stored.point(corner.in_view_px), frame.point(found))
                .set("stroke", colour(corner.said))
                .set("stroke-width", format!("{width:.2}"))
                .set("stroke-opacity", 0.38),
        );
    }
    lines
}

fn legend(best: &ViewExplanation, y: f32) -> Group {
    let mut legend = Group::new();
    let mut x = MARGIN + 6.0;
    for group in &best.groups {
        let text = format!("{} {} {:+.1}", group.corners, group.said.name(), group.evidence_bits);
        legend = legend.add(circle([x, y - 4.0], 4.5).set("fill", colour(group.said)));
        legend = legend.add(line_of_text(&text, x + 10.0, y, 12.0, PALE));
        x += 30.0 + 6.3 * text.len() as f32;
    }
    legend
}
