//! Quadrics cut by planes against closed forms, and against every other kind: first contacts, membership, regions, mass, import.
//!
//! How far domes and hyperboloids of revolution reach along a direction has a formula, and so have first contacts with planes. The
//! distance of a point from a paraboloid of revolution is that from a parabola, the one positive root of a cubic; on an axis those
//! from a hyperboloid and from a saddle have formulas, too. Pairs with the other kinds have no closed form: their certificates are
//! checked by the independent verifier.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers quadrics:: -- --nocapture` sets the number of pairs,
//! and of trees.

use super::kinds::{Scene, alone, at_rest, compare, pairs, past, placed, speed, turning, values_and_volumes};
use contactd::contact::Extent;
use contactd::import::{Facets, Limits, import_csg};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::{Shape, Solid};
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::certified::{certify_all, certify_trees, stay_small};
use contactd_tests::quadrics::{KINDS, of_kind, random, shape_or_quadric};
use contactd_tests::random_solids::{Random, shape};
use contactd_tests::scenes::Recipe;
use glam::{DMat3, DVec2, DVec3, dvec3};
use std::f64::consts::PI;

/// Resolutions of a gap at which a pair may count as touching: psi is up to ten times flatter than the distance.
const FLAT: f64 = 60.0;

/// Of the pairs whose certificates are checked.
const KINDS_SEED: u64 = 0x0_dd1c;

