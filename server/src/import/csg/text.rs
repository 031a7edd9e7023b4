//! `text`: characters in a row or a column, as OpenSCAD sets them.
//!
//! Sizes, alignment and the pieces of curves are those of OpenSCAD 2021.01 (FreetypeRenderer, DrawingCallback): an em is 100/72 of the
//! size, steps are 1000/1024 of the font's, a curve has an eighth of a circle's pieces. Glyphs are not hinted, which moves OpenSCAD's corners by a thousandth of the size
//! at most; kerning counts, ligatures are not made.

use super::arguments::Arguments;
use super::flat::{Flat, Outline};
use super::parts::{Part, PartId};
use super::polygon::overlay;
use super::shapes::Shapes;
use super::slices::Curve;
use super::syntax::{Call, ValueKind};
use super::{Place, Problem};
use crate::import::Attachment;
use crate::import::font::{Font, Pattern};
use crate::solid::Op;
use glam::{DAffine3, DVec2};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// What OpenSCAD writes of a text.
const PARAMETERS: [&str; 9] =
    ["text", "size", "font", "direction", "language", "script", "halign", "valign", "spacing"];
/// An em, in sizes.
const EM: f64 = 100.0 / 72.0;
/// Steps, and how far glyphs reach for the alignment, in what glyphs themselves are sized by: OpenSCAD divides these by 1000 and those by
/// 16 times 64.
const STEP: f64 = 1000.0 / 1024.0;
/// Characters of one text.
const LONGEST: usize = 10_000;

/// The font that a call asks for.
pub fn font_of(call: &Call) -> Option<Pattern> {
    let arguments = Arguments::new(call, &PARAMETERS).ok()?;
    match arguments.get("font").map(|v| &v.kind) {
        None => Some(Pattern::new("")),
        Some(ValueKind::Text(name)) => Some(Pattern::new(name)),
        Some(_) => None,
    }
}

/// Which way a text runs.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    Right,
    Left,
    Down,
    Up,
}

/// A call's arguments.
struct Setting {
    text: String,
    size: f64,
    spacing: f64,
    way: Way,
    /// Words for the sides that stand at the origin.
    align: [String; 2],
    pieces: u32,
}

impl Setting {
    fn of(shapes: &Shapes<'_>, call: &Call) -> Result<Self> {
        let arguments = Arguments::new(call, &PARAMETERS)?;
        let word = |name: &str| match arguments.get(name) {
            None => Ok(String::new()),
            Some(v) => match &v.kind {
                ValueKind::Text(text) => Ok(text.clone()),
                _ => Err((v.at, Problem::syntax(format!("a string as {name} of text"), v.found()))),
            },
        };
        let finite = |name: &str, default: f64| match arguments.number_or(name, default)? {
            n if n.is_finite() => Ok(n),
            n => Err((call.at, Problem::syntax(format!("a finite number as {name} of text"), n.to_string()))),
        };
        let size = finite("size", 10.0)?;
        let way = match word("direction")?.as_str() {
            "rtl" => Way::Left,
            "ttb" => Way::Down,
            "btt" => Way::Up,
            _ => Way::Right,
        };
        word("font")?;
        Curve::of(&arguments)?;
        let text = word("text")?;
        if text.chars().count() > LONGEST {
            return Err((call.at, Problem::Limit { what: "characters of a text", limit: LONGEST }));
        }
        let pieces = (shapes.pieces(&arguments, size.abs())? / 8 + 1).max(2);
        Ok(Self {
            text,
            size,
            spacing: finite("spacing", 1.0)?,
            way,
            align: [word("halign")?, word("valign")?],
            pieces,
        })
    }

    /// Where the first glyph stands, in em, of a text so long and wide whose glyphs reach so far above and below the base line.
    fn origin(&self, along: DVec2, wide: f64, (above, below): (f64, f64)) -> DVec2 {
        let level = matches!(self.way, Way::Right | Way::Left);
        let (width, above, below) = if level { (along.x, above, below) } else { (wide, along.y, 0.0) };
        let x = match self.align[0].as_str() {
            "right" => -width,
            "center" => -0.5 * width,
            _ => 0.0,
        };
        let y = match self.align[1].as_str() {
            "top" => -above,
            "center" => 0.5 * (below - above),
            "bottom" => below,
            _ => 0.0,
        };
        DVec2::new(x, y)
    }
}

