//! How two whole primitives turn.

use super::whole::PrimitivePair;
use glam::{DMat3, DVec3};

/// How a pair turns.
pub struct Turns {
    /// Rotation vectors over the step, world axes; none for a spin that moves nothing of its body.
    pub spins: [DVec3; 2],
    pub rates: [f64; 2],
    /// World from primitive: what lies along the axis of rotation, across it, and that a quarter turn on.
    axes: [[DMat3; 3]; 2],
    /// From the centres of rotation to the primitives', along the primitives' axes.
    offsets: [DVec3; 2],
    /// From A's centre of rotation to B's at the start.
    pub pivots: DVec3,
    /// Of A against B.
    velocity: DVec3,
}

/// Two bodies at one time; world axes.
#[derive(Clone, Copy)]
pub struct Posed {
    /// The time.
    pub t: f64,
    /// World from primitive.
    pub axes: [DMat3; 2],
    /// From the centres of rotation to the primitives'.
    pub offsets: [DVec3; 2],
    /// From A's centre to B's.
    pub way: DVec3,
}

impl Turns {
    /// Of primitives that stand with these axes at the start.
    pub fn new(pair: &PrimitivePair, axes: [DMat3; 2], spins: [DVec3; 2]) -> Self {
        let rates = spins.map(DVec3::length);
        let split = |k: usize| {
            if rates[k] == 0.0 {
                return [axes[k], DMat3::ZERO, DMat3::ZERO];
            }
            let u = spins[k] / rates[k];
            let part =
                |f: &dyn Fn(DVec3) -> DVec3| DMat3::from_cols(f(axes[k].x_axis), f(axes[k].y_axis), f(axes[k].z_axis));
            let along = part(&|v| u * u.dot(v));
            [along, axes[k] - along, part(&|v| u.cross(v))]
        };
        let offsets = [0, 1]
            .map(|k| if pair.offsets[k] == DVec3::ZERO { DVec3::ZERO } else { axes[k].transpose() * pair.offsets[k] });
        let pivots = pair.way - pair.offsets[1] + pair.offsets[0];
        Self { spins, rates, axes: [split(0), split(1)], offsets, pivots, velocity: pair.velocity }
    }

    /// The bodies at a time.
    pub fn at(&self, t: f64) -> Posed {
        // Each body by itself: `map` over an array of two is a call for each step of it.
        let axes = [self.axes_at(0, t), self.axes_at(1, t)];
        let offset = |k: usize| if self.offsets[k] == DVec3::ZERO { DVec3::ZERO } else { axes[k] * self.offsets[k] };
        let offsets = [offset(0), offset(1)];
        Posed { t, axes, offsets, way: self.pivots - self.velocity * t + (offsets[1] - offsets[0]) }
    }

    /// World from primitive at a time.
    #[inline]
    fn axes_at(&self, k: usize, t: f64) -> DMat3 {
        let [along, across, ahead] = &self.axes[k];
        if self.rates[k] == 0.0 {
            return *along;
        }
        let (s, c) = libm::sincos(self.rates[k] * t);
        *along + *across * c + *ahead * s
    }
}
