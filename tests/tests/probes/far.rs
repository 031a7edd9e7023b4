//! Points and rays from far away, and directions of every length: what rounding hides is never told as proven.

use contactd::contact::probe::{
    DEFAULT_LIMIT, PointOptions, PosedModel, Ray, RayHit, RayOptions, RayOutcome, points, rays,
};
use contactd::ipc::{Embedded, ServerConfig};
use contactd::math::random::Random;
use contactd::solid::primitive::HalfSpace;
use contactd_client::{Object, Session};
use contactd_proto::Pose;
use contactd_proto::query::{ObjectRay, RayOutcome as Outcome, Side};
use contactd_tests::models::simple;
use contactd_tests::sweep::sized;
use glam::{DVec2, DVec3};

const RAYS: RayOptions = RayOptions { depth: 0.0, limit: DEFAULT_LIMIT };

/// The signed distance of a point outside of a body, from far away: no squares.
type Distance = fn(DVec3) -> f64;

/// A session with one body at the origin.
fn of(text: &str) -> Session<Embedded> {
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    let model = session.load_model("m.csg", text).unwrap().id;
    session.add_object(Object::new("body", model)).unwrap();
    session
}

fn norm(v: DVec3) -> f64 {
    let most = v.abs().max_element();
    if most == 0.0 { 0.0 } else { most * (v / most).length() }
}

const BODIES: [(&str, Distance); 5] = [
    ("sphere(r = 1);", |x| norm(x) - 1.0),
    ("cube(size = 2, center = true);", |x| norm((x.abs() - 1.0).max(DVec3::ZERO))),
    // A foil: less than what rounding hides from afar.
    ("cube(size = [2, 2, 1e-3], center = true);", |x| norm((x.abs() - DVec3::new(1.0, 1.0, 5e-4)).max(DVec3::ZERO))),
    ("difference() { sphere(r = 1); translate([0, 0, 5]) sphere(r = 1); }", |x| norm(x) - 1.0),
    ("rotate([0, 90, 0]) cylinder(h = 4, r = 1, center = true);", |x| {
        norm(DVec3::new((x.x.abs() - 2.0).max(0.0), (norm(DVec3::new(0.0, x.y, x.z)) - 1.0).max(0.0), 0.0))
    }),
];

#[test]
fn points_however_far_are_bracketed() {
    let options = PointOptions { surface: 1e-9, tolerance: 1e-6, limit: DEFAULT_LIMIT };
    for (text, truth) in BODIES {
        let mut session = of(text);
        for power in 1..=300 {
            for way in [DVec3::X, DVec3::new(0.6, -0.8, 0.0), DVec3::new(-0.5, 0.1, 0.7), DVec3::Z] {
                let x = way * 10f64.powi(power) + DVec3::new(0.0, 0.1, 0.2);
                let told = session.points(&[x.to_array()], &options, None).unwrap()[0];
                let (d, off) = (truth(x), 1e-15 * norm(x));
                let name = format!("{text} {x:?}: {d:e} {told:?}");
                assert!(told.lower <= d + off && d - off <= told.upper && told.side == Side::Outside, "{name}");
                // 8 E, of 300 units in the last place each.
                assert!(told.is_settled && told.upper - told.lower <= 1e-6 + 8e-13 * norm(x), "{name}");
                let near = DVec3::from_array(told.nearest);
                assert!(norm(near) < 2.5 && norm(near - x) <= told.upper + off, "{name}");
            }
        }
        // The side alone.
        let options = PointOptions { tolerance: f64::INFINITY, ..options };
        for x in [1e3, 1e13, 1e160, 1e300, f64::MAX] {
            let told = session.points(&[[x, x, -x]], &options, None).unwrap()[0];
            assert!(
                told.side == Side::Outside && told.is_settled && told.lower <= 1.7321 * x,
                "{text} {x:e}: {told:?}"
            );
        }
    }
}

/// Among bodies the nearest one is told, also where the squares of its distance are no doubles.
#[test]
fn the_nearest_of_bodies_far_away_is_told() {
    let mut session = of("sphere(r = 1);");
    let model = session.load_model("n.csg", "sphere(r = 1);").unwrap().id;
    let far = Pose::at(DVec3::X * 1e100);
    let other = session.add_object(Object::new("other", model).at(far)).unwrap();
    let options = PointOptions { surface: 1e-9, tolerance: 1e-6, limit: DEFAULT_LIMIT };
    for power in 100..=114 {
        let x = 2.0 * 10f64.powi(power);
        let told = session.points(&[[x, 0.0, 0.0]], &options, None).unwrap()[0];
        let is_told = told.object == Some(other) || x - 1e100 > x * (1.0 - 1e-12);
        assert!(is_told && told.lower <= x - 1e100 && x - 1e100 <= told.upper, "{x:e}: {told:?}");
    }
    for power in 150..=300 {
        let x = 10f64.powi(power);
        let told = session.points(&[[x, 0.0, 0.0]], &options, None).unwrap()[0];
        assert!(told.lower <= x && x <= told.upper && told.is_settled, "{x:e}: {told:?}");
    }
}

