//! Elliptic solids against closed forms, and against every other kind: first contacts, membership, regions, mass, import.
//!
//! How far an ellipsoid or an elliptic frustum reaches along a direction has a formula, and so have first contacts with planes; the
//! distance of a point from an ellipsoid is the root of one function of one number (D. Eberly, Distance from a Point to an Ellipse, an
//! Ellipsoid, or a Hyperellipsoid), and so are those with balls, from outside and from within. What follows them by a Lipschitz
//! constant shares nothing with the search. Pairs with the other kinds have no closed form: their certificates are checked by the
//! independent verifier.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers elliptics:: -- --nocapture` sets the number of
//! pairs, and of trees.

use super::kinds::{Scene, alone, at_rest, compare, pairs, past, placed, speed, turning, values_and_volumes};
use contactd::contact::{Extent, Status, Strategies};
use contactd::import::{Facets, Limits, import_csg};
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::Shape;
use contactd::solid::primitive::{Ellipsoid, EllipticFrustum};
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::certified::{certify_all, certify_trees};
use contactd_tests::engine::{ReportedPoint as _, SEARCH_ALONE, ask_with, differences};
use contactd_tests::random_solids::{Random, elliptic, shape, shape_or_elliptic};
use contactd_tests::scenes::Recipe;
use glam::{DMat3, DVec2, DVec3, dvec3};
use std::f64::consts::PI;

/// Resolutions of a gap at which a pair may count as touching: psi is up to seven times flatter than the distance.
const FLAT: f64 = 40.0;

/// Semi-axes up to 1 and down to a seventh of that.
fn semi(r: &mut Random) -> DVec3 {
    DVec3::new(r.within(0.15, 1.0), r.within(0.15, 1.0), r.within(0.15, 1.0))
}

/// How far an ellipsoid or elliptic frustum reaches along a unit vector of its frame.
fn reach(shape: &Shape, n: DVec3) -> f64 {
    match shape {
        Shape::Ellipsoid(e) => (e.semi * n).length(),
        Shape::EllipticFrustum(c) => {
            let (rim, up) = ((c.semi.x * n.x).hypot(c.semi.y * n.y), n.z + c.lean.dot(n.truncate()));
            (c.top * rim + c.half_height * up).max(c.bottom * rim - c.half_height * up)
        }
        _ => panic!("an elliptic shape"),
    }
}

/// Signed distance of a point from an ellipsoid: the nearest point is a²y/(t + a²) for the largest root t of Σ (a y/(t + a²))² = 1.
fn off_ellipsoid(semi: DVec3, y: DVec3) -> f64 {
    let (square, least) = (semi * semi, semi.min_element());
    let f = |t: f64| (semi * y / (t + square)).length() - 1.0;
    let (mut low, mut high) = (-least * least, (semi * y).length());
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if f(middle) > 0.0 { low = middle } else { high = middle }
    }
    // y less the nearest point is t y/(t + a²).
    (y * high / (high + square)).length().copysign(high)
}

