//! Checks certificates of what a session has remembered (docs/certificate.md, "What is remembered") against the motions that
//! its bodies truly make in the step.
//!
//! Everything is worked out from the solids, the poses in the text and the motions that the caller gives, in intervals: how far a
//! body reaches along a direction by formulas of its own for each primitive, how far bodies have gone from where they stood by
//! their poses alone. What is added up on the server is not asked for.

use super::bound::BUDGET;
use super::interval::{Interval, Vector, apply, cross, dot, minus, plus, point, product, times, transpose, vector};
use super::motion::{Motions, rotation, turned};
use super::{Bounder, Checked, Region, certain, check_cells, check_level, expression, extent, extent_in, number};
use contactd::contact::probe::{PointOptions, PosedModel, points as probe};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::{Node, NodeId, Op, Shape, Solid};
use contactd_proto::{Motion, Pose};
use glam::{DQuat, DVec3};

/// What was found to hold.
#[derive(Clone, Copy, Debug)]
pub enum Proven {
    /// Apart over the whole step by a distance measured before.
    Clearance,
    /// Apart over the whole step along directions.
    Directions,
    /// Apart over the whole step since they keep to a predicted motion.
    PredictedMotion,
    /// The same question: what its certificate proves.
    Answer(Checked),
    /// The same question: in each other at the start.
    Overlap,
    /// Of a step that asks for its first contact: free of contact until later than that.
    Horizon {
        /// When the first pair has met.
        first: f64,
        /// Until then this one has not.
        until: f64,
    },
    /// The same question: farther apart than a threshold.
    Apart {
        /// The threshold.
        threshold: f64,
        /// Until then.
        until: f64,
    },
    /// The same question: touching where it is told, and nowhere else.
    Regions {
        /// How near is touching.
        threshold: f64,
        /// When.
        time: f64,
    },
}

/// Two bodies that a certificate names beside its own, as they move in the step, and their pair's resolution.
pub type Others<'a> = dyn Fn(u32, u32) -> Option<([Truth<'a>; 2], f64)> + 'a;

/// A body as it truly is in the step.
#[derive(Clone, Copy, Debug)]
pub struct Truth<'a> {
    solid: &'a Solid,
    placed: Placed,
    /// A box around the solid, its own frame; `None` for an empty one.
    extent: Option<[Interval; 3]>,
    /// Farthest point from the object's origin, at most.
    reach: f64,
}

/// By what a body is bounded: its box, its whole tree, or that with directions split among what intersects.
#[derive(Clone, Copy, Debug, PartialEq)]
enum By {
    Box,
    Tree,
    Split,
}

/// Spans of time that a proof by directions may be halved into.
const SPANS: usize = 4096;

/// How far those points of a solid that lie in a box reach along a direction of its own frame, at most.
fn support(solid: &Solid, node: NodeId, m: Vector, clip: [Interval; 3]) -> f64 {
    let Some(all) = extent_in(solid, node, 0.0, clip) else { return f64::NEG_INFINITY };
    let own = match &solid.nodes[node as usize] {
        Node::Empty => f64::NEG_INFINITY,
        Node::Primitive(p) => primitive_support(solid, *p, m),
        Node::Op(Op::Difference, children) => support(solid, children[0], m, clip),
        Node::Op(Op::Union, children) => {
            children.iter().map(|c| support(solid, *c, m, clip)).fold(f64::NEG_INFINITY, f64::max)
        }
        Node::Op(Op::Intersection, children) => {
            children.iter().map(|c| support(solid, *c, m, all)).fold(f64::INFINITY, f64::min)
        }
    };
    own.min(box_support(&all, m))
}

/// The steps by which parts of a direction go over from one operand to another: of disjoint operands no step is too long.
const STEPS: [f64; 11] = [4.0, 2.0, 1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625, 0.0078125, 0.00390625];

/// Rounds of such steps, of each length.
const ROUNDS: usize = 12;
/// Intersections that a tree is expanded into, at most.
const EXPANDED: usize = 64;

/// What a node is within: the operands of its intersections, and of its differences the first ones.
fn operands(solid: &Solid, node: NodeId, out: &mut Vec<NodeId>) {
    match &solid.nodes[node as usize] {
        Node::Op(Op::Intersection, children) => children.iter().for_each(|c| operands(solid, *c, out)),
        Node::Op(Op::Difference, children) => operands(solid, children[0], out),
        Node::Op(Op::Union, _) | Node::Primitive(_) | Node::Empty => out.push(node),
    }
}

/// The same for an intersection. Of any vectors that sum up to m, one for each operand, the operands' supports along them sum up to
/// no less than what the intersection reaches along m; for convex operands the best split reaches just that (R. Rockafellar, Convex
/// Analysis (1970), theorem 16.4). The split is looked for by steps on a grid.
fn split_support(solid: &Solid, node: NodeId, m: Vector, clip: [Interval; 3]) -> f64 {
    let mut children = Vec::new();
    operands(solid, node, &mut children);
    split_among(solid, &children, m, clip, EXPANDED).min(support(solid, node, m, clip))
}

