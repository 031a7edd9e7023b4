//! All regions in which two bodies touch at an instant: points, lines, patches, each with the points that bound it.
//!
//! Two bodies touch where their surfaces are within a threshold of each other, `tau`: the pair's margin, or twice the
//! resolution. `separation` covers what may touch by boxes, proven to hold all of it; a box is halved until few faces
//! are left in it. From the faces of the boxes, in this order,
//!
//! * patches: two faces lie on each other (`surface`); told by the corners of their common area (`patch`);
//! * lines: an edge lies on a face or an edge, or round faces touch along a ruling or a circle (`line`);
//! * points: what touches nowhere else (`point`).
//!
//! Two polytopes are told by their corners (`polytopes`), two convex bodies that lie on each other with flat faces by the outlines of
//! these (`flat`), those that touch in one point or along one straight line by that (`single`): all without
//! these boxes.
//!
//! All points are roots of the faces' own equations and are confirmed by both whole trees: nothing is sampled. Faces that
//! make up one surface (abutting operands of a union) count as one. Regions and their points are ordered by face ids and
//! by directions fixed in the bodies, never by position, so that a body at rest has the same list from step to step.
//!
//! Not promised: a line along which two cones touch side by side, or one along a curve that is neither straight nor
//! circular, comes as points; isolated points closer to each other than 1/24 of the smaller body's radius may come as one; and
//! rulings or edges of convex bodies that cross by more than 15 degrees as one point, however large the threshold.

mod ball;
mod flat;
mod line;
mod local;
mod patch;
mod point;
mod polytope;
mod polytopes;
mod single;
mod surface;

use crate::contact::distance::{self, DistanceQuery};
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::depth;
use crate::contact::instant::separation::{Cover, Place};
use crate::contact::instant::work::Work;
use crate::contact::query::outcome::{ContactKind, ContactPoint, Extent, NO_FACE, Outcome, Verdict};
use crate::contact::query::question::PairQuery;
use crate::contact::query::task::Task;
use crate::math::halt;
use crate::motion::relative::Instant;
use glam::DVec3;
use line::Candidate;
pub use local::REACH;
use local::{Bodies, Lit};
use patch::Corner;
use point::Meeting;
use std::collections::BTreeMap;
use surface::{FacePair, Standing, same_surface};

/// A point of a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionPoint {
    /// Half way between the surfaces; world frame.
    pub point: DVec3,
    /// Distance of the surfaces there, along the normal.
    pub separation: f64,
}

/// Where two bodies touch without interruption.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Which features meet.
    pub kind: ContactKind,
    /// Point, line or patch.
    pub extent: Extent,
    /// Unit normal from a to b, world frame; of a curved patch the mean one.
    pub normal: DVec3,
    /// Faces of a that meet there; `NO_FACE` fills.
    pub faces_a: [u32; 3],
    /// Faces of b.
    pub faces_b: [u32; 3],
    /// What bounds it: one point, two ends (a circle: points all round), the corners of a patch.
    pub points: Vec<RegionPoint>,
}

/// All regions of a pair at an instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Regions {
    /// In a fixed order: patches, lines, points, each by face ids.
    pub regions: Vec<Region>,
    /// False when the work limit cut the search: there may be more.
    pub complete: bool,
    /// Boxes looked at.
    pub cells: u64,
}

impl Regions {
    /// From A's frame at an instant to the world's, and to the order in which the question names the bodies.
    fn turn_to_world(&mut self, task: &Task, at: &Instant, swapped: bool) {
        for r in &mut self.regions {
            r.normal = (at.world_from_a * r.normal).normalize();
            for p in &mut r.points {
                p.point = task.relative.world_point(at, p.point);
            }
            if swapped {
                r.normal = -r.normal;
                std::mem::swap(&mut r.faces_a, &mut r.faces_b);
            }
        }
    }
}

