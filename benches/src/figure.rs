//! Figures of curves and of rows, drawn with the project's own pen as SVG and PNG, and as SVG for a page with tool tips.

use crate::table::{escaped, shown};
use contactd::picture::drawing::{Anchor, Color, Drawing, GREY, INK, Size, text_width};
use std::fmt::Write as _;
use std::path::Path;

/// Colours that stay apart for colour-blind readers (Okabe and Ito 2008) and on light and dark paper, in the order of use.
pub const PALETTE: [u32; 7] = [0x0072b2, 0xd55e00, 0x009e73, 0xcc79a7, 0xe69f00, 0x56b4e9, 0x8a8f98];

/// How a series' points are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stroke {
    /// A line through them.
    Solid,
    /// A dashed line: a tail or a bound of the curve of the same colour.
    Dashed,
    /// Rings that no line joins: extremes.
    Rings,
    /// By twos, from a dot to a ring: a median and its tail.
    Whiskers,
    /// A bar from the lower end of x to each point; of rows only.
    Bars,
}

/// A series of points.
#[derive(Clone, Debug)]
pub struct Series {
    /// What it is, for the legend.
    pub name: String,
    /// Points (x, y); those that an axis cannot show are left out.
    pub points: Vec<[f64; 2]>,
    /// How they are joined.
    pub stroke: Stroke,
    /// Index into the palette.
    pub color: usize,
}

/// What stands along an axis.
#[derive(Clone, Debug)]
pub enum Axis {
    /// Powers of ten; what is measured, with its unit.
    Log(String),
    /// Whole numbers.
    Linear(String),
    /// A name for each of 0, 1, 2 …, from above.
    Rows(Vec<String>),
}

/// A figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its files.
    pub name: String,
    /// What is seen, in a few words.
    pub title: String,
    /// What follows from it; a reader of nothing else must get it right.
    pub caption: String,
    /// Along x and y; rows along y only.
    pub axes: [Axis; 2],
    /// The series.
    pub series: Vec<Series>,
}

const WIDTH: f64 = 1200.0;
const TOP: f64 = 76.0;
const LINE: f64 = 22.0;
/// Pixels between the series of one row.
const APART: f64 = 7.0;
/// Pixels of a bar.
const THICK: f64 = 5.0;

impl Axis {
    fn shows(&self, v: f64) -> bool {
        v.is_finite() && (v > 0.0 || !matches!(self, Axis::Log(_)))
    }

    fn label(&self) -> &str {
        match self {
            Axis::Log(label) | Axis::Linear(label) => label,
            Axis::Rows(_) => "",
        }
    }

    /// Where a value stands, in the axis' own units.
    fn place(&self, v: f64) -> f64 {
        if matches!(self, Axis::Log(_)) { v.log10() } else { v }
    }

    /// A value in words.
    fn reported(&self, v: f64) -> String {
        match self {
            Axis::Rows(names) => names.get(v.round() as usize).cloned().unwrap_or_default(),
            Axis::Log(label) | Axis::Linear(label) => format!("{label}: {}", shown(v)),
        }
    }
}

/// Where a figure's parts are.
struct Layout {
    left: f64,
    width: f64,
    height: f64,
    /// Lowest and highest value of each axis, in its own units.
    ranges: [[f64; 2]; 2],
}

impl Layout {
    /// Where a point of series `s` is drawn.
    fn at(&self, figure: &Figure, s: usize, p: [f64; 2]) -> [f64; 2] {
        let share = |k: usize| {
            let [low, high] = self.ranges[k];
            (figure.axes[k].place(p[k]) - low) / (high - low)
        };
        let x = self.left + share(0) * self.width;
        if matches!(figure.axes[1], Axis::Rows(_)) {
            let off = APART * (s as f64 - 0.5 * (figure.series.len() - 1) as f64);
            return [x, TOP + self.height * share(1) + off];
        }
        [x, TOP + self.height * (1.0 - share(1))]
    }
}

