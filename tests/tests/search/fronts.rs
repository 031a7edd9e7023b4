//! What is told in front of the search (whole primitives, bodies in holes, balls) is what the search says by itself.
//!
//! Some random scenes here; for more
//! `CONTACTD_FRONTS=100000 cargo test -p contactd-tests --test search fronts:: -- --nocapture`.
//! The two share the trees' values and Newton's equations, and nothing of how time before a contact is excluded.

use contactd::contact::{Status, Strategies};
use contactd::solid::Op;
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::{SEARCH_ALONE, are_tied, ask, ask_scene_with, differences};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Recipe, Scene};
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// A block of flat faces at right angles with holes, slots and steps along its axes, some of them tilted, or cut by a tilted block; and a
/// ball that goes for one of its edges.
fn edged(r: &mut Random, ball: Recipe) -> Scene {
    let size = dvec3(r.within(0.4, 0.9), r.within(0.4, 0.9), r.within(0.2, 0.6));
    let mut block = Recipe::cuboid(size.x, size.y, size.z);
    for _ in 0..1 + r.below(3) {
        let along = [DQuat::IDENTITY, DQuat::from_rotation_x(FRAC_PI_2), DQuat::from_rotation_y(FRAC_PI_2)][r.below(3)];
        let (wide, long) = (r.within(0.05, 0.35), if r.chance(0.7) { 2.0 } else { r.within(0.2, 0.8) });
        let tool =
            if r.chance(0.6) { Recipe::cylinder(wide, long) } else { Recipe::cuboid(wide, r.within(0.05, 0.35), long) };
        let along = if r.chance(0.2) { r.rotation() } else { along };
        let tool = tool.moved(&Pose::new(size * r.vector(1.0), along));
        block = if r.chance(0.75) { block.minus(tool) } else { block.union(tool) };
    }
    if r.chance(0.3) {
        let other = Recipe::cuboid(r.within(0.5, 1.0), r.within(0.5, 1.0), r.within(0.3, 0.8));
        block = block.intersection(other.moved(&Pose::new(r.vector(0.3), r.rotation())));
    }
    // One coordinate or two of the place it goes for lie in a face.
    let mut aim = size * r.vector(1.0);
    for k in [r.below(3), r.below(3)] {
        aim[k] = size[k].copysign(aim[k]);
    }
    let place = Pose::new(r.vector(0.2), r.rotation());
    let (start, end) = (place.point(aim + aim.normalize() * r.within(0.5, 1.0)), place.point(aim + r.vector(0.4)));
    let by = |r: &mut Random| if r.chance(0.6) { DVec3::ZERO } else { r.vector(0.5) };
    let (turn, spin) = (by(r), by(r));
    let of_ball = Motion::turning(Pose::new(start, r.rotation()), end, spin);
    Scene::new("ball", block, Motion::turning(place, place.position, turn), ball, of_ball)
}

/// A ball, about its centre or not, against any tree: from outside, or within a hollow of any shape. It may turn, and so may the tree.
pub(super) fn ball(r: &mut Random) -> Scene {
    let ball = Recipe::sphere(r.within(0.05, 0.3));
    let ball = if r.chance(0.7) { ball } else { ball.moved(&Pose::at(r.vector(0.1))) };
    if r.chance(0.5) {
        let scene = edged(r, ball);
        return if r.chance(0.5) { scene.swapped() } else { scene };
    }
    let leaves = 2 + r.below(5);
    let (solid, (of_solid, of_ball)) = if r.chance(0.5) {
        (scenes::tree(r, leaves), scenes::approach(r, 1.0))
    } else {
        // Open above, or closed: what is cut out reaches through the top of the block, or does not.
        let hollow =
            [Recipe::sphere(0.9), Recipe::cone(0.1, 0.9, 0.8), Recipe::torus(0.7, 0.5), scenes::tree(r, leaves)];
        let block = Recipe::cuboid(1.2, 1.2, 1.0).minus(hollow[r.below(4)].at(0.0, 0.0, r.within(0.0, 0.6)));
        let place = Pose::new(r.vector(0.2), r.rotation());
        let start = place.point(r.vector(0.2));
        let by = |r: &mut Random| if r.chance(0.5) { DVec3::ZERO } else { r.vector(0.5) };
        let (turn, spin) = (by(r), by(r));
        let way = r.direction() * r.within(0.1, 1.5);
        let of_ball = Motion::turning(Pose::new(start, r.rotation()), start + way, spin);
        (block, (Motion::turning(place, place.position + r.vector(0.1), turn), of_ball))
    };
    let scene = Scene::new("ball", solid, of_solid, ball, of_ball);
    if r.chance(0.5) { scene.swapped() } else { scene }
}

#[test]
fn a_ball_that_is_all_that_is_left_of_a_tree_is_told_without_a_cell() {
    let nothing = Recipe::Op(Op::Union, vec![]);
    // Its face is the seventh: those of the box, which holds nothing of what it is cut with, come before.
    let cut = Recipe::cuboid(1.0, 1.0, 1.0).intersection(nothing);
    let left = cut.union(Recipe::sphere(0.3));
    let plate = Recipe::cuboid(2.0, 2.0, 0.1).intersection(Recipe::sphere(2.5));
    let scene = Scene::falling(plate, left, DVec3::Z, DVec3::NEG_Z);
    for scene in [scene.swapped(), scene] {
        let told = ask(&scene);
        assert_eq!((told.status(), told.counters.cells), (Status::Contact, 0), "{told:?}");
        assert!((told.time() - 0.6).abs() < 1e-12, "{told:?}");
    }
}

