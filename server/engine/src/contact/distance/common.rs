//! A point that two bodies share, looked for from a point that both are near.

use super::part::literal_at;
use super::polish::Pair;
use crate::motion::Instant;
use crate::octree::Model;
use crate::solid::local::LiteralId;
use glam::DVec3;

/// Steps of one length on the way to a common point, and the next length.
const STEPS: usize = 32;
const SHORTER: f64 = 0.25;

/// A point of both bodies, proven, that is found from one of A's model frame; `least`: the shortest step, a length.
///
/// It steps against the gradient of the higher f, by ever shorter steps: where both are convex the way to any point of both becomes shorter
/// by a step that is shorter than that point is deep (N. Z. Shor, Minimization Methods for Non-Differentiable Functions, Springer 1985,
/// section 2.1).
pub fn from_point(models: [&Model; 2], at: &Instant, x: DVec3, rounding: f64, least: f64) -> Option<Pair> {
    let higher = |x: DVec3| {
        let y = at.b_point(x);
        let [(f, f_id), (g, g_id)] = [models[0].deciding(x), models[1].deciding(y)];
        let gradient =
            |k: usize, id: LiteralId, x: DVec3| literal_at(&models[k].solid.faces[id.face() as usize], id.sense(), x).1;
        if f >= g { (f, gradient(0, f_id, x)) } else { (g, at.a_vector(gradient(1, g_id, y))) }
    };
    let (mut best, mut step) = ((f64::INFINITY, x), models[0].size().min(models[1].size()));
    while step > least {
        step *= SHORTER;
        let mut x = best.1;
        for _ in 0..STEPS {
            let (f, gradient) = higher(x);
            if f <= -rounding {
                return Some(Pair { x, y: at.b_point(x), distance: 0.0 });
            }
            if f < best.0 {
                best = (f, x);
            }
            x -= gradient * step;
        }
    }
    None
}
