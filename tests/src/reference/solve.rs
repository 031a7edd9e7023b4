//! The contact equations of a few literals, solved by Newton's method with a differenced Jacobian.
//!
//! Unknown are the point x (a's frame), the time or the level, and one multiplier a row:
//! every row's function = level, sum of multiplier times gradient = 0, multipliers of literals sum to 1. A cone's apex
//! is three rows of its own: two across the axis and one along it, through the apex of the cone at that level.

use super::field::Field;
use super::linear::least_squares;
use contactd_proto::Motion;
use glam::{DMat3, DVec3};

/// Two fields under their motions. Points are in a's object frame.
pub struct Pair {
    /// First solid.
    pub a: Field,
    /// Second solid.
    pub b: Field,
    /// Motions of a and b.
    pub motions: [Motion; 2],
}

/// Where b stands as seen from a at one time.
#[derive(Clone, Copy)]
pub struct Frame {
    /// Time.
    pub t: f64,
    /// Rotation of a.
    pub turn_a: DMat3,
    /// Rotation of b.
    pub turn_b: DMat3,
    /// From a's origin to b's, world axes.
    pub d: DVec3,
}

impl Frame {
    /// A point of a's frame in b's.
    pub fn to_b(&self, x: DVec3) -> DVec3 {
        self.turn_b.transpose() * (self.turn_a * x - self.d)
    }
    /// A direction of b's frame in a's.
    pub fn from_b(&self, n: DVec3) -> DVec3 {
        self.turn_a.transpose() * (self.turn_b * n)
    }
}

impl Pair {
    /// Poses at `t`. The difference of the positions is taken first, so that a common offset costs nothing.
    pub fn at(&self, t: f64) -> Frame {
        let [a, b] = &self.motions;
        Frame {
            t,
            turn_a: a.matrix_at(t),
            turn_b: b.matrix_at(t),
            d: (b.start.position - a.start.position) + (b.velocity - a.velocity) * t,
        }
    }

    /// max(f_A, f_B) at a point of a's frame.
    pub fn value(&self, f: &Frame, x: DVec3) -> f64 {
        self.a.value(x).max(self.b.value(f.to_b(x)))
    }

    /// Bound of the speed, relative to b, of a's points within `r` of `c` while |t − f.t| <= h.
    pub fn speed(&self, f: &Frame, c: DVec3, r: f64, h: f64) -> f64 {
        let [a, b] = &self.motions;
        let omega = a.spin - b.spin;
        let v = a.velocity - b.velocity;
        let carried = v + b.spin.cross(f.d);
        let at_c = (carried + omega.cross(f.turn_a * c)).length();
        // a's own turn moves a_turn·c within h; both bounds hold.
        let turning = omega.length() * r + omega.cross(a.spin).length() * c.length() * h;
        let loose = carried.length() + omega.length() * (c.length() + r);
        (at_c + turning).min(loose) + h * b.spin.length() * v.length()
    }
}

/// One row of the equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Row {
    /// Literal of a.
    A(u32),
    /// Literal of b.
    B(u32),
    /// Apex of a's cone literal.
    ApexA(u32),
    /// Apex of b's cone literal.
    ApexB(u32),
}

impl Row {
    /// True for rows of a.
    pub fn of_a(self) -> bool {
        matches!(self, Row::A(_) | Row::ApexA(_))
    }
}

/// What is unknown beside the point: the time at a given level, or the level at a given time.
#[derive(Clone, Copy)]
pub enum Unknown {
    /// Solve for the time at which the rows meet at this level.
    Time {
        /// Value of every row.
        level: f64,
    },
    /// Solve for the level of the deepest point at this time.
    Level {
        /// The time.
        t: f64,
    },
}

/// A solution.
#[derive(Clone, Debug)]
pub struct Root {
    /// Point in a's frame.
    pub x: DVec3,
    /// Time.
    pub t: f64,
    /// Level.
    pub level: f64,
    /// Multipliers, one a scalar row (three an apex).
    pub lambda: Vec<f64>,
    /// Sum of multiplier times gradient over a's rows: from a's inside to its outside.
    pub push: DVec3,
    /// Largest violated row, in lengths.
    pub gap: f64,
    /// Length of the sum of all forces: 0 where the point is stationary.
    pub imbalance: f64,
}

struct Scalars {
    values: Vec<f64>,
    gradients: Vec<DVec3>,
    of_a: Vec<bool>,
    signed: Vec<bool>,
}