/// A part at a sharp edge is as shallow as rounding once it is as small: it counts all the same.
#[test]
fn points_far_above_rims_are_bracketed() {
    let mut r = Random(20);
    let (mut asked, mut settled) = (0, 0);
    for _ in 0..sized("CONTACTD_PROBE_WORLDS", 4usize) {
        let (radius, height) = (r.within(0.3, 1.0), r.within(0.2, 0.6));
        let text = format!("cylinder(r1 = {radius:?}, r2 = 0, h = {height:?});");
        let mut session = of(&text);
        for power in 2..=8 {
            for _ in 0..6 {
                let way = r.vector(1.0);
                let x = DVec3::new(way.x, way.y, way.z.abs()).normalize() * 10f64.powi(power);
                // The rim, the side and the base, in the half-plane of the point.
                let p = DVec2::new(x.truncate().length(), x.z);
                let of_edge = |a: DVec2, b: DVec2| {
                    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                    p.distance(a + (b - a) * t)
                };
                let (rim, tip) = (DVec2::new(radius, 0.0), DVec2::new(0.0, height));
                let d = of_edge(rim, tip).min(of_edge(DVec2::ZERO, rim));
                let options = PointOptions { surface: 0.0, tolerance: 1e-9, limit: 20_000 };
                let told = session.points(&[x.to_array()], &options, None).unwrap()[0];
                let off = 4.0 * f64::EPSILON * x.length();
                assert!(told.lower <= d + off && d - off <= told.upper, "{text} {x:?}: {d:e} {told:?}");
                (asked, settled) = (asked + 1, settled + u32::from(told.is_settled));
            }
        }
    }
    println!("{settled} of {asked} settled");
}

/// What is near is not hidden by what rounding does far along a ray.
#[test]
fn long_rays_meet_a_floor_where_it_is() {
    let model = simple(HalfSpace);
    let floor = PosedModel { model: &model, pose: Pose::IDENTITY };
    let ask = |z: f64, direction: DVec3, length: f64| {
        let ray = Ray { origin: DVec3::new(5.0, 1.0, z), direction, length };
        rays(&floor, &[ray], &RAYS)[0].outcome
    };
    for length in [100.0, 1e6, 1e12, 1e14, 1e19, 1e150, f64::INFINITY] {
        // From above, from three below upwards, and at a flat angle.
        let flat = DVec3::new(1.0, 0.0, -0.01).normalize();
        for (z, direction, t) in [(10.0, -DVec3::Z, 10.0), (-3.0, DVec3::Z, 3.0), (0.01, flat, -0.01 / flat.z)] {
            let told = ask(z, direction, length);
            let is_right = |hit: RayHit| {
                hit.is_leaving == (z < 0.0) && (hit.t - t).abs() < 1e-12 && hit.lower > t - 1e-7 && hit.upper < t + 1e-7
            };
            assert!(matches!(told, RayOutcome::Hit(hit) if is_right(hit)), "{length:e} from {z}: {told:?}");
        }
        // Away from it, and along it within it: no end of it is met as far as anything can be told.
        for (z, direction) in [(10.0, DVec3::Z), (-3.0, DVec3::X), (-3.0, -DVec3::Z)] {
            let is_right = match ask(z, direction, length) {
                RayOutcome::Miss { is_inside } => is_inside == (z < 0.0),
                RayOutcome::Undecided { until } => length > 1e10 && until > 1e10,
                RayOutcome::Hit(_) => false,
            };
            assert!(is_right, "{length:e} from {z} along {direction}");
        }
    }
}

#[test]
fn a_distance_that_is_no_double_has_no_upper_bound() {
    let mut session = of("cube(1);");
    let told = session.points(&[[f64::MAX; 3]], &PointOptions::default(), None).unwrap()[0];
    assert!(
        told.lower > 1e308 && told.lower.is_finite() && told.upper == f64::INFINITY && !told.is_settled,
        "{told:?}"
    );
}

