//! Scenes in which a record is easily told of the wrong faces: solids on a lattice, whose faces lie in common planes;
//! corners of subtracted bodies; small apexes, edges and balls; parts of very unequal size.

use crate::random_solids::Random;
use crate::scenes::{Recipe, Scene};
use contactd::solid::Op;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use glam::{DQuat, DVec3};
use std::f64::consts::FRAC_PI_2;

/// The families, by name.
pub const FAMILIES: [(&str, fn(&mut Random) -> Scene); 5] = [
    ("lattice", lattice),
    ("subtracted corners", subtracted_corners),
    ("small apexes", small_apexes),
    ("small on large", small_on_large),
    ("large and small", large_and_small),
];

fn quarter(rng: &mut Random) -> DQuat {
    let axis = [DVec3::X, DVec3::Y, DVec3::Z][rng.below(3)];
    quat_of_rotation_vector(axis * (FRAC_PI_2 * rng.below(4) as f64))
}

fn halves(rng: &mut Random, most: usize) -> f64 {
    0.5 * rng.below(2 * most + 1) as f64
}

fn lattice_leaf(rng: &mut Random) -> Recipe {
    let size = |rng: &mut Random| 0.25 * (1 + rng.below(4)) as f64;
    let leaf = match rng.below(4) {
        0 | 1 => Recipe::cuboid(size(rng), size(rng), size(rng)),
        2 => Recipe::cylinder(0.5 * (1 + rng.below(2)) as f64, size(rng)),
        _ => Recipe::sphere(0.5 * (1 + rng.below(2)) as f64),
    };
    let at = DVec3::new(halves(rng, 2), halves(rng, 2), halves(rng, 2)) - DVec3::ONE;
    leaf.moved(&Pose::new(at, quarter(rng)))
}

/// A tree whose primitives stand on a grid of halves, along the axes.
pub fn lattice_tree(rng: &mut Random, leaves: usize) -> Recipe {
    loop {
        let recipe = lattice_subtree(rng, leaves);
        let solid = recipe.build();
        if (0..200).any(|_| solid.value(rng.vector(1.5)) < -0.05) {
            return recipe;
        }
    }
}

fn lattice_subtree(rng: &mut Random, leaves: usize) -> Recipe {
    if leaves <= 1 {
        return lattice_leaf(rng);
    }
    let left = 1 + rng.below(leaves - 1);
    let op = [Op::Union, Op::Union, Op::Difference][rng.below(3)];
    Recipe::Op(op, vec![lattice_subtree(rng, left), lattice_subtree(rng, leaves - left)])
}

/// Two lattice trees, one of which comes along an axis, turning about an axis or not at all.
pub fn lattice(rng: &mut Random) -> Scene {
    let (a, b) = (1 + rng.below(8), 1 + rng.below(8));
    let (a, b) = (lattice_tree(rng, a), lattice_tree(rng, b));
    let along = [DVec3::X, DVec3::Y, DVec3::Z][rng.below(3)];
    let aside = DVec3::new(halves(rng, 3), halves(rng, 3), halves(rng, 3)) - DVec3::splat(1.5);
    let start = aside - along * aside.dot(along) + along * 5.0;
    let about = [DVec3::X, DVec3::Y, DVec3::Z][rng.below(3)];
    let spin = match rng.below(3) {
        0 => DVec3::ZERO,
        1 => about * FRAC_PI_2,
        _ => about * rng.within(-1.5, 1.5),
    };
    let motion = Motion::turning(Pose::at(start), start - along * 6.0, spin);
    Scene::new("lattice", a, Motion::resting(Pose::IDENTITY), b, motion)
}

