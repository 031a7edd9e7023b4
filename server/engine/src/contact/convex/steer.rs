//! Newton's step of a direction, with the features that two bodies show along it.
//!
//! A body that shows an edge or a side along n holds n to a circle of directions, two circles hold it altogether, else the
//! gap is smooth on what is left; see `straight` and `turning` for the equations.

use super::part::ConvexPart;
use crate::math::any_perpendicular;
use crate::solid::primitive::Shown;
use glam::{DVec2, DVec3};

/// A circle of directions n·a = lean, flattened at a direction.
#[derive(Clone, Copy, Default)]
struct Circle {
    /// a across n.
    way: DVec2,
    /// By how much n misses it.
    off: f64,
    lean: f64,
    /// d(a)/dt across n, and of the miss.
    turn: DVec2,
    rate: f64,
}

/// The step of the unit direction n to where the gap along it is stationary, at n now and for each unit of time. `way` is the
/// gradient of the gap, with the weight that n itself has in it (the gap), `moves` what it becomes in time where the same
/// points are shown; the bodies turn by `spins`. `None` where the gap is lowest, not highest.
#[inline(always)] // What does not turn leaves half of it out.
pub fn steer(
    parts: &[ConvexPart; 2],
    held: &[(u8, bool); 2],
    shown: &[Shown; 2],
    n: DVec3,
    (way, weight): (DVec3, f64),
    moves: DVec3,
    spins: [DVec3; 2],
) -> Option<(DVec3, DVec3)> {
    let e = any_perpendicular(n);
    let f = n.cross(e);
    let flat = |v: DVec3| DVec2::new(v.dot(e), v.dot(f));
    let (mut xx, mut xy) = (-(shown[0].round + shown[1].round) - weight, 0.0);
    let mut yy = xx;
    let mut shift = moves;
    for (part, spin) in shown.iter().zip(spins) {
        let t = flat(part.tangent);
        xx -= part.bend * t.x * t.x;
        xy -= part.bend * t.x * t.y;
        yy -= part.bend * t.y * t.y;
        // As the body turns other points are shown.
        let turned = spin.cross(n);
        shift += turned * part.round + part.tangent * (part.bend * part.tangent.dot(turned));
    }
    let (g, shift) = (flat(way), flat(shift));
    let times = |v: DVec2| DVec2::new(xx * v.x + xy * v.y, xy * v.x + yy * v.y);
    // Circles of both bodies; of two that are one the second says nothing.
    let (mut circles, mut count) = ([Circle::default(); 2], 0);
    for (k, sign) in [1.0, -1.0].into_iter().enumerate() {
        for (a, lean) in parts[k].circles(held[k].0) {
            let a = a * sign;
            let way = flat(a);
            let is_same = |c: &Circle| c.way.perp_dot(way).abs() <= 1e-6 * c.way.length() * way.length();
            if count < 2 && !circles[..count].iter().any(is_same) {
                let turn = spins[k].cross(a);
                circles[count] = Circle { way, off: n.dot(a) - lean, lean, turn: flat(turn), rate: n.dot(turn) };
                count += 1;
            }
        }
    }
    let (now, later) = match &circles[..count] {
        [] => {
            let det = xx * yy - xy * xy;
            if det <= 1e-6 * xx * yy || xx >= 0.0 {
                return None;
            }
            let solve = |v: DVec2| DVec2::new(xy * v.y - yy * v.x, xy * v.x - xx * v.y) / det;
            (solve(g), solve(shift))
        }
        [c] => {
            let square = c.way.length_squared();
            let mu = g.dot(c.way) / square;
            let along = c.way.perp() / square.sqrt();
            let bend = times(along).dot(along) + mu * c.lean;
            if bend >= 0.0 {
                return None;
            }
            let step = |off: f64, gradient: DVec2| {
                let across = c.way * (-off / square);
                across - along * ((gradient.dot(along) + times(across).dot(along)) / bend)
            };
            (step(c.off, g), step(c.rate, shift - c.turn * mu))
        }
        [p, q, ..] => {
            let det = p.way.perp_dot(q.way);
            let solve = |p_off: f64, q_off: f64| (p.way.perp() * q_off - q.way.perp() * p_off) / -det;
            (solve(p.off, q.off), solve(p.rate, q.rate))
        }
    };
    let unflat = |v: DVec2| e * v.x + f * v.y;
    Some((unflat(now), unflat(later)))
}