impl Figure {
    fn shown<'a>(&'a self, s: &'a Series) -> impl Iterator<Item = [f64; 2]> + 'a {
        s.points.iter().copied().filter(|p| (0..2).all(|k| self.axes[k].shows(p[k])))
    }

    /// Smallest and largest place along an axis, rounded outwards.
    fn range(&self, k: usize) -> [f64; 2] {
        if let Axis::Rows(names) = &self.axes[k] {
            return [-0.5, names.len() as f64 - 0.5];
        }
        let all = || self.series.iter().flat_map(|s| self.shown(s)).map(|p| self.axes[k].place(p[k]));
        let low = all().fold(f64::INFINITY, f64::min).floor();
        let high = all().fold(f64::NEG_INFINITY, f64::max).ceil();
        if low.is_finite() && high.is_finite() { [low, high.max(low + 1.0)] } else { [0.0, 1.0] }
    }

    fn layout(&self) -> Layout {
        let (left, height) = match &self.axes[1] {
            Axis::Rows(names) => {
                let widest = names.iter().map(|n| text_width(n, Size::Small)).fold(0.0, f64::max);
                // Room for each series' own line within a row.
                let row = 14.0 + APART * self.series.len() as f64;
                (widest + 30.0, (row * names.len() as f64).max(120.0))
            }
            _ => (100.0, 460.0),
        };
        let legend = self.series.iter().map(|s| text_width(&s.name, Size::Small)).fold(0.0, f64::max) + 90.0;
        Layout { left, width: WIDTH - left - legend, height, ranges: [self.range(0), self.range(1)] }
    }