/// The shapes of a text, each glyph one, in the plane of `inner`.
///
/// # Errors
/// What is wrong with its arguments, and where.
pub fn text(
    shapes: &mut Shapes<'_>,
    call: &Call,
    inner: DAffine3,
    overshoot: u32,
    attached: Option<&[Attachment]>,
) -> Result<PartId> {
    if matches!(Arguments::new(call, &PARAMETERS)?.get("size").map(|v| &v.kind), Some(ValueKind::Number(n)) if !n.is_finite())
    {
        return Ok(shapes.nothing(call, "of no finite size"));
    }
    let setting = Setting::of(shapes, call)?;
    let at = call.at;
    let pattern = font_of(call).unwrap_or_else(|| Pattern::new(""));
    let name = pattern.attachment();
    let found = attached.unwrap_or_default().iter().find(|a| a.name == name).and_then(|a| a.bytes.as_ref().ok());
    let font = found.and_then(|bytes| Font::new(bytes)).or_else(|| Font::carried(&pattern));
    let Some(font) = font else {
        return Err((at, Problem::syntax("a font", format!("none for {:?}", pattern.family))));
    };
    let (family, style) = font.name();
    if pattern.is_style_alone() {
        let text = format!("text in a font without a family: set in {family} {style}, OpenSCAD's may be another");
        shapes.parts.note(at, text, None);
    } else if !pattern.is_met(&family) {
        let text = format!("text in {:?}: that font is not at hand, set in {family} {style}", pattern.family);
        shapes.parts.note(at, text, None);
    }
    // Language and script change nothing here, whatever they are.
    let set = Set::new(&setting, &font);
    if !set.unknown.is_empty() {
        let text = format!(
            "{family} {style} has no glyph for {:?}: its sign for that is shown, as OpenSCAD does",
            set.unknown
        );
        shapes.parts.note(at, text, None);
    }
    shapes.parts.affordable(at, set.glyphs.iter().flatten().map(Vec::len).max().unwrap_or(0))?;
    if set.glyphs.is_empty() || setting.size == 0.0 {
        return Ok(shapes.nothing(call, "without a visible character"));
    }
    let corners = set.glyphs.iter().flatten().map(Vec::len).sum();
    shapes.parts.faceted(at, &format!("text {:?}", setting.text), corners, set.off * setting.size.abs());
    let mut made = Vec::with_capacity(set.glyphs.len());
    for paths in set.glyphs {
        let outline = Outline::Paths(filled(paths));
        let flat = Flat { outline, inner, overshoot, name: "text".into(), at, pieces: 0 };
        made.push(shapes.parts.push(Part::Flat(Box::new(flat))));
    }
    Ok(shapes.parts.op(Op::Union, at, made))
}

/// Glyphs where they stand.
struct Set {
    /// The paths of each that has any.
    glyphs: Vec<Vec<Vec<DVec2>>>,
    /// How far the pieces of curves lie off them at most, in sizes.
    off: f64,
    /// Characters without a glyph.
    unknown: String,
}

