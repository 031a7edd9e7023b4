//! The thirteen families: what each one draws by lot.

use super::aim::{ALL, Aim, ROUND, aimed, leaf, polyhedron, quarter_turns, rotation, seen, shape, tree};
use super::draw::Draw;
use super::tree::{Node, Shape, placed, prism_over};
use super::{Course, Scene};
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DAffine3, DMat3, DQuat, DVec3, dvec3};

/// Names of the families, in order.
pub const NAMES: [&str; 13] = [
    "plain trees",
    "deep trees",
    "coincident faces",
    "size ratios",
    "tiny features",
    "needles and plates",
    "fits",
    "screws",
    "fast spins",
    "far and scaled",
    "grazing and resting",
    "thin walls",
    "mirrors and polyhedra",
];

/// The scene of a family (0..13) with this index.
pub fn scene(seed: u64, family: usize, index: u64) -> Scene {
    let mut draw = Draw::new(seed, family as u64, index);
    let d = &mut draw;
    match family {
        0 => {
            let (n, m) = (1 + d.below(10), 1 + d.below(10));
            let (a, b) = (tree(d, n, ALL), tree(d, m, ALL));
            aimed(d, a, b, Aim::default())
        }
        1 => {
            let (n, m) = (10 + d.below(51), if d.chance(0.5) { 10 + d.below(51) } else { 1 + d.below(10) });
            let (a, b) = (tree(d, n, ALL), tree(d, m, ALL));
            aimed(d, a, b, Aim::default())
        }
        2 => lattices(d),
        3 => size_ratios(d),
        4 => tiny_features(d),
        5 => needles(d),
        6 => fit(d, false),
        7 => fit(d, true),
        8 => {
            let (n, m) = (1 + d.below(5), 1 + d.below(5));
            let (a, b) = (tree(d, n, ALL), tree(d, m, ALL));
            let turns = d.power(0.0, 1.2);
            aimed(d, a, b, Aim { turns: Some(turns), ..Aim::default() })
        }
        9 => far_and_scaled(d, seed, index),
        10 => grazing(d),
        11 => thin_walls(d),
        12 => mirrors(d),
        _ => panic!("there are {} families", NAMES.len()),
    }
}

/// A number on a grid of quarters.
fn quarter(d: &mut Draw, low: i32, high: i32) -> f64 {
    f64::from(low + d.below((high - low + 1) as usize) as i32) * 0.25
}

/// A primitive on the grid, sizes too.
fn lattice_leaf(d: &mut Draw) -> Node {
    let kind = d.below(8);
    let shape = match kind {
        0..=3 => Shape::Box { size: dvec3(quarter(d, 2, 8), quarter(d, 2, 8), quarter(d, 2, 8)) },
        4 => Shape::Ball { r: quarter(d, 1, 4) },
        5 => {
            let r = quarter(d, 1, 4);
            Shape::Round { h: quarter(d, 2, 8), bottom: r, top: r }
        }
        6 => {
            let r = quarter(d, 1, 4);
            let (bottom, top) = d.of(&[(r, 0.0), (0.0, r), (r, r / 2.0)]);
            Shape::Round { h: quarter(d, 2, 8), bottom, top }
        }
        _ => Shape::Prism { n: d.of(&[3, 4, 6, 8]), r: quarter(d, 1, 4), h: quarter(d, 2, 8) },
    };
    let turn = if d.chance(0.5) { DMat3::IDENTITY } else { quarter_turns(d) };
    let at = dvec3(quarter(d, -4, 4), quarter(d, -4, 4), quarter(d, -4, 4));
    Node::Leaf(shape).moved(placed(turn, at))
}

