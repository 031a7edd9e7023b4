//! Flat shapes together: as paths, their hull, their sum.

use super::flat::{Flat, Outline};
use super::hull::{Disc, disc_hull};
use super::meshed::guarded;
use super::parts::{Part, PartId, Parts};
use super::polygon::{Region, overlay, triangles, turn};
use super::{Place, Problem};
use crate::solid::Op;
use glam::{DAffine3, DVec2, DVec3};
use manifold_rust::cross_section::CrossSection;
use manifold_rust::linalg::Vec2;
use manifold_rust::types::OpType;
use smallvec::SmallVec;
use std::collections::HashMap;

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// A shape in the plane's own coordinates.
pub fn flat(like: &Flat, outline: Outline, center: DVec2) -> Part {
    Part::Flat(Box::new(like.with(outline, DAffine3::from_translation(center.extend(0.0)))))
}

/// Some discs and the polygon of their tangent points, as parts.
pub fn hull_parts(parts: &mut Parts<'_>, like: &Flat, discs: &[Disc]) -> Vec<PartId> {
    let hull = disc_hull(discs);
    let mut made = Vec::new();
    if hull.corners.len() >= 3 {
        made.push(parts.push(flat(like, Outline::Paths(vec![hull.corners]), DVec2::ZERO)));
    }
    for d in hull.discs {
        made.push(parts.push(flat(like, Outline::Circle(d.radius), d.center)));
    }
    made
}

/// The leaves below some parts, in order.
pub fn flats(parts: &Parts<'_>, roots: &[PartId]) -> Vec<PartId> {
    let mut stack: Vec<PartId> = roots.iter().rev().copied().collect();
    let mut found = Vec::new();
    while let Some(p) = stack.pop() {
        match &parts.list[p] {
            Part::Flat(_) => found.push(p),
            Part::Op(_, _, of) => stack.extend(of.iter().rev()),
            Part::Empty | Part::Leaf(..) | Part::Stray(..) => {}
        }
    }
    found
}

/// The flat shape of a leaf.
pub fn flat_of<'p>(parts: &'p Parts<'_>, id: PartId) -> Option<&'p Flat> {
    match &parts.list[id] {
        Part::Flat(flat) => Some(flat),
        Part::Empty | Part::Leaf(..) | Part::Stray(..) | Part::Op(..) => None,
    }
}

/// Tells that round shapes are taken as polygons, by whom; nothing where none is round.
pub fn note_facets(parts: &mut Parts<'_>, at: Place, leaves: &[PartId], who: &str) {
    note_stretched_facets(parts, at, leaves, who, 1.0);
}

/// The same of what is then made longer, `stretch` times at most.
pub fn note_stretched_facets(parts: &mut Parts<'_>, at: Place, leaves: &[PartId], who: &str, stretch: f64) {
    let round = leaves.iter().filter_map(|l| flat_of(parts, *l)).filter(|f| matches!(f.outline, Outline::Circle(_)));
    let (count, sides, off) = round.fold((0, 0, 0.0_f64), |(n, s, d), f| (n + 1, s + f.pieces, d.max(f.deviation())));
    if count > 0 {
        parts.faceted(at, &format!("{count} circle(s) of {who}"), sides as usize, off * stretch);
    }
}

