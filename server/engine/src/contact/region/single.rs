//! The one point, or the one straight line, in which two convex bodies touch: without boxes.
//!
//! Two convex bodies are nearest to each other along one direction, and touch in what both have foremost along it
//! (`Convex::foremost`). That is a point where one of them stands out, as an ellipsoid does, a rim or a corner, and where an edge or a
//! ruling crosses another one; and where none of their faces lie on each other and no curve of one runs along the other
//! (`super::may_extend`). It is a line where one of them has a ruling or an edge foremost and the faces that decide there have one
//! candidate with a run (`line`). Both feet of a point are followed from where F is lowest, or found by Newton's method on the distance
//! itself. That they are nearest is proven: between the planes through them across the normal neither body reaches.

use super::local::{Bodies, Lit};
use super::point::{self, Meeting};
use super::{Region, SAME_FACES, SAME_POINT, line, line_region, on_run, point_region, surface};
use crate::contact::distance::polish::{self, Polish};
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::depth::{self, Deepest};
use crate::solid::local::LiteralId;
use crate::solid::primitive::{Foremost, Primitive};
use crate::solid::{Face, Sense};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Thresholds by which all that is near one point of a body stands out, where it touches another one there alone: areas are told of
/// what leans by `surface::LEAN` thresholds at most …
const POINTED: f64 = 2.0 * surface::LEAN;
/// … and lines of what leans by some roots of the threshold over the size (`line`).
const LEAN: f64 = 2.0;
/// Sine of the angle from which on two rulings or edges cross: they are near each other along no more than twice the widths of what is
/// foremost of both, over it.
const CROSSING: f64 = 0.25;
/// Thresholds from where F is lowest to the faces that decide there.
const ACTIVE: f64 = 2.0;
/// Diameters of the smaller body from which on bodies are apart for Newton's method on the distance.
const APART: f64 = 1e-6;
/// Times that Newton's method on the distance asks both trees, or so.
const ROUNDS: usize = 8;
/// Steps from a point down to a body.
const PROJECTIONS: usize = 16;
/// Faces of a body that are looked through.
pub const MOST_FACES: usize = 32;
/// Thresholds to which it is enough to know that feet are nearest where boxes know them to less.
const ROUGH: f64 = 1e-3;
/// Cosines from 1 within which two ways are one: of feet that nearly touch …
const SAME_WAY: f64 = 0.1;
/// … and of a half-space and its own normal, as far as rounding may turn it.
const SAME_NORMAL: f64 = 1e-14;

/// What two convex bodies have in common where they touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Common {
    /// What is near one point.
    Point,
    /// What is near one straight line, or less.
    Line,
    Any,
}

/// The region of two convex bodies that touch in one point or along one straight line, none where they are apart; `None` for other
/// bodies, and where it may be more than that.
pub fn regions(bodies: &Bodies) -> Option<Vec<Region>> {
    let both = convex(bodies)?;
    let (lowest, proven) = depth::nearest(bodies.task, bodies.at, bodies.tau, depth::BETTER, bodies.work);
    if !proven {
        return None;
    }
    let Some(lowest) = lowest else { return Some(Vec::new()) };
    // An apex has no normal, and is told beside what touches next to it.
    let (depth, lean) = (POINTED * bodies.tau, LEAN * (bodies.lie / bodies.size).sqrt());
    let foremost = |whole: &Primitive, n: DVec3, foot: DVec3| {
        let is_behind = |apex: DVec3| n.dot(foot - apex) > depth || whole.value(apex) > bodies.eps;
        let mut apexes = whole.faces.listed().iter().filter_map(Face::apex);
        let foremost = whole.shape.convex().foremost(whole.frame.rotation.inverse() * n, bodies.tau, depth, lean);
        apexes.all(|apex| is_behind(apex.point)).then_some(foremost)
    };
    // What both have foremost in common; `None` at an apex.
    let common = |m: &Meeting| {
        let of_a = foremost(both[0], m.normal, m.feet[0])?;
        let of_b = foremost(both[1], bodies.at.b_from_a * -m.normal, bodies.at.b_point(m.feet[1]))?;
        Some(match (of_a, of_b) {
            (Foremost::Point, _) | (_, Foremost::Point) => Common::Point,
            (Foremost::Line { along, width }, Foremost::Line { along: other, width: wide }) => {
                let (v, w) = (both[0].frame.rotation * along, bodies.at.a_vector(both[1].frame.rotation * other));
                let sine = v.cross(w).length();
                let is_short = 2.0 * (width + wide + bodies.tau) <= super::ROUND * 0.5 * bodies.size * sine;
                if is_short || sine > CROSSING { Common::Point } else { Common::Line }
            }
            (Foremost::Line { .. }, Foremost::Area) | (Foremost::Area, Foremost::Line { .. }) => Common::Line,
            (Foremost::Area, Foremost::Area) => Common::Any,
        })
    };
    // Where F is lowest the bodies face each other nearly as where they are nearest.
    let first = common(&Meeting { feet: [lowest.0; 2], normal: lowest.1, gap: 0.0 })?;
    if let (Common::Line, Some(run)) = (first, only_run(bodies, both, &lowest)) {
        return Some(vec![line_region(bodies, &run)]);
    }
    let is_one = first == Common::Point;
    if !is_one && super::may_extend(bodies) {
        return None;
    }
    let m = meeting(bodies, both, &lowest, bodies.eps)?;
    let then = common(&m)?;
    if is_one && then != Common::Point {
        return None;
    }
    let is_near = m.gap <= bodies.tau * (1.0 + SAME_POINT) + bodies.eps;
    Some(if is_near { vec![point_region(bodies, &m)] } else { Vec::new() })
}

