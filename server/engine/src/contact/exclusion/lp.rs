//! The inner problem of every bound: the lowest point of a few planes over a box.
//!
//! ```text
//! z* = min over |y_k| <= e_k of max_i (b_i + n_i·y)  =  max over λ >= 0, Σλ = 1 of Σ λ_i b_i − Σ_k e_k |Σ λ_i n_i|_k
//! ```
//!
//! A linear program with four rows: the dual has the columns (n_i, 1) with profit b_i and the six slacks (∓ê_k, 0) with
//! profit −e_k; the best single plane with its three slacks is a feasible start, so a primal simplex on a 4×4 basis inverse
//! needs no first phase. Whatever it returns is only a proposal: callers evaluate the bound of its λ themselves, so an
//! early stop or rounding can cost work, never correctness.

use crate::math::halt;
use glam::{DMat4, DVec3, DVec4};

/// The multipliers and the point the program proposes.
#[derive(Clone, Copy, Debug)]
pub struct Solution {
    /// Proposed minimum z*.
    pub z: f64,
    /// The minimising point y, relative to the box's centre.
    pub y: DVec3,
    /// Planes with a positive multiplier: (index, λ).
    pub support: [(u32, f64); 4],
    /// How many of `support` are filled.
    pub count: usize,
}

/// Planes b + n·y, coordinate by coordinate: the program looks at one number of each at a time.
#[derive(Clone, Debug, Default)]
pub struct Planes {
    normals: [Vec<f64>; 3],
    b: Vec<f64>,
    /// Working memory: how high each is above what the program has come to.
    heights: Vec<f64>,
}

impl Planes {
    /// Takes other planes in place of these: normals and values at the box's centre.
    pub fn set(&mut self, planes: impl ExactSizeIterator<Item = (DVec3, f64)>) {
        let count = planes.len();
        let Self { normals: [nx, ny, nz], b, .. } = self;
        for all in [&mut *nx, &mut *ny, &mut *nz, &mut *b] {
            all.resize(count, 0.0);
        }
        let (nx, ny, nz, b) = (&mut nx[..count], &mut ny[..count], &mut nz[..count], &mut b[..count]);
        for (i, (normal, value)) in planes.enumerate().take(count) {
            (nx[i], ny[i], nz[i], b[i]) = (normal.x, normal.y, normal.z, value);
        }
    }

    fn len(&self) -> usize {
        self.b.len()
    }

    fn normal(&self, i: usize) -> DVec3 {
        let [x, y, z] = &self.normals;
        DVec3::new(x[i], y[i], z[i])
    }

    /// The plane that is highest above another one, n = −(y0, y1, y2), b = −y3, if it is by more than `gain`; and by how much. The
    /// first of equals.
    fn highest(&mut self, y: [f64; 4], gain: f64) -> Option<(usize, f64)> {
        let Self { normals: [nx, ny, nz], b, heights } = self;
        let count = b.len();
        heights.resize(count, 0.0);
        let (nx, ny, nz, b, heights) = (&nx[..count], &ny[..count], &nz[..count], &b[..count], &mut heights[..count]);
        for i in 0..count {
            heights[i] = b[i] - (nx[i] * y[0] + ny[i] * y[1] + nz[i] * y[2] + y[3]);
        }
        let mut most = [gain; LANES];
        let (chunks, rest) = heights.as_chunks::<LANES>();
        for chunk in chunks {
            for (most, height) in most.iter_mut().zip(chunk) {
                *most = if *height > *most { *height } else { *most };
            }
        }
        let highest = most.iter().chain(rest).fold(gain, |most, height| if *height > most { *height } else { most });
        if highest > gain { heights.iter().position(|h| *h == highest).map(|i| (i, highest)) } else { None }
    }
}

/// Planes looked at side by side.
const LANES: usize = 4;

/// The plane that is highest at its lowest point over the box, alone: the program without multipliers.
pub fn best_alone(planes: &Planes, half: DVec3) -> Solution {
    let lowest = |i: usize| planes.b[i] - planes.normal(i).abs().dot(half);
    let best = (0..planes.len()).max_by(|i, j| lowest(*i).total_cmp(&lowest(*j))).unwrap_or(0);
    let y = -half * planes.normal(best).signum();
    Solution { z: lowest(best), y, support: [(best as u32, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)], count: 1 }
}

