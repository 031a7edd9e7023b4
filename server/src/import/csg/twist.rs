//! Extrusions with bent walls: with a twist, or scaled unevenly.
//!
//! Their walls are ruled surfaces that no face here is, so they are taken as OpenSCAD has them: slices, whose quads are cut along the
//! shorter diagonal, between caps (linear_extrude of OpenSCAD 2021.01; how many slices: its Calc). Slices so coarse that their facets
//! cross are halved until they do not. Walls that end in a line have more corners than OpenSCAD's, which cross there (`Ridge`).

use super::extrude::Extrusion;
use super::facets::direction;
use super::outlines::{crossing, paths};
use super::parts::{Part, PartId, Parts};
use super::place;
use super::polygon::{Region, triangles};
use super::{Place, Problem};
use crate::math::tolerance::ROUNDING;
use crate::solid::primitive::MeshFault;
use glam::{DAffine3, DVec2, DVec3};
use std::collections::HashMap;

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// Diagonals that differ by less than this, relative to their half sum, are equally long to OpenSCAD.
const SAME_DIAGONAL: f64 = 1e-5;
/// How often slices are halved where facets cross.
const HALVINGS: u32 = 4;

/// The extrusion of all that some parts make together.
///
/// # Errors
/// Outlines whose crossings no double can tell; more facets than the limit says; facets that cross however fine the slices are.
pub fn extruded(
    parts: &mut Parts<'_>,
    at: Place,
    outer: &DAffine3,
    extrusion: &Extrusion,
    roots: &[PartId],
) -> Result<Part> {
    let region = Region::of_paths(&paths(parts, at, roots, "linear_extrude")?);
    if region.open {
        return Err((at, crossing()));
    }
    if region.rings.is_empty() {
        parts.note(at, "a linear_extrude without area: left out, as OpenSCAD does", None);
        return Ok(Part::Empty);
    }
    of_region(parts, at, outer, extrusion, &region)
}

/// The surface of an extrusion without twist, counter-clockwise as seen from outside.
pub fn surface(outer: &DAffine3, extrusion: &Extrusion, rings: &[Vec<DVec2>]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (points, faces) = Bent { extrusion, rings, ridge: None, cut: false, slices: 1 }.mesh();
    let mirrored = outer.matrix3.determinant() < 0.0;
    let turned = |f: &Vec<u32>| if mirrored { [f[0], f[1], f[2]] } else { [f[2], f[1], f[0]] };
    (points.into_iter().map(|p| outer.transform_point3(p)).collect(), faces.iter().map(turned).collect())
}

/// The extrusion of outlines without crossings.
///
/// # Errors
/// More facets than the limit says; facets that cross however fine the slices are.
pub fn of_region(
    parts: &mut Parts<'_>,
    at: Place,
    outer: &DAffine3,
    extrusion: &Extrusion,
    region: &Region,
) -> Result<Part> {
    let corners: Vec<DVec2> = region.rings.iter().flatten().copied().collect();
    let (ridge, cut) = Ridge::of(extrusion, &region.rings).unzip();
    let mut rings = &region.rings;
    let wanted = extrusion.slices(&corners);
    let mut slices = wanted;
    for halved in 0.. {
        let bent = Bent { extrusion, rings, ridge: ridge.as_ref(), cut: !std::ptr::eq(rings, &region.rings), slices };
        let facets = bent.facets();
        parts.meshable(at, facets)?;
        let (points, faces) = bent.mesh();
        match place::mesh(outer, &points, &faces) {
            Err(Problem::Surface(MeshFault::Crossing(_) | MeshFault::Through { .. } | MeshFault::Intricate(_)))
                if halved < HALVINGS =>
            {
                match &cut {
                    Some(cut) if halved == 0 => rings = cut,
                    Some(_) | None => slices *= 2,
                }
            }
            Err(Problem::Surface(MeshFault::Flat)) => {
                parts.note(at, "a linear_extrude without volume: left out, as OpenSCAD does", None);
                return Ok(Part::Empty);
            }
            placed => {
                let m = outer.matrix3;
                let size = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
                if !extrusion.may_bend() {
                    let text = format!(
                        "linear_extrude of {} corners: taken as a mesh, for its formula is too deep",
                        corners.len()
                    );
                    parts.note(at, text, None);
                    return parts.leaf("linear_extrude", at, placed.map(|p| p.0));
                }
                let what = if slices == wanted && bent.cut {
                    "linear_extrude to a line, cut into more facets than OpenSCAD's, which cross".to_owned()
                } else if slices == wanted {
                    "linear_extrude with bent walls".to_owned()
                } else {
                    format!("linear_extrude with bent walls, {slices} slices in place of {wanted}, whose facets cross")
                };
                parts.faceted(at, &what, facets, bent.deviation() * size);
                return parts.leaf("faceted linear_extrude", at, placed.map(|p| p.0));
            }
        }
    }
    Ok(Part::Empty)
}

