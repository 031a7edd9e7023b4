//! Parallel axes: two trapezia in the plane of the axes decide.
//!
//! Both bodies are symmetric about the plane that holds both axes, and where a separating direction exists the best one
//! is unique, so it lies in that plane; there each body's support is that of its meridian trapezium. Configurations:
//! side of a trapezium against a corner (cap, generator), corner against corner (rim, apex).
//! Source: elementary; the uniqueness from the concavity of the separation.

use super::{Best, Round};
use contactd::math::{any_perpendicular, tolerance::PARALLEL};

/// Offers every configuration of a pair with parallel axes; false if they are not, exactly.
pub fn parallel(a: &Round, b: &Round, best: &mut Best) -> bool {
    if a.axis.cross(b.axis).length_squared() > PARALLEL * PARALLEL {
        return false;
    }
    let o = b.centers[0] - a.centers[0];
    let p = o - a.axis * o.dot(a.axis);
    let u = p.try_normalize().unwrap_or_else(|| any_perpendicular(a.axis));
    // On a common axis p is rounding, and not even square to it.
    let u = (u - a.axis * u.dot(a.axis)).try_normalize().unwrap_or_else(|| any_perpendicular(a.axis));
    let corners = |r: &Round| [0, 1].map(|i| [1.0, -1.0].map(|s| r.centers[i] + u * (s * r.radii[i])));
    for (r, sign) in [(a, 1.0), (b, -1.0)] {
        best.offer(r.axis);
        best.offer(-r.axis);
        let cos = (1.0 - r.lean * r.lean).sqrt();
        best.offer((r.axis * r.lean + u * cos) * sign);
        best.offer((r.axis * r.lean - u * cos) * sign);
    }
    let (ca, cb) = (corners(a), corners(b));
    for p in ca.iter().flatten() {
        for q in cb.iter().flatten() {
            let mut list = vec![*q - *p];
            best.offer_all(&mut list);
        }
    }
    true
}