/// The union of some parts as closed paths, by the even-odd rule; circles as polygons, with a note that names `who` needs it.
pub fn paths(parts: &mut Parts<'_>, at: Place, roots: &[PartId], who: &str) -> Result<Vec<Vec<DVec2>>> {
    let leaves = flats(parts, roots);
    note_facets(parts, at, &leaves, who);
    let of_each: Vec<Vec<Vec<DVec2>>> = leaves.iter().filter_map(|l| flat_of(parts, *l)).map(Flat::paths).collect();
    let corners = of_each.iter().flatten().map(Vec::len).sum();
    parts.meshable(at, corners)?;
    if let ([one], [root]) = (of_each.as_slice(), roots)
        && leaves[0] == *root
    {
        return Ok(one.clone());
    }
    // Operands before operations, each by its place among the leaves or in this order.
    let place: HashMap<PartId, usize> = leaves.iter().enumerate().map(|(i, l)| (*l, i)).collect();
    let mut order = Vec::new();
    let mut stack: Vec<(PartId, bool)> = roots.iter().map(|r| (*r, false)).collect();
    while let Some((p, done)) = stack.pop() {
        match &parts.list[p] {
            Part::Op(_, _, of) if !done => {
                stack.push((p, true));
                stack.extend(of.iter().map(|c| (*c, false)));
            }
            Part::Empty | Part::Leaf(..) | Part::Flat(_) | Part::Stray(..) | Part::Op(..) => order.push(p),
        }
    }
    if parts.affordable(at, corners).is_err() {
        return clipped(parts, at, roots, &order, (&of_each, &place));
    }
    let within = Within::of(parts, &order, roots, &place);
    let inside = |of: &[bool]| within.holds(of);
    overlay(&of_each, &inside).ok_or_else(|| (at, crossing()))
}

/// What a point is in of some parts, each by its place in an order that has operands before operations.
struct Within {
    steps: Vec<Step>,
    roots: Vec<usize>,
}

enum Step {
    /// The leaf of a number.
    Flat(usize),
    Op(Op, Vec<usize>),
    Nothing,
}

impl Within {
    fn of(parts: &Parts<'_>, order: &[PartId], roots: &[PartId], leaves: &HashMap<PartId, usize>) -> Self {
        // Of a part that is there twice the first counts, which stands before all that have it.
        let mut at: HashMap<PartId, usize> = HashMap::with_capacity(order.len());
        order.iter().enumerate().for_each(|(i, p)| _ = at.entry(*p).or_insert(i));
        let step = |p: &PartId| match &parts.list[*p] {
            Part::Flat(_) => Step::Flat(leaves[p]),
            Part::Op(op, _, of) => Step::Op(*op, of.iter().map(|c| at[c]).collect()),
            Part::Empty | Part::Leaf(..) | Part::Stray(..) => Step::Nothing,
        };
        Self { steps: order.iter().map(step).collect(), roots: roots.iter().map(|r| at[r]).collect() }
    }

    /// True where a point is inside that lies in some of the leaves.
    fn holds(&self, of: &[bool]) -> bool {
        let mut truth: SmallVec<[bool; 64]> = SmallVec::with_capacity(self.steps.len());
        for step in &self.steps {
            truth.push(match step {
                Step::Flat(leaf) => of[*leaf],
                Step::Op(Op::Union, c) => c.iter().any(|c| truth[*c]),
                Step::Op(Op::Intersection, c) => !c.is_empty() && c.iter().all(|c| truth[*c]),
                Step::Op(Op::Difference, c) => {
                    c.first().is_some_and(|f| truth[*f]) && !c.iter().skip(1).any(|c| truth[*c])
                }
                Step::Nothing => false,
            });
        }
        self.roots.iter().any(|r| truth[*r])
    }
}

/// The same of more corners than can be held against each other one by one: by Clipper (of manifold-rust), as in OpenSCAD, on a grid
/// of about 1e-12 of the size.
fn clipped(
    parts: &Parts<'_>,
    at: Place,
    roots: &[PartId],
    order: &[PartId],
    (of_each, place): (&[Vec<Vec<DVec2>>], &HashMap<PartId, usize>),
) -> Result<Vec<Vec<DVec2>>> {
    let grid = Grid::of(of_each.iter().flatten().flatten().copied());
    let mut made: HashMap<PartId, CrossSection> = HashMap::with_capacity(order.len());
    for p in order {
        let section = match &parts.list[*p] {
            Part::Flat(_) => {
                let region = Region::of_paths(&of_each[place[p]]);
                if region.open {
                    return Err((at, crossing()));
                }
                grid.section(&region.rings)
            }
            Part::Op(op, _, of) => {
                let all: Vec<CrossSection> = of.iter().filter_map(|c| made.remove(c)).collect();
                let how = match op {
                    Op::Union => OpType::Add,
                    Op::Intersection => OpType::Intersect,
                    Op::Difference => OpType::Subtract,
                };
                guarded(at, || CrossSection::batch_boolean(&all, how))?
            }
            Part::Empty | Part::Leaf(..) | Part::Stray(..) => CrossSection::default(),
        };
        made.insert(*p, section);
    }
    let all: Vec<CrossSection> = roots.iter().filter_map(|r| made.remove(r)).collect();
    Ok(grid.paths(&guarded(at, || CrossSection::batch_boolean(&all, OpType::Add))?))
}

