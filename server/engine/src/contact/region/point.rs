//! Points: where two bodies touch at a single point, or come nearest to each other within the threshold.
//!
//! Such a point is a stationary point of F = max(f_A, f_B): literals of both bodies at one level, their gradients
//! balanced. Every choice of one to three faces a side is solved by Newton's method (the faces of a box are few); a
//! solution counts if both whole trees have that value there, so that no other face decides. Surfaces apart are then
//! followed back from the level to each body's own surface, which gives both feet and their distance. A cone's apex is
//! a point of its own.

use super::Told;
use super::local::{Bodies, Lit, has_descent};
use crate::contact::exclusion::literal::Side;
use crate::contact::instant::depth::Deepest;
use crate::contact::instant::separation::Place;
use crate::contact::witness::balance::{self, BALANCE, Balance, Equations, MOST_BALANCED};
use crate::contact::witness::newton::{MAX_UNKNOWNS, cholesky_solve};
use crate::math::any_perpendicular;
use crate::math::linear::eliminated;
use crate::solid::Sense;
use crate::solid::surface::{Apex, Quadric, Symmetry};
use glam::DVec3;
use smallvec::{SmallVec, smallvec};
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// A stationary point of the distance of two bodies.
#[derive(Clone, Debug)]
pub struct Meeting {
    /// Feet on A and B.
    pub feet: [DVec3; 2],
    /// From A to B.
    pub normal: DVec3,
    /// Distance of the feet along the normal.
    pub gap: f64,
}

impl Meeting {
    pub fn middle(&self) -> DVec3 {
        (self.feet[0] + self.feet[1]) * 0.5
    }
}

/// How far off its box a meeting may be found, in boxes.
const SLACK: f64 = 1e-3;

/// The meetings within some boxes, but for those on the rims of what is told.
pub fn meetings(bodies: &Bodies, places: &[Place], told: &Told) -> Vec<Meeting> {
    let mut out = Vec::new();
    for (lits, of) in systems(bodies, places, told) {
        // Planes balance nowhere, in one place, or all along a flat of which the trees choose a part.
        let is_flat = lits.iter().all(|l| bodies.face(*l).is_flat());
        let mut last: Option<DVec3> = None;
        for place in of {
            if bodies.work.is_spent() {
                return out;
            }
            // Equations of planes are linear: what has no solution from one start has none from another.
            let starts = [place.lowest, place.center];
            let found = starts[..if is_flat { 1 } else { 2 }].iter().find_map(|&x| {
                let balance = balance(bodies, &lits, x)?;
                Some((balance.0, meeting(bodies, place, &lits, balance)))
            });
            let met = found.as_ref().is_some_and(|f| f.1.is_some());
            let again = |x: DVec3| last.is_some_and(|y| (x - y).length() <= bodies.eps);
            let all = is_flat && (met || found.as_ref().is_none_or(|f| again(f.0)));
            last = found.as_ref().map(|f| f.0);
            out.extend(found.and_then(|f| f.1));
            if all {
                break;
            }
        }
    }
    for place in places {
        for (side, other) in [(Side::A, Side::B), (Side::B, Side::A)] {
            for &lit in place.lits(side) {
                let Some(Apex { point: apex, .. }) = bodies.face(lit).apex() else { continue };
                if lit.1.sense() == Sense::Positive && place.holds(apex, bodies.tau) {
                    out.extend(at_apex(bodies, side, apex, place.lits(other)));
                }
            }
        }
    }
    out
}

/// Faces that may balance, those of A first.
type System = SmallVec<[Lit; MOST_BALANCED]>;

/// The sets of one to three faces a side that may balance, each once with the boxes in which they may.
fn systems<'p>(bodies: &Bodies, places: &'p [Place], told: &Told) -> BTreeMap<System, Vec<&'p Place>> {
    let mut found: BTreeMap<System, Vec<&Place>> = BTreeMap::new();
    for (i, place) in places.iter().enumerate() {
        if bodies.work.is_spent() {
            return found;
        }
        let _ = each_system(bodies, place, told.of(i), |lits| {
            found.entry(lits).or_default().push(place);
            ControlFlow::Continue(())
        });
    }
    found
}