/// The same of the operands of an intersection. One that is a union is each of its operands in turn, as long as there are fewer than
/// `left` intersections.
fn split_among(solid: &Solid, children: &[NodeId], m: Vector, clip: [Interval; 3], left: usize) -> f64 {
    for (k, child) in children.iter().enumerate() {
        if let Node::Op(Op::Union, parts) = &solid.nodes[*child as usize]
            && parts.len() <= left
        {
            let each = parts.iter().map(|part| {
                let mut of_part = children.to_vec();
                of_part.remove(k);
                operands(solid, *part, &mut of_part);
                split_among(solid, &of_part, m, clip, left / parts.len())
            });
            return each.fold(f64::NEG_INFINITY, f64::max);
        }
    }
    let plain = children.iter().map(|c| support(solid, *c, m, clip)).fold(f64::INFINITY, f64::min);
    if children.len() < 2 {
        return plain;
    }
    let of = |parts: &[[f64; 3]], rest: usize| {
        // One operand takes what rounding leaves of the others' sum.
        let mut left = m;
        let mut sum = point(0.0);
        for (k, part) in parts.iter().enumerate().filter(|(k, part)| *k != rest && **part != [0.0; 3]) {
            left = minus(left, vector(*part));
            sum = sum + point(support(solid, children[k], vector(*part), clip));
        }
        (sum + point(support(solid, children[rest], left, clip))).hi
    };
    let reaches = |k: usize| support(solid, children[k], m, clip);
    let Some(rest) = (0..children.len()).min_by(|p, q| reaches(*p).total_cmp(&reaches(*q))) else { return plain };
    let mut parts = vec![[0.0; 3]; children.len()];
    let mut best = of(&parts, rest).min(plain);
    for step in STEPS {
        // As long as a round of them leads down.
        for _ in 0..ROUNDS {
            let reached = best;
            for k in (0..children.len()).filter(|k| *k != rest) {
                // To the 26 neighbours in a cubic grid.
                for way in (0..27).filter(|way| *way != 13) {
                    let before = parts[k];
                    let to = [way % 3, way / 3 % 3, way / 9].map(|digit| step * (f64::from(digit) - 1.0));
                    parts[k] = std::array::from_fn(|j| before[j] + to[j]);
                    let sum = of(&parts, rest);
                    if sum < best {
                        best = sum;
                    } else {
                        parts[k] = before;
                    }
                }
            }
            if best == reached {
                break;
            }
        }
    }
    best
}

fn box_support(all: &[Interval; 3], m: Vector) -> f64 {
    let mut sum = point(0.0);
    for k in 0..3 {
        if !(all[k].lo.is_finite() && all[k].hi.is_finite()) {
            return f64::INFINITY;
        }
        let most = (m[k] * point(all[k].hi)).hi.max((m[k] * point(all[k].lo)).hi);
        sum = sum + point(most);
    }
    sum.hi
}

fn primitive_support(solid: &Solid, p: u32, m: Vector) -> f64 {
    let p = &solid.primitives[p as usize];
    let n = apply(&transpose(&rotation(&p.frame)), m);
    let at = dot(vector(p.frame.position.to_array()), m);
    let abs = |x: Interval| point(x.mag());
    let across = (n[0].square() + n[1].square()).sqrt();
    let own = match &p.shape {
        Shape::Sphere(s) => point(s.radius) * (n[0].square() + n[1].square() + n[2].square()).sqrt(),
        Shape::Cylinder(c) => point(c.half_height) * abs(n[2]) + point(c.radius) * across,
        Shape::Cone(c) => {
            let top = point(c.half_height) * n[2] + point(c.top) * across;
            let bottom = point(-c.half_height) * n[2] + point(c.bottom) * across;
            point(top.hi.max(bottom.hi))
        }
        Shape::Cuboid(c) => point(c.half.x) * abs(n[0]) + point(c.half.y) * abs(n[1]) + point(c.half.z) * abs(n[2]),
        Shape::Polyhedron(p) => {
            let each = p.vertices.iter().map(|v| dot(vector(v.to_array()), n).hi);
            point(each.fold(f64::NEG_INFINITY, f64::max))
        }
        Shape::TriangleMesh(m) => {
            let each = m.vertices().iter().map(|v| dot(vector(v.to_array()), n).hi);
            point(each.fold(f64::NEG_INFINITY, f64::max))
        }
        Shape::Torus(t) => {
            point(t.major) * across + point(t.minor) * (n[0].square() + n[1].square() + n[2].square()).sqrt()
        }
        Shape::Capsule(c) => {
            point(c.half) * abs(n[2]) + point(c.radius) * (n[0].square() + n[1].square() + n[2].square()).sqrt()
        }
        Shape::Ellipsoid(e) => {
            let [a, b, c] = std::array::from_fn(|k| (point(e.semi[k]) * n[k]).square());
            (a + b + c).sqrt()
        }
        Shape::Superellipsoid(s) => super::norm::reach(s.semi, s.exponents, n),
        Shape::EllipticFrustum(c) => {
            let rim = ((point(c.semi.x) * n[0]).square() + (point(c.semi.y) * n[1]).square()).sqrt();
            let up = n[2] + point(c.lean.x) * n[0] + point(c.lean.y) * n[1];
            let top = point(c.half_height) * up + point(c.top) * rim;
            let bottom = point(-c.half_height) * up + point(c.bottom) * rim;
            point(top.hi.max(bottom.hi))
        }
        Shape::HalfSpace(_) => return f64::INFINITY,
        Shape::Quadric(q) => match crate::quadrics::checked_box(q, 0.0) {
            Some(held) => {
                let each = held.corners().map(|v| dot(vector(v.to_array()), n).hi);
                point(each.into_iter().fold(f64::NEG_INFINITY, f64::max))
            }
            None => return f64::INFINITY,
        },
    };
    (at + own).hi
}