/// Cells' worth of work that one pair's regions may cost, should its cell limit allow more.
pub const MOST_CELLS: u64 = 20_000;
/// A box with no more faces than this, of both sides together, is not halved for their number: 132 sets of them may balance.
const FEW_FACES: usize = 8;
/// So many boxes of few faces show whether two convex bodies touch in a point alone, or not at all.
const FEW_PLACES: usize = 8;
/// Boxes in which curved faces may touch at several points are halved down to this part of the smaller body's radius …
const ROUND: f64 = 1.0 / 24.0;
/// … and those in which many faces run together down to this one, or to where all that is left in them is near.
const SMALLEST: f64 = 1e-3;

/// Pairs of faces of a box that cost as much as a look at one.
const PAIRS_PER_LOOK: usize = 4;

/// Diameters of the smaller body within which two points are one …
const SAME_POINT: f64 = 1e-6;
/// … those by which points are nearer to each other than others, for all that rounding tells …
const NEARER: f64 = 1e-9;
/// … and those of the same faces.
const SAME_FACES: f64 = 1e-4;

/// The threshold of touching for a pair: its margin, at least twice the resolution.
pub fn threshold(resolution: f64, margin: f64) -> f64 {
    margin.max(2.0 * resolution)
}

/// Cells' worth of work that a question allows for one instant.
fn limit(query: &PairQuery) -> u64 {
    query.cell_limit.min(MOST_CELLS)
}

/// All regions in which the bodies of a question touch at `time`: surfaces within `threshold` of each other. Where
/// none is found, since all are farther apart than [`REACH`] of the smaller body, the nearest place is the one region.
pub fn regions(query: &PairQuery, time: f64, threshold: f64) -> Regions {
    let (task, swapped) = Task::of(query);
    if task.a.is_empty() || task.b.is_empty() {
        return Regions { complete: true, ..Regions::default() };
    }
    let at = task.relative.at(time);
    let limit = limit(query);
    // A quarter is kept for the nearest place, so that a pair which touches has at least one region.
    let work = Work::new(limit - limit / 4);
    let bodies = Bodies::new(&task, &at, threshold, &work);
    let mut found = find(&bodies);
    found.cells = work.cells();
    if found.regions.is_empty() {
        let is_near = |m: &Meeting| m.gap <= threshold * (1.0 + SAME_POINT) + bodies.eps;
        // Far from both surfaces F is less than the distance at every edge.
        let mut left = limit.saturating_sub(found.cells);
        let mut far = None;
        if threshold > bodies.tau {
            let cells;
            (far, cells) = nearest_at(query, time, swapped, &bodies, left / 2);
            (found.cells, left) = (found.cells + cells, left.saturating_sub(cells));
        }
        let (nearest, proven) = match far {
            Some(meeting) => (Some(meeting), true),
            None => {
                let rest = Work::new(left);
                let (nearest, proven) = depth::nearest(&task, &at, threshold, depth::BETTER, &rest);
                found.cells += rest.cells();
                (nearest.map(|lowest| single::roughly_nearest(&bodies, &lowest, threshold)), proven)
            }
        };
        found.regions.extend(nearest.filter(is_near).map(|m| point_region(&bodies, &m)));
        found.complete &= proven;
    }
    found.turn_to_world(&task, &at, swapped);
    found
}

/// A way in which regions are found. Where more than one answers they agree, and each can be asked alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Of convex bodies that touch in one point or along one straight line.
    Single,
    /// Of convex bodies that lie on each other with flat faces: by the outlines of these.
    Flat,
    /// Of a ball and any solid: by the feet of its centre.
    Ball,
    /// Of any bodies: by boxes.
    Boxes,
}

