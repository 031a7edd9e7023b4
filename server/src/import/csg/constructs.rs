//! What constructs mean, told a second time by formulas of the point that share nothing with the importer: membership, a depth and a
//! distance that nothing oversteps, and no seam, for f is near 0 near the surface alone.

use crate::import::{Facets, Limits, import_csg};
use crate::math::random::Random;
use glam::{DVec2, DVec3};

type Inside = Box<dyn Fn(DVec3) -> bool>;

fn linear(arguments: &str, inner: &str) -> String {
    format!("linear_extrude({arguments}) {{ {inner} }}")
}

fn revolved(arguments: &str, inner: &str) -> String {
    format!("rotate_extrude({arguments}) {{ {inner} }}")
}

fn moved(x: f64, y: f64, z: f64, inner: &str) -> String {
    format!("multmatrix([[1, 0, 0, {x}], [0, 1, 0, {y}], [0, 0, 1, {z}], [0, 0, 0, 1]]) {{ {inner} }}")
}

/// Inside of paths by the even-odd rule: crossings of a ray.
fn even_odd(paths: &[&[[f64; 2]]], p: DVec2) -> bool {
    let mut odd = false;
    for path in paths {
        for i in 0..path.len() {
            let ([ax, ay], [bx, by]) = (path[i], path[(i + 1) % path.len()]);
            odd ^= (ay > p.y) != (by > p.y) && p.x < ax + (bx - ax) * (p.y - ay) / (by - ay);
        }
    }
    odd
}

/// Distance from the segment between two points.
fn to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    (p - a - (b - a) * t).length()
}

/// Inside of the hull of balls: below the tangent plane of every direction of a fine set, which lies outside of it by
/// less than the tests' margin; exact where `false`.
fn in_hull(balls: Vec<(DVec3, f64)>) -> Inside {
    let count = 200_000;
    let directions: Vec<(DVec3, f64)> = (0..count)
        .map(|i| {
            // A Fibonacci lattice of the sphere.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let (s, c) = libm::sincos(f64::from(i) * 2.399_963_229_728_653);
            let n = DVec3::new(c * (1.0 - z * z).sqrt(), s * (1.0 - z * z).sqrt(), z);
            (n, balls.iter().map(|(c, r)| n.dot(*c) + r).fold(f64::NEG_INFINITY, f64::max))
        })
        .collect();
    Box::new(move |p| directions.iter().all(|(n, h)| n.dot(p) <= *h))
}

const L: [[f64; 2]; 6] = [[0., 0.], [3., 0.], [3., 1.], [1., 1.], [1., 3.], [0., 3.]];
const HOLE: [[f64; 2]; 4] = [[0.2, 0.2], [0.8, 0.3], [0.7, 0.8], [0.3, 0.6]];
const STAR: [[f64; 2]; 10] = [
    [2., 0.],
    [0.8, 0.6],
    [0.6, 1.9],
    [-0.3, 0.95],
    [-1.6, 1.2],
    [-1., 0.],
    [-1.6, -1.2],
    [-0.3, -0.95],
    [0.6, -1.9],
    [0.8, -0.6],
];
const VASE: [[f64; 2]; 8] =
    [[0., -1.], [1.2, -1.], [0.5, 0.], [1.5, 1.], [1.2, 1.5], [0.6, 0.8], [0.4, 0.2], [0., 0.1]];
const RING: [[f64; 2]; 5] = [[1., -0.5], [2., -0.5], [1.6, 0.1], [2., 0.7], [1.1, 0.5]];

fn list(points: &[[f64; 2]]) -> String {
    format!("{points:?}")
}

/// Distance to the boundary of a path in the plane.
fn to_path(path: &[[f64; 2]], p: DVec2) -> f64 {
    let at = |i: usize| DVec2::from_array(path[i % path.len()]).extend(0.0);
    (0..path.len()).map(|i| to_segment(p.extend(0.0), at(i), at(i + 1))).fold(f64::INFINITY, f64::min)
}