fn lattice_tree(d: &mut Draw, n: usize) -> Node {
    let mut parts: Vec<Node> = (0..n).map(|_| lattice_leaf(d)).collect();
    // Repeated parts, moved by a step of the grid or not at all.
    if n > 1 && d.chance(0.4) {
        let copy = d.below(n - 1);
        let by = if d.chance(0.5) { DVec3::ZERO } else { dvec3(quarter(d, -2, 2), quarter(d, -2, 2), 0.0) };
        parts[n - 1] = parts[copy].clone().at(by);
    }
    while parts.len() > 1 {
        let other = parts.pop().expect("two");
        let i = d.below(parts.len());
        let one = std::mem::replace(&mut parts[i], Node::Group(super::tree::Join::Union, Vec::new()));
        parts[i] = match d.below(8) {
            0..=3 => one.or(other),
            4..=6 => one.less(other),
            _ => one.and(other),
        };
    }
    parts.pop().expect("one")
}

/// Everything on a grid: abutting unions, flush differences, bodies that meet face on face.
fn lattices(d: &mut Draw) -> Scene {
    let (n, m) = (1 + d.below(8), 1 + d.below(8));
    let (a, b) = (lattice_tree(d, n), lattice_tree(d, m));
    let (c, r) = a.ball();
    let (e, s) = b.ball();
    if d.chance(0.2) {
        let square = d.chance(0.5);
        return aimed(d, a, b, Aim { square, ..Aim::default() });
    }
    let axis = d.of(&[DVec3::X, DVec3::Y, DVec3::Z]) * d.sign();
    let away = ((r + s) * 4.0).ceil() / 4.0;
    let off = dvec3(quarter(d, -3, 3), quarter(d, -3, 3), quarter(d, -3, 3));
    let round = |v: DVec3| (v * 4.0).round() / 4.0;
    let start = round(c - e) + axis * away + off;
    let drift =
        if d.chance(0.3) { dvec3(quarter(d, -2, 2), quarter(d, -2, 2), quarter(d, -2, 2)) } else { DVec3::ZERO };
    let length = d.of(&[0.5, 1.0, 1.0, 2.0]);
    let spin = match d.below(10) {
        0 => axis * std::f64::consts::FRAC_PI_2,
        1 => axis * d.within(-3.0, 3.0),
        2 => d.direction() * d.power(-6.0, 0.0),
        _ => DVec3::ZERO,
    };
    let resting = Course { start: DVec3::ZERO, rotation: DQuat::IDENTITY, end: DVec3::ZERO, spin: DVec3::ZERO };
    let rotation = if d.chance(0.3) { DQuat::from_mat3(&quarter_turns(d)).normalize() } else { DQuat::IDENTITY };
    let moving = Course { start, rotation, end: start - axis * away * 2.0 * length + drift, spin };
    Scene { a, b, courses: [resting, moving], resolution: None }
}

/// One body up to a hundred thousand times smaller than the other.
fn size_ratios(d: &mut Draw) -> Scene {
    let (n, m) = (1 + d.below(8), 1 + d.below(4));
    let a = tree(d, n, ALL);
    let ratio = d.power(-5.0, -1.0);
    let kinds = if d.chance(0.4) { ROUND } else { ALL };
    let b = tree(d, m, kinds).scaled(ratio);
    let length = if d.chance(0.5) { Some(ratio * d.power(0.0, 2.0)) } else { None };
    let aim = Aim { length, ..Aim::default() };
    if d.chance(0.5) { aimed(d, a, b, aim) } else { aimed(d, b, a, aim) }
}

