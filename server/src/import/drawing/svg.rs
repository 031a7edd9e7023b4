//! SVG drawings as OpenSCAD 2021.01 reads them: path, rect, circle, ellipse, polygon as areas; line, polyline and open paths as their
//! strokes; groups with transforms; page, viewBox, units, dpi.
//!
//! A Bézier curve is 20 pieces, an ellipse 40, an arc 10 and 4 more per half turn, whatever `$fn` says; `fill`, styles other than a
//! stroke's and visibility are not looked at. Each element is filled by the even-odd rule. `id` and `layer` choose elements, as later
//! versions do.

use super::{Drawing, Frame};
use crate::import::Place;
use crate::import::problem::Problem;
use crate::import::xml;
use clipper2_rust::core::{Path64, Paths64, Point64};
use clipper2_rust::offset::{ClipperOffset, EndType, JoinType};
use glam::{DAffine2, DMat2, DVec2};
use roxmltree::Node;
use std::collections::BTreeMap;
use std::f64::consts::PI;

type Result<T> = std::result::Result<T, (Place, Problem)>;
type Path = Vec<DVec2>;

/// Corners of one drawing.
const MOST_CORNERS: usize = 200_000;
/// Levels of elements.
const DEEPEST: usize = 500;
/// Pieces of a Bézier curve, and of an ellipse.
const OF_BEZIER: u32 = 20;
const OF_ELLIPSE: u32 = 40;
/// Ends nearer than this are one.
const CLOSED: f64 = 0.1;
/// Steps of the grid on which strokes are widened, in a user unit; how far a round one may lie off, in steps.
const STROKE_GRID: f64 = 1e4;
const STROKE_OFF: f64 = 0.25;
/// Millimetres of an inch.
const INCH: f64 = 25.4;

/// Reads a drawing.
///
/// # Errors
/// What is no XML, or no number where one has to be; too many corners.
pub fn read(bytes: &[u8], frame: &Frame<'_>) -> Result<Drawing> {
    let document = xml::parse(bytes)?;
    let root = document.root_element();
    if root.tag_name().name() != "svg" {
        return Err(xml::wrong(root, "an element svg", Some(root.tag_name().name())));
    }
    let page = Page::of(root, frame.dpi);
    let (shapes, left) = (Vec::new(), BTreeMap::new());
    let mut reader = Reader { frame, page, shapes, corners: 0, off: 0.0, left, zeros: None, is_defined: false };
    let all = frame.id.is_empty() && frame.layer.is_empty();
    reader.element(root, DAffine2::IDENTITY, (all, false), 0)?;
    let Reader { page, mut shapes, off, left, zeros, .. } = reader;
    let scale = page.scale;
    let origin = if frame.center {
        let corners = || shapes.iter().flatten().flatten();
        let low = corners().fold(DVec2::INFINITY, |m, p| m.min(*p));
        let high = corners().fold(DVec2::NEG_INFINITY, |m, p| m.max(*p));
        // The page's own corner counts once more, as in OpenSCAD.
        let middle = (low + high) * 0.5 * scale;
        DVec2::new(-middle.x, middle.y)
    } else {
        page.origin
    };
    let put = |p: &mut DVec2| *p = (*p * DVec2::new(1.0, -1.0) - page.corner) * scale + origin;
    shapes.iter_mut().flatten().flatten().for_each(put);
    let off = off * scale.abs().max_element();
    Ok(Drawing { shapes, off, left_out: left.into_iter().collect(), zeros })
}

/// Where a drawing lies in millimetres.
struct Page {
    scale: DVec2,
    /// What the scale is about.
    corner: DVec2,
    /// Where that becomes.
    origin: DVec2,
}

