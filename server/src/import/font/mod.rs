//! Fonts: outlines of characters, how far they stand apart, and which font a name means.
//!
//! TrueType outlines (`glyf`) are read, by read-fonts; hints and ligatures are not. A name is looked up among the machine's fonts by
//! whoever reads the file (`machine`), so that a kept model is of the font, too. Without any, two fonts that this program carries
//! stand in for all: Ubuntu Light, and Hack for names of fonts whose characters are equally wide.

pub mod machine;
mod style;

pub use style::Pattern;

use glam::DVec2;
use read_fonts::tables::glyf::{Anchor, Glyph};
use read_fonts::tables::gpos::{PairPos, PositionSubtables};
use read_fonts::types::{GlyphId, NameId, Tag};
use read_fonts::{FontRef, TableProvider};

/// Glyphs within glyphs, beyond which a font is broken.
const DEEPEST: u32 = 8;
/// Corners of one glyph, beyond which a font is broken.
const MOST_CORNERS: usize = 1 << 16;

/// A font that is read.
pub struct Font<'a> {
    font: FontRef<'a>,
    /// Its own units in an em.
    units: f64,
}

impl Font<'static> {
    /// The one that stands in where no other is at hand.
    pub fn carried(pattern: &Pattern) -> Option<Self> {
        Self::new(if pattern.is_mono() {
            epaint_default_fonts::HACK_REGULAR
        } else {
            epaint_default_fonts::UBUNTU_LIGHT
        })
    }
}

impl<'a> Font<'a> {
    /// A font file; `None` for what is none with TrueType outlines.
    pub fn new(bytes: &'a [u8]) -> Option<Self> {
        let font = FontRef::new(bytes).ok()?;
        let units = f64::from(font.head().ok()?.units_per_em());
        (units > 0.0 && font.glyf().is_ok() && font.hmtx().is_ok() && font.cmap().is_ok())
            .then_some(Self { font, units })
    }

    /// Its family and style, such as "Hack" and "Regular".
    pub fn name(&self) -> (String, String) {
        let of = |id: NameId| {
            let table = self.font.name().ok()?;
            let record = table.name_record().iter().find(|r| r.name_id() == id && r.is_unicode())?;
            Some(record.string(table.string_data()).ok()?.chars().collect::<String>())
        };
        let either = |a, b| of(a).or_else(|| of(b)).unwrap_or_default();
        (
            either(NameId::TYPOGRAPHIC_FAMILY_NAME, NameId::FAMILY_NAME),
            either(NameId::TYPOGRAPHIC_SUBFAMILY_NAME, NameId::SUBFAMILY_NAME),
        )
    }

    /// The number of a character's glyph; 0, which shows that there is none, where it has none.
    pub fn glyph(&self, c: char) -> u32 {
        self.font.cmap().ok().and_then(|t| t.map_codepoint(c)).map_or(0, |g| g.to_u32())
    }

    /// How far the next glyph stands from this one, in em.
    pub fn advance(&self, glyph: u32) -> f64 {
        let advance = self.font.hmtx().ok().and_then(|t| t.advance(GlyphId::new(glyph))).unwrap_or(0);
        f64::from(advance) / self.units
    }

    /// How much nearer (negative) or farther two glyphs stand than that, in em: of `GPOS`, or of `kern` where that has no pairs.
    pub fn kerning(&self, left: u32, right: u32) -> f64 {
        let (left, right) = (GlyphId::new(left), GlyphId::new(right));
        let units = match self.pairs() {
            Some(lookups) => lookups.iter().find_map(|i| self.pair(*i, left, right)).map_or(0, i32::from),
            None => self.kern(left, right).unwrap_or(0),
        };
        f64::from(units) / self.units
    }

    /// Height above and depth below the base line (negative) that the font states, in em.
    pub fn extent(&self) -> (f64, f64) {
        let of = |a: i16, d: i16| (f64::from(a) / self.units, f64::from(d) / self.units);
        match (self.font.os2(), self.font.hhea()) {
            (Ok(t), _) => of(t.s_typo_ascender(), t.s_typo_descender()),
            (_, Ok(t)) => of(t.ascender().to_i16(), t.descender().to_i16()),
            _ => (1.0, 0.0),
        }
    }

