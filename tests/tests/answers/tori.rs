//! Tori against closed forms, and against every other kind: first contacts, membership, regions, mass.
//!
//! A point's distance from a torus is that from its circle less r, so first contacts with balls, planes and spherical walls are
//! roots of one function of time, which is followed here by its Lipschitz constant and shares nothing with the search. Pairs with the other
//! kinds have no closed form: their certificates are checked by the independent verifier.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers tori:: -- --nocapture` sets the number of
//! pairs, and of trees.

use contactd::contact::region::{regions, threshold};
use contactd::contact::{Extent, QueryOptions, Scratch, Status, earliest_contact};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::Shape;
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::certified::{certify_all, certify_trees};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::engine::question;
use contactd_tests::random_solids::{Random, shape, shape_or_torus, solid_of, torus};
use contactd_tests::rays::integrals;
use contactd_tests::reference::field::Field;
use contactd_tests::scenes::Recipe;
use glam::{DVec3, dvec3};
use std::f64::consts::PI;

fn pairs(default: usize) -> usize {
    std::env::var("CONTACTD_PAIRS").ok().map_or(default, |n| n.parse().expect("a number of pairs"))
}

/// Two bodies, how far they are from touching at a pose of each, and how fast that may change.
struct Scene {
    a: Recipe,
    b: Recipe,
    motions: [Motion; 2],
    gap: Box<dyn Fn(&Pose, &Pose) -> f64>,
    speed: f64,
}

/// Distance from the circle of a torus about the z axis of a pose.
fn from_circle(pose: &Pose, major: f64, x: DVec3) -> f64 {
    let o = pose.inverse().point(x);
    (o.x.hypot(o.y) - major).hypot(o.z)
}

impl Scene {
    fn at(&self, t: f64) -> f64 {
        (self.gap)(&self.motions[0].at(t), &self.motions[1].at(t))
    }

    /// The first time at which the gap is closed; how fast it closes then.
    fn first(&self) -> Option<(f64, f64)> {
        let mut t = 0.0;
        loop {
            let gap = self.at(t);
            if gap <= 1e-15 {
                let h = 1e-6;
                return Some((t, (self.at(t - h) - self.at(t + h)) / (2.0 * h)));
            }
            t += gap / self.speed;
            if t > 1.0 {
                return None;
            }
        }
    }
}

/// A motion from a place next to the origin past it.
fn past(r: &mut Random, from: f64) -> Motion {
    let start = r.direction() * from;
    let aim = r.vector(0.7);
    let spin = if r.chance(0.3) { DVec3::ZERO } else { r.vector(1.5) };
    Motion { start: Pose::new(start, r.rotation()), velocity: (aim - start) * r.within(0.8, 1.6), spin }
}

fn turning(r: &mut Random) -> Motion {
    let spin = if r.chance(0.3) { DVec3::ZERO } else { r.vector(1.0) };
    Motion { start: Pose::new(DVec3::ZERO, r.rotation()), velocity: r.vector(0.3), spin }
}

fn speed(motions: &[Motion; 2], reach: f64) -> f64 {
    let [a, b] = motions;
    (a.velocity - b.velocity).length() + (a.spin.length() + b.spin.length()) * reach
}