/// A mesh in the making.
struct Bent<'e> {
    extrusion: &'e Extrusion,
    /// Outlines with the inside on their left.
    rings: &'e [Vec<DVec2>],
    ridge: Option<&'e Ridge>,
    /// Every ring has a corner at every level of the ridge that it passes.
    cut: bool,
    slices: usize,
}

impl Bent<'_> {
    /// Scale and direction of +x at a level.
    fn level(&self, k: usize) -> (DVec2, DVec2) {
        let t = k as f64 / self.slices as f64;
        let scale = DVec2::ONE - (DVec2::ONE - self.extrusion.scale) * t;
        // Counted from the upper end there: it is as the text says.
        let scale = if k == self.slices { self.extrusion.scale } else { scale };
        (scale, direction(-self.extrusion.twist * t))
    }

    /// All corners at a level.
    fn corners(&self, k: usize) -> Vec<DVec2> {
        let (scale, x) = self.level(k);
        let all = self.rings.iter().flatten().map(|p| scale * x.rotate(*p));
        match self.ridge.filter(|_| k == self.slices) {
            Some(ridge) => all.map(|p| ridge.levelled(p)).collect(),
            None => all.collect(),
        }
    }

    /// The largest number of its facets.
    fn facets(&self) -> usize {
        let corners: usize = self.rings.iter().map(Vec::len).sum();
        2 * corners * (self.slices + 1)
    }

    /// Points, and faces that run clockwise as seen from outside.
    fn mesh(&self) -> (Vec<DVec3>, Vec<Vec<u32>>) {
        let extrusion = self.extrusion;
        let stride: usize = self.rings.iter().map(Vec::len).sum();
        let (mut points, mut faces) = (Vec::with_capacity(stride * (self.slices + 1)), Vec::new());
        let mut below: Vec<DVec2> = Vec::new();
        for k in 0..=self.slices {
            let here = self.corners(k);
            let z = extrusion.low + extrusion.height * k as f64 / self.slices as f64;
            points.extend(here.iter().map(|p| p.extend(z)));
            if k > 0 {
                self.walls(&below, &here, ((k - 1) * stride, k * stride), &mut faces);
            }
            below = here;
        }
        let caps = triangles(self.rings);
        let top = self.slices * stride;
        faces.extend(caps.iter().map(|t| t.map(|i| i as u32).to_vec()));
        if extrusion.scale.min_element() > 0.0 {
            faces.extend(caps.iter().map(|t| [t[2], t[1], t[0]].map(|i| (top + i) as u32).to_vec()));
        }
        (points, faces)
    }

    /// The walls of one slice; what an end that is a point or a line takes the area of is left out.
    fn walls(&self, low: &[DVec2], high: &[DVec2], (down, up): (usize, usize), faces: &mut Vec<Vec<u32>>) {
        let ridge = if up == self.slices * low.len() { self.ridge } else { None };
        let (mut first, mut last) = (0, Vec::new());
        for ring in self.rings {
            let hole = area(ring) < 0.0;
            for i in 0..ring.len() {
                let (a, b) = (first + i, first + (i + 1) % ring.len());
                let (to_next, from_next) = (low[a].distance(high[b]), low[b].distance(high[a]));
                let even = (to_next - from_next).abs() <= SAME_DIAGONAL * 0.5 * (to_next + from_next);
                // Equally long ones follow the twist.
                let flip = hole != (self.extrusion.twist <= 0.0);
                let rising = match ridge {
                    // The same way everywhere, so that walls that are in order below and above stay so between.
                    Some(ridge) if self.cut => high[a][ridge.axis] >= high[b][ridge.axis],
                    Some(_) => even && flip || !even && to_next >= from_next,
                    None => even && !flip || !even && to_next < from_next,
                };
                let [p, q, r, s] = [down + a, down + b, up + b, up + a].map(|i| i as u32);
                let quads = if rising { [[p, r, q], [p, s, r]] } else { [[p, s, q], [q, s, r]] };
                let at = |i: u32| {
                    let i = i as usize;
                    if i >= up { (high[i - up], true) } else { (low[i - down], false) }
                };
                let thin = |t: &[u32; 3]| (0..3).any(|k| at(t[k]) == at(t[(k + 1) % 3]));
                let kept = quads.iter().filter(|t| !thin(t));
                if ridge.is_some() {
                    last.extend(kept);
                } else {
                    faces.extend(kept.map(|t| t.to_vec()));
                }
            }
            first += ring.len();
        }
        if let Some(ridge) = ridge {
            let corner = |i: u32| if i as usize >= up { high[i as usize - up] } else { low[i as usize - down] };
            let last = if self.cut { last } else { ridge.fanned(&last, (up, high)) };
            faces.extend(ridge.without_doubles(&last, &|i| (i as usize >= up, corner(i))));
        }
    }

    /// How far facets lie off the ruled walls at most: the sagitta of the way that a corner turns in a slice, and half of how far the
    /// two diagonals of a quad pass each other.
    fn deviation(&self) -> f64 {
        let turned = (self.extrusion.twist / self.slices as f64).to_radians().abs().min(std::f64::consts::PI);
        let mut most = 0.0_f64;
        let mut below = self.corners(0);
        let reach = |all: &[DVec2]| all.iter().map(|p| p.length()).fold(0.0, f64::max);
        for k in 1..=self.slices {
            let here = self.corners(k);
            let radius = reach(&below).max(reach(&here));
            let mut first = 0;
            for ring in self.rings {
                for i in 0..ring.len() {
                    let (a, b) = (first + i, first + (i + 1) % ring.len());
                    most = most.max(0.25 * (below[a] + here[b] - below[b] - here[a]).length());
                }
                first += ring.len();
            }
            most = most.max(radius * (1.0 - libm::cos(0.5 * turned)));
            below = here;
        }
        if turned > 0.0 { 2.0 * most } else { most }
    }
}