impl Set {
    fn new(setting: &Setting, font: &Font<'_>) -> Self {
        let level = matches!(setting.way, Way::Right | Way::Left);
        let mut characters: Vec<char> = setting.text.chars().collect();
        if matches!(setting.way, Way::Left | Way::Up) {
            characters.reverse();
        }
        let ids: Vec<u32> = characters.iter().map(|c| font.glyph(*c)).collect();
        let mut unknown: String = characters.iter().zip(&ids).filter(|(_, id)| **id == 0).map(|(c, _)| *c).collect();
        unknown.truncate(unknown.char_indices().nth(20).map_or(unknown.len(), |(i, _)| i));
        let (mut pen, mut off, mut wide) = (DVec2::ZERO, 0.0_f64, 0.0_f64);
        let (mut above, mut below) = (0.0_f64, 0.0_f64);
        let mut placed = Vec::with_capacity(ids.len());
        for (i, &id) in ids.iter().enumerate() {
            let glyph = font.outline(id, setting.pieces);
            let advance = font.advance(id) * STEP;
            // In a column glyphs hang below their origin, about its middle, each by its own height.
            let high = if glyph.low.is_finite() { glyph.high.y - glyph.low.y } else { 0.0 };
            let (down, top) = font.column(id, high);
            let up = if glyph.low.is_finite() { glyph.high.y } else { 0.0 };
            let hung = if level { DVec2::ZERO } else { DVec2::new(-0.5 * advance, -(up + top) * STEP) };
            if glyph.low.is_finite() {
                (above, below) = (above.max(glyph.high.y * STEP), below.max(-glyph.low.y * STEP));
                wide = wide.max((glyph.high.x - glyph.low.x) * STEP);
                off = off.max(glyph.off);
            }
            placed.push((glyph.paths, pen + hung));
            pen += setting.spacing
                * if level {
                    let kerning = ids.get(i + 1).map_or(0.0, |next| font.kerning(id, *next) * STEP);
                    DVec2::new(advance + kerning, 0.0)
                } else {
                    DVec2::new(0.0, -down * STEP)
                };
        }
        let origin = setting.origin(pen, wide, (above, below));
        let put = |(paths, at): (Vec<Vec<DVec2>>, DVec2)| {
            let point = |p: DVec2| (p + at + origin) * (EM * setting.size);
            let paths = paths.into_iter().filter(|p| p.len() >= 3);
            paths.map(|path| path.into_iter().map(point).collect()).collect::<Vec<Vec<DVec2>>>()
        };
        let glyphs = placed.into_iter().map(put).filter(|g| !g.is_empty()).collect();
        Self { glyphs, off: off * EM, unknown }
    }
}

/// Paths of a glyph whose contours may cover each other, filled by the winding number as fonts mean it, as paths for the even-odd rule.
fn filled(paths: Vec<Vec<DVec2>>) -> Vec<Vec<DVec2>> {
    if paths.len() < 2 {
        return paths;
    }
    let way = |path: &Vec<DVec2>| {
        let n = path.len();
        let area: f64 = (0..n).map(|i| (path[i] - path[0]).perp_dot(path[(i + 1) % n] - path[0])).sum();
        if area < 0.0 { -1 } else { 1 }
    };
    let ways: Vec<i32> = paths.iter().map(way).collect();
    let each: Vec<Vec<Vec<DVec2>>> = paths.iter().map(|p| vec![p.clone()]).collect();
    let inside = |of: &[bool]| of.iter().zip(&ways).filter(|(here, _)| **here).map(|(_, w)| w).sum::<i32>() != 0;
    overlay(&each, &inside).unwrap_or(paths)
}

#[cfg(test)]
mod tests {
    use crate::import::{Facets, Import, Limits, import_csg};
    use glam::DVec3;

    fn read(arguments: &str) -> Import {
        let text = format!("linear_extrude(height = 2) {{ text({arguments}); }}");
        import_csg("m.csg", &text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{text}: {e}"))
    }

    fn bounds(import: &Import) -> [f64; 4] {
        let b = import.solid.aabb();
        [b.min.x, b.min.y, b.max.x, b.max.y]
    }

    /// Area by sums over a grid of the plane at half height.
    fn area(import: &Import) -> f64 {
        let b = import.solid.aabb();
        let n = 100;
        let at = |i: u32, low: f64, high: f64| low + (high - low) * (f64::from(i) + 0.5) / f64::from(n);
        let inside = (0..n * n).filter(|k| {
            let p = DVec3::new(at(k % n, b.min.x, b.max.x), at(k / n, b.min.y, b.max.y), 1.0);
            import.solid.value(p) < 0.0
        });
        let size = b.max - b.min;
        size.x * size.y * inside.count() as f64 / f64::from(n * n)
    }

    #[test]
    fn texts_have_the_areas_and_bounds_that_another_reader_of_fonts_says() {
        // fontTools 4.68: areas of the curves, their bounds, and sums of 1000/1024 of the advances with GPOS' kerning; an em is
        // size · 100/72.
        for (font, text, size, spacing, area_of, all) in [
            ("", "AVo fi", 10.0, 1.0, 78.645648, [0.138889, -0.166667, 34.410048, 10.777778]),
            ("", "Äg&T.", 4.0, 1.3, 14.346048, [0.055556, -1.044444, 17.542166, 4.872222]),
            ("Hack", "R6 {x}", 7.0, 0.9, 62.34956, [0.678847, -1.243761, 31.001247, 7.771132]),
            ("", "~-", 20.0, 1.0, 33.89175, [1.388889, 6.166667, 22.355035, 10.166667]),
        ] {
            let arguments = format!("{text:?}, size = {size}, spacing = {spacing}, font = {font:?}, $fn = 200");
            let import = read(&arguments);
            let off = bounds(&import).iter().zip(all).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 2e-3 * size, "{text}: {:?}", bounds(&import));
            assert!((area(&import) - area_of).abs() < 0.06 * area_of, "{text}: {}", area(&import));
        }
    }