/// How far those points of a solid that lie in a box are from an origin, at most: no farther than the corners of their box, and those
/// of a primitive no farther than the corners of its box along its own axes.
fn farthest(solid: &Solid, node: NodeId, origin: Vector, clip: [Interval; 3]) -> f64 {
    let Some(all) = extent_in(solid, node, 0.0, clip) else { return 0.0 };
    let among = |children: &[NodeId], clip| -> Vec<f64> {
        children.iter().map(|c| farthest(solid, *c, origin, clip)).collect()
    };
    let own = match &solid.nodes[node as usize] {
        Node::Empty => 0.0,
        Node::Primitive(p) => {
            let axes = transpose(&rotation(&solid.primitives[*p as usize].frame));
            let along = |m: Vector| primitive_support(solid, *p, m) - dot(origin, m).lo;
            let sides = axes.map(|m| along(m).max(along(m.map(|x| -x))));
            match &solid.primitives[*p as usize].shape {
                Shape::Sphere(s) => {
                    let center = vector(solid.primitives[*p as usize].frame.position.to_array());
                    (point(length(minus(center, origin))) + point(s.radius)).hi
                }
                _ => length(sides.map(point)),
            }
        }
        Node::Op(Op::Difference, children) => farthest(solid, children[0], origin, clip),
        Node::Op(Op::Union, children) => among(children, clip).into_iter().fold(0.0, f64::max),
        Node::Op(Op::Intersection, children) => among(children, all).into_iter().fold(f64::INFINITY, f64::min),
    };
    let corner = length(std::array::from_fn(|k| point((all[k] - origin[k]).mag())));
    own.min(corner)
}

fn length(v: Vector) -> f64 {
    (v[0].square() + v[1].square() + v[2].square()).sqrt().hi
}

impl<'a> Truth<'a> {
    /// A solid with its place and motion.
    pub fn new(solid: &'a Solid, placed: Placed) -> Self {
        let extent = extent(solid, solid.root, 0.0);
        let mut reach: f64 = 0.0;
        if let Some(all) = extent {
            let m = rotation(&placed.place);
            for i in 0..8u32 {
                let corner: Vector =
                    std::array::from_fn(|k| point(if i >> k & 1 == 0 { all[k].lo } else { all[k].hi }));
                reach = reach.max(length(plus(apply(&m, corner), vector(placed.place.position.to_array()))));
            }
            if reach.is_finite() {
                let origin = apply(&transpose(&m), vector(placed.place.position.to_array())).map(|x| -x);
                reach = reach.min(farthest(solid, solid.root, origin, all));
            }
        }
        Self { solid, placed, extent, reach }
    }

    /// The same with another motion.
    pub fn moving(self, motion: Motion) -> Self {
        Self { placed: Placed { motion, ..self.placed }, ..self }
    }

    /// The outward normal of a half-space, and how far its plane lies from its object's origin along it, along the
    /// world's axes at a time of a motion; `None` for another solid.
    fn plane(&self, motion: &Motion, t: f64) -> Option<(Vector, Interval)> {
        let Node::Primitive(p) = self.solid.nodes[self.solid.root as usize] else { return None };
        let primitive = &self.solid.primitives[p as usize];
        if !matches!(primitive.shape, Shape::HalfSpace(_)) {
            return None;
        }
        let place = rotation(&self.placed.place);
        let r = product(&turned(vector(motion.spin.to_array()), point(t)), &rotation(&motion.start));
        let turn = product(&r, &place);
        let n = apply(&product(&turn, &rotation(&primitive.frame)), vector([0.0, 0.0, 1.0]));
        let at = plus(
            apply(&place, vector(primitive.frame.position.to_array())),
            vector(self.placed.place.position.to_array()),
        );
        Some((n, dot(apply(&r, at), n)))
    }