/// A scale at which Clipper, which counts in millionths, moves corners by no more than about 1e-12 of the size.
pub struct Grid(f64);

impl Grid {
    /// That of some points.
    pub fn of(points: impl Iterator<Item = DVec2>) -> Self {
        let size = points.fold(f64::MIN_POSITIVE, |m, p| m.max(p.abs().max_element()));
        // A power of two rounds nothing.
        Self((1e6 / size).log2().floor().exp2())
    }

    /// A length on it.
    pub fn length(&self, length: f64) -> f64 {
        length * self.0
    }

    /// Rings that run with the inside on their left.
    pub fn section(&self, rings: &[Vec<DVec2>]) -> CrossSection {
        let polygon = |ring: &Vec<DVec2>| ring.iter().map(|p| Vec2::new(p.x * self.0, p.y * self.0)).collect();
        CrossSection::new(rings.iter().map(polygon).collect())
    }

    /// The rings of a section.
    pub fn paths(&self, section: &CrossSection) -> Vec<Vec<DVec2>> {
        let path = |p: Vec<Vec2>| p.into_iter().map(|v| DVec2::new(v.x, v.y) / self.0).collect();
        section.to_polygons().into_iter().map(path).collect()
    }
}

/// Some parts without the holes in them.
pub fn filled(parts: &mut Parts<'_>, at: Place, like: &Flat, roots: &[PartId]) -> Result<Part> {
    let leaves = flats(parts, roots);
    let is_path = |l: &PartId| flat_of(parts, *l).is_some_and(|f| matches!(f.outline, Outline::Paths(_)));
    if leaves.len() == 1 && !leaves.iter().any(is_path) {
        return Ok(Part::Op(Op::Union, at, roots.to_vec()));
    }
    let region = Region::of_paths(&paths(parts, at, roots, "fill")?);
    if region.open {
        return Err((at, crossing()));
    }
    let area = |ring: &[DVec2]| -> f64 {
        (0..ring.len()).map(|i| (ring[i] - ring[0]).perp_dot(ring[(i + 1) % ring.len()] - ring[0])).sum()
    };
    let mut outer: Vec<Vec<DVec2>> = region.rings.into_iter().filter(|r| area(r) > 0.0).collect();
    outer.sort_by(|a, b| area(b).total_cmp(&area(a)));
    let mut kept: Vec<Vec<DVec2>> = Vec::with_capacity(outer.len());
    for ring in outer {
        // Rings touch at corners at most: the middle of a side tells whether all of one lies in a hole.
        let middle = (ring[0] + ring[1]) * 0.5;
        if !kept.iter().any(|k| surrounds(k, middle)) {
            kept.push(ring);
        }
    }
    let made = kept.into_iter().map(|ring| parts.push(flat(like, Outline::Paths(vec![ring]), DVec2::ZERO))).collect();
    Ok(Part::Op(Op::Union, at, made))
}

/// Does a point lie within a ring?
fn surrounds(ring: &[DVec2], p: DVec2) -> bool {
    let sides = (0..ring.len()).map(|i| (ring[i], ring[(i + 1) % ring.len()]));
    let crossed = sides.filter(|(a, b)| {
        let (low, high) = if a.y < b.y { (*a, *b) } else { (*b, *a) };
        low.y <= p.y && p.y < high.y && turn(low, high, p) > 0.0
    });
    crossed.count() % 2 == 1
}