/// An upper end that is a line along x or y: walls of either side meet there, and must have the same edges. So every side of the
/// outline has a corner wherever another one has, seen along that line.
struct Ridge {
    axis: usize,
    /// Where corners are along it, in order.
    levels: Vec<f64>,
    /// Levels nearer than this are one.
    near: f64,
}

impl Ridge {
    /// That of an extrusion, and its outline with all the corners; `None` where the end is no line.
    fn of(extrusion: &Extrusion, rings: &[Vec<DVec2>]) -> Option<(Self, Vec<Vec<DVec2>>)> {
        let axis = match (extrusion.scale.x == 0.0, extrusion.scale.y == 0.0) {
            (true, false) => 1,
            (false, true) => 0,
            (true, true) | (false, false) => return None,
        };
        let x = direction(-extrusion.twist);
        let along = |p: DVec2| (extrusion.scale * x.rotate(p))[axis];
        let mut levels: Vec<f64> = rings.iter().flatten().map(|p| along(*p)).collect();
        levels.sort_by(f64::total_cmp);
        let near = ROUNDING * levels.iter().fold(0.0, |m: f64, l| m.max(l.abs()));
        levels.dedup_by(|a, b| *a - *b <= near);
        let ridge = Self { axis, levels, near };
        let cut = |ring: &Vec<DVec2>| {
            let mut all = Vec::with_capacity(ring.len());
            for (i, a) in ring.iter().enumerate() {
                let b = ring[(i + 1) % ring.len()];
                all.push(*a);
                let (from, to) = (along(*a), along(b));
                let (low, high) = (from.min(to) + near, from.max(to) - near);
                let between = ridge.levels.iter().filter(|l| (low..=high).contains(*l));
                let mut ways: Vec<f64> = between.map(|l| (l - from) / (to - from)).collect();
                if from > to {
                    ways.reverse();
                }
                all.extend(ways.into_iter().map(|t| *a + (b - *a) * t));
            }
            all
        };
        let rings = rings.iter().map(cut).collect();
        Some((ridge, rings))
    }

