//! Same-shape fits: a body in a hole of its own shape, at equal size and at clearances of 1e-3 to 1e-9 of the size, going
//! in, sliding, pressing sideways, spinning. Every answer is known in closed form; none may be undecided.
//!
//! Each kind has one ceiling on the cells of its dearest scene in `cell_ceilings.toml` (`CONTACTD_RECORD=1` prints it).

use contactd::contact::{Outcome, Status};
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::engine::{SEARCH_ALONE, ask_scene_with, cell_ceiling};
use contactd_tests::scenes::{Recipe, Scene};
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::{FRAC_PI_3, SQRT_2};

/// Clearances as fractions of the size.
const CLEARANCES: [f64; 5] = [0.0, 1e-9, 1e-7, 1e-5, 1e-3];
/// Speed at which a body presses sideways, so that it crosses every clearance early in the step.
const PRESSING: f64 = 0.1;
// Where the clearance is of the size of the resolution, the surfaces are within it of each other in many directions at
// once: the normal is then any of theirs, which leaves it 1 - 4e-9/gap of the direction of pressing.

/// Error of a time, as a length: nine digits of the size.
const SAME: f64 = 1e-9;

/// The dearest scene of a kind so far.
struct Cost {
    kind: &'static str,
    cells: u64,
}

impl Cost {
    fn of(kind: &'static str) -> Self {
        Self { kind, cells: 0 }
    }

    fn ask(&mut self, what: &str, hole: &Recipe, body: &Recipe, motion: Motion) -> Outcome {
        let still = Motion::resting(Pose::IDENTITY);
        let scene = Scene::new("fit", hole.clone(), still, body.clone(), motion);
        let o = ask_scene_with(&scene, SEARCH_ALONE);
        assert!(matches!(o.status(), Status::Contact | Status::Clear), "{} {what}: {o:?}", self.kind);
        self.cells = self.cells.max(o.counters.cells);
        o
    }

    fn clear(&mut self, what: &str, hole: &Recipe, body: &Recipe, motion: Motion) {
        let o = self.ask(what, hole, body, motion);
        assert_eq!(o.status(), Status::Clear, "{} {what}: {o:?}", self.kind);
    }

    /// A contact at `time`, closing at `speed`, with the normal's part along `up` at least `least`.
    fn meets(
        &mut self,
        what: &str,
        hole: &Recipe,
        body: &Recipe,
        motion: Motion,
        (time, speed): (f64, f64),
        (up, least): (DVec3, f64),
    ) {
        let o = self.ask(what, hole, body, motion);
        assert_eq!(o.status(), Status::Contact, "{} {what}: {o:?}", self.kind);
        assert!((o.time() - time).abs() * speed <= SAME, "{} {what}: {} for {time}", self.kind, o.time());
        assert!(
            o.time_lower() <= o.time() && (o.time_upper() - o.time_lower()) * speed <= 10.0 * SAME,
            "{what}: {o:?}"
        );
        assert!(o.at().normal.dot(up) >= least, "{} {what}: normal {}", self.kind, o.at().normal);
    }

    fn end(self) {
        if std::env::var_os("CONTACTD_RECORD").is_some() {
            println!("RECORD fit_{} = {}", self.kind, 2 * self.cells.max(4));
            return;
        }
        let most = cell_ceiling(&format!("fit_{}", self.kind));
        assert!(self.cells <= most, "{}: {} cells, ceiling {most}", self.kind, self.cells);
    }
}

fn moving(from: DVec3, by: DVec3) -> Motion {
    Motion { start: Pose::at(from), velocity: by, spin: DVec3::ZERO }
}

fn spinning(about: DVec3) -> Motion {
    Motion { start: Pose::new(DVec3::ZERO, DQuat::IDENTITY), velocity: DVec3::ZERO, spin: about }
}

fn block() -> Recipe {
    Recipe::cuboid(1.0, 1.0, 0.5)
}

#[test]
fn a_ball_in_a_socket() {
    let (mut cost, r) = (Cost::of("ball"), 0.5);
    let socket = block().at(0.0, 0.0, -0.5).minus(Recipe::sphere(r));
    let cavity = Recipe::cuboid(1.0, 1.0, 1.0).minus(Recipe::sphere(r));
    for gap in CLEARANCES.map(|c| c * r) {
        let ball = Recipe::sphere(r - gap);
        let drop = moving(DVec3::Z * 0.9, -DVec3::Z);
        cost.meets(&format!("drop {gap}"), &socket, &ball, drop, (0.9 + gap, 1.0), (DVec3::Z, 0.0));
        for way in [DVec3::X, dvec3(0.6, 0.0, -0.8)] {
            let press = moving(DVec3::ZERO, way * PRESSING);
            cost.meets(
                &format!("press {gap}"),
                &cavity,
                &ball,
                press,
                (gap / PRESSING, PRESSING),
                (-way, (1.0 - 4e-9 / gap).max(0.0)),
            );
        }
        cost.clear(&format!("spin {gap}"), &socket, &ball, spinning(dvec3(1.0, 2.0, -1.5)));
        cost.clear(&format!("spin in a cavity {gap}"), &cavity, &ball, spinning(dvec3(1.0, 2.0, -1.5)));
        cost.clear(&format!("lift {gap}"), &socket, &ball, moving(DVec3::ZERO, DVec3::Z));
    }
    cost.end();
}