    /// How far a point of it is displaced by a turn of this size, at most; none displaces no point of a body without
    /// bounds.
    fn swing(&self, turn: f64) -> f64 {
        if turn == 0.0 { 0.0 } else { turn * self.reach }
    }

    /// True for a half-space that turns about its own normal: nothing of it goes anywhere by that.
    fn turns_in_itself(&self, motion: &Motion) -> bool {
        let spin = vector(motion.spin.to_array());
        self.plane(motion, 0.0).is_some_and(|(n, _)| length(cross(spin, n)) <= 1e-12 * length(spin))
    }

    /// How far it reaches from its object's origin along a direction of the world at a time of a motion.
    fn support(&self, motion: &Motion, n: Vector, t: f64, by: By) -> f64 {
        let r = product(&turned(vector(motion.spin.to_array()), point(t)), &rotation(&motion.start));
        let along = apply(&transpose(&r), n);
        let own = apply(&transpose(&rotation(&self.placed.place)), along);
        let solid = self.extent.map_or(f64::NEG_INFINITY, |all| match by {
            By::Box => box_support(&all, own),
            By::Tree => support(self.solid, self.solid.root, own, all),
            By::Split => split_support(self.solid, self.solid.root, own, all),
        });
        (point(solid) + dot(vector(self.placed.place.position.to_array()), along)).hi
    }
}

/// The gap of two bodies along n (from the first to the second) at a time of two motions, at least.
fn gap(bodies: &[Truth; 2], motions: &[Motion; 2], n: Vector, t: f64, by: By) -> f64 {
    let [p, q] = motions.map(|m| vector(m.start.position.to_array()));
    let [v, w] = motions.map(|m| vector(m.velocity.to_array()));
    let way = plus(minus(q, p), times(point(t), minus(w, v)));
    // A half-space reaches nowhere but along its own normal: that stands for a direction that is it but for rounding.
    let own = [bodies[0].plane(&motions[0], t), bodies[1].plane(&motions[1], t)];
    if let [Some((u, far)), None] | [None, Some((u, far))] = own {
        let (k, sign) = if own[0].is_some() { (1, 1.0) } else { (0, -1.0) };
        let along = times(point(sign), u);
        if length(minus(along, n)) > 1e-9 {
            return f64::NEG_INFINITY;
        }
        let other = bodies[k].support(&motions[k], times(point(-1.0), u), t, by);
        return (dot(way, along) - point(other) - far).lo;
    }
    let back = times(point(-1.0), n);
    let (a, b) = (bodies[0].support(&motions[0], n, t, by), bodies[1].support(&motions[1], back, t, by));
    if a == f64::NEG_INFINITY || b == f64::NEG_INFINITY {
        // Nothing is apart from everything.
        return f64::INFINITY;
    }
    (dot(way, n) - point(a) - point(b)).lo
}

/// True when two bodies are farther than `least` apart over [t0, t1] of their motions, along a direction that goes over from one
/// to another. For points a, b of the bodies n·(b − a) has a second derivative of at most 2|ν|(|v₀| + ω_A ρ_A + ω_B ρ_B) +
/// |n|(ω_A² ρ_A + ω_B² ρ_B), so over a span h it lies above the line between its ends by no less than −⅛ of that times h².
fn apart(bodies: &[Truth; 2], motions: &[Motion; 2], from: (f64, DVec3), to: (f64, DVec3), least: f64) -> bool {
    [By::Box, By::Tree, By::Split].into_iter().any(|by| apart_by(bodies, motions, from, to, least, by))
}