/// The straight line along which two convex bodies touch, if there is one and no other.
fn only_run(bodies: &Bodies, both: [&Primitive; 2], lowest: &Deepest) -> Option<line::Run> {
    if both.iter().any(|whole| whole.faces.len() > MOST_FACES) {
        return None;
    }
    let all = [(Side::A, both[0]), (Side::B, both[1])].map(|(side, whole)| literals(side, whole));
    let near = |lit: &Lit| bodies.value(*lit, lowest.0).abs() <= ACTIVE * bodies.tau + bodies.eps;
    let active = [&all[0], &all[1]].map(|lits| lits.iter().copied().filter(near).collect::<SmallVec<[Lit; 4]>>());
    bodies.work.look((active[0].len() + active[1].len()).pow(2));
    let mut runs: SmallVec<[line::Run; 2]> = SmallVec::new();
    for c in line::candidates_among(bodies, [&active[0], &active[1]]) {
        let line::Curve::Line { .. } = c.curve else { continue };
        let others: Vec<Lit> = all.iter().flatten().copied().filter(|lit| !c.faces.contains(lit)).collect();
        let s = c.curve.nearest(lowest.0).0;
        let far = bodies.size + 2.0 * bodies.tau;
        runs.extend(line::runs_within(bodies, &c, (s - far, s + far), &others, &|_| false));
    }
    // What was not looked at any more may be an end of a line.
    if bodies.work.is_spent() {
        return None;
    }
    let first = runs.pop()?;
    runs.iter().all(|r| on_run(bodies, &first, r.middle) && on_run(bodies, r, first.middle)).then_some(first)
}

/// The faces of a convex body.
pub fn literals(side: Side, whole: &Primitive) -> SmallVec<[Lit; 8]> {
    let literal = |face| (side, LiteralId::new(whole.first_face + face as u32, Sense::Positive));
    (0..whole.faces.len()).map(literal).collect()
}

/// The point that boxes told of two bodies as their only region, where they are proven to be nearest if they are convex.
pub fn nearest_point(bodies: &Bodies) -> Option<Region> {
    let both = convex(bodies)?;
    let (lowest, _) = depth::nearest(bodies.task, bodies.at, bodies.tau, depth::BETTER, bodies.work);
    let slack = bodies.eps.max(ROUGH * bodies.tau);
    Some(point_region(bodies, &meeting(bodies, both, &lowest?, slack)?))
}

/// Both bodies, if they are convex and one of them is round: of polytopes corners tell more (`polytopes`).
pub fn convex<'a>(bodies: &Bodies<'_, 'a>) -> Option<[&'a Primitive; 2]> {
    let both = [bodies.task.a.whole()?, bodies.task.b.whole()?];
    let is_flat = |whole: &&Primitive| whole.faces.listed().iter().all(Face::is_flat);
    (both.iter().all(|whole| whole.is_convex()) && !both.iter().all(is_flat)).then_some(both)
}