/// What one way alone finds at `time`, within the question's cell limit: for who compares it with another one. `None` where the way does
/// not answer; no nearest place stands in where it finds nothing.
pub fn in_one_way(query: &PairQuery, time: f64, threshold: f64, way: Way) -> Option<Regions> {
    let (task, swapped) = Task::of(query);
    let (at, work) = (task.relative.at(time), Work::new(query.cell_limit));
    let bodies = Bodies::new(&task, &at, threshold, &work);
    let whole = |regions| Regions { regions, complete: true, cells: 0 };
    let mut found = match way {
        Way::Single => whole(single::regions(&bodies)?),
        Way::Flat => whole(flat::regions(&bodies)?),
        Way::Ball => whole(ball::regions(&bodies)?),
        Way::Boxes => in_boxes(&bodies),
    };
    found.cells = work.cells();
    found.turn_to_world(&task, &at, swapped);
    Some(found)
}

/// Where two bodies that are farther apart than [`REACH`] are nearest, by their least distance, and the pairs of parts that were
/// looked at; `None` where the work ran out before.
fn nearest_at(query: &PairQuery, time: f64, swapped: bool, bodies: &Bodies, limit: u64) -> (Option<Meeting>, u64) {
    let (a, b) = if swapped { (query.b, query.a) } else { (query.a, query.b) };
    let found = distance::at_instant(&DistanceQuery { a, b, tolerance: SAME_POINT * bodies.size, limit }, time);
    let feet = [found.a.point, found.b.point].map(|x| bodies.task.relative.model_point(bodies.at, x));
    let normal = (feet[1] - feet[0]).try_normalize();
    let meeting = normal.map(|normal| Meeting { feet, normal, gap: found.upper });
    (meeting.filter(|_| found.is_settled), found.cells)
}

/// The regions of an answered question: at the contact, or at the start where the pair touches and does not meet; such a
/// pair's answer gets the separation, normal and features of its nearest region.
pub fn complete(query: &PairQuery, outcome: &mut Outcome, threshold: f64) -> Regions {
    let touching = outcome.touching;
    let found = match &mut outcome.verdict {
        Verdict::Contact(contact) => {
            let mut found = halt::attempt(|| regions(query, contact.time, threshold)).unwrap_or_default();
            if let (Some(p), true) = (&contact.point, found.regions.is_empty()) {
                // A contact that its own faces cannot be followed to: the point is what is known.
                found.regions.push(Region::of_point(p));
                found.complete = false;
            }
            found
        }
        Verdict::Clear { rest, .. } if touching => {
            let found = halt::attempt(|| regions(query, 0.0, threshold)).unwrap_or_default();
            let nearest = found.regions.iter().min_by(|r, s| r.separation().total_cmp(&s.separation()));
            *rest = nearest.map(|r| r.at_rest(query));
            found
        }
        Verdict::Clear { .. } | Verdict::Overlap(_) | Verdict::Undecided { .. } => {
            return Regions { complete: true, ..Regions::default() };
        }
    };
    outcome.counters.instant_cells += found.cells;
    found
}

/// The regions of an answered question that there is no time to look for: the contact's point, where one is known.
pub fn cut_short(outcome: &Outcome) -> Regions {
    let of_contact = outcome.contact().and_then(|contact| contact.point.as_ref());
    Regions { regions: of_contact.map(Region::of_point).into_iter().collect(), ..Regions::default() }
}

impl Region {
    /// The region that a contact's point is.
    fn of_point(p: &ContactPoint) -> Self {
        Self {
            kind: p.kind,
            extent: Extent::Point,
            normal: p.normal,
            faces_a: p.faces_a,
            faces_b: p.faces_b,
            points: vec![RegionPoint { point: p.point, separation: 0.0 }],
        }
    }

    /// What a record tells of two bodies that rest on each other here at the start.
    fn at_rest(&self, query: &PairQuery) -> ContactPoint {
        let point = self.points.iter().map(|p| p.point).sum::<DVec3>() / self.points.len() as f64;
        ContactPoint {
            point,
            normal: self.normal,
            averaged_normal: self.kind == ContactKind::VertexVertex,
            separation: self.separation(),
            normal_speed: normal_speed(query, point, self.normal),
            kind: self.kind,
            extent: self.extent,
            faces_a: self.faces_a,
            faces_b: self.faces_b,
        }
    }