fn apart_by(
    bodies: &[Truth; 2],
    motions: &[Motion; 2],
    (t0, n0): (f64, DVec3),
    (t1, n1): (f64, DVec3),
    least: f64,
    by: By,
) -> bool {
    let up = 1.0 + 1e-12;
    let omega = motions.map(|m| m.spin.length() * up);
    let way = (motions[0].velocity - motions[1].velocity).length() * up;
    // What turns without bounds has no bound of its own.
    let swing = [0, 1].map(|k| if bodies[k].turns_in_itself(&motions[k]) { 0.0 } else { bodies[k].swing(omega[k]) });
    let speed = way + swing[0] + swing[1];
    let pull = omega[0] * swing[0] + omega[1] * swing[1];
    let longest = n0.length().max(n1.length()) * up;
    let turn = if t1 > t0 { (n1 - n0).length() / (t1 - t0) * up } else { 0.0 };
    let curve = (2.0 * turn * speed + longest * pull) * up;
    let at = |t: f64| {
        let s = if t1 > t0 { (t - t0) / (t1 - t0) } else { 0.0 };
        let n = if n0 == n1 { n0 } else { n0 * (1.0 - s) + n1 * s };
        // However the direction is rounded: it is one, and the bound of its turning has room for that.
        gap(bodies, motions, vector(n.to_array()), t, by)
    };
    let (first, last) = (at(t0), at(t1));
    let need = least * longest;
    let mut stack = vec![((t0, first), (t1, last))];
    for _ in 0..SPANS {
        let Some((p, q)) = stack.pop() else { return true };
        if !(p.1 > need && q.1 > need) {
            return false;
        }
        let h = q.0 - p.0;
        // Mixed directions are shorter than unit ones: a gap along them is at least as much in lengths.
        if p.1.min(q.1) - 0.125 * curve * h * h > need {
            continue;
        }
        let t = 0.5 * (p.0 + q.0);
        let middle = (t, at(t));
        stack.push((middle, q));
        stack.push((p, middle));
    }
    false
}

/// Sine of half the angle between two rotations, at most.
fn half_angle_sine(p: DQuat, q: DQuat) -> f64 {
    let r = p.normalize() * q.normalize().conjugate();
    DVec3::new(r.x, r.y, r.z).length() + 1e-15
}

/// How far any point of a body is, over the step that it truly makes, from where it would be in `expected` at the same time.
fn strays(body: &Truth, expected: &Motion) -> f64 {
    let truth = &body.placed.motion;
    let off = truth.start.position - expected.start.position;
    let later = off + (truth.velocity - expected.velocity);
    let turned = 2.0 * half_angle_sine(truth.start.rotation, expected.start.rotation);
    let turning = (turned + (truth.spin - expected.spin).length()).min(2.0);
    let size = truth.start.position.abs().max_element() + expected.start.position.abs().max_element();
    let stays = truth.start.rotation == expected.start.rotation && truth.spin == expected.spin;
    let turning = if stays { 0.0 } else { turning };
    (off.length().max(later.length()) + body.swing(turning)) * (1.0 + 1e-14) + 4.0 * f64::EPSILON * size
}

/// True when a point of the world lies for certain at a depth in both bodies at a time; of a negative depth: no farther from them, as
/// f measures it. `inside_out`: of what is not in the bodies.
fn is_deep(bodies: &[Truth; 2], x: DVec3, t: f64, depth: f64, inside_out: [bool; 2]) -> bool {
    let [a, b] = bodies;
    let place = a.placed.place.inverse();
    let x = place.point(a.placed.motion.at(t).inverse().point(x));
    let motions = Motions::new(&a.placed, &b.placed);
    let mut bounder =
        Bounder { a: a.solid, b: b.solid, motions, depth, evaluations: 0, budget: BUDGET, exhausted: false };
    let region = Region([(x.x, x.x), (x.y, x.y), (x.z, x.z), (t, t)]);
    let own = expression(a.solid, a.solid.root, inside_out[0], false);
    let other = expression(b.solid, b.solid.root, inside_out[1], true);
    certain(&mut bounder, &own, region) && certain(&mut bounder, &other, region)
}