/// A large body with a small apex, corner, ridge or hole, that is where it is met.
fn tiny_features(d: &mut Draw) -> Scene {
    let n = 1 + d.below(3);
    let body = tree(d, n, &[0, 1, 2, 4]);
    let small = d.power(-5.0, -1.5);
    let (c, r) = body.ball();
    let field = body.field();
    let u = d.direction();
    let p = seen(d, &field, (c, r), u);
    let out = field.gradient(p, 1e-6 * r);
    let out = if out == DVec3::ZERO { u } else { out };
    let turn = DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, out));
    let size = small * r;
    let (feature, tip, hole) = match d.below(7) {
        0 => (Shape::Round { h: 2.0, bottom: d.within(0.2, 1.5), top: 0.0 }, 1.0, false),
        1 => (Shape::Round { h: 2.0, bottom: 1.0, top: d.power(-3.0, -0.3) }, 1.0, false),
        2 => (Shape::Box { size: DVec3::splat(1.0) }, 0.5, false),
        3 => (Shape::Ball { r: 1.0 }, 1.0, false),
        4 => {
            let x = d.within(0.2, 1.0);
            (prism_over(&[(-x, -1.0), (x, -1.0), (0.0, 1.0)], -1.0, 1.0, (0.0, 0.0)), 1.0, false)
        }
        5 => (Shape::Round { h: 4.0, bottom: 1.0, top: 1.0 }, 0.0, true),
        _ => (Shape::Round { h: 2.0, bottom: 0.0, top: 1.0 }, 0.0, true),
    };
    let tilt =
        if d.chance(0.5) { DMat3::from_quat(quat_of_rotation_vector(d.in_ball() * 0.6)) } else { DMat3::IDENTITY };
    let feature = Node::Leaf(feature).moved(placed(tilt, DVec3::ZERO)).scaled(size).moved(placed(turn, p));
    let a = if hole { body.less(feature) } else { body.or(feature) };
    let aim_at = p + out * tip * size;
    let m = 1 + d.below(3);
    let other = match d.below(3) {
        0 => Node::Leaf(shape(d, ALL)),
        1 => tree(d, m, ALL),
        _ => tree(d, m, ALL).scaled(small * d.power(-0.5, 1.5)),
    };
    let length = if d.chance(0.5) { None } else { Some(size * d.power(0.5, 3.0)) };
    let aim = Aim { a: Some(aim_at), along: d.chance(0.7).then_some(out), length, ..Aim::default() };
    aimed(d, a, other, aim)
}

/// Primitives up to ten thousand times longer than wide, or wider than thick.
fn needle(d: &mut Draw) -> Node {
    let f = d.power(-4.0, -1.0);
    let shape = match d.below(8) {
        0 => Shape::Round { h: 2.0, bottom: f, top: f },
        1 => Shape::Round { h: 2.0, bottom: f, top: 0.0 },
        2 => Shape::Round { h: 2.0, bottom: f, top: f * 0.3 },
        3 => Shape::Box { size: dvec3(2.0, f, f * d.within(0.5, 2.0)) },
        4 => Shape::Box { size: dvec3(2.0, d.within(0.5, 2.0), f) },
        5 => Shape::Round { h: f, bottom: 1.0, top: 1.0 },
        6 => Shape::Round { h: f, bottom: 1.0, top: d.of(&[0.0, 0.9]) },
        _ => {
            let n = 3 + d.below(6) as u32;
            if d.chance(0.5) { Shape::Prism { n, r: f, h: 2.0 } } else { Shape::Prism { n, r: 1.0, h: f } }
        }
    };
    let by = placed(rotation(d), DVec3::ZERO);
    Node::Leaf(shape).moved(by)
}

fn needles(d: &mut Draw) -> Scene {
    let mut a = needle(d);
    for _ in 0..d.below(3) {
        let at = d.in_ball();
        let more = if d.chance(0.6) { needle(d) } else { leaf(d, ALL).scaled(0.6) };
        a = if d.chance(0.75) { a.or(more.at(at)) } else { a.less(more.at(at)) };
    }
    let m = 1 + d.below(4);
    let b = if d.chance(0.5) { needle(d) } else { tree(d, m, ALL) };
    // Needles are aimed at where they are: their ends as often as their sides.
    let tip = |d: &mut Draw, node: &Node| {
        let field = node.field();
        let on = field.surface_points(24, d);
        (d.chance(0.6) && !on.is_empty()).then(|| on[d.below(on.len())])
    };
    let (pa, pb) = (tip(d, &a), tip(d, &b));
    aimed(d, a, b, Aim { a: pa, b: pb, ..Aim::default() })
}