    /// Smallest separation of its points.
    pub fn separation(&self) -> f64 {
        self.points.iter().map(|p| p.separation).fold(f64::INFINITY, f64::min)
    }
}

/// Speed at which the bodies approach at a point of the start, along a normal from a to b.
fn normal_speed(query: &PairQuery, point: DVec3, normal: DVec3) -> f64 {
    let velocity = |m: &contactd_proto::Motion| m.velocity + m.spin.cross(point - m.start.position);
    (velocity(&query.a.placed.motion) - velocity(&query.b.placed.motion)).dot(normal)
}

/// All regions along A's axes; those found until the work ran out.
fn find(bodies: &Bodies) -> Regions {
    let mut out = Regions::default();
    if let Some(regions) = polytopes::regions(bodies) {
        (out.regions, out.complete) = (regions, true);
        out.regions.sort_by_key(rank);
        return out;
    }
    let in_front = flat::regions(bodies).or_else(|| single::regions(bodies)).or_else(|| ball::regions(bodies));
    if let Some(regions) = in_front {
        (out.regions, out.complete) = (regions, true);
        return out;
    }
    let mut found = in_boxes(bodies);
    if let Some(nearest) = beside_the_nearest(bodies, &found.regions) {
        found.regions.push(nearest);
        found.regions.sort_by_key(rank);
    }
    // Boxes follow curves that nearly run along each other to a part of the threshold.
    if let [only] = &mut found.regions[..]
        && only.extent == Extent::Point
        && let Some(nearest) = single::nearest_point(bodies)
    {
        *only = nearest;
    }
    found
}

/// The point where bodies are nearest to each other near a line that is told as the nearest, where it is none of that: of an edge that
/// leans against a round face the ends alone are told. A patch is told by corners and by directions that stay.
fn beside_the_nearest(bodies: &Bodies, regions: &[Region]) -> Option<Region> {
    let region = regions.iter().min_by(|r, s| r.separation().total_cmp(&s.separation()))?;
    if region.extent != Extent::Line {
        return None;
    }
    let p = region.points.iter().min_by(|p, q| p.separation.total_cmp(&q.separation))?;
    let aside = region.normal * (0.5 * p.separation);
    let m = Meeting { feet: [p.point - aside, p.point + aside], normal: region.normal, gap: p.separation };
    let nearer = single::nearer(bodies, &m, p.separation - SAME_POINT * bodies.size)?;
    let is_other = |r: &Region| r.points.iter().all(|p| p.point.distance(nearer.middle()) > SAME_FACES * bodies.size);
    regions.iter().all(is_other).then(|| point_region(bodies, &nearer))
}