fn load(text: &str) -> Solid {
    import_csg("a.csg", text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{text}: {e}")).solid
}

/// The primitive of a text that has one.
fn one(text: &str) -> Recipe {
    let solid = load(text);
    assert_eq!(solid.primitives.len(), 1, "{text}");
    Recipe::Leaf(solid.primitives[0].shape.clone(), solid.primitives[0].frame)
}

/// How far a dome with its tip at z = h and its rim of radius r at z = 0 reaches along a unit vector; `cone` of a hyperbolic one.
fn reach_of_dome(n: DVec3, r: f64, h: f64, cone: Option<f64>) -> f64 {
    let (across, up) = (n.truncate().length(), n.z);
    let rim = across * r;
    let Some(c) = cone else {
        // The highest of across ρ + up h (1 − ρ²/r²).
        let at = across * r * r / (2.0 * h * up);
        return if up > 0.0 && at < r { up * h + across * across * r * r / (4.0 * h * up) } else { rim };
    };
    // ρ = a sinh t, z = h + c − c cosh t.
    let a = r * c / (h * (h + 2.0 * c)).sqrt();
    let tanh = across * a / (up * c);
    if up > 0.0 && tanh < 1.0 && a * tanh / (1.0 - tanh * tanh).sqrt() < r {
        return up * (h + c) - ((up * c - across * a) * (up * c + across * a)).sqrt();
    }
    rim
}

/// Distance from the parabola z = α ρ² at ρ >= 0: of the nearest point 2α² ρ³ + (1 − 2αz) ρ is the point's own ρ.
fn off_parabola(alpha: f64, own: f64, z: f64) -> f64 {
    let f = |rho: f64| 2.0 * alpha * alpha * rho * rho * rho + (1.0 - 2.0 * alpha * z) * rho - own;
    let (mut low, mut high) = (0.0, own + (z.abs() / alpha).sqrt() + 1.0 / alpha);
    // On the axis the root beyond 0, where there is one.
    let turn = ((2.0 * alpha * z - 1.0) / (6.0 * alpha * alpha)).max(0.0).sqrt();
    low = turn.max(low);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    (own - high).hypot(z - alpha * high * high)
}

#[test]
fn quadrics_meet_planes_and_balls_when_closed_forms_say_so() {
    let count = pairs(8);
    let on_plane = |r: &mut Random, body: Recipe, reach: Box<dyn Fn(DVec3) -> f64>| {
        let floor = Recipe::cuboid(8.0, 8.0, 1.0).at(0.0, 0.0, -1.0);
        let motions = [past(r, 2.8), Motion::resting(Pose::new(r.vector(0.2), r.rotation()))];
        let speed = speed(&motions, 2.2);
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let n = b.rotation * DVec3::Z;
            n.dot(a.position - b.position) - reach(a.rotation.inverse() * -n)
        });
        Scene { a: body, b: floor, motions, gap, speed }.above_plane()
    };
    compare("paraboloid on a plane", (count, 1, FLAT), |r| {
        let (h, rim) = (r.within(0.3, 1.5), r.within(0.3, 1.0));
        on_plane(r, one(&format!("paraboloid({h}, {rim});")), Box::new(move |n| reach_of_dome(n, rim, h, None)))
    });
    compare("hyperbolic dome on a plane", (count, 2, FLAT), |r| {
        let (h, rim, cone) = (r.within(0.3, 1.5), r.within(0.3, 1.0), r.within(0.1, 2.0));
        let text = format!("hyperboloid({h}, {rim}, cone = {cone});");
        on_plane(r, one(&text), Box::new(move |n| reach_of_dome(n, rim, h, Some(cone))))
    });
    compare("hyperboloid on a plane", (count, 3, FLAT), |r| {
        let (h, rim) = (r.within(0.5, 1.5), r.within(0.3, 1.0));
        let waist = rim * r.within(0.3, 0.95);
        let text = format!("hyperboloid({h}, {rim}, waist = {waist}, center = true);");
        on_plane(r, one(&text), Box::new(move |n| n.truncate().length() * rim + 0.5 * h * n.z.abs()))
    });
    compare("ball in a paraboloid", (count, 4, FLAT), |r| {
        let alpha = r.within(0.5, 2.0);
        // Up to z = 3 within a block; no larger than the least radius of curvature.
        let rim = (3.0 / alpha).sqrt();
        let bowl = one(&format!("multmatrix([[1,0,0,0],[0,-1,0,0],[0,0,-1,3],[0,0,0,1]]) {{ paraboloid(3, {rim}); }}"));
        let block = Recipe::cuboid(4.0, 4.0, 2.0).at(0.0, 0.0, 1.0).minus(bowl);
        let ball = r.within(0.2, 0.95) * 0.5 / alpha;
        let a = turning(r);
        let start = a.start.point(dvec3(0.0, 0.0, 1.0) + r.vector(0.2));
        let aim = DVec2::new(r.within(-1.0, 1.0), r.within(-1.0, 1.0)).extend(r.within(-1.5, 0.2));
        let velocity = a.velocity + a.start.vector(aim * 1.2);
        let b = Motion { start: Pose::new(start, r.rotation()), velocity, spin: r.vector(1.0) };
        let motions = [Motion { spin: a.spin * 0.3, ..a }, b];
        let speed = speed(&motions, 3.0);
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let x = a.inverse().point(b.position);
            let (rho, off) = (x.truncate().length(), x.z - alpha * x.truncate().length_squared());
            off_parabola(alpha, rho, x.z).copysign(off) - ball
        });
        Scene { a: block, b: Recipe::sphere(ball), motions, gap, speed }
    });
    // Down the axis, both turning about it.
    let along = |r: &mut Random, from: f64| {
        let turn = r.rotation();
        let axis = turn * DVec3::Z;
        let a =
            Motion { start: Pose::new(r.vector(0.5), turn), velocity: r.vector(0.3), spin: axis * r.within(-1.0, 1.0) };
        let start = Pose::new(a.start.position + axis * from, r.rotation());
        let b = Motion { start, velocity: a.velocity - axis * from * r.within(0.5, 2.0), spin: r.vector(2.0) };
        [a, b]
    };
    let height = |a: &Pose, b: &Pose| (b.position - a.position).dot(a.rotation * DVec3::Z);
    // It touches along a circle, all of which the search cuts small.
    compare("ball on the axis of a hyperboloid's hole", (count.div_ceil(10), 5, FLAT), move |r| {
        let (rim, h) = (r.within(1.0, 2.0), 4.0);
        let waist = rim * r.within(0.3, 0.8);
        let hole = one(&format!("hyperboloid({h}, {rim}, waist = {waist}, center = true);"));
        let block = Recipe::cuboid(3.0, 3.0, 1.9).minus(hole);
        // ρ² = w² + k z².
        let k = (rim - waist) * (rim + waist) / (0.25 * h * h);
        let from = r.within(1.0, 1.5);
        let distance = move |z: f64| (waist * waist + z * z * k / (1.0 + k)).sqrt();
        let ball = waist * 1.01 + (distance(from) - waist * 1.01) * r.within(0.0, 0.9);
        let motions = along(r, from);
        let gap = Box::new(move |a: &Pose, b: &Pose| distance(height(a, b)) - ball);
        Scene { a: block, b: Recipe::sphere(ball), motions, gap, speed: speed(&motions, 0.0) }
    });
    compare("ball under a saddle, on its axis", (count, 6, FLAT), move |r| {
        let (alpha, beta) = (r.within(0.3, 1.0), r.within(0.3, 1.0));
        let m = format!("[[{alpha},0,0,0],[0,{},0,0],[0,0,0,0.5],[0,0,0.5,0]]", -beta);
        // α x² − β y² + z <= 0: below, and the ball comes from above.
        let body = one(&format!("quadric({m}, [-1.5, -1.5, -3], [1.5, 1.5, 3]);"));
        let (ball, from) = (r.within(0.1, 0.6), r.within(1.2, 2.5));
        let distance = move |z: f64| if z <= 0.5 / beta { z } else { (z / beta - 0.25 / (beta * beta)).sqrt() };
        let motions = along(r, from);
        let gap = Box::new(move |a: &Pose, b: &Pose| distance(height(a, b)) - ball);
        Scene { a: body, b: Recipe::sphere(ball), motions, gap, speed: speed(&motions, 0.0) }
    });
}