/// False when nothing balances in a box.
pub fn may_meet(bodies: &Bodies, place: &Place) -> bool {
    each_system(bodies, place, &[], |_| ControlFlow::Break(())).is_break()
}

/// True when a box has one meeting and it is found.
pub fn meets_once(bodies: &Bodies, place: &Place) -> bool {
    is_unique(bodies, place) && !meetings(bodies, std::slice::from_ref(place), &Told::default()).is_empty()
}

/// True where no more than one point of a box can be a balance: there a ball and one other face are. With a convex one F is strictly
/// convex. Out of a hollow one the ball's centre c must be seen along the face's normal, and a gradient of length 1 is the same all
/// along a normal up to the face's focus: while that is farther than c from everywhere in the box, the normal through c is the one
/// line on which the balance lies, and the levels agree there once. Normals of a round face lie in planes through its axis: where
/// the box lies on c's side of the axis, and the face is straight in these planes, its normals there are parallel, and one goes
/// through c.
fn is_unique(bodies: &Bodies, place: &Place) -> bool {
    let [of_a, of_b] = [Side::A, Side::B].map(|side| place.lits(side));
    let ([p], [q]) = (of_a, of_b) else { return false };
    let reach = place.half.length() * (1.0 + SLACK) + bodies.eps;
    let with = |ball: Lit, other: Lit| {
        let (Some((center, _)), Sense::Positive) = (bodies.face(ball).ball(), ball.1.sense()) else { return false };
        let face = bodies.face(other);
        if other.1.sense() == Sense::Positive {
            return face.is_convex();
        }
        if is_beside_axis(face.quadric(0.0).as_ref(), center, place, bodies.eps) {
            return true;
        }
        let at = face.at(place.center);
        let far = (place.center - center).length() + reach;
        // Of elliptic faces and quadrics, which have no symmetry, no gradient is of length 1.
        face.symmetry() != Symmetry::None && far * at.k < (at.rho - reach) * (1.0 - SLACK)
    };
    bodies.work.look(2);
    with(*p, *q) || with(*q, *p)
}

/// True where a box lies on a point's side of the axis of a cylinder or cone: no plane through the axis shows both sides of it there.
fn is_beside_axis(round: Option<&Quadric>, point: DVec3, place: &Place, eps: f64) -> bool {
    let Some(&Quadric { origin, axis: Some(axis), .. }) = round else { return false };
    let off = |x: DVec3| (x - origin) - axis * (x - origin).dot(axis);
    let Some(way) = off(point).try_normalize() else { return false };
    let grown = place.half * (1.0 + SLACK) + DVec3::splat(SLACK * place.half.max_element() + eps);
    off(place.center).dot(way) > way.abs().dot(grown)
}

/// A literal in a box: its value and gradient at the centre, how far the gradient turns on the way through the box.
struct InBox {
    lit: Lit,
    value: f64,
    gradient: DVec3,
    turn: f64,
}

impl InBox {
    /// False where the box has no point at which this literal and another one are on one level that is near enough to touch: half
    /// their sum changes by their gradients' sum alone.
    fn may_level(&self, other: &Self, reach: f64, most: f64) -> bool {
        let change = (self.gradient + other.gradient).length() + self.turn + other.turn;
        (self.value + other.value).abs() <= 2.0 * most + change * reach
    }
}