/// Checks the certificate of one pair: its text, the two bodies as they truly move in the step (the one with the smaller id
/// first) and the resolution of the pair. Apart means: by more than the resolution.
///
/// # Errors
/// The first thing that is not certain.
pub fn check(
    text: &str,
    ids: (u32, u32),
    bodies: [Truth; 2],
    resolution: f64,
    others: &Others,
) -> Result<Proven, String> {
    let (head, rest) = text.split_once('\n').ok_or("no line")?;
    let words: Vec<&str> = head.split(' ').collect();
    let ["pair", a, b, kind, words @ ..] = words.as_slice() else { return Err("not the head of a pair".into()) };
    if (a.parse().ok(), b.parse().ok()) != (Some(ids.0), Some(ids.1)) {
        return Err("another pair".into());
    }
    let motions = [bodies[0].placed.motion, bodies[1].placed.motion];
    match *kind {
        "clearance" => {
            let mut numbers = Numbers::of(words)?;
            let clearance = numbers.next()?;
            let along = numbers.vector()?;
            let poses = [numbers.pose()?, numbers.pose()?];
            let then = poses.map(Motion::resting);
            let unit = (along.length() - 1.0).abs() < 1e-9;
            let gone = strays(&bodies[0], &then[0]) + strays(&bodies[1], &then[1]);
            // A half-space is measured by where its body stands.
            let far = |k: usize| Some(bodies[k].reach).filter(|r| r.is_finite()).unwrap_or(poses[k].position.length());
            let size = 1e-12 * (far(0) + far(1) + gone);
            let n = vector(along.to_array());
            let least = (clearance - size).max((gone + resolution) * (1.0 + 1e-8));
            let mut apart = f64::NEG_INFINITY;
            for by in [By::Box, By::Tree, By::Split] {
                if apart <= least {
                    apart = apart.max(gap(&bodies, &then, n, 0.0, by));
                }
            }
            if !unit || apart < clearance - size {
                return Err(format!("the bodies were {apart:e} apart, not {clearance:e}"));
            }
            if apart * (1.0 - 2e-9) - gone <= resolution {
                return Err(format!("{apart:e} apart, they may have gone {gone:e} since"));
            }
            Ok(Proven::Clearance)
        }
        "directions" => {
            let mut numbers = Numbers::of(words)?;
            let (n0, n1) = (numbers.vector()?, numbers.vector()?);
            if apart(&bodies, &motions, (0.0, n0), (1.0, n1), resolution) {
                Ok(Proven::Directions)
            } else {
                Err("the directions do not keep the bodies apart".into())
            }
        }
        "prediction" => prediction(words, rest, &bodies, resolution),
        "answer" => {
            let mut numbers = Numbers::of(words)?;
            let asked = [numbers.motion()?, numbers.motion()?];
            if asked != motions {
                return Err("another question".into());
            }
            let [a, b] = &bodies;
            if let Some(x) = rest.strip_prefix("overlap ") {
                let words: Vec<&str> = x.trim_end().split(' ').collect();
                let x = Numbers::of(&words)?.vector()?;
                if is_deep(&bodies, x, 0.0, resolution, [false; 2]) {
                    return Ok(Proven::Overlap);
                }
                return Err("the point is not inside both bodies".into());
            }
            super::check(rest, (0, 1), (a.solid, &a.placed), (b.solid, &b.placed)).map(Proven::Answer)
        }
        "horizon" => {
            let mut numbers = Numbers::of(words)?;
            let (first, until) = (numbers.next()?, numbers.next()?);
            let (c, d) = (numbers.next()? as u32, numbers.next()? as u32);
            let x = numbers.vector()?;
            let (pair, theirs) = others(c, d).ok_or("the pair that meets first is none")?;
            if !(0.0..=1.0).contains(&first) || !is_deep(&pair, x, first, super::WITNESS * theirs, [false; 2]) {
                return Err(format!("{c} and {d} are not seen to have met at {first}"));
            }
            let [a, b] = &bodies;
            let checked = super::check(rest, (0, 1), (a.solid, &a.placed), (b.solid, &b.placed))?;
            if checked.until < until || until <= first && until < 1.0 {
                return Err(format!("free until {}, told {until}, the first contact comes by {first}", checked.until));
            }
            Ok(Proven::Horizon { first, until })
        }
        "apart" => {
            let mut numbers = Numbers::of(words)?;
            let (since, threshold, until) = (numbers.next()?, numbers.next()?, numbers.next()?);
            if since < 0.0 || [numbers.motion()?, numbers.motion()?] != motions {
                return Err("another question".into());
            }
            let [a, b] = &bodies;
            let checked = check_level(rest, (0, 1), (a.solid, &a.placed), (b.solid, &b.placed))?;
            if checked.until < until || -2.0 * checked.depth < APART * threshold {
                let (until, distance) = (checked.until, -2.0 * checked.depth);
                return Err(format!("{distance:e} apart until {until}, the threshold is {threshold:e}"));
            }
            Ok(Proven::Apart { threshold, until })
        }
        "regions" => {
            let mut numbers = Numbers::of(words)?;
            let (since, time, threshold) = (numbers.next()?, numbers.next()?, numbers.next()?);
            let count = numbers.next()? as usize;
            if since < 0.0 || [numbers.motion()?, numbers.motion()?] != motions {
                return Err("another question".into());
            }
            let still = bodies.map(|b| b.moving(Motion::resting(b.placed.motion.at(time))));
            regions(rest, (count, threshold), &still, resolution)?;
            Ok(Proven::Regions { threshold, time })
        }
        _ => Err(format!("{kind:?} is no kind of memory")),
    }
}

/// Of a threshold as much must be proven as apart: the rest is the checker's room.
const APART: f64 = 0.75;
/// Of half a threshold as much must be proven as told. f is less than the distance where edges are sharp.
const TOLD: f64 = 0.25;