/// A block with corners, edges and a cone's tip cut out of it, and something with a corner that comes into them.
pub fn subtracted_corners(rng: &mut Random) -> Scene {
    let mut block = vec![Recipe::cuboid(1.0, 1.0, 0.5)];
    for _ in 0..3 {
        let at = DVec3::new(rng.within(-0.8, 0.8), rng.within(-0.8, 0.8), 0.5);
        let pose = Pose::new(at, if rng.chance(0.5) { quarter(rng) } else { rng.rotation() });
        let cut = match rng.below(3) {
            0 => Recipe::cuboid(0.3, 0.4, 0.25),
            1 => Recipe::cone(0.3, 0.0, 0.3),
            _ => Recipe::platonic([4, 8, 20][rng.below(3)], 0.4),
        };
        block.push(cut.moved(&pose));
    }
    let b = match rng.below(3) {
        0 => Recipe::cuboid(0.15, 0.2, 0.15),
        1 => Recipe::cone(0.15, 0.0, 0.2),
        _ => Recipe::platonic([4, 6, 8, 12][rng.below(4)], 0.2),
    };
    let start = Pose::new(DVec3::new(rng.within(-0.8, 0.8), rng.within(-0.8, 0.8), 1.2), rng.rotation());
    let end = start.position + DVec3::new(rng.within(-0.2, 0.2), rng.within(-0.2, 0.2), -1.0);
    let turn = if rng.chance(0.3) { DVec3::ZERO } else { rng.vector(0.7) };
    let motion = Motion::turning(start, end, turn);
    Scene::new("subtracted corners", Recipe::Op(Op::Difference, block), Motion::resting(Pose::IDENTITY), b, motion)
}

/// Needles against needles: cones a thousand times as long as they are wide.
pub fn small_apexes(rng: &mut Random) -> Scene {
    let needle = |rng: &mut Random| {
        let half = rng.within(0.4, 0.5);
        let thin = half * 10f64.powf(rng.within(-3.5, -1.5));
        Recipe::cone(thin, 0.0, half)
    };
    let a = (0..3).fold(needle(rng), |all, _| {
        let at = Pose::new(rng.vector(0.2), rng.rotation());
        all.union(needle(rng).moved(&at))
    });
    let b = needle(rng);
    let along = rng.direction();
    let start = Pose::new(along * 0.8 + rng.vector(0.1), rng.rotation());
    let motion = Motion::turning(start, -along * 0.8, rng.vector(1.0));
    Scene::new("small apexes", a, Motion::turning(Pose::IDENTITY, DVec3::ZERO, rng.vector(1.0)), b, motion)
}

/// A small ball, tip or edge on a large body.
pub fn small_on_large(rng: &mut Random) -> Scene {
    let small = 10f64.powf(rng.within(-3.0, -1.0));
    let tip = match rng.below(3) {
        0 => Recipe::sphere(small),
        1 => Recipe::cone(small, 0.0, small),
        _ => Recipe::cuboid(small, small, small),
    };
    let b = Recipe::cuboid(0.4, 0.4, 0.4).union(tip.moved(&Pose::new(DVec3::new(0.1, 0.05, -0.4), rng.rotation())));
    let a = if rng.chance(0.5) {
        Recipe::cuboid(1.0, 1.0, 0.3).minus(Recipe::cylinder(0.3, 1.0).at(0.5, 0.0, 0.0))
    } else {
        Recipe::sphere(1.0).minus(Recipe::cuboid(0.2, 0.2, 1.5))
    };
    let start = Pose::new(DVec3::new(rng.within(-0.3, 0.3), rng.within(-0.3, 0.3), 2.0), DQuat::IDENTITY);
    let motion = Motion::turning(start, start.position - DVec3::Z * 2.0, rng.vector(0.4));
    Scene::new("small on large", a, Motion::resting(Pose::IDENTITY), b, motion)
}

/// A part on one that is ten to ten thousand times as large.
pub fn large_and_small(rng: &mut Random) -> Scene {
    let ratio = 10f64.powf(rng.within(1.0, 4.0));
    let leaves = (1 + rng.below(4), 1 + rng.below(4));
    let a = crate::scenes::tree(rng, leaves.0).scaled(ratio);
    let b = crate::scenes::tree(rng, leaves.1);
    // From outside towards a point near the surface.
    let solid = a.build();
    let along = rng.direction();
    let (mut inner, mut outer) = (0.0, 4.0 * ratio);
    for _ in 0..60 {
        let middle = 0.5 * (inner + outer);
        *(if solid.value(along * middle) > 0.0 { &mut outer } else { &mut inner }) = middle;
    }
    let start = Pose::new(along * (outer + 3.0), rng.rotation());
    let motion = Motion::turning(start, along * (outer - 2.0) + rng.vector(1.0), rng.vector(1.2));
    Scene::new("large and small", a, Motion::resting(Pose::IDENTITY), b, motion)
}
