//! Where the observer stands, as a plan (SVG): buildings, observers with their 95 % ellipses, bearings, north, a scale bar.
//!
//! North is up. Everything is given as WGS84 and drawn in the east-north-up frame of the middle of the buildings.

use daymark_core::fix::{Fix, LocalFrame, Wgs84};
use daymark_core::geometry::hull::{ConvexHull, Hull};
use daymark_core::point::ImagePoint;
use daymark_core::table::{LandmarkTable, POINTS_LIMIT, TableError};
use svg::Document;
use svg::node::element::{Circle, Ellipse, Group, Line, Path, Polygon, Polyline, Rectangle, Text};

const SIDE: f64 = 720.0;
const MARGIN: f64 = 56.0;
const FOOT: f64 = 64.0;
/// The scale bar is at most this share of the plan's width.
const BAR_SHARE: f64 = 0.3;
/// A plan shows at least so many metres.
const LEAST_METRES: f64 = 40.0;
/// If the largest ellipse has a half axis of fewer pixels, all are drawn so many times as large.
const SMALL: [(f64, f64); 2] = [(0.6, 100.0), (6.0, 10.0)];
/// Half the angle of the wedge that shows where the camera points, degrees.
const WEDGE: f64 = 15.0;

/// A building of the plan.
#[derive(Debug, Clone)]
pub struct Building {
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub position: Wgs84,
    /// Its outline on the ground, if that is known; otherwise a small square is drawn.
    pub outline: Vec<Wgs84>,
}

impl Building {
    /// A landmark of a table; its outline is what its model stands on, if it has one in metres that is turned to north. `None` if
    /// nobody said where it stands.
    ///
    /// # Errors
    /// A damaged record; not of a verified table.
    pub fn of(table: &LandmarkTable<'_>, number: u32) -> Result<Option<Self>, TableError> {
        let landmark = table.landmark(number)?;
        let Some(at) = landmark.position else { return Ok(None) };
        let model = table.model(number)?;
        let model = model.filter(|model| model.facts().scale_error.is_some() && model.facts().azimuth.is_some());
        let site = crate::observer::site(at, model.as_ref());
        let frame = LocalFrame::new(site.position);
        let ground = model.iter().flat_map(daymark_core::table::StoredModel::points).map(|point| {
            let [east, north, _] = site.point_in(&frame, point.position);
            [east, north]
        });
        let outline = hull(&ground.collect::<Vec<_>>());
        let outline = outline.into_iter().map(|[east, north]| frame.wgs84_from_local([east, north, 0.0])).collect();
        Ok(Some(Self { name: landmark.name.to_owned(), position: site.position, outline }))
    }
}

/// The convex hull of places in metres, to the centimetre.
fn hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let centimetres = |metres: f64| libm::round(metres * 100.0) as i32;
    let places: Vec<_> = points.iter().map(|[x, y]| ImagePoint::new(centimetres(*x), centimetres(*y))).collect();
    let mut hull = Box::new(ConvexHull::<{ POINTS_LIMIT as usize }>::new());
    match hull.enclose(&places) {
        Ok(Hull::Polygon(numbers)) => numbers.iter().map(|number| points[usize::from(*number)]).collect(),
        _ => Vec::new(),
    }
}

/// An observer of the plan.
#[derive(Debug, Clone)]
pub struct Observer {
    /// Where, and how sure.
    pub fix: Fix,
    /// Number of the building that is seen: a line leads there.
    pub sees: Option<usize>,
}

/// What a plan shows.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    /// What stands above it.
    pub title: String,
    /// Buildings.
    pub buildings: Vec<Building>,
    /// Observers.
    pub observers: Vec<Observer>,
    /// The way that the observer took in truth, if that is known.
    pub way: Vec<Wgs84>,
}

/// Metres to pixels.
#[derive(Debug, Clone, Copy)]
struct Scale {
    frame: LocalFrame,
    /// Of the upper left corner: east, north.
    corner: [f64; 2],
    pixels_a_metre: f64,
    /// How many times as large ellipses are drawn.
    ellipses: f64,
}

impl Scale {
    fn metres(&self, place: Wgs84) -> [f64; 2] {
        let [east, north, _] = self.frame.local_from_wgs84(place);
        [east, north]
    }

    fn at(&self, place: Wgs84) -> [f64; 2] {
        let [east, north] = self.metres(place);
        [
            MARGIN + (east - self.corner[0]) * self.pixels_a_metre,
            MARGIN + (self.corner[1] - north) * self.pixels_a_metre,
        ]
    }
}

