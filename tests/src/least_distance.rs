//! The least distance of unions of balls and rods, and of these and boxes, over a step: closed forms at each of many times. Written
//! without the engine, its motions, too.

use glam::{DMat3, DVec3};

/// A body as the judge knows it, in its own frame.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Points within a length of some segments; balls are segments of no length.
    Rods(Vec<([DVec3; 2], f64)>),
    /// A box by its half sides.
    Box(DVec3),
}

/// A body on its way: the judge's own pose at each time of the step.
#[derive(Clone, Debug)]
pub struct Way {
    /// What it is.
    pub shape: Shape,
    /// Its rotation and place at the start.
    pub start: (DMat3, DVec3),
    /// Way of its origin over the step.
    pub velocity: DVec3,
    /// Rotation vector over the step, world axes.
    pub spin: DVec3,
}

/// A rotation by a vector, by Rodrigues' formula.
fn turned(v: DVec3) -> DMat3 {
    let angle = v.length();
    if angle == 0.0 {
        return DMat3::IDENTITY;
    }
    let n = v / angle;
    let k = DMat3::from_cols(DVec3::new(0.0, n.z, -n.y), DVec3::new(-n.z, 0.0, n.x), DVec3::new(n.y, -n.x, 0.0));
    DMat3::IDENTITY + k * angle.sin() + (k * k) * (1.0 - angle.cos())
}

impl Way {
    /// Rotation and place at a time of the step.
    pub fn at(&self, t: f64) -> (DMat3, DVec3) {
        (turned(self.spin * t) * self.start.0, self.start.1 + self.velocity * t)
    }
}

/// The least distance of two segments (C. Ericson, Real-Time Collision Detection, 2005, 5.1.9).
fn segments([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> f64 {
    let (u, v, w) = (q - p, s - r, p - r);
    let (a, e, f) = (u.dot(u), v.dot(v), v.dot(w));
    let (c, b) = (u.dot(w), u.dot(v));
    let det = a * e - b * b;
    let clamp = |x: f64| x.clamp(0.0, 1.0);
    let mut x = if a > 0.0 && det > 1e-14 * a * e { clamp((b * f - c * e) / det) } else { 0.0 };
    if e == 0.0 {
        x = if a > 0.0 { clamp(-c / a) } else { 0.0 };
    }
    let mut y = if e > 0.0 { (b * x + f) / e } else { 0.0 };
    if !(0.0..=1.0).contains(&y) {
        y = clamp(y);
        x = if a > 0.0 { clamp((b * y - c) / a) } else { 0.0 };
    }
    (p + u * x - r - v * y).length()
}

/// The distance at a time of the step; 0 where they meet.
///
/// # Panics
/// Of two boxes.
pub fn distance(a: &Way, b: &Way, t: f64) -> f64 {
    let ((ra, pa), (rb, pb)) = (a.at(t), b.at(t));
    match (&a.shape, &b.shape) {
        (Shape::Rods(own), Shape::Rods(other)) => {
            let mut least = f64::INFINITY;
            for (s, r) in own {
                for (o, q) in other {
                    let ends = (s.map(|x| ra * x + pa), o.map(|x| rb * x + pb));
                    least = least.min(segments(ends.0, ends.1) - r - q);
                }
            }
            least.max(0.0)
        }
        (Shape::Box(half), Shape::Rods(balls)) | (Shape::Rods(balls), Shape::Box(half)) => {
            let is_box = matches!(a.shape, Shape::Box(_));
            let ((rb, pb), (ra, pa)) = if is_box { ((ra, pa), (rb, pb)) } else { ((rb, pb), (ra, pa)) };
            let of_ball = |([x, _], r): &([DVec3; 2], f64)| {
                let x = rb.transpose() * (ra * *x + pa - pb);
                (x.abs() - *half).max(DVec3::ZERO).length() - r
            };
            balls.iter().map(of_ball).fold(f64::INFINITY, f64::min).max(0.0)
        }
        (Shape::Box(_), Shape::Box(_)) => panic!("the distance of two boxes has no closed form here"),
    }
}

/// The least over the step: of many times, and then of the neighbourhoods of the least of them, ever finer.
pub fn least(a: &Way, b: &Way) -> f64 {
    const TIMES: usize = 600;
    let at = |i: usize| i as f64 / TIMES as f64;
    let told: Vec<f64> = (0..=TIMES).map(|i| distance(a, b, at(i))).collect();
    let mut least = told.iter().copied().fold(f64::INFINITY, f64::min);
    for i in 0..=TIMES {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(TIMES));
        if told[i] > told[before] || told[i] > told[after] {
            continue;
        }
        let (mut low, mut high) = (at(before), at(after));
        for _ in 0..60 {
            let (p, q) = (low + 0.382 * (high - low), low + 0.618 * (high - low));
            let (f, g) = (distance(a, b, p), distance(a, b, q));
            least = least.min(f).min(g);
            if f < g { high = q } else { low = p }
        }
    }
    least
}