    #[test]
    fn a_text_stands_where_its_alignment_says() {
        // Width by steps 35.319010, heights 1000/1024 of 10.777778 above and of 0.166667 below: from the table above.
        let (width, above, below) = (35.319010, 10.525174, 0.162760);
        let at = |align: &str| bounds(&read(&format!("\"AVo fi\", font = \"\", $fn = 200, {align}")));
        let left = at("halign = \"left\", valign = \"baseline\"");
        for (align, x, y) in [
            ("halign = \"center\"", -0.5 * width, 0.0),
            ("halign = \"right\"", -width, 0.0),
            ("valign = \"top\"", 0.0, -above),
            ("valign = \"bottom\"", 0.0, below),
            ("valign = \"center\"", 0.0, 0.5 * (below - above)),
            ("halign = \"default\", valign = \"default\", language = 7", 0.0, 0.0),
        ] {
            let here = at(align);
            for (k, by) in [x, y, x, y].into_iter().enumerate() {
                assert!((here[k] - left[k] - by).abs() < 1e-5, "{align}: {here:?} of {left:?}");
            }
        }
        let size = |direction: &str| {
            let [x, y, u, v] = bounds(&read(&format!("\"iii\", direction = {direction:?}")));
            [u - x, v - y]
        };
        assert!(size("ttb")[1] > 3.0 * size("ltr")[1] && size("ttb")[0] < 0.5 * size("ltr")[0]);
        assert_eq!(size("ttb"), size("btt"));
        assert_eq!(size("rtl"), size("ltr"));
    }

