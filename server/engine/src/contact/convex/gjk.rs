//! Distance of two convex bodies by Gilbert, Johnson and Keerthi's algorithm: the nearest point to 0 of their difference.
//!
//! What comes out is a direction and two witnesses; nothing relies on how exact they are, the advance proves with what the
//! bodies reach along the direction.
//! The algorithm itself is `math::gjk`.

use super::support::ConvexBody;
use crate::math::gjk::{Cores, of_supports};
use glam::DVec3;

/// A convex body as a support mapping: the core, and what it is thicker than that all around.
pub trait SupportMapping {
    /// The core's farthest point along n, which may have any length.
    fn support(&self, n: DVec3) -> DVec3;
    /// What the body is thicker than its core.
    fn margin(&self) -> f64;
}

impl SupportMapping for ConvexBody<'_> {
    #[inline]
    fn support(&self, n: DVec3) -> DVec3 {
        ConvexBody::support(self, n)
    }

    fn margin(&self) -> f64 {
        self.margin
    }
}

/// The nearest points of two disjoint bodies.
#[derive(Clone, Copy, Debug)]
pub struct Nearest {
    /// Distance, as far as the witnesses tell.
    pub distance: f64,
    /// Unit direction from a to b.
    pub normal: DVec3,
    /// Witness on a.
    pub a: DVec3,
    /// Witness on b.
    pub b: DVec3,
}

/// How two bodies stand to each other.
pub enum Meeting {
    /// Their cores are apart.
    Apart(Nearest),
    /// A point of both cores, as far as rounding goes.
    Common(DVec3),
    /// Neither was found.
    Open,
}

/// Distance of `a` and `b`, as `meeting` finds it; `None` if their cores overlap, or nearly so.
pub fn nearest(a: &impl SupportMapping, b: &impl SupportMapping, start: DVec3, good: f64) -> Option<Nearest> {
    if let Meeting::Apart(found) = meeting(a, b, start, good) { Some(found) } else { None }
}

/// The nearest points of `a` and `b`, from a first direction, to a relative gap of `good` between their distance and its
/// lower bound; or a common point.
pub fn meeting(a: &impl SupportMapping, b: &impl SupportMapping, start: DVec3, good: f64) -> Meeting {
    match of_supports(|v| a.support(v), |v| b.support(v), start, good) {
        Cores::Apart { v, a: on_a, .. } => {
            let length = v.length();
            let normal = v / length;
            if !normal.is_finite() {
                return Meeting::Open;
            }
            let distance = length - a.margin() - b.margin();
            let on_a = on_a + normal * a.margin();
            Meeting::Apart(Nearest { distance, normal, a: on_a, b: on_a + normal * distance })
        }
        Cores::Common(x) => Meeting::Common(x),
        Cores::Open => Meeting::Open,
    }
}
