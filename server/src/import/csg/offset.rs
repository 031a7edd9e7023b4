//! OpenSCAD's offset of flat shapes: rounded by a radius, or with sharp or cut corners by a distance.
//!
//! A ring's edges are moved, and their ends joined: where the ring opens there, around the corner (`r`: a disc at it), to the
//! point in which the moved edges meet (`delta`) or to a cut at the distance (`chamfer`); where it closes, at the point in which they
//! meet. That is the offset where the moved rings are simple and no edge has turned round. Where they are not, the rounded one is
//! the shape with a rectangle over every edge and a disc at every corner, added or taken away.
//!
//! Where arcs are to be OpenSCAD's pieces (`Facets`), they are those of Clipper 6, which it uses: not those of a circle's polygon.

use super::arguments::Arguments;
use super::flat::{Flat, Outline};
use super::hull::Disc;
use super::meshed::guarded;
use super::outlines::{Grid, crossing, flat, flat_of, hull_parts, paths};
use super::parts::{Part, PartId, Parts};
use super::polygon::{Region, turn};
use super::shapes::Shapes;
use super::syntax::Call;
use super::{Place, Problem};
use crate::solid::Op;
use clipper2_rust::clipper::union_subjects_64;
use clipper2_rust::core::{FillRule, Path64, Paths64, Point64};
use glam::DVec2;
use std::f64::consts::PI;

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Clipper's numbers of joins, and OpenSCAD's limit of a sharp one, in offsets.
const SQUARE: i32 = 0;
const ROUND: i32 = 1;
const MITER: i32 = 2;
const LONGEST_MITER: f64 = 1e6;
/// The grid, in a unit, on which OpenSCAD's Clipper tells that two edges run on straight.
const CLIPPER_GRID: f64 = 65536.0;

/// How corners are joined where the ring opens.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Join {
    Round,
    Sharp,
    Cut,
}

/// An `offset`.
#[derive(Clone, Copy, Debug)]
pub struct Offset {
    by: f64,
    join: Join,
    /// OpenSCAD's pieces of a turn, where arcs are cut into these.
    arcs: Option<u32>,
}

