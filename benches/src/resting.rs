//! Bodies at rest on each other, as a physics loop holds them: what they cost a step while nothing happens.
//!
//! Each scene twice: `still`, every object sent in every step where it lies; `held`, put back in every step to where it lies, up to
//! the little by which a solver misses, and then let fall by what gravity asks of a step.

use crate::stepped::Scene;
use contactd_proto::{Pose, Report, Rule};
use contactd_tests::scenes::Recipe;
use glam::DVec3;

/// How far an object falls in a step from rest: g dt² at 1 kHz, in metres of a body of that size.
const FALL: f64 = 1e-5;
/// By how much a solver misses the place of a body at rest.
const MISS: f64 = 1e-7;
/// Up to which distance contacts are told, as a solver asks.
const MARGIN: f64 = 1e-3;

/// A number of [−1, 1] for an object, an axis and a step, the same in each run.
fn noise(object: usize, axis: usize, step: usize) -> f64 {
    let mut x = (object * 3 + axis) as u64 + 1000 * step as u64 + 1;
    // splitmix64 (Steele, Lea, Flood 2014).
    x = x.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    (x ^ (x >> 31)) as f64 / u64::MAX as f64 * 2.0 - 1.0
}

/// A place with what a solver misses of it.
fn missed(place: DVec3, object: usize, step: usize) -> Pose {
    Pose::at(place + MISS * DVec3::from([0, 1, 2].map(|axis| noise(object, axis, step))))
}

/// A cube on a slab.
fn cube(object: usize) -> DVec3 {
    if object == 0 { DVec3::new(0.0, 0.0, -0.5) } else { DVec3::new(0.3, 0.2, 0.5) }
}

/// A ball of radius 1 on the rim of a hole of radius .6: its centre √(1 − .36) above the rim.
fn ball(object: usize) -> DVec3 {
    if object == 0 { DVec3::new(0.0, 0.0, -0.5) } else { DVec3::new(0.0, 0.0, 0.8) }
}

/// A peg in the gap of four boxes, its foot on a floor and its side on one of them.
fn peg(object: usize) -> DVec3 {
    [DVec3::new(0.0, 0.0, -0.5), DVec3::new(0.0, 0.0, 0.5), DVec3::new(0.001, 0.0, 1.0)][object]
}

/// Three balls of radius .5 that touch each other and the wall of a funnel of 45 degrees.
fn funnel(object: usize) -> DVec3 {
    if object == 0 {
        return DVec3::ZERO;
    }
    // Centres on a circle of radius 1/√3 about the axis; the wall z = |x, y| is r √2 above their height's cone.
    let angle = std::f64::consts::TAU * object as f64 / 3.0;
    let radius = 1.0 / 3f64.sqrt();
    DVec3::new(radius * angle.cos(), radius * angle.sin(), radius + 0.5 * std::f64::consts::SQRT_2)
}

/// The scenes.
pub fn scenes() -> Vec<Scene> {
    let slab = Recipe::cuboid(4.0, 4.0, 0.5);
    let side = |x: f64, y: f64| {
        let (a, b) = if x == 0.0 { (2.101, 1.0) } else { (1.0, 2.101) };
        Recipe::cuboid(a, b, 0.5).at(1.101 * x, 1.101 * y, 0.0)
    };
    let boxes = side(1.0, 0.0).union(side(-1.0, 0.0)).union(side(0.0, 1.0)).union(side(0.0, -1.0));
    let cone = Recipe::cone(0.0, 3.0, 1.5).at(0.0, 0.0, 1.5);
    let pit = Recipe::cuboid(4.0, 4.0, 2.0).at(0.0, 0.0, 1.0).minus(cone).minus(Recipe::cylinder(0.2, 4.0));
    let holed = slab.clone().minus(Recipe::cylinder(0.6, 1.0));
    let all: [(&str, &str, Vec<Recipe>, usize, [fn(usize, usize) -> Pose; 2]); 4] = [
        (
            "cube on a slab",
            "cube on a slab, held",
            vec![slab.clone(), Recipe::cuboid(0.5, 0.5, 0.5)],
            1,
            [|i, _| Pose::at(cube(i)), |i, k| missed(cube(i), i, k)],
        ),
        (
            "ball on a rim",
            "ball on a rim, held",
            vec![holed, Recipe::sphere(1.0)],
            1,
            [|i, _| Pose::at(ball(i)), |i, k| missed(ball(i), i, k)],
        ),
        (
            "peg between boxes",
            "peg between boxes, held",
            vec![slab, boxes, Recipe::cuboid(0.1, 0.1, 1.0)],
            2,
            [|i, _| Pose::at(peg(i)), |i, k| missed(peg(i), i, k)],
        ),
        (
            "three balls in a funnel",
            "three balls in a funnel, held",
            vec![pit, Recipe::sphere(0.5), Recipe::sphere(0.5), Recipe::sphere(0.5)],
            1,
            [|i, _| Pose::at(funnel(i)), |i, k| missed(funnel(i), i, k)],
        ),
    ];
    let rule = Rule { report: Report::Patch, margin: MARGIN, ..Rule::new(["default".into(), "default".into()]) };
    let mut scenes = Vec::new();
    for (still, held, recipes, fixed, poses) in all {
        for (name, pose, fall) in [(still, poses[0], None), (held, poses[1], Some(FALL))] {
            scenes.push(Scene { name, recipes: recipes.clone(), fixed, pose, fall, rules: vec![rule.clone()] });
        }
    }
    scenes
}