    /// Triangles with an edge on the ridge cut at every corner there, so that those of either side have the same edges.
    fn fanned(&self, all: &[[u32; 3]], (up, high): (usize, &[DVec2])) -> Vec<[u32; 3]> {
        // One corner of each level.
        let level = |p: &DVec2| self.levels.partition_point(|l| *l < p[self.axis]);
        let mut corner = vec![0; self.levels.len() + 1];
        high.iter().enumerate().rev().for_each(|(i, p)| corner[level(p)] = (up + i) as u32);
        let mut fans = Vec::with_capacity(2 * all.len());
        for t in all {
            let above = (0..3).find(|k| t[*k] as usize >= up && t[(k + 1) % 3] as usize >= up);
            let Some(k) = above else {
                fans.push(*t);
                continue;
            };
            let [from, to] = [k, (k + 1) % 3].map(|k| level(&high[t[k] as usize - up]));
            let mut way: Vec<u32> = corner[from.min(to)..=from.max(to)].to_vec();
            if from > to {
                way.reverse();
            }
            fans.extend(way.windows(2).map(|w| [w[0], w[1], t[(k + 2) % 3]]));
        }
        fans
    }

    /// Triangles without those that lie on each other the other way round, as walls do that begin in one corner; `at` tells of a
    /// point whether it is of the end, and where it is.
    fn without_doubles(&self, all: &[[u32; 3]], at: &dyn Fn(u32) -> (bool, DVec2)) -> Vec<Vec<u32>> {
        // Where each stands over the ridge: its corner below, and how often more it runs up than down.
        let mut over: HashMap<[u64; 4], i32> = HashMap::new();
        let place = |t: &[u32; 3]| {
            let corners = t.map(at);
            let k = (0..3).find(|k| corners[*k].0 && corners[(k + 1) % 3].0)?;
            let [one, two] = [k, (k + 1) % 3].map(|k| corners[k].1[self.axis]);
            let below = corners[(k + 2) % 3].1;
            Some(([below.x, below.y, one.min(two), one.max(two)].map(f64::to_bits), if one < two { 1 } else { -1 }))
        };
        all.iter().filter_map(place).for_each(|(key, way)| *over.entry(key).or_default() += way);
        let mut kept = |t: &&[u32; 3]| {
            let Some((key, way)) = place(t) else { return true };
            let left = over.entry(key).or_default();
            let keep = *left * way > 0;
            *left -= if keep { way } else { 0 };
            keep
        };
        all.iter().filter(|t| kept(t)).map(|t| t.to_vec()).collect()
    }

    /// A corner of the end, at its level.
    fn levelled(&self, mut p: DVec2) -> DVec2 {
        let x = &mut p[self.axis];
        let i = self.levels.partition_point(|l| *l < *x - 2.0 * self.near);
        *x = self.levels.get(i).copied().unwrap_or(*x);
        p
    }
}

