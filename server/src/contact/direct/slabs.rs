//! Two boxes that only move along: one of 15 directions tells when they meet.
//!
//! Their difference is a polytope whose faces lie across the normals of either box or across the products of their edges
//! (S. Gottschalk, M. C. Lin, D. Manocha, SIGGRAPH 1996), so it is the intersection of 15 slabs. With w the velocity of A
//! against B, c the way from A's centre to B's, n one of these directions turned so that n·w >= 0 and r what both boxes reach
//! along it, B's centre passes the slab from (n·c − r)/n·w to (n·c + r)/n·w: the latest entry is the time of contact if no
//! exit comes before it (the slabs of T. L. Kay and J. T. Kajiya, SIGGRAPH 1986).
//!
//! Where an exit does come before the latest entry, halfway between both the one direction is free since the start and the
//! other one until the end: that is the proof of a miss. Nothing else relies on how exact these times are.

use glam::{DMat3, DVec3};

/// Edges whose directions differ by less than this, squared, make no direction: its gap would be rounding.
const PARALLEL: f64 = 1e-6;

/// What the slabs tell.
pub enum Passage {
    /// The boxes miss each other, by a gap that is larger than asked for.
    Miss,
    /// They meet first across this direction, a unit vector; which of A's and B's axes lie across it.
    Across(DVec3, [u8; 2]),
    /// Neither is told.
    Open,
}

/// Two boxes by their axes in the world and half extents; `free` is a gap that excludes a contact.
pub fn pass(axes: [&DMat3; 2], half: [DVec3; 2], way: DVec3, velocity: DVec3, free: f64) -> Passage {
    let [a, b] = axes;
    let turned = a.transpose() * *b;
    let r: [[f64; 3]; 3] = turned.transpose().to_cols_array_2d();
    let s = r.map(|row| row.map(f64::abs));
    let (p, q) = (half[0].to_array(), half[1].to_array());
    let (c, w) = ((a.transpose() * way).to_array(), (a.transpose() * velocity).to_array());
    let (d, v) = ((b.transpose() * way).to_array(), (b.transpose() * velocity).to_array());
    // Along each direction: way, velocity, what both boxes reach.
    let mut slabs = [(0.0, 0.0, 0.0); 15];
    for i in 0..3 {
        slabs[i] = (c[i], w[i], p[i] + q[0] * s[i][0] + q[1] * s[i][1] + q[2] * s[i][2]);
        slabs[3 + i] = (d[i], v[i], q[i] + p[0] * s[0][i] + p[1] * s[1][i] + p[2] * s[2][i]);
        let (i1, i2) = ((i + 1) % 3, (i + 2) % 3);
        for j in 0..3 {
            let (j1, j2) = ((j + 1) % 3, (j + 2) % 3);
            let reach = p[i1] * s[i2][j] + p[i2] * s[i1][j] + q[j1] * s[i][j2] + q[j2] * s[i][j1];
            // Of edges along each other a slab that holds everything.
            let reach = if 1.0 - r[i][j] * r[i][j] > PARALLEL { reach } else { f64::INFINITY };
            let across = |x: &[f64; 3]| x[i2] * r[i1][j] - x[i1] * r[i2][j];
            slabs[6 + 3 * i + j] = (across(&c), across(&w), reach);
        }
    }
    let times = slabs.map(|(along, speed, reach)| {
        let each = 1.0 / speed.abs();
        let along = along * 1f64.copysign(speed);
        ((along - reach) * each, (along + reach) * each)
    });
    let (mut k, mut last) = (0, 0);
    for i in 1..15 {
        k = if times[i].0 > times[k].0 { i } else { k };
        last = if times[i].1 < times[last].1 { i } else { last };
    }
    let (entry, exit) = (times[k].0, times[last].1);
    let (closing, leaving) = (slabs[k].1.abs(), slabs[last].1.abs());
    // A direction that is free to the end, one that is free from the start, or two that take turns. They are no longer than
    // unit vectors.
    let beyond = |time: f64, speed: f64| time * speed > free;
    let halfway = 0.5 * (entry - exit);
    if beyond(entry - 1.0, closing) || beyond(-exit, leaving) || (beyond(halfway, closing) && beyond(halfway, leaving))
    {
        return Passage::Miss;
    }
    if entry > exit || !entry.is_finite() {
        return Passage::Open;
    }
    let others = |k: usize| 0b111 & !(1 << k);
    let (n, held) = match k {
        0..3 => (a.col(k), [others(k), 0]),
        3..6 => (b.col(k - 3), [0, others(k - 3)]),
        _ => {
            let (i, j) = ((k - 6) / 3, (k - 6) % 3);
            (a.col(i).cross(b.col(j)), [1 << i, 1 << j])
        }
    };
    let n = if n.dot(velocity) < 0.0 { -n } else { n };
    n.try_normalize().map_or(Passage::Open, |n| Passage::Across(n, held))
}