fn angle(p: DVec3) -> f64 {
    p.y.atan2(p.x).to_degrees().rem_euclid(360.0)
}

/// Texts, each with what it holds; the last number is how far the second telling may be off.
fn cases() -> Vec<(String, Inside, f64)> {
    let meridian = |p: DVec3| DVec2::new(p.x.hypot(p.y), p.z);
    let plane = |p: DVec3| p.truncate();
    let ball = |x: f64, y: f64, z: f64, r: f64| moved(x, y, z, &format!("sphere({r});"));
    let mut cases: Vec<(String, Inside, f64)> = vec![
        (
            linear("height = 2", &format!("polygon({});", list(&L))),
            Box::new(move |p| (0.0..2.0).contains(&p.z) && even_odd(&[&L], plane(p))),
            0.0,
        ),
        (
            linear("height = 2, scale = 0.25", &format!("polygon({});", list(&STAR))),
            Box::new(move |p| (0.0..2.0).contains(&p.z) && even_odd(&[&STAR], plane(p) / (1.0 - 0.375 * p.z))),
            0.0,
        ),
        (
            linear(
                "height = 2, center = true",
                &format!(
                    "polygon({}, [[0, 1, 2, 3, 4, 5], [6, 7, 8, 9]]);",
                    list(&L.iter().chain(&HOLE).copied().collect::<Vec<_>>())
                ),
            ),
            Box::new(move |p| p.z.abs() < 1.0 && even_odd(&[&L, &HOLE], plane(p))),
            0.0,
        ),
        (
            linear(
                "height = 1",
                &format!(
                    "difference() {{ circle(2.5); polygon({}); }} {}",
                    list(&STAR),
                    moved(3., 0., 0., "square(1);")
                ),
            ),
            Box::new(move |p| {
                let q = plane(p);
                let square = (3.0..4.0).contains(&q.x) && (0.0..1.0).contains(&q.y);
                (0.0..1.0).contains(&p.z) && (q.length() < 2.5 && !even_odd(&[&STAR], q) || square)
            }),
            0.0,
        ),
        (
            revolved("angle = 360", &format!("polygon({});", list(&VASE))),
            Box::new(move |p| even_odd(&[&VASE], meridian(p))),
            0.0,
        ),
        (
            revolved("angle = 75", &format!("polygon({});", list(&RING))),
            Box::new(move |p| even_odd(&[&RING], meridian(p)) && angle(p) < 75.0),
            0.0,
        ),
        (
            revolved(
                "angle = 250, start = 30",
                &format!("difference() {{ polygon({}); square([1.5, 0.3]); }}", list(&RING)),
            ),
            Box::new(move |p| {
                let m = meridian(p);
                let cut = m.x < 1.5 && (0.0..0.3).contains(&m.y);
                even_odd(&[&RING], m) && !cut && (30.0..280.0).contains(&angle(p))
            }),
            0.0,
        ),
        (
            revolved(
                "angle = 360",
                &format!("multmatrix([[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) {{ polygon({}); }}", list(&RING)),
            ),
            Box::new(move |p| even_odd(&[&RING], meridian(p))),
            0.0,
        ),
        (
            revolved(
                "",
                "difference() { circle(2); translate_left(); }"
                    .replace("translate_left();", &moved(-5., -5., 0., "square([5, 10]);"))
                    .as_str(),
            ),
            Box::new(move |p| p.length() < 2.0),
            0.0,
        ),
        (
            revolved("$fn = 6", &format!("polygon({});", list(&RING))),
            Box::new(move |p| {
                // How far out by the hexagon with a corner at −x.
                let far = (0..6).map(|k| {
                    let (s, c) = (60.0 * f64::from(k) + 30.0).to_radians().sin_cos();
                    (p.x * c + p.y * s) / 30f64.to_radians().cos()
                });
                even_odd(&[&RING], DVec2::new(far.fold(f64::NEG_INFINITY, f64::max), p.z))
            }),
            0.0,
        ),
        (
            linear("height = 1", &format!("offset(r = 0.3) {{ polygon({}); }}", list(&STAR))),
            Box::new(move |p| {
                let q = plane(p);
                (0.0..1.0).contains(&p.z) && (even_odd(&[&STAR], q) || to_path(&STAR, q) < 0.3)
            }),
            0.0,
        ),
        (
            linear("height = 1", &format!("offset(r = 1.1) {{ polygon({}); }}", list(&STAR))),
            Box::new(move |p| {
                let q = plane(p);
                (0.0..1.0).contains(&p.z) && (even_odd(&[&STAR], q) || to_path(&STAR, q) < 1.1)
            }),
            0.0,
        ),
        (
            linear("height = 1", &format!("offset(r = -0.2) {{ polygon({}); }}", list(&STAR))),
            Box::new(move |p| {
                let q = plane(p);
                (0.0..1.0).contains(&p.z) && even_odd(&[&STAR], q) && to_path(&STAR, q) > 0.2
            }),
            0.0,
        ),
        (
            linear("height = 1", &format!("offset(delta = 0.3) {{ polygon({}); }}", list(&L))),
            Box::new(move |p| {
                let grown = [[-0.3, -0.3], [3.3, -0.3], [3.3, 1.3], [1.3, 1.3], [1.3, 3.3], [-0.3, 3.3]];
                (0.0..1.0).contains(&p.z) && even_odd(&[&grown], plane(p))
            }),
            0.0,
        ),
        (
            linear("height = 1", &format!("offset(delta = -0.3) {{ polygon({}); }}", list(&L))),
            Box::new(move |p| {
                let shrunk = [[0.3, 0.3], [2.7, 0.3], [2.7, 0.7], [0.7, 0.7], [0.7, 2.7], [0.3, 2.7]];
                (0.0..1.0).contains(&p.z) && even_odd(&[&shrunk], plane(p))
            }),
            0.0,
        ),
        (
            linear("height = 1", "offset(delta = 0.5, chamfer = true) { square(2); }"),
            Box::new(move |p| {
                let q = (plane(p) - 1.0).abs();
                (0.0..1.0).contains(&p.z) && q.max_element() < 1.5 && (q.x + q.y - 2.0) / 2f64.sqrt() < 0.5
            }),
            0.0,
        ),
        (
            linear("height = 1", "minkowski() { square(2); circle(0.5); }"),
            Box::new(move |p| {
                let q = plane(p);
                (0.0..1.0).contains(&p.z) && (q - q.clamp(DVec2::ZERO, DVec2::splat(2.0))).length() < 0.5
            }),
            0.0,
        ),
        (
            moved(1., 0., 0., "minkowski() { cube(2); sphere(0.5); }"),
            Box::new(move |p| {
                let q = p - DVec3::X;
                (q - q.clamp(DVec3::ZERO, DVec3::splat(2.0))).length() < 0.5
            }),
            0.0,
        ),
        (
            "minkowski() { cube([2, 1, 1]); cylinder(h = 1, r1 = 0.5, r2 = 0.5); }".into(),
            Box::new(move |p| {
                let q = plane(p);
                (0.0..2.0).contains(&p.z) && (q - q.clamp(DVec2::ZERO, DVec2::new(2.0, 1.0))).length() < 0.5
            }),
            0.0,
        ),
        (
            format!(
                "minkowski() {{ union() {{ cube([3, 1, 1]); cube([1, 3, 1]); }} {} }}",
                moved(0., 0., 1., "cube([1, 1, 2]);")
            ),
            Box::new(move |p| {
                let within = |x: f64, y: f64| (0.0..x).contains(&p.x) && (0.0..y).contains(&p.y);
                (1.0..4.0).contains(&p.z) && (within(4., 2.) || within(2., 4.))
            }),
            0.0,
        ),
        (
            format!("hull() {{ {} {} }}", ball(0., 0., 0., 1.), ball(2., 1., 0.5, 1.)),
            Box::new(move |p| to_segment(p, DVec3::ZERO, DVec3::new(2., 1., 0.5)) < 1.0),
            0.0,
        ),
        (
            format!(
                "hull() {{ cylinder(h = 3, r1 = 1, r2 = 1); {} }}",
                moved(2., 0., 0., "cylinder(h = 3, r1 = 1, r2 = 1);")
            ),
            Box::new(move |p| {
                (0.0..3.0).contains(&p.z) && to_segment(p.with_z(0.0), DVec3::ZERO, DVec3::X * 2.0) < 1.0
            }),
            0.0,
        ),
        (
            format!("hull() {{ cube(1); {} }}", moved(1., 1., 1., "cube(1);")),
            Box::new(move |p| {
                let diagonal = |a: f64, b: f64| (a - b).abs() < 1.0;
                p.min_element() > 0.0
                    && p.max_element() < 2.0
                    && diagonal(p.x, p.y)
                    && diagonal(p.x, p.z)
                    && diagonal(p.y, p.z)
            }),
            0.0,
        ),
        (
            format!(
                "hull() {{ cylinder(h = 1, r1 = 2, r2 = 2); {} }}",
                moved(0., 0., 2., "cylinder(h = 1, r1 = 1, r2 = 0);")
            ),
            Box::new(move |p| {
                let m = meridian(p);
                // Corners of the meridian: (2, 0), (2, 1), (1, 2) and (0, 3) on one line.
                (0.0..3.0).contains(&m.y) && m.x < 2.0 && m.x + m.y < 3.0
            }),
            0.0,
        ),
        (
            linear(
                "height = 1",
                &format!(
                    "hull() {{ circle(1); {} polygon([[0, -3], [1, -3], [0.5, -2]]); }}",
                    moved(3., 1., 0., "circle(0.5);")
                ),
            ),
            {
                let flat = in_hull(vec![
                    (DVec3::ZERO, 1.0),
                    (DVec3::new(3., 1., 0.), 0.5),
                    (DVec3::new(0., -3., 0.), 0.0),
                    (DVec3::new(1., -3., 0.), 0.0),
                ]);
                Box::new(move |p| (0.0..1.0).contains(&p.z) && flat(p.with_z(0.0)))
            },
            1e-3,
        ),
    ];
    // A frame with a frame in its hole, and what lies beside: holes are gone, and what was in them is covered.
    let frame = |a: f64, b: f64| {
        let at = |x: f64| moved(-x, -x, 0.0, &format!("square({});", 2.0 * x));
        format!("difference() {{ {} {} }}", at(a), at(b))
    };
    let shapes = format!("{} {} {}", frame(3.0, 2.0), frame(1.0, 0.5), moved(5.0, 0.0, 0.0, "square(1);"));
    cases.push((
        linear("height = 1", &format!("fill() {{ {shapes} }}")),
        Box::new(|p| {
            let beside = (5.0..6.0).contains(&p.x) && (0.0..1.0).contains(&p.y);
            (0.0..1.0).contains(&p.z) && (p.x.abs().max(p.y.abs()) < 3.0 || beside)
        }),
        0.0,
    ));
    // What is taken away takes no corner, and points are enough of a polyhedron.
    let open_mesh = "polyhedron([[0,0,0],[2,0,0],[0,2,0],[2,2,0],[0,0,1]], [[0,1,2],[3,4,1]]);";
    cases.push((
        format!(
            "hull() {{ difference() {{ cube(2); {} }} group() {{ {open_mesh} }} }}",
            moved(1., 1., -1., "cylinder(h = 9, r1 = 0.5, r2 = 0.5);")
        ),
        Box::new(|p| p.min_element() > 0.0 && p.max_element() < 2.0),
        0.0,
    ));
    // Circles beside the axis are tori, rims rounded by a ball parts of some.
    let tube = |p: DVec3, r: f64| DVec2::new(p.x.hypot(p.y) - 3.0, p.z - 1.0).length() < r;
    let rounded =
        |p: DVec3| DVec2::new((p.x.hypot(p.y) - 2.0).max(0.0), ((p.z - 1.0).abs() - 1.0).max(0.0)).length() < 0.5;
    cases.extend([
        (revolved("", &moved(3., 1., 0., "circle(1);")), Box::new(move |p| tube(p, 1.0)) as Inside, 0.0),
        (
            revolved(
                "angle = 100",
                &format!(
                    "difference() {{ {} {} }}",
                    moved(-3., 1., 0., "circle(1);"),
                    moved(-3., 1., 0., "circle(0.4);")
                ),
            ),
            Box::new(move |p| tube(p, 1.0) && !tube(p, 0.4) && (180.0..280.0).contains(&angle(p))),
            0.0,
        ),
        (
            revolved(
                "",
                &format!(
                    "difference() {{ {} {} }}",
                    moved(1., 0., 0., "circle(2);"),
                    moved(-5., -5., 0., "square([5, 10]);")
                ),
            ),
            Box::new(|p| DVec2::new(p.x.hypot(p.y) - 1.0, p.z).length() < 2.0),
            0.0,
        ),
        ("minkowski() { cylinder(h = 2, r1 = 2, r2 = 2); sphere(0.5); }".into(), Box::new(rounded), 0.0),
        (
            format!("hull() {{ {} }}", revolved("", &moved(3., 1., 0., "circle(1);"))),
            Box::new(move |p| tube(p, 1.0) || p.x.hypot(p.y) < 3.0 && (p.z - 1.0).abs() < 1.0),
            0.0,
        ),
        (
            format!("minkowski() {{ {} sphere(0.25); }}", moved(0., 0., 1., "cylinder(h = 1, r1 = 1, r2 = 0);")),
            Box::new(|p| {
                // The distance from a cone's meridian: a triangle.
                let m = DVec2::new(p.x.hypot(p.y), p.z - 1.0);
                let corner = [DVec2::ZERO, DVec2::X, DVec2::Y].map(|c| c.extend(0.0));
                let q = m.extend(0.0);
                let rim = (0..3).map(|i| to_segment(q, corner[i], corner[(i + 1) % 3])).fold(f64::INFINITY, f64::min);
                rim < 0.25 || m.y > 0.0 && m.x + m.y < 1.0
            }),
            0.0,
        ),
    ]);
    let balls = [[0., 0., 0., 1.], [3., 0., 0., 0.5], [0., 3., 0., 0.7], [1., 1., 3., 0.2], [1., 1., 0.5, 1.1]];
    let text: String = balls.iter().map(|[x, y, z, r]| ball(*x, *y, *z, *r)).collect();
    let all = balls.iter().map(|[x, y, z, r]| (DVec3::new(*x, *y, *z), *r)).collect();
    cases.push((format!("hull() {{ {text} }}"), in_hull(all), 2e-3));
    cases.extend((0..24).map(turned));
    cases
}

