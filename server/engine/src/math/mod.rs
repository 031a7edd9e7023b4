//! Rigid motion's raw material: boxes, balls and the one place for numerical constants.
//!
//! Nothing here knows about solids. Floor 0: imports only `glam`.

pub mod aabb;
pub mod ball;
pub mod ball_tree;
pub mod bound_queue;
pub mod f64x2;
pub mod gjk;
pub mod halt;
pub mod linear;
pub mod mix;
pub mod moments;
pub mod oriented;
pub mod random;
pub mod scaled;
pub mod tolerance;

pub use aabb::Aabb;
pub use ball::Ball;
pub use ball_tree::BallTree;
pub use bound_queue::BoundQueue;
pub use f64x2::{F64x2, Lanes};
pub use moments::Moments;
pub use oriented::Oriented;

use glam::DVec3;

/// A unit vector perpendicular to the unit vector `a`, always the same one for the same `a`.
pub fn any_perpendicular(a: DVec3) -> DVec3 {
    let e = DVec3::AXES[a.abs().min_position()];
    (e - a * a.dot(e)).normalize()
}