    /// Of a glyph so high (in em) in a column: how far below it the next one stands, and how far below its place its own top is. Where the
    /// font has no metrics of columns they are FreeType's: the glyph is in the middle of what ascender and descender span, in whole
    /// units, a half unit off the middle where that is uneven.
    pub fn column(&self, glyph: u32, high: f64) -> (f64, f64) {
        if let Ok(table) = self.font.vmtx()
            && let (Some(advance), Some(top)) =
                (table.advance(GlyphId::new(glyph)), table.side_bearing(GlyphId::new(glyph)))
        {
            return (f64::from(advance) / self.units, f64::from(top) / self.units);
        }
        let (ascent, descent) = self.extent();
        let advance = ((ascent - descent) * self.units).round();
        let top = (0.5 * (advance - (high * self.units).round())).trunc();
        (advance / self.units, top / self.units)
    }

    /// The lookups of pairs of `GPOS` for Latin text; `None` where it has none.
    fn pairs(&self) -> Option<Vec<u16>> {
        let gpos = self.font.gpos().ok()?;
        let (scripts, features) = (gpos.script_list().ok()?, gpos.feature_list().ok()?);
        let script = [b"latn", b"DFLT"].iter().find_map(|t| scripts.index_for_tag(Tag::new(t)))?;
        let script = scripts.get(script).ok()?;
        let language = script.default_lang_sys()?.ok()?;
        let mut lookups = Vec::new();
        for index in language.feature_indices() {
            let Ok(feature) = features.get(index.get()) else { continue };
            if feature.tag == Tag::new(b"kern") {
                lookups.extend(feature.lookup_list_indices().iter().map(|i| i.get()));
            }
        }
        lookups.sort_unstable();
        lookups.dedup();
        (!lookups.is_empty()).then_some(lookups)
    }

    /// What one lookup says of a pair; `None` where it says nothing.
    fn pair(&self, lookup: u16, left: GlyphId, right: GlyphId) -> Option<i16> {
        let lookups = self.font.gpos().ok()?.lookup_list().ok()?;
        let PositionSubtables::Pair(tables) = lookups.lookups().get(usize::from(lookup)).ok()?.subtables().ok()? else {
            return None;
        };
        tables.iter().flatten().find_map(|table| match table {
            PairPos::Format1(t) => {
                let set = t.pair_sets().get(t.coverage().ok()?.get(left)? as usize).ok()?;
                let second = read_fonts::types::GlyphId16::try_from(right).ok()?;
                set.find_pair_value_record(second)?.value_record1().x_advance()
            }
            PairPos::Format3(_) | PairPos::Format4(_) => None,
            PairPos::Format2(t) => {
                t.coverage().ok()?.get(left)?;
                let (a, b) = (t.class_def1().ok()?.get(left), t.class_def2().ok()?.get(right));
                let (a, b) = (u16::try_from(a).ok()?, u16::try_from(b).ok()?);
                Some(t.value_record_refs(a, b)?[0].x_advance().unwrap_or(0))
            }
        })
    }