fn scalars(pair: &Pair, rows: &[Row], f: &Frame, x: DVec3, level: f64) -> Scalars {
    let y = f.to_b(x);
    let mut s = Scalars { values: vec![], gradients: vec![], of_a: vec![], signed: vec![] };
    for row in rows {
        let of_a = row.of_a();
        let (field, p) = if of_a { (&pair.a, x) } else { (&pair.b, y) };
        let world = |n: DVec3| if of_a { n } else { f.from_b(n) };
        let mut push = |value: f64, n: DVec3, signed: bool| {
            s.values.push(value);
            s.gradients.push(world(n));
            s.of_a.push(of_a);
            s.signed.push(signed);
        };
        match *row {
            Row::A(i) | Row::B(i) => {
                let l = &field.literals[i as usize];
                push(l.value(p) - level, l.gradient(p), true);
            }
            Row::ApexA(i) | Row::ApexB(i) => {
                let (apex, axis, sin) = field.literals[i as usize].apex().expect("a convex cone");
                let o = p - (apex - axis * (level / sin));
                let (e1, e2) = axis.any_orthonormal_pair();
                push(o.dot(e1), e1, false);
                push(o.dot(e2), e2, false);
                push(o.dot(axis), axis, false);
            }
        }
    }
    s
}

/// What a solution is measured by.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// The unit of length.
    pub size: f64,
    /// One of length per step.
    pub speed: f64,
    /// A point that wanders much farther than this from where it started is given up: another start finds that solution.
    pub near: f64,
}

/// Solves the equations from the start (x, t).
pub fn solve(
    pair: &Pair,
    rows: &[Row],
    (x, t): (DVec3, f64),
    unknown: Unknown,
    Scales { size, speed, near }: Scales,
) -> Option<Root> {
    let unit_t = size / speed.max(size * 1e-12);
    let n = scalars(pair, rows, &pair.at(t), x, 0.0).values.len();
    // z: x / size, then t / unit_t or level / size, then multipliers.
    let mut z = vec![x.x / size, x.y / size, x.z / size, 0.0];
    match unknown {
        Unknown::Time { .. } => z[3] = t / unit_t,
        Unknown::Level { .. } => z[3] = pair.value(&pair.at(t), x) / size,
    }
    z.extend(vec![1.0 / n as f64; n]);
    let read = |z: &[f64]| {
        let x = DVec3::new(z[0], z[1], z[2]) * size;
        let (t, level) = match unknown {
            Unknown::Time { level } => (z[3] * unit_t, level),
            Unknown::Level { t } => (t, z[3] * size),
        };
        (x, t, level, scalars(pair, rows, &pair.at(t), x, level))
    };
    let residual = |z: &[f64]| -> Vec<f64> {
        let (.., s) = read(z);
        let mut r: Vec<f64> = s.values.iter().map(|v| v / size).collect();
        let force: DVec3 = s.gradients.iter().zip(&z[4..]).map(|(g, l)| *g * *l).sum();
        r.extend(force.to_array());
        r.push((0..n).filter(|i| s.signed[*i]).map(|i| z[4 + i]).sum::<f64>() - 1.0);
        r
    };
    // Differences stay well inside the smallest radius of curvature.
    let fields = [&pair.a, &pair.b];
    let mut step = 1e-6;
    for row in rows {
        let (Row::A(i) | Row::B(i) | Row::ApexA(i) | Row::ApexB(i)) = *row;
        if let Some(radius) = fields[usize::from(!row.of_a())].literals[i as usize].face.radius() {
            step = f64::min(step, 1e-6 * radius / size);
        }
    }
    let mut last = f64::INFINITY;
    for iteration in 0..40 {
        let r = residual(&z);
        let norm = r.iter().map(|v| v * v).sum::<f64>().sqrt();
        if !norm.is_finite() {
            return None;
        }
        if norm < 1e-15 || (iteration > 6 && norm > 0.7 * last && norm < 1e-11) {
            break;
        }
        last = norm;
        let mut columns = Vec::with_capacity(4 + n);
        for k in 0..4 {
            let (mut up, mut down) = (z.clone(), z.clone());
            up[k] += step;
            down[k] -= step;
            let width = up[k] - down[k];
            let d = residual(&up).iter().zip(residual(&down)).map(|(u, d)| (u - d) / width).collect();
            columns.push(d);
        }
        let (.., s) = read(&z);
        for i in 0..n {
            let mut column = vec![0.0; n];
            column.extend(s.gradients[i].to_array());
            column.push(f64::from(s.signed[i]));
            columns.push(column);
        }
        let dz = least_squares(&columns, &r, 1e-9);
        let reach = dz[..4].iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let scale = if reach > 0.3 { 0.3 / reach } else { 1.0 };
        for i in 0..4 {
            z[i] -= scale * dz[i];
        }
        for i in 4..4 + n {
            z[i] -= dz[i];
        }
        if (DVec3::new(z[0], z[1], z[2]) * size).distance(x) > 20.0 * near {
            return None;
        }
    }
    let (x, t, level, s) = read(&z);
    let lambda = z[4..].to_vec();
    let force =
        |of_a: bool| -> DVec3 { (0..n).filter(|i| s.of_a[*i] == of_a).map(|i| s.gradients[i] * lambda[i]).sum() };
    let gap = s.values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let imbalance = (force(true) + force(false)).length();
    let positive = (0..n).all(|i| !s.signed[i] || lambda[i] >= -1e-7);
    let root = Root { x, t, level, push: force(true), lambda, gap, imbalance };
    (positive && gap <= 1e-10 * size && imbalance <= 1e-6).then_some(root)
}