/// Pivots after which the current basis is returned as it is.
const MAX_PIVOTS: usize = 48;
/// Slack columns stand before the planes: 2k (p_k) and 2k + 1 (q_k), k < 3; plane i is column `SLACKS` + i.
const SLACKS: usize = 6;
const NONE: usize = usize::MAX;

/// A basis to start from: that of the last program, whose planes were much the same.
#[derive(Clone, Copy, Debug, Default)]
pub struct Warm {
    basis: Option<[usize; 4]>,
    /// Pivots of the last program.
    pub pivots: u64,
}

impl Warm {
    /// The inverse of the basis over these planes; `None` if it is none, nearly singular, or not feasible.
    fn inverse(&self, planes: &Planes) -> Option<([usize; 4], [[f64; 4]; 4])> {
        let basis = self.basis?;
        if basis.iter().any(|c| *c >= SLACKS + planes.len()) {
            return None;
        }
        let column = |c: usize| match c.checked_sub(SLACKS) {
            Some(i) => planes.normal(i).extend(1.0),
            None => {
                let mut v = [0.0; 4];
                v[c / 2] = if c.is_multiple_of(2) { -1.0 } else { 1.0 };
                DVec4::from_array(v)
            }
        };
        let matrix = DMat4::from_cols(column(basis[0]), column(basis[1]), column(basis[2]), column(basis[3]));
        let det = matrix.determinant();
        if det.is_nan() || det.abs() < 1e-6 {
            return None;
        }
        let inv = matrix.inverse().transpose().to_cols_array_2d();
        inv.iter().all(|row| row[3] >= 0.0).then_some((basis, inv))
    }
}

/// Solves the program for some planes; at least one is needed. `warm` is where to start, and is left where this ended.
pub fn min_max(planes: &mut Planes, half: DVec3, warm: &mut Warm) -> Solution {
    debug_assert!(planes.len() > 0);
    let scale = planes.b.iter().fold(half.max_element(), |m: f64, b| m.max(b.abs()));
    let tol = 1e-14 * scale;
    // Rows of the basis inverse; `basis[r]` is the column in row r.
    let (mut basis, mut inv) = warm.inverse(planes).unwrap_or_else(|| single(planes, half));
    let e = half.to_array();
    let profit = |planes: &Planes, c: usize| if c >= SLACKS { planes.b[c - SLACKS] } else { -e[c / 2] };
    let mut p = basis.map(|c| profit(planes, c));
    let mut y = [0.0; 4];
    let mut pivots = 0;
    for _ in 0..MAX_PIVOTS {
        halt::work(8);
        pivots += 1;
        for k in 0..4 {
            y[k] = p[0] * inv[0][k] + p[1] * inv[1][k] + p[2] * inv[2][k] + p[3] * inv[3][k];
        }
        // Entering column: the largest reduced profit.
        let (mut entering, mut gain) = planes.highest(y, tol).map_or((NONE, tol), |(i, gain)| (SLACKS + i, gain));
        for k in 0..3 {
            let over = y[k].abs() - e[k];
            if over > gain {
                (entering, gain) = (2 * k + usize::from(y[k] < 0.0), over);
            }
        }
        if entering == NONE {
            break;
        }
        let d: [f64; 4] = match entering.checked_sub(SLACKS) {
            Some(i) => {
                let n = planes.normal(i);
                std::array::from_fn(|r| inv[r][0] * n.x + inv[r][1] * n.y + inv[r][2] * n.z + inv[r][3])
            }
            None => std::array::from_fn(|r| {
                let v = inv[r][entering / 2];
                if entering.is_multiple_of(2) { -v } else { v }
            }),
        };
        let (mut leaving, mut ratio) = (NONE, f64::INFINITY);
        for r in 0..4 {
            if d[r] > 1e-12 {
                let q = inv[r][3].max(0.0) / d[r];
                // Ties: the larger pivot, for stability.
                if q < ratio || (q == ratio && leaving != NONE && d[r] > d[leaving]) {
                    (leaving, ratio) = (r, q);
                }
            }
        }
        if leaving == NONE {
            break;
        }
        let pivot = 1.0 / d[leaving];
        let row = inv[leaving].map(|v| v * pivot);
        for r in 0..4 {
            for k in 0..4 {
                inv[r][k] -= d[r] * row[k];
            }
        }
        inv[leaving] = row;
        (basis[leaving], p[leaving]) = (entering, profit(planes, entering));
    }
    *warm = Warm { basis: Some(basis), pivots };
    let mut s = Solution { z: y[3], y: DVec3::new(-y[0], -y[1], -y[2]), support: [(0, 0.0); 4], count: 0 };
    s.y = s.y.clamp(-half, half);
    for r in 0..4 {
        if basis[r] >= SLACKS && inv[r][3] > 0.0 {
            s.support[s.count] = ((basis[r] - SLACKS) as u32, inv[r][3]);
            s.count += 1;
        }
    }
    s
}