#[test]
fn elliptic_solids_meet_planes_and_balls_when_closed_forms_say_so() {
    let count = pairs(40);
    let on_plane = |r: &mut Random, shape: Shape| {
        let floor = Recipe::cuboid(8.0, 8.0, 1.0).at(0.0, 0.0, -1.0);
        let motions = [past(r, 2.5), Motion::resting(Pose::new(r.vector(0.2), r.rotation()))];
        let speed = speed(&motions, 2.2);
        let own = shape.clone();
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let n = b.rotation * DVec3::Z;
            n.dot(a.position - b.position) - reach(&own, a.rotation.inverse() * -n)
        });
        Scene { a: Recipe::of(shape), b: floor, motions, gap, speed }.above_plane()
    };
    compare("ellipsoid on a plane", (count, 1, FLAT), |r| {
        let shape = Ellipsoid { semi: semi(r) }.into();
        on_plane(r, shape)
    });
    compare("elliptic cylinder, cone or frustum on a plane", (count, 2, FLAT), |r| {
        let shape = loop {
            let shape = elliptic(r, 1.0);
            if matches!(shape, Shape::EllipticFrustum(_)) {
                break shape;
            }
        };
        on_plane(r, shape)
    });
    compare("ellipsoid and a ball", (count, 3, FLAT), |r| {
        let (semi, ball) = (semi(r), r.within(0.05, 0.6));
        let motions = [turning(r), past(r, 2.2)];
        let speed = speed(&motions, 3.5);
        let gap = Box::new(move |a: &Pose, b: &Pose| off_ellipsoid(semi, a.inverse().point(b.position)) - ball);
        Scene { a: Recipe::of(Ellipsoid { semi }), b: Recipe::sphere(ball), motions, gap, speed }
    });
    // Straight along one of its axes, where the nearest point is the end of that axis.
    compare("ellipsoid and a ball along an axis", (count, 4, FLAT), |r| {
        let (semi, ball, k) = (semi(r), r.within(0.05, 0.6), r.below(3));
        let body = r.rotation();
        let along = body * DVec3::AXES[k];
        let a = Motion { start: Pose::new(r.vector(0.5), body), velocity: r.vector(0.3), spin: DVec3::ZERO };
        let start = Pose::new(a.start.position + along * r.within(2.0, 3.0), r.rotation());
        let b = Motion { start, velocity: a.velocity - along * r.within(1.0, 4.0), spin: r.vector(2.0) };
        let motions = [a, b];
        let gap = Box::new(move |a: &Pose, b: &Pose| along.dot(b.position - a.position) - semi[k] - ball);
        Scene { a: Recipe::of(Ellipsoid { semi }), b: Recipe::sphere(ball), motions, gap, speed: speed(&motions, 0.0) }
    });
    compare("ball in an elliptic hollow", (count, 5, FLAT), |r| {
        let semi = semi(r);
        // No larger than the least radius of curvature: the ball touches in one place.
        let ball = r.within(0.2, 0.9) * semi.min_element().powi(2) / semi.max_element();
        let block = Recipe::cuboid(3.0, 3.0, 3.0).minus(Recipe::of(Ellipsoid { semi }));
        let a = turning(r);
        let at = a.start.point((semi - ball) * r.direction() * r.within(0.0, 0.7));
        let b =
            Motion { start: Pose::new(at, r.rotation()), velocity: a.velocity + r.vector(1.0), spin: r.vector(1.0) };
        let motions = [a, b];
        let speed = speed(&motions, 3.5);
        let gap = Box::new(move |a: &Pose, b: &Pose| -off_ellipsoid(semi, a.inverse().point(b.position)) - ball);
        Scene { a: block, b: Recipe::sphere(ball), motions, gap, speed }
    });
}

#[test]
fn elliptic_solids_meet_convex_bodies_in_front_of_the_search_as_in_it() {
    let count = pairs(90);
    let mut r = Random::new(0xe11);
    let (mut contacts, mut clear, mut in_front, mut apart) = (0, 0, 0, 0);
    for i in 0..count {
        let other = if r.chance(0.4) { elliptic(&mut r, 0.8) } else { shape(&mut r, 0.8) };
        let a = (alone(elliptic(&mut r, 0.8)), placed(turning(&mut r)));
        let b = (alone(other), placed(past(&mut r, 2.2)));
        let [by_search, o] = [SEARCH_ALONE, Strategies::default()]
            .map(|strategies| ask_with((&a.0, a.1), (&b.0, b.1), None, strategies));
        if [&by_search, &o].iter().any(|o| matches!(o.status(), Status::Undecided | Status::Overlap)) {
            assert!(o.status() != Status::Undecided && o.status() == by_search.status(), "{i}: {o:?}, {by_search:?}");
            continue;
        }
        apart += 1;
        in_front += usize::from(o.counters.cells == 0);
        *if o.status() == Status::Contact { &mut contacts } else { &mut clear } += 1;
        let differing = differences(&o, &by_search, a.0.radius.max(b.0.radius));
        assert!(differing.is_empty(), "{i}: {differing:?}: {o:?}, {by_search:?}");
    }
    println!("{contacts} contacts, {clear} clear, {in_front} of {apart} without a cell");
    assert!(contacts * 3 > count && in_front * 100 >= apart * 97, "{in_front} of {apart}");
}