/// Hands over the sets that may balance in a box, or some of them where the work runs out. Of others two are on no common level in
/// it, or some direction leads down all of their literals wherever one is, so that their gradients have no sum zero. More than two
/// faces of which two are `told` to lie on each other there are left out: where they balance both bodies end at the two, on one level,
/// which is on the rim of their common area.
fn each_system(
    bodies: &Bodies,
    place: &Place,
    told: &[[Lit; 2]],
    mut found: impl FnMut(System) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let reach = place.half.length() * (1.0 + SLACK) + bodies.eps;
    let most = 0.5 * bodies.tau + 2.0 * bodies.eps;
    let [of_a, of_b] = [Side::A, Side::B].map(|side| {
        let in_box = |&lit: &Lit| {
            let face = bodies.face(lit);
            let at = face.at(place.center);
            let sign = if lit.1.sense() == Sense::Positive { 1.0 } else { -1.0 };
            let turn = face.turn(place.center, &at, reach);
            InBox { lit, value: at.value * sign, gradient: at.normal * sign, turn }
        };
        place.lits(side).iter().map(in_box).collect::<SmallVec<[InBox; 2 * MOST_BALANCED]>>()
    });
    bodies.work.look(of_a.len() + of_b.len());
    let level = |way: &[usize], of: &[InBox]| {
        way.iter().enumerate().all(|(n, i)| way[..n].iter().all(|j| of[*i].may_level(&of[*j], reach, most)))
    };
    let mut ways_b = choices(of_b.len());
    ways_b.retain(|way| level(way, &of_b));
    let apart: SmallVec<[bool; 32]> =
        of_a.iter().flat_map(|p| of_b.iter().map(|q| !p.may_level(q, reach, most))).collect();
    let lie = |p: &InBox, q: &InBox| told.contains(&[p.lit, q.lit]);
    let lies: SmallVec<[bool; 32]> = of_a.iter().flat_map(|p| of_b.iter().map(|q| lie(p, q))).collect();
    let mut gradients = SmallVec::<[DVec3; MOST_BALANCED]>::new();
    for way_a in choices(of_a.len()).iter().filter(|way| level(way, &of_a)) {
        if bodies.work.is_spent() {
            break;
        }
        for way_b in ways_b.iter().filter(|way_b| way_a.len() + way_b.len() <= MOST_BALANCED) {
            let any = |of: &[bool]| way_a.iter().any(|i| way_b.iter().any(|j| of[i * of_b.len() + j]));
            if any(&apart) || way_a.len() + way_b.len() > 2 && any(&lies) {
                continue;
            }
            let chosen = || way_a.iter().map(|i| &of_a[*i]).chain(way_b.iter().map(|j| &of_b[*j]));
            gradients.clear();
            gradients.extend(chosen().map(|c| c.gradient));
            let turn = chosen().fold(10.0 * BALANCE, |most, c| most.max(c.turn));
            bodies.work.look(1);
            if !has_descent(&gradients, turn) {
                found(chosen().map(|c| c.lit).collect())?;
            }
        }
    }
    ControlFlow::Continue(())
}

/// All choices of one to three of `count`, as indices; of many, those of one and two.
fn choices(count: usize) -> Vec<SmallVec<[usize; 3]>> {
    let mut out = Vec::new();
    for i in 0..count {
        out.push(smallvec![i]);
        for j in i + 1..count {
            out.push(smallvec![i, j]);
            if count <= 8 {
                out.extend((j + 1..count).map(|k| smallvec![i, j, k]));
            }
        }
    }
    out
}

/// Newton's steps to where two faces are nearest to each other.
const MOST_STEPS: usize = 8;
/// How far from where they began, in sizes of the smaller body.
const ASIDE: f64 = 1e-2;
/// Steps to and fro between two surfaces.
const MOST_PACES: usize = 32;