/// All regions of any bodies.
fn in_boxes(bodies: &Bodies) -> Regions {
    let mut out = Regions::default();
    let (places, covered) = cover(bodies);
    let patches = pairs(bodies, &places);
    let mut ends: Vec<DVec3> = Vec::new();
    let mut told = Told::default();
    for facing in &patches {
        let Facing { pair, boxes, .. } = facing;
        for group in parts(bodies, &places, boxes) {
            let part: Vec<&Place> = group.iter().map(|i| &places[*i]).collect();
            let corners = patch::corners(bodies, pair, &part);
            if bodies.work.is_spent() {
                return out;
            }
            let pieces = apart(bodies, pair, &part, corners);
            if !pieces.is_empty() {
                told.add(&group, facing);
            }
            for corners in pieces {
                ends.extend(corners.iter().map(|c| c.x));
                out.regions.push(patch_region(bodies, pair, &corners));
            }
        }
    }
    let in_patch = |x: DVec3| {
        patches.iter().any(|Facing { pair, .. }| {
            [pair.alpha, pair.beta].iter().all(|l| bodies.value(*l, x).abs() <= bodies.tau + bodies.eps)
                && surface::standing(bodies, pair, x) != Standing::Outside
        })
    };
    let mut lines: Vec<line::Run> = Vec::new();
    for (candidate, of) in candidates(bodies, &places) {
        if of.iter().all(|i| told.bounds(*i, &places[*i], &candidate)) {
            continue;
        }
        let of: Vec<&Place> = of.iter().map(|i| &places[*i]).collect();
        let runs = line::runs(bodies, &candidate, &of, &in_patch);
        if bodies.work.is_spent() {
            return out;
        }
        for run in runs {
            // Two faces may have an edge in common that a third one shares.
            let same = |l: &line::Run| on_run(bodies, l, run.middle) && on_run(bodies, &run, l.middle);
            if !lines.iter().any(same) {
                out.regions.push(line_region(bodies, &run));
                lines.push(run);
            }
        }
    }
    let mut points: Vec<(DVec3, [u32; 3], [u32; 3])> = Vec::new();
    for m in point::meetings(bodies, &places, &told) {
        let m = single::nearer(bodies, &m, m.gap - NEARER * bodies.size).unwrap_or(m);
        let x = m.middle();
        let region = point_region(bodies, &m);
        let faces = (region.faces_a, region.faces_b);
        let is_same = |(p, of_a, of_b): &(DVec3, [u32; 3], [u32; 3])| {
            // Where the curvature vanishes equations tell a point to a part of their digits.
            let part = if (*of_a, *of_b) == faces { SAME_FACES } else { SAME_POINT };
            (*p - x).length() <= part * bodies.size + bodies.lie
        };
        let known = points.iter().any(is_same)
            || ends.iter().any(|c| (*c - x).length() <= bodies.eps)
            || lines.iter().any(|l| on_run(bodies, l, x))
            || in_patch(x);
        if !known {
            points.push((x, faces.0, faces.1));
            out.regions.push(region);
        }
    }
    out.regions.sort_by_key(rank);
    out.complete = covered && !bodies.work.is_spent();
    out
}

/// The order of regions.
fn rank(r: &Region) -> (u8, [u32; 3], [u32; 3]) {
    (2 - r.extent as u8, r.faces_a, r.faces_b)
}

/// True when a point lies on a run, its ends included.
fn on_run(bodies: &Bodies, run: &line::Run, x: DVec3) -> bool {
    let (s, off) = run.curve.nearest(x);
    let slack = 1e-6;
    let within = |s: f64| s >= run.from - slack * bodies.size && s <= run.to + slack * bodies.size;
    let turn = std::f64::consts::TAU;
    let round = matches!(run.curve, line::Curve::Circle { .. });
    off <= bodies.tau + slack * bodies.size && (within(s) || (round && (within(s + turn) || within(s + 2.0 * turn))))
}

/// Boxes that hold all that touches, each with few faces, and whether that is proven.
fn cover(bodies: &Bodies) -> (Vec<Place>, bool) {
    let tau = bodies.tau;
    let mut cover = Cover::new(bodies.task, bodies.at, tau, tau, bodies.work);
    let mut places = Vec::new();
    let smallest = (0.5 * SMALLEST * bodies.size).max(0.5 * tau);
    while let Some(place) = cover.next(0.5 * tau) {
        let radius = place.half.length();
        let sides = [Side::A, Side::B].map(|s| place.lits(s));
        if sides.iter().any(|lits| lits.is_empty()) {
            // Inside one body: no surface of it.
            continue;
        }
        let few = sides[0].len() + sides[1].len() <= FEW_FACES;
        let is_flat = sides.iter().copied().flatten().all(|l| bodies.face(*l).is_flat());
        let simple = few
            && (is_flat
                || radius <= ROUND * 0.5 * bodies.size
                || is_simple(bodies, &place)
                || point::meets_once(bodies, &place));
        if simple || radius <= smallest {
            places.push(place);
        } else if !few {
            cover.split(place, |_| true);
        } else if point::may_meet(bodies, &place) {
            // Few faces that touch along no area and no line: halves in which nothing meets need no look.
            cover.split(place, |half| point::may_meet(bodies, half));
        }
    }
    (places, cover.is_done())
}