/// Contacts of the pairs of the test before, whose first witness Newton may find on another part of the surfaces than the touch: the
/// bracket is as narrow as a resolution takes at the speed told, and not the way from one to the other.
#[test]
fn the_witness_of_an_elliptic_contact_is_next_to_its_touch() {
    let mut r = Random::new(0xe11);
    let (mut contacts, mut widest) = (0, 0.0f64);
    let wanted = pairs(90);
    for i in 0..4746.max(wanted) {
        let other = if r.chance(0.4) { elliptic(&mut r, 0.8) } else { shape(&mut r, 0.8) };
        let a = (elliptic(&mut r, 0.8), placed(turning(&mut r)));
        let b = (other, placed(past(&mut r, 2.2)));
        // The first ones, and 4,745, of which the bracket was 0.08 wide.
        if i >= wanted && i != 4745 {
            continue;
        }
        let o = ask_with((&alone(a.0), a.1), (&alone(b.0), b.1), None, Strategies::default());
        // Slow ones take a while to a resolution.
        if o.status() == Status::Contact && !o.not_continued() && o.at().normal_speed > 0.1 {
            contacts += 1;
            widest = widest.max((o.time_upper() - o.time()) * o.at().normal_speed);
            assert!((o.time_upper() - o.time()) * o.at().normal_speed < 1e-6, "{i}: {o:?}");
        }
    }
    println!("{contacts} contacts, the widest bracket {widest:.1e}");
    assert!(contacts * 2 > wanted, "{contacts}");
}

#[test]
fn certificates_of_elliptic_solids_against_every_kind_and_of_trees_with_them_hold() {
    let count = pairs(16);
    certify_all("kinds", (count, 0xe1_1195), |r| {
        let other = if r.chance(0.3) { elliptic(r, 0.8) } else { shape(r, 0.8) };
        [(alone(elliptic(r, 0.8)), placed(turning(r))), (alone(other), placed(past(r, 2.2)))]
    });
    certify_trees((count, 0xe1_1195), shape_or_elliptic);
}

#[test]
fn trees_with_elliptic_solids_have_the_values_and_the_volumes_of_an_independent_evaluation() {
    // A volume by rays takes a second: a twelfth of them in the command.
    values_and_volumes(shape_or_elliptic, (pairs(60).div_ceil(30).min(24), 3, pairs(60) * 10), [64, 41]);
}