/// What a balance within a box is to the bodies.
fn meeting(bodies: &Bodies, place: &Place, lits: &[Lit], (x, level, lambda): Balance) -> Option<Meeting> {
    let eps = bodies.eps;
    if !place.holds(x, bodies.eps + SLACK * place.half.max_element()) || level.abs() > 0.5 * bodies.tau + eps {
        return None;
    }
    // The whole trees have this value there, and no other.
    if (bodies.f(Side::A, x) - level).abs() > eps || (bodies.f(Side::B, x) - level).abs() > eps {
        return None;
    }
    let sum = |side: Side| {
        let of = lits.iter().zip(&lambda).filter(|(l, _)| l.0 == side);
        of.map(|(l, w)| bodies.slant(*l, x).1 * *w).sum::<DVec3>()
    };
    let normal = (sum(Side::A) - sum(Side::B)).try_normalize()?;
    on_feet(bodies, lits, x, normal).filter(|m| m.gap.abs() <= bodies.tau + eps)
}

/// From a point at which literals balance back to each body's own surface, where both trees confirm it.
fn on_feet(bodies: &Bodies, lits: &[Lit], x: DVec3, normal: DVec3) -> Option<Meeting> {
    // The sharper feature first: a face is met under it, not under the point at which the levels agree.
    let own = |side: Side| lits.iter().filter(|l| l.0 == side).copied().collect::<SmallVec<[Lit; MOST_BALANCED]>>();
    let (of_a, of_b) = (own(Side::A), own(Side::B));
    let feet = if of_a.len() >= of_b.len() {
        let on_a = follow(bodies, &of_a, x);
        [on_a, follow(bodies, &of_b, if of_a.len() > of_b.len() { on_a } else { x })]
    } else {
        let on_b = follow(bodies, &of_b, x);
        [follow(bodies, &of_a, on_b), on_b]
    };
    let on = |feet: [DVec3; 2]| {
        let on = |side: Side, y: DVec3| bodies.f(side, y).abs() <= bodies.eps && bodies.is_bodily(side, y);
        on(Side::A, feet[0]) && on(Side::B, feet[1])
    };
    // F is lowest where the faces' levels agree, the distance a little beside it.
    if let ([a], [b]) = (&of_a[..], &of_b[..])
        && let Some(feet) = facing(bodies, [*a, *b], feet)
        && on(feet)
    {
        return Some(met(bodies, feet, normal));
    }
    // To and fro until the feet stay.
    let mut closer = feet;
    for _ in 0..MOST_PACES {
        let on_a = follow(bodies, &of_a, closer[1]);
        let next = [on_a, follow(bodies, &of_b, on_a)];
        let moved = (next[0] - closer[0]).length().max((next[1] - closer[1]).length());
        closer = next;
        if moved <= bodies.eps {
            break;
        }
    }
    let feet = [closer, feet].into_iter().find(|feet| on(*feet))?;
    Some(met(bodies, feet, normal))
}

/// The meeting of two feet, along a normal.
pub fn met(bodies: &Bodies, feet: [DVec3; 2], normal: DVec3) -> Meeting {
    let way = feet[1] - feet[0];
    // From some distance on the way itself tells the normal best.
    let is_apart = way.dot(normal) > bodies.eps / SLACK;
    let normal = if is_apart { way.normalize() } else { normal };
    Meeting { feet, normal, gap: way.dot(normal) }
}