/// False where it is known that two convex bodies, of few faces where they are near, touch over no area and along no line: no two faces
/// lie on each other, and no candidate for a line has a run.
fn may_extend(bodies: &Bodies) -> bool {
    let tau = bodies.tau;
    let mut cover = Cover::new(bodies.task, bodies.at, tau, tau, bodies.work);
    let mut places = Vec::new();
    while let Some(place) = cover.next(0.5 * tau) {
        let [a, b] = [Side::A, Side::B].map(|s| place.lits(s).len());
        if a == 0 || b == 0 {
            continue;
        }
        if a + b <= FEW_FACES {
            places.push(place);
        } else if places.len() < FEW_PLACES {
            cover.split(place, |_| true);
        } else {
            return true;
        }
    }
    let is_line = |(c, of): (Candidate, Vec<usize>)| {
        let of: Vec<&Place> = of.iter().map(|i| &places[*i]).collect();
        !line::runs(bodies, &c, &of, &|_| false).is_empty()
    };
    !cover.is_done()
        || !pairs(bodies, &places).is_empty()
        || candidates(bodies, &places).into_iter().any(is_line)
        || bodies.work.is_spent()
}

/// True when faces touch in a box over an area or along a line: halving it would only cut that up.
fn is_simple(bodies: &Bodies, place: &Place) -> bool {
    let b = place.lits(Side::B);
    let pairs = place.lits(Side::A).iter().any(|p| b.iter().any(|q| FacePair::of(bodies, *p, *q).is_some()));
    pairs || line::has_line(bodies, place)
}

/// Two surfaces that lie on each other.
struct Facing {
    pair: FacePair,
    /// All literals of A and of B that are of these surfaces, as they come together in some box.
    lits: Vec<[Lit; 2]>,
    /// The boxes in which they do.
    boxes: Vec<usize>,
}

/// The faces whose patches are told, by the boxes of these.
#[derive(Default)]
struct Told {
    all: BTreeMap<usize, Vec<[Lit; 2]>>,
    /// Those that do not lean apart, so that their patch ends nowhere but where one of them does.
    level: BTreeMap<usize, Vec<[Lit; 2]>>,
}

impl Told {
    fn add(&mut self, boxes: &[usize], Facing { pair, lits, .. }: &Facing) {
        for i in boxes {
            self.all.entry(*i).or_default().extend_from_slice(lits);
            if pair.limit.is_none() {
                self.level.entry(*i).or_default().extend_from_slice(lits);
            }
        }
    }

    /// True for an edge that bounds a face whose patch is told in a box, on another one that is all there is of the other body there:
    /// where the edge touches it is on the patch's rim.
    fn bounds(&self, i: usize, place: &Place, edge: &Candidate) -> bool {
        let [p, q] = edge.faces;
        let other = if p.0 == Side::A { Side::B } else { Side::A };
        let [face] = place.lits(other)[..] else { return false };
        let lie = |l: Lit| if other == Side::A { [face, l] } else { [l, face] };
        p.0 == q.0 && self.level.get(&i).is_some_and(|told| told.iter().any(|two| *two == lie(p) || *two == lie(q)))
    }

    /// The faces of a box that lie on each other and are told.
    fn of(&self, place: usize) -> &[[Lit; 2]] {
        self.all.get(&place).map_or(&[], |lits| lits)
    }
}