/// An outline of either side of the axis, turned in flat sides as OpenSCAD has them: each sector holds the outline as far out as its
/// middle says.
fn turned(round: u64) -> (String, Inside, f64) {
    let mut r = Random(100 + round);
    let pieces = 6 + (r.unit() * 3.0) as u32;
    let angle =
        if round.is_multiple_of(3) { 360.0 } else { r.within(130.0, 300.0) * if r.unit() < 0.5 { -1.0 } else { 1.0 } };
    let side = if round.is_multiple_of(2) { 1.0 } else { -1.0 };
    let points: Vec<[f64; 2]> = RING.iter().map(|[x, y]| [x * side, *y]).collect();
    let count = (f64::from(pieces) * angle.abs() / 360.0).floor().max(1.0);
    // From +x on a part of a turn, from −x a whole one; on the other side of the axis from the other side.
    let start = if angle == 360.0 { 180.0 } else { angle.min(0.0) } + if side < 0.0 { 180.0 } else { 0.0 };
    let (turn, step) = (angle.abs(), angle.abs() / count);
    let inside = move |p: DVec3| {
        let at = (p.y.atan2(p.x).to_degrees() - start).rem_euclid(360.0);
        let middle = (start + ((at / step).floor() + 0.5) * step).to_radians();
        let out = (p.x * middle.cos() + p.y * middle.sin()) / (0.5 * step).to_radians().cos();
        at < turn && even_odd(&[&RING], DVec2::new(out, p.z))
    };
    (revolved(&format!("angle = {angle}, $fn = {pieces}"), &format!("polygon({points:?});")), Box::new(inside), 0.0)
}