#[test]
fn moments_of_elliptic_solids_are_those_of_their_formulas_and_of_their_halves() {
    let whole = |recipe: &Recipe, tolerance: f64| {
        mass_properties(&Model::new(recipe.build()), &MassOptions { tolerance, boxes: 300_000 }).expect("bounded")
    };
    let e = Recipe::ellipsoid(1.0, 2.0, 3.0);
    let (m, exact) = (whole(&e, 1e-6), 8.0 * PI);
    assert!(m.boxes == 0 && (m.volume - exact).abs() <= m.volume_error);
    // m/5 (b² + c²).
    for (k, i) in [(0, 13.0), (1, 10.0), (2, 5.0)] {
        assert!((m.inertia[k] - exact * i / 5.0).abs() <= 1e-11, "{m:?}");
    }
    let half = e.clone().minus(Recipe::cuboid(4.0, 4.0, 4.0).at(0.0, 0.0, 4.0));
    let leaning = EllipticFrustum {
        semi: DVec2::new(1.0, 0.5),
        bottom: 1.0,
        top: 0.5,
        half_height: 1.0,
        lean: DVec2::new(0.3, 0.2),
    };
    // ⅓ π a b h (1 + ½ + ¼).
    let frustum = PI * 0.5 * 2.0 / 3.0 * 1.75;
    let (of_frustum, leaning) = (whole(&Recipe::of(leaning.clone()), 1e-6), Recipe::of(leaning));
    assert!(of_frustum.boxes == 0 && (of_frustum.volume - frustum).abs() <= of_frustum.volume_error, "{of_frustum:?}");
    // From its apex down its parts are alike: at z = 0 it is ¾ as wide as below.
    let lower = leaning.minus(Recipe::cuboid(4.0, 4.0, 4.0).at(0.0, 0.0, 4.0));
    let lower_volume = PI * 0.5 / 3.0 * (1.0 + 0.75 + 0.5625);
    for tolerance in [0.1, 1e-2, 1e-3] {
        for (recipe, exact) in [(&half, 0.5 * exact), (&lower, lower_volume)] {
            let m = whole(recipe, tolerance);
            assert!(m.boxes > 0 && (m.volume - exact).abs() <= m.volume_error, "{m:?} {exact}");
            assert!(m.volume_error <= tolerance * exact, "{m:?}");
        }
    }
}

#[test]
fn elliptic_solids_touch_along_lines_and_at_points() {
    let floor = || Recipe::cuboid(5.0, 5.0, 1.0).at(0.0, 0.0, -1.0);
    let on_side = contactd_proto::motion::quat_of_rotation_vector(DVec3::X * (0.5 * PI));
    let tube =
        EllipticFrustum { semi: DVec2::new(2.0, 0.5), bottom: 1.0, top: 1.0, half_height: 1.5, lean: DVec2::ZERO };
    // Its z axis lies along −y, its y axis upwards.
    let found = at_rest(floor(), Recipe::of(tube.clone()), Pose::new(dvec3(0.0, 0.0, 0.5), on_side));
    assert!(found.len() == 1 && found[0].extent == Extent::Line && found[0].points.len() == 2, "{found:?}");
    for p in &found[0].points {
        assert!(p.point.x.abs() < 1e-9 && (p.point.y.abs() - 1.5).abs() < 1e-9 && p.point.z.abs() < 1e-9, "{found:?}");
    }
    assert!((found[0].normal - DVec3::Z).length() < 1e-9, "{found:?}");
    // Upright, on its elliptic end.
    let found = at_rest(floor(), Recipe::of(tube), Pose::at(dvec3(0.0, 0.0, 1.5)));
    assert!(found.len() == 1 && found[0].extent == Extent::Patch && found[0].points.len() == 8, "{found:?}");
    assert!(found[0].points.iter().all(|p| (p.point.x.hypot(4.0 * p.point.y) - 2.0).abs() < 1e-9), "{found:?}");
    let found = at_rest(floor(), Recipe::ellipsoid(1.0, 0.6, 0.3), Pose::at(dvec3(0.2, 0.1, 0.3)));
    assert!(found.len() == 1 && found[0].extent == Extent::Point, "{found:?}");
    let p = &found[0].points[0];
    assert!(
        (p.point - dvec3(0.2, 0.1, 0.0)).length() < 1e-9 && (found[0].normal - DVec3::Z).length() < 1e-9,
        "{found:?}"
    );
    // In a hole of its own shape.
    let hole = floor().minus(Recipe::of(Ellipsoid { semi: dvec3(2.0, 1.0, 0.7) }));
    let found = at_rest(hole, Recipe::ellipsoid(2.0, 1.0, 0.7), Pose::IDENTITY);
    assert!(found.len() == 1 && found[0].extent == Extent::Patch && found[0].points.len() == 8, "{found:?}");
    assert!(found[0].points.iter().all(|p| (p.point.x.hypot(2.0 * p.point.y) - 2.0).abs() < 1e-9), "{found:?}");
    // A leaning cone on its apex.
    let cone = EllipticFrustum {
        semi: DVec2::new(0.5, 0.8),
        bottom: 0.0,
        top: 1.0,
        half_height: 1.0,
        lean: DVec2::new(0.1, 0.2),
    };
    let found = at_rest(floor(), Recipe::of(cone), Pose::at(dvec3(0.1, 0.2, 1.0)));
    assert!(found.len() == 1 && found[0].extent == Extent::Point, "{found:?}");
    assert!(found[0].points[0].point.length() < 1e-9 && (found[0].normal - DVec3::Z).length() < 1e-9, "{found:?}");
}