impl Page {
    fn of(svg: Node<'_, '_>, dpi: f64) -> Self {
        let numbers = |text: &str| -> Option<Vec<f64>> {
            let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
            words.map(|w| w.parse::<f64>().ok().filter(|n| n.is_finite())).collect()
        };
        let view = svg.attribute("viewBox").and_then(numbers);
        let view = view.and_then(|v| <[f64; 4]>::try_from(v).ok()).filter(|v| v[2] > 0.0 && v[3] > 0.0);
        let size = |name: &str, of_view: Option<f64>| match svg.attribute(name).and_then(length) {
            None => of_view.map_or(0.0, |v| INCH * v / dpi),
            Some((n, unit)) => match unit {
                "" => INCH * n / dpi,
                "px" => INCH * n / 96.0,
                "pt" => INCH * n / 72.0,
                "pc" => INCH * n / 6.0,
                "in" => INCH * n,
                "cm" => 10.0 * n,
                "mm" => n,
                _ => of_view.unwrap_or(0.0),
            },
        };
        let page = DVec2::new(size("width", view.map(|v| v[2])), size("height", view.map(|v| v[3])));
        let Some(view) = view else {
            return Self { scale: DVec2::ONE, corner: DVec2::ZERO, origin: DVec2::new(0.0, page.y) };
        };
        let of_view = DVec2::new(view[2], view[3]);
        let mut scale = page / of_view;
        let mut shift = DVec2::ZERO;
        let ratio = svg.attribute("preserveAspectRatio").unwrap_or("xMidYMid");
        let mut words = ratio.split_whitespace().filter(|w| *w != "defer");
        let word = words.next().unwrap_or("xMidYMid");
        if word != "none" {
            let slice = words.next() == Some("slice");
            scale = DVec2::splat(if slice { scale.max_element() } else { scale.min_element() });
            let part = |low: &str, high: &str| match () {
                () if word.contains(low) => 0.0,
                () if word.contains(high) => 1.0,
                () => 0.5,
            };
            shift = (page - scale * of_view) * DVec2::new(part("xMin", "xMax"), part("YMin", "YMax"));
        }
        Self { scale, corner: DVec2::new(view[0], view[1]), origin: DVec2::new(shift.x, page.y - shift.y) }
    }
}

/// A length and its unit; `None` for anything else.
fn length(text: &str) -> Option<(f64, &'static str)> {
    const UNITS: [&str; 10] = ["", "em", "ex", "px", "in", "cm", "mm", "pt", "pc", "%"];
    let text = text.trim();
    UNITS.iter().rev().find_map(|unit| {
        let number = text.strip_suffix(unit)?.trim_end().parse::<f64>().ok()?;
        number.is_finite().then_some((number, *unit))
    })
}

/// What was read.
struct Reader<'f> {
    frame: &'f Frame<'f>,
    /// The page that was read last.
    page: Page,
    shapes: Vec<Vec<Path>>,
    corners: usize,
    /// How far pieces of curves lie off them at most, in the drawing's units.
    off: f64,
    left: BTreeMap<String, usize>,
    zeros: Zeros,
    /// Within `defs`, as OpenSCAD counts: up to the first end of one.
    is_defined: bool,
}

/// The elements that are shapes.
const SHAPES: [&str; 7] = ["path", "rect", "circle", "ellipse", "line", "polyline", "polygon"];

/// The first attribute that is no plain number, and how many there are.
type Zeros = Option<(String, usize)>;

