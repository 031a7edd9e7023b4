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

/// Edges whose directions differ by less than this, squared, make no direction. Products are no unit vectors: what rounding
/// does to a gap, some ten half units of the numbers at hand, is up to 32 times that along the unit vector. It has to stay below
/// 2 delta, which is no less than eight roundings of the pair of 66 half units each.
const PARALLEL: f64 = 1e-3;

/// Two boxes along the axes of the first one.
pub struct Boxes {
    /// Half extents.
    pub half: [DVec3; 2],
    /// The axes of the second one.
    pub turned: DMat3,
    /// From the first one's centre to the second one's at the start.
    pub way: DVec3,
    /// Of the first one against the second one.
    pub velocity: DVec3,
}

/// What the slabs tell.
pub enum Passage {
    /// The boxes miss each other.
    Miss,
    /// They meet first across this direction.
    Across(Across),
    /// Neither is told.
    Open,
}

/// A direction across which two boxes may meet, and whether it is turned.
#[derive(Clone, Copy)]
pub struct Across {
    /// What lies across it.
    pub features: Features,
    /// 1, or −1 for the opposite direction.
    pub sign: f64,
}

/// What lies across a direction: a face, or an edge of each box, by the indices of their axes.
#[derive(Clone, Copy)]
pub enum Features {
    FaceOfA(usize),
    FaceOfB(usize),
    Edges(usize, usize),
}

impl Features {
    /// The slabs in order: A's axes, B's axes, their products.
    fn of(slab: usize) -> Self {
        match slab {
            0..3 => Self::FaceOfA(slab),
            3..6 => Self::FaceOfB(slab - 3),
            _ => Self::Edges((slab - 6) / 3, (slab - 6) % 3),
        }
    }
}

impl Boxes {
    /// Whether the boxes meet in the course of time. A gap excludes a contact.
    #[inline]
    pub fn pass(&self) -> Passage {
        let b = &self.turned;
        let r = b.transpose().to_cols_array_2d();
        let abs = |row: [f64; 3]| [row[0].abs(), row[1].abs(), row[2].abs()];
        let s = [abs(r[0]), abs(r[1]), abs(r[2])];
        let (p, q) = (self.half[0].to_array(), self.half[1].to_array());
        let (c, w) = (self.way.to_array(), self.velocity.to_array());
        let (d, v) = ((b.transpose() * self.way).to_array(), (b.transpose() * self.velocity).to_array());
        // Along each direction: way, velocity, what both boxes reach. Three arrays, which are worked on side by side.
        let (mut along, mut speed, mut reach) = ([0.0; 15], [0.0; 15], [0.0; 15]);
        for i in 0..3 {
            (along[i], speed[i]) = (c[i], w[i]);
            reach[i] = p[i] + (q[0] * s[i][0] + q[1] * s[i][1] + q[2] * s[i][2]);
            (along[3 + i], speed[3 + i]) = (d[i], v[i]);
            reach[3 + i] = q[i] + (p[0] * s[0][i] + p[1] * s[1][i] + p[2] * s[2][i]);
            let (i1, i2) = ((i + 1) % 3, (i + 2) % 3);
            for j in 0..3 {
                let (j1, j2, k) = ((j + 1) % 3, (j + 2) % 3, 6 + 3 * i + j);
                let sum = (p[i1] * s[i2][j] + p[i2] * s[i1][j]) + (q[j1] * s[i][j2] + q[j2] * s[i][j1]);
                // Of edges along each other a slab that holds everything.
                reach[k] = if 1.0 - r[i][j] * r[i][j] > PARALLEL { sum } else { f64::INFINITY };
                along[k] = c[i2] * r[i1][j] - c[i1] * r[i2][j];
                speed[k] = w[i2] * r[i1][j] - w[i1] * r[i2][j];
            }
        }
        let (mut enter, mut leave) = ([0.0; 15], [0.0; 15]);
        for k in 0..15 {
            let each = 1.0 / speed[k].abs();
            let ahead = along[k] * 1f64.copysign(speed[k]);
            (enter[k], leave[k]) = ((ahead - reach[k]) * each, (ahead + reach[k]) * each);
        }
        // What is not a number, a slab entered and left by rest alone, is passed over.
        let (first, last) = (latest(&enter), latest(&leave.map(|t| -t)));
        let (entry, exit) = (enter[first], leave[last]);
        let (closing, leaving) = (speed[first].abs(), speed[last].abs());
        let sides = [first, last].map(|k| along[k] * 1f64.copysign(speed[k]));
        // A direction that is free to the end, one that is free from the start, or two that take turns.
        let halfway = 0.5 * (entry - exit);
        if sides[0] - reach[first] - closing > 0.0
            || -sides[1] - reach[last] > 0.0
            || (halfway * closing > 0.0 && halfway * leaving > 0.0)
        {
            return Passage::Miss;
        }
        if entry > exit || !entry.is_finite() {
            return Passage::Open;
        }
        Passage::Across(Across { features: Features::of(first), sign: 1f64.copysign(speed[first]) })
    }
}

/// Where the largest of some numbers is: the first of those. No step waits for the one before it.
#[inline(always)]
fn latest(times: &[f64; 15]) -> usize {
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    let mut best = [f64::NEG_INFINITY; 4];
    for (k, t) in times.iter().enumerate() {
        best[k % 4] = larger(*t, best[k % 4]);
    }
    let most = larger(larger(best[0], best[1]), larger(best[2], best[3]));
    let equal = times.iter().enumerate().fold(1 << 14, |equal: u32, (k, t)| equal | u32::from(*t == most) << k);
    equal.trailing_zeros() as usize
}