/// Where two faces are nearest to each other, from feet that are near to it: each face's normal along the way to the other one. Newton's
/// method on that, along two tangents, which holds however small the gap is. `None` where it does not end, as of faces that lie
/// along each other.
fn facing(bodies: &Bodies, [a, b]: [Lit; 2], from: [DVec3; 2]) -> Option<[DVec3; 2]> {
    let [mut p, mut q] = from;
    let aside = |x: DVec3, from: DVec3| x.distance(from) > ASIDE * bodies.size;
    if [a, b].iter().all(|l| bodies.face(*l).is_flat()) {
        return None;
    }
    for _ in 0..MOST_STEPS {
        let (on_a, on_b) = (bodies.look_out(a, p), bodies.look_out(b, q));
        let n = on_a.normal;
        let u = any_perpendicular(n);
        let (way, turned) = (q - p, n + on_b.normal);
        let gap = way.dot(n);
        // The unknowns are the steps of both feet.
        let (mut rows, mut f) = ([[0.0; 6]; 6], [0.0; 6]);
        let mut row = |i: usize, of_p: DVec3, of_q: DVec3, value: f64| {
            rows[i][..3].copy_from_slice(&of_p.to_array());
            rows[i][3..].copy_from_slice(&of_q.to_array());
            f[i] = -value;
        };
        row(0, n, DVec3::ZERO, on_a.value);
        row(1, DVec3::ZERO, on_b.normal, on_b.value);
        for (k, t) in [u, n.cross(u)].into_iter().enumerate() {
            let (bend_a, bend_b) = (on_a.hessian * t, on_b.hessian * t);
            row(2 + k, bend_a * bodies.size, bend_b * bodies.size, t.dot(turned) * bodies.size);
            row(4 + k, -t - bend_a * gap, t, t.dot(way));
        }
        let step = eliminated(&mut rows, f, 6)?;
        let (dp, dq) = (DVec3::from_slice(&step[..3]), DVec3::from_slice(&step[3..]));
        (p, q) = (p + dp, q + dq);
        if !p.is_finite() || !q.is_finite() || aside(p, from[0]) || aside(q, from[1]) {
            return None;
        }
        if dp.length().max(dq.length()) <= bodies.eps {
            return Some([p, q]);
        }
    }
    None
}

/// The meeting at the lowest point of F. Where its faces cannot be followed, what F itself proves: no less than 2F apart.
pub fn nearest(bodies: &Bodies, lowest: &Deepest) -> Meeting {
    let (x, normal, depth, _) = lowest;
    followed(bodies, lowest).unwrap_or_else(|| Meeting {
        feet: [*x + *normal * *depth, *x - *normal * *depth],
        normal: *normal,
        gap: -2.0 * depth,
    })
}

/// The same where its faces can be followed.
pub fn followed(bodies: &Bodies, (x, normal, _, lits): &Deepest) -> Option<Meeting> {
    on_feet(bodies, lits, *x, *normal)
}

/// Where some literals balance, looked for from `x` on.
fn balance(bodies: &Bodies, lits: &[Lit], x: DVec3) -> Option<Balance> {
    let literal = |i: usize, x: DVec3| bodies.bent(lits[i], x);
    balance::balance(&Equations { count: lits.len(), size: bodies.size, tolerance: bodies.eps, literal }, x)
}