impl Reader<'_> {
    /// Reads an element with all inside of it, which `to_page` places; `chosen`: by the id and the layer, or only the layer.
    fn element(
        &mut self,
        node: Node<'_, '_>,
        to_page: DAffine2,
        (mut chosen, mut layer): (bool, bool),
        depth: usize,
    ) -> Result<()> {
        if depth > DEEPEST {
            return Err((xml::place(node), Problem::Limit { what: "levels of elements", limit: DEEPEST }));
        }
        let frame = self.frame;
        // A name space of its own has the attribute that Inkscape writes of layers.
        let label = || node.attributes().find(|a| a.name() == "label").map(|a| a.value());
        layer |= frame.layer.is_empty() || label() == Some(frame.layer);
        chosen |= layer && (frame.id.is_empty() || node.attribute("id") == Some(frame.id));
        let name = node.tag_name().name();
        // OpenSCAD knows these elements. It looks for shapes inside of any other one as if that were not there: `a`, `switch`,
        // `symbol`, `clipPath`; but for `defs`.
        let own = match node.attribute("transform") {
            Some(text) if name == "g" || SHAPES.contains(&name) => transform(node, text)?,
            _ => DAffine2::IDENTITY,
        };
        let outer = to_page;
        let to_page = to_page * own;
        let mut pen = Pen { paths: Vec::new(), off: 0.0, stroke: Stroke::of(node), zeros: None };
        match name {
            "svg" | "g" => {
                // Of several pages the last one is that of all shapes.
                if name == "svg" {
                    self.page = Page::of(node, frame.dpi);
                }
                for child in node.children().filter(Node::is_element) {
                    self.element(child, to_page, (chosen, layer), depth + 1)?;
                }
                return Ok(());
            }
            "path" => pen.path(node, node.attribute("d").unwrap_or_default())?,
            "rect" => pen.rect(node),
            "circle" | "ellipse" => {
                let at = pen.point(node, ["cx", "cy"]);
                let half = match name {
                    "circle" => DVec2::splat(pen.number(node, "r")),
                    _ => pen.point(node, ["rx", "ry"]),
                };
                pen.ellipse(at, half.abs());
            }
            "line" => {
                let ends = [pen.point(node, ["x1", "y1"]), pen.point(node, ["x2", "y2"])];
                pen.stroke(&ends);
            }
            "polyline" | "polygon" => {
                let numbers = Words::of(node, node.attribute("points").unwrap_or_default()).all()?;
                let points: Path = numbers.chunks_exact(2).map(|c| DVec2::new(c[0], c[1])).collect();
                if name == "polyline" { pen.stroke(&points) } else { pen.paths.push(points) }
            }
            "use" | "text" | "image" if !self.is_defined => self.leave(name),
            // What changes no shape: gradients, styles, titles, the data of editors; and what is only defined.
            _ => {}
        }
        let was_defined = self.is_defined;
        self.is_defined |= name == "defs";
        for child in node.children().filter(Node::is_element) {
            self.element(child, outer, (chosen, layer), depth + 1)?;
        }
        self.is_defined &= name != "defs";
        if !chosen || was_defined {
            return Ok(());
        }
        if let Some((first, count)) = pen.zeros {
            self.zeros.get_or_insert((first, 0)).1 += count;
        }
        pen.paths.retain(|p| p.len() >= 3);
        if pen.paths.is_empty() {
            return Ok(());
        }
        self.corners += pen.paths.iter().map(Vec::len).sum::<usize>();
        if self.corners > MOST_CORNERS {
            return Err((xml::place(node), Problem::Limit { what: "corners of a drawing", limit: MOST_CORNERS }));
        }
        pen.paths.iter_mut().flatten().for_each(|p| *p = to_page.transform_point2(*p));
        let m = to_page.matrix2;
        self.off = self.off.max(pen.off * m.x_axis.length().hypot(m.y_axis.length()));
        self.shapes.push(pen.paths);
        Ok(())
    }

    fn leave(&mut self, what: &str) {
        *self.left.entry(what.to_owned()).or_default() += 1;
    }
}

/// The transforms of an attribute, the first one outermost.
fn transform(node: Node<'_, '_>, text: &str) -> Result<DAffine2> {
    let mut all = DAffine2::IDENTITY;
    let mut rest = text.trim_matches(|c: char| c == ',' || c.is_whitespace());
    while !rest.is_empty() {
        let wrong = || xml::wrong(node, "a transform such as translate(1, 2)", Some(rest));
        let (name, more) = rest.split_once('(').ok_or_else(wrong)?;
        let (inside, more) = more.split_once(')').ok_or_else(wrong)?;
        let a = Words::of(node, inside).all()?;
        let turn = |degrees: f64| DAffine2::from_angle(degrees.to_radians());
        let about =
            |degrees: f64, c: DVec2| DAffine2::from_translation(c) * turn(degrees) * DAffine2::from_translation(-c);
        let skew = |x: f64, y: f64| {
            let tangent = |degrees: f64| libm::tan(degrees.to_radians());
            DAffine2::from_mat2(DMat2::from_cols(DVec2::new(1.0, tangent(y)), DVec2::new(tangent(x), 1.0)))
        };
        let one = match (name.trim(), a.as_slice()) {
            ("matrix", [a, b, c, d, e, f]) => DAffine2::from_cols_array(&[*a, *b, *c, *d, *e, *f]),
            ("translate", [x]) => DAffine2::from_translation(DVec2::new(*x, 0.0)),
            ("translate", [x, y]) => DAffine2::from_translation(DVec2::new(*x, *y)),
            ("scale", [s]) => DAffine2::from_scale(DVec2::splat(*s)),
            ("scale", [x, y]) => DAffine2::from_scale(DVec2::new(*x, *y)),
            ("rotate", [degrees]) => turn(*degrees),
            ("rotate", [degrees, x, y]) => about(*degrees, DVec2::new(*x, *y)),
            ("skewX", [degrees]) => skew(*degrees, 0.0),
            ("skewY", [degrees]) => skew(0.0, *degrees),
            _ => return Err(wrong()),
        };
        all *= one;
        rest = more.trim_start_matches(|c: char| c == ',' || c.is_whitespace());
    }
    Ok(all)
}

/// Numbers and letters of an attribute.
struct Words<'a, 'i, 't> {
    node: Node<'a, 'i>,
    rest: &'t str,
}