#[test]
fn faceted_hulls_hold_the_polygons_of_all_their_circles() {
    let raised = |inner: &str| moved(0.0, 0.0, 5.0, inner);
    let revolved = "rotate_extrude() { difference() { circle(r = 5, $fn = 64); multmatrix([[1,0,0,-9],[0,1,0,-9],[0,0,1,0],\
                    [0,0,0,1]]) { square([9, 18]); } } }";
    for round in [
        "linear_extrude(height = 1) { circle(r = 5, $fn = 64); }".to_owned(),
        format!(
            "hull() {{ cylinder(h = 1, r1 = 5, r2 = 5, $fn = 64); {} }}",
            raised("cylinder(h = 1, r1 = 5, r2 = 5);")
        ),
        revolved.to_owned(),
    ] {
        let text = format!("hull() {{ {round} {} }}", moved(9.0, 0.0, 0.0, "cube([1, 1, 7]);"));
        let import = import_csg("m.csg", &text, Facets::Auto, &Limits::default()).expect("a hull");
        let exact = round == revolved;
        assert!(exact || import.notes.iter().any(|n| n.text.contains("hull: faceted, ")), "{:?}", import.notes);
        for k in 0..90 {
            let (s, c) = libm::sincos(f64::from(k) * 4f64.to_radians());
            assert!(import.solid.value(DVec3::new(4.9 * c, 4.9 * s, 0.01)) < 0.0, "{k}: {text}");
        }
    }
}