/// A male part in its female one, clearances from touching to a hundredth and interferences; with `screw` it spins about its
/// axis of travel.
pub(super) fn fit(d: &mut Draw, screw: bool) -> Scene {
    let r = d.within(0.15, 1.5);
    let clearance = match d.below(10) {
        0 => 0.0,
        1 | 2 => -d.power(-9.0, -2.0),
        _ => d.power(-9.0, -2.0),
    } * r;
    let h = d.within(0.5, 2.0) * r;
    let round = |r: f64, h: f64| Shape::Round { h, bottom: r, top: r };
    // What is taken from the block, what goes in there, both around z with the mouth at z = 0 and the seat's depth; and how
    // deep the male part sits when it is home.
    let n = 3 + d.below(6) as u32;
    let q = r - clearance;
    let inscribed = (std::f64::consts::PI / f64::from(n)).cos();
    let (hole, peg, home): (Node, Node, f64) = match d.below(11) {
        // Peg and through hole.
        0 | 1 => (Node::Leaf(round(r, 8.0 * h)), Node::Leaf(round(q, h)), h),
        // Peg and blind hole; home with its bottom on the ground.
        2 => (Node::Leaf(round(r, 2.0 * h)), Node::Leaf(round(q, h)), h / 2.0),
        // Ball and socket.
        3 => (Node::Leaf(Shape::Ball { r }), Node::Leaf(Shape::Ball { r: q }), 0.0),
        // Cone and pocket: apex down.
        4 => {
            let (o, half) = (r * 2.0, r);
            let cone = |r: f64| Node::Leaf(Shape::Round { h: o, bottom: 0.0, top: r });
            (cone(half), cone(half), clearance)
        }
        // Frustum and pocket.
        5 => {
            let o = r;
            let frustum = |r: f64| Node::Leaf(Shape::Round { h: o, bottom: r * 0.6, top: r });
            (frustum(r), frustum(if d.chance(0.5) { r } else { q }), clearance)
        }
        // Prism in a round hole.
        6 => (Node::Leaf(round(r, 8.0 * h)), Node::Leaf(Shape::Prism { n, r: q, h }), h),
        // Round peg in a prismatic hole.
        7 => (Node::Leaf(Shape::Prism { n, r, h: 8.0 * h }), Node::Leaf(round(r * inscribed - clearance, h)), h),
        // Prism in a prism.
        8 => (Node::Leaf(Shape::Prism { n, r, h: 8.0 * h }), Node::Leaf(Shape::Prism { n, r: q, h }), h),
        // Box in a box.
        9 => {
            let w = d.within(0.5, 1.5);
            let cube = |r: f64, h: f64| Node::Leaf(Shape::Box { size: dvec3(2.0 * r, 2.0 * r * w, h) });
            (cube(r, 8.0 * h), cube(q, h), h)
        }
        // Ball in a round hole.
        _ => (Node::Leaf(round(r, 8.0 * h)), Node::Leaf(Shape::Ball { r: q }), r),
    };
    let depth = h * 2.0 + 2.0 * r;
    let block = Node::Leaf(Shape::Box { size: dvec3(4.0 * r, 4.0 * r, depth) }).at(dvec3(0.0, 0.0, -depth / 2.0));
    let mut female = block.less(hole);
    if d.chance(0.2) {
        let by = d.in_ball() * r;
        female = female.less(leaf(d, ALL).scaled(0.3 * r).at(by + dvec3(1.5 * r, 0.0, 0.0)));
    }
    let male = if d.chance(0.2) {
        let head = Node::Leaf(round(1.4 * r, 0.3 * r)).at(dvec3(0.0, 0.0, home.max(h) / 2.0 + 0.15 * r + h));
        peg.or(head)
    } else {
        peg
    };
    // Travel along z from above or from within, tilted and off centre by amounts like the clearance or not at all.
    let gap = clearance.abs().max(1e-9 * r);
    let small = |d: &mut Draw| match d.below(5) {
        0 | 1 => 0.0,
        2 | 3 => gap * d.within(0.0, 2.0),
        _ => r * d.power(-10.0, -1.0),
    };
    let flat = |d: &mut Draw| dvec3(d.within(-1.0, 1.0), d.within(-1.0, 1.0), 0.0).normalize_or_zero();
    let high = if d.chance(0.5) { h + r * d.within(0.1, 2.0) } else { home * d.within(-0.5, 0.6) + small(d) };
    let low = high - d.power(-6.0, 0.6) * r;
    let off = flat(d) * small(d);
    let drift = flat(d) * small(d);
    let tilt = flat(d) * (small(d) / r).min(0.5);
    let turning = flat(d) * (small(d) / r).min(1.0);
    let about = match (screw, d.below(4)) {
        (true, _) => d.within(0.5, 30.0) * d.sign(),
        (false, 0) => d.within(-1.0, 1.0),
        _ => 0.0,
    };
    let phase = if d.chance(0.5) { d.within(0.0, 3.0) } else { 0.0 };
    let (qa, shift) = if d.chance(0.5) { (d.rotation(), d.in_ball() * r) } else { (DQuat::IDENTITY, DVec3::ZERO) };
    let start = qa * (dvec3(0.0, 0.0, high) + off) + shift;
    let end = qa * (dvec3(0.0, 0.0, low) + off + drift) + shift;
    let own = quat_of_rotation_vector(tilt) * quat_of_rotation_vector(DVec3::Z * phase);
    let spin = qa * (DVec3::Z * about + turning);
    let still = Course { start: shift, rotation: qa, end: shift, spin: DVec3::ZERO };
    let moving = Course { start, rotation: (qa * own).normalize(), end, spin };
    Scene { a: female, b: male, courses: [still, moving], resolution: None }
}