/// What to say of paths that make no closed rings.
pub fn crossing() -> Problem {
    Problem::syntax("outlines whose crossings a double can tell", "sides that nearly lie on each other")
}

/// Discs and points whose hull is that of some parts; circles that are none any more as points, with a note.
fn discs(parts: &mut Parts<'_>, at: Place, roots: &[PartId], who: &str) -> Result<Vec<Disc>> {
    let points = |paths: Vec<Vec<DVec2>>| paths.into_iter().flatten().map(|center| Disc { center, radius: 0.0 });
    let mut discs = Vec::new();
    for root in roots {
        let Some((leaves, false)) = parts.leaves(*root) else {
            discs.extend(points(paths(parts, at, &[*root], who)?));
            continue;
        };
        for leaf in leaves {
            let Some((disc, paths)) = flat_of(parts, leaf).map(|f| (f.disc(), f.paths())) else { continue };
            match disc {
                Some(disc) => discs.push(disc),
                None => {
                    note_facets(parts, at, &[leaf], who);
                    discs.extend(points(paths));
                }
            }
        }
    }
    Ok(discs)
}

/// The hull of some parts.
pub fn hull(parts: &mut Parts<'_>, at: Place, like: &Flat, roots: &[PartId]) -> Result<Part> {
    let discs = discs(parts, at, roots, "hull")?;
    parts.affordable(at, discs.len())?;
    let made = hull_parts(parts, like, &discs);
    if made.is_empty() {
        parts.note(at, "a hull without area: left out, as OpenSCAD does", None);
        return Ok(Part::Empty);
    }
    Ok(Part::Op(Op::Union, at, made))
}

/// The sum of some operands about the plane point `origin`, which each of them was moved by: the union of the sums of their convex
/// pieces. Of one operand that is itself.
pub fn minkowski(parts: &mut Parts<'_>, at: Place, like: &Flat, operands: &[PartId], origin: DVec3) -> Result<Part> {
    if let [one] = operands {
        return Ok(Part::Op(Op::Union, at, vec![*one]));
    }
    let origin = origin.truncate();
    let mut sums: Vec<Vec<Disc>> = vec![vec![Disc { center: origin, radius: 0.0 }]];
    let mut cut = false;
    for operand in operands {
        let (pieces, more) = convex_pieces(parts, at, *operand)?;
        cut |= more;
        let mut next = Vec::with_capacity(sums.len() * pieces.len());
        for sum in &sums {
            for piece in &pieces {
                let all = sum.iter().flat_map(|a| {
                    piece.iter().map(|b| Disc { center: a.center + b.center - origin, radius: a.radius + b.radius })
                });
                next.push(all.collect());
            }
        }
        sums = next;
        let corners = sums.iter().map(Vec::len).sum();
        if cut { parts.meshable(at, corners)? } else { parts.affordable(at, corners)? }
    }
    if cut && sums.iter().flatten().all(|disc| disc.radius == 0.0) {
        return united(parts, at, like, &sums);
    }
    parts.affordable(at, sums.iter().map(Vec::len).sum())?;
    let mut made = Vec::new();
    for sum in sums {
        made.extend(hull_parts(parts, like, &sum));
    }
    Ok(Part::Op(Op::Union, at, made))
}

/// The union of the hulls of some sets of points as one outline, for there are many of them: by Clipper.
fn united(parts: &mut Parts<'_>, at: Place, like: &Flat, sums: &[Vec<Disc>]) -> Result<Part> {
    let grid = Grid::of(sums.iter().flatten().map(|d| d.center));
    let hull = |sum: &Vec<Disc>| disc_hull(sum).corners;
    let all: Vec<CrossSection> = sums.iter().map(hull).filter(|h| h.len() >= 3).map(|h| grid.section(&[h])).collect();
    let paths = grid.paths(&guarded(at, || CrossSection::batch_boolean(&all, OpType::Add))?);
    if paths.is_empty() {
        parts.note(at, "a minkowski without area: left out, as OpenSCAD does", None);
        return Ok(Part::Empty);
    }
    Ok(flat(like, Outline::Paths(paths), DVec2::ZERO))
}