/// Of a solid without bounds nothing is told from where squares are no doubles.
#[test]
fn points_far_from_a_half_space_are_bracketed_or_nothing_is_told() {
    let model = simple(HalfSpace);
    let options = PointOptions { surface: 1e-9, tolerance: 1e-6, limit: DEFAULT_LIMIT };
    for power in 1..=300 {
        let z = 10f64.powi(power);
        let told = points(&PosedModel { model: &model, pose: Pose::IDENTITY }, &[DVec3::new(3.0, 1.0, z)], &options)[0];
        assert!(told.lower <= z && z <= told.upper && told.is_settled == (power < 150), "{z:e}: {told:?}");
    }
}

#[test]
fn rays_however_far_are_no_false_misses() {
    for (k, text) in ["sphere(r = 1);", "cube(size = 2, center = true);"].into_iter().enumerate() {
        let mut session = of(text);
        let mut hits = 0;
        for power in 1..=300 {
            for start in [1.0, 2.0, 5.0] {
                let x = start * 10f64.powi(power);
                let mut cast = |y: f64| {
                    let ray = ObjectRay { origin: [x, y, 0.0], direction: [-1.0, 0.0, 0.0], length: f64::INFINITY };
                    session.rays(&[ray], &RAYS, None).unwrap()[0].outcome
                };
                // Through the middle: x − 1 off.
                match cast(0.0) {
                    Outcome::Hit(hit) => {
                        hits += 1;
                        let slack = 1e-12 * x;
                        assert!(hit.lower <= x - 1.0 + slack && x - 1.0 <= hit.upper + slack, "{text} {x:e}: {hit:?}");
                        assert!(hit.upper <= x + 2.0 && hit.lower <= hit.t && hit.t <= hit.upper, "{text} {x:e}");
                    }
                    Outcome::Undecided { until } => {
                        assert!(until <= x && x > 1e13, "{text} {x:e}: {until:e}");
                    }
                    Outcome::Miss { .. } => panic!("{text} {x:e}: a miss through the middle"),
                }
                // Far beside it.
                assert_eq!(cast(0.2 * x + 2.0), Outcome::Miss { is_inside: false }, "{text} {x:e}");
                // Beside the ball, within its box.
                if k == 0 && x <= 1e9 {
                    let ray = ObjectRay { origin: [x, 0.8, 0.8], direction: [-1.0, 0.0, 0.0], length: f64::INFINITY };
                    let told = session.rays(&[ray], &RAYS, None).unwrap()[0].outcome;
                    assert_eq!(told, Outcome::Miss { is_inside: false }, "{x:e}");
                }
            }
        }
        println!("{text} {hits} hits");
        assert!(hits >= 39, "{text}: {hits}");
    }
}

#[test]
fn directions_have_any_length_but_none() {
    let mut session = of("sphere(r = 1);");
    let ways = [([9.0, 0.0, 0.0], DVec3::new(-1.0, 0.0, 0.0)), ([9.0, 3.0, 0.0], DVec3::new(-0.75, -0.25, 0.0))];
    for (origin, way) in ways {
        let from = DVec3::from_array(origin).length() - 1.0;
        for power in -323..=308 {
            let direction = way * format!("1e{power}").parse::<f64>().unwrap();
            // Of the smallest numbers no digits are left to point anywhere.
            if power < -300 && way.y != 0.0 {
                continue;
            }
            let ray = ObjectRay { origin, direction: direction.to_array(), length: f64::INFINITY };
            let told = session.rays(&[ray], &RAYS, None).unwrap()[0].outcome;
            let Outcome::Hit(hit) = told else { panic!("{direction:?}: {told:?}") };
            assert!((hit.t - from).abs() < 1e-12 && hit.lower <= from && from <= hit.upper, "{direction:?}: {hit:?}");
        }
    }
    for (direction, length, end) in [
        (DVec3::ZERO, 1.0, "a ray cannot go along [0, 0, 0]"),
        (DVec3::X, -1e300, "a ray's length must be >= 0, not -1e300"),
    ] {
        let ray = ObjectRay { origin: [9.0, 0.0, 0.0], direction: direction.to_array(), length };
        let told = session.rays(&[ray], &RAYS, None).unwrap_err().to_string();
        assert!(told.ends_with(end), "{told}");
    }
    let ray = ObjectRay { origin: [1e300, f64::NAN, 0.0], direction: [1.0, 0.0, 0.0], length: 1.0 };
    let told = session.rays(&[ray], &RAYS, None).unwrap_err().to_string();
    assert!(told.ends_with("the ray from [1e300, NaN, 0] along [1, 0, 0]"), "{told}");
}