    fn kern(&self, left: GlyphId, right: GlyphId) -> Option<i32> {
        use read_fonts::tables::kern::SubtableKind;
        let kern = self.font.kern().ok()?;
        let usable = kern.subtables().flatten().filter(|t| t.is_horizontal() && !t.is_cross_stream());
        let of = |t: read_fonts::tables::kern::Subtable<'a>| match t.kind().ok()? {
            SubtableKind::Format0(t) => t.kerning(left, right),
            SubtableKind::Format1(_) | SubtableKind::Format2(_) | SubtableKind::Format3(_) => None,
        };
        let all: Vec<i32> = usable.filter_map(of).collect();
        (!all.is_empty()).then(|| all.iter().sum())
    }

    /// The outline of a glyph, every curve in `pieces`.
    pub fn outline(&self, glyph: u32, pieces: u32) -> GlyphOutline {
        let mut contours = Vec::new();
        self.contours(glyph, 0, &mut contours);
        let mut outline = GlyphOutline { paths: Vec::new(), low: DVec2::INFINITY, high: DVec2::NEG_INFINITY, off: 0.0 };
        for contour in &mut contours {
            for c in contour.iter_mut() {
                c.at /= self.units;
                (outline.low, outline.high) = (outline.low.min(c.at), outline.high.max(c.at));
            }
            let (path, off) = flattened(contour, pieces);
            outline.off = outline.off.max(off);
            outline.paths.push(path);
        }
        outline
    }

    fn contours(&self, glyph: u32, depth: u32, out: &mut Vec<Vec<Corner>>) -> Option<()> {
        let (glyf, loca) = (self.font.glyf().ok()?, self.font.loca(None).ok()?);
        let count = |all: &[Vec<Corner>]| all.iter().map(Vec::len).sum::<usize>();
        match loca.get(GlyphId::new(glyph), &glyf)?.into_glyph()? {
            Glyph::Simple(simple) => {
                if simple.num_points() > MOST_CORNERS {
                    return None;
                }
                let corner = |p: read_fonts::tables::glyf::CurvePoint| Corner {
                    at: DVec2::new(f64::from(p.x), f64::from(p.y)),
                    on: p.on_curve,
                };
                let points: Vec<Corner> = simple.points().map(corner).collect();
                let mut first = 0;
                for end in simple.end_pts_of_contours() {
                    let end = usize::from(end.get()) + 1;
                    out.push(points.get(first..end)?.to_vec());
                    first = end;
                }
            }
            Glyph::Composite(composite) => {
                for part in composite.components() {
                    if depth >= DEEPEST || count(out) > MOST_CORNERS {
                        return None;
                    }
                    let before = out.len();
                    self.contours(part.glyph.to_u32(), depth + 1, out);
                    let t = part.transform;
                    let [xx, yx, xy, yy] = [t.xx, t.yx, t.xy, t.yy].map(|v| f64::from(v.to_f32()));
                    let shift = match part.anchor {
                        Anchor::Offset { x, y } => DVec2::new(f64::from(x), f64::from(y)),
                        Anchor::Point { .. } => DVec2::ZERO,
                    };
                    for c in out[before..].iter_mut().flatten() {
                        c.at = DVec2::new(xx * c.at.x + xy * c.at.y, yx * c.at.x + yy * c.at.y) + shift;
                    }
                }
            }
        }
        Some(())
    }
}

/// What a glyph looks like, in em.
pub struct GlyphOutline {
    /// Closed paths; outer ones run clockwise.
    pub paths: Vec<Vec<DVec2>>,
    /// The lowest corner of its box, corners that steer curves included; infinite for a glyph without paths.
    pub low: DVec2,
    /// The highest.
    pub high: DVec2,
    /// How far the pieces of curves lie off them at most.
    pub off: f64,
}

/// A corner of a contour, on it or steering a curve of it.
#[derive(Clone, Copy, Debug)]
struct Corner {
    at: DVec2,
    on: bool,
}