    #[test]
    fn glyphs_of_a_column_hang_where_openscad_hangs_them() {
        // Bounds of what OpenSCAD 2021.01 makes of these in the same fonts, $fn = 100.
        for (font, text, way, [across, along], [size, spacing], all) in [
            ("Hack", "A.", "ttb", ["default", "default"], [10.0, 1.0], [-3.832, -21.4685, 4.02798, -1.59715]),
            ("Hack", "A.", "ttb", ["default", "default"], [5.0, 1.3], [-1.916, -12.7688, 2.01399, -0.798569]),
            ("Hack", "A.", "btt", ["default", "default"], [10.0, 1.0], [-3.832, -25.2856, 4.02798, -5.61296]),
            ("Hack", "A.", "btt", ["default", "default"], [5.0, 1.3], [-1.916, -14.6773, 2.01399, -2.80647]),
            ("Hack", ".", "ttb", ["default", "default"], [10.0, 1.0], [-1.0244, -7.90517, 1.17288, -5.61296]),
            ("Hack", "Agjy8@%-", "ttb", ["default", "default"], [10.0, 1.0], [-3.8998, -102.186, 4.05508, -1.59715]),
            ("Hack", "Agjy8@%-", "ttb", ["default", "default"], [5.0, 1.3], [-1.94989, -65.3345, 2.02754, -0.798569]),
            ("Hack", "Agjy8@%-", "btt", ["default", "default"], [10.0, 1.0], [-3.8998, -106.666, 4.05508, -6.13011]),
            ("Hack", "Agjy8@%-", "btt", ["default", "default"], [5.0, 1.3], [-1.94989, -67.5745, 2.02754, -3.06505]),
            ("Hack", "_", "ttb", ["default", "default"], [10.0, 1.0], [-3.4454, -7.22827, 3.63469, -6.41447]),
            ("Hack", " W", "ttb", ["default", "default"], [5.0, 1.3], [-2.04144, -14.6773, 2.13943, -9.61478]),
            ("Hack", " W", "btt", ["default", "default"], [5.0, 1.3], [-2.04144, -5.86113, 2.13943, -0.798569]),
            ("Hack", "i l", "ttb", ["default", "default"], [10.0, 1.0], [-2.8622, -39.0888, 3.32268, -1.35541]),
            ("Hack", "Ag.", "ttb", ["left", "bottom"], [10.0, 1.3], [-3.832, -43.17, 4.02798, -1.59715]),
            ("Hack", "Ag.", "ttb", ["center", "center"], [10.0, 1.3], [-7.67262, -16.7214, 0.187363, 24.8514]),
            ("Hack", "Ag.", "btt", ["right", "top"], [10.0, 1.3], [-11.5133, 5.91013, -3.65326, 47.2842]),
            ("", "A.", "ttb", ["default", "default"], [10.0, 1.0], [-4.20816, -20.2947, 4.41623, -1.59248]),
            ("", "A.", "ttb", ["default", "default"], [5.0, 1.3], [-2.10408, -12.1025, 2.20811, -0.796234]),
            ("", "A.", "btt", ["default", "default"], [10.0, 1.0], [-4.20816, -24.2513, 4.41623, -5.73265]),
            ("", "A.", "btt", ["default", "default"], [5.0, 1.3], [-2.10408, -14.0808, 2.20811, -2.86632]),
            ("", ".", "ttb", ["default", "default"], [10.0, 1.0], [-0.723862, -7.26035, 0.803833, -5.73265]),
            ("", "Agjy8@%-", "ttb", ["default", "default"], [10.0, 1.0], [-5.37489, -98.1013, 5.67999, -1.59248]),
            ("", "Agjy8@%-", "ttb", ["default", "default"], [5.0, 1.3], [-2.68744, -62.7367, 2.84, -0.796234]),
            ("", "Agjy8@%-", "btt", ["default", "default"], [10.0, 1.0], [-5.37489, -102.458, 5.67999, -5.98575]),
            ("", "Agjy8@%-", "btt", ["default", "default"], [5.0, 1.3], [-2.68744, -64.9148, 2.84, -2.99287]),
            ("", "_", "ttb", ["default", "default"], [10.0, 1.0], [-3.39244, -6.95026, 3.55154, -6.17255]),
            ("", " W", "ttb", ["default", "default"], [5.0, 1.3], [-2.87294, -14.0808, 3.02249, -9.26859]),
            ("", " W", "btt", ["default", "default"], [5.0, 1.3], [-2.87294, -5.60844, 3.02249, -0.796234]),
            ("", "i l", "ttb", ["default", "default"], [10.0, 1.0], [-0.635025, -37.9125, 1.40939, -1.37941]),
            ("", "Ag.", "ttb", ["left", "bottom"], [10.0, 1.3], [-4.20816, -41.1497, 4.41623, -1.59248]),
            ("", "Ag.", "ttb", ["center", "center"], [10.0, 1.3], [-8.42378, -15.7327, 0.200592, 23.8245]),
            ("", "Ag.", "btt", ["right", "top"], [10.0, 1.3], [-12.6394, 5.72778, -4.01501, 45.1014]),
        ] {
            let arguments = format!(
                "{text:?}, size = {size}, spacing = {spacing}, font = {font:?}, direction = {way:?}, halign = {across:?}, \
                 valign = {along:?}, $fn = 100"
            );
            let import = read(&arguments);
            let off = bounds(&import).iter().zip(all).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-3 * size, "{arguments}: {:?} instead of {all:?}", bounds(&import));
        }
    }

    #[test]
    fn fonts_and_glyphs_that_are_not_at_hand_are_told() {
        let told =
            |arguments: &str| read(arguments).notes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
        assert!(
            told("\"a\", font = \"Arial:style=Bold\"")
                .contains("text in \"Arial\": that font is not at hand, set in Ubuntu")
        );
        assert!(!told("\"a\", font = \"Hack\"").contains("at hand"));
        assert!(told("\"a\", font = \":style=Bold\"").contains("text in a font without a family: set in Ubuntu"));
        assert!(!told("\"a\", font = \"\"").contains("without a family"));
        assert!(told("\"a\u{10fff0}\"").contains("has no glyph for "));
        assert!(told("\"\"").contains("text without a visible character: left out"));
        assert!(told("\" \"").contains("text without a visible character: left out"));
        assert!(told("\"o\", $fn = 16").contains("text \"o\": faceted, "));
    }
}