/// Twice the area, positive counter-clockwise.
fn area(ring: &[DVec2]) -> f64 {
    (0..ring.len()).map(|i| (ring[i] - ring[0]).perp_dot(ring[(i + 1) % ring.len()] - ring[0])).sum()
}

#[cfg(test)]
mod tests {
    use crate::import::{Facets, Import, Limits, import_csg};
    use crate::math::random::Random;
    use glam::{DVec2, DVec3};

    fn read(text: &str) -> Import {
        import_csg("m.csg", text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{text}: {e}"))
    }

    /// The number behind a word of the note about bent walls.
    fn told(import: &Import, behind: &str) -> f64 {
        let bent = |text: &str| {
            ["linear_extrude with bent walls", "linear_extrude to a line"].iter().any(|b| text.starts_with(b))
        };
        let note = import.notes.iter().find(|n| bent(&n.text)).expect("a note");
        let text = &note.text[note.text.find(behind).expect("the word") + behind.len()..];
        text.split([' ', ',']).next().expect("a number").parse().expect("a number")
    }

    fn crossings(path: &[DVec2], p: DVec2) -> usize {
        let edges = (0..path.len()).map(|i| (path[i], path[(i + 1) % path.len()]));
        edges.filter(|(a, b)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y)).count()
    }

    fn distance(path: &[DVec2], p: DVec2) -> f64 {
        let edges = (0..path.len()).map(|i| (path[i], path[(i + 1) % path.len()]));
        edges.fold(f64::INFINITY, |least, (a, b)| {
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            least.min((a + (b - a) * t - p).length())
        })
    }

