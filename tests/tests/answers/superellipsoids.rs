//! Superellipsoids against closed forms, against the solids that they lie between, and against every other kind.
//!
//! How far one reaches along a direction is a dual norm, so first contacts with planes have a formula, which followed by a Lipschitz constant shares
//! nothing with the search. With both exponents 1 it is an ellipsoid, of which there is another kind. Any of them lies within the box of its
//! semi-axes, and around a smaller one whose corners are on it: so do its first contacts. Pairs with the other kinds have no closed form: what
//! is told in front of the search is told by it, too, and their certificates are checked by the independent verifier.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers superellipsoids:: -- --nocapture` sets the
//! number of pairs, and of trees.

use super::kinds::{Scene, alone, at_rest, compare, pairs, past, placed, speed, turning, values_and_volumes};
use super::planes::reach_of_superellipsoid;
use contactd::contact::{Extent, Status, Strategies};
use contactd::import::{Facets, Limits, import_csg};
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::Shape;
use contactd::solid::primitive::{Cuboid, Ellipsoid, Geometry as _, HalfSpace, Superellipsoid};
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::certified::{certify_all, certify_trees};
use contactd_tests::engine::{ReportedPoint as _, SEARCH_ALONE, ask_with, differences};
use contactd_tests::random_solids::{Random, shape, shape_or_superellipsoid, superellipsoid};
use contactd_tests::scenes::Recipe;
use glam::{DMat3, DVec2, DVec3, dvec3};
use std::f64::consts::PI;

/// Resolutions of a gap at which a pair may count as touching: psi is up to twelve times flatter than the distance.
const FLAT: f64 = 60.0;

/// (|x/a|^(2/e₂) + |y/b|^(2/e₂))^(e₂/e₁) + |z/c|^(2/e₁), written down as it stands.
fn level(s: &Superellipsoid, x: DVec3) -> f64 {
    let [x, y, z] = (x / s.semi).abs().to_array();
    let (e, f) = (s.exponents.x, s.exponents.y);
    (x.powf(2.0 / f) + y.powf(2.0 / f)).powf(f / e) + z.powf(2.0 / e)
}

#[test]
fn superellipsoids_meet_planes_and_balls_when_closed_forms_say_so() {
    let count = pairs(40);
    let above = |r: &mut Random, floor: Recipe| {
        let s = superellipsoid(r, 1.0);
        let motions = [past(r, 2.5), Motion::resting(Pose::new(r.vector(0.2), r.rotation()))];
        let speed = speed(&motions, 2.2);
        let own = s.clone();
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let n = b.rotation * DVec3::Z;
            n.dot(a.position - b.position) - reach_of_superellipsoid(own.semi, own.exponents, a.rotation.inverse() * -n)
        });
        Scene { a: Recipe::of(s), b: floor, motions, gap, speed }.above_plane()
    };
    compare("superellipsoid on a box", (count, 1, FLAT), |r| {
        above(r, Recipe::cuboid(8.0, 8.0, 1.0).at(0.0, 0.0, -1.0))
    });
    compare("superellipsoid on a half-space", (count, 2, FLAT), |r| above(r, Recipe::of(HalfSpace)));
    // Straight along one of its axes, where the nearest point is the end of that axis.
    compare("superellipsoid and a ball along an axis", (count, 3, FLAT), |r| {
        let (s, ball, k) = (superellipsoid(r, 1.0), r.within(0.05, 0.6), r.below(3));
        let (body, semi) = (r.rotation(), s.semi);
        let along = body * DVec3::AXES[k];
        let a = Motion { start: Pose::new(r.vector(0.5), body), velocity: r.vector(0.3), spin: DVec3::ZERO };
        let start = Pose::new(a.start.position + along * r.within(2.0, 3.0), r.rotation());
        let b = Motion { start, velocity: a.velocity - along * r.within(1.0, 4.0), spin: r.vector(2.0) };
        let motions = [a, b];
        let gap = Box::new(move |a: &Pose, b: &Pose| along.dot(b.position - a.position) - semi[k] - ball);
        Scene { a: Recipe::of(s), b: Recipe::sphere(ball), motions, gap, speed: speed(&motions, 0.0) }
    });
    // Within a hollow of its shape, along an axis.
    compare("ball in a hollow along an axis", (count.div_ceil(4), 4, FLAT), |r| {
        let (s, k) = (superellipsoid(r, 1.0), r.below(3));
        // As small as the smallest radius of curvature of what is about as sharp as a superellipsoid gets.
        let ball = 0.2 * s.semi.min_element().powi(2) / s.semi.max_element();
        let (body, semi) = (r.rotation(), s.semi);
        let along = body * DVec3::AXES[k];
        let a = Motion { start: Pose::new(r.vector(0.5), body), velocity: r.vector(0.3), spin: DVec3::ZERO };
        let velocity = a.velocity + along * r.within(0.5, 4.0);
        let b = Motion { start: Pose::new(a.start.position, r.rotation()), velocity, spin: r.vector(2.0) };
        let motions = [a, b];
        let gap = Box::new(move |a: &Pose, b: &Pose| semi[k] - along.dot(b.position - a.position) - ball);
        let block = Recipe::cuboid(3.0, 3.0, 3.0).minus(Recipe::of(s));
        Scene { a: block, b: Recipe::sphere(ball), motions, gap, speed: speed(&motions, 0.0) }
    });
}