impl<'a, 'i, 't> Words<'a, 'i, 't> {
    fn of(node: Node<'a, 'i>, text: &'t str) -> Self {
        let mut this = Self { node, rest: text };
        this.space();
        this
    }

    fn space(&mut self) {
        self.rest = self.rest.trim_start_matches(|c: char| c == ',' || c.is_whitespace());
    }

    /// The next command, where a letter stands.
    fn letter(&mut self) -> Option<char> {
        let letter = self.rest.chars().next().filter(char::is_ascii_alphabetic)?;
        self.rest = &self.rest[1..];
        self.space();
        Some(letter)
    }

    /// A flag: one digit, after which no blank need stand.
    fn flag(&mut self) -> Result<bool> {
        match self.rest.as_bytes().first() {
            Some(b'0' | b'1') => {
                let set = self.rest.starts_with('1');
                self.rest = &self.rest[1..];
                self.space();
                Ok(set)
            }
            _ => Err(xml::wrong(self.node, "a flag, 0 or 1, of an arc", Some(self.rest))),
        }
    }

    fn number(&mut self) -> Result<f64> {
        let bytes = self.rest.as_bytes();
        let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
        let sign = |at: usize| usize::from(matches!(bytes.get(at), Some(b'+' | b'-')));
        let mut end = sign(0);
        end += digits(end);
        if bytes.get(end) == Some(&b'.') {
            end += 1 + digits(end + 1);
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let from = end + 1 + sign(end + 1);
            if digits(from) > 0 {
                end = from + digits(from);
            }
        }
        match self.rest[..end].parse::<f64>().ok().filter(|n| n.is_finite()) {
            Some(number) => {
                self.rest = &self.rest[end..];
                self.space();
                Ok(number)
            }
            None => Err(xml::wrong(self.node, "a number", Some(self.rest))),
        }
    }

    fn point(&mut self) -> Result<DVec2> {
        Ok(DVec2::new(self.number()?, self.number()?))
    }

    /// All numbers up to the end.
    fn all(mut self) -> Result<Vec<f64>> {
        let mut all = Vec::new();
        while !self.rest.is_empty() {
            all.push(self.number()?);
        }
        Ok(all)
    }
}

/// How a line is widened.
#[derive(Clone, Copy)]
struct Stroke {
    width: f64,
    join: JoinType,
    end: EndType,
}

impl Stroke {
    fn of(node: Node<'_, '_>) -> Self {
        let style = |name: &str| {
            let pairs = node.attribute("style").unwrap_or_default().split(';').filter_map(|p| p.split_once(':'));
            let found = pairs.filter(|(n, _)| n.trim() == name).map(|(_, value)| value.trim()).next();
            node.attribute(name).or(found).unwrap_or_default()
        };
        let width = style("stroke-width").parse::<f64>().unwrap_or(0.0);
        Self {
            width: if width.is_finite() && width >= 0.01 { width } else { 1.0 },
            join: match style("stroke-linejoin") {
                "bevel" => JoinType::Square,
                "round" => JoinType::Round,
                _ => JoinType::Miter,
            },
            end: match style("stroke-linecap") {
                "butt" => EndType::Butt,
                "round" => EndType::Round,
                _ => EndType::Square,
            },
        }
    }
}

/// Draws one element.
struct Pen {
    paths: Vec<Path>,
    off: f64,
    stroke: Stroke,
    zeros: Zeros,
}

impl Pen {
    /// An attribute's number, 0 where there is none. So it is to OpenSCAD 2021.01, too, where anything else stands than a number, a unit
    /// behind one or a blank; that is kept to be told.
    fn number(&mut self, node: Node<'_, '_>, attribute: &str) -> f64 {
        let Some(word) = node.attribute(attribute) else { return 0.0 };
        word.parse::<f64>().ok().filter(|n| n.is_finite()).unwrap_or_else(|| {
            let place = xml::place(node);
            let first = || (format!("{attribute}={word:?} of {} at {place}", node.tag_name().name()), 0);
            self.zeros.get_or_insert_with(first).1 += 1;
            0.0
        })
    }

    fn point(&mut self, node: Node<'_, '_>, [x, y]: [&str; 2]) -> DVec2 {
        DVec2::new(self.number(node, x), self.number(node, y))
    }

