//! One bound: a ball and a box that hold the same points, and the rules that join bounds under set operations.
//!
//! A bound is an upper estimate: every rule's result holds the exact result of its operation on whatever its operands
//! hold, rounding included. Rules never make a bound larger than what box and ball rules give by themselves.
//! Balls alone or boxes alone (`Volumes`) are there for comparison: the other kind then follows from the first and says nothing of its own.

use crate::math::{Aabb, Ball, Oriented, tolerance::OUTWARD};
use crate::solid::{Op, Primitive};
use contactd_proto::Pose;
use glam::DVec3;

/// Which bounding volumes stage 1 works with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Volumes {
    /// Balls alone.
    Balls,
    /// Boxes alone, along the model's axes.
    Boxes,
    /// A ball and a box at every node, each tightened by the other.
    #[default]
    Both,
    /// Both, and besides a box along each primitive's own axes, and one along the other body's axes around where it moves:
    /// tighter, at the cost of tests of separating axes.
    Oriented,
}

/// A ball and a box around the same points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Axis-aligned box, model frame.
    pub aabb: Aabb,
    /// Ball, model frame.
    pub ball: Ball,
}

/// By how much of their distance from an interior point c a primitive's points go out to hold {psi <= margin}.
fn reach(p: &Primitive, c: DVec3, margin: f64) -> Option<f64> {
    if !p.is_convex() {
        return None;
    }
    let rho = -p.value(c);
    let reach = if margin > 0.0 { margin / rho } else { 0.0 };
    (rho > 0.0 && reach.is_finite()).then_some(reach)
}

/// A box along a primitive's own axes around {psi <= margin}, model frame; `None` for one without bounds.
pub(super) fn oriented(p: &Primitive, margin: f64) -> Option<Oriented> {
    let geometry = p.shape.geometry();
    let c = geometry.interior_point();
    let reach = reach(p, p.frame.point(c), margin)?;
    let own = geometry.aabb(&Pose::IDENTITY);
    if !own.is_finite() {
        return None;
    }
    let center = own.center();
    let center = center + (center - c) * reach;
    let half = own.half() * (1.0 + reach);
    let rounding = (center.abs() + c.abs() + half + p.frame.position.abs()).element_sum() * OUTWARD;
    Some(Oriented { center: p.frame.point(center), axes: p.frame.matrix(), half: half + rounding })
}

impl Bound {
    /// The bound of nothing.
    pub const EMPTY: Self = Self { aabb: Aabb::EMPTY, ball: Ball::EMPTY };
    /// The bound of everything.
    pub const ALL: Self = Self { aabb: Aabb::ALL, ball: Ball::ALL };

    /// The bound of a box.
    pub fn of_box(b: Aabb) -> Self {
        Self { aabb: b, ball: Ball::of_box(&b) }
    }

    /// The bound of {psi <= margin} for a primitive.
    ///
    /// psi is convex and psi(c) = −rho at an interior point c. So y with psi(y) <= margin lies on the ray from c through
    /// a point x of the primitive with |y−c| <= (1 + margin/rho)|x−c|: scaling the primitive's own bounds about c by
    /// 1 + margin/rho bounds the dilated set, whatever the primitive. A face that is not convex is an exact distance: it alone
    /// bounds such a primitive, and its own bounds grow by the margin. What has a formula says in which box it lies, and what such a face
    /// has planes around.
    pub fn of_primitive(p: &Primitive, margin: f64, volumes: Volumes) -> Self {
        let geometry = p.shape.geometry();
        if let Some(domain) = geometry.domain() {
            // Its planes are operands of an "and": what lies outside of them by more than the margin has a larger psi.
            let size = domain.min.abs().max(domain.max.abs()).max_element() + p.frame.position.length();
            let by = margin.max(0.0) * geometry.spread();
            let own = domain.grown(by + (size + margin.abs()) * (8.0 * OUTWARD));
            let aabb = Aabb::of_points(own.corners().map(|c| p.frame.point(c))).grown(size * OUTWARD);
            let center = p.frame.point(own.center());
            let ball = Ball { center, radius: own.half().length() * (1.0 + OUTWARD) + size * OUTWARD };
            return Self { aabb, ball }.tightened(volumes);
        }
        if !p.is_convex() {
            let rounding = (p.aabb.min.abs().max(p.aabb.max.abs()).max_element() + margin.abs()) * OUTWARD;
            let by = margin.max(0.0) + rounding;
            let ball = Ball { center: p.ball.center, radius: p.ball.radius + by };
            return Self { aabb: p.aabb.grown(by), ball }.tightened(volumes);
        }
        let c = p.frame.point(p.shape.geometry().interior_point());
        let Some(reach) = reach(p, c, margin) else { return Self::ALL };
        let outward = |x: DVec3, sign: f64| {
            // x + reach·(x − c), with the rounding of the primitive's own box on top; infinite sides stay so.
            let y = x + (x - c) * reach + (x.abs() + c.abs()) * (sign * OUTWARD);
            DVec3::select(x.is_finite_mask(), y, x)
        };
        let aabb = Aabb { min: outward(p.aabb.min, -1.0), max: outward(p.aabb.max, 1.0) };
        let center = p.ball.center + (p.ball.center - c) * reach;
        let radius =
            p.ball.radius * ((1.0 + reach) * (1.0 + OUTWARD)) + (p.ball.center.abs() + c.abs()).max_element() * OUTWARD;
        Self { aabb, ball: Ball { center, radius } }.tightened(volumes)
    }