#[test]
fn constructs_hold_what_they_mean_without_seams() {
    let mut r = Random(17);
    for (text, inside, off) in cases() {
        let import =
            import_csg("m.csg", &text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{text}: {e}"));
        let (solid, b) = (&import.solid, import.solid.aabb());
        let faceted = import.notes.iter().any(|n| n.text.contains("faceted"));
        assert!(b.is_finite() && !faceted, "{text}: {:?}", import.notes);
        let tell = 1e-9 + off;
        let (mut full, mut near) = (0, 0);
        for _ in 0..if off > 0.0 { 400 } else { 2000 } {
            let x = b.center() + (r.vector(1.0) * 1.2) * b.half();
            let f = solid.value(x);
            if f.abs() <= tell {
                near += 1;
                continue;
            }
            let here = inside(x);
            assert_eq!(f < 0.0, here, "{x}, f {f}: {text}");
            full += usize::from(here);
            // Nothing else within |f|.
            for _ in 0..4 {
                let aside = r.vector(1.0).normalize() * (f.abs() - tell).max(0.0) * r.unit();
                assert_eq!(inside(x + aside), here, "{x}, f {f}, {aside}: {text}");
            }
            // Where f is near 0 the surface is.
            if off == 0.0 && f.abs() < 0.01 {
                let other = (0..4000).any(|_| inside(x + r.vector(1.0) * f.abs() * 30.0) != here);
                assert!(other, "a seam at {x}, f {f}: {text}");
            }
        }
        assert!(full > 20 && near < 60, "{full} inside, {near} near: {text}");
    }
}

/// A ring about the origin whose corners lie at random distances: two rays from there never cross a side twice.
fn coast(r: &mut Random, n: usize) -> Vec<[f64; 2]> {
    let waves: Vec<[f64; 3]> =
        (1..60).map(|k| [f64::from(k), r.within(-2.0, 2.0) / f64::from(k), r.within(0.0, 6.3)]).collect();
    let corner = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / n as f64;
        let far = 9.0 + waves.iter().map(|[k, a, at]| a * (k * angle + at).cos()).sum::<f64>();
        [far * angle.cos(), far * angle.sin()]
    };
    (0..n).map(corner).collect()
}