    /// The outline of a line as wide as its stroke.
    fn stroke(&mut self, points: &[DVec2]) {
        // What lies beyond could not be told on the grid; a drawing is not that large.
        let most = 1e12;
        if points.is_empty() || points.iter().any(|p| p.abs().max_element() > most) || self.stroke.width > most {
            return;
        }
        let on_grid = |p: &DVec2| {
            let p = *p * STROKE_GRID;
            Point64::new(p.x as i64, p.y as i64)
        };
        let line: Path64 = points.iter().map(on_grid).collect();
        let mut offset = ClipperOffset::new(2.0, STROKE_OFF, false, false);
        offset.add_path(&line, self.stroke.join, self.stroke.end);
        let mut made = Paths64::new();
        offset.execute(self.stroke.width * 0.5 * STROKE_GRID, &mut made);
        for path in &made {
            self.paths.push(path.iter().map(|p| DVec2::new(p.x as f64, p.y as f64) / STROKE_GRID).collect());
        }
    }

    fn ellipse(&mut self, at: DVec2, half: DVec2) {
        let point = |i: u32| {
            let (sin, cos) = libm::sincos(2.0 * PI * f64::from(i) / f64::from(OF_ELLIPSE));
            at + half * DVec2::new(sin, cos)
        };
        self.off = self.off.max(half.max_element() * (1.0 - libm::cos(PI / f64::from(OF_ELLIPSE))));
        self.paths.push((1..=OF_ELLIPSE).map(point).collect());
    }

    fn rect(&mut self, node: Node<'_, '_>) {
        let at = self.point(node, ["x", "y"]);
        let size = self.point(node, ["width", "height"]);
        let [mut rx, mut ry] = self.point(node, ["rx", "ry"]).abs().to_array();
        if rx < 1e-8 && ry < 1e-8 {
            self.paths
                .push([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|c| at + size * DVec2::from(c)).into());
            return;
        }
        if rx < 1e-8 {
            rx = ry;
        } else if ry < 1e-8 {
            ry = rx;
        }
        let r = DVec2::new(rx.min(size.x / 2.0), ry.min(size.y / 2.0));
        let end = at + size;
        let mut path = vec![DVec2::new(at.x + r.x, at.y), DVec2::new(end.x - r.x, at.y)];
        for (to, then) in [
            (DVec2::new(end.x, at.y + r.y), DVec2::new(end.x, end.y - r.y)),
            (DVec2::new(end.x - r.x, end.y), DVec2::new(at.x + r.x, end.y)),
            (DVec2::new(at.x, end.y - r.y), DVec2::new(at.x, at.y + r.y)),
        ] {
            self.arc(&mut path, r, 0.0, (false, true), to);
            path.push(then);
        }
        let first = path[0];
        self.arc(&mut path, r, 0.0, (false, true), first);
        self.paths.push(path);
    }

    /// An arc from where the path ends (SVG 1.1, F.6.5 and F.6.6).
    fn arc(&mut self, path: &mut Path, r: DVec2, degrees: f64, (large, sweep): (bool, bool), to: DVec2) {
        let Some(&from) = path.last() else { return };
        if r.min_element() <= 0.0 || from == to {
            path.push(to);
            return;
        }
        let axis = DVec2::from_angle(degrees.to_radians());
        let into = |v: DVec2| DVec2::new(axis.dot(v), axis.perp().dot(v));
        let out = |v: DVec2| axis * v.x + axis.perp() * v.y;
        let half = into((from - to) * 0.5);
        let far = (half / r).length_squared();
        let r = if far > 1.0 { r * far.sqrt() } else { r };
        // On the unit circle: the ends stand at ± `end` from the middle of the chord.
        let end = half / r;
        let away = (1.0 / end.length_squared() - 1.0).max(0.0).sqrt() * if large == sweep { -1.0 } else { 1.0 };
        let center = DVec2::new(end.y, -end.x) * away;
        let begin = (end - center).to_angle();
        let mut turn = ((-end - center).to_angle() - begin).rem_euclid(2.0 * PI);
        if !sweep {
            turn -= 2.0 * PI;
        }
        let steps = (turn.abs() / PI * 10.0 + 4.0).floor();
        let middle = (from + to) * 0.5 + out(center * r);
        self.off = self.off.max(r.max_element() * (1.0 - libm::cos(turn / steps * 0.5)));
        for i in 1..steps as u32 {
            let (sin, cos) = libm::sincos(begin + turn * f64::from(i) / steps);
            path.push(middle + out(DVec2::new(cos, sin) * r));
        }
        path.push(to);
    }

