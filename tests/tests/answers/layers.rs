//! Thin layers that bodies have in common: cones in pockets of nearly their own shape, walls hardly thicker than the
//! resolution.
//!
//! Each family is drawn at random and knows nothing of the engine's cases. Its judges are a descent on max(f_A, f_B), the judge
//! of records, and the balance of the normals that meet. `CONTACTD_LAYER_SCENES=20000` is the long form.

use crate::tight::{Pair, ask, decades, judge};
use contactd::contact::{Outcome, Status};
use contactd::octree::Model;
use contactd_proto::contact_record::NO_FACE;
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::random_solids::Random;
use contactd_tests::record_judge::lies;
use contactd_tests::reference::Moving;
use contactd_tests::scenes::{self, Recipe, Scene};
use contactd_tests::sweep::sized;
use glam::{DVec3, dvec3};

/// A cone that is longer than its pocket and no wider, so that it sticks in the pocket's upper half by many resolutions.
/// Both go and turn together; each spins about its own axis.
fn stuck(rng: &mut Random) -> Scene {
    let (wide, half) = (rng.within(0.3, 1.0), rng.within(0.3, 1.2));
    let shorter = decades(rng, -5.5, -2.0);
    let pocket = Recipe::cone(0.0, wide, half * (1.0 - shorter));
    let block = Recipe::cuboid(1.5, 1.5, 0.5 * half).minus(pocket);
    let start = Pose::at(rng.vector(10.0));
    let (end, lean) = (start.position + rng.vector(1.0), rng.vector(1.0) * dvec3(1.0, 1.0, 0.0));
    let mut turning = || Motion::turning(start, end, lean + DVec3::Z * rng.within(-20.0, 20.0));
    Scene::new("stuck", Recipe::cone(0.0, wide, half), turning(), block, turning())
}

/// A cone in a pocket that is narrower and shorter by less than the resolution: in touch at the start, from tip to base.
fn pressed(rng: &mut Random) -> Scene {
    let (wide, half) = (rng.within(0.3, 1.0), rng.within(0.3, 1.2));
    let resolution = decades(rng, -7.0, -5.0);
    let less = resolution * decades(rng, -3.0, 0.0);
    let block = Recipe::cuboid(1.5, 1.5, 2.0).minus(Recipe::cone(0.0, wide - less, half - less));
    let start = scenes::pose(rng, 5.0);
    let (spin, small) = (rng.vector(3.0), decades(rng, -4.0, -1.0));
    let other =
        if rng.chance(0.5) { rng.vector(10.0) } else { spin + start.rotation * DVec3::Z * rng.within(-20.0, 20.0) };
    let end = start.position + rng.vector(1.0);
    let (a, b) = (Motion::turning(start, end, spin), Motion::turning(start, end + rng.vector(small), other));
    let mut scene = Scene::new("pressed", Recipe::cone(0.0, wide, half), a, block, b);
    scene.resolution = Some(resolution);
    scene
}

/// A cone or frustum in a pocket with little room, beside which it moves.
fn loose(rng: &mut Random) -> Scene {
    let (half, wide) = (rng.within(0.3, 1.2), rng.within(0.3, 1.0));
    let bottom = if rng.chance(0.5) { 0.0 } else { rng.within(0.05, 0.6) };
    let room = decades(rng, -8.0, -2.0);
    let lower = if bottom > 0.0 { room } else { 0.0 };
    let pocket = Recipe::cone(bottom + lower, wide + room, half + if rng.chance(0.5) { room } else { 0.0 });
    let block = Recipe::cuboid(1.5, 1.5, 0.5 * half).minus(pocket);
    let start = scenes::pose(rng, 5.0);
    let (spin, small) = (rng.vector(1.0), decades(rng, -6.0, -1.0));
    let about = start.rotation * DVec3::Z * rng.within(-20.0, 20.0);
    let other = spin + if rng.chance(0.5) { rng.vector(small) } else { about };
    let end = start.position + rng.vector(1.0);
    let (a, b) = (Motion::turning(start, end, spin), Motion::turning(start, end + rng.vector(small), other));
    Scene::new("loose", Recipe::cone(bottom, wide, half), a, block, b)
}

/// A wall hardly thicker than the resolution, what a cylinder leaves of another one, and a cylinder, a tube or a ball that
/// pierces it.
fn skin(rng: &mut Random) -> Scene {
    let thick = decades(rng, -10.0, -5.0);
    let outer = Recipe::cylinder(rng.within(0.2, 0.8), rng.within(0.2, 0.8));
    let skin = outer.clone().minus(outer.at(thick, 0.0, 0.3 * thick));
    let body = match rng.below(3) {
        0 => Recipe::sphere(rng.within(0.2, 0.6)),
        1 => Recipe::cylinder(rng.within(0.1, 0.6), 0.4),
        _ => {
            let tube = Recipe::cylinder(rng.within(0.2, 0.6), 0.3);
            tube.clone().minus(tube.scaled(rng.within(0.6, 0.95)))
        }
    };
    let (a, b) = scenes::approach(rng, 0.7);
    let mut scene = Scene::new("skin", skin, a, body, b);
    scene.resolution = Some((0.3 * thick * decades(rng, -1.0, 0.0)).max(1e-12));
    scene
}