/// The pairs of surfaces that lie on each other.
fn pairs(bodies: &Bodies, places: &[Place]) -> Vec<Facing> {
    let mut boxes: BTreeMap<(Lit, Lit), Vec<usize>> = BTreeMap::new();
    for (i, place) in places.iter().enumerate() {
        let b = place.lits(Side::B);
        // In a box in which many faces run together they are many pairs.
        bodies.work.look(place.lits(Side::A).len() * b.len() / PAIRS_PER_LOOK);
        if bodies.work.is_spent() {
            return Vec::new();
        }
        for p in place.lits(Side::A) {
            b.iter().for_each(|q| boxes.entry((*p, *q)).or_default().push(i));
        }
    }
    let mut found: Vec<Facing> = Vec::new();
    for ((p, q), of) in boxes {
        bodies.work.look(1 + found.len() / PAIRS_PER_LOOK);
        if bodies.work.is_spent() {
            break;
        }
        let is_same = |k: &FacePair| same_surface(bodies, k.alpha, p) && same_surface(bodies, k.beta, q);
        match found.iter_mut().find(|f| is_same(&f.pair)) {
            Some(known) => {
                known.lits.push([p, q]);
                known.boxes.extend(of);
            }
            None => {
                let pair = FacePair::of(bodies, p, q);
                found.extend(pair.map(|pair| Facing { pair, lits: vec![[p, q]], boxes: of }));
            }
        }
    }
    for Facing { boxes, .. } in &mut found {
        boxes.sort_unstable();
        boxes.dedup();
    }
    found
}

/// Boxes in groups that hang together, as indices.
fn parts(bodies: &Bodies, places: &[Place], of: &[usize]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, index) in of.iter().enumerate() {
        // Some comparisons make one look.
        bodies.work.look(i / 8);
        if bodies.work.is_spent() {
            return Vec::new();
        }
        let place = &places[*index];
        let meets = |o: &usize| {
            let o = &places[*o];
            let gap = (o.center - place.center).abs() - (o.half + place.half) * (1.0 + 1e-9);
            gap.max_element() <= 0.0
        };
        let (near, far): (Vec<_>, Vec<_>) = groups.into_iter().partition(|g| g.iter().any(meets));
        groups = far;
        groups.push(near.into_iter().flatten().chain([*index]).collect());
    }
    groups
}

/// The points of a flat patch in groups that see each other: one a piece. Curved ones stay as they are.
fn apart(bodies: &Bodies, pair: &FacePair, places: &[&Place], corners: Vec<Corner>) -> Vec<Vec<Corner>> {
    if corners.is_empty() {
        return Vec::new();
    }
    // Fewer points than two triangles have make no two pieces.
    if corners.len() < 6 || !bodies.face(pair.alpha).is_flat() {
        return vec![corners];
    }
    let mut lits: Vec<Lit> = Vec::new();
    for side in [Side::A, Side::B] {
        lits.extend(places.iter().flat_map(|p| p.lits(side)));
    }
    lits.sort_unstable();
    lits.dedup();
    let mut groups: Vec<Vec<Corner>> = Vec::new();
    for c in corners {
        let sees = |g: &Vec<Corner>| g.iter().any(|o| line::sees(bodies, pair, &lits, o.x, c.x));
        let (near, far): (Vec<_>, Vec<_>) = groups.into_iter().partition(sees);
        groups = far;
        groups.push(near.into_iter().flatten().chain([c]).collect());
    }
    for g in &mut groups {
        patch::order(bodies, pair, g);
    }
    groups.sort_by_key(|g| g.iter().map(|c| c.key).min());
    groups
}

