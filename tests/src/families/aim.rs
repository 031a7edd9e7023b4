//! Trees by lot, and how two of them come at each other.

use super::draw::Draw;
use super::tree::{Field, Node, Shape, hull_of, placed, prism_over};
use super::{Course, Scene};
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DMat3, DQuat, DVec3, dvec3};

/// Kinds of primitives, by number.
pub(super) const ALL: &[usize] = &[0, 1, 2, 3, 4, 5, 6];
/// The round ones among them.
pub(super) const ROUND: &[usize] = &[0, 2, 3, 4];

/// A primitive of about unit radius: ball, box, cylinder, cone, frustum, prism, polyhedron.
pub(super) fn shape(d: &mut Draw, kinds: &[usize]) -> Shape {
    match d.of(kinds) {
        0 => Shape::Ball { r: d.within(0.4, 1.0) },
        1 => Shape::Box { size: dvec3(d.within(0.4, 1.6), d.within(0.4, 1.6), d.within(0.4, 1.6)) },
        2 => {
            let r = d.within(0.2, 0.9);
            Shape::Round { h: d.within(0.4, 1.8), bottom: r, top: r }
        }
        3 => {
            let r = d.within(0.2, 1.0);
            let (bottom, top) = if d.chance(0.5) { (r, 0.0) } else { (0.0, r) };
            Shape::Round { h: d.within(0.4, 1.8), bottom, top }
        }
        4 => Shape::Round { h: d.within(0.4, 1.8), bottom: d.within(0.2, 0.5), top: d.within(0.5, 0.9) },
        5 => Shape::Prism { n: 3 + d.below(6) as u32, r: d.within(0.3, 0.9), h: d.within(0.4, 1.8) },
        _ => polyhedron(d),
    }
}

/// A polyhedron of about unit radius.
pub(super) fn polyhedron(d: &mut Draw) -> Shape {
    match d.below(4) {
        0 => {
            // A wedge.
            let (x, y) = (d.within(0.3, 0.9), d.within(0.1, 0.9));
            let h = d.within(0.2, 0.8);
            prism_over(&[(-x, -y), (x, -y), (-x, y)], -h, h, (0.0, 0.0))
        }
        1 => {
            // A slanted prism over a polygon with corners on a circle.
            let n = 3 + d.below(5);
            let mut angles: Vec<f64> = (0..n).map(|i| (i as f64 + d.within(0.0, 0.7)) / n as f64).collect();
            angles.sort_by(f64::total_cmp);
            let corner = |t: &f64| {
                let q = quat_of_rotation_vector(DVec3::Z * (t * std::f64::consts::TAU)) * (DVec3::X * 0.8);
                (q.x, q.y)
            };
            let outline: Vec<(f64, f64)> = angles.iter().map(corner).collect();
            let h = d.within(0.1, 0.8);
            prism_over(&outline, -h, h, (d.within(-0.3, 0.3), d.within(-0.3, 0.3)))
        }
        _ => loop {
            let n = 4 + d.below(8);
            let flat = if d.chance(0.2) { d.power(-2.0, 0.0) } else { 1.0 };
            let points = (0..n).map(|_| d.direction() * dvec3(1.0, 1.0, flat) * d.within(0.7, 1.0)).collect();
            if let Some(hull) = hull_of(points) {
                return hull;
            }
        },
    }
}

/// A rotation matrix: any, or one that keeps the axes.
pub(super) fn rotation(d: &mut Draw) -> DMat3 {
    if d.chance(0.3) { quarter_turns(d) } else { DMat3::from_quat(d.rotation()) }
}

/// One of the rotations of a cube.
pub(super) fn quarter_turns(d: &mut Draw) -> DMat3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let i = d.below(3);
    let j = (i + 1 + d.below(2)) % 3;
    let (x, y) = (axes[i] * d.sign(), axes[j] * d.sign());
    DMat3::from_cols(x, y, x.cross(y))
}

pub(super) fn leaf(d: &mut Draw, kinds: &[usize]) -> Node {
    let by = placed(rotation(d), DVec3::ZERO);
    Node::Leaf(shape(d, kinds)).moved(by)
}

/// A tree of n primitives that hang together more or less.
pub(super) fn tree(d: &mut Draw, n: usize, kinds: &[usize]) -> Node {
    if n <= 1 {
        let size = d.within(0.5, 1.0);
        return leaf(d, kinds).scaled(size);
    }
    let k = 1 + d.below(n - 1);
    let one = tree(d, k, kinds);
    let other = tree(d, n - k, kinds);
    let ((c, r), (e, s)) = (one.ball(), other.ball());
    let kind = d.unit();
    let node = if kind < 0.6 {
        let way = d.direction() * d.within(0.2, 0.8) * (r + s) * 0.7;
        one.or(other.at(c - e + way))
    } else if kind < 0.88 {
        // What is taken away is smaller and sits near the surface.
        let f = (r / s) * d.within(0.2, 0.9);
        let way = d.direction() * r * d.within(0.2, 1.0);
        one.less(other.at(-e).scaled(f).at(c + way))
    } else {
        let f = (r / s) * d.within(0.8, 1.4);
        let way = d.in_ball() * r * 0.3;
        one.and(other.at(-e).scaled(f).at(c + way))
    };
    if d.chance(0.2) { node.moved(placed(rotation(d), DVec3::ZERO)) } else { node }
}