/// A quadric, and one of the other kinds or another quadric that goes past it.
fn passing(r: &mut Random) -> [(Model, Placed); 2] {
    let other = if r.chance(0.3) { random(r, 0.8) } else { shape(r, 0.8) };
    [(alone(random(r, 0.8)), placed(turning(r))), (alone(other), placed(past(r, 2.2)))]
}

#[test]
fn certificates_of_quadrics_against_every_kind_and_of_trees_with_them_hold() {
    let count = pairs(14);
    certify_all("kinds", (count, KINDS_SEED), passing);
    certify_trees((count, KINDS_SEED), shape_or_quadric);
}

/// Of a thousand of the pairs above those of which thin cells take hundreds of thousands, along what bends away from its tangents.
#[test]
fn certificates_along_saddles_stay_small() {
    stay_small("saddles", KINDS_SEED, &[449, 923], passing);
}

#[test]
fn trees_with_quadrics_have_the_values_and_the_volumes_of_an_independent_evaluation() {
    values_and_volumes(shape_or_quadric, (pairs(60).div_ceil(30).min(24), 3, pairs(60) * 10), [64, 41]);
}

#[test]
fn f_of_a_quadric_is_no_larger_than_the_distance_and_small_at_its_surface_alone() {
    let (mut r, mut looked) = (Random::new(23), 0);
    for i in 0..pairs(60).div_ceil(10).min(400) {
        let shape = of_kind(&mut r, 1.0, i % KINDS);
        let solid = Recipe::of(shape).build();
        let around = solid.aabb().grown(0.3);
        for _ in 0..60 {
            let x = r.point_in(&around);
            let f = solid.value(x);
            // A ball of that radius is all on one side.
            for _ in 0..20 {
                let y = x + r.direction() * (f.abs() * r.within(0.9, 0.999_999));
                assert!(solid.value(y) * f >= 0.0, "{i}: {f} at {x}, {} at {y}", solid.value(y));
            }
            // Where |f| is small the surface is near: psi is at most so much flatter than the distance within the box.
            let near = (0..400).any(|_| solid.value(x + r.direction() * (f.abs() * r.within(1.0, 60.0))) * f < 0.0);
            assert!(near || f.abs() > 0.02, "{i}: {f} at {x}, and no surface near");
            looked += 1;
        }
    }
    println!("{looked} points");
}