/// Points about an outline that goes once around the origin, as their sectors tell: inside or not where that is clear.
fn by_sector(ring: &[[f64; 2]], p: DVec2) -> bool {
    let angle = p.y.atan2(p.x).rem_euclid(std::f64::consts::TAU);
    let i = (angle / std::f64::consts::TAU * ring.len() as f64) as usize % ring.len();
    let (a, b) = (DVec2::from_array(ring[i]), DVec2::from_array(ring[(i + 1) % ring.len()]));
    (b - a).perp_dot(p - a) > 0.0
}

#[test]
fn outlines_of_very_many_corners_hold_what_their_sectors_say() {
    let mut r = Random(5);
    let rounds = std::env::var("CONTACTD_OUTLINES").ok().and_then(|n| n.parse().ok());
    for round in 0..rounds.unwrap_or(3_usize) {
        // Every third is convex: of it all sides are on the hull.
        let n = if rounds.is_some() { 50_000 } else { 2_500 };
        let ring = if round % 3 == 2 {
            let at = |i: usize| (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
            (0..n).map(|i| [9.0 * at(i).1, 9.0 * at(i).0]).collect()
        } else {
            coast(&mut r, n)
        };
        let text = linear("height = 2", &format!("polygon({});", list(&ring)));
        let started = std::time::Instant::now();
        let import = import_csg("m.csg", &text, Facets::Auto, &Limits::default()).expect("an outline");
        let took = started.elapsed();
        assert!(import.notes.is_empty(), "{:?}", import.notes);
        if rounds.is_some() {
            println!("{n} corners: {} faces in {took:?}", import.solid.faces.len());
        }
        let mut seen = [0, 0];
        for _ in 0..40 {
            let (angle, far) = (r.within(0.0, 6.3), r.within(6.0, 12.0));
            let p = DVec3::new(far * angle.cos(), far * angle.sin(), r.within(-0.2, 2.2));
            let f = import.solid.value(p);
            let inside = (0.0..2.0).contains(&p.z) && by_sector(&ring, p.truncate());
            if f.abs() > 1e-9 {
                assert_eq!(f < 0.0, inside, "{p}, f {f}, round {round}");
                seen[usize::from(inside)] += 1;
            }
        }
        assert!(seen[0] > 4 && seen[1] > 4, "{seen:?}");
    }
    // What is hull, shadow or sum of one is of its corners.
    let ring = coast(&mut r, if rounds.is_some() { 8_000 } else { 2_500 });
    let outline = linear("height = 2", &format!("polygon({});", list(&ring)));
    let shadow = linear("height = 1", &format!("projection() {{ {outline} }}"));
    let shadow = import_csg("m.csg", &shadow, Facets::Auto, &Limits::default()).expect("a shadow");
    let hull = import_csg("m.csg", &format!("hull() {{ {outline} }}"), Facets::Auto, &Limits::default());
    let hull = hull.expect("a hull").solid;
    for _ in 0..60 {
        let (angle, far) = (r.within(0.0, 6.3), r.within(6.0, 12.0));
        let p = DVec2::new(far * angle.cos(), far * angle.sin());
        let inside = by_sector(&ring, p);
        let f = shadow.solid.value(p.extend(0.5));
        assert!(f.abs() < 1e-6 || (f < 0.0) == inside, "{p}: {f}");
        assert!(!inside || hull.value(p.extend(1.0)) < 1e-9, "{p}");
    }
}

/// A convex outline with a dent in one side keeps its corners, however flat the dent.
#[test]
fn outlines_with_flat_dents_keep_their_corners() {
    let mut r = Random(23);
    for round in 0..60 {
        let (n, size) = (3 + (r.within(0.0, 5.0) as usize), r.within(0.5, 200.0));
        let mut outline: Vec<DVec2> = (0..n)
            .map(|i| DVec2::from_angle((i as f64 + r.within(-0.2, 0.2)) * std::f64::consts::TAU / n as f64) * size)
            .collect();
        let (from, to) = (outline[0], outline[1]);
        let depth = size * 10f64.powf(r.within(-4.8, -3.0));
        outline.insert(1, from.lerp(to, r.within(0.2, 0.8)) + (to - from).perp().normalize() * depth);
        let listed = outline.iter().map(|p| [p.x, p.y]).collect::<Vec<_>>();
        let points: Vec<[f64; 3]> = [0.0, 1.0].iter().flat_map(|z| listed.iter().map(|p| [p[0], p[1], *z])).collect();
        let m = outline.len();
        let mut faces: Vec<Vec<usize>> = vec![(0..m).collect(), (m..2 * m).rev().collect()];
        faces.extend((0..m).map(|i| vec![i, i + m, (i + 1) % m + m, (i + 1) % m]));
        let texts = [
            linear("height = 1", &format!("polygon(points = {listed:?});")),
            format!("polyhedron(points = {points:?}, faces = {faces:?});"),
        ];
        for text in texts {
            let import =
                import_csg("dent.csg", &text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}"));
            assert!(import.notes.iter().all(|note| !note.text.contains("convex")), "{text}: {:?}", import.notes);
            for i in 0..m {
                let (a, b) = (outline[i], outline[(i + 1) % m]);
                for t in [0.001, 0.01, 0.1, 0.5, 0.9, 0.99, 0.999] {
                    for aside in [-1e-7, 1e-7] {
                        let p = a.lerp(b, t) + (b - a).perp().normalize() * (aside * size);
                        let told = import.solid.value(p.extend(0.5)) < 0.0;
                        assert_eq!(told, even_odd(&[&listed], p), "{round}: {p} of {text}");
                    }
                }
            }
        }
    }
}

#[test]
fn outlines_as_deep_as_they_have_corners_are_meshes_and_too_many_corners_are_refused() {
    let arm = |i: usize, width: f64| {
        let angle = 0.05 * i as f64;
        [angle.cos() * (1.0 + 0.05 * angle + width), angle.sin() * (1.0 + 0.05 * angle + width)]
    };
    let ring: Vec<[f64; 2]> = (0..700).map(|i| arm(i, 0.1)).chain((0..700).rev().map(|i| arm(i, 0.0))).collect();
    // As it stands, and taken from a plate: then it goes through.
    let spiral = format!("polygon({});", list(&ring));
    let plate = format!("difference() {{ {} {spiral} }}", moved(-5.0, -5.0, 0.0, "square(10);"));
    let mut r = Random(9);
    for (text, from) in [(&spiral, false), (&plate, true)] {
        let text = linear("height = 2", text);
        let import = import_csg("m.csg", &text, Facets::Auto, &Limits::default()).expect("a spiral");
        assert!(import.notes.iter().any(|n| n.text.contains("corners: taken as a mesh")), "{:?}", import.notes);
        let mut seen = [0, 0];
        for _ in 0..400 {
            let p = DVec3::new(r.within(-4.0, 4.0), r.within(-4.0, 4.0), r.within(-0.2, 2.2));
            let inside = (0.0..2.0).contains(&p.z) && even_odd(&[&ring], p.truncate()) != from;
            let f = import.solid.value(p);
            if f.abs() > 1e-9 {
                assert_eq!(f < 0.0, inside, "{p}, f {f}, from a plate {from}");
                seen[usize::from(inside)] += 1;
            }
        }
        assert!(seen[0] > 20 && seen[1] > 20, "{seen:?}");
    }
    let limits = Limits { outline_corners: 1000, ..Limits::default() };
    let refused = import_csg("m.csg", &linear("height = 2", &spiral), Facets::Auto, &limits).expect_err("too many");
    assert!(refused.to_string().contains("at most 1000 corners of an outline"), "{refused}");
    assert!(refused.to_string().contains("found 1400"), "{refused}");
}
