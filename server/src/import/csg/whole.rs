//! Constructs that look at the whole of what is inside, held against the inside itself: hulls and sums of what something has cut,
//! shadows, sections, sizes.

use crate::import::{Facets, Import, Limits, import_csg};
use crate::math::random::Random;
use glam::{DVec2, DVec3};

fn read(text: &str) -> Import {
    import_csg("m.csg", text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn moved(by: DVec3, inner: &str) -> String {
    let [x, y, z] = by.to_array();
    format!("multmatrix([[1, 0, 0, {x}], [0, 1, 0, {y}], [0, 0, 1, {z}], [0, 0, 0, 1]]) {{ {inner} }}")
}

fn is_faceted(import: &Import) -> bool {
    import.notes.iter().any(|n| n.text.contains("faceted"))
}

/// Volume by sums over a grid.
fn volume(import: &Import, n: u32) -> f64 {
    let b = import.solid.aabb();
    let size = b.max - b.min;
    let at = |i: u32| DVec3::new(f64::from(i % n), f64::from(i / n % n), f64::from(i / n / n)) + 0.5;
    let inside = (0..n * n * n).filter(|i| import.solid.value(b.min + size * at(*i) / f64::from(n)) < 0.0);
    size.x * size.y * size.z * inside.count() as f64 / f64::from(n * n * n)
}

/// A difference or an intersection of random boxes, balls and cylinders.
fn random_cut(r: &mut Random, flat: bool) -> String {
    let operand = |r: &mut Random, size: f64| {
        let at = r.vector(0.7);
        let shape = match (flat, (r.unit() * 3.0) as u32) {
            (false, 0) => format!("sphere(r = {}, $fn = 40);", size * r.within(0.6, 1.0)),
            (false, 1) => {
                format!("cylinder(h = {}, r1 = {}, r2 = {}, center = true, $fn = 40);", 2.0 * size, size, 0.6 * size)
            }
            _ => format!("cube([{}, {}, {}], center = true);", 2.0 * size, r.within(1.0, 2.0) * size, 1.5 * size),
        };
        moved(at, &shape)
    };
    let (a, b, c) = (operand(r, 2.0), operand(r, 1.3), operand(r, 1.0));
    match (r.unit() * 3.0) as u32 {
        0 => format!("difference() {{ {a} {b} {c} }}"),
        1 => format!("intersection() {{ {a} {b} }}"),
        _ => format!("difference() {{ union() {{ {a} {c} }} {b} }}"),
    }
}

#[test]
fn a_hull_of_what_is_cut_holds_what_is_left_and_reaches_no_farther() {
    let mut r = Random(41);
    for round in 0..16 {
        let cut = random_cut(&mut r, round % 2 == 0);
        let (inner, hull) = (read(&cut), read(&format!("hull() {{ {cut} }}")));
        let b = inner.solid.aabb();
        let off = if round % 2 == 0 { 1e-9 } else { 0.03 };
        let points: Vec<DVec3> = (0..6000).map(|_| b.center() + r.vector(1.0) * b.half()).collect();
        let kept: Vec<DVec3> = points.into_iter().filter(|x| inner.solid.value(*x) < 0.0).collect();
        assert!(kept.iter().all(|x| hull.solid.value(*x) < off), "{cut}");
        // Along each direction the hull ends where the last of what is left does.
        for _ in 0..20 {
            let n = r.vector(1.0).normalize();
            let reach = kept.iter().map(|x| n.dot(*x)).fold(f64::NEG_INFINITY, f64::max);
            let beyond = (0..4000).map(|_| b.center() + r.vector(1.0) * b.half()).filter(|x| n.dot(*x) > reach + 0.5);
            assert!(beyond.into_iter().all(|x| hull.solid.value(x) > -0.05), "{n} of {cut}");
        }
        assert!(round % 2 == 1 || !hull.notes.iter().any(|n| n.text.contains("faceted")), "{:?}", hull.notes);
    }
    // A cube without a corner: its hull lacks the corner of a tetrahedron.
    let corner = format!("hull() {{ difference() {{ cube(2); {} }} }}", moved(DVec3::ONE, "cube(2);"));
    assert!(
        (read(&corner).solid.primitives.len() == 1) && (volume(&read(&corner), 60) - (8.0 - 1.0 / 6.0)).abs() < 0.02
    );
    // Flat polyhedra span a hull with what stands beside them.
    let sheet = "polyhedron([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], [[0, 1, 2, 3]]);";
    let between = read(&format!("hull() {{ {sheet} {} }}", moved(DVec3::Z * 3.0, sheet)));
    assert_eq!(between.solid.aabb().max, DVec3::new(2.0, 2.0, 3.0));
    assert!(between.solid.value(DVec3::new(0.1, 1.9, 2.9)) < -0.09);
    let nothing = read("cube(1); hull() { difference() { cube(1); cube(3, center = true); } }");
    assert_eq!(nothing.solid.primitives.len(), 1);
}

#[test]
fn sums_of_what_is_not_convex_are_exact_where_it_is_and_meshes_where_not() {
    let bend = format!("difference() {{ cube([3, 3, 1]); {} }}", moved(DVec3::new(1.0, 1.0, -1.0), "cube(9);"));
    for (around, at) in [(String::new(), DVec3::ZERO), ("moved".into(), DVec3::new(5.0, -2.0, 1.0))] {
        let sum = format!("minkowski() {{ {bend} cube(1); }}");
        let import = read(&if around.is_empty() { sum } else { moved(at, &sum) });
        let mut r = Random(43);
        for _ in 0..2000 {
            let x = DVec3::new(r.within(-0.5, 4.5), r.within(-0.5, 4.5), r.within(-0.5, 2.5));
            let inside = x.min_element() > 0.0 && x.x < 4.0 && x.y < 4.0 && x.z < 2.0 && (x.x < 2.0 || x.y < 2.0);
            let f = import.solid.value(x + at);
            assert!(f.abs() < 1e-9 || (f < 0.0) == inside, "{x}: {f}");
        }
        assert!(is_faceted(&import));
    }
    let round =
        format!("minkowski() {{ intersection() {{ cube(2); {} }} sphere(0.5); }}", moved(DVec3::ONE, "cube(2);"));
    let import = read(&round);
    let mut r = Random(44);
    for _ in 0..2000 {
        let x = DVec3::splat(1.5) + r.vector(1.2);
        let away = (x - x.clamp(DVec3::ONE, DVec3::splat(2.0))).length();
        let f = import.solid.value(x);
        assert!((away - 0.5).abs() < 1e-9 || (f < 0.0) == (away < 0.5), "{x}: {f}");
    }
    assert!(!is_faceted(&import), "{:?}", import.notes);
}

#[test]
fn sections_and_shadows_are_what_the_solid_says() {
    let mut r = Random(45);
    let rounds = std::env::var("CONTACTD_OUTLINES").ok().and_then(|n| n.parse().ok()).map_or(8, |n: usize| n.max(16));
    for round in 0..rounds {
        let exact = round % 2 == 0;
        let tilted = "multmatrix([[0.6, 0, 0.8, 0.3], [0, 1, 0, 0.2], [-0.8, 0, 0.6, 0.1], [0, 0, 0, 1]])";
        let inner = random_cut(&mut r, false);
        let inner = if exact { inner } else { format!("union() {{ {tilted} {{ {inner} }} cube(0.5); }}") };
        let solid = read(&inner).solid;
        let flat =
            |cut: bool| read(&format!("linear_extrude(height = 2) {{ projection(cut = {cut}) {{ {inner} }} }}")).solid;
        let (section, shadow) = (flat(true), flat(false));
        let b = solid.aabb();
        for _ in 0..300 {
            let p = (b.center() + r.vector(1.0) * b.half()).truncate();
            let f = solid.value(p.extend(0.0));
            if f.abs() > if exact { 1e-7 } else { 0.05 } {
                assert_eq!(section.value(p.extend(1.0)) < 0.0, f < 0.0, "{p}, f {f}, section of {inner}");
            }
            let along = (0..200).map(|i| p.extend(b.min.z + (b.max.z - b.min.z) * (f64::from(i) + 0.5) / 200.0));
            let deepest = along.map(|x| solid.value(x)).fold(f64::INFINITY, f64::min);
            if deepest.abs() > 0.08 {
                let g = shadow.value(p.extend(1.0));
                assert_eq!(g < 0.0, deepest < 0.0, "{p}, f {deepest}, {g}: shadow of {inner}");
            }
        }
    }
    // A face in the plane is in the section, whichever side the solid is on. A lying cylinder casts a rectangle, an upright one its circle, exactly.
    let on = |text: &str, p: DVec2| {
        read(&format!("linear_extrude(height = 2) {{ {text} }}")).solid.value(p.extend(1.0)) < 0.0
    };
    assert!(on("projection(cut = true) { cube(2); }", DVec2::ONE));
    assert!(on(
        "projection(cut = true) { cube(3); multmatrix([[1,0,0,5],[0,1,0,0],[0,0,1,-2],[0,0,0,1]]) { cube(2); } }",
        DVec2::new(6.0, 1.0)
    ));
    let lying =
        "multmatrix([[1,0,0,0],[0,0,-1,0],[0,1,0,9],[0,0,0,1]]) { cylinder(h = 4, r1 = 1, r2 = 1, center = true); }";
    let import = read(&format!(
        "linear_extrude(height = 1) {{ projection() {{ {lying} cylinder(h = 1, r1 = 1.5, r2 = 1.5); }} }}"
    ));
    assert!(!is_faceted(&import) && import.solid.primitives.len() == 2, "{:?}", import.notes);
    assert!(
        import.solid.value(DVec3::new(0.99, 1.99, 0.5)) < 0.0 && import.solid.value(DVec3::new(1.499, 0.0, 0.5)) < 0.0
    );
}

#[test]
fn resized_shapes_have_the_sizes_that_are_asked_for() {
    let size = |text: &str| {
        let b = read(text).solid.aabb();
        b.max - b.min
    };
    let near = |a: DVec3, b: [f64; 3]| (a - DVec3::from_array(b)).abs().max_element() < 1e-9;
    assert!(near(size("resize([4, 0, 6]) { cube([1, 2, 3]); }"), [4.0, 2.0, 6.0]));
    assert!(near(size("resize([4, 0, 0], auto = true) { cube([1, 2, 3]); }"), [4.0, 8.0, 12.0]));
    assert!(near(size("resize([4, 0, 0], auto = [false, true, false]) { cube([1, 2, 3]); }"), [4.0, 8.0, 3.0]));
    assert!(near(size("resize([6, 6, 6]) { sphere(1); }"), [6.0, 6.0, 6.0]));
    assert!(near(
        size("linear_extrude(height = 1) { resize([3, 1]) { square([1, 4]); circle(0.1, $fn = 4); } }"),
        [3.0, 1.0, 1.0]
    ));
    assert!(near(size("resize([0, 0, 0]) { cube([1, 2, 3]); }"), [1.0, 2.0, 3.0]));
    assert!(near(size("resize([2, 2, 2]) { resize([1, 5, 9]) { cube(3); } }"), [2.0, 2.0, 2.0]));
    let text = format!("resize([1, 5, 5]) {{ difference() {{ cube(2); {} }} }}", moved(DVec3::X, "cube(9);"));
    let import = read(&text);
    // What is left of the cube is one wide, and stays so; the cube that was cut away is as large as before.
    let inside = |x: f64, y: f64, z: f64| import.solid.value(DVec3::new(x, y, z)) < 0.0;
    assert!(inside(0.99, 4.9, 4.9) && !inside(1.01, 1.0, 1.0) && !inside(0.5, 5.1, 1.0));
    // About the origin, not about itself.
    let aside = format!("resize([2, 0, 0]) {{ {} }}", moved(DVec3::X, "cube(1);"));
    assert!((read(&aside).solid.aabb().min.x - 2.0).abs() < 1e-12);
    assert_eq!(read("cube(1); resize([1, 1, 1]) { }").solid.primitives.len(), 1);
}

#[test]
fn parts_of_a_turn_are_resized_by_their_own_size_and_not_by_that_of_pieces() {
    let mut r = Random(61);
    for round in 0..40 {
        let [low, high, h] = [r.within(1.0, 5.0), r.within(5.5, 9.0), r.within(1.0, 4.0)];
        let (start, angle) = ((r.unit() * 400.0).floor() - 200.0, 5.0 + (r.unit() * 340.0).floor());
        let angle = if round % 8 == 7 { 360.0 } else { angle };
        // A ring of a rectangle, with a bevel, of a disc, or cut.
        let (mid, thick) = (0.5 * (low + high), 0.5 * (high - low));
        let outline = match round % 4 {
            0 => format!("polygon([[{low}, 0], [{high}, 0], [{high}, {h}], [{low}, {h}]]);"),
            1 => format!("polygon([[{low}, 0], [{high}, {h}], [{low}, {h}]]);"),
            2 => moved(DVec3::new(mid, 0.0, 0.0), &format!("circle({thick}, $fn = 100);")),
            _ => format!(
                "difference() {{ polygon([[{low}, 0], [{high}, 0], [{high}, {h}], [{low}, {h}]]); {} }}",
                moved(DVec3::new(mid, 0.5 * h, 0.0), "square(50);")
            ),
        };
        let within = |rho: f64, z: f64| match round % 4 {
            0 => (rho - low).min(high - rho).min(z).min(h - z),
            1 => (rho - low).min(h - z).min(z * (high - low) - (rho - low) * h),
            2 => thick - (rho - mid).hypot(z),
            _ => (rho - low).min(high - rho).min(z).min(h - z).min((mid - rho).max(0.5 * h - z)),
        };
        let text = format!(
            "resize([10, 20, 30]) {{ multmatrix([[{}, {}, 0, 1], [{}, {}, 0, -2], [0, 0, 1, 0], [0, 0, 0, 1]]) {{ \
             rotate_extrude(angle = {angle}, $fn = 50) {{ {outline} }} }} }}",
            start.to_radians().cos(),
            -start.to_radians().sin(),
            start.to_radians().sin(),
            start.to_radians().cos(),
        );
        let import = read(&text);
        // The box: both ends and whole quarters of the turn, at the inner and the outer radius.
        let mut b = crate::math::Aabb::EMPTY;
        let quarters = (-16..=32).map(|k| f64::from(k) * 90.0).filter(|q| *q >= start && *q <= start + angle);
        for phi in [start, start + angle].into_iter().chain(quarters) {
            let (sin, cos) = phi.to_radians().sin_cos();
            for rho in [low, high] {
                b = b.union(&crate::math::Aabb::of_points([DVec3::new(rho * cos, rho * sin, 0.0)]));
            }
        }
        let (bottom, top) = if round % 4 == 2 { (-thick, thick) } else { (0.0, h) };
        // A disc that turns and is scaled is a polygon of 100 sides.
        let off = if round % 4 == 2 { 1e-6 + thick * (1.0 - (0.01 * std::f64::consts::PI).cos()) } else { 1e-6 };
        let scale = DVec3::new(10.0, 20.0, 30.0) / DVec3::new(b.max.x - b.min.x, b.max.y - b.min.y, top - bottom);
        for _ in 0..4000 {
            let (rho, phi) = (r.within(0.9 * low, 1.1 * high), (start + r.within(-0.1, 1.1) * angle).to_radians());
            let z = r.within(bottom - 0.3, top + 0.3);
            let turned = (phi.to_degrees() - start).rem_euclid(360.0);
            let sides = if angle == 360.0 { f64::INFINITY } else { turned.min(angle - turned).to_radians() * rho };
            let inside = within(rho, z).min(sides);
            let x = DVec3::new(rho * phi.cos() + 1.0, rho * phi.sin() - 2.0, z) * scale;
            let f = import.solid.value(x);
            assert!(inside.abs() < off || (inside > 0.0) == (f < 0.0), "{x}: {inside} {f} of {text}");
        }
    }
    // A quarter of a ring of radii 5 and 8, 4 high.
    let inner = "rotate_extrude(angle = 90, $fn = 360) { polygon([[5, 0], [8, 0], [8, 4], [5, 4]]); }";
    let quarter = read(&format!("resize([10, 10, 10]) {{ {inner} }}"));
    let area = std::f64::consts::FRAC_PI_4 * (64.0 - 25.0) * (10.0 / 8.0) * (10.0 / 8.0);
    assert!((area * 10.0 - 478.602).abs() < 1e-3);
    for (x, y, inside) in [(9.999, 1e-3, true), (1e-3, 9.999, true), (1e-3, 10.001, false), (10.001, 1e-3, false)] {
        assert_eq!(quarter.solid.value(DVec3::new(x, y, 9.999)) < 0.0, inside, "{x} {y}");
    }
    // Beside another solid, and where something is taken from it: by its own pieces, of which 360 end on the axes.
    for text in [
        format!("resize([10, 10, 10]) {{ {inner} cube(1); }}"),
        format!("resize([10, 10, 10]) {{ difference() {{ {inner} cube([1, 1, 20], center = true); }} }}"),
        format!(
            "resize([10, 10, 10]) {{ difference() {{ {inner} {} }} }}",
            moved(DVec3::new(4.0, 4.0, 1.0), "cube(1);")
        ),
    ] {
        let solid = read(&text).solid;
        let at = |y: f64| solid.value(DVec3::new(1e-3, y, 9.999)) < 0.0;
        assert!(at(9.999) && !at(10.001), "{text}");
    }
}

#[test]
fn offsets_by_a_delta_at_which_sides_meet_are_the_moved_half_planes() {
    // Two squares and a bridge between them; a fork whose gap closes.
    let bridge = "polygon([[0, 0], [4, 0], [4, 1.5], [6, 1.5], [6, 0], [10, 0], [10, 4], [6, 4], [6, 2.5], [4, 2.5], [4, 4], [0, 4]]);";
    let fork = "polygon([[0, 0], [5, 0], [5, 4], [3, 4], [3, 1], [2, 1], [2, 4], [0, 4]]);";
    let of = |delta: f64, shape: &str| {
        read(&format!("linear_extrude(height = 2) {{ offset(delta = {delta}) {{ {shape} }} }}"))
    };
    let (thin, closed) = (of(-0.75, bridge), of(0.75, fork));
    let mut r = Random(47);
    for _ in 0..3000 {
        let p = DVec2::new(r.within(-2.0, 12.0), r.within(-2.0, 6.0));
        let within = |x: f64, y: f64, u: f64, v: f64| p.x > x && p.x < u && p.y > y && p.y < v;
        for (import, inside) in [
            (&thin, within(0.75, 0.75, 3.25, 3.25) || within(6.75, 0.75, 9.25, 3.25)),
            (&closed, within(-0.75, -0.75, 5.75, 4.75)),
        ] {
            let f = import.solid.value(p.extend(1.0));
            assert!(f.abs() < 1e-9 || (f < 0.0) == inside, "{p}: {f}");
        }
    }
    assert!(of(-3.0, bridge).solid.is_empty());
}
