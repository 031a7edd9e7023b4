//! What the demo plays: five acts of real parts, every step a function of its number.
//!
//! A step gives the start and the end of every body, so that any row of the demo's table can be written as a scene file
//! and checked on its own. Between two steps a body may be set back: an assembly robot that feels its way, draws back a
//! little and tries again.
//! Invariant: no step starts in overlap, and `step(i)` depends on `i` alone, to the bit (sine and cosine from `libm`).

use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DVec3, dvec3};
use std::f64::consts::{PI, TAU};

/// A model of the demo: its name and its OpenSCAD tree.
#[derive(Clone, Copy, Debug)]
pub struct DemoModel {
    /// Name, also of its file.
    pub name: &'static str,
    /// The `.csg` text.
    pub text: &'static str,
}

macro_rules! parts {
    ($($constant:ident $name:literal),+ $(,)?) => {
        $(#[doc = concat!("`server/models/", $name, ".csg`.")]
        pub const $constant: DemoModel = DemoModel { name: $name, text: include_str!(concat!("../../models/", $name, ".csg")) };)+
        /// All models of the demo.
        pub const PARTS: &[DemoModel] = &[$($constant),+];
    };
}

parts! {
    FLANGE "flange", BOLT "bolt", PLATE "plate", PEG "peg", OUTER_RING "outer_ring", INNER_RING "inner_ring",
    CAGE "cage", BALL "ball", GEAR "gear", BASE "base", COVER "cover",
}

/// An object of an act.
#[derive(Clone, Debug)]
pub struct DemoObject {
    /// Its name.
    pub name: String,
    /// Its model.
    pub part: DemoModel,
    /// It never moves.
    pub fixed: bool,
}

/// Start and end of one body in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Pose at t = 0.
    pub start: Pose,
    /// Pose at t = 1, reached the shortest way.
    pub end: Pose,
}

impl Leg {
    fn rest(pose: Pose) -> Self {
        Self { start: pose, end: pose }
    }
}

/// One act: its bodies, and what they do.
#[derive(Debug)]
pub struct Act {
    /// What happens, for the progress bar.
    pub title: &'static str,
    /// Its objects.
    pub bodies: Vec<DemoObject>,
    /// Number of its steps.
    pub steps: usize,
    legs: fn(usize) -> Vec<Leg>,
}

impl Act {
    /// What every body does in step `i` of this act, in the order of `bodies`.
    pub fn step(&self, i: usize) -> Vec<Leg> {
        (self.legs)(i)
    }
}

/// The acts, in order.
pub fn acts() -> Vec<Act> {
    let fixed = |name: &str, part| DemoObject { name: name.into(), part, fixed: true };
    let moving = |name: &str, part| DemoObject { name: name.into(), part, fixed: false };
    let several = |stem: &str, n: usize, part| (1..=n).map(move |i| moving(&format!("{stem}_{i}"), part)).collect();
    let with = |first: Vec<DemoObject>, rest: Vec<DemoObject>| [first, rest].concat();
    vec![
        Act {
            title: "bolts into the flange",
            bodies: with(vec![fixed("flange", FLANGE)], several("bolt", BOLTS, BOLT)),
            steps: BOLTS * BOLT_STEPS,
            legs: bolts,
        },
        Act {
            title: "pegs into the plate",
            bodies: with(vec![fixed("plate", PLATE)], several("peg", PEGS, PEG)),
            steps: PEGS * PEG_STEPS,
            legs: pegs,
        },
        Act {
            title: "balls in the bearing",
            bodies: with(vec![fixed("outer_ring", OUTER_RING), fixed("cage", CAGE)], several("ball", BALLS, BALL)),
            steps: BEARING_STEPS,
            legs: bearing,
        },
        Act {
            title: "gears in mesh",
            bodies: vec![moving("gear_1", GEAR), moving("gear_2", GEAR)],
            steps: GEAR_STEPS,
            legs: gears,
        },
        Act {
            title: "cover onto its dowels",
            bodies: vec![fixed("base", BASE), moving("cover", COVER)],
            steps: COVER_STEPS,
            legs: cover,
        },
    ]
}

const BOLTS: usize = 8;
const BOLT_STEPS: usize = 24;
const PEGS: usize = 4;
const PEG_STEPS: usize = 40;
const BALLS: usize = 3;
const BEARING_STEPS: usize = 192;
const GEAR_STEPS: usize = 288;
const COVER_STEPS: usize = 200;

/// Golden angle: directions that never repeat and fill the circle evenly.
const GOLDEN: f64 = 2.399_963_229_728_653;