/// Candidates for lines, each once, with the boxes that name it.
fn candidates(bodies: &Bodies, places: &[Place]) -> Vec<(Candidate, Vec<usize>)> {
    let mut found: Vec<(Candidate, Vec<usize>)> = Vec::new();
    let mut index: BTreeMap<([Lit; 2], usize), usize> = BTreeMap::new();
    for (i, place) in places.iter().enumerate() {
        let faces: usize = [Side::A, Side::B].iter().map(|side| place.lits(*side).len()).sum();
        bodies.work.look(faces * faces / 2 / PAIRS_PER_LOOK);
        if bodies.work.is_spent() {
            return Vec::new();
        }
        let mut count: BTreeMap<[Lit; 2], usize> = BTreeMap::new();
        for c in line::candidates(bodies, place) {
            // Two faces may have two curves in common.
            let nth = count.entry(c.faces).or_default();
            let key = (c.faces, *nth);
            *nth += 1;
            match index.get(&key) {
                Some(k) => found[*k].1.push(i),
                None => {
                    index.insert(key, found.len());
                    found.push((c, vec![i]));
                }
            }
        }
    }
    found
}

fn three(ids: impl IntoIterator<Item = u32>) -> [u32; 3] {
    let mut out = [NO_FACE; 3];
    let mut ids: Vec<u32> = ids.into_iter().collect();
    ids.sort_unstable();
    ids.dedup();
    for (slot, id) in out.iter_mut().zip(ids) {
        *slot = id;
    }
    out
}

fn faces_at(bodies: &Bodies, side: Side, x: DVec3) -> [u32; 3] {
    three(bodies.through(side, x).iter().map(|id| id.face()))
}

fn points_of(corners: &[Corner]) -> Vec<RegionPoint> {
    corners.iter().map(|c| RegionPoint { point: c.x, separation: c.gap }).collect()
}

fn patch_region(bodies: &Bodies, pair: &FacePair, corners: &[Corner]) -> Region {
    let normals = corners.iter().map(|c| bodies.slant_out(pair.alpha, c.x).1);
    let mean = normals.clone().sum::<DVec3>();
    let normal = if mean.length() > 1e-3 { mean.normalize() } else { normals.clone().next().unwrap_or(DVec3::Z) };
    Region {
        kind: ContactKind::FaceFace,
        extent: Extent::Patch,
        normal,
        faces_a: three([pair.alpha.1.face()]),
        faces_b: three([pair.beta.1.face()]),
        points: points_of(corners),
    }
}

fn line_region(bodies: &Bodies, run: &line::Run) -> Region {
    let [on_a, on_b] = run.feet;
    let (rank_a, rank_b) = (bodies.rank(Side::A, on_a), bodies.rank(Side::B, on_b));
    let (of_a, of_b) = (bodies.average(Side::A, on_a), bodies.average(Side::B, on_b));
    // A face has a normal of its own; two edges along each other have the average of the adjacent ones.
    let normal = match (rank_a, rank_b) {
        (1, _) => of_a,
        (_, 1) => -of_b,
        _ => (of_a - of_b).normalize_or(of_a),
    };
    Region {
        kind: ContactKind::of_active(rank_a.min(2), rank_b.min(2)),
        extent: Extent::Line,
        normal,
        faces_a: faces_at(bodies, Side::A, on_a),
        faces_b: faces_at(bodies, Side::B, on_b),
        points: points_of(&run.ends),
    }
}

fn point_region(bodies: &Bodies, m: &Meeting) -> Region {
    let [on_a, on_b] = m.feet;
    let kind = ContactKind::of_active(bodies.rank(Side::A, on_a), bodies.rank(Side::B, on_b));
    // Where a vertex meets a vertex the average of the adjacent normals stands for the normal, as in the paper.
    let average = bodies.average(Side::A, on_a) - bodies.average(Side::B, on_b);
    let normal = if kind == ContactKind::VertexVertex { average.normalize_or(m.normal) } else { m.normal };
    Region {
        kind,
        extent: Extent::Point,
        normal,
        faces_a: faces_at(bodies, Side::A, on_a),
        faces_b: faces_at(bodies, Side::B, on_b),
        points: vec![RegionPoint { point: m.middle(), separation: m.gap }],
    }
}