    /// A Bézier curve of three or four points from where the path ends.
    fn bezier(&mut self, path: &mut Path, rest: &[DVec2]) {
        let Some(&from) = path.last() else { return };
        let all: Vec<DVec2> = std::iter::once(from).chain(rest.iter().copied()).collect();
        let degree = (all.len() - 1) as f64;
        // A piece lies off by at most an eighth of its second derivative times the square of its share.
        let bend = all.windows(3).fold(0.0, |m: f64, w| m.max((w[0] - 2.0 * w[1] + w[2]).length()));
        self.off = self.off.max(degree * (degree - 1.0) * bend / (8.0 * f64::from(OF_BEZIER * OF_BEZIER)));
        for i in 1..=OF_BEZIER {
            let t = f64::from(i) / f64::from(OF_BEZIER);
            let mut points = all.clone();
            while points.len() > 1 {
                points = points.windows(2).map(|w| w[0].lerp(w[1], t)).collect();
            }
            path.push(if i == OF_BEZIER { all[all.len() - 1] } else { points[0] });
        }
    }

    /// The data of a path.
    fn path(&mut self, node: Node<'_, '_>, text: &str) -> Result<()> {
        let mut words = Words::of(node, text);
        let (mut path, mut at, mut any_closed): (Path, DVec2, bool) = (Vec::new(), DVec2::ZERO, false);
        // The last control point of a curve, and of how many points that was.
        let mut control: Option<(usize, DVec2)> = None;
        let mut command = None;
        while !words.rest.is_empty() {
            let letter = words.letter();
            let drawn = match (letter, command) {
                (Some(letter), _) => letter,
                // Pairs after a move are lines.
                (None, Some('M')) => 'L',
                (None, Some('m')) => 'l',
                (None, Some(letter)) if !matches!(letter, 'z' | 'Z') => letter,
                (None, _) => return Err(xml::wrong(node, "a letter of the data of a path", Some(words.rest))),
            };
            command = Some(letter.unwrap_or(drawn));
            let base = if drawn.is_ascii_lowercase() { at } else { DVec2::ZERO };
            let upper = drawn.to_ascii_uppercase();
            if !matches!(upper, 'M' | 'Z') && path.is_empty() {
                // After an end it goes on from there.
                path.push(at);
            }
            let before = control.take();
            let mirrored = |of: usize| before.filter(|(n, _)| *n == of).map_or(at, |(_, c)| at * 2.0 - c);
            match upper {
                'M' => {
                    at = base + words.point()?;
                    self.end_of(std::mem::take(&mut path), true);
                    path.push(at);
                    continue;
                }
                'Z' => {
                    any_closed = true;
                    at = path.first().copied().unwrap_or(at);
                    self.paths.push(std::mem::take(&mut path));
                    continue;
                }
                'L' => path.push(base + words.point()?),
                'H' => path.push(DVec2::new(base.x + words.number()?, at.y)),
                'V' => path.push(DVec2::new(at.x, base.y + words.number()?)),
                'C' => {
                    let of = [base + words.point()?, base + words.point()?, base + words.point()?];
                    control = Some((4, of[1]));
                    self.bezier(&mut path, &of);
                }
                'S' => {
                    let of = [mirrored(4), base + words.point()?, base + words.point()?];
                    control = Some((4, of[1]));
                    self.bezier(&mut path, &of);
                }
                'Q' => {
                    let of = [base + words.point()?, base + words.point()?];
                    control = Some((3, of[0]));
                    self.bezier(&mut path, &of);
                }
                'T' => {
                    let of = [mirrored(3), base + words.point()?];
                    control = Some((3, of[0]));
                    self.bezier(&mut path, &of);
                }
                'A' => {
                    let (r, degrees) = (words.point()?.abs(), words.number()?);
                    let flags = (words.flag()?, words.flag()?);
                    let to = base + words.point()?;
                    self.arc(&mut path, r, degrees, flags, to);
                }
                _ => return Err(xml::wrong(node, "one of mzlhvcsqta in the data of a path", Some(&drawn.to_string()))),
            }
            at = path.last().copied().unwrap_or(at);
        }
        // An element of which any part is closed has its last one closed, too: so OpenSCAD takes it.
        self.end_of(path, !any_closed);
        Ok(())
    }

    /// A part of a path that is not closed: an area where its ends meet or where it need not be open, else its stroke.
    fn end_of(&mut self, path: Path, open: bool) {
        let apart = match (path.first(), path.last()) {
            (Some(a), Some(b)) => a.distance(*b),
            _ => return,
        };
        if open && apart > CLOSED { self.stroke(&path) } else { self.paths.push(path) }
    }
}