/// What `aimed` is told.
#[derive(Clone, Copy, Default)]
pub(super) struct Aim {
    /// Turns of a body in the step, else drawn.
    pub turns: Option<f64>,
    /// Where on a to aim, in its frame.
    pub a: Option<DVec3>,
    /// Where on b.
    pub b: Option<DVec3>,
    /// The direction of travel of b in a's frame.
    pub along: Option<DVec3>,
    /// The whole length of travel.
    pub length: Option<f64>,
    /// Bodies keep their axes along the world's.
    pub square: bool,
}

/// A point of the surface as it is seen along `-u`, and the distance from the middle that is free along `u`.
pub(super) fn seen(d: &mut Draw, field: &Field, (c, r): (DVec3, f64), u: DVec3) -> DVec3 {
    let side = u.any_orthonormal_vector();
    let (x, y) = (side, u.cross(side));
    for _ in 0..6 {
        let from = c + x * d.within(-0.7, 0.7) * r + y * d.within(-0.7, 0.7) * r + u * 2.0 * r;
        if let Some(p) = field.met_by(from, -u, 4.0 * r) {
            return p;
        }
    }
    c
}

/// b comes at a so that a point of its surface meets one of a's about when it is drawn; seven in ten within the step.
pub(super) fn aimed(d: &mut Draw, a: Node, b: Node, aim: Aim) -> Scene {
    let (fa, fb) = (a.field(), b.field());
    let (ball_a, ball_b) = (a.ball(), b.ball());
    let turned = |d: &mut Draw| {
        if aim.square { DQuat::from_mat3(&quarter_turns(d)).normalize() } else { d.rotation() }
    };
    // Rotations at the time of meeting.
    let (qa, qb) = (turned(d), turned(d));
    let spin = |d: &mut Draw| match aim.turns {
        Some(turns) => d.direction() * turns * std::f64::consts::TAU,
        None => {
            let kind = d.unit();
            let size = if kind < 0.35 {
                0.0
            } else if kind < 0.5 {
                d.power(-9.0, -2.0)
            } else {
                d.within(0.05, 3.0)
            };
            d.direction() * size
        }
    };
    let spins = if aim.turns.is_some() && d.chance(0.6) {
        if d.chance(0.5) { [spin(d), DVec3::ZERO] } else { [DVec3::ZERO, spin(d)] }
    } else {
        [if d.chance(0.5) { spin(d) } else { DVec3::ZERO }, spin(d)]
    };
    let u = aim.along.unwrap_or_else(|| qa.conjugate() * d.direction());
    let pa = aim.a.unwrap_or_else(|| seen(d, &fa, ball_a, u));
    let u = qa * u;
    let pb = aim.b.unwrap_or_else(|| seen(d, &fb, ball_b, qb.conjugate() * -u));
    let meet = d.within(0.08, 1.25);
    let small = ball_a.1.min(ball_b.1);
    let length = aim.length.unwrap_or_else(|| (ball_a.1 + ball_b.1) * d.within(0.6, 4.0) / meet.min(1.0));
    let sideways = u.cross(d.direction()) * d.within(0.0, 0.6) * length;
    let travel = -u * length + if d.chance(0.5) { sideways } else { DVec3::ZERO };
    let place_a = d.in_ball() * small * 3.0;
    // Half of the time a moves as well.
    let share = if d.chance(0.5) { d.within(-0.5, 1.0) } else { 0.0 };
    let (va, vb) = (-travel * share, travel * (1.0 - share));
    let back = |spin: DVec3, q: DQuat| (quat_of_rotation_vector(-spin * meet) * q).normalize();
    let at = place_a + va * meet + qa * pa - qb * pb;
    let course = |position: DVec3, rotation: DQuat, velocity: DVec3, spin: DVec3| Course {
        start: position - velocity * meet,
        rotation,
        end: position + velocity * (1.0 - meet),
        spin,
    };
    let a_course = Course { start: place_a, rotation: back(spins[0], qa), end: place_a + va, spin: spins[0] };
    let b_course = course(at, back(spins[1], qb), vb, spins[1]);
    Scene { a, b, courses: [a_course, b_course], resolution: None }
}