/// Asks about scenes and compares with the closed form, to 1e-12 of the size.
fn compare(name: &str, count: usize, seed: u64, make: impl Fn(&mut Random) -> Scene) {
    let mut r = Random::new(seed);
    let (mut contacts, mut clear, mut overlap, mut undecided, mut worst, mut cells) = (0, 0, 0, 0, 0.0f64, 0);
    let mut flagged = 0;
    for i in 0..count {
        let s = make(&mut r);
        let (a, b) = (Model::new(s.a.build()), Model::new(s.b.build()));
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let query = question((&a, placed(s.motions[0])), (&b, placed(s.motions[1])), QueryOptions::DEPTH);
        let o = earliest_contact(&query, &mut Scratch::default());
        let size = query.resolution / 1e-9;
        cells += o.counters.cells;
        if s.at(0.0) <= 4.0 * query.resolution {
            assert!(s.at(0.0) > 0.0 || o.status() != Status::Clear, "{name} {i}: {o:?}");
            overlap += 1;
            continue;
        }
        match (s.first(), o.status()) {
            (_, Status::Undecided) => undecided += 1,
            (None, Status::Clear) => clear += 1,
            (Some((t, speed)), Status::Contact) => {
                contacts += 1;
                assert!(
                    o.time_lower() <= t + 1e-12 * size / speed.max(1e-9),
                    "{name} {i}: {t} before {}",
                    o.time_lower()
                );
                if o.not_continued() {
                    flagged += 1;
                    continue;
                }
                let off = (t - o.time()).abs() * speed.abs().max(o.at().normal_speed.abs()) / size;
                worst = worst.max(off);
                assert!(off <= 1e-12, "{name} {i}: {off:e}: {t} at {speed}, not {o:?}");
            }
            // A graze within the depth at which contacts are decided is none.
            (Some((t, speed)), Status::Clear) => assert!(speed.abs() < 1e-3, "{name} {i}: missed at {t}, {speed}"),
            (found, _) => panic!("{name} {i}: {found:?}, not {o:?}"),
        }
    }
    println!(
        "{name}: {contacts} contacts, {clear} clear, {overlap} overlap, {undecided} undecided, {flagged} not continued; worst {worst:.1e}; \
         {} cells each",
        cells / count as u64
    );
    assert!(contacts * 5 > count && undecided * 100 <= count && flagged * 100 <= count, "{name}");
}

#[test]
fn a_torus_meets_a_ball_and_a_plane_and_leaves_round_walls_when_closed_forms_say_so() {
    let count = pairs(150);
    compare("ball", count, 1, |r| {
        let (t, ball) = (torus(r, 1.0), r.within(0.05, 0.6));
        let motions = [turning(r), past(r, 2.0)];
        let (major, least) = (t.major, t.minor + ball);
        let speed = speed(&motions, 4.0);
        let gap = Box::new(move |a: &Pose, b: &Pose| from_circle(a, major, b.position) - least);
        Scene { a: Recipe::of(t), b: Recipe::sphere(ball), motions, gap, speed }
    });
    compare("plane", count, 2, |r| {
        let t = torus(r, 1.0);
        let floor = Recipe::cuboid(8.0, 8.0, 1.0).at(0.0, 0.0, -1.0);
        let motions = [past(r, 2.5), Motion::resting(Pose::new(r.vector(0.2), r.rotation()))];
        let (major, minor) = (t.major, t.minor);
        let speed = speed(&motions, 2.0);
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let n = b.rotation * DVec3::Z;
            let lean = (a.rotation * DVec3::Z).cross(n).length();
            n.dot(a.position - b.position) - major * lean - minor
        });
        let s = Scene { a: Recipe::of(t), b: floor, motions, gap, speed };
        // From the other side of the floor: turned over.
        if s.at(0.0) > 0.0 {
            return s;
        }
        let [mut a, b] = s.motions;
        let n = b.start.rotation * DVec3::Z;
        let mirrored = |v: DVec3| v - n * (2.0 * n.dot(v));
        a.start.position = mirrored(a.start.position - b.start.position) + b.start.position;
        a.velocity = mirrored(a.velocity);
        Scene { motions: [a, b], ..s }
    });
    compare("ball in a round groove", count, 3, |r| {
        let mut t = torus(r, 1.0);
        t.major = t.minor * r.within(1.2, 3.0);
        let ball = t.minor * r.within(0.1, 0.95);
        let block = Recipe::cuboid(3.0, 3.0, 1.0).minus(Recipe::of(t.clone()));
        let inside = (t.minor - ball) * 0.8;
        let a = turning(r);
        let at = a.start.point(DVec3::X * t.major + r.direction() * (inside * r.within(0.0, 1.0)));
        let b =
            Motion { start: Pose::new(at, r.rotation()), velocity: a.velocity + r.vector(0.5), spin: r.vector(1.0) };
        let motions = [a, b];
        let speed = speed(&motions, 4.0);
        let (major, room) = (t.major, t.minor - ball);
        let gap = Box::new(move |a: &Pose, b: &Pose| room - from_circle(a, major, b.position));
        Scene { a: block, b: Recipe::sphere(ball), motions, gap, speed }
    });
    compare("torus in a hollow ball", count, 4, |r| {
        let t = torus(r, 0.6);
        let hollow = t.major + t.minor + r.within(0.05, 0.4);
        let block = Recipe::cuboid(3.0, 3.0, 3.0).minus(Recipe::sphere(hollow));
        let motions = [turning(r), Motion::turning(Pose::new(DVec3::ZERO, r.rotation()), r.vector(1.0), r.vector(1.5))];
        let speed = speed(&motions, 4.0);
        let (major, minor) = (t.major, t.minor);
        let gap = Box::new(move |a: &Pose, b: &Pose| {
            let o = b.inverse().point(a.position);
            hollow - minor - (o.x.hypot(o.y) + major).hypot(o.z)
        });
        Scene { a: block, b: Recipe::of(t), motions, gap, speed }
    });
}