fn around_z(angle: f64, radius: f64, z: f64) -> DVec3 {
    let (s, c) = libm::sincos(angle);
    dvec3(radius * c, radius * s, z)
}

fn turned(position: DVec3, rotation_vector: DVec3) -> Pose {
    Pose::new(position, quat_of_rotation_vector(rotation_vector))
}

/// Eight screws, one after the other: down into the hole, feeling for its wall on the way, onto the seat at z = 9.
fn bolts(i: usize) -> Vec<Leg> {
    let (now, s) = (i / BOLT_STEPS, i % BOLT_STEPS);
    let mut legs = vec![Leg::rest(Pose::IDENTITY)];
    for b in 0..BOLTS {
        let hole = around_z(b as f64 * TAU / BOLTS as f64, 52.0, 0.0);
        // No hand holds a screw exactly in line: each has a lean and an offset of its own.
        let lean = around_z(1.7 * b as f64, 0.004, 0.0);
        let off = around_z(2.9 * b as f64 + 0.4, 0.2, 0.0);
        let at = |z: f64, aside: DVec3, tilt: DVec3| turned(hole + off + aside + DVec3::Z * z, tilt + lean);
        legs.push(match b.cmp(&now) {
            std::cmp::Ordering::Less => Leg::rest(at(9.2, DVec3::ZERO, DVec3::ZERO)),
            std::cmp::Ordering::Greater => Leg::rest(at(48.0, DVec3::ZERO, DVec3::ZERO)),
            std::cmp::Ordering::Equal => {
                let height = |s: usize| 48.0 - 38.4 * s as f64 / (BOLT_STEPS - 1) as f64;
                let z = height(s);
                let start = at(z, DVec3::ZERO, DVec3::ZERO);
                let aside = around_z(GOLDEN * i as f64, 1.0, 0.0);
                let end = match s {
                    _ if s == BOLT_STEPS - 1 => at(8.6, DVec3::ZERO, DVec3::ZERO),
                    _ if s % 3 != 1 || s == 16 => at(height(s + 1), DVec3::ZERO, DVec3::ZERO),
                    // Above the hole: too far out, onto the rims of hole and counterbore.
                    _ if z > 33.0 => at(25.0, aside * 2.0, DVec3::ZERO),
                    _ if s.is_multiple_of(2) => at(z - 0.4, aside * 0.9, DVec3::Z.cross(aside) * 0.03),
                    _ => at(z - 0.4, aside * 0.5, DVec3::Z.cross(aside) * 0.06),
                };
                Leg { start, end }
            }
        });
    }
    legs
}

/// Four pegs with 0.05 mm around the shank: onto the chamfer beside the hole, then in, sideways, tilted, on the shoulder.
fn pegs(i: usize) -> Vec<Leg> {
    let (now, s) = (i / PEG_STEPS, i % PEG_STEPS);
    let mut legs = vec![Leg::rest(Pose::IDENTITY)];
    for p in 0..PEGS {
        let hole = dvec3(-50.0 + 40.0 * p as f64, [-20.0, 20.0, 0.0, 40.0][p], 0.0);
        let at = |z: f64, aside: DVec3, tilt: DVec3| turned(hole + aside + DVec3::Z * z, tilt);
        legs.push(match p.cmp(&now) {
            std::cmp::Ordering::Less => Leg::rest(at(0.2, DVec3::ZERO, DVec3::ZERO)),
            std::cmp::Ordering::Greater => Leg::rest(at(40.0, DVec3::ZERO, DVec3::ZERO)),
            std::cmp::Ordering::Equal => {
                let height = |s: usize| 40.0 - 39.6 * s as f64 / (PEG_STEPS - 1) as f64;
                let z = height(s);
                let aside = around_z(GOLDEN * i as f64, 1.0, 0.0);
                let start = at(z, DVec3::ZERO, DVec3::ZERO);
                let end = match s {
                    _ if s == PEG_STEPS - 1 => at(-0.3, DVec3::ZERO, DVec3::ZERO),
                    // Above the hole: now and then a trial beside it, onto the chamfer.
                    _ if z > 24.0 && s % 3 == 1 => at(22.6, aside * 0.8, DVec3::ZERO),
                    _ if z > 24.0 && s % 3 == 2 => at(22.4, aside * 0.6, aside * 0.05),
                    _ if s % 3 != 1 || z > 24.0 => at(height(s + 1), DVec3::ZERO, DVec3::ZERO),
                    _ if s.is_multiple_of(2) => at(z - 0.2, aside * 0.12, DVec3::ZERO),
                    _ => at(z - 0.2, DVec3::ZERO, aside * 0.03),
                };
                Leg { start, end }
            }
        });
    }
    legs
}

