//! Affine images of round faces, and quadrics, from their numbers: psi is |B y| − w·y − r, or |P| − |N|.

use super::interval::{
    Interval, Jet, Vector, ZERO, cross, dot, length, linear, minus, offsets, plus, point, short, times, vector,
};
use contactd::solid::surface;
use glam::DVec3;

/// The parts of P and of N of a saddle: gradient, and value at its origin.
pub type Parts = [[(Vector, Interval); 2]; 2];

/// B, w and r.
pub type Rows = ([Vector; 3], Vector, Interval);

/// B, w and r of an elliptic face, from its numbers: with p = `turn` and s = |p|², the quaternion (2p, 1 − s)/(1 + s).
pub fn image(e: &surface::Elliptic) -> Rows {
    let p = vector(e.turn.to_array());
    let s = p[0].square() + p[1].square() + p[2].square();
    let per = (point(1.0) + s).recip();
    let (v, w) = (times(point(2.0) * per, p), (point(1.0) - s) * per);
    let two = point(2.0);
    // Column k: e + 2 w v × e + 2 v × (v × e).
    let column = |k: usize| {
        let unit: Vector = std::array::from_fn(|i| point(if i == k { 1.0 } else { 0.0 }));
        let once = cross(v, unit);
        plus(unit, plus(times(two * w, once), times(two, cross(v, once))))
    };
    let zero = [ZERO; 3];
    if e.third < 0.0 {
        let rows = [times(point(e.size), column(0)), times(point(e.second), column(1)), zero];
        return (rows, times(point(-e.third), column(2)), ZERO);
    }
    let whole = 1.0 - 1.0 / (1u64 << 47) as f64;
    let third = if e.third == 0.0 { zero } else { times(point(e.third), column(2)) };
    ([times(point(whole), column(0)), times(point(e.second), column(1)), third], zero, point(e.size))
}

/// The lower bound of what a psi |B y| − w·y − r is above another one at a distance `far` from the other's origin.
pub fn walled(((p, w, r), o): (Rows, DVec3), ((q, v, s), u): (Rows, DVec3), far: Interval) -> Interval {
    let like = |a: Vector, b: Vector| if dot(a, b).hi < 0.0 { times(point(-1.0), b) } else { b };
    let off = |k: usize| length(minus(p[k], like(p[k], q[k])));
    let lean = off(0) + off(1) + off(2) + length(minus(w, v));
    let delta = minus(vector(o.to_array()), vector(u.to_array()));
    s - r + dot(w, delta) - length(p.map(|row| dot(row, delta))) - lean * far
}

/// The columns of a rotation that is told by a quarter of its angle, as of an elliptic face.
pub fn columns(turn: DVec3) -> [Vector; 3] {
    let whole = 1.0 - 1.0 / (1u64 << 47) as f64;
    let like = surface::Elliptic { origin: DVec3::ZERO, turn, size: 1.0, second: whole, third: whole };
    image(&like).0.map(|row| times(point(whole).recip(), row))
}

/// B, w and r of a bowl.
pub fn rows_of_bowl(b: &surface::Bowl) -> Rows {
    let axes = columns(b.turn);
    let row = |k: usize| if b.scale[k] == 0.0 { [ZERO; 3] } else { times(point(b.scale[k]), axes[k]) };
    ([row(0), row(1), row(2)], times(point(b.fall), axes[2]), point(b.radius))
}

/// The parts of P and of N of a saddle: gradient, and value at its origin.
pub fn parts_of_saddle(s: &surface::Saddle) -> Parts {
    let axes = columns(s.turn);
    let part = |scale: f64, k: usize, at: Interval| {
        let row = if scale == 0.0 { [ZERO; 3] } else { times(point(scale), axes[k]) };
        (row, at)
    };
    if s.third == 0.0 {
        let half = 0.5 * (1.0 - 1.0 / (1u64 << 47) as f64);
        let level = point(half) * point(s.size);
        return [
            [part(s.first, 0, ZERO), part(half, 2, ZERO - level)],
            [part(s.second, 1, ZERO), part(half, 2, level)],
        ];
    }
    [[part(s.first, 0, ZERO), part(s.second, 1, ZERO)], [part(s.third, 2, ZERO), part(0.0, 2, point(s.size))]]
}

/// P and N of a saddle.
pub fn halves(s: &surface::Saddle, y: &[Jet; 3]) -> [[Jet; 2]; 2] {
    let o = offsets(y, s.origin);
    parts_of_saddle(s).map(|both| both.map(|(row, at)| linear(row, &o).plus(at)))
}

/// A vector no longer than 1 as P (0) or N (1) points at a place.
pub fn along(s: &surface::Saddle, at: DVec3, half: usize) -> [Interval; 2] {
    let o = at - s.origin;
    let middle = |v: Interval| 0.5 * (v.lo + v.hi);
    let of = |(row, level): &(Vector, Interval)| DVec3::from_array(row.map(middle)).dot(o) + middle(*level);
    let both = &parts_of_saddle(s)[half];
    let n = short(DVec3::new(of(&both[0]), of(&both[1]), 0.0));
    [n[0], n[1]]
}

/// A plane below |B y| − w·y − r, with B y as it points at a place.
pub fn touched((rows, fall, radius): Rows, o: DVec3, at: DVec3, y: &[Jet; 3]) -> Jet {
    let middle = |row: Vector| DVec3::from_array(row.map(|x| 0.5 * (x.lo + x.hi))).dot(at - o);
    let n = short(DVec3::from_array(rows.map(middle)));
    let y = offsets(y, o);
    let v = rows.map(|row| linear(row, &y));
    linear(n, &v) - linear(fall, &y).plus(radius)
}