#[test]
fn what_is_told_in_front_of_the_search_is_what_the_search_says() {
    let count = sized("CONTACTD_FRONTS", 100_u64);
    let all: Vec<([bool; 2], bool, Option<String>)> = (0..count)
        .into_par_iter()
        .map(|i| {
            let mut r = Random::new(9_000_000 + i);
            let scene = match i % 5 {
                0 => scenes::peg(&mut r),
                1 => scenes::drilled(&mut r),
                2 => scenes::cavity(&mut r),
                3 => ball(&mut r),
                _ => scenes::any(&mut r),
            };
            let (fronted, alone) = (ask(&scene), ask_scene_with(&scene, SEARCH_ALONE));
            let size = scene.delta() / 1e-9;
            let differ = differences(&alone, &fronted, size);
            let undecided = [&fronted, &alone].iter().any(|o| o.status() == Status::Undecided);
            let wrong = !(differ.is_empty() || undecided || are_tied(&alone, &fronted, size));
            let in_front = fronted.counters.cells == 0 && fronted.counters.closed_forms > 0;
            let what = format!("scene {i} ({}): {differ:?}\nalone {alone:?}\nfronted {fronted:?}", scene.class);
            ([in_front, scene.class == "ball"], undecided, wrong.then_some(what))
        })
        .collect();
    let in_front = all.iter().filter(|a| a.0[0]).count();
    let balls = all.iter().filter(|a| a.0 == [true, true]).count();
    let undecided = all.iter().filter(|a| a.1).count();
    let wrong: Vec<&String> = all.iter().filter_map(|a| a.2.as_ref()).collect();
    println!(
        "{count} scenes: {in_front} reported without a cell, {balls} of these balls, {undecided} undecided, {} differ",
        wrong.len()
    );
    assert!(wrong.is_empty(), "{}", wrong.iter().take(3).map(|w| w.as_str()).collect::<Vec<_>>().join("\n"));
    assert!(
        4 * in_front > count as usize && 20 * balls > count as usize && 200 * undecided <= count as usize,
        "{in_front} in front, {balls} balls, {undecided} undecided"
    );
}

/// The least f of a solid that is found on a ball at a time, both moved as a scene says: from many directions the best is followed.
fn lowest(scene: &Scene, ball: usize, t: f64, r: &mut Random) -> f64 {
    let (own, other) = if ball == 0 { (&scene.a, &scene.b) } else { (&scene.b, &scene.a) };
    let motions = [scene.motion_a, scene.motion_b];
    let (own, other, of_own, of_other) = (own.build(), other.build(), motions[ball], motions[1 - ball]);
    let [face] = own.faces.listed() else { panic!("a ball has one face") };
    let (center, radius) = face.ball().expect("a ball");
    let to_other = |x: DVec3| {
        let world = of_own.start.position + of_own.velocity * t + of_own.matrix_at(t) * x;
        of_other.matrix_at(t).transpose() * (world - of_other.start.position - of_other.velocity * t)
    };
    let f = |u: DVec3| other.value(to_other(center + u * radius));
    let mut best = (f64::INFINITY, DVec3::Z);
    for k in 0..160 {
        let u =
            if k < 60 { r.direction() } else { (best.1 + r.vector(10f64.powf(-0.06 * f64::from(k - 60)))).normalize() };
        let v = f(u);
        if v < best.0 {
            best = (v, u);
        }
    }
    best.0
}

#[test]
fn no_point_of_a_ball_lies_in_a_solid_before_they_are_told_to_meet() {
    // Beside random ones those in which a face was once taken to be at a right angle, or not to turn.
    const KNOWN: [u64; 6] = [220, 380, 567, 1152, 1572, 1645];
    let count = sized("CONTACTD_FRONTS", 100_u64);
    let scenes: Vec<u64> = (0..count).chain(KNOWN).collect();
    let told: usize = scenes
        .into_par_iter()
        .map(|i| {
            let mut r = Random::new(19_000_000 + i);
            let scene = ball(&mut r);
            // Cavities answer for some of them before.
            let o = ask_scene_with(&scene, Strategies { cavities: false, ..Strategies::default() });
            let is_told = o.counters.cells == 0 && matches!(o.status(), Status::Contact | Status::Clear);
            // The solid has two primitives or more.
            let ball = usize::from(scene.a.build().primitives.len() > 1);
            if !is_told {
                return 0;
            }
            let (until, delta) = (if o.status() == Status::Contact { o.time_lower() } else { 1.0 }, scene.delta());
            for k in 0..8 {
                let t = if k < 4 { r.within(0.0, until) } else { until * (1.0 - 10f64.powi(-3 * (k - 3))) };
                let f = lowest(&scene, ball, t, &mut r);
                assert!(f >= -2.0 * delta, "scene {i}: {f:e} at {t}: {o:?}");
            }
            1
        })
        .sum();
    println!("{told} of {count} balls told without a cell");
    assert!(4 * told as u64 > count, "{told} of {count}");
}
