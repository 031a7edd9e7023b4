//! Solids that are built in code, printed and read back: each random tree carries a formula of the point beside it that shares nothing with
//! printer or reader, and both must say the same of what is inside.

use contactd::import::{Facets, Limits, import_csg};
use contactd::math::Aabb;
use contactd::solid::primitive::Shape;
use contactd_client::solid::{
    Outline, Solid, capsule, circle, cone, cuboid, cylinder, half_space, hull, hyperbolic_dome, hyperboloid,
    intersection, paraboloid, polygon, polyhedron, quadric, rectangle, sphere, superellipsoid, torus, union,
};
use contactd_tests::random_solids::Random;
use glam::{DAffine3, DMat3, DVec2, DVec3};

type Inside = Box<dyn Fn(DVec3) -> bool>;
type Within = Box<dyn Fn(DVec2) -> bool>;

/// A flat shape on the positive side of x, and what is in it.
fn outline(random: &mut Random) -> (Outline, Within) {
    let (dx, dy) = (random.within(2.0, 3.0), random.within(-1.0, 1.0));
    let (w, h, r) = (random.within(0.5, 2.0), random.within(0.5, 2.0), random.within(0.2, 0.6));
    let box_ = rectangle(w, h).moved(dx, dy);
    let in_box = move |p: DVec2| (p.x - dx).abs() < 0.5 * w && (p.y - dy).abs() < 0.5 * h;
    let angle = random.within(0.0, 6.0);
    let (s, c) = angle.sin_cos();
    match random.below(4) {
        0 => (box_, Box::new(in_box)),
        1 => (circle(r).moved(dx, dy) + box_, Box::new(move |p| in_box(p) || p.distance(DVec2::new(dx, dy)) < r)),
        2 => {
            let hole = rectangle(r, r).turned(angle).moved(dx, dy);
            let in_hole = move |p: DVec2| {
                let q = p - DVec2::new(dx, dy);
                let q = DVec2::new(c * q.x + s * q.y, c * q.y - s * q.x);
                q.abs().max_element() < 0.5 * r
            };
            (box_ - hole, Box::new(move |p| in_box(p) && !in_hole(p)))
        }
        _ => {
            // A quarter of the rectangle is missing: not convex.
            let at = |x: f64, y: f64| DVec2::new(dx + x * w, dy + y * h);
            let l = polygon(&[at(-0.5, -0.5), at(0.5, -0.5), at(0.5, 0.0), at(0.0, 0.0), at(0.0, 0.5), at(-0.5, 0.5)]);
            (l, Box::new(move |p| in_box(p) && !(p.x > dx && p.y > dy)))
        }
    }
}

/// A primitive around the origin, and what is in it.
fn primitive(random: &mut Random) -> (Solid, Inside) {
    let (r, q, h) = (random.within(0.5, 2.0), random.within(0.0, 1.5), random.within(0.5, 3.0));
    let sides = DVec3::new(random.within(0.5, 3.0), random.within(0.5, 3.0), random.within(0.5, 3.0));
    let along = |p: DVec3| DVec2::new(p.x.hypot(p.y), p.z);
    match random.below(12) {
        0 => (sphere(r), Box::new(move |p| p.length() < r)),
        1 => (cuboid(sides.x, sides.y, sides.z), Box::new(move |p| (p.abs() - sides * 0.5).max_element() < 0.0)),
        2 => (cylinder(r, h), Box::new(move |p| along(p).x < r && p.z.abs() < 0.5 * h)),
        3 => (cone(r, q, h), Box::new(move |p| p.z.abs() < 0.5 * h && along(p).x < r + (q - r) * (p.z / h + 0.5))),
        4 => (torus(2.0 + r, r), Box::new(move |p| along(p).distance(DVec2::new(2.0 + r, 0.0)) < r)),
        5 => (capsule(r, h), Box::new(move |p| (p.z - p.z.clamp(-0.5 * h, 0.5 * h)).hypot(along(p).x) < r)),
        6 => {
            // A tetrahedron: below the plane through the far ends of its three legs.
            let points = [DVec3::ZERO, DVec3::X * sides.x, DVec3::Y * sides.y, DVec3::Z * sides.z];
            let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
            (polyhedron(&points, &faces), Box::new(move |p| p.min_element() > 0.0 && (p / sides).element_sum() < 1.0))
        }
        8 => {
            let solid = if random.chance(0.5) { paraboloid(r, h) } else { hyperbolic_dome(r, h, 1e9) };
            (solid, Box::new(move |p| p.z > -0.5 * h && along(p).x.powi(2) / (r * r) < 0.5 - p.z / h))
        }
        9 => {
            let (waist, form) =
                (0.4 * r, [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.5, 0.0]]);
            if random.chance(0.5) {
                let wide = move |z: f64| waist.hypot((r * r - waist * waist).sqrt() * z / (0.5 * h));
                return (hyperboloid(r, waist, h), Box::new(move |p| p.z.abs() < 0.5 * h && along(p).x < wide(p.z)));
            }
            let within = move |p: DVec3| (p.abs() - sides).max_element() < 0.0 && p.x * p.x - p.y * p.y + p.z < 0.0;
            (quadric(&form, -sides, sides), Box::new(within))
        }
        10 => {
            let (e, f) = (random.within(0.1, 1.0), random.within(0.1, 1.0));
            let within = move |p: DVec3| {
                let u = (p / sides).abs();
                let flat = u.x.powf(2.0 / f) + u.y.powf(2.0 / f);
                flat.powf(f / e) + u.z.powf(2.0 / e) < 1.0
            };
            (superellipsoid(sides, [e, f]), Box::new(within))
        }
        7 => {
            let (flat, within) = outline(random);
            (flat.extrude(h), Box::new(move |p| p.z.abs() < 0.5 * h && within(p.truncate())))
        }
        _ => {
            let (flat, within) = outline(random);
            (flat.revolve(), Box::new(move |p| within(along(p))))
        }
    }
}