/// How far the normal told is from what the named faces of one body span: sine of an angle.
fn imbalance(scene: &Scene, models: [&Model; 2], o: &Outcome) -> f64 {
    let of_body = |model: &Model, motion: &Motion, faces: [u32; 3], normal: DVec3| {
        let pose = motion.at(o.time());
        let (y, n) = (pose.inverse().point(o.at().point), pose.rotation.inverse() * normal);
        let faces = faces.into_iter().filter(|f| *f != NO_FACE);
        let normals: Vec<DVec3> = faces.map(|f| model.solid.faces[f as usize].unit_normal(y)).collect();
        match normals[..] {
            [g] => n.cross(g).length(),
            [g, h] => n.dot(g.cross(h).normalize_or_zero()).abs(),
            _ => 0.0,
        }
    };
    let at = o.at();
    let of_a = of_body(models[0], &scene.motion_a, at.faces_a, at.normal);
    of_a.max(of_body(models[1], &scene.motion_b, at.faces_b, at.normal))
}

/// What is wrong with the record of an answer.
fn wrong_records(scene: &Scene, models: [&Model; 2], o: &Outcome) -> Vec<String> {
    let moving = |k: usize, motion| Moving { solid: &models[k].solid, place: Pose::IDENTITY, motion };
    let (a, b) = (moving(0, scene.motion_a), moving(1, scene.motion_b));
    lies(&a, &b, o).into_iter().map(|(lie, text)| format!("{lie:?}: {text}")).collect()
}

/// How deep the bodies are in each other at the time told, in resolutions.
fn depth_at_touch(scene: &Scene, models: [&Model; 2], o: &Outcome) -> f64 {
    let pair = Pair { models, motions: [scene.motion_a, scene.motion_b] };
    let values = [1e-3, 1e-5, 1e-7].map(|step| pair.descend(o.time(), o.at().point, step).1);
    values.into_iter().fold(0.0, |depth: f64, value| depth.max(-value)) / o.resolution
}

/// Asks for the first scenes of a family, as many as `CONTACTD_LAYER_SCENES` says or `first`, and for some that are known by
/// their seed.
fn all(
    make: fn(&mut Random) -> Scene,
    first: u64,
    known: &[u64],
    mut each: impl FnMut(u64, &Scene, [&Model; 2], &Outcome),
) {
    let first = sized("CONTACTD_LAYER_SCENES", first);
    for seed in (0..first).chain(known.iter().copied().filter(|seed| *seed >= first)) {
        let scene = make(&mut Random::new(seed));
        let models = [&Model::new(scene.a.build()), &Model::new(scene.b.build())];
        each(seed, &scene, models, &ask(&scene, models));
    }
}

/// A witness at the very start whose multipliers do not settle once ended such a search as a contact at 0.
#[test]
fn cones_that_stick_in_their_pockets_overlap() {
    all(stuck, 6, &[], |seed, scene, models, o| {
        let pair = Pair { models, motions: [scene.motion_a, scene.motion_b] };
        assert_eq!(o.status(), Status::Overlap, "{seed}: {o:?}");
        assert_eq!(judge(&mut Random::new(seed), scene, o, &pair), None, "{seed}: {o:?}");
    });
}

/// What a contact at the start is told of is there at the start: a tip that its witness met a little later is left out where it
/// is farther off.
#[test]
fn cones_in_touch_with_their_pockets_at_the_start_are_told_of_what_is_there() {
    let mut met = 0;
    all(pressed, 6, &[15, 17, 22, 31], |seed, scene, models, o| {
        if o.status() == Status::Contact && o.time() == 0.0 {
            met += 1;
            assert_eq!(wrong_records(scene, models, o), [""; 0], "{seed}: {o:?}");
        }
    });
    assert!(met >= 5, "{met}");
}

/// The touch is where the surfaces meet first: normals oppose each other there, and nothing is deep yet. Where the
/// multipliers hardly miss their balance, and where another face of the same body is ahead, neither is so.
#[test]
fn touches_of_cones_in_their_pockets_are_balanced() {
    // Of these no touch was found with the faces that hold the end of the way back.
    let continued = [250, 763];
    let (mut met, mut bad) = (0, Vec::new());
    all(loose, 12, &continued, |seed, scene, models, o| {
        let is_continued = o.status() == Status::Contact && !o.not_continued();
        assert!(is_continued || !continued.contains(&seed), "{seed}: {o:?}");
        if o.status() != Status::Contact || o.time() == 0.0 || o.not_continued() {
            return;
        }
        met += 1;
        let (angle, depth) = (imbalance(scene, models, o), depth_at_touch(scene, models, o));
        if angle > 1.5e-7 || depth > 0.02 {
            bad.push(format!("{seed}: off by {angle:e}, {depth:e} resolutions deep"));
        }
    });
    // A way back may end at another touch of the same layer, a part of the resolution later: none of the first scenes does,
    // and 14 of 883 contacts of the first thousand.
    assert!(30 * bad.len() <= met, "{} of {met}: {bad:#?}", bad.len());
    assert!(met >= 8, "{met}");
}

/// A wall that is pierced is followed to its rim on the way back, so that its touch is told and not its witness.
#[test]
fn walls_that_are_pierced_are_followed_back_to_their_touch() {
    // Of the others a fifth are told with their witness's time, and flagged as such.
    let continued = [12, 31, 58, 95, 114, 153, 184];
    let (mut met, mut left) = (0, 0);
    all(skin, 6, &continued, |seed, scene, models, o| {
        met += u64::from(o.status() == Status::Contact);
        left += u64::from(o.not_continued());
        if continued.contains(&seed) {
            assert!(o.status() == Status::Contact && !o.not_continued(), "{seed}: {o:?}");
            assert_eq!(wrong_records(scene, models, o), [""; 0], "{seed}: {o:?}");
        }
    });
    println!("{met} walls are pierced, {left} of them without a touch");
    assert!(met >= 10 && 3 * left < met, "{left} of {met}");
}