/// Where bodies that stand touch: each point of the regions told lies half way between surfaces that are as far apart as it says, and
/// every place in which they may touch hangs together with one of the points.
fn regions(text: &str, (count, threshold): (usize, f64), bodies: &[Truth; 2], resolution: f64) -> Result<(), String> {
    let cells = text.find("pair ").ok_or("the cells are missing")?;
    let (told, cells) = text.split_at(cells);
    let mut points: Vec<DVec3> = Vec::new();
    let (mut regions, mut left, mut is_line) = (0, 0.0, false);
    for line in told.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let mut numbers = Numbers::of(&words)?;
        match words[0] {
            "region" => {
                let normal = numbers.vector()?;
                if (normal.length() - 1.0).abs() > 1e-9 || left != 0.0 {
                    return Err(format!("{line}: no region"));
                }
                regions += 1;
                is_line = words[1] == "line";
                left = numbers.next()?;
            }
            "point" => {
                let (x, separation) = (numbers.vector()?, numbers.next()?);
                let size = bodies[0].reach.min(bodies[1].reach) + x.abs().max_element();
                let slack = 0.25 * resolution + 1e-10 * size;
                let within = |f: f64| {
                    let ways = [[false, false], [true, true]];
                    ways.iter().all(|way| is_deep(bodies, x, 0.0, -f - slack, *way))
                };
                // At sharp edges f is less than the distance: what is nearest where nothing else is, may be farther apart.
                let is_nearest = count == 1 && !is_line && left == 1.0 && points.is_empty();
                if separation.abs() > threshold * (1.0 + 1e-6) + slack && !is_nearest {
                    return Err(format!("{line}: farther apart than {threshold:e}"));
                }
                // The very end of a line may lie on the edge that it runs along, as far beyond the threshold as its middle is within it.
                // Surfaces may lean against each other by as much as opens the threshold over a body: their middle is off by its square.
                let lean = threshold / bodies[0].reach.min(bodies[1].reach);
                let most = if is_line { 2.0 * threshold } else { 0.5 * separation.abs() * (1.0 + lean * lean) };
                if !within(most) {
                    return Err(format!("{line}: not within {most:e} of both surfaces"));
                }
                points.push(x);
                left -= 1.0;
            }
            _ => return Err(format!("{line}: neither region nor point")),
        }
    }
    if regions != count || left != 0.0 {
        return Err("regions or points are left over or missing".into());
    }
    let [a, b] = bodies;
    let mut boxes = Vec::new();
    let sides = ((a.solid, &a.placed), (b.solid, &b.placed));
    let checked = check_cells(BUDGET, cells, (0, 1), sides, Some(&mut boxes))?;
    if -2.0 * checked.depth < TOLD * threshold * (1.0 - 1e-9) {
        return Err(format!("proven for {:e} alone, the threshold is {threshold:e}", -2.0 * checked.depth));
    }
    let reference = &bodies[usize::from(cells.starts_with("pair 0 1 reference 1"))];
    let into = |x: &DVec3| {
        reference.placed.place.inverse().point(reference.placed.motion.start.inverse().point(*x)).to_array()
    };
    let points: Vec<[f64; 3]> = points.iter().map(into).collect();
    let near = 1e-9 * (a.reach.min(b.reach) + threshold);
    let holds =
        |cell: &[(f64, f64); 3], x: &[f64; 3]| (0..3).all(|k| cell[k].0 - near <= x[k] && x[k] <= cell[k].1 + near);
    let meets =
        |p: &[(f64, f64); 3], q: &[(f64, f64); 3]| (0..3).all(|k| p[k].0 - near <= q[k].1 && q[k].0 <= p[k].1 + near);
    // From the cells with a point to all that hang together with them.
    let (mut told, mut rest): (Vec<_>, Vec<_>) =
        boxes.into_iter().partition(|cell| points.iter().any(|x| holds(cell, x)));
    while let Some(cell) = told.pop() {
        let (near, far) = rest.into_iter().partition(|other| meets(&cell, other));
        rest = far;
        told.extend::<Vec<_>>(near);
    }
    // At sharp edges, as of meshes, f says little of the distance: there nothing touches where both bodies are proven too far away, by
    // `probe`, which has judges of its own.
    if !rest.is_empty() {
        let models = bodies.map(|b| Model::new(b.solid.clone()));
        rest.retain(|cell| !is_far(cell, reference, bodies, &models, threshold));
    }
    match rest.first() {
        Some(cell) => Err(format!("{UNTOLD}: {} cells, of which one is {cell:?}", rest.len())),
        None => Ok(()),
    }
}

/// True when no surfaces within a cell (of the reference body's model) are as near to each other as a threshold: from its centre the
/// distances of both bodies are longer together than that and than the way from there to its corners and back.
fn is_far(cell: &[(f64, f64); 3], reference: &Truth, bodies: &[Truth; 2], models: &[Model; 2], threshold: f64) -> bool {
    let pose = |b: &Truth| {
        let at = b.placed.motion.start;
        Pose::new(at.point(b.placed.place.position), at.rotation * b.placed.place.rotation)
    };
    let [low, high] = [cell.map(|s| s.0), cell.map(|s| s.1)].map(DVec3::from_array);
    let (center, radius) = (pose(reference).point(0.5 * (low + high)), 0.5 * (high - low).length());
    let options = PointOptions { surface: 0.0, tolerance: 0.1 * threshold, limit: 20_000 };
    let off = |k: usize| {
        let body = PosedModel { model: &models[k], pose: pose(&bodies[k]) };
        probe(&body, &[center], &options)[0].lower.max(0.0)
    };
    off(0) + off(1) > threshold + 2.0 * radius
}

