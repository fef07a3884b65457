//! Plots (SVG): lines and points over two axes, each linear or logarithmic.

use svg::Document;
use svg::node::element::{Circle, Group, Line, Polyline, Rectangle, Text};

const WIDTH: f64 = 470.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 46.0;
const BOTTOM: f64 = 54.0;

/// An axis from one value to another.
#[derive(Debug, Clone)]
pub struct Axis {
    /// What it shows.
    pub label: String,
    /// The value at the left or lower end.
    pub from: f64,
    /// The value at the other end.
    pub to: f64,
    /// Logarithmic: values below `from` are drawn at `from`.
    pub logarithmic: bool,
    /// Where there are ticks, and what stands there.
    pub ticks: Vec<(f64, String)>,
}

/// A line through points.
#[derive(Debug, Clone)]
pub struct Curve {
    /// The points.
    pub points: Vec<[f64; 2]>,
    /// Any CSS colour.
    pub colour: &'static str,
    /// Broken, for what is meant and was not measured.
    pub dashed: bool,
}

/// A measured point with its interval and a remark.
#[derive(Debug, Clone)]
pub struct Mark {
    /// Where.
    pub at: [f64; 2],
    /// The interval of its second value.
    pub interval: [f64; 2],
    /// What stands beside it.
    pub remark: String,
}

/// A plot.
#[derive(Debug, Clone)]
pub struct Plot {
    /// What stands above it.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Lines.
    pub curves: Vec<Curve>,
    /// Points.
    pub marks: Vec<Mark>,
}

impl Axis {
    /// Where a value lies along the axis, 0 to 1.
    fn place(&self, value: f64) -> f64 {
        let place = if self.logarithmic {
            let log = |value: f64| libm::log10(value.max(self.from));
            (log(value) - log(self.from)) / (log(self.to) - log(self.from))
        } else {
            (value - self.from) / (self.to - self.from)
        };
        place.clamp(0.0, 1.0)
    }
}

impl Plot {
    fn point(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let across = LEFT + self.x.place(x) * (WIDTH - LEFT - RIGHT);
        [across, HEIGHT - BOTTOM - self.y.place(y) * (HEIGHT - TOP - BOTTOM)]
    }

    /// The plot as an SVG element; its inks are the page's.
    pub fn to_svg(&self) -> String {
        let mut document = Document::new()
            .set("viewBox", format!("0 0 {WIDTH} {HEIGHT}"))
            .set("width", WIDTH)
            .set("height", HEIGHT)
            .set("role", "img")
            .set("style", "max-width:100%;height:auto")
            .add(
                Rectangle::new()
                    .set("width", WIDTH)
                    .set("height", HEIGHT)
                    .set("rx", 10)
                    .set("fill", "var(--card, #fff)"),
            )
            .add(text(&self.title, [LEFT, 26.0], 14, "start").set("font-weight", 600))
            .add(self.grid());
        for curve in &self.curves {
            let points = curve.points.iter().map(|&point| self.point(point));
            let points = points.map(|[x, y]| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ");
            let mut line = Polyline::new()
                .set("points", points)
                .set("fill", "none")
                .set("stroke", curve.colour)
                .set("stroke-width", 2)
                .set("stroke-linejoin", "round");
            if curve.dashed {
                line = line.set("stroke-dasharray", "5 5").set("stroke-width", 1.4);
            }
            document = document.add(line);
        }
        for mark in &self.marks {
            document = document.add(self.mark(mark));
        }
        document.to_string()
    }

    fn grid(&self) -> Group {
        let mut grid = Group::new();
        let rule =
            |from: [f64; 2], to: [f64; 2]| line(from, to).set("stroke", "var(--line, #ddd)").set("stroke-width", 1);
        for (value, name) in &self.x.ticks {
            let [x, bottom] = self.point([*value, self.y.from]);
            grid = grid.add(rule([x, TOP], [x, bottom])).add(pale(name, [x, bottom + 17.0], "middle"));
        }
        for (value, name) in &self.y.ticks {
            let [left, y] = self.point([self.x.from, *value]);
            grid = grid.add(rule([left, y], [WIDTH - RIGHT, y])).add(pale(name, [left - 8.0, y + 4.0], "end"));
        }
        let middle = TOP + (HEIGHT - TOP - BOTTOM) / 2.0;
        grid.add(pale(&self.x.label, [LEFT + (WIDTH - LEFT - RIGHT) / 2.0, HEIGHT - 14.0], "middle"))
            .add(pale(&self.y.label, [16.0, middle], "middle").set("transform", format!("rotate(-90 16 {middle})")))
    }

    fn mark(&self, mark: &Mark) -> Group {
        let [x, y] = self.point(mark.at);
        let [low, high] = mark.interval.map(|value| self.point([mark.at[0], value]));
        let colour = "var(--good, #0f8a55)";
        let end = if x > WIDTH - 90.0 { ([x - 9.0, y + 17.0], "end") } else { ([x + 9.0, y + 17.0], "start") };
        Group::new()
            .add(line(low, high).set("stroke", colour).set("stroke-width", 2).set("stroke-opacity", 0.55))
            .add(
                Circle::new()
                    .set("cx", format!("{x:.1}"))
                    .set("cy", format!("{y:.1}"))
                    .set("r", 4.5)
                    .set("fill", colour),
            )
            .add(pale(&mark.remark, end.0, end.1))
    }
}

fn line([x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) -> Line {
    Line::new()
        .set("x1", format!("{x1:.1}"))
        .set("y1", format!("{y1:.1}"))
        .set("x2", format!("{x2:.1}"))
        .set("y2", format!("{y2:.1}"))
}

fn text(content: &str, [x, y]: [f64; 2], size: u32, anchor: &str) -> Text {
    Text::new(content)
        .set("x", format!("{x:.1}"))
        .set("y", format!("{y:.1}"))
        .set("font-size", size)
        .set("text-anchor", anchor)
        .set("fill", "var(--ink, #222)")
}

fn pale(content: &str, at: [f64; 2], anchor: &str) -> Text {
    text(content, at, 12, anchor).set("fill", "var(--pale, #667)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_along_an_axis() {
        let axis = |logarithmic, from, to| Axis { label: String::new(), from, to, logarithmic, ticks: Vec::new() };
        let log = axis(true, 1e-4, 1.0);
        assert!((log.place(0.01) - 0.5).abs() < 1e-12);
        assert_eq!((log.place(0.0), log.place(2.0)), (0.0, 1.0));
        assert_eq!(axis(false, 0.0, 4.0).place(1.0), 0.25);
    }
}
