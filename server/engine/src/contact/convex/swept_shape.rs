//! A body over one step as one convex primitive, prepared once for all of its pairs, and what a direction proves of a pair at
//! a separating-axis test. The primitive is the body itself, or one around it: what stays apart of what encloses them stays apart.
//!
//! A direction n that leaves a gap φ₀ at the start and φ₁ at the end leaves, in between, no less than
//!
//! ```text
//! min(φ₀, φ₁) − ⅛ Q,    Q = 2|n₁ − n₀|(|v₀| + ω_A ρ_A + ω_B ρ_B) + ω_A² ρ_A + ω_B² ρ_B
//! ```
//!
//! with n going over from n₀ to n₁ (the formula of `convex`, s(1−s) <= ¼). Most pairs that are near stay apart, and the
//! direction that kept them apart in the last step mostly does so in this one: four supports, and nothing is searched. So
//! the direction is remembered; where it fails, nearest points give another one, at the start and then at the end.
//!
//! It only ever says "apart", with a margin far above all rounding: what is nearer is asked in the ordinary way, so that no
//! bit of an answer depends on which directions were remembered. How near trees are is told by f, whose levels reach out
//! farther at corners than their distance: so what encloses a tree encloses all of its {f <= level}, and a pair that is
//! asked about beyond that level has no separating-axis test.

use super::gjk;
use super::support::ConvexBody;
use super::whole::body_of;
use crate::math::{F64x2, Lanes};
use crate::octree::Model;
use crate::solid::primitive::{Convex, Cuboid};
use crate::solid::{Node, Op, Primitive, Shape};
use contactd_proto::{MotionState, Pose};
use glam::{DMat3, DQuat, DVec3};

/// Relative to the numbers at hand: far above what rounding does to a gap, and above the least resolution of any pair.
const CRUDE: f64 = 1e-11;
/// The part of that which the place of a body counts: sums of three numbers are rounded there, and no more.
const PLACE: f64 = 1e-4;
/// How near to the distance a separating-axis test looks for its direction.
const ROUGH: f64 = 0.3;

/// What does not change from step to step.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Hull {
    /// The level of the body's f up to which it is enclosed.
    level: f64,
    /// How far the primitive reaches; `None` for a polyhedron.
    form: Option<Convex<'static>>,
    /// The primitive's frame in the object's.
    turned: DQuat,
    center: DVec3,
    /// Farthest point from the object's origin.
    rho: f64,
    /// The numbers that rounding depends on: the model's extents and those of its place.
    size: f64,
    /// What encloses the body, where it is no primitive itself. Seldom looked at: last.
    around: Option<Shape>,
}

/// One body in one step. Four lines of a cache: there are many, and each is looked at from all around.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct SweptShape {
    /// The primitive's axes in the world, component by component, at both ends.
    axes: [[F64x2; 3]; 3],
    /// Its centre.
    center: [F64x2; 3],
    /// How far it reaches, but for a polyhedron, whose corners are many.
    form: Option<Convex<'static>>,
    /// The level of f up to which the primitive encloses the body.
    level: f64,
    /// ω ρ and ω² ρ.
    swing: f64,
    pull: f64,
    /// The numbers that rounding depends on.
    size: f64,
}

const _: () = assert!(size_of::<SweptShape>() == 256);

/// Two vectors, component by component.
fn twins(start: DVec3, end: DVec3) -> [F64x2; 3] {
    [F64x2([start.x, end.x]), F64x2([start.y, end.y]), F64x2([start.z, end.z])]
}

/// The products with one vector.
#[inline]
fn dot(v: &[F64x2; 3], n: DVec3) -> F64x2 {
    v[0] * n.x + v[1] * n.y + v[2] * n.z
}

/// What was seen of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparatingAxisTest {
    /// The direction of the gap at the start, world axes; a unit vector.
    pub along: DVec3,
    /// By how much more than asked the bodies are apart at the start, at least.
    pub clearance: f64,
    /// They stay apart by what was asked, over the whole step.
    pub apart: bool,
}