/// A contour of lines and quadratic curves, each curve in `pieces` of equal parameter, and how far these lie off at most: a curve with
/// the second difference d lies d/4 off its chord.
fn flattened(contour: &[Corner], pieces: u32) -> (Vec<DVec2>, f64) {
    let n = contour.len();
    let mut corners = Vec::with_capacity(2 * n);
    for i in 0..n {
        let (a, b) = (contour[i], contour[(i + 1) % n]);
        corners.push(a);
        if !a.on && !b.on {
            // Between two corners that steer lies one on it.
            corners.push(Corner { at: (a.at + b.at) * 0.5, on: true });
        }
    }
    let Some(start) = corners.iter().position(|c| c.on) else { return (Vec::new(), 0.0) };
    corners.rotate_left(start);
    let at = |i: usize| corners[i % corners.len()];
    let (mut path, mut i, mut off) = (Vec::new(), 0, 0.0_f64);
    while i < corners.len() {
        let (from, next) = (at(i).at, at(i + 1));
        if next.on {
            path.push(next.at);
            i += 1;
            continue;
        }
        let to = at(i + 2).at;
        for k in 1..=pieces {
            let a = f64::from(k) / f64::from(pieces);
            path.push(from * ((1.0 - a) * (1.0 - a)) + next.at * (2.0 * (1.0 - a) * a) + to * (a * a));
        }
        off = off.max(0.25 * (from - next.at * 2.0 + to).length() / f64::from(pieces * pieces));
        i += 2;
    }
    (path, off)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(path: &[DVec2]) -> f64 {
        let n = path.len();
        (0..n).map(|i| 0.5 * path[i].perp_dot(path[(i + 1) % n])).sum()
    }

    #[test]
    fn carried_fonts_have_outlines_that_close_around_their_characters() {
        for (name, family) in [("", "Ubuntu"), ("Liberation Mono:style=Bold", "Hack")] {
            let font = Font::carried(&Pattern::new(name)).expect("a font");
            assert!(font.name().0.starts_with(family), "{:?}", font.name());
            for c in ('!'..='~').chain("äöüÄÖÜß€°é".chars()) {
                let glyph = font.glyph(c);
                assert_ne!(glyph, 0, "{c}");
                let GlyphOutline { paths, low, high, .. } = font.outline(glyph, 6);
                assert!(!paths.is_empty() && paths.iter().all(|p| p.len() >= 3), "{c}");
                // TrueType's outer contours run clockwise.
                let filled: f64 = paths.iter().map(|p| area(p)).sum();
                let size = high - low;
                assert!(filled < 0.0 && -filled < 1.000001 * size.x * size.y, "{c}: {filled} of {size}");
                assert!(font.advance(glyph) > 0.1 && size.max_element() < 1.6, "{c}");
                let within = |p: &DVec2| p.cmpge(low).all() && p.cmple(high).all();
                assert!(paths.iter().flatten().all(within), "{c}");
                // More pieces of a curve come nearer to it, by a quarter each time they double.
                let of = |pieces| font.outline(glyph, pieces).paths.iter().map(|p| area(p)).sum::<f64>();
                let [a, b, d] = [of(4), of(8), of(16)];
                assert!((b - d).abs() <= 0.26 * (a - b).abs() + 1e-12, "{c}: {a}, {b}, {d}");
            }
            assert_eq!(font.glyph('\u{10fff0}'), 0);
        }
        let sans = Font::carried(&Pattern::new("")).expect("a font");
        assert!(sans.kerning(sans.glyph('A'), sans.glyph('V')) < -0.01, "AV stand nearer");
        assert_eq!(sans.kerning(sans.glyph('H'), sans.glyph('H')), 0.0);
    }

    #[test]
    fn contours_of_steering_corners_alone_are_closed() {
        let c = |x: f64, y: f64, on| Corner { at: DVec2::new(x, y), on };
        // A rounded square of four curves between middles of sides.
        let round = flattened(&[c(1., 1., false), c(-1., 1., false), c(-1., -1., false), c(1., -1., false)], 64).0;
        assert!((area(&round) - (4.0 - 4.0 / 6.0)).abs() < 1e-3, "{}", area(&round));
        assert!(flattened(&[c(1., 1., false)], 4).0.len() <= 8 && flattened(&[], 4).0.is_empty());
        let line = flattened(&[c(0., 0., true), c(1., 0., true), c(0., 1., true)], 9).0;
        assert_eq!(line, [DVec2::X, DVec2::Y, DVec2::ZERO]);
    }

    #[test]
    fn broken_fonts_are_refused_or_read_without_harm() {
        let bytes = epaint_default_fonts::HACK_REGULAR;
        assert!(Font::new(b"").is_none() && Font::new(b"not a font").is_none());
        let mut r = crate::math::random::Random(5);
        for _ in 0..60 {
            let mut broken = bytes.to_vec();
            broken.truncate((r.unit() * bytes.len() as f64) as usize);
            for _ in 0..200 {
                let at = (r.unit() * broken.len() as f64) as usize;
                if let Some(b) = broken.get_mut(at) {
                    *b = (r.unit() * 256.0) as u8;
                }
            }
            let Some(font) = Font::new(&broken) else { continue };
            for c in "Ag&é".chars() {
                let glyph = font.glyph(c);
                let (advance, outline) = (font.advance(glyph), font.outline(glyph, 3));
                assert!(advance.is_finite() && font.kerning(glyph, glyph).is_finite() && !outline.low.is_nan());
            }
            font.name();
        }
    }
}