/// Convex pieces of which an operand consists; whether what is not convex had to be cut into triangles for that.
fn convex_pieces(parts: &mut Parts<'_>, at: Place, operand: PartId) -> Result<(Vec<Vec<Disc>>, bool)> {
    let point = |center: &DVec2| Disc { center: *center, radius: 0.0 };
    let (mut pieces, mut cut) = (Vec::new(), false);
    let mut of_paths = |paths: &[Vec<DVec2>]| {
        let region = Region::of_paths(paths);
        if region.open {
            return Err((at, crossing()));
        }
        if region.is_convex() {
            pieces.push(region.islands[0].hull.iter().map(point).collect());
            return Ok(());
        }
        cut = true;
        let corners: Vec<DVec2> = region.rings.iter().flatten().copied().collect();
        pieces.extend(triangles(&region.rings).iter().map(|t| t.iter().map(|i| point(&corners[*i])).collect()));
        Ok(())
    };
    let Some((leaves, false)) = parts.leaves(operand) else {
        of_paths(&paths(parts, at, &[operand], "minkowski")?)?;
        return Ok((pieces, cut));
    };
    let mut whole = Vec::new();
    for leaf in leaves {
        let Some((disc, paths)) = flat_of(parts, leaf).map(|f| (f.disc(), f.paths())) else { continue };
        if let Some(disc) = disc {
            whole.push(vec![disc]);
            continue;
        }
        note_facets(parts, at, &[leaf], "minkowski");
        of_paths(&paths)?;
    }
    pieces.extend(whole);
    Ok((pieces, cut))
}

#[cfg(test)]
mod tests {
    use crate::import::{Facets, Limits, import_csg};
    use crate::math::random::Random;
    use glam::{DVec2, DVec3};

