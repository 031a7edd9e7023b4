//! A body over one step as one convex primitive, prepared once for all of its pairs, and what a direction proves of a pair at
//! a glance. The primitive is the body itself, or one around it: what stays apart of what encloses them stays apart.
//!
//! A direction n that leaves a gap φ₀ at the start and φ₁ at the end leaves, in between, no less than
//!
//! ```text
//! min(φ₀, φ₁) − ⅛ Q,    Q = 2|n₁ − n₀|(|v₀| + ω_A ρ_A + ω_B ρ_B) + ω_A² ρ_A + ω_B² ρ_B
//! ```
//!
//! with n going over from n₀ to n₁ (the formula of `direct`, s(1−s) <= ¼). Most pairs that are near stay apart, and the
//! direction that kept them apart in the last step mostly does so in this one: four supports, and nothing is searched. So
//! the direction is remembered; where it fails, nearest points give another one, at the start and then at the end.
//!
//! It only ever says "apart", with a margin far above all rounding: what is nearer is asked in the ordinary way, so that no
//! bit of an answer depends on which directions were remembered. How near trees are is told by f, whose levels reach out
//! farther at corners than their distance: so what encloses a tree encloses all of its {f <= level}, and a pair that is
//! asked about beyond that level has no glance.

use super::support::Body;
use super::{body_of, gjk};
use crate::eco::Model;
use crate::solid::primitive::{Cuboid, Cylinder, Sphere};
use crate::solid::{Node, Op, Primitive, Shape};
use contactd_proto::{Pose, Track};
use glam::{DMat3, DQuat, DVec3};

/// Relative to the numbers at hand: far above what rounding does to a gap, and above the least resolution of any pair.
const CRUDE: f64 = 1e-11;
/// How near to the distance a glance looks for its direction.
const ROUGH: f64 = 0.03;

/// What does not change from step to step.
#[derive(Clone, Debug)]
pub struct Hull {
    /// What encloses the body, where it is no primitive itself, and the level of its f up to which it does.
    around: Option<Shape>,
    level: f64,
    /// The primitive's frame in the object's.
    turned: DQuat,
    center: DVec3,
    /// Farthest point from the object's origin.
    rho: f64,
    /// The numbers that rounding depends on: the model's extents and those of its place.
    size: f64,
}

/// One body in one step.
#[derive(Clone, Copy, Debug)]
pub struct Stance {
    /// World from primitive, at both ends.
    axes: [DMat3; 2],
    /// From the object's origin to the primitive's centre, at both ends.
    offsets: [DVec3; 2],
    position: DVec3,
    velocity: DVec3,
    /// ω ρ and ω² ρ.
    swing: f64,
    pull: f64,
    size: f64,
}

/// What was seen of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glance {
    /// The direction of the gap at the start, world axes; a unit vector.
    pub along: DVec3,
    /// By how much more than asked the bodies are apart at the start, at least.
    pub room: f64,
    /// They stay apart by what was asked, over the whole step.
    pub apart: bool,
}

impl Hull {
    /// Of a model placed in its object; `None` for one without bounds.
    pub fn new(model: &Model, place: &Pose) -> Option<Self> {
        let (around, level, frame, ball) = if let Some(p) = model.solid.whole() {
            body_of(p)?;
            (None, f64::INFINITY, p.frame, p.ball)
        } else {
            let (shape, frame) = enclosing(model)?;
            let mut ball = shape.geometry().ball();
            ball.center = frame.point(ball.center);
            (Some(shape), model.bounds.margin(), frame, ball)
        };
        let rho = (place.point(ball.center).length() + ball.radius) * (1.0 + 1e-14);
        let [reach, radius] = model.extents;
        Some(Self {
            around,
            level,
            turned: place.rotation * frame.rotation,
            center: place.point(frame.position),
            rho,
            size: 2.0 * (reach + radius + model.face_reach + place.position.length()) + rho,
        })
    }