/// A tree of some primitives, placed, turned, mirrored, scaled.
fn tree(random: &mut Random, primitives: usize) -> (Solid, Inside) {
    if primitives == 1 {
        let (mut solid, inside) = primitive(random);
        let mut linear = DMat3::from_quat(random.rotation()) * random.within(0.5, 1.5);
        solid = solid.turned(glam::DQuat::from_mat3(&(linear * (1.0 / linear.x_axis.length()))));
        solid = solid.scaled(DVec3::splat(linear.x_axis.length()));
        if random.chance(0.3) {
            let n = random.direction();
            solid = solid.mirrored(n * random.within(0.1, 9.0));
            linear = (DMat3::IDENTITY - 2.0 * DMat3::from_cols(n * n.x, n * n.y, n * n.z)) * linear;
        }
        let by = random.vector(2.0);
        let back = DAffine3 { matrix3: linear, translation: by }.inverse();
        return (solid.moved(by), Box::new(move |p| inside(back.transform_point3(p))));
    }
    let left = 1 + random.below(primitives - 1);
    let ((a, in_a), (b, in_b)) = (tree(random, left), tree(random, primitives - left));
    match random.below(4) {
        0 => (a + b, Box::new(move |p| in_a(p) || in_b(p))),
        1 => (intersection([a, b]), Box::new(move |p| in_a(p) && in_b(p))),
        2 => {
            let (n, d) = (random.direction(), random.within(-1.0, 1.0));
            let cut = half_space(n * 3.0, d);
            (union([a, b]) & cut, Box::new(move |p| (in_a(p) || in_b(p)) && n.dot(p) < d))
        }
        _ => (a - b, Box::new(move |p| in_a(p) && !in_b(p))),
    }
}

#[test]
fn what_is_built_is_what_is_read() {
    let mut random = Random::new(2026);
    let (mut points, mut inside_points) = (0, 0);
    for i in 0..120 {
        let primitives = 1 + i % 7;
        let (solid, inside) = tree(&mut random, primitives);
        let text = solid.text().unwrap_or_else(|e| panic!("{i}: {e}"));
        let import = import_csg("built.csg", &text, Facets::Auto, &Limits::default());
        let import = import.unwrap_or_else(|e| panic!("{i}: {e}\n{text}"));
        assert!(import.notes.iter().all(|n| !n.text.contains("faceted")), "{i}: {:?}", import.notes);
        let around = Aabb::around(DVec3::ZERO, DVec3::splat(5.0));
        for _ in 0..400 {
            let p = random.point_in(&around);
            let f = if import.solid.is_void() { f64::INFINITY } else { import.solid.value(p) };
            if f.abs() < 1e-6 {
                continue;
            }
            assert_eq!(f < 0.0, inside(p), "{i}: {p} {f}\n{text}");
            points += 1;
            inside_points += usize::from(f < 0.0);
        }
    }
    assert!(points > 45_000 && inside_points > 800, "{points} {inside_points}");
}

#[test]
fn numbers_of_primitives_are_kept_to_the_bit() {
    let (r, h, at) = (1.0 / 3.0, 0.1 + 0.2, DVec3::new(1e-9, -1.0 / 7.0, 12_345.678_901_234_5));
    let part = (cylinder(r, h).moved(at) + sphere(r).moved(-at)) - cuboid(r, h, 1e-3).mirrored(DVec3::X);
    let import =
        import_csg("part.csg", &part.text().expect("text"), Facets::Auto, &Limits::default()).expect("a model");
    let [cylinder, sphere, cuboid] = &import.solid.primitives[..] else { panic!("three primitives") };
    assert_eq!((cylinder.frame.position, sphere.frame.position), (at, -at));
    let Shape::Cylinder(c) = &cylinder.shape else { panic!("{:?}", cylinder.shape) };
    assert_eq!((c.radius.to_bits(), (2.0 * c.half_height).to_bits()), (r.to_bits(), h.to_bits()));
    let Shape::Sphere(s) = &sphere.shape else { panic!("{:?}", sphere.shape) };
    assert_eq!(s.radius.to_bits(), r.to_bits());
    let Shape::Cuboid(b) = &cuboid.shape else { panic!("{:?}", cuboid.shape) };
    assert_eq!(b.half * 2.0, DVec3::new(r, h, 1e-3));
    assert!(hull([circle(1.0).extrude(1.0)]).text().is_ok());
}