    fn inside(ring: &[DVec2], p: DVec2) -> bool {
        let sides = (0..ring.len()).map(|i| (ring[i], ring[(i + 1) % ring.len()]));
        let crossed =
            sides.filter(|(a, b)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y));
        crossed.count() % 2 == 1
    }

    /// Whether two rings have a point in common.
    fn meet(a: &[DVec2], b: &[DVec2]) -> bool {
        let sides = |r: &[DVec2]| -> Vec<[DVec2; 2]> { (0..r.len()).map(|i| [r[i], r[(i + 1) % r.len()]]).collect() };
        let cross = |[p, q]: [DVec2; 2], [s, t]: [DVec2; 2]| {
            let side = |x: DVec2, y: DVec2, z: DVec2| (y - x).perp_dot(z - x);
            side(p, q, s) * side(p, q, t) <= 0.0 && side(s, t, p) * side(s, t, q) <= 0.0
        };
        inside(a, b[0]) || inside(b, a[0]) || sides(a).iter().any(|s| sides(b).iter().any(|t| cross(*s, *t)))
    }

    /// A point is in the sum of A and B where A meets B, turned by half a turn, about it.
    #[test]
    fn sums_of_outlines_that_are_not_convex_hold_where_one_meets_the_other_turned_about_the_point() {
        let mut r = Random(9);
        let limits = Limits::default();
        for round in 0..40 {
            let ring = |size: f64, r: &mut Random| -> Vec<DVec2> {
                let n = 3 + (r.unit() * 8.0) as usize;
                let at = |i: usize| libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
                let aside = DVec2::new(r.within(-2.0, 2.0), r.within(-2.0, 2.0));
                (0..n).map(|i| DVec2::new(at(i).1, at(i).0) * size * r.within(0.2, 1.0) + aside).collect()
            };
            let (a, b) = (ring(4.0, &mut r), ring(1.5, &mut r));
            let list = |ring: &[DVec2]| format!("{:?}", ring.iter().map(|p| p.to_array()).collect::<Vec<_>>());
            // As a polygon, or as what is left of a square.
            let wrapped = |ring: &str| match round % 2 {
                0 => format!("polygon({ring});"),
                _ => format!("intersection() {{ square(40, center = true); polygon({ring}); }}"),
            };
            let text = format!(
                "linear_extrude(height = 1) {{ minkowski() {{ {} polygon({}); }} }}",
                wrapped(&list(&a)),
                list(&b)
            );
            let import = import_csg("m.csg", &text, Facets::Auto, &limits).unwrap_or_else(|e| panic!("{text}: {e}"));
            let bounds = import.solid.aabb();
            let mut seen = [0, 0];
            for _ in 0..400 {
                let p = bounds.center() + r.vector(1.1) * bounds.half();
                let p = DVec3::new(p.x, p.y, 0.5);
                let turned = |by: f64| -> Vec<DVec2> { b.iter().map(|q| p.truncate() - *q * by).collect() };
                let f = import.solid.value(p);
                let truth = meet(&a, &turned(1.0));
                if f.abs() > 1e-6 {
                    assert_eq!(f < 0.0, truth, "{p}, f {f}: {text}");
                    seen[usize::from(truth)] += 1;
                }
            }
            assert!(seen[0] > 20 && seen[1] > 20, "{seen:?}: {text}");
        }
    }

    /// The same of prisms, one of them moved, so that it does not hold the origin.
    #[test]
    fn sums_of_solids_hold_where_one_meets_the_other_turned_about_the_point() {
        let mut r = Random(10);
        for round in 0..16 {
            let ring = |size: f64, least: f64, r: &mut Random| -> Vec<DVec2> {
                let n = 3 + (r.unit() * 3.0) as usize;
                let at = |i: usize| libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
                (0..n).map(|i| DVec2::new(at(i).1, at(i).0) * size * r.within(least, 1.0)).collect()
            };
            // The second is convex, or not.
            let (a, b) = (ring(4.0, 0.1, &mut r), ring(1.5, if round % 2 == 0 { 1.0 } else { 0.2 }, &mut r));
            let shift = r.vector(1.0) * 6.0;
            let list = |ring: &[DVec2]| format!("{:?}", ring.iter().map(|p| p.to_array()).collect::<Vec<_>>());
            let prism = |ring: &[DVec2], h: f64| format!("linear_extrude(height = {h}) {{ polygon({}); }}", list(ring));
            let moved = format!(
                "multmatrix([[1, 0, 0, {}], [0, 1, 0, {}], [0, 0, 1, {}], [0, 0, 0, 1]]) {{ {} }}",
                shift.x,
                shift.y,
                shift.z,
                prism(&b, 1.0)
            );
            let mut both = [prism(&a, 2.0), moved];
            if round % 4 > 1 {
                both.reverse();
            }
            let text = format!("minkowski() {{ {} }}", both.concat());
            let import = import_csg("m.csg", &text, Facets::Auto, &Limits::default());
            let import = import.unwrap_or_else(|e| panic!("{text}: {e}"));
            let bounds = import.solid.aabb();
            let mut seen = [0, 0];
            for _ in 0..400 {
                let p = bounds.center() + r.vector(1.1) * bounds.half();
                let q = p - shift;
                let turned: Vec<DVec2> = b.iter().map(|b| q.truncate() - *b).collect();
                let truth = (0.0..=3.0).contains(&q.z) && meet(&a, &turned);
                let f = import.solid.value(p);
                if f.abs() > 1e-6 {
                    assert_eq!(f < 0.0, truth, "{p}, f {f}: {text}");
                    seen[usize::from(truth)] += 1;
                }
            }
            assert!(seen[0] > 20 && seen[1] > 20, "{seen:?}: {text}");
        }
    }
}