/// Scenes of other families in other units, far from the origin.
fn far_and_scaled(d: &mut Draw, seed: u64, index: u64) -> Scene {
    let family = d.of(&[0, 0, 2, 3, 5, 6, 10]);
    let mut s = scene(seed ^ 0x5EED, family, index);
    if d.chance(0.6) {
        let f = d.power(-6.0, 6.0);
        s.a = s.a.scaled(f);
        s.b = s.b.scaled(f);
        s.resolution = s.resolution.map(|r| r * f);
        for c in &mut s.courses {
            c.start *= f;
            c.end *= f;
        }
    }
    if d.chance(0.7) {
        let far = d.direction() * d.power(1.0, 7.0) * s.a.ball().1.max(s.b.ball().1).min(1.0);
        for c in &mut s.courses {
            c.start += far;
            c.end += far;
        }
    }
    if d.chance(0.3) {
        // A model away from its own origin; it turns about that.
        let (_, r) = s.a.ball();
        let by = d.direction() * d.power(0.5, 4.0) * r;
        let c = &mut s.courses[0];
        let turned = quat_of_rotation_vector(c.spin) * c.rotation;
        c.start -= c.rotation * by;
        c.end -= turned * by;
        s.a = s.a.at(by);
    }
    s
}

/// Bodies that touch, nearly touch, slide or roll on each other, slowly as a rule.
fn grazing(d: &mut Draw) -> Scene {
    let n = d.below(3);
    // The ground: a plate with its top at z = 0, perhaps with more on it or out of it; or a ball, a groove, a corner.
    let mut ground = Node::Leaf(Shape::Box { size: dvec3(4.0, 4.0, 1.0) }).at(dvec3(0.0, 0.0, -0.5));
    let mut rest_at = DVec3::ZERO;
    match d.below(6) {
        0 => {
            let r = d.within(0.5, 2.0);
            ground = Node::Leaf(Shape::Ball { r }).at(dvec3(0.0, 0.0, -r));
        }
        1 => {
            let r = d.within(0.5, 2.0);
            let turn = placed(DMat3::from_cols(DVec3::Z, DVec3::Y, -DVec3::X), dvec3(0.0, 0.0, -r));
            ground = Node::Leaf(Shape::Round { h: 4.0, bottom: r, top: r }).moved(turn);
        }
        2 => {
            // A step's inner corner.
            ground = ground.or(Node::Leaf(Shape::Box { size: dvec3(1.0, 4.0, 1.0) }).at(dvec3(-1.5, 0.0, 0.5)));
            rest_at = dvec3(-1.0, 0.0, 0.0);
        }
        _ => {
            for _ in 0..n {
                let at = dvec3(d.within(-1.5, 1.5), d.within(-1.5, 1.5), d.of(&[0.0, -0.25, -0.5]));
                let more = lattice_leaf(d).scaled(0.5).at(at);
                ground = if d.chance(0.5) { ground.less(more) } else { ground.or(more.at(dvec3(0.0, 0.0, -1.0))) };
            }
        }
    }
    let r = d.power(-1.0, 0.0);
    let lying = DMat3::from_cols(DVec3::Z, DVec3::Y, -DVec3::X);
    let (body, low, reach) = match d.below(8) {
        0 => (Node::Leaf(Shape::Ball { r }), r, r),
        1 | 2 => (Node::Leaf(Shape::Box { size: dvec3(2.0 * r, r, 1.5 * r) }), 0.75 * r, r),
        3 => (Node::Leaf(Shape::Round { h: r, bottom: r, top: r }), r / 2.0, r),
        4 => (Node::Leaf(Shape::Round { h: r, bottom: r, top: r }).moved(placed(lying, DVec3::ZERO)), r, r / 2.0),
        5 => (Node::Leaf(Shape::Round { h: 2.0 * r, bottom: 0.0, top: r }), r, r),
        6 => (Node::Leaf(Shape::Prism { n: 6, r, h: r }), r / 2.0, r),
        _ => {
            let two = |x: f64| Node::Leaf(Shape::Box { size: dvec3(0.5 * r, r, r) }).at(dvec3(x, 0.0, 0.0));
            (
                two(-0.75 * r).or(two(0.75 * r)).or(Node::Leaf(Shape::Box { size: dvec3(2.0 * r, r, 0.5 * r) })),
                r / 2.0,
                r,
            )
        }
    };
    let gap = match d.below(6) {
        0 | 1 => 0.0,
        2 => -d.power(-12.0, -8.0),
        _ => d.power(-12.0, -3.0),
    };
    let wall =
        if rest_at == DVec3::ZERO { 0.0 } else { reach + if d.chance(0.5) { 0.0 } else { d.power(-12.0, -4.0) } };
    let start = rest_at + dvec3(wall, 0.0, low + gap);
    let slide =
        dvec3(d.within(-1.0, 1.0), d.within(-1.0, 1.0), 0.0) * if d.chance(0.2) { 0.0 } else { d.power(-9.0, 0.5) };
    let fall = match d.below(5) {
        0 | 1 => 0.0,
        2 => d.power(-12.0, -2.0),
        3 => -d.power(-12.0, 0.0),
        _ => -gap * d.within(0.5, 2.0),
    };
    let spin = match d.below(6) {
        0 => DVec3::Z * d.within(-2.0, 2.0),
        1 => d.direction() * d.power(-9.0, 0.0),
        // Rolling without slipping.
        2 => DVec3::Z.cross(slide) / low,
        _ => DVec3::ZERO,
    };
    let (q, shift) = match d.below(3) {
        0 => (d.rotation(), d.in_ball() * 3.0),
        _ => (DQuat::IDENTITY, DVec3::ZERO),
    };
    let phase = if d.chance(0.3) { quat_of_rotation_vector(DVec3::Z * d.within(0.0, 6.0)) } else { DQuat::IDENTITY };
    let end = start + slide + DVec3::Z * fall;
    let still = Course { start: shift, rotation: q, end: shift, spin: DVec3::ZERO };
    let moving =
        Course { start: q * start + shift, rotation: (q * phase).normalize(), end: q * end + shift, spin: q * spin };
    let (a, b) = (ground, body);
    if d.chance(0.3) {
        Scene { a: b, b: a, courses: [moving, still], resolution: None }
    } else {
        Scene { a, b, courses: [still, moving], resolution: None }
    }
}