impl Hull {
    /// Of a model placed in its object; `None` for one without bounds.
    pub fn new(model: &Model, place: &Pose) -> Option<Self> {
        // Of a bounded one that has no form a box stands for it.
        let has_form = |p: &&Primitive| p.is_convex() && (p.shape.convex().is_known() || !p.aabb.is_finite());
        let whole = model.solid.whole().filter(has_form);
        let (around, level, form, frame, ball) = if let Some(p) = whole {
            body_of(p)?;
            (None, f64::INFINITY, p.shape.convex().of_few(), p.frame, p.ball)
        } else {
            let (shape, frame) = enclosing(model)?;
            let mut ball = shape.geometry().ball();
            ball.center = frame.point(ball.center);
            let form = shape.convex().of_few();
            (Some(shape), model.bounds.margin(), form, frame, ball)
        };
        let rho = (place.point(ball.center).length() + ball.radius) * (1.0 + 1e-14);
        let [reach, radius] = model.extents;
        Some(Self {
            around,
            level,
            form,
            turned: place.rotation * frame.rotation,
            center: place.point(frame.position),
            rho,
            size: 2.0 * (reach + radius + model.face_reach + place.position.length()) + rho,
        })
    }

    /// The shape that is looked at.
    pub fn shape<'a>(&'a self, model: &'a Model) -> Option<&'a Shape> {
        self.around.as_ref().or_else(|| model.solid.whole().map(|p| &p.shape))
    }

    /// True when it is the body itself, of which distances are told.
    pub fn is_whole(&self) -> bool {
        self.level == f64::INFINITY
    }

    /// True when it holds all points at which f of the body is up to half of `touch`.
    pub fn holds(&self, touch: f64) -> bool {
        0.5 * touch <= self.level
    }

    /// Over the step that a track tells.
    pub fn swept_shape(&self, motion_state: &MotionState) -> SweptShape {
        let motion = &motion_state.motion;
        let (first, last) = (motion.start.rotation, motion_state.end.rotation);
        let [start, end] = [DMat3::from_quat(first * self.turned), DMat3::from_quat(last * self.turned)];
        let axes = [twins(start.x_axis, end.x_axis), twins(start.y_axis, end.y_axis), twins(start.z_axis, end.z_axis)];
        let (from, to) = (motion.start.position, motion.start.position + motion.velocity);
        let center = if self.center == DVec3::ZERO {
            twins(from, to)
        } else {
            twins(from + first * self.center, to + last * self.center)
        };
        let far = from.abs().max_element().max(to.abs().max_element());
        let omega = motion.spin.length();
        SweptShape {
            axes,
            center,
            form: self.form,
            level: self.level,
            swing: omega * self.rho,
            pull: omega * omega * self.rho,
            size: self.size * (1.0 + omega) + PLACE * far,
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
                // Sharp edges reach out farther: the box of the bounds knows how far.
                let Some(grown) = shape.geometry().grown(margin) else { break };
                return Some((grown, *frame));
            }
            Node::Op(Op::Union, _) | Node::Empty => break,
        }
    }
    let aabb = bounds.node(n).aabb;
    let is_box = aabb.is_finite() && !aabb.is_empty();
    is_box.then(|| (Cuboid { half: aabb.half() }.into(), Pose::at(aabb.center())))
}