#[test]
fn a_paraboloid_and_a_hyperboloid_have_their_volumes() {
    let volume = |text: &str, exact: f64| {
        for tolerance in [0.1, 1e-2, 1e-3] {
            let m =
                mass_properties(&Model::new(load(text)), &MassOptions { tolerance, boxes: 300_000 }).expect("bounded");
            assert!((m.volume - exact).abs() <= m.volume_error && m.volume_error <= tolerance * exact, "{text}: {m:?}");
        }
    };
    volume("paraboloid(2, 1.5);", 0.5 * PI * 2.25 * 2.0);
    // ⅓ π h (2 w² + r²).
    volume("hyperboloid(2, 1.5, waist = 0.5);", PI * 2.0 / 3.0 * (0.5 + 2.25));
    // ∫ r² (u² − c²)/(H² − c²) from c to H = h + c.
    let (r, h, c) = (1.5f64, 2.0f64, 0.5f64);
    let whole = ((h + c).powi(3) - c.powi(3)) / 3.0 - c * c * h;
    volume("hyperboloid(2, 1.5, cone = 0.5);", PI * r * r / (h * (h + 2.0 * c)) * whole);
    // Between y = ±1 the saddle z = x² − y² halves a box of odd symmetry.
    volume("quadric([[1,0,0,0],[0,-1,0,0],[0,0,0,0.5],[0,0,0.5,0]], [-1, -1, -2], [1, 1, 2]);", 8.0);
    // All but a ball.
    volume("quadric([[-1,0,0,0],[0,-1,0,0],[0,0,-1,0],[0,0,0,1]], [-2, -2, -2], [2, 2, 2]);", 64.0 - 4.0 / 3.0 * PI);
}

#[test]
fn quadrics_touch_at_points_and_along_rims() {
    let floor = || Recipe::cuboid(5.0, 5.0, 1.0).at(0.0, 0.0, -1.0);
    let upside_down = Pose::new(dvec3(0.2, 0.1, 1.0), contactd_proto::motion::quat_of_rotation_vector(DVec3::X * PI));
    let found = at_rest(floor(), one("paraboloid(1, 1);"), upside_down);
    assert!(found.len() == 1 && found[0].extent == Extent::Point, "{found:?}");
    assert!((found[0].points[0].point - dvec3(0.2, 0.1, 0.0)).length() < 1e-8, "{found:?}");
    assert!((found[0].normal - DVec3::Z).length() < 1e-8, "{found:?}");
    // On its flat side, the rim around it.
    let found = at_rest(floor(), one("paraboloid(1, 1);"), Pose::IDENTITY);
    assert!(found.len() == 1 && found[0].extent == Extent::Patch && found[0].points.len() == 8, "{found:?}");
    assert!(found[0].points.iter().all(|p| (p.point.truncate().length() - 1.0).abs() < 1e-8), "{found:?}");
    let found = at_rest(floor(), one("hyperboloid(1, 1, waist = 0.5);"), Pose::IDENTITY);
    assert!(found.len() == 1 && found[0].extent == Extent::Patch && found[0].points.len() == 8, "{found:?}");
    assert!(found[0].points.iter().all(|p| (p.point.truncate().length() - 1.0).abs() < 1e-8), "{found:?}");
}