#[test]
fn round_calls_under_any_matrix_are_their_exact_images() {
    let (mut r, mut seen) = (Random::new(5), 0);
    for i in 0..pairs(70) {
        let m = match r.below(3) {
            0 => DMat3::from_diagonal(semi(&mut r)),
            1 => {
                DMat3::from_quat(r.rotation())
                    * DMat3::from_diagonal(semi(&mut r) * 3.0)
                    * DMat3::from_quat(r.rotation())
            }
            _ => DMat3::from_cols(r.vector(1.0), r.vector(1.0), r.vector(1.0)),
        };
        let at = r.vector(1.0);
        let worst = m.inverse().to_cols_array().iter().fold(0.0f64, |s, x| s.max(x.abs()));
        if worst.is_nan() || worst >= 50.0 {
            continue;
        }
        let row = |k: usize| format!("[{:?}, {:?}, {:?}, {:?}]", m.row(k).x, m.row(k).y, m.row(k).z, at[k]);
        let (call, inside): (&str, Box<dyn Fn(DVec3) -> f64>) = match r.below(3) {
            0 => ("sphere(r = 1.5);", Box::new(|u: DVec3| u.length() - 1.5)),
            1 => (
                "cylinder(r1 = 1, r2 = 1, h = 2, center = true);",
                Box::new(|u: DVec3| (u.truncate().length() - 1.0).max(u.z.abs() - 1.0)),
            ),
            _ => (
                "cylinder(r1 = 1, r2 = 0.25, h = 2);",
                Box::new(|u: DVec3| (u.truncate().length() - (1.0 - 0.375 * u.z)).max(u.z - 2.0).max(-u.z)),
            ),
        };
        let text = format!("multmatrix([{}, {}, {}, [0, 0, 0, 1]]) {{ {call} }}", row(0), row(1), row(2));
        let import =
            import_csg("a.csg", &text, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert!(import.notes.iter().all(|n| !n.text.contains("faceted")), "{text}: {:?}", import.notes);
        let (solid, back) = (&import.solid, m.inverse());
        let (around, mut within) = (solid.aabb(), 0);
        for _ in 0..400 {
            let x = r.point_in(&around);
            let (f, exact) = (solid.value(x), inside(back * (x - at)));
            assert!(
                exact.abs() < 1e-11 * worst.max(1.0) || (f < 0.0) == (exact < 0.0),
                "{i}: {text} at {x}: {f}, {exact}"
            );
            within += usize::from(f < 0.0);
        }
        seen += within;
        let volume = match call.as_bytes()[0] {
            b's' => 4.5 * PI,
            _ if call.contains("0.25") => 2.0 * PI / 3.0 * (1.0 + 0.25 + 0.0625),
            _ => 2.0 * PI,
        } * m.determinant().abs();
        let mass = mass_properties(&Model::new(solid.clone()), &MassOptions::default()).expect("bounded");
        assert!((mass.volume - volume).abs() <= 1e-9 * volume, "{text}: {} not {volume}", mass.volume);
    }
    assert!(seen > 20 * pairs(70), "{seen} points inside");
}