/// What a body that fits a straight hole along z does: in, along, sideways, round.
fn in_a_straight_hole(
    cost: &mut Cost,
    hole: &Recipe,
    body: &Recipe,
    gap: f64,
    ways: &[DVec3],
    turned: Option<(f64, f64)>,
) {
    let say = |what: &str| format!("{what} {gap}");
    cost.clear(&say("drop"), hole, body, moving(DVec3::Z * 1.2, -DVec3::Z));
    cost.clear(&say("slide"), hole, body, moving(DVec3::Z * 0.2, -DVec3::Z * 0.4));
    let screw = Motion { start: Pose::at(DVec3::Z * 0.1), velocity: -DVec3::Z * 0.3, spin: DVec3::Z };
    for way in ways {
        let press = moving(DVec3::ZERO, *way * PRESSING);
        cost.meets(&say("press"), hole, body, press, (gap / PRESSING, PRESSING), (-*way, 0.7));
    }
    match turned {
        None => {
            cost.clear(&say("spin"), hole, body, spinning(DVec3::Z));
            cost.clear(&say("screw"), hole, body, screw);
        }
        // The angle at which its edges meet the walls, and how fast they go then.
        Some((angle, speed)) => {
            cost.meets(&say("spin"), hole, body, spinning(DVec3::Z), (angle, speed), (DVec3::Z, -1e-9));
            cost.meets(&say("screw"), hole, body, screw, (angle, speed), (DVec3::Z, -1e-9));
        }
    }
}

#[test]
fn a_peg_in_a_round_hole() {
    let (mut cost, r) = (Cost::of("peg"), 0.25);
    let hole = block().minus(Recipe::cylinder(r, 1.0));
    for gap in CLEARANCES.map(|c| c * r) {
        let peg = Recipe::cylinder(r - gap, 0.4);
        in_a_straight_hole(&mut cost, &hole, &peg, gap, &[DVec3::X, dvec3(-0.6, 0.8, 0.0)], None);
    }
    cost.end();
}

#[test]
fn a_square_prism_in_its_hole() {
    let (mut cost, r) = (Cost::of("square"), 0.25);
    let hole = block().minus(Recipe::cuboid(r, r, 1.0));
    for gap in CLEARANCES.map(|c| c * r) {
        let a = r - gap;
        let prism = Recipe::cuboid(a, a, 0.4);
        // A corner at a·√2 from the axis meets the wall where a (cos θ + sin θ) = r.
        let angle = (r / (a * SQRT_2)).acos();
        let angle = std::f64::consts::FRAC_PI_4 - angle;
        let speed = a * (angle.cos() - angle.sin());
        in_a_straight_hole(&mut cost, &hole, &prism, gap, &[DVec3::X, -DVec3::Y], Some((angle, speed)));
    }
    cost.end();
}

/// A hexagonal prism: where three slabs meet.
fn hexagon(half_width: f64, half_height: f64) -> Recipe {
    let slab = |k: f64| {
        let turn = Pose::new(DVec3::ZERO, DQuat::from_rotation_z(k * FRAC_PI_3));
        Recipe::cuboid(half_width, 1.0, half_height).moved(&turn)
    };
    slab(0.0).intersection(slab(1.0)).intersection(slab(2.0))
}

#[test]
fn a_hexagonal_prism_in_its_hole() {
    let (mut cost, r) = (Cost::of("hexagon"), 0.25);
    let hole = block().minus(hexagon(r, 1.0));
    for gap in CLEARANCES.map(|c| c * r) {
        let a = r - gap;
        // A corner at 2a/√3, 30 degrees from the wall's normal: a (cos θ + sin θ/√3) = r.
        let angle = (gap / a * 3f64.sqrt()).min(0.1);
        let angle = (0..50).fold(angle, |t, _| {
            t - (a * (t.cos() + t.sin() / 3f64.sqrt()) - r) / (a * (t.cos() / 3f64.sqrt() - t.sin()))
        });
        let speed = a * (angle.cos() / 3f64.sqrt() - angle.sin());
        in_a_straight_hole(&mut cost, &hole, &hexagon(a, 0.4), gap, &[DVec3::X], Some((angle, speed)));
    }
    cost.end();
}

#[test]
fn a_cone_in_a_cone() {
    let mut cost = Cost::of("cone");
    // Radius .35 + z/2 on both at equal height.
    let hole = block().minus(Recipe::cone(0.1, 0.6, 0.5));
    for gap in CLEARANCES.map(|c| c * 0.35) {
        let cone = Recipe::cone(0.2 - gap, 0.5 - gap, 0.3);
        let drop = moving(DVec3::Z * 0.5, -DVec3::Z);
        // Down by h the gap at equal height shrinks by h/2; across the surfaces they close by sin(half angle).
        let speed = 1.0 / 5f64.sqrt();
        cost.meets(&format!("drop {gap}"), &hole, &cone, drop, (0.5 + 2.0 * gap, speed), (DVec3::Z, 0.0));
        let across = 2.0 / 5f64.sqrt();
        let press = moving(DVec3::ZERO, DVec3::X * PRESSING);
        cost.meets(
            &format!("press {gap}"),
            &hole,
            &cone,
            press,
            (gap / PRESSING, PRESSING * across),
            (-DVec3::X, (0.89 - 4e-9 / gap).max(0.0)),
        );
        cost.clear(&format!("spin {gap}"), &hole, &cone, spinning(DVec3::Z));
        cost.clear(&format!("lift {gap}"), &hole, &cone, moving(DVec3::ZERO, DVec3::Z));
    }
    cost.end();
}