#[test]
fn a_quadric_under_any_matrix_is_its_exact_image() {
    let (mut r, mut seen, mut refused) = (Random::new(5), 0, 0);
    for i in 0..pairs(30) {
        let map = DMat3::from_cols(r.vector(1.0), r.vector(1.0), r.vector(1.0));
        let worst = map.inverse().to_cols_array().iter().fold(0.0f64, |s, x| s.max(x.abs()));
        if worst.is_nan() || worst >= 30.0 {
            continue;
        }
        let at = r.vector(1.0);
        let row = |k: usize| format!("[{:?}, {:?}, {:?}, {:?}]", map.row(k).x, map.row(k).y, map.row(k).z, at[k]);
        // Any form, and some of each degenerate kind.
        let mut m = [[0.0; 4]; 4];
        let general = r.chance(0.5);
        for k in 0..4 {
            for l in 0..=k {
                let v = if general || k == l { r.within(-1.0, 1.0) } else { 0.0 };
                (m[k][l], m[l][k]) = (v, v);
            }
        }
        if !general {
            let flat = r.below(3);
            (m[flat][flat], m[3][flat], m[flat][3]) = (0.0, 0.5, 0.5);
        }
        let form = |u: DVec3| {
            let x = [u.x, u.y, u.z, 1.0];
            (0..4).flat_map(|k| (0..4).map(move |l| (k, l))).map(|(k, l)| m[k][l] * x[k] * x[l]).sum::<f64>()
        };
        let call = format!("quadric(m = {m:?}, min = [-1, -1, -1], max = [1, 1, 1]);");
        let text = format!("multmatrix([{}, {}, {}, [0, 0, 0, 1]]) {{ {call} }}", row(0), row(1), row(2));
        let loaded = import_csg("a.csg", &text, Facets::Auto, &Limits::default());
        let Ok(import) = loaded else {
            refused += 1;
            // Nothing is inside, or next to nothing.
            let inside = (0..400).filter(|_| form(r.vector(1.0).clamp(-DVec3::ONE, DVec3::ONE)) < 0.0).count();
            assert!(inside < 4, "{text}: {inside}, {:?}", loaded.err());
            continue;
        };
        let (solid, back) = (&import.solid, map.inverse());
        let around = solid.aabb();
        for _ in 0..500 {
            let x = r.point_in(&around);
            let u = back * (x - at);
            let exact = form(u).max(u.abs().max_element() - 1.0);
            let f = solid.value(x);
            assert!(
                exact.abs() < 1e-10 * worst.max(1.0) || (f < 0.0) == (exact < 0.0),
                "{i}: {text} at {x}: {f}, {exact}"
            );
            seen += usize::from(f < 0.0);
        }
    }
    println!("{seen} points inside, {refused} refused");
    assert!(seen > 20 * pairs(30) && refused * 2 < pairs(30), "{seen}, {refused}");
}

#[test]
fn what_is_no_quadric_is_refused_with_a_sentence() {
    for (text, part) in [
        (
            "quadric([[1,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,-1]], [-2,-2,-2], [2,2,2]);",
            "a quadric that is none of planes",
        ),
        (
            "quadric([[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], [-2,-2,-2], [2,2,2]);",
            "a quadric that is none of planes",
        ),
        ("quadric([[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,-1]], [2,2,2], [3,3,3]);", "an inside within its box"),
        ("quadric([[1,1,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,-1]], [-2,-2,-2], [3,3,3]);", "a symmetric matrix"),
        ("quadric([[1,0],[0,1]], [-2,-2,-2], [3,3,3]);", "a symmetric matrix with 4 rows of 4 numbers"),
        ("quadric([[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,-1]], [-2,-2,-2], [3,-3,3]);", "min below max"),
        ("hyperboloid(1, 1, waist = 2);", "a waist below r"),
        ("hyperboloid(1, 1);", "either waist"),
        ("hull() { paraboloid(1, 1); sphere(1); }", "facets of a paraboloid"),
    ] {
        let refused = import_csg("a.csg", text, Facets::Auto, &Limits::default());
        let e = refused.err().unwrap_or_else(|| panic!("{text} loads")).to_string();
        assert!(e.contains(part), "{text}: {e}");
    }
    // Of no size: nothing, with a note.
    assert!(load("paraboloid(0, 1); cube(1);").primitives.len() == 1);
}

#[test]
fn shapes_of_every_kind_are_drawn() {
    let mut r = Random::new(3);
    for kind in 0..KINDS {
        let Shape::Quadric(q) = of_kind(&mut r, 1.0, kind) else { panic!("a quadric") };
        let m = Model::new(Recipe::of(q).build());
        assert!(mass_properties(&m, &MassOptions { tolerance: 0.02, boxes: 300_000 }).is_ok(), "{kind}");
    }
}