    /// The shape that is looked at.
    fn shape<'a>(&'a self, model: &'a Model) -> Option<&'a Shape> {
        self.around.as_ref().or_else(|| model.solid.whole().map(|p| &p.shape))
    }

    /// Over the step that a track tells.
    pub fn stance(&self, track: &Track) -> Stance {
        let motion = &track.motion;
        let (first, last) = (motion.start.rotation, track.end.rotation);
        let axes = [DMat3::from_quat(first * self.turned), DMat3::from_quat(last * self.turned)];
        let offsets =
            if self.center == DVec3::ZERO { [DVec3::ZERO; 2] } else { [first * self.center, last * self.center] };
        let omega = motion.spin.length();
        Stance {
            axes,
            offsets,
            position: motion.start.position,
            velocity: motion.velocity,
            swing: omega * self.rho,
            pull: omega * omega * self.rho,
            size: self.size * (1.0 + omega),
        }
    }
}

/// A primitive, in the model's frame, around all points at which f of a tree is no more than the margin of its bounds: the
/// one that others are subtracted from or cut away of, or a box.
fn enclosing(model: &Model) -> Option<(Shape, Pose)> {
    let (solid, bounds) = (&model.solid, &model.bounds);
    let margin = bounds.margin();
    let mut n = solid.root;
    loop {
        let radius = |n: u32| bounds.node(n).ball.radius;
        match &solid.nodes[n as usize] {
            // f of a difference or an intersection is no less than that of its first or any operand.
            Node::Op(Op::Difference, children) => n = *children.first()?,
            Node::Op(Op::Intersection, children) => {
                n = *children.iter().min_by(|p, q| radius(**p).total_cmp(&radius(**q)))?;
            }
            Node::Op(Op::Union, children) if children.len() == 1 => n = children[0],
            Node::Primitive(p) => {
                let Primitive { shape, frame, .. } = &solid.primitives[*p as usize];
                let grown = match shape {
                    Shape::Sphere(s) => Sphere { radius: s.radius + margin }.into(),
                    Shape::Cylinder(c) => {
                        Cylinder { radius: c.radius + margin, half_height: c.half_height + margin }.into()
                    }
                    Shape::Cuboid(c) => Cuboid { half: c.half + margin }.into(),
                    // Sharp edges reach out farther: the box of the bounds knows how far.
                    Shape::Cone(_) | Shape::Polyhedron(_) | Shape::HalfSpace(_) => break,
                };
                return Some((grown, *frame));
            }
            Node::Op(Op::Union, _) | Node::Empty => break,
        }
    }
    let aabb = bounds.node(n).aabb;
    let is_box = aabb.is_finite() && !aabb.is_empty();
    is_box.then(|| (Cuboid { half: aabb.half() }.into(), Pose::at(aabb.center())))
}

/// Largest n·x over a shape that stands with these axes.
#[inline]
pub fn reach(shape: &Shape, axes: &DMat3, n: DVec3) -> f64 {
    let m = DVec3::new(axes.x_axis.dot(n), axes.y_axis.dot(n), axes.z_axis.dot(n));
    let across = || (m.x * m.x + m.y * m.y).sqrt();
    match shape {
        Shape::Sphere(s) => s.radius,
        Shape::Cuboid(c) => c.half.dot(m.abs()),
        Shape::Cylinder(c) => c.radius * across() + c.half_height * m.z.abs(),
        Shape::Cone(c) => {
            let (across, up) = (across(), c.half_height * m.z);
            (c.top * across + up).max(c.bottom * across - up)
        }
        Shape::Polyhedron(p) => p.vertices.iter().fold(f64::NEG_INFINITY, |far, v| far.max(m.dot(*v))),
        Shape::HalfSpace(_) => f64::INFINITY,
    }
}