impl Plan {
    /// The plan as an SVG document; `None` if there is nothing to draw.
    pub fn to_svg(&self) -> Option<String> {
        let scale = self.scale()?;
        let height = SIDE + FOOT;
        let mut document = Document::new()
            .set("viewBox", format!("0 0 {SIDE} {height}"))
            .set("width", SIDE)
            .set("height", height)
            .set("role", "img")
            .set("style", "max-width:100%;height:auto;font-family:system-ui,'DejaVu Sans',sans-serif")
            .add(Rectangle::new().set("width", SIDE).set("height", height).set("fill", "#fbfbf9"))
            .add(text(&self.title, [MARGIN / 2.0, 30.0], 16.0, "start").set("font-weight", 600));
        for building in &self.buildings {
            document = document.add(outline(building, &scale));
        }
        if self.way.len() > 1 {
            let points = self.way.iter().map(|place| pair(scale.at(*place))).collect::<Vec<_>>().join(" ");
            document = document.add(
                Polyline::new()
                    .set("class", "way")
                    .set("points", points)
                    .set("fill", "none")
                    .set("stroke", "#8a94a3")
                    .set("stroke-width", 1.2)
                    .set("stroke-dasharray", "2 3"),
            );
        }
        for observer in &self.observers {
            document = document.add(self.observer(observer, &scale));
        }
        for building in &self.buildings {
            let [x, y] = scale.at(building.position);
            document = document.add(text(&building.name, [x, y + 4.0], 12.0, "middle").set("font-weight", 600));
        }
        Some(document.add(north()).add(bar(&scale)).to_string())
    }

    /// Room for every building, observer and ellipse.
    fn scale(&self) -> Option<Scale> {
        let observers = self.observers.iter().map(|observer| observer.fix.position);
        let buildings = self.buildings.iter().flat_map(|one| one.outline.iter().copied().chain([one.position]));
        let places: Vec<_> = buildings.chain(observers).chain(self.way.iter().copied()).collect();
        let frame = LocalFrame::new(*places.first()?);
        let radius = |observer: &Observer| {
            let [east, north, _] = frame.local_from_wgs84(observer.fix.position);
            let reach = observer.fix.ellipse().semi_major_m;
            [[east - reach, north - reach], [east + reach, north + reach]]
        };
        let points = places.iter().map(|place| {
            let [east, north, _] = frame.local_from_wgs84(*place);
            [east, north]
        });
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points.chain(self.observers.iter().flat_map(radius)) {
            for ((low, high), x) in low.iter_mut().zip(&mut high).zip(point) {
                *low = low.min(x);
                *high = high.max(x);
            }
        }
        let side = (high[0] - low[0]).max(high[1] - low[1]).max(LEAST_METRES);
        let middle = [f64::midpoint(low[0], high[0]), f64::midpoint(low[1], high[1])];
        let pixels_a_metre = (SIDE - 2.0 * MARGIN) / side;
        let ellipses = self.observers.iter().map(|observer| observer.fix.ellipse().semi_major_m * pixels_a_metre);
        let largest = ellipses.fold(0.0, f64::max);
        let ellipses = SMALL.iter().find(|(pixels, _)| largest < *pixels).map_or(1.0, |(_, factor)| *factor);
        let corner = [middle[0] - side / 2.0, middle[1] + side / 2.0];
        side.is_finite().then_some(Scale { frame, corner, pixels_a_metre, ellipses })
    }

    fn observer(&self, observer: &Observer, scale: &Scale) -> Group {
        let fix = &observer.fix;
        let [x, y] = scale.at(fix.position);
        let ellipse = fix.ellipse();
        let pixels = scale.pixels_a_metre * scale.ellipses;
        let mut group = Group::new().set("class", "observer");
        if let Some(building) = observer.sees.and_then(|number| self.buildings.get(number)) {
            let [to_x, to_y] = scale.at(building.position);
            group = group.add(line([x, y], [to_x, to_y], "#b7791f", 1.2).set("stroke-opacity", 0.7));
        }
        if let Some(heading) = fix.heading_deg {
            group = group.add(wedge([x, y], heading.value));
        }
        // Half axes along and across its direction, which is counted from north.
        group
            .add(
                Ellipse::new()
                    .set("cx", number(x))
                    .set("cy", number(y))
                    .set("rx", number(ellipse.semi_minor_m * pixels))
                    .set("ry", number(ellipse.semi_major_m * pixels))
                    .set("transform", format!("rotate({:.1} {x:.1} {y:.1})", ellipse.orientation_deg))
                    .set("fill", "#2f6fdb")
                    .set("fill-opacity", 0.15)
                    .set("stroke", "#2f6fdb")
                    .set("stroke-width", 1.2),
            )
            .add(Circle::new().set("cx", number(x)).set("cy", number(y)).set("r", 2.6).set("fill", "#1f4fa5"))
    }
}

fn number(value: f64) -> String {
    format!("{value:.1}")
}

fn pair([x, y]: [f64; 2]) -> String {
    format!("{x:.1},{y:.1}")
}

fn line(from: [f64; 2], to: [f64; 2], colour: &str, width: f64) -> Line {
    Line::new()
        .set("x1", number(from[0]))
        .set("y1", number(from[1]))
        .set("x2", number(to[0]))
        .set("y2", number(to[1]))
        .set("stroke", colour)
        .set("stroke-width", width)
}

fn text(content: &str, [x, y]: [f64; 2], size: f64, anchor: &str) -> Text {
    Text::new(super::phrase::printable(content))
        .set("x", number(x))
        .set("y", number(y))
        .set("font-size", size)
        .set("text-anchor", anchor)
        .set("fill", "#18202c")
}