impl Offset {
    /// Its arguments by name.
    pub fn arguments(call: &Call) -> Result<Arguments<'_>> {
        Arguments::new(call, &["r", "delta", "chamfer"])
    }

    /// Reads the arguments of `offset`; `None` by no finite distance, of which OpenSCAD makes nothing.
    pub fn new(call: &Call) -> Result<Option<Self>> {
        let arguments = Self::arguments(call)?;
        let chamfer = arguments.bool_or("chamfer", false)?;
        let (name, join) = match (arguments.get("r"), chamfer) {
            (Some(_), _) => ("r", Join::Round),
            (None, true) => ("delta", Join::Cut),
            (None, false) => ("delta", Join::Sharp),
        };
        // OpenSCAD's own, where neither is given.
        let by = arguments.setting(name, 1.0)?;
        Ok(by.is_finite().then_some(Self { by, join, arcs: None }))
    }

    /// Cuts its arcs into pieces where the text's `$fn` says so, with a note.
    ///
    /// # Errors
    /// More pieces than the limit says.
    pub fn cut(&mut self, shapes: &mut Shapes<'_>, call: &Call) -> Result<()> {
        if self.join == Join::Round && self.by != 0.0 {
            self.arcs = shapes.fragments(&Self::arguments(call)?, self.by.abs())?;
        }
        Ok(())
    }

    /// How far it reaches.
    pub fn by(&self) -> f64 {
        self.by
    }

    /// The offset of the union of some parts, which stand in the coordinates in which it is asked for.
    pub fn of(&self, parts: &mut Parts<'_>, at: Place, like: &Flat, roots: &[PartId]) -> Result<Part> {
        if self.by == 0.0 || roots.is_empty() {
            return Ok(Part::Op(Op::Union, at, roots.to_vec()));
        }
        let mut leaves = Vec::new();
        let mut plain = true;
        for root in roots {
            match parts.leaves(*root) {
                Some((more, false)) => leaves.extend(more),
                Some((_, true)) | None => plain = false,
            }
        }
        // The rounded offset outwards of a union is the union of the offsets.
        let whole_arcs = self.join == Join::Round && self.arcs.is_none();
        let one_by_one = plain && (leaves.len() <= 1 || self.by > 0.0 && whole_arcs);
        if !one_by_one {
            let all = paths(parts, at, roots, "offset of shapes together")?;
            return self.of_paths(parts, at, like, &all);
        }
        let mut made = Vec::new();
        for leaf in leaves {
            let Some((disc, paths)) = flat_of(parts, leaf).map(|f| (f.disc(), f.paths())) else { continue };
            let part = match disc {
                Some(Disc { center, radius }) if radius + self.by > 0.0 => {
                    flat(like, Outline::Circle(radius + self.by), center)
                }
                Some(_) => Part::Empty,
                None => {
                    super::outlines::note_facets(parts, at, &[leaf], "offset");
                    self.of_paths(parts, at, like, &paths)?
                }
            };
            made.push(parts.push(part));
        }
        Ok(Part::Op(Op::Union, at, made))
    }

    fn of_paths(&self, parts: &mut Parts<'_>, at: Place, like: &Flat, paths: &[Vec<DVec2>]) -> Result<Part> {
        let region = Region::of_paths(paths);
        if region.open {
            return Err((at, crossing()));
        }
        if let Some(pieces) = self.arcs
            && !(self.by < 0.0 && region.is_convex())
        {
            let paths = self.arced(at, &region.rings, pieces)?;
            return Ok(if paths.is_empty() { Part::Empty } else { flat(like, Outline::Paths(paths), DVec2::ZERO) });
        }
        let corners: usize = region.rings.iter().map(Vec::len).sum();
        if parts.affordable(at, corners).is_err() {
            // As OpenSCAD has it: a disc or a strip at each of so many would be as many primitives.
            let paths = self.clipped(at, &region.rings, like.pieces)?;
            if self.join == Join::Round {
                let off = self.by.abs() * (1.0 - libm::cos(std::f64::consts::PI / f64::from(like.pieces.max(3))));
                parts.faceted(at, "offset", paths.iter().map(Vec::len).sum(), off);
            }
            return Ok(if paths.is_empty() { Part::Empty } else { flat(like, Outline::Paths(paths), DVec2::ZERO) });
        }
        if self.join == Join::Round && self.by > 0.0 && region.is_convex() {
            let disc = |c: &DVec2| Disc { center: *c, radius: self.by };
            let discs: Vec<Disc> = region.islands[0].hull.iter().map(disc).collect();
            return Ok(Part::Op(Op::Union, at, hull_parts(parts, like, &discs)));
        }
        if self.by < 0.0 && region.is_convex() {
            let inner = self.inset(&region.islands[0].hull);
            return Ok(if inner.len() < 3 {
                Part::Empty
            } else {
                flat(like, Outline::Paths(vec![inner]), DVec2::ZERO)
            });
        }
        let moved: Vec<Option<Vec<DVec2>>> = region.rings.iter().map(|r| self.moved(r)).collect();
        if let Some(moved) = moved.into_iter().collect::<Option<Vec<_>>>() {
            let after = Region::of_paths(&moved);
            // What is passed through the other way round, or twice, counts otherwise than by the even-odd rule.
            let (passed, filled) = (area(&moved), area(&after.rings));
            let once = (passed - filled).abs() <= 1e-9 * (passed.abs() + filled.abs());
            if once && !after.crossed && !after.open && after.rings.len() == region.rings.len() {
                return Ok(self.joined(parts, at, like, &region, Outline::Paths(moved), false));
            }
        }
        if self.join != Join::Round {
            let paths = self.clipped(at, &region.rings, like.pieces)?;
            return Ok(if paths.is_empty() { Part::Empty } else { flat(like, Outline::Paths(paths), DVec2::ZERO) });
        }
        Ok(self.joined(parts, at, like, &region, Outline::Paths(paths.to_vec()), true))
    }

    /// Rings with their edges moved where some meet others: by Clipper (of manifold-rust), as in OpenSCAD, on a grid of about 1e-12 of
    /// the size.
    fn clipped(&self, at: Place, rings: &[Vec<DVec2>], pieces: u32) -> Result<Vec<Vec<DVec2>>> {
        let grid = Grid::of(rings.iter().flatten().copied().chain([DVec2::splat(self.by)]));
        let section = grid.section(rings);
        let join = match self.join {
            Join::Cut => SQUARE,
            Join::Sharp => MITER,
            Join::Round => ROUND,
        };
        let pieces = pieces.max(3) as i32;
        guarded(at, || grid.paths(&section.offset_with_params(grid.length(self.by), join, LONGEST_MITER, pieces)))
    }

    /// Rings with arcs in the pieces of Clipper 6 (`DoOffset`, `DoRound`): steps of one angle from the first edge's normal on, as many as
    /// fit best, and the last one ends at the other edge's. What the rings go round more often than not is inside.
    fn arced(&self, at: Place, rings: &[Vec<DVec2>], pieces: u32) -> Result<Vec<Vec<DVec2>>> {
        let by = self.by.abs();
        let half = 180.0 / f64::from(pieces);
        // Of this angle OpenSCAD has the cosine as it is; whether one step and a half are one or two hangs on the last digit.
        let cos = if half == 30.0 { 0.75_f64.sqrt() } else { libm::cos(half.to_radians()) };
        let tolerance = (by * (1.0 - cos)).min(by * 0.25);
        let steps = PI / libm::acos(1.0 - tolerance / by);
        let (sin, cos) = libm::sincos(2.0 * PI / steps);
        let step = DVec2::new(cos, if self.by < 0.0 { -sin } else { sin });
        let size = rings.iter().flatten().fold(by, |m, p| m.max(p.abs().max_element() + by));
        // A power of two rounds nothing.
        let grid = (2_f64.powi(40) / size).log2().floor().exp2();
        let on_grid = |p: DVec2| Point64::new((p.x * grid).round() as i64, (p.y * grid).round() as i64);
        let mut moved = Paths64::new();
        for ring in rings {
            let mut path: Vec<DVec2> = Vec::with_capacity(2 * ring.len());
            for i in 0..ring.len() {
                let [before, p, after] = around(ring, i);
                let (m1, m2) = (outwards(before, p), outwards(p, after));
                let (sin, cos) = (m1.perp_dot(m2), m1.dot(m2));
                path.push(p + m1 * self.by);
                if (sin * by).abs() * CLIPPER_GRID < 1.0 && cos > 0.0 {
                    continue;
                }
                if sin * self.by < 0.0 {
                    path.push(p);
                } else {
                    let count = (steps / (2.0 * PI) * libm::atan2(sin, cos).abs() + 0.5).floor().max(1.0) as u32;
                    let mut m = m1;
                    for _ in 1..count {
                        m = step.rotate(m);
                        path.push(p + m * self.by);
                    }
                }
                path.push(p + m2 * self.by);
            }
            moved.push(path.into_iter().map(on_grid).collect());
        }
        let made = guarded(at, || union_subjects_64(&moved, FillRule::Positive))?;
        let path = |path: &Path64| path.iter().map(|p| DVec2::new(p.x as f64, p.y as f64) / grid).collect();
        Ok(made.iter().map(path).collect())
    }

    /// The shape with discs at the corners where it opens, and with rectangles over its edges; added or taken away.
    fn joined(
        &self,
        parts: &mut Parts<'_>,
        at: Place,
        like: &Flat,
        region: &Region,
        base: Outline,
        strips: bool,
    ) -> Part {
        let like = &Flat { overshoot: like.overshoot + u32::from(self.by < 0.0), ..like.clone() };
        let first = Flat { overshoot: like.overshoot - u32::from(self.by < 0.0), ..like.clone() };
        let mut made = vec![parts.push(flat(&first, base, DVec2::ZERO))];
        for ring in &region.rings {
            for i in 0..ring.len() {
                let [before, p, after] = around(ring, i);
                if strips {
                    let out = outwards(p, after) * self.by;
                    let strip = vec![p - out, after - out, after + out, p + out];
                    made.push(parts.push(flat(like, Outline::Paths(vec![strip]), DVec2::ZERO)));
                }
                if self.join == Join::Round && turn(before, p, after) * self.by > 0.0 {
                    made.push(parts.push(flat(like, Outline::Circle(self.by.abs()), p)));
                }
            }
        }
        Part::Op(if self.by > 0.0 { Op::Union } else { Op::Difference }, at, made)
    }

    /// A ring with its edges moved; `None` where one turns round.
    fn moved(&self, ring: &[DVec2]) -> Option<Vec<DVec2>> {
        let n = ring.len();
        let mut corners = Vec::with_capacity(2 * n);
        // Where the edge from corner i begins and ends when moved.
        let (mut starts, mut ends) = (vec![DVec2::ZERO; n], vec![DVec2::ZERO; n]);
        for i in 0..n {
            let [before, p, after] = around(ring, i);
            let (m1, m2) = (outwards(before, p), outwards(p, after));
            let (from, to) = (p + m1 * self.by, p + m2 * self.by);
            let meet = p + (m1 + m2) * (self.by / (1.0 + m1.dot(m2)));
            let opens = turn(before, p, after) * self.by > 0.0;
            match self.join {
                Join::Round if opens => corners.extend([from, to]),
                Join::Cut if opens => {
                    // The cut lies at the distance from the corner, square to the middle.
                    let middle = (m1 + m2).try_normalize()?;
                    let along = |m: DVec2, edge: DVec2| {
                        let t = self.by * (1.0 - m.dot(middle)) / edge.dot(middle);
                        p + m * self.by + edge * t
                    };
                    corners.extend([along(m1, (p - before).normalize()), along(m2, (p - after).normalize())]);
                }
                Join::Sharp | Join::Round | Join::Cut if meet.is_finite() => corners.push(meet),
                Join::Sharp | Join::Round | Join::Cut => return None,
            }
            let count = corners.len();
            let single = count < 2 || !opens || self.join == Join::Sharp;
            ends[(i + n - 1) % n] = if single { corners[count - 1] } else { corners[count - 2] };
            starts[i] = corners[count - 1];
        }
        let kept = (0..n).all(|i| (ends[i] - starts[i]).dot(ring[(i + 1) % n] - ring[i]) > 0.0);
        kept.then_some(corners)
    }

    /// A convex ring moved inwards: what all moved sides leave of it.
    fn inset(&self, ring: &[DVec2]) -> Vec<DVec2> {
        let mut left = ring.to_vec();
        for i in 0..ring.len() {
            let [_, p, after] = around(ring, i);
            let out = outwards(p, after);
            let height = |q: DVec2| out.dot(q - p) - self.by;
            let mut kept = Vec::with_capacity(left.len() + 1);
            for k in 0..left.len() {
                let (a, b) = (left[k], left[(k + 1) % left.len()]);
                let (s, t) = (height(a), height(b));
                if s <= 0.0 {
                    kept.push(a);
                }
                if (s < 0.0) != (t < 0.0) && s != 0.0 && t != 0.0 {
                    kept.push(a + (b - a) * (s / (s - t)));
                }
            }
            left = kept;
        }
        left
    }
}

