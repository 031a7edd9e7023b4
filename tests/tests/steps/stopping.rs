//! A body that is stopped at its contact, again and again, neither deadlocks nor creeps.
//!
//! A loop that stops a body at `time` or at `time_lower` starts its next step at depth 0, give or take rounding and
//! the resolution. Whatever it does next must have an answer that lets it go on: pressing on is a contact at once, with
//! a normal; resting, sliding and receding are clear; overlap never comes up. And a body that is pressed on forever
//! stays where it is: nothing of it is ever deeper than what twice the resolution allows. No answer is left
//! undecided.
//!
//! 10,000 stops here; `CONTACTD_STOPS=1000000 cargo test -p contactd-tests --test steps stopping::` makes a million.

use contactd::contact::{
    Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, default_resolution, earliest_contact,
};
use contactd::math::any_perpendicular;
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Shape;
use contactd::solid::primitive::{Cone, Cuboid, Cylinder, Polyhedron, Sphere};
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};

/// Stops of the plain test command, and how often a body is pressed on before it is dropped anew.
const STOPS: usize = 10_000;
const PRESSES: usize = 8;
/// Cells that one answer may cost before it is left undecided, and those that the dearest of the plain test command may: an
/// advance by less than rounding is no progress, and cells that are put back after it come again by hundreds.
const CELLS: u64 = 20_000;
const DEAREST: u64 = 250;

/// Two models, one of them moving; what they have in common with a loop.
struct Table {
    moving: Model,
    fixed: Model,
    place: Pose,
    delta: f64,
    scratch: Scratch,
}

impl Table {
    fn new(moving: Recipe, fixed: Recipe, place: Pose) -> Self {
        let (moving, fixed) = (Model::new(moving.build()), Model::new(fixed.build()));
        let delta = default_resolution(&moving, &fixed);
        Self { moving, fixed, place, delta, scratch: Scratch::default() }
    }

    /// The fixed body is a.
    fn ask(&mut self, motion: Motion) -> Outcome {
        let at = |motion| Placed { place: Pose::IDENTITY, motion };
        let query = PairQuery {
            a: PlacedModel { model: &self.fixed, placed: at(Motion::resting(self.place)) },
            b: PlacedModel { model: &self.moving, placed: at(motion) },
            resolution: self.delta,
            cell_limit: CELLS,
            strategies: Strategies::default(),
            query_options: QueryOptions::DEPTH,
        };
        let o = earliest_contact(&query, &mut self.scratch);
        assert!(
            o.status() != Status::Overlap,
            "a stopped body met {}: {motion:?} of {:?} at {:?} of {:?}: {o:?}",
            o.status().name(),
            self.moving.solid.primitives,
            self.place,
            self.fixed.solid.primitives
        );
        if o.status() == Status::Undecided {
            let (moving, fixed) = (&self.moving.solid.primitives, &self.fixed.solid.primitives);
            println!("undecided: {motion:?} of {moving:?} at {:?} of {fixed:?}: {o:?}", self.place);
        }
        let most = if stops() == STOPS { DEAREST } else { CELLS };
        assert!(o.counters.cells <= most, "{} cells: {motion:?}: {o:?}", o.counters.cells);
        assert!(
            0.0 <= o.time_lower() && o.time_lower() <= o.time() && o.time() <= o.time_upper() && o.time_upper() <= 1.0
        );
        o
    }

    /// Depth of the deepest common point on the ways from some points of the moving body's surface to its middle, by the
    /// plain value of the trees; it is reached within some resolutions of them, or some hundred at sharp edges.
    fn depth_at(&self, pose: &Pose, points: &[DVec3]) -> f64 {
        let into_fixed = self.place.inverse();
        let ways = points.iter().flat_map(|p| (0..=40).map(move |k| (*p, 1.25f64.powi(k))));
        ways.fold(f64::NEG_INFINITY, |depth, (p, steps)| {
            let x = p - p.normalize_or_zero() * (0.5 * self.delta * steps);
            let f = self.fixed.solid.value(into_fixed.point(pose.point(x))).max(self.moving.solid.value(x));
            depth.max(-f)
        })
    }
}