#[test]
fn certificates_of_tori_against_every_kind_and_of_trees_with_them_hold() {
    let count = pairs(120);
    let alone = |shape: Shape| Model::new(Recipe::of(shape).build());
    certify_all("kinds", (count, 0x70_7105), |r| {
        let other = if r.chance(0.3) { torus(r, 0.8).into() } else { shape(r, 0.8) };
        let place = |motion| Placed { place: Pose::IDENTITY, motion };
        [(alone(torus(r, 0.8).into()), place(turning(r))), (alone(other), place(past(r, 2.2)))]
    });
    certify_trees((count, 0x70_7105), shape_or_torus);
}

#[test]
fn trees_with_tori_have_the_values_and_the_volumes_of_an_independent_evaluation() {
    let mut r = Random::new(31);
    let (mut inside, mut seen) = (0, 0);
    // A volume by rays takes a second: an eighth of them in the command.
    for i in 0..pairs(150).div_ceil(50).min(24) {
        let solid = solid_of(&mut r, 1 + i % 3, shape_or_torus);
        let (model, around) = (Model::new(solid.clone()), solid.aabb());
        let field = Field::new(&solid, &Pose::IDENTITY);
        for _ in 0..pairs(150) * 10 {
            let x = r.point_in(&around);
            let (f, other) = (solid.value(x), field.value(x));
            assert!((f - other).abs() < 1e-13, "solid {i} at {x}: {f} {other}");
            let margin = model.margin();
            let within = model.value_within(x, margin).clamp(-margin, margin);
            assert!((within - f.clamp(-margin, margin)).abs() < 1e-13, "solid {i} at {x}: {within} {f}");
            // 1-Lipschitz.
            let y = x + r.vector(0.3);
            assert!((solid.value(y) - f).abs() <= x.distance(y) * (1.0 + 1e-12) + 1e-13);
            inside += usize::from(f < 0.0);
            seen += 1;
        }
        let (fine, coarse) = (integrals(&solid, &around, 96), integrals(&solid, &around, 61));
        if fine[0] < 1e-2 {
            continue;
        }
        let m = mass_properties(&model, &MassOptions { tolerance: 0.03, boxes: 300_000 }).expect("bounded");
        let doubt = 4.0 * (fine[0] - coarse[0]).abs() + 2e-3 * fine[0];
        assert!((m.volume - fine[0]).abs() <= m.volume_error + doubt, "solid {i}: {m:?} {}", fine[0]);
        assert!(m.volume_error <= 0.03 * m.volume, "solid {i}: {m:?}");
    }
    assert!(inside * 20 > seen, "{inside} of {seen}");
}