fn around(ring: &[DVec2], i: usize) -> [DVec2; 3] {
    let n = ring.len();
    [ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]]
}

/// The unit normal to the right of the way from a to b: out of a shape on the left.
fn outwards(a: DVec2, b: DVec2) -> DVec2 {
    -(b - a).normalize().perp()
}

/// Twice the area within rings, of what runs clockwise negative.
fn area(rings: &[Vec<DVec2>]) -> f64 {
    let of = |ring: &Vec<DVec2>| -> f64 {
        (0..ring.len()).map(|i| (ring[i] - ring[0]).perp_dot(ring[(i + 1) % ring.len()] - ring[0])).sum()
    };
    rings.iter().map(of).sum()
}

#[cfg(test)]
mod tests {
    use crate::import::{Facets, Import, Limits, import_csg};
    use crate::octree::Model;
    use crate::octree::mass::mass_properties;
    use contactd_proto::MassOptions;

    /// The expected volumes are those of the STL files that OpenSCAD 2021.01 writes, of six digits.
    #[test]
    fn arcs_in_pieces_are_those_of_openscad() {
        let square = "square([20, 20], center = true);";
        let cross = "square([3, 250], center = true); square([250, 3], center = true);";
        let nook = "polygon([[0, 0], [30, 0], [30, 10], [12, 10], [10, 30], [0, 27]]);";
        let holed = "difference() { square([40, 30]); polygon([[8, 8], [22, 9], [20, 20], [15, 14], [9, 21]]); }";
        let (auto, written) = (Facets::Auto, Facets::AsWritten);
        for (arguments, inner, facets, volume) in [
            ("r = 7, $fn = 4", square, auto, 1058.0),
            ("r = -7, $fn = 7", &*format!("offset(r = 7, $fn = 4) {{ {cross} }}"), auto, 1523.4785),
            // Three halves of a step are two.
            ("r = 2, $fn = 6", nook, auto, 743.4195994),
            ("r = -2.5, $fn = 5", holed, auto, 612.1113570),
            ("r = 6.5, $fn = 0, $fa = 12, $fs = 2", square, written, 1050.4983011),
            ("r = 7, $fn = 30", square, written, 1112.5354923),
        ] {
            let text = format!("linear_extrude(height = 1) {{ offset({arguments}) {{ {inner} }} }}");
            let Import { solid, notes } =
                import_csg("m.csg", &text, facets, &Limits::default()).unwrap_or_else(|e| panic!("{text}: {e}"));
            let found = mass_properties(&Model::new(solid), &MassOptions::default()).expect("a solid").volume;
            assert!((found - volume).abs() < 1e-5 * volume, "{text}: {found}, not {volume}");
            assert!(notes.iter().any(|n| n.text.starts_with("offset taken with OpenSCAD's arcs, of ")), "{notes:?}");
        }
        // Of nine pieces on arcs are whole.
        let text = format!("linear_extrude(height = 1) {{ offset(r = 7, $fn = 9) {{ {square} }} }}");
        let whole = import_csg("m.csg", &text, auto, &Limits::default()).expect("a solid");
        assert_eq!(whole.notes[0].text, "offset with $fn = 9: taken as exact");
        assert_eq!(whole.solid.primitives.len(), 5);
    }
}