#[test]
fn with_exponents_1_they_are_ellipsoids() {
    let (mut r, mut contacts, mut worst) = (Random::new(0x0e11), 0, 0.0f64);
    let count = pairs(70);
    for i in 0..count {
        let s = Superellipsoid { exponents: DVec2::ONE, ..superellipsoid(&mut r, 0.8) };
        let other = alone(shape(&mut r, 0.8));
        let (block, hollow) = (Recipe::cuboid(3.0, 3.0, 3.0), r.chance(0.3));
        let of = |shape: Shape| {
            let one = Recipe::of(shape);
            Model::new(if hollow { block.clone().minus(one) } else { one }.build())
        };
        let both = [of(s.clone().into()), of(Ellipsoid { semi: s.semi }.into())];
        let (a, b) = (turning(&mut r), past(&mut r, if hollow { 0.2 } else { 2.2 }));
        let [one, two] = both.map(|m| ask_with((&m, placed(a)), (&other, placed(b)), None, Strategies::default()));
        assert_eq!(one.status(), two.status(), "{i}: {one:?} {two:?}");
        if one.status() == Status::Contact && !one.not_continued() && !two.not_continued() {
            let off = (one.time() - two.time()).abs() * one.at().normal_speed.abs();
            worst = worst.max(off);
            assert!(off <= 1e-12, "{i}: {off:e}: {one:?} {two:?}");
            contacts += 1;
        }
    }
    println!("{contacts} contacts of {count}, worst {worst:.1e}");
    assert!(contacts * 4 > count, "{contacts}");
}

#[test]
fn their_first_contacts_lie_between_those_of_the_boxes_around_and_in_them() {
    let (mut r, mut between, mut closest) = (Random::new(0xb0c5), 0, f64::INFINITY);
    let count = pairs(70);
    for i in 0..count {
        let mut s = superellipsoid(&mut r, 0.8);
        if r.chance(0.5) {
            s.exponents = DVec2::new(0.1, 0.1);
        }
        // The corner of the box within, on the surface.
        let inner = s.semi / level(&s, s.semi).powf(0.5 * s.exponents.x);
        let other = alone(shape(&mut r, 0.8));
        let (a, b) = (turning(&mut r), past(&mut r, 2.2));
        let ask = |shape: Shape| ask_with((&alone(shape), placed(a)), (&other, placed(b)), None, Strategies::default());
        let all = [
            ask(Cuboid { half: s.semi }.into()),
            ask(s.clone().into()),
            ask(Cuboid { half: inner * (1.0 - 1e-6) }.into()),
        ];
        if all.iter().any(|o| matches!(o.status(), Status::Overlap | Status::Undecided)) {
            assert!(all[1].status() != Status::Undecided, "{i}: {all:?}");
            continue;
        }
        // What is told is δ deep at the latest in the bracket, and psi is flatter than the distance.
        let late = |o: &contactd::contact::Outcome| if o.status() == Status::Clear { 2.0 } else { o.time() };
        let slack = 1e-6;
        assert!(late(&all[0]) <= late(&all[1]) + slack && late(&all[1]) <= late(&all[2]) + slack, "{i}: {all:?}");
        if all.iter().all(|o| o.status() == Status::Contact) {
            between += 1;
            closest = closest.min(late(&all[2]) - late(&all[0]));
        }
    }
    println!("{between} of {count} between two contacts, the closest {closest:.1e} apart");
    assert!(between * 4 > count, "{between}");
}