/// A random convex primitive and the points of it that reach lowest along world −z at any tilt: corners, or what takes
/// their place for a round one under `turn`.
fn convex(r: &mut Random, size: f64, turn: DQuat) -> (Shape, Vec<DVec3>) {
    let mut s = || size * r.within(0.3, 1.0);
    let (a, b, c) = (s(), s(), s());
    let down = turn.inverse() * DVec3::NEG_Z;
    let flat = dvec3(down.x, down.y, 0.0).normalize_or_zero();
    match r.below(5) {
        0 => (Sphere { radius: a }.into(), vec![down * a]),
        1 => {
            let rim = |z: f64| flat * a + DVec3::Z * z;
            (Cylinder { radius: a, half_height: b }.into(), vec![rim(b), rim(-b)])
        }
        2 => (Cone { bottom: a, top: 0.0, half_height: b }.into(), vec![DVec3::Z * b, flat * a - DVec3::Z * b]),
        3 => {
            let half = dvec3(a, b, c);
            let corners = contactd::math::Aabb::around(DVec3::ZERO, half).corners().to_vec();
            (Cuboid { half }.into(), corners)
        }
        _ => {
            let p = Polyhedron::platonic([4, 8, 12, 20][r.below(4)], a + 0.3 * size).expect("a platonic count");
            let corners = p.vertices.clone();
            (p.into(), corners.to_vec())
        }
    }
}

/// Runs `stops` stops over tables that `make` sets up (with a start pose and a motion that meets), and returns how many
/// steps of each kind there were: [contacts at once, clear, undecided].
fn run(
    seed: u64,
    stops: usize,
    slides: bool,
    mut make: impl FnMut(&mut Random) -> (Table, Motion, f64, Vec<DVec3>),
) -> [usize; 3] {
    let mut r = Random::new(seed);
    let mut stopped = 0;
    let mut seen = [0; 3];
    while stopped < stops {
        let (mut table, approach, size, low) = make(&mut r);
        let delta = table.delta;
        let o = table.ask(approach);
        if o.status() == Status::Undecided {
            seen[2] += 1;
            stopped += 1;
            continue;
        }
        assert_eq!(o.status(), Status::Contact, "{approach:?}: {o:?}");
        let stop =
            |r: &mut Random, o: &Outcome, m: &Motion| m.at(if r.chance(0.5) { o.time() } else { o.time_lower() });
        let mut pose = stop(&mut r, &o, &approach);
        // From the fixed body to the moving one, as the caller sees it.
        let mut normal = o.at().normal;
        stopped += 1;
        for _ in 0..PRESSES {
            // Pressed on by much or by hardly anything, straight or askew; a push below the resolution may be clear.
            let push = size * 10f64.powf(r.within(-11.0, 0.0));
            let askew = any_perpendicular(normal) * (push * r.within(-1.0, 1.0));
            let press = Motion { start: pose, velocity: askew - normal * push, spin: DVec3::ZERO };
            let o = table.ask(press);
            match o.status() {
                Status::Contact => {
                    seen[0] += 1;
                    // What is left to the touch is what the stop before left: no more than the resolution.
                    assert!(
                        o.time() * push <= 8.0 * delta,
                        "pressed on by {push}, stops after {}: {o:?}",
                        o.time() * push
                    );
                    assert!((o.at().normal.length() - 1.0).abs() < 1e-9 && o.at().point.is_finite(), "{o:?}");
                    assert!(o.at().normal_speed >= 0.0, "pressed on, and yet receding: {o:?}");
                    normal = o.at().normal;
                    pose = stop(&mut r, &o, &press);
                }
                // Where the work limit ran out the proven time is still safe to go to.
                Status::Undecided => {
                    seen[2] += 1;
                    pose = press.at(o.time_lower());
                }
                _ => {
                    assert!(push <= 16.0 * delta, "pressed on by {push}, nothing met: {o:?}");
                    pose = press.at(1.0);
                }
            }
            stopped += 1;
            // Nothing may be deeper than the search at twice the resolution lets it be.
            let depth = table.depth_at(&pose, &low);
            assert!(depth <= 2.0 * delta * (1.0 + 1e-6), "crept to a depth of {} resolutions", depth / delta);
            // What it may do without being stopped.
            let way = size * 10f64.powf(r.within(-8.0, 0.0));
            let along = any_perpendicular(normal);
            let along = (along * r.within(-1.0, 1.0) + normal.cross(along) * r.within(-1.0, 1.0)).normalize_or(along);
            let free = match r.below(3) {
                0 => DVec3::ZERO,
                1 if slides => along * way,
                _ => normal * way.min(1e-4 * size),
            };
            let o = table.ask(Motion { start: pose, velocity: free, spin: DVec3::ZERO });
            if o.status() == Status::Undecided {
                seen[2] += 1;
                continue;
            }
            assert_eq!(o.status(), Status::Clear, "free to go along {free} (normal {normal}) from {pose:?}: {o:?}");
            seen[1] += 1;
        }
    }
    seen
}