    /// The figure, with its caption below or without.
    pub fn draw(&self, with_caption: bool) -> Drawing {
        let caption =
            if with_caption { wrapped(&self.caption, (WIDTH - 60.0) / Size::Small.advance()) } else { Vec::new() };
        let layout = self.layout();
        let Layout { left, width, height, ranges } = layout;
        let legend = TOP + 20.0 + LINE * self.series.len() as f64;
        let foot = (TOP + height + 90.0).max(legend);
        let bottom = if with_caption { foot + LINE * caption.len() as f64 } else { foot - 20.0 };
        let mut d = Drawing::new(WIDTH as usize, bottom as usize);
        d.bold([20.0, 30.0], &self.title, Size::Normal, Anchor::Left, INK);
        let x_axis = |v: f64| [left + width * (v - ranges[0][0]) / (ranges[0][1] - ranges[0][0]), TOP + height];
        for (v, label) in ticks(&self.axes[0], ranges[0], 9.0) {
            let [x, y] = x_axis(v);
            d.line([x, TOP], [x, y], GREY.alpha(0.3), 1.0);
            d.text([x, y + 20.0], &label, Size::Small, Anchor::Middle, INK);
        }
        if let Axis::Rows(names) = &self.axes[1] {
            for (i, name) in names.iter().enumerate() {
                let y = TOP + height * (i as f64 + 0.5) / names.len() as f64;
                d.line([left, y], [left + width, y], GREY.alpha(0.3), 1.0);
                d.text([left - 12.0, y], name, Size::Small, Anchor::Right, INK);
            }
        }
        for (v, label) in ticks(&self.axes[1], ranges[1], 9.0) {
            let y = TOP + height * (1.0 - (v - ranges[1][0]) / (ranges[1][1] - ranges[1][0]));
            d.line([left, y], [left + width, y], GREY.alpha(0.3), 1.0);
            d.text([left - 10.0, y], &label, Size::Small, Anchor::Right, INK);
        }
        d.rectangle([left, TOP], [width, height], None, Some((GREY, 1.0)));
        d.text([left + 0.5 * width, TOP + height + 50.0], self.axes[0].label(), Size::Small, Anchor::Middle, INK);
        d.text([20.0, TOP - 18.0], self.axes[1].label(), Size::Small, Anchor::Left, INK);
        for (i, s) in self.series.iter().enumerate() {
            let color = Color::hex(PALETTE[s.color % PALETTE.len()]);
            let points: Vec<[f64; 2]> = self.shown(s).map(|p| layout.at(self, i, p)).collect();
            for w in points.windows(2) {
                match s.stroke {
                    Stroke::Solid => d.line(w[0], w[1], color, 2.5),
                    Stroke::Dashed => d.dashed(w[0], w[1], color, 2.0, 6.0),
                    Stroke::Rings | Stroke::Whiskers | Stroke::Bars => {}
                }
            }
            if s.stroke == Stroke::Bars {
                let bar = |p: &[f64; 2]| ([left, p[1] - 0.5 * THICK], [p[0] - left, THICK]);
                points.iter().map(bar).for_each(|(at, size)| d.rectangle(at, size, Some(color), None));
            }
            if s.stroke == Stroke::Whiskers {
                points.chunks_exact(2).for_each(|w| d.line(w[0], w[1], color.alpha(0.5), 2.0));
            }
            for (k, p) in points.iter().enumerate() {
                mark(&mut d, *p, s.stroke, k, color);
            }
            let (x, y) = (left + width + 20.0, TOP + 12.0 + LINE * i as f64);
            match s.stroke {
                Stroke::Solid => d.line([x, y], [x + 32.0, y], color, 2.5),
                Stroke::Dashed => d.dashed([x, y], [x + 32.0, y], color, 2.0, 6.0),
                Stroke::Whiskers => d.line([x + 2.0, y], [x + 28.0, y], color.alpha(0.5), 2.0),
                Stroke::Bars => d.rectangle([x, y - 0.5 * THICK], [32.0, THICK], Some(color), None),
                Stroke::Rings => {}
            }
            match s.stroke {
                Stroke::Whiskers => {
                    mark(&mut d, [x + 2.0, y], s.stroke, 0, color);
                    mark(&mut d, [x + 28.0, y], s.stroke, 1, color);
                }
                _ => mark(&mut d, [x + 16.0, y], s.stroke, 0, color),
            }
            d.text([x + 44.0, y], &s.name, Size::Small, Anchor::Left, INK);
        }
        for (i, line) in caption.iter().enumerate() {
            d.text([30.0, foot + LINE * i as f64], line, Size::Small, Anchor::Left, INK);
        }
        d
    }

    /// For a page: without its caption, in the page's own ink, each point with a tool tip.
    pub fn inline(&self) -> String {
        let svg = self.draw(false).to_svg();
        let mut svg = svg
            .replace("#ffffff", "var(--paper)")
            .replace("#1f2933", "var(--ink)")
            .replace("#7b8794", "var(--rule)")
            .replace("</svg>\n", "");
        let layout = self.layout();
        for (i, s) in self.series.iter().enumerate() {
            for p in self.shown(s) {
                let [x, y] = layout.at(self, i, p);
                let tip = format!("{}\n{}\n{}", s.name, self.axes[0].reported(p[0]), self.axes[1].reported(p[1]));
                let _ = writeln!(
                    svg,
                    "<circle class=\"hit\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\" data-tip=\"{0}\"><title>{0}</title></circle>",
                    escaped(&tip)
                );
            }
        }
        svg + "</svg>\n"
    }

    /// Writes NAME.svg and NAME.png into a folder.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write(&self, folder: &Path) -> std::io::Result<()> {
        self.write_png(folder)?;
        std::fs::write(folder.join(&self.name).with_extension("svg"), self.draw(true).to_svg())
    }

    /// Writes NAME.png into a folder.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write_png(&self, folder: &Path) -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        std::fs::write(folder.join(&self.name).with_extension("png"), self.draw(true).to_png())
    }
}