/// Two bodies in one step.
pub struct Glancing<'a> {
    shapes: [&'a Shape; 2],
    stances: [&'a Stance; 2],
    /// From A's centre to B's at both ends.
    ways: [DVec3; 2],
    /// What the gap has to stay above.
    least: f64,
}

impl<'a> Glancing<'a> {
    /// Two bodies by their models, hulls and stances, asked whether they stay farther apart than `touch` (a length). `None`
    /// where one's hull does not enclose it that far.
    pub fn new(models: [&'a Model; 2], hulls: [&'a Hull; 2], stances: [&'a Stance; 2], touch: f64) -> Option<Self> {
        if 0.5 * touch > hulls[0].level.min(hulls[1].level) {
            return None;
        }
        let shapes = [hulls[0].shape(models[0])?, hulls[1].shape(models[1])?];
        let [a, b] = stances;
        let difference = b.position - a.position;
        let velocity = b.velocity - a.velocity;
        let extent = difference.abs().element_sum() + velocity.abs().element_sum() + a.size + b.size;
        let ways = [difference + (b.offsets[0] - a.offsets[0]), difference + velocity + (b.offsets[1] - a.offsets[1])];
        Some(Self { shapes, stances, ways, least: touch + CRUDE * extent })
    }

    /// The gap along a unit direction at one end.
    fn gap(&self, end: usize, n: DVec3) -> f64 {
        let [a, b] = self.stances;
        let reach_a = reach(self.shapes[0], &a.axes[end], n);
        n.dot(self.ways[end]) - reach_a - reach(self.shapes[1], &b.axes[end], -n)
    }

    /// A direction from nearest points at one end.
    fn find(&self, end: usize, from: DVec3) -> Option<DVec3> {
        let [a, b] = self.stances;
        let a = Body::new(self.shapes[0], a.axes[end], DVec3::ZERO)?;
        let b = Body::new(self.shapes[1], b.axes[end], self.ways[end])?;
        Some(gjk::nearest(&a, &b, from, ROUGH)?.normal)
    }

    /// What two directions prove, the one at the start and the other at the end.
    fn proves(&self, (n0, gap0): (DVec3, f64), (n1, gap1): (DVec3, f64)) -> bool {
        let [a, b] = self.stances;
        let turned = (n1 - n0).length();
        let speed = if turned == 0.0 { 0.0 } else { (b.velocity - a.velocity).length() + a.swing + b.swing };
        gap0.min(gap1) - 0.125 * (1.0 + 1e-12) * (2.0 * turned * speed + a.pull + b.pull) > self.least
    }

    /// Looks along the direction that was remembered, or else from centre to centre, and then along others.
    pub fn look(&self, along: Option<DVec3>) -> Glance {
        let along = along.unwrap_or_else(|| self.ways[0].normalize_or(DVec3::X));
        let gaps = [self.gap(0, along), self.gap(1, along)];
        let seen = |along, gap: f64, apart| Glance { along, room: gap - self.least, apart };
        if self.proves((along, gaps[0]), (along, gaps[1])) {
            return seen(along, gaps[0], true);
        }
        let Some(n0) = self.find(0, along) else { return seen(along, gaps[0], false) };
        let gap0 = self.gap(0, n0);
        let fixed = (n0, self.gap(1, n0));
        if gap0 <= self.least || self.proves((n0, gap0), fixed) {
            return seen(n0, gap0, gap0 > self.least);
        }
        let Some(n1) = self.find(1, n0) else { return seen(n0, gap0, false) };
        let gap1 = self.gap(1, n1);
        if gap1 <= self.least {
            return seen(n0, gap0, false);
        }
        let later = (n1, self.gap(0, n1));
        if self.proves((n1, later.1), (n1, gap1)) {
            return seen(n1, later.1, true);
        }
        seen(n0, gap0, self.proves((n0, gap0), (n1, gap1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::eco::testing::{pierced, simple};
    use crate::math::random::Random;
    use crate::solid::primitive::{Cuboid, Cylinder, Sphere};
    use crate::solid::{Label, SolidBuilder};
    use contactd_proto::Motion;

    fn track(start: DVec3, end: DVec3, spin: DVec3) -> Track {
        let motion = Motion::turning(Pose::at(start), end, spin);
        Track { motion, end: motion.at(1.0) }
    }

    fn glance(models: [&Model; 2], tracks: [&Track; 2], touch: f64) -> Glance {
        let hulls = [0, 1].map(|k| Hull::new(models[k], &Pose::IDENTITY).expect("bounded"));
        let stances = [0, 1].map(|k| hulls[k].stance(tracks[k]));
        Glancing::new(models, hulls.each_ref(), [&stances[0], &stances[1]], touch).expect("within").look(None)
    }

    #[test]
    fn a_bar_that_sweeps_past_between_both_ends_of_the_step_is_seen() {
        let bar = simple(Cuboid { half: DVec3::new(1.0, 0.02, 0.02) });
        let ball = simple(Sphere { radius: 0.1 });
        let at_rest = |at| track(at, at, DVec3::ZERO);
        // It ends each quarter turn as far from the ball as it begins, and passes through it in between.
        let turning = track(DVec3::ZERO, DVec3::ZERO, DVec3::Z * std::f64::consts::FRAC_PI_2);
        let beside = at_rest(DVec3::new(0.75, 0.75, 0.0));
        assert!(!glance([&bar, &ball], [&turning, &beside], 0.0).apart);
        let far = at_rest(DVec3::new(2.5, 2.5, 0.0));
        let seen = glance([&bar, &ball], [&turning, &far], 0.0);
        assert!(seen.apart && seen.room > 1.0 && seen.room < 2.5 * 2f64.sqrt());
        // A margin counts.
        let still = at_rest(DVec3::ZERO);
        let close = at_rest(DVec3::new(0.0, 0.2, 0.0));
        assert!(glance([&bar, &ball], [&still, &close], 0.07).apart);
        assert!(!glance([&bar, &ball], [&still, &close], 0.09).apart);
    }

    /// A ring, a drilled ball, a drilled block that is cut by a ball, two rods crossed, and a rod less a cone.
    fn trees() -> Vec<Model> {
        let rod = |radius, half_height| Cylinder { radius, half_height };
        let crossed = |op: Op, shapes: [Shape; 2]| {
            let mut b = SolidBuilder::new();
            let parts = shapes.map(|shape| b.primitive(shape, Pose::at(DVec3::new(0.3, -0.1, 0.2)), Label::default()));
            let root = b.operation(op, &parts);
            Model::new(b.finish(root))
        };
        let hole: Shape = rod(0.2, 2.0).into();
        let tip = crate::solid::primitive::Cone { bottom: 0.5, top: 0.0, half_height: 0.4 };
        vec![
            pierced(rod(0.5, 0.2), vec![(hole.clone(), Pose::IDENTITY)]),
            pierced(Sphere { radius: 0.6 }, vec![(hole.clone(), Pose::IDENTITY)]),
            crossed(
                Op::Intersection,
                [Cuboid { half: DVec3::new(0.7, 0.4, 0.3) }.into(), Sphere { radius: 0.6 }.into()],
            ),
            crossed(Op::Union, [rod(0.1, 0.9).into(), Cuboid { half: DVec3::new(0.5, 0.1, 0.1) }.into()]),
            pierced(tip, vec![(hole, Pose::IDENTITY)]),
        ]
    }

    #[test]
    fn what_encloses_a_tree_holds_its_level() {
        let mut numbers = Random(5);
        for (k, model) in trees().iter().enumerate() {
            let (shape, frame) = enclosing(model).expect("bounded");
            let level = model.bounds.margin();
            assert!(level > 0.0, "tree {k}");
            let outer = Primitive::new(shape, frame, Label::default(), 0);
            let (mut inside, mut near) = (0, 0);
            for _ in 0..200_000 {
                let mut n = || numbers.within(-1.0, 1.0);
                let x = outer.aabb.center() + DVec3::new(n(), n(), n()) * outer.aabb.half() * 1.01;
                let f = model.solid.value(x);
                assert!(f > level || outer.value(x) <= 1e-15, "tree {k}: f = {f} at {x}");
                (inside, near) = (inside + u32::from(f < 0.0), near + u32::from(f.abs() <= level));
            }
            assert!(inside > 1000, "tree {k}: {inside} inside, {near} within the level");
        }
    }

    #[test]
    fn trees_that_a_glance_calls_apart_have_no_point_in_common() {
        let models = trees();
        let mut numbers = Random(9);
        let mut n = || numbers.within(-1.0, 1.0);
        let mut v = |size: f64| DVec3::new(n(), n(), n()) * size;
        let (mut apart, mut meet) = (0, 0);
        for i in 0..800 {
            let (a, b) = (&models[i % 5], &models[i / 5 % 5]);
            let at = v(1.4);
            let tracks = [track(DVec3::ZERO, v(0.3), v(1.5)), track(at, at + v(0.3), v(1.5))];
            let seen = glance([a, b], [&tracks[0], &tracks[1]], 0.0);
            let common = (0..=10).any(|k| {
                let poses = tracks.each_ref().map(|t| t.motion.at(f64::from(k) / 10.0));
                (0..150).any(|_| {
                    let x = poses[0].point(v(1.0));
                    a.solid.value(poses[0].inverse().point(x)) < 0.0 && b.solid.value(poses[1].inverse().point(x)) < 0.0
                })
            });
            assert!(!(seen.apart && common), "{i}: {tracks:?}");
            (apart, meet) = (apart + u32::from(seen.apart), meet + u32::from(common));
        }
        assert!(apart > 60 && meet > 60, "{apart} apart, {meet} meet");
        // Beyond the level nothing is told.
        let far = track(DVec3::X * 9.0, DVec3::X * 9.0, DVec3::ZERO);
        let near = track(DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let hulls = [0, 1].map(|k| Hull::new(&models[k], &Pose::IDENTITY).expect("bounded"));
        let stances = [hulls[0].stance(&near), hulls[1].stance(&far)];
        let asked = |touch| Glancing::new([&models[0], &models[1]], hulls.each_ref(), stances.each_ref(), touch);
        assert!(asked(0.0).is_some_and(|g| g.look(None).apart) && asked(0.1).is_none());
    }

    #[test]
    fn what_a_glance_calls_apart_has_no_point_in_common() {
        let rod = simple(Cylinder { radius: 0.1, half_height: 0.6 });
        let block = simple(Cuboid { half: DVec3::new(0.4, 0.3, 0.2) });
        let mut numbers = Random(3);
        let mut n = || numbers.within(-1.0, 1.0);
        let mut v = |size: f64| DVec3::new(n(), n(), n()) * size;
        let (mut apart, mut meet) = (0, 0);
        for _ in 0..2000 {
            let at = v(1.2);
            let tracks = [track(DVec3::ZERO, v(0.3), v(1.5)), track(at, at + v(0.3), v(1.5))];
            let seen = glance([&rod, &block], [&tracks[0], &tracks[1]], 0.0);
            // Points of the rod's axis and rims, through time.
            let common = (0..=20).any(|k| {
                let poses = tracks.each_ref().map(|t| t.motion.at(f64::from(k) / 20.0));
                (0..=40).any(|i| {
                    let (s, c) = f64::from(i).sin_cos();
                    [DVec3::ZERO, DVec3::new(0.1 * c, 0.1 * s, 0.0)].iter().any(|rim| {
                        let x = poses[0].point(*rim + DVec3::Z * (0.03 * f64::from(i) - 0.6));
                        block.solid.value(poses[1].inverse().point(x)) < 0.0
                    })
                })
            });
            assert!(!(seen.apart && common), "{tracks:?}");
            (apart, meet) = (apart + u32::from(seen.apart), meet + u32::from(common));
        }
        assert!(apart > 300 && meet > 300, "{apart} apart, {meet} meet");
    }
}