/// The first basis: the plane whose own minimum over the box is highest, with its slacks.
fn single(planes: &Planes, half: DVec3) -> ([usize; 4], [[f64; 4]; 4]) {
    let mut best = (f64::NEG_INFINITY, 0);
    for (i, b) in planes.b.iter().enumerate() {
        let own = b - planes.normal(i).abs().dot(half);
        if own > best.0 {
            best = (own, i);
        }
    }
    let (mut basis, mut inv) = ([SLACKS + best.1; 4], [[0.0; 4]; 4]);
    for k in 0..3 {
        let n = planes.normal(best.1)[k];
        let (column, sign) = if n >= 0.0 { (2 * k, -1.0) } else { (2 * k + 1, 1.0) };
        basis[k] = column;
        inv[k][k] = sign;
        inv[k][3] = -sign * n;
    }
    inv[3][3] = 1.0;
    (basis, inv)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    fn check(normals: &[DVec3], b: &[f64], half: DVec3) {
        let planes = |b: &[f64]| {
            let mut planes = Planes::default();
            planes.set(normals.iter().copied().zip(b.iter().copied()));
            planes
        };
        let mut warm = Warm::default();
        let cold = min_max(&mut planes(b), half, &mut warm);
        judge(&cold, normals, b, half);
        // The same program, and one a little further on, from the basis of the first.
        judge(&min_max(&mut planes(b), half, &mut warm), normals, b, half);
        let moved: Vec<f64> = b.iter().enumerate().map(|(i, b)| b + 0.1 * (i as f64).sin()).collect();
        judge(&min_max(&mut planes(&moved), half, &mut warm), normals, &moved, half);
    }

    fn judge(s: &Solution, normals: &[DVec3], b: &[f64], half: DVec3) {
        let top = |y: DVec3| (0..b.len()).map(|i| b[i] + normals[i].dot(y)).fold(f64::NEG_INFINITY, f64::max);
        // Strong duality: the multipliers' bound equals the value at the point.
        let (mut value, mut w) = (0.0, DVec3::ZERO);
        for &(i, l) in &s.support[..s.count] {
            value += l * b[i as usize];
            w += l * normals[i as usize];
        }
        let bound = value - w.abs().dot(half);
        assert!((bound - top(s.y)).abs() < 1e-12, "{bound} {}", top(s.y));
        assert!((s.z - bound).abs() < 1e-12);
    }

    #[test]
    fn primal_and_dual_agree_on_random_planes() {
        let mut numbers = Random(1);
        let mut random = || numbers.within(-1.0, 1.0);
        for round in 0..20000 {
            let count = 1 + round % 12;
            let normals: Vec<DVec3> = (0..count)
                .map(|_| DVec3::new(random(), random(), random()).try_normalize().unwrap_or(DVec3::X))
                .collect();
            let b: Vec<f64> = (0..count).map(|_| random()).collect();
            check(&normals, &b, DVec3::new(random().abs(), random().abs(), random().abs()));
        }
    }

    #[test]
    fn degenerate_planes_are_solved() {
        let n = [DVec3::X, -DVec3::X, DVec3::X, DVec3::Y, -DVec3::Y];
        check(&n, &[0.0; 5], DVec3::splat(1.0));
        check(&n[..2], &[1.0, 1.0], DVec3::new(1.0, 0.0, 1.0));
        check(&n[..1], &[-0.5], DVec3::ZERO);
    }
}