/// How the error begins of bodies that may touch where nothing is told.
pub const UNTOLD: &str = "they may touch where nothing is told";

/// A predicted motion: the bodies were proven to keep a distance over motions, and stray from these by less.
fn prediction(words: &[&str], rest: &str, bodies: &[Truth; 2], resolution: f64) -> Result<Proven, String> {
    let mut numbers = Numbers::of(words)?;
    let (since, steps, until) = (numbers.next()?, numbers.next()?, numbers.next()?);
    let expected = [numbers.motion()?, numbers.motion()?];
    let stands = since >= steps;
    if !(since >= 0.0 && steps >= 1.0) || !stands && since + 1.0 > steps.min(until) || stands && until < f64::INFINITY {
        return Err("the step is not within the prediction".into());
    }
    // As the bodies were expected to go in this step.
    let now = expected.map(|m| {
        let start = m.at(since.min(steps));
        if stands { Motion::resting(start) } else { Motion { start, ..m } }
    });
    let astray = strays(&bodies[0], &now[0]) + strays(&bodies[1], &now[1]);
    let whole = expected.map(|m| Motion { velocity: m.velocity * steps, spin: m.spin * steps, ..m });
    // This step's part of the predicted motion, as a fraction of it.
    let (from, to) = if stands { (1.0, 1.0) } else { (since / steps, (since + 1.0) / steps) };
    if rest.starts_with("from ") {
        let mut turns = Vec::new();
        for line in rest.lines() {
            let words: Vec<&str> = line.split(' ').skip(1).collect();
            let mut numbers = Numbers::of(&words)?;
            turns.push((numbers.next()?, numbers.vector()?));
        }
        let least = astray + resolution;
        for (i, (begin, n)) in turns.iter().enumerate() {
            let end = turns.get(i + 1).map_or(1.0, |next| next.0);
            let (t0, t1) = (begin.max(from), end.min(to));
            let here = if i == 0 { t0 <= from || t0 <= t1 } else { t0 <= t1 };
            if here && t0 <= t1 && !apart(bodies, &whole, (t0, *n), (t1, *n), least) {
                return Err(format!("direction {i} does not keep the bodies {least:e} apart on their prediction"));
            }
        }
        let begins = turns.first().is_some_and(|t| t.0 <= from);
        let ordered = turns.windows(2).all(|w| w[0].0 <= w[1].0);
        return if begins && ordered {
            Ok(Proven::PredictedMotion)
        } else {
            Err("the directions leave time out".into())
        };
    }
    let [a, b] = [0, 1].map(|k| Placed { motion: whole[k], ..bodies[k].placed });
    let checked = check_level(rest, (0, 1), (bodies[0].solid, &a), (bodies[1].solid, &b))?;
    if checked.until < to * (1.0 - 1e-12) {
        return Err(format!("the prediction is proven until {}, the step ends at {to} of it", checked.until));
    }
    // Every point x of both bodies would lie within half of what they stray of both as they were expected.
    if -2.0 * checked.depth - astray <= resolution {
        return Err(format!("proven to keep f above {:e}, they stray {astray:e}", -checked.depth));
    }
    Ok(Proven::PredictedMotion)
}

/// The numbers of a line, words between them left out.
struct Numbers(std::vec::IntoIter<f64>);

impl Numbers {
    fn of(words: &[&str]) -> Result<Self, String> {
        let named = |w: &&&str| !w.chars().all(|c| c.is_ascii_alphabetic()) || **w == "inf";
        let value = |w: &&str| if *w == "inf" { Ok(f64::INFINITY) } else { number(w) };
        let all: Result<Vec<f64>, String> = words.iter().filter(named).map(value).collect();
        Ok(Self(all?.into_iter()))
    }
    fn next(&mut self) -> Result<f64, String> {
        self.0.next().ok_or_else(|| "a number is missing".into())
    }
    fn vector(&mut self) -> Result<DVec3, String> {
        Ok(DVec3::new(self.next()?, self.next()?, self.next()?))
    }
    fn pose(&mut self) -> Result<Pose, String> {
        let at = self.vector()?;
        Ok(Pose::new(at, DQuat::from_xyzw(self.next()?, self.next()?, self.next()?, self.next()?)))
    }
    fn motion(&mut self) -> Result<Motion, String> {
        Ok(Motion { start: self.pose()?, velocity: self.vector()?, spin: self.vector()? })
    }
}