/// Walls from a billionth of a unit to a hundredth, none at all, and solids joined with themselves.
fn thin_walls(d: &mut Draw) -> Scene {
    let wall = if d.chance(0.3) { 0.0 } else { d.power(-12.0, -2.0) };
    let outer = shape(d, ALL);
    let r = Node::Leaf(outer.clone()).ball().1;
    let inner = match &outer {
        Shape::Ball { r } => Shape::Ball { r: r - wall },
        Shape::Box { size } => Shape::Box { size: *size - DVec3::splat(2.0 * wall) },
        Shape::Round { h, bottom, top } if bottom == top => {
            Shape::Round { h: if d.chance(0.5) { *h } else { h - 2.0 * wall }, bottom: bottom - wall, top: top - wall }
        }
        Shape::Prism { n, r, h } => {
            Shape::Prism { n: *n, r: r - wall, h: if d.chance(0.5) { *h } else { h - 2.0 * wall } }
        }
        other => other.clone(),
    };
    let shrunk =
        matches!(&outer, Shape::Round { bottom, top, .. } if bottom != top) || matches!(outer, Shape::Hull { .. });
    let inner = Node::Leaf(inner).scaled(if shrunk { 1.0 - wall / r } else { 1.0 });
    let outer = Node::Leaf(outer);
    let shell = if wall == 0.0 { outer.clone().less(outer.clone()) } else { outer.clone().less(inner) };
    let more = leaf(d, ALL).scaled(d.within(0.3, 0.8)).at(d.direction() * d.within(0.0, 1.5));
    let a = match d.below(9) {
        0 => shell,
        1 => shell.or(more),
        2 => shell.less(more),
        3 => shell.clone().or(shell),
        4 => shell.clone().and(shell),
        // A solid less itself and more, joined with itself, common to itself and more.
        5 => outer.clone().less(Node::union(vec![outer, more])),
        6 => outer.clone().or(more.clone()).or(outer),
        7 => outer.clone().and(outer.or(more)),
        _ => shell.clone().or(more.clone()).less(more),
    };
    let a = a.moved(placed(rotation(d), d.in_ball()));
    let m = 1 + d.below(4);
    let b = if d.chance(0.3) { a.clone().scaled(d.within(0.3, 0.9)) } else { tree(d, m, ALL) };
    let mut s = aimed(d, a, b, Aim::default());
    if d.chance(0.15) {
        s.resolution = Some(coarse(d.power(-9.0, -3.0), &s));
    }
    s
}