#[test]
fn superellipsoids_meet_convex_bodies_in_front_of_the_search_as_in_it() {
    let count = pairs(70);
    let mut r = Random::new(0x5e11);
    let (mut contacts, mut clear, mut in_front, mut apart, mut cells, mut most) = (0, 0, 0, 0, 0, 0);
    for i in 0..count {
        let other = if r.chance(0.4) { superellipsoid(&mut r, 0.8).into() } else { shape(&mut r, 0.8) };
        let a = (alone(superellipsoid(&mut r, 0.8)), placed(turning(&mut r)));
        let b = (alone(other), placed(past(&mut r, 2.2)));
        let [by_search, o] = [SEARCH_ALONE, Strategies::default()]
            .map(|strategies| ask_with((&a.0, a.1), (&b.0, b.1), None, strategies));
        if [&by_search, &o].iter().any(|o| matches!(o.status(), Status::Undecided | Status::Overlap)) {
            assert!(o.status() != Status::Undecided && o.status() == by_search.status(), "{i}: {o:?}, {by_search:?}");
            continue;
        }
        apart += 1;
        cells += by_search.counters.cells;
        most = most.max(by_search.counters.cells);
        in_front += usize::from(o.counters.cells == 0);
        *if o.status() == Status::Contact { &mut contacts } else { &mut clear } += 1;
        let differing = differences(&o, &by_search, a.0.radius.max(b.0.radius));
        assert!(differing.is_empty(), "{i}: {differing:?}: {o:?}, {by_search:?}");
    }
    println!(
        "{contacts} contacts, {clear} clear, {in_front} of {apart} without a cell; the search alone takes {} cells each, {most} at most",
        cells / apart.max(1) as u64
    );
    assert!(contacts * 3 > count && in_front * 100 >= apart * 95, "{in_front} of {apart}");
}

#[test]
fn certificates_of_superellipsoids_against_every_kind_and_of_trees_with_them_hold() {
    let count = pairs(12);
    certify_all("kinds", (count, 0x5e_1195), |r| {
        let other = if r.chance(0.3) { superellipsoid(r, 0.8).into() } else { shape(r, 0.8) };
        [(alone(superellipsoid(r, 0.8)), placed(turning(r))), (alone(other), placed(past(r, 2.2)))]
    });
    certify_trees((count, 0x5e_1195), shape_or_superellipsoid);
}

#[test]
fn trees_with_superellipsoids_have_the_values_and_the_volumes_of_an_independent_evaluation() {
    values_and_volumes(
        shape_or_superellipsoid,
        (pairs(60).div_ceil(30).min(24), if pairs(60) > 60 { 3 } else { 2 }, pairs(60) * 5),
        [56, 37],
    );
}

#[test]
fn a_superellipsoid_holds_the_points_of_its_inequality_and_f_is_small_at_its_surface_alone() {
    let (mut r, mut inside, mut near, mut looked) = (Random::new(29), 0, 0, 0);
    for i in 0..pairs(60) {
        let s = superellipsoid(&mut r, 1.0);
        let pose = Pose::new(r.vector(1.0), r.rotation());
        let solid = Recipe::of(s.clone()).moved(&pose).build();
        let around = solid.aabb().grown(0.2);
        // No farther from the surface than so many times |f|.
        let flattest = 1.01 * s.ball().radius / s.semi.min_element();
        for _ in 0..100 {
            let x = r.point_in(&around);
            let (f, own) = (solid.value(x), pose.inverse().point(x));
            let exact = level(&s, own) - 1.0;
            assert!(exact.abs() < 1e-11 || (f < 0.0) == (exact < 0.0), "{i}: {s:?} at {x}: {f}, {exact}");
            inside += usize::from(f < 0.0);
            looked += 1;
            // A ball of the radius |f| is all on one side, and on the way from the centre the surface is near.
            let y = x + r.direction() * (f.abs() * r.within(0.9, 0.999_999));
            assert!(solid.value(y) * f >= 0.0, "{i}: {f} at {x}");
            let out = own.normalize() * (1.0f64).copysign(-f);
            let way = if f > 0.0 { (f * flattest).min(own.length()) } else { -f * flattest };
            let beyond = pose.point(own + out * way);
            assert!(solid.value(beyond) * f <= 0.0, "{i}: {s:?}: {f} at {x}, and no surface near");
            near += usize::from(f.abs() < 0.01);
        }
    }
    println!("{looked} points, {inside} inside, {near} within a hundredth of psi");
    assert!(inside * 5 > looked && near > looked / 200, "{inside} {near}");
}