/// Two bodies in one step; `S` gives the shape of each.
pub struct AxisSearch<'a, S> {
    forms: [Convex<'a>; 2],
    swept: [&'a SweptShape; 2],
    shapes: S,
    /// From A's centre to B's at both ends.
    ways: [F64x2; 3],
    /// What the gap has to stay above.
    least: f64,
}

impl<'a, S: Fn(usize) -> Option<&'a Shape>> AxisSearch<'a, S> {
    /// Two bodies by their swept shapes and shapes (of their hulls), asked whether they stay farther apart than `touch` (a length).
    /// `None` where one's hull does not enclose it that far.
    #[inline]
    pub fn new(swept: [&'a SweptShape; 2], shapes: S, touch: f64) -> Option<Self> {
        let [a, b] = swept;
        if 0.5 * touch > a.level.min(b.level) {
            return None;
        }
        let form = |k: usize| swept[k].form.or_else(|| shapes(k).map(Shape::convex));
        let forms = [form(0)?, form(1)?];
        let ways = [b.center[0] - a.center[0], b.center[1] - a.center[1], b.center[2] - a.center[2]];
        let [first, last] = (ways[0].abs() + ways[1].abs() + ways[2].abs()).0;
        let extent = first + last + a.size + b.size;
        Some(Self { forms, swept, shapes, ways, least: touch + CRUDE * extent })
    }

    /// The gap along a unit direction at both ends.
    #[inline]
    fn gap(&self, n: DVec3) -> [f64; 2] {
        let ([a, b], [of_a, of_b]) = (self.swept, &self.forms);
        let own_a = of_a.extent([dot(&a.axes[0], n), dot(&a.axes[1], n), dot(&a.axes[2], n)]);
        let back = -n;
        let own_b = of_b.extent([dot(&b.axes[0], back), dot(&b.axes[1], back), dot(&b.axes[2], back)]);
        (dot(&self.ways, n) - own_a - own_b).0
    }

    /// A direction from nearest points at one end.
    fn find(&self, end: usize, from: DVec3) -> Option<DVec3> {
        let at = |v: &[F64x2; 3]| DVec3::new(v[0].0[end], v[1].0[end], v[2].0[end]);
        let body = |k: usize, origin: DVec3| {
            let [x, y, z] = &self.swept[k].axes;
            ConvexBody::new((self.shapes)(k)?, DMat3::from_cols(at(x), at(y), at(z)), origin)
        };
        let (a, b) = (body(0, DVec3::ZERO)?, body(1, at(&self.ways))?);
        Some(gjk::nearest(&a, &b, from, ROUGH)?.normal)
    }

    /// What two directions prove, the one at the start and the other at the end.
    fn proves(&self, (n0, gap0): (DVec3, f64), (n1, gap1): (DVec3, f64)) -> bool {
        let [a, b] = self.swept;
        let turned = (n1 - n0).length();
        // Of the centres of rotation, which go what the centres go but for their swing.
        let way = || DVec3::from_array(self.ways.map(|w| w.0[1] - w.0[0])).length();
        let speed = if turned == 0.0 { 0.0 } else { way() + 2.0 * (a.swing + b.swing) };
        gap0.min(gap1) - 0.125 * (1.0 + 1e-12) * (2.0 * turned * speed + a.pull + b.pull) > self.least
    }

    /// Looks along the direction that was remembered (0: none was), or else from centre to centre, and then along others.
    #[inline]
    pub fn look(&self, along: DVec3) -> SeparatingAxisTest {
        let mut last = DVec3::ZERO;
        self.look_to(along, &mut last)
    }

    /// The two directions, at the start and at the end, that keep the bodies apart where a look says that they stay so.
    pub fn directions(&self, along: DVec3) -> Option<[DVec3; 2]> {
        let mut last = DVec3::ZERO;
        let axis_test = self.look_to(along, &mut last);
        axis_test.apart.then_some([axis_test.along, if last == DVec3::ZERO { axis_test.along } else { last }])
    }

    /// Notes the direction at the end in `last` where it is another one.
    #[inline]
    fn look_to(&self, along: DVec3, last: &mut DVec3) -> SeparatingAxisTest {
        let is_remembered = along != DVec3::ZERO;
        let along = if is_remembered { along } else { self.way().normalize_or(DVec3::X) };
        let gaps = self.gap(along);
        if self.proves((along, gaps[0]), (along, gaps[1])) {
            return self.seen(along, gaps[0], true);
        }
        let found = self.look_around(along, gaps[0], last);
        if found.apart || !is_remembered {
            return found;
        }
        // What is told of a pair must not depend on what is remembered of it: what a first look proves is proven here, too.
        *last = DVec3::ZERO;
        let first = self.look_to(DVec3::ZERO, last);
        if first.apart { first } else { found }
    }

    /// Looks along the directions of nearest points, where `along` does not keep the bodies apart.
    #[inline(never)]
    fn look_around(&self, along: DVec3, gap: f64, last: &mut DVec3) -> SeparatingAxisTest {
        for k in 0..2 {
            for n in self.sides(k) {
                let gaps = self.gap(n);
                if self.proves((n, gaps[0]), (n, gaps[1])) {
                    return self.seen(n, gaps[0], true);
                }
            }
        }
        let Some(n0) = self.find(0, along) else { return self.seen(along, gap, false) };
        let gaps = self.gap(n0);
        if gaps[0] <= self.least || self.proves((n0, gaps[0]), (n0, gaps[1])) {
            return self.seen(n0, gaps[0], gaps[0] > self.least);
        }
        let Some(n1) = self.find(1, n0) else { return self.seen(n0, gaps[0], false) };
        let later = self.gap(n1);
        if later[1] <= self.least {
            return self.seen(n0, gaps[0], false);
        }
        if self.proves((n1, later[0]), (n1, later[1])) {
            return self.seen(n1, later[0], true);
        }
        *last = n1;
        self.seen(n0, gaps[0], self.proves((n0, gaps[0]), (n1, later[1])))
    }

    /// Normals of a body's sides at the start, towards the other body's centre: of bodies that are near each other one of them
    /// mostly keeps them apart, and is cheaper to try than nearest points are to find.
    fn sides(&self, k: usize) -> impl Iterator<Item = DVec3> + use<S> {
        let at = |v: &[F64x2; 3]| DVec3::from_array(v.map(|x| x.0[0]));
        let way = self.way();
        let [x, y, z] = self.swept[k].axes.each_ref().map(at);
        let sides = self.forms[k].sides([x, y, z], way);
        let towards = move |n: DVec3| if n.dot(way) < 0.0 { -n } else { n };
        sides.into_iter().filter(|n| *n != DVec3::ZERO).map(towards)
    }

    fn seen(&self, along: DVec3, gap: f64, apart: bool) -> SeparatingAxisTest {
        SeparatingAxisTest { along, clearance: gap - self.least, apart }
    }

    /// From centre to centre at the start.
    fn way(&self) -> DVec3 {
        DVec3::from_array(self.ways.map(|w| w.0[0]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::octree::testing::{pierced, simple};
    use crate::solid::primitive::{Cuboid, Cylinder, Sphere};
    use crate::solid::{Label, SolidBuilder};
    use contactd_proto::Motion;

    fn motion_state(start: DVec3, end: DVec3, spin: DVec3) -> MotionState {
        let motion = Motion::turning(Pose::at(start), end, spin);
        MotionState { motion, end: motion.at(1.0) }
    }

    fn axis_test(models: [&Model; 2], motion_states: [&MotionState; 2], touch: f64) -> SeparatingAxisTest {
        let hulls = [0, 1].map(|k| Hull::new(models[k], &Pose::IDENTITY).expect("bounded"));
        let swept = [0, 1].map(|k| hulls[k].swept_shape(motion_states[k]));
        let shapes = |k: usize| hulls[k].shape(models[k]);
        AxisSearch::new(swept.each_ref(), shapes, touch).expect("within").look(DVec3::ZERO)
    }

    #[test]
    fn a_bar_that_sweeps_past_between_both_ends_of_the_step_is_seen() {
        let bar = simple(Cuboid { half: DVec3::new(1.0, 0.02, 0.02) });
        let ball = simple(Sphere { radius: 0.1 });
        let at_rest = |at| motion_state(at, at, DVec3::ZERO);
        // It ends each quarter turn as far from the ball as it begins, and passes through it in between.
        let turning = motion_state(DVec3::ZERO, DVec3::ZERO, DVec3::Z * std::f64::consts::FRAC_PI_2);
        let beside = at_rest(DVec3::new(0.75, 0.75, 0.0));
        assert!(!axis_test([&bar, &ball], [&turning, &beside], 0.0).apart);
        let far = at_rest(DVec3::new(2.5, 2.5, 0.0));
        let seen = axis_test([&bar, &ball], [&turning, &far], 0.0);
        assert!(seen.apart && seen.clearance > 1.0 && seen.clearance < 2.5 * 2f64.sqrt());
        // A margin counts.
        let still = at_rest(DVec3::ZERO);
        let close = at_rest(DVec3::new(0.0, 0.2, 0.0));
        assert!(axis_test([&bar, &ball], [&still, &close], 0.07).apart);
        assert!(!axis_test([&bar, &ball], [&still, &close], 0.09).apart);
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
            let motion_states = [motion_state(DVec3::ZERO, v(0.3), v(1.5)), motion_state(at, at + v(0.3), v(1.5))];
            let seen = axis_test([a, b], [&motion_states[0], &motion_states[1]], 0.0);
            let common = (0..=10).any(|k| {
                let poses = motion_states.each_ref().map(|t| t.motion.at(f64::from(k) / 10.0));
                (0..150).any(|_| {
                    let x = poses[0].point(v(1.0));
                    a.solid.value(poses[0].inverse().point(x)) < 0.0 && b.solid.value(poses[1].inverse().point(x)) < 0.0
                })
            });
            assert!(!(seen.apart && common), "{i}: {motion_states:?}");
            (apart, meet) = (apart + u32::from(seen.apart), meet + u32::from(common));
        }
        assert!(apart > 60 && meet > 60, "{apart} apart, {meet} meet");
        // Beyond the level nothing is told.
        let far = motion_state(DVec3::X * 9.0, DVec3::X * 9.0, DVec3::ZERO);
        let near = motion_state(DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let hulls = [0, 1].map(|k| Hull::new(&models[k], &Pose::IDENTITY).expect("bounded"));
        let swept = [hulls[0].swept_shape(&near), hulls[1].swept_shape(&far)];
        let glance = |touch| AxisSearch::new(swept.each_ref(), |k| hulls[k].shape(&models[k]), touch);
        assert!(glance(0.0).is_some_and(|g| g.look(DVec3::ZERO).apart) && glance(0.1).is_none());
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
            let motion_states = [motion_state(DVec3::ZERO, v(0.3), v(1.5)), motion_state(at, at + v(0.3), v(1.5))];
            let seen = axis_test([&rod, &block], [&motion_states[0], &motion_states[1]], 0.0);
            // Points of the rod's axis and rims, through time.
            let common = (0..=20).any(|k| {
                let poses = motion_states.each_ref().map(|t| t.motion.at(f64::from(k) / 20.0));
                (0..=40).any(|i| {
                    let (s, c) = f64::from(i).sin_cos();
                    [DVec3::ZERO, DVec3::new(0.1 * c, 0.1 * s, 0.0)].iter().any(|rim| {
                        let x = poses[0].point(*rim + DVec3::Z * (0.03 * f64::from(i) - 0.6));
                        block.solid.value(poses[1].inverse().point(x)) < 0.0
                    })
                })
            });
            assert!(!(seen.apart && common), "{motion_states:?}");
            (apart, meet) = (apart + u32::from(seen.apart), meet + u32::from(common));
        }
        assert!(apart > 300 && meet > 300, "{apart} apart, {meet} meet");
    }
}