    /// True when it holds no point.
    pub fn is_empty(&self) -> bool {
        self.aabb.is_empty() || self.ball.is_empty()
    }

    /// True when box and ball are finite.
    pub fn is_finite(&self) -> bool {
        self.aabb.is_finite() && self.ball.radius.is_finite()
    }

    /// Box and ball each tightened by the other, empty when they miss each other; of one kind alone the other one follows.
    pub fn tightened(self, volumes: Volumes) -> Self {
        match volumes {
            Volumes::Balls if self.ball.is_empty() => return Self::EMPTY,
            Volumes::Balls => return Self { aabb: self.ball.aabb(), ball: self.ball },
            Volumes::Boxes if self.aabb.is_empty() => return Self::EMPTY,
            Volumes::Boxes => return Self::of_box(self.aabb),
            Volumes::Both | Volumes::Oriented => {}
        }
        if self.is_empty() || self.ball.misses(&self.aabb) {
            return Self::EMPTY;
        }
        let aabb = self.aabb.intersection(&self.ball.aabb());
        if aabb.is_empty() {
            return Self::EMPTY;
        }
        let around = Ball::of_box(&aabb);
        let ball = if around.radius < self.ball.radius { around } else { self.ball };
        Self { aabb, ball }
    }

    /// A bound of what both hold.
    pub fn intersection(&self, other: &Self, volumes: Volumes) -> Self {
        let aabb = self.aabb.intersection(&other.aabb);
        Self { aabb, ball: self.ball.intersection(&other.ball) }.tightened(volumes)
    }

    /// A bound of what either holds.
    pub fn union(&self, other: &Self, volumes: Volumes) -> Self {
        if self.is_empty() {
            return *other;
        }
        if other.is_empty() {
            return *self;
        }
        Self { aabb: self.aabb.union(&other.aabb), ball: self.ball.union(&other.ball) }.tightened(volumes)
    }

    /// The upward rule: a bound of an operation's result from the bounds of its operands, in order.
    pub fn upward(op: Op, mut operands: impl Iterator<Item = Bound>, volumes: Volumes) -> Self {
        match op {
            Op::Union => operands.fold(Self::EMPTY, |a, b| a.union(&b, volumes)),
            Op::Intersection => operands.fold(Self::ALL, |a, b| a.intersection(&b, volumes)),
            Op::Difference => operands.next().unwrap_or(Self::EMPTY),
        }
    }

    /// A bound with the smaller box of the two and the smaller ball, both of which must hold the same points.
    pub fn smaller(&self, other: &Self, volumes: Volumes) -> Self {
        let ball = if other.ball.radius < self.ball.radius { other.ball } else { self.ball };
        Self { aabb: self.aabb.intersection(&other.aabb), ball }.tightened(volumes)
    }

    /// True when `self` is smaller than `before` by more than the fraction `progress`, or newly empty or finite.
    pub fn shrank_from(&self, before: &Self, progress: f64) -> bool {
        if self.is_empty() {
            return !before.is_empty();
        }
        let extent = |b: &Aabb| b.max - b.min;
        let (e, f) = (extent(&self.aabb), extent(&before.aabb));
        let less = |now: f64, was: f64| now < was * (1.0 - progress) || (now.is_finite() && !was.is_finite());
        less(self.ball.radius, before.ball.radius) || (0..3).any(|k| less(e[k], f[k]))
    }
}