/// The mark of point `k` of a series.
fn mark(d: &mut Drawing, p: [f64; 2], stroke: Stroke, k: usize, color: Color) {
    match stroke {
        Stroke::Solid => d.circle(p, 4.0, Some(color), None),
        Stroke::Dashed => d.circle(p, 2.5, Some(color), None),
        Stroke::Bars => {}
        Stroke::Whiskers if k.is_multiple_of(2) => d.circle(p, 4.5, Some(color), None),
        Stroke::Rings | Stroke::Whiskers => d.circle(p, 4.0, None, Some((color, 1.5))),
    }
}

/// Places along an axis that are labelled, `most` at the most; none of rows.
fn ticks(axis: &Axis, [low, high]: [f64; 2], most: f64) -> Vec<(f64, String)> {
    let least = ((high - low) / most).max(1.0);
    // Of whole numbers 1, 2 or 5 times a power of ten.
    let decade = 10f64.powf(least.log10().floor());
    let round = [1.0, 2.0, 5.0, 10.0].map(|k| k * decade).into_iter().find(|s| *s >= least);
    let step = match axis {
        Axis::Linear(_) => round.unwrap_or(least) as usize,
        _ => least.ceil() as usize,
    };
    let label = |e: i32| match axis {
        Axis::Linear(_) => format!("{e}"),
        _ if (-2..=3).contains(&e) => format!("{}", 10f64.powi(e)),
        _ => format!("1e{e}"),
    };
    match axis {
        Axis::Rows(_) => Vec::new(),
        _ => (low as i32..=high as i32).step_by(step.max(1)).map(|e| (f64::from(e), label(e))).collect(),
    }
}

/// Lines of at most so many characters.
fn wrapped(text: &str, most: f64) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.last_mut().expect("one line at least");
        let room = text_width(last, Size::Small) / Size::Small.advance() + 1.0 + word.chars().count() as f64;
        if !last.is_empty() && room > most {
            lines.push(word.into());
        } else {
            if !last.is_empty() {
                last.push(' ');
            }
            last.push_str(word);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(axes: [Axis; 2], points: Vec<[f64; 2]>, stroke: Stroke) -> Figure {
        let series = vec![Series { name: "a < b".into(), points, stroke, color: 0 }];
        Figure { name: "f".into(), title: "t".into(), caption: "one two three".into(), axes, series }
    }

    #[test]
    fn a_figure_spans_its_points_and_leaves_out_what_has_no_logarithm() {
        let axes = [Axis::Log("x".into()), Axis::Log("y".into())];
        let figure = figure(axes, vec![[1e-3, 2.0], [0.0, 5.0], [20.0, 300.0]], Stroke::Solid);
        assert_eq!((figure.range(0), figure.range(1)), ([-3.0, 2.0], [0.0, 3.0]));
        let svg = figure.draw(true).to_svg();
        assert!(
            svg.contains("1e-3") && svg.contains(">one two three<") && !svg.contains("NaN") && !svg.contains("inf")
        );
        assert_eq!(wrapped("one two three", 8.0), ["one two", "three"]);
    }

    #[test]
    fn rows_have_names_and_points_have_tool_tips() {
        let axes = [Axis::Log("ratio".into()), Axis::Rows(vec!["first".into(), "second".into()])];
        let figure = figure(axes, vec![[1.0, 0.0], [10.0, 0.0], [2.0, 1.0], [3.0, 1.0]], Stroke::Whiskers);
        let svg = figure.inline();
        assert!(svg.contains(">first<") && svg.contains(">second<") && !svg.contains("one two three"));
        assert_eq!(svg.matches("class=\"hit\"").count(), 4);
        assert!(svg.contains("a &lt; b\nratio: 10\nfirst") && svg.contains("var(--ink)") && !svg.contains("#1f2933"));
        // The first row is the upper one.
        let layout = figure.layout();
        assert!(layout.at(&figure, 0, [1.0, 0.0])[1] < layout.at(&figure, 0, [1.0, 1.0])[1]);
    }
}