#[test]
fn moments_of_superellipsoids_are_those_of_their_formulas_and_of_their_halves() {
    let whole = |recipe: &Recipe, tolerance: f64| {
        mass_properties(&Model::new(recipe.build()), &MassOptions { tolerance, boxes: 300_000 }).expect("bounded")
    };
    let of = |e: f64, f: f64| Recipe::of(Superellipsoid { semi: dvec3(1.0, 2.0, 3.0), exponents: DVec2::new(e, f) });
    let ball = whole(&of(1.0, 1.0), 1e-6);
    assert!(ball.boxes == 0 && (ball.volume - 8.0 * PI).abs() <= ball.volume_error, "{ball:?}");
    for (k, i) in [(0, 13.0), (1, 10.0), (2, 5.0)] {
        assert!((ball.inertia[k] - 8.0 * PI * i / 5.0).abs() <= 1e-11, "{ball:?}");
    }
    // Γ(1 + k/4) of k = 1, 2, 3: |x|⁴ + |y|⁴ <= 1 has the area 4 Γ(5/4)²/Γ(3/2).
    let [one, two, three] = [0.906_402_477_055_477, 0.886_226_925_452_758, 0.919_062_526_848_883_4];
    let quartic = whole(&of(0.5, 0.5), 1e-6);
    let exact = 48.0 * (one * one / two) * (one * two / three);
    assert!((quartic.volume - exact).abs() <= quartic.volume_error + 1e-13 * exact, "{quartic:?} {exact}");
    for (e, f) in [(0.5, 0.5), (0.2, 1.0), (1.0, 0.1), (0.7, 0.3)] {
        let exact = whole(&of(e, f), 1e-6);
        assert_eq!(exact.boxes, 0);
        let half = of(e, f).minus(Recipe::cuboid(4.0, 4.0, 4.0).at(0.0, 0.0, 4.0));
        // The volumes of what is flat in both directions converge slowest: one of them to the last.
        let tolerances = [0.1, 1e-2, 1e-3];
        for &tolerance in &tolerances[..if e == f { 3 } else { 2 }] {
            let m = whole(&half, tolerance);
            assert!(m.boxes > 0 && (m.volume - 0.5 * exact.volume).abs() <= m.volume_error, "{m:?} {exact:?}");
            assert!(m.volume_error <= tolerance * exact.volume, "{m:?}");
        }
    }
}

#[test]
fn superellipsoids_touch_at_points_and_in_hollows_of_their_shape() {
    let floor = || Recipe::cuboid(5.0, 5.0, 1.0).at(0.0, 0.0, -1.0);
    let of = |e: f64, f: f64| Recipe::of(Superellipsoid { semi: dvec3(1.0, 0.6, 0.3), exponents: DVec2::new(e, f) });
    for (e, f) in [(1.0, 0.3), (0.6, 0.6), (0.9, 0.2)] {
        let found = at_rest(floor(), of(e, f), Pose::at(dvec3(0.2, 0.1, 0.3)));
        assert!(found.len() == 1 && found[0].extent == Extent::Point, "{e} {f}: {found:?}");
        let p = found[0].points[0].point;
        // Where it is flat all of what is next to the middle touches.
        assert!(p.z.abs() < 1e-8 && (p - dvec3(0.2, 0.1, 0.0)).length() < 0.05, "{e} {f}: {found:?}");
        assert!((found[0].normal - DVec3::Z).length() < 1e-6, "{e} {f}: {found:?}");
        let found = at_rest(floor().minus(of(e, f)), of(e, f), Pose::IDENTITY);
        assert!(found.len() == 1 && found[0].extent == Extent::Patch, "{e} {f}: {found:?}");
    }
}