/// Where the bodies are nearest to each other, proven to a slack, from where F is lowest.
fn meeting(bodies: &Bodies, both: [&Primitive; 2], lowest: &Deepest, slack: f64) -> Option<Meeting> {
    let near = |m: Meeting| nearest(bodies, both, m, slack);
    let polished = |feet: [DVec3; 2]| polished(bodies, feet, lowest.1).and_then(near);
    // Two faces are followed at once, what has edges by the distance itself.
    if lowest.3.len() > 2
        && let Some(m) = polished([lowest.0; 2])
    {
        return Some(m);
    }
    let followed = point::followed(bodies, lowest);
    let feet = followed.as_ref().map_or([lowest.0; 2], |m| m.feet);
    // Beside the end of a face Newton's method needs a start on the bodies.
    let on_bodies = || [onto(bodies, Side::A, both[0], lowest.0), onto(bodies, Side::B, both[1], lowest.0)];
    followed.and_then(near).or_else(|| polished(feet)).or_else(|| polished(on_bodies()))
}

/// A point of a convex body near to `x`, but for rounding: down to one face after the other, the one that is farthest below.
fn onto(bodies: &Bodies, side: Side, whole: &Primitive, x: DVec3) -> DVec3 {
    let mut y = if side == Side::A { x } else { bodies.at.b_point(x) };
    for _ in 0..PROJECTIONS {
        bodies.work.look(whole.faces.len());
        let (face, value) = whole.highest(y);
        if value <= bodies.eps {
            break;
        }
        let at = whole.faces[face].at(y);
        y -= at.normal * (value / (at.slope * at.slope));
    }
    if side == Side::A { y } else { bodies.at.a_point(y) }
}

/// Where two bodies are nearest to each other as F tells it, where nothing proves more, as of an edge beside an apex. Along an axis F has
/// no slope, and its normal may be any: of convex bodies the one is told, of F's, its faces' and the distance's own, along which they
/// reach least far into each other, and how far they are apart along that.
pub fn roughly_nearest(bodies: &Bodies, lowest: &Deepest, threshold: f64) -> Meeting {
    let of_f = point::nearest(bodies, lowest);
    let Some(both) = convex(bodies) else { return nearer(bodies, &of_f, threshold).unwrap_or(of_f) };
    let (x, _, depth, lits) = lowest;
    let of_face = |lit: &Lit| {
        let slope = bodies.slant_out(*lit, *x).1.normalize_or_zero();
        let normal = if lit.0 == Side::A { slope } else { -slope };
        (normal != DVec3::ZERO).then(|| Meeting {
            feet: [*x + normal * *depth, *x - normal * *depth],
            normal,
            gap: 0.0,
        })
    };
    let others = lits.iter().filter_map(of_face).chain(polished(bodies, [*x; 2], lowest.1));
    let along = |m: Meeting| Meeting { gap: apart(bodies, both, m.normal), ..m };
    let least = along(of_f.clone()).gap;
    let best = others.map(along).max_by(|m, n| m.gap.total_cmp(&n.gap));
    best.filter(|m| m.gap > least).unwrap_or(of_f)
}

/// The meeting, if no points of the bodies are nearer to each other than its feet, but for a slack; these are on the bodies.
fn nearest(bodies: &Bodies, both: [&Primitive; 2], mut m: Meeting, slack: f64) -> Option<Meeting> {
    let n = sharpened(bodies, &m);
    m = Meeting { gap: (m.feet[1] - m.feet[0]).dot(n), normal: n, ..m };
    // A half-space reaches on without end, but along its own normal.
    for (side, whole) in [Side::A, Side::B].into_iter().zip(both) {
        if let Some(h) = half_space(whole) {
            let h = if side == Side::A { h.0 } else { -bodies.at.a_vector(h.0) };
            if h.dot(m.normal) < 1.0 - SAME_FACES {
                return None;
            }
            m = Meeting { gap: (m.feet[1] - m.feet[0]).dot(h), normal: h, ..m };
        }
    }
    let aside = (m.feet[1] - m.feet[0] - m.normal * m.gap).length();
    (aside <= slack && m.gap - apart(bodies, both, m.normal) <= slack).then_some(m)
}