    #[test]
    fn twisted_and_unevenly_scaled_outlines_are_the_outline_turned_and_scaled_at_each_height() {
        let mut r = Random(31);
        let rounds =
            std::env::var("CONTACTD_OUTLINES").ok().and_then(|n| n.parse().ok()).map_or(6, |n: usize| n.max(12));
        for round in 0..rounds {
            let ring = |size: f64, r: &mut Random| -> Vec<DVec2> {
                let n = 3 + (r.unit() * 7.0) as usize;
                let at = |i: usize| libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
                (0..n).map(|i| DVec2::new(at(i).1, at(i).0) * size * r.within(0.6, 1.0)).collect()
            };
            let aside = DVec2::new(r.within(-4.0, 4.0), r.within(-4.0, 4.0));
            let rings: Vec<Vec<DVec2>> =
                [3.0, 1.0].map(|s| ring(s, &mut r).into_iter().map(|p| p + aside).collect()).into();
            let (height, mut scale) = (r.within(1.0, 9.0), [r.within(0.3, 2.0), r.within(0.3, 2.0)]);
            // An end that is a line.
            if 2 * round >= rounds {
                scale[round % 2] = 0.0;
            }
            let twist = if round % 4 == 0 { 0.0 } else { r.within(-300.0, 300.0) };
            let center = round % 2 == 0;
            let points: Vec<[f64; 2]> = rings.iter().flatten().map(|p| p.to_array()).collect();
            let (first, all): (Vec<usize>, Vec<usize>) = ((0..rings[0].len()).collect(), (0..points.len()).collect());
            let paths = [&first[..], &all[rings[0].len()..]];
            let text = format!(
                "linear_extrude(height = {height}, center = {center}, twist = {twist}, scale = {scale:?}, slices = 40) \
                 {{ polygon({points:?}, {paths:?}); }}"
            );
            let import = read(&text);
            let off = told(&import, "max deviation ") * 1.01 + 1e-9;
            let b = import.solid.aabb();
            let mut sure = [0, 0];
            for _ in 0..400 {
                let x = b.center() + r.vector(1.0) * 1.1 * b.half();
                let low = if center { -0.5 * height } else { 0.0 };
                let t = (x.z - low) / height;
                let f = import.solid.value(x);
                // A wall that leans lies off sideways by more than the facets do.
                if !(0.0..1.0).contains(&t) {
                    assert!(f > 0.0, "{x}, f {f}: {text}");
                    continue;
                }
                let (sin, cos) = libm::sincos((-twist * t).to_radians());
                let here = |p: DVec2| {
                    let s = DVec2::new(1.0 + (scale[0] - 1.0) * t, 1.0 + (scale[1] - 1.0) * t);
                    s * DVec2::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y)
                };
                let outlines: Vec<Vec<DVec2>> =
                    rings.iter().map(|ring| ring.iter().map(|p| here(*p)).collect()).collect();
                let q = x.truncate();
                if outlines.iter().any(|o| distance(o, q) <= off) {
                    continue;
                }
                let inside = outlines.iter().map(|o| crossings(o, q)).sum::<usize>() % 2 == 1;
                assert_eq!(f < 0.0, inside, "{x}, f {f}, facets within {off}: {text}");
                sure[usize::from(inside)] += 1;
            }
            assert!(sure[0] > 50 && sure[1] > 2, "{sure:?}: {text}");
        }
    }

    #[test]
    fn slices_are_those_of_openscad() {
        let square = |arguments: &str| format!("linear_extrude({arguments}) {{ square(10, center = true); }}");
        // Two facets a wall and slice, and room for the caps.
        for (arguments, slices) in [
            ("height = 10, twist = 90, slices = 7", 7.0),
            ("height = 10, twist = -90, $fn = 30", 8.0),
            ("height = 10, twist = 90, $fn = 0, $fa = 12, $fs = 2", 8.0),
            ("height = 10, twist = 90, $fn = 0, $fa = 12, $fs = 4", 4.0),
            ("height = 10, twist = 360, $fn = 1", 3.0),
            ("height = 10, twist = 90, scale = 0.5, $fn = 0, $fa = 1, $fs = 1", 14.0),
        ] {
            let facets = told(&read(&square(arguments)), "faceted, ");
            assert_eq!(facets, 8.0 * (slices + 1.0), "{arguments}");
        }
        let turned = "multmatrix([[0.8, -0.6, 0, 0], [0.6, 0.8, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) { square(10); }";
        for (arguments, slices) in [("$fn = 6", 6.0), ("$fn = 0, $fs = 2", 8.0)] {
            let text = format!("linear_extrude(height = 12, scale = [2, 1], {arguments}) {{ {turned} }}");
            assert_eq!(told(&read(&text), "faceted, "), 8.0 * (slices + 1.0), "{arguments}");
        }
    }

    #[test]
    fn ends_that_are_a_point_or_a_line_and_slices_that_are_too_coarse_load() {
        let value = |text: &str, x: [f64; 3]| read(text).solid.value(DVec3::from_array(x));
        let point = "linear_extrude(height = 10, twist = 90, scale = 0) { square(10, center = true); }";
        assert!(value(point, [0.0, 0.0, 9.0]) < 0.0 && value(point, [1.0, 0.0, 9.5]) > 0.0);
        let line = "linear_extrude(height = 10, scale = [1, 0], slices = 5) { circle(5); }";
        assert!(value(line, [0.0, 0.0, 9.5]) < 0.0 && value(line, [4.0, 0.0, 9.9]) < 0.0);
        assert!(value(line, [4.0, 1.0, 8.0]) > 0.0 && value(line, [0.0, 1.0, 9.5]) > 0.0);
        let coarse = "linear_extrude(height = 1, twist = 400, slices = 2) { polygon([[0.93, 0], [0.494, 0.855], \
                      [-2.343, 4.059], [-4.726, 0], [-0.476, -0.825], [2.276, -3.943]]); }";
        assert!(read(coarse).notes.iter().any(|n| n.text.contains("slices in place of 2, whose facets cross")));
        // What needs no facets has none.
        let wedge = read("linear_extrude(height = 10, scale = [2, 1], $fn = 8) { square(10); }");
        assert!(wedge.notes.is_empty() && wedge.solid.primitives.len() == 1, "{:?}", wedge.notes);
    }
}