/// The nearest point to `x` at which some literals vanish.
fn follow(bodies: &Bodies, lits: &[Lit], mut x: DVec3) -> DVec3 {
    let m = lits.len();
    for _ in 0..6 {
        let at: SmallVec<[(f64, DVec3); MOST_BALANCED]> = lits.iter().map(|l| bodies.slant(*l, x)).collect();
        let (mut gram, mut rhs) = ([[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS], [0.0; MAX_UNKNOWNS]);
        for i in 0..m {
            // The other half of the matrix is not looked at.
            for j in 0..=i {
                gram[i][j] = at[i].1.dot(at[j].1);
            }
            gram[i][i] += 1e-13;
            rhs[i] = -at[i].0;
        }
        let Some(y) = cholesky_solve(&mut gram, rhs, m) else { break };
        let next = x + (0..m).map(|i| at[i].1 * y[i]).sum::<DVec3>();
        if next == x {
            break;
        }
        x = next;
    }
    x
}

/// A body's apex at or over the other body.
fn at_apex(bodies: &Bodies, side: Side, apex: DVec3, others: &[Lit]) -> Option<Meeting> {
    let eps = bodies.eps;
    if bodies.f(side, apex).abs() > eps || !bodies.is_bodily(side, apex) {
        return None;
    }
    let other = if side == Side::A { Side::B } else { Side::A };
    let foot = if bodies.f(other, apex).abs() <= eps {
        apex
    } else {
        others
            .iter()
            .filter(|l| bodies.value(**l, apex).abs() <= bodies.tau + eps)
            .map(|l| bodies.foot(*l, apex))
            .find(|y| bodies.f(other, *y).abs() <= eps)?
    };
    if !bodies.is_bodily(other, foot) {
        return None;
    }
    // On a face its normal; against an edge, a vertex or another apex the average of the adjacent normals.
    let opposite = bodies.average(other, foot);
    let mine = bodies.average(side, apex);
    let out = if bodies.rank(other, foot) == 1 { -opposite } else { mine - opposite };
    let normal = if side == Side::A { out } else { -out }.try_normalize()?;
    let feet = if side == Side::A { [apex, foot] } else { [foot, apex] };
    let gap = (feet[1] - feet[0]).dot(normal);
    (gap.abs() <= bodies.tau + eps).then_some(Meeting { feet, normal, gap })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::instant::separation::Cover;
    use crate::contact::instant::work::Work;
    use crate::contact::query::options::QueryOptions;
    use crate::contact::query::question::{PairQuery, PlacedModel, Strategies, default_resolution};
    use crate::contact::query::task::Task;
    use crate::math::random::Random;
    use crate::motion::Placed;
    use crate::octree::Model;
    use crate::octree::testing::{pierced, simple};
    use crate::solid::Shape;
    use crate::solid::primitive::{Capsule, Cone, Cuboid, Cylinder, Sphere, Torus};
    use contactd_proto::motion::quat_of_rotation_vector;
    use contactd_proto::{Motion, Pose};
    use glam::dvec3;

    /// A shape of about unit size.
    fn shape(r: &mut Random, kind: usize) -> Shape {
        match kind {
            0 => Sphere { radius: r.within(0.5, 1.1) }.into(),
            1 => Cylinder { radius: r.within(0.4, 0.9), half_height: r.within(0.5, 1.2) }.into(),
            2 => Cone { bottom: 0.0, top: r.within(0.6, 1.2), half_height: r.within(0.4, 0.8) }.into(),
            3 => Capsule { half: r.within(0.2, 0.6), radius: r.within(0.3, 0.6) }.into(),
            4 => Torus { major: r.within(0.6, 0.8), minor: r.within(0.2, 0.5) }.into(),
            _ => Cuboid { half: dvec3(r.within(0.3, 0.8), r.within(0.3, 0.8), r.within(0.3, 0.8)) }.into(),
        }
    }

    /// Shows some boxes of what a body and another solid or hollow one have in common, within a wide distance.
    fn each_place(
        r: &mut Random,
        body: (Model, DVec3),
        other: Model,
        mut seen: impl FnMut(&Bodies, &Place, &mut Random),
    ) {
        let (body, center) = body;
        let turn = quat_of_rotation_vector(r.vector(2.0));
        let resting = |model, pose| PlacedModel {
            model,
            placed: Placed { place: Pose::IDENTITY, motion: Motion::resting(pose) },
        };
        let query = PairQuery {
            a: resting(&body, Pose::new(center, turn)),
            b: resting(&other, Pose::IDENTITY),
            resolution: default_resolution(&body, &other),
            cell_limit: 1000,
            strategies: Strategies::default(),
            query_options: QueryOptions::DEPTH,
        };
        let (task, _) = Task::of(&query);
        let (instant, work) = (task.relative.at(0.0), Work::new(1_000_000));
        let bodies = Bodies::new(&task, &instant, 0.25, &work);
        let mut cover = Cover::new(&task, &instant, bodies.tau, bodies.tau, &work);
        for _ in 0..60 {
            let Some(place) = cover.next(0.5 * bodies.tau) else { break };
            seen(&bodies, &place, r);
            cover.split(place, |_| true);
        }
    }

    /// What balances in a box, found from many starts in it.
    fn balances(bodies: &Bodies, place: &Place, lits: &[Lit], r: &mut Random) -> Vec<DVec3> {
        let starts = (0..24).map(|_| place.center + place.half * r.vector(1.0));
        let found = starts.filter_map(|x| balance(bodies, lits, x));
        let found = found.filter(|(x, level, _)| place.holds(*x, 0.0) && level.abs() <= 0.5 * bodies.tau);
        found.map(|(x, ..)| x).collect()
    }

    #[test]
    fn a_box_said_to_hold_one_balance_holds_no_other() {
        let mut r = Random(0x0062_616c_6c73);
        let (mut unique, mut met, mut several) = (0, 0, 0);
        for i in 0..120 {
            let hollow = shape(&mut r, i % 5);
            let other = if i / 5 % 3 == 0 {
                simple(hollow)
            } else {
                pierced(Cuboid { half: DVec3::splat(2.0) }, vec![(hollow, Pose::IDENTITY)])
            };
            // As large as its place allows, or a little larger or smaller; in hollows also about their middle.
            let about = if i / 5 % 3 == 1 && i % 5 != 4 { 0.08 } else { 1.5 };
            let (center, gap) = loop {
                let x = r.vector(about);
                let gap = other.solid.value(x);
                if (0.05..1.2).contains(&gap) {
                    break (x, gap);
                }
            };
            let ball = simple(Sphere { radius: gap * r.within(0.95, 1.05) });
            each_place(&mut r, (ball, center), other, |bodies, place, r| {
                let lits: Vec<Lit> = [Side::A, Side::B].iter().flat_map(|side| place.lits(*side)).copied().collect();
                if lits.len() != 2 || lits[0].0 == lits[1].0 {
                    return;
                }
                let found = balances(bodies, place, &lits, r);
                let spread = found.iter().map(|x| (*x - found[0]).length()).fold(0.0, f64::max);
                if is_unique(bodies, place) {
                    unique += 1;
                    met += usize::from(!found.is_empty());
                    assert!(spread <= 1e-5 * bodies.size, "{i}: balances {spread} apart");
                } else {
                    several += usize::from(spread > 1e-3 * bodies.size);
                }
            });
        }
        assert!(unique > 1000 && met > 50 && several > 5, "{unique} said to hold one, {met} do; {several} hold more");
    }

    #[test]
    fn every_set_that_balances_in_a_box_is_handed_over() {
        const ENOUGH: usize = 100;
        let mut r = Random(0x0073_6574_7300);
        let (mut balanced, mut kept_out) = (0, 0);
        // Long: CONTACTD_SETS=1440.
        let count = std::env::var("CONTACTD_SETS").ok().and_then(|n| n.parse().ok()).unwrap_or(144);
        for i in 0..count {
            let [p, q, hole] = [i % 6, i / 6 % 6, (i + 1) % 6].map(|kind| shape(&mut r, kind));
            let at = Pose::at(r.vector(0.3));
            let (body, other) = (if i % 3 == 0 { pierced(p, vec![(hole, at)]) } else { simple(p) }, simple(q));
            // Near enough to touch, more or less.
            let center = loop {
                let x = r.vector(1.5);
                if (0.3..0.8).contains(&other.solid.value(x)) {
                    break x;
                }
            };
            each_place(&mut r, (body, center), other, |bodies, place, r| {
                let mut listed = Vec::new();
                let _ = each_system(bodies, place, &[], |lits| {
                    listed.push(lits);
                    ControlFlow::Continue(())
                });
                for &p in place.lits(Side::A) {
                    for &q in place.lits(Side::B) {
                        let lits: System = smallvec![p, q];
                        if listed.contains(&lits) {
                            continue;
                        }
                        kept_out += 1;
                        let found = balances(bodies, place, &lits, r);
                        assert!(found.is_empty(), "{i}: {lits:?} balance at {found:?} and were left out");
                    }
                }
                // No more than it takes to know that such places are met: each is as dear as one that was left out.
                for lits in &listed {
                    if balanced <= ENOUGH {
                        balanced += usize::from(!balances(bodies, place, lits, r).is_empty());
                    }
                }
            });
        }
        assert!(balanced > ENOUGH && kept_out > 2000, "{balanced} balance, {kept_out} left out");
    }
}