/// A resolution that both bodies' primitives stand.
fn coarse(resolution: f64, s: &Scene) -> f64 {
    resolution.min(0.1 * s.a.smallest().min(s.b.smallest()))
}

/// Mirrors, complements of complements, polyhedra, coarse resolutions.
fn mirrors(d: &mut Draw) -> Scene {
    let body = |d: &mut Draw| {
        let kind = d.below(4);
        let mut node = match kind {
            0 => Node::Leaf(polyhedron(d)),
            1 => {
                // A less (B less (C less …)).
                let depth = 2 + d.below(5);
                let mut node = leaf(d, ALL).scaled(0.6);
                for _ in 0..depth {
                    let at = d.in_ball() * 0.6;
                    node = leaf(d, ALL).less(node.at(at));
                }
                node
            }
            2 => {
                let n = 2 + d.below(6);
                tree(d, n, &[1, 5, 6])
            }
            _ => {
                let n = 2 + d.below(6);
                tree(d, n, ALL)
            }
        };
        if d.chance(0.6) {
            let flip = d.of(&[dvec3(-1.0, 1.0, 1.0), dvec3(1.0, -1.0, 1.0), dvec3(1.0, 1.0, -1.0), -DVec3::ONE]);
            let mirror = DAffine3::from_mat3(DMat3::from_diagonal(flip));
            let whole = d.chance(0.5);
            node = if whole { node.moved(mirror) } else { node.clone().moved(mirror).at(d.in_ball()).or(node) };
        }
        node
    };
    let (a, b) = (body(d), body(d));
    let square = d.chance(0.4);
    let mut s = aimed(d, a, b, Aim { square, ..Aim::default() });
    if d.chance(0.4) {
        s.resolution = Some(coarse(d.power(-7.0, -1.7) * s.a.ball().1.max(s.b.ball().1), &s));
    }
    s
}