fn stops() -> usize {
    sized("CONTACTD_STOPS", STOPS)
}

fn check(seen: [usize; 3], stops: usize) {
    println!("{stops} stops: {} at once, {} free steps, {} undecided", seen[0], seen[1], seen[2]);
    assert_eq!(seen[2], 0, "undecided of {stops}");
    assert!(seen[0] > stops / 2 && seen[1] > stops / 2, "the test does not test what it says: {seen:?}");
}

#[test]
fn a_body_on_a_floor_is_stopped_again_and_again() {
    let stops = stops() / 2;
    let seen = run(1, stops, true, |r| {
        let size = 10f64.powf(r.within(-3.0, 3.0));
        // Flat on a face, or at any tilt.
        let turn = if r.chance(0.3) { DQuat::IDENTITY } else { r.rotation() };
        let (shape, low) = convex(r, size, turn);
        let h = size * r.within(0.5, 20.0);
        let floor = Recipe::cuboid(40.0 * size, 40.0 * size, h);
        let place = Pose::at(DVec3::NEG_Z * h);
        let height = size * r.within(2.0, 6.0);
        let start = Pose::new(dvec3(0.0, 0.0, height) + r.vector(size) * dvec3(1.0, 1.0, 0.0), turn);
        let velocity = dvec3(r.within(-2.0, 2.0) * size, r.within(-2.0, 2.0) * size, -height * r.within(1.1, 30.0));
        let spin = if r.chance(0.5) { DVec3::ZERO } else { DVec3::Z * r.within(-2.0, 2.0) };
        (Table::new(Recipe::of(shape), floor, place), Motion { start, velocity, spin }, size, low)
    });
    check(seen, stops);
}

#[test]
fn convex_bodies_that_meet_at_any_angle_are_stopped_again_and_again() {
    let stops = stops() / 4;
    let seen = run(2, stops, true, |r| {
        let size = 10f64.powf(r.within(-3.0, 3.0));
        let (turn, fixed_turn) = (r.rotation(), r.rotation());
        let (a, _) = convex(r, size, fixed_turn);
        let other = size * r.within(0.3, 1.0);
        let (b, low) = convex(r, other, turn);
        let away = r.direction();
        let start = Pose::new(away * (6.0 * size), turn);
        // Towards the middle, which both bodies hold.
        let motion = Motion { start, velocity: -away * (size * r.within(6.0, 60.0)), spin: DVec3::ZERO };
        (Table::new(Recipe::of(a), Recipe::of(b), Pose::new(DVec3::ZERO, fixed_turn)), motion, size, low)
    });
    check(seen, stops);
}

#[test]
fn a_peg_in_its_hole_is_stopped_again_and_again() {
    let stops = stops() / 4;
    let seen = run(3, stops, false, |r| {
        let size = 10f64.powf(r.within(-3.0, 3.0));
        let clearance = size * 10f64.powf(r.within(-3.0, -1.0));
        let hole = size * r.within(0.3, 0.8);
        let plate = Recipe::cuboid(size, size, 0.3 * size).minus(Recipe::cylinder(hole, size));
        let radius = hole - clearance;
        let peg = if r.chance(0.5) { Recipe::cylinder(radius, 0.6 * size) } else { Recipe::sphere(radius) };
        let along = r.within(0.0, std::f64::consts::TAU);
        let side = dvec3(along.cos(), along.sin(), 0.0);
        let start = Pose::at(side * (0.3 * clearance) + DVec3::Z * (0.2 * size * r.within(-1.0, 1.0)));
        let motion = Motion { start, velocity: side * (clearance * r.within(2.0, 50.0)), spin: DVec3::ZERO };
        (Table::new(peg, plate, Pose::IDENTITY), motion, clearance, vec![side * radius])
    });
    check(seen, stops);
}