#[test]
fn half_a_torus_has_half_its_volume() {
    let exact = 2.0 * PI * PI * 2.0 * 0.25;
    let whole =
        mass_properties(&Model::new(Recipe::torus(2.0, 0.5).build()), &MassOptions { tolerance: 1e-6, boxes: 10 });
    let whole = whole.expect("bounded");
    assert!(whole.boxes == 0 && (whole.volume - exact).abs() <= whole.volume_error);
    // Pappus: I_z = m (R² + ¾ r²), I_x = m (½ R² + ⅝ r²).
    for (k, i) in [(0, 2.0 + 0.15625), (1, 2.0 + 0.15625), (2, 4.0 + 0.1875)] {
        assert!((whole.inertia[k] - exact * i).abs() <= 1e-12 * exact, "{whole:?}");
    }
    let cut = Recipe::torus(2.0, 0.5).minus(Recipe::cuboid(4.0, 4.0, 1.0).at(0.0, 4.0, 0.0));
    for tolerance in [0.1, 1e-2, 1e-3] {
        let half =
            mass_properties(&Model::new(cut.build()), &MassOptions { tolerance, boxes: 300_000 }).expect("bounded");
        assert!(half.boxes > 0 && (half.volume - 0.5 * exact).abs() <= half.volume_error, "{half:?}");
        assert!(half.volume_error <= tolerance * exact, "{half:?}");
        println!("{tolerance}: {} boxes", half.boxes);
    }
}

#[test]
fn a_torus_touches_along_circles_and_at_points() {
    let at_rest = |a: Recipe, b: Recipe, pose: Pose| {
        let (a, b) = (Model::new(a.build()), Model::new(b.build()));
        let place = |pose| Placed { place: Pose::IDENTITY, motion: Motion::resting(pose) };
        let query = question((&a, place(Pose::IDENTITY)), (&b, place(pose)), QueryOptions::DEPTH);
        let found = regions(&query, 0.0, threshold(query.resolution, 0.0));
        assert!(found.complete, "{found:?}");
        found.regions
    };
    let floor = || Recipe::cuboid(5.0, 5.0, 1.0).at(0.0, 0.0, -1.0);
    let ring = || Recipe::torus(2.0, 0.5);
    let circle = |name: &str, a: Recipe, b: Recipe, pose: Pose, radius: f64, z: f64| {
        let found = at_rest(a, b, pose);
        assert!(found.len() == 1 && found[0].extent == Extent::Line, "{name}: {found:?}");
        assert_eq!(found[0].points.len(), 8, "{name}: {found:?}");
        for p in &found[0].points {
            let x = p.point;
            assert!((x.x.hypot(x.y) - radius).abs() < 1e-9 && (x.z - z).abs() < 1e-9, "{name}: {x}");
        }
    };
    let up = |z: f64| Pose::at(dvec3(0.0, 0.0, z));
    circle("on a floor", floor(), ring(), up(0.5), 2.0, 0.0);
    circle("a ring on a rod", Recipe::cylinder(1.5, 3.0), ring(), up(0.0), 1.5, 0.0);
    circle("a ring in a pipe", Recipe::cylinder(4.0, 3.0).minus(Recipe::cylinder(2.5, 4.0)), ring(), up(0.0), 2.5, 0.0);
    // 3-4-5: a ball of 2 on a ring of 2 and ½ has its centre 1.5 above the plane of the circle.
    circle("a ball in a ring", ring(), Recipe::sphere(2.0), up(1.5), 2.0 - 0.5 * 0.8, 0.3);
    // A slot cut by a plane across: the ring stands on its edge.
    let on_edge =
        Pose::new(dvec3(0.0, 0.0, 2.5), contactd_proto::motion::quat_of_rotation_vector(DVec3::X * (0.5 * PI)));
    let found = at_rest(floor(), ring(), on_edge);
    assert!(found.len() == 1 && found[0].extent == Extent::Point, "{found:?}");
    assert!(found[0].points[0].point.length() < 1e-9 && (found[0].normal - DVec3::Z).length() < 1e-9, "{found:?}");
}