/// Three balls roll in their pockets; one after the other is thrown outwards, into the raceway's two cones, or lags
/// behind and meets the wall of its pocket.
fn bearing(i: usize) -> Vec<Leg> {
    // How far a ball rolls on while it is thrown: another way each time.
    let roll = |i: usize| 0.004 * libm::sin(GOLDEN * i as f64);
    let throw = |i: usize| 0.2 + 0.1 * libm::cos(1.7 * i as f64);
    let mut legs = vec![Leg::rest(Pose::IDENTITY); 2];
    for b in 0..BALLS {
        let home = b as f64 * TAU / BALLS as f64;
        let at = |radius: f64, angle: f64, i: usize| {
            turned(around_z(home + angle, radius, 0.0), DVec3::Z * (-0.3 * i as f64))
        };
        let start = at(22.92, 0.0, i);
        let end = match i % (2 * BALLS) {
            k if k == 2 * b && i.is_multiple_of(4) => at(23.0 + throw(i), roll(i), i + 1),
            k if k == 2 * b => at(22.9 + throw(i), roll(i), i + 1),
            k if k == 2 * b + 1 && i % 4 == 1 => at(22.95, 0.012, i + 1),
            _ => at(22.92, 0.0, i),
        };
        legs.push(Leg { start, end });
    }
    legs
}

/// Two gears on fixed axes turn against each other, tooth by tooth: the first one drives, now this way, now that, until
/// its flank meets the other's; on half of the steps the second one runs away as fast, and nothing meets.
fn gears(i: usize) -> Vec<Leg> {
    let tooth = TAU / 24.0;
    let at = |x: f64, angle: f64| turned(dvec3(x, 0.0, 2.3), DVec3::Z * angle);
    let phase = 0.37 * tooth * i as f64;
    let drive = if i.is_multiple_of(2) { 0.06 } else { -0.06 };
    let lag = if i % 4 < 2 { 0.0 } else { -drive };
    vec![
        Leg { start: at(-30.0, phase), end: at(-30.0, phase + drive) },
        Leg { start: at(30.0, PI + 0.5 * tooth - phase), end: at(30.0, PI + 0.5 * tooth - phase + lag) },
    ]
}

/// The cover comes down on its dowels: beside them, then on, sideways, and flat on the base.
fn cover(i: usize) -> Vec<Leg> {
    let height = |s: usize| 14.0 - 13.9 * s as f64 / (COVER_STEPS - 1) as f64;
    let z = height(i);
    let at = |z: f64, aside: DVec3, tilt: DVec3| turned(aside + DVec3::Z * z, tilt);
    let aside = around_z(GOLDEN * i as f64, 1.0, 0.0);
    let end = match i {
        _ if i == COVER_STEPS - 1 => at(-0.2, DVec3::ZERO, DVec3::ZERO),
        _ if i.is_multiple_of(2) => at(height(i + 1), DVec3::ZERO, DVec3::ZERO),
        _ if z > 9.5 && i % 4 == 1 => at(7.0, aside * 3.0, DVec3::ZERO),
        _ if z > 9.5 => at(7.5, aside * 2.0, aside * 0.02),
        _ if i % 4 == 1 => at(z - 0.05, aside * 0.2, DVec3::ZERO),
        _ => at(z - 0.05, DVec3::ZERO, aside * 0.01 + DVec3::Z * 0.004),
    };
    vec![Leg::rest(Pose::IDENTITY), Leg { start: at(z, DVec3::ZERO, DVec3::ZERO), end }]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_unit(q: glam::DQuat) -> bool {
        (q.length_squared() - 1.0).abs() < 1e-12
    }

    #[test]
    fn the_acts_have_a_thousand_steps_of_finite_unit_poses() {
        let acts = acts();
        let mut total = 0;
        for act in &acts {
            total += act.steps;
            for i in 0..act.steps {
                let legs = act.step(i);
                assert_eq!(legs.len(), act.bodies.len());
                assert_eq!(legs, act.step(i));
                for (leg, body) in legs.iter().zip(&act.bodies) {
                    assert!(leg.start.position.is_finite() && leg.end.position.is_finite());
                    assert!(is_unit(leg.start.rotation) && is_unit(leg.end.rotation));
                    assert!(!body.fixed || leg.start == leg.end);
                }
            }
        }
        assert!(total >= 1000, "{total}");
    }
}