/// How far the bodies are apart along a unit vector, at least, as far as each reaches: a half-space without end, but along its own normal.
pub fn apart(bodies: &Bodies, [a, b]: [&Primitive; 2], normal: DVec3) -> f64 {
    let reach = |whole: &Primitive, n: DVec3| match half_space(whole) {
        Some((own, offset)) => {
            if n.dot(own) > 1.0 - SAME_NORMAL {
                offset
            } else {
                f64::INFINITY
            }
        }
        None => {
            let axes = DMat3::from_quat(whole.frame.rotation);
            n.dot(whole.frame.position) + whole.shape.convex().reach(&axes, n)
        }
    };
    let of_b = reach(b, bodies.at.b_from_a * -normal) - normal.dot(bodies.at.a_point(DVec3::ZERO));
    -of_b - reach(a, normal)
}

/// The normal of a meeting as the faces tell it that pass through its feet: the way between these has as few digits as it is short.
fn sharpened(bodies: &Bodies, m: &Meeting) -> DVec3 {
    let through = |side: Side, foot: DVec3| -> SmallVec<[DVec3; 4]> {
        let all = bodies.through(side, foot);
        all.iter().map(|id| bodies.slant_out((side, *id), foot).1).collect()
    };
    let n = match (&through(Side::A, m.feet[0])[..], &through(Side::B, m.feet[1])[..]) {
        ([p], _) => *p,
        (_, [q]) => -*q,
        ([p, q], [r, s]) => p.cross(*q).cross(r.cross(*s)).normalize_or_zero(),
        _ => m.normal,
    };
    let n = if n.dot(m.normal) < 0.0 { -n } else { n };
    if n.dot(m.normal) > 1.0 - SAME_WAY { n } else { m.normal }
}

/// Outward unit normal and offset of a half-space, in the model's frame.
fn half_space(whole: &Primitive) -> Option<(DVec3, f64)> {
    match whole.faces.listed() {
        [face] => face.flat(),
        _ => None,
    }
}

/// Points of both bodies near the feet of a meeting that are nearest to each other, and no farther apart than `most`; `None` where the
/// bodies are hardly apart, or none are found. Where parts of a body end on it, F may balance beside the nearest points: its edges
/// are none of the whole.
pub fn nearer(bodies: &Bodies, m: &Meeting, most: f64) -> Option<Meeting> {
    // Below that equations of faces tell more digits.
    let is_apart = |m: &Meeting| m.gap > APART * bodies.size;
    if !is_apart(m) || bodies.work.is_spent() {
        return None;
    }
    let polish = polish_of(bodies);
    let [x, y] = m.feet;
    let (y, way) = (bodies.at.b_point(y), -(bodies.at.b_from_a * m.normal));
    let of_a = polish.beside(0, x, m.normal, m.gap).into_iter().map(|x| [x, y]);
    let of_b = polish.beside(1, y, way, m.gap).into_iter().map(|y| [x, y]);
    let starts = std::iter::once([x, y]).chain(of_a).chain(of_b);
    // Of a face that is as far off as the gap, and bends as the smaller body does, the nearest point is within √(2 gap size).
    let reach = 2.0 * (m.gap * bodies.size).sqrt();
    let is_beside = |found: &Meeting| (0..2).all(|side| found.feet[side].distance(m.feet[side]) <= reach);
    let found = starts.filter_map(|feet| run(bodies, &polish, feet, m.normal)).filter(is_beside);
    found.min_by(|m, n| m.gap.total_cmp(&n.gap)).filter(|found| is_apart(found) && found.gap <= most)
}

/// The feet by Newton's method on the distance.
fn polished(bodies: &Bodies, [x, y]: [DVec3; 2], normal: DVec3) -> Option<Meeting> {
    run(bodies, &polish_of(bodies), [x, bodies.at.b_point(y)], normal)
}

fn polish_of<'s, 'a>(bodies: &Bodies<'s, 'a>) -> Polish<'s, 'a> {
    let (task, at) = (bodies.task, bodies.at);
    let sides = [task.model_a, task.model_b].map(|model| polish::Side { model, tokens: &model.solid.normal_form });
    Polish { sides, at, scale: task.scale, rounding: task.rounding, steps: polish::Steps::ALL }
}

/// Newton's method from points in the frames of their bodies.
fn run(bodies: &Bodies, polish: &Polish, [x, y]: [DVec3; 2], normal: DVec3) -> Option<Meeting> {
    let pair = polish.run(x, y);
    // Each of a few rounds asks both trees.
    let looks = polish.sides.iter().map(|side| ROUNDS * side.tokens.len()).sum();
    bodies.work.look(looks);
    let pair = pair?;
    let feet = [pair.x, bodies.at.a_point(pair.y)];
    Some(point::met(bodies, feet, normal))
}