fn read(text: &str) -> Result<contactd::import::Import, String> {
    import_csg("a.csg", text, Facets::Auto, &Limits::default()).map_err(|e| e.to_string())
}

#[test]
fn a_call_under_a_matrix_along_its_axes_is_its_exact_image_and_others_are_refused() {
    let (mut r, mut seen) = (Random::new(7), 0);
    for i in 0..pairs(30) {
        let s = superellipsoid(&mut r, 1.0);
        let (scale, turn) = (r.vector(1.0).abs() + 0.3, DMat3::from_quat(r.rotation()));
        let map = turn * DMat3::from_diagonal(if r.chance(0.3) { -scale } else { scale });
        let at = r.vector(1.0);
        let row = |k: usize| format!("[{:?}, {:?}, {:?}, {:?}]", map.row(k).x, map.row(k).y, map.row(k).z, at[k]);
        let (a, e) = (s.semi, s.exponents);
        let call = format!("superellipsoid(r = [{:?}, {:?}, {:?}], e = [{:?}, {:?}]);", a.x, a.y, a.z, e.x, e.y);
        let text = format!("multmatrix([{}, {}, {}, [0, 0, 0, 1]]) {{ {call} }}", row(0), row(1), row(2));
        let import = read(&text).unwrap_or_else(|e| panic!("{e}"));
        assert!(import.notes.is_empty(), "{:?}", import.notes);
        let (around, back) = (import.solid.aabb(), map.inverse());
        for _ in 0..200 {
            let x = r.point_in(&around);
            let (f, exact) = (import.solid.value(x), level(&s, back * (x - at)) - 1.0);
            assert!(exact.abs() < 1e-10 || (f < 0.0) == (exact < 0.0), "{i}: {text} at {x}: {f}, {exact}");
            seen += usize::from(f < 0.0);
        }
    }
    assert!(seen > 20 * pairs(30), "{seen}");
    for (text, part) in [
        ("superellipsoid(r = [1, 1, 1], e = [1.5, 1]);", "exponents from 0.1 to 1"),
        ("superellipsoid(r = [1, 1, 1], e = [1, 0.05]);", "exponents from 0.1 to 1"),
        ("superellipsoid(r = [1, 1, 1], e = [1, 1, 1]);", "two numbers as e"),
        ("superellipsoid(r = [1, 1], e = 1);", "three positive numbers as r"),
        ("superellipsoid(r = 1);", "two numbers as e of superellipsoid"),
        ("superellipsoid(r = [1, inf, 1], e = 1);", "finite radii"),
        (
            "multmatrix([[1,0.5,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) { superellipsoid(r = 1, e = 0.5); }",
            "shear on a superellipsoid",
        ),
    ] {
        let e = read(text).err().unwrap_or_else(|| panic!("{text} loads"));
        assert!(e.contains(part), "{text}: {e}");
    }
    assert_eq!(read("superellipsoid(r = 0, e = 1); cube(1);").expect("a cube").solid.primitives.len(), 1);
    // What has no exact form takes its pieces.
    let hull = read("hull() { superellipsoid(r = [1, 2, 3], e = [0.5, 0.3]); cube(4); }").expect("a hull");
    assert!(hull.notes.iter().any(|n| n.text.contains("faceted")), "{:?}", hull.notes);
    let own = alone(Superellipsoid { semi: dvec3(1.0, 2.0, 3.0), exponents: DVec2::new(0.5, 0.3) });
    let faceted = read("hull() { superellipsoid(r = [1, 2, 3], e = [0.5, 0.3]); }").expect("a hull").solid;
    let [exact, pieces] =
        [own, Model::new(faceted)].map(|m| mass_properties(&m, &MassOptions::default()).expect("bounded").volume);
    assert!(pieces <= exact * (1.0 + 1e-9) && pieces > 0.95 * exact, "{pieces} of {exact}");
}