fn outline(building: &Building, scale: &Scale) -> Polygon {
    let [x, y] = scale.at(building.position);
    let corners: Vec<_> = if building.outline.len() > 2 {
        building.outline.iter().map(|place| scale.at(*place)).collect()
    } else {
        [[-6.0, -6.0], [6.0, -6.0], [6.0, 6.0], [-6.0, 6.0]].iter().map(|[u, v]| [x + u, y + v]).collect()
    };
    Polygon::new()
        .set("class", "building")
        .set("points", corners.into_iter().map(pair).collect::<Vec<_>>().join(" "))
        .set("fill", "#d9dde4")
        .set("stroke", "#5d6b80")
        .set("stroke-width", 1.2)
}

/// Where the camera points.
fn wedge([x, y]: [f64; 2], heading_deg: f64) -> Path {
    let end = |degrees: f64| {
        let radians = (heading_deg + degrees).to_radians();
        pair([x + 26.0 * libm::sin(radians), y - 26.0 * libm::cos(radians)])
    };
    Path::new()
        .set("d", format!("M{} L{} L{} Z", pair([x, y]), end(-WEDGE), end(WEDGE)))
        .set("fill", "#2f6fdb")
        .set("fill-opacity", 0.35)
}

fn north() -> Group {
    let (x, y) = (SIDE - 34.0, 44.0);
    Group::new()
        .set("class", "north")
        .add(
            Path::new()
                .set(
                    "d",
                    format!("M{x} {} L{} {} L{x} {} L{} {} Z", y - 22.0, x + 8.0, y + 8.0, y + 2.0, x - 8.0, y + 8.0),
                )
                .set("fill", "#18202c"),
        )
        .add(text("N", [x, y + 24.0], 13.0, "middle").set("font-weight", 600))
}

/// The longest of 1, 2, 5, 10, 20, ... metres that is not too long for the plan.
fn bar_metres(plan_metres: f64) -> f64 {
    let most = plan_metres * BAR_SHARE;
    let mut metres = 1e-3;
    for factor in [2.0, 2.5, 2.0].iter().cycle().take(30) {
        if metres * factor > most {
            break;
        }
        metres *= factor;
    }
    metres
}

fn bar(scale: &Scale) -> Group {
    let metres = bar_metres((SIDE - 2.0 * MARGIN) / scale.pixels_a_metre);
    let (left, y) = (MARGIN, SIDE + FOOT - 30.0);
    let right = left + metres * scale.pixels_a_metre;
    let name = if metres >= 1_000.0 { format!("{} km", metres / 1_000.0) } else { format!("{metres} m") };
    let enlarged =
        if scale.ellipses > 1.0 { format!(", drawn {} times as large", scale.ellipses) } else { String::new() };
    let legend = format!("ellipses hold the truth with 95 %{enlarged}");
    Group::new()
        .set("class", "scale")
        .add(line([left, y], [right, y], "#18202c", 3.0))
        .add(line([left, y - 5.0], [left, y + 5.0], "#18202c", 1.5))
        .add(line([right, y - 5.0], [right, y + 5.0], "#18202c", 1.5))
        .add(text(&name, [right + 8.0, y + 4.0], 12.0, "start"))
        .add(text(&legend, [SIDE - MARGIN / 2.0, y + 4.0], 12.0, "end"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use daymark_core::fix::{Evidence, Measured};

    fn place(east: f64, north: f64) -> Wgs84 {
        let origin = Wgs84 { latitude_deg: 52.0, longitude_deg: 13.0, altitude_m: 0.0 };
        LocalFrame::new(origin).wgs84_from_local([east, north, 0.0])
    }

    #[test]
    fn bars_are_round() {
        assert_eq!([40.0, 100.0, 260.0, 5_000.0].map(bar_metres).map(f64::round), [10.0, 20.0, 50.0, 1_000.0]);
    }

    #[test]
    fn north_is_up_and_east_is_right() {
        let fix = Fix {
            position: place(0.0, -50.0),
            covariance: [[4.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            bearing_deg: None,
            range_m: None,
            heading_deg: Some(Measured { value: 0.0, deviation: 1.0 }),
            evidence: Evidence::Fixes { count: 1 },
        };
        let building = |name: &str, position| Building { name: name.to_owned(), position, outline: Vec::new() };
        let plan = Plan {
            title: "<Plan>".to_owned(),
            buildings: vec![building("north", place(0.0, 50.0)), building("east", place(50.0, 0.0))],
            observers: vec![Observer { fix, sees: Some(0) }],
            way: Vec::new(),
        };
        let scale = plan.scale().expect("places");
        let ([x, y], [u, v]) = (scale.at(plan.buildings[0].position), scale.at(plan.buildings[1].position));
        assert!(y < v && x < u);
        let svg = plan.to_svg().expect("places");
        assert!(svg.contains("&lt;Plan&gt;") && svg.contains("class=\"north\"") && svg.contains("class=\"scale\""));
        // The long axis lies east-west.
        assert!(svg.contains("rotate(90.0 "), "{svg}");
        assert_eq!(Plan::default().to_svg(), None);
    }
}
