//! A body of one convex primitive over one step, prepared once for all of its pairs, and what a direction proves of a pair
//! at a glance.
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
//! bit of an answer depends on which directions were remembered.

use super::support::Body;
use super::{body_of, gjk};
use crate::eco::Model;
use crate::solid::Shape;
use contactd_proto::{Pose, Track};
use glam::{DMat3, DQuat, DVec3};

/// Relative to the numbers at hand: far above what rounding does to a gap, and above the least resolution of any pair.
const CRUDE: f64 = 1e-11;
/// How near to the distance a glance looks for its direction.
const ROUGH: f64 = 0.03;

/// What does not change from step to step.
#[derive(Clone, Copy, Debug)]
pub struct Hull {
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
    /// Of a model placed in its object; `None` unless it is one bounded convex primitive.
    pub fn new(model: &Model, place: &Pose) -> Option<Self> {
        let primitive = model.solid.whole()?;
        body_of(primitive)?;
        let ball = &primitive.ball;
        let rho = (place.point(ball.center).length() + ball.radius) * (1.0 + 1e-14);
        let [reach, radius] = model.extents;
        Some(Self {
            turned: place.rotation * primitive.frame.rotation,
            center: place.point(primitive.frame.position),
            rho,
            size: 2.0 * (reach + radius + model.face_reach + place.position.length()) + rho,
        })
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
    /// Two bodies by their models and stances, asked whether they stay farther apart than `touch` (a length). `None` if one
    /// of them is no convex primitive.
    pub fn new(models: [&'a Model; 2], stances: [&'a Stance; 2], touch: f64) -> Option<Self> {
        let shapes = [&models[0].solid.whole()?.shape, &models[1].solid.whole()?.shape];
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
    use crate::eco::testing::simple;
    use crate::math::random::Random;
    use crate::solid::primitive::{Cuboid, Cylinder, Sphere};
    use contactd_proto::Motion;

    fn track(start: DVec3, end: DVec3, spin: DVec3) -> Track {
        let motion = Motion::turning(Pose::at(start), end, spin);
        Track { motion, end: motion.at(1.0) }
    }

    fn glance(models: [&Model; 2], tracks: [&Track; 2], touch: f64) -> Glance {
        let stances = [0, 1].map(|k| Hull::new(models[k], &Pose::IDENTITY).expect("convex").stance(tracks[k]));
        Glancing::new(models, [&stances[0], &stances[1]], touch).expect("convex").look(None)
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
