//! The reference against answers that need no program, and against itself (`CONTACTD_LAW_SCENES` scenes).

use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::reference::{Effort, Verdict};
use contactd_tests::scenes::{self, Recipe, Scene, Share};
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3};
use std::f64::consts::FRAC_PI_2;

fn still() -> Motion {
    Motion::resting(Pose::IDENTITY)
}

#[track_caller]
fn check(scene: &Scene, time: f64, normal: DVec3) {
    let truth = scene.truth(Effort::QUICK);
    assert_eq!(truth.verdict, Verdict::Contact, "{truth:?}");
    assert!((truth.time - time).abs() < 1e-11, "time {}, expected {time}", truth.time);
    assert!((truth.normal - normal).length() < 1e-8, "normal {}, expected {normal}", truth.normal);
    assert!(truth.lower <= truth.time && truth.time <= truth.upper);
}

/// A part of the boxes in the command: what stays in touch all the time takes all that there are.
#[track_caller]
fn check_clear(scene: &Scene) {
    let long = std::env::var_os("CONTACTD_LAW_SCENES").is_some();
    let budget = if long { Effort::QUICK.budget } else { Effort::QUICK.budget / 64 };
    let truth = scene.truth(Effort { budget, ..Effort::QUICK });
    assert_eq!(truth.verdict, Verdict::Clear, "{truth:?}");
}

fn plate_with_hole(r: f64) -> Recipe {
    Recipe::cuboid(0.5, 0.5, 0.1).minus(Recipe::cylinder(r, 0.5))
}

#[test]
fn a_spinning_rod_meets_a_ball_at_the_closed_form() {
    let rod = Recipe::cylinder(0.01, 2.0).moved(&Pose::new(DVec3::ZERO, DQuat::from_rotation_y(FRAC_PI_2)));
    let angle = 0.5f64;
    let ball = Motion::resting(Pose::at(DVec3::new(1.5 * angle.cos(), 1.5 * angle.sin(), 0.0)));
    let spin = Motion::turning(Pose::IDENTITY, DVec3::ZERO, DVec3::new(0.0, 0.0, 50.0));
    let time = (angle - (0.06f64 / 1.5).asin()) / 50.0;
    let truth = Scene::new("rod", rod, spin, Recipe::sphere(0.05), ball).truth(Effort::QUICK);
    assert!((truth.time - time).abs() < 1e-12 && (time - 0.00919978651).abs() < 1e-11, "{truth:?}");
}

#[test]
fn a_cube_turning_above_a_plane_touches_between_its_two_clear_ends() {
    let start = Pose::at(DVec3::new(0.0, 0.0, 0.6));
    let cube = Motion::turning(start, start.position, DVec3::new(FRAC_PI_2, 0.0, 0.0));
    let floor = Recipe::cuboid(5.0, 5.0, 0.5).at(0.0, 0.0, -0.5);
    let truth = Scene::new("cube", floor, still(), Recipe::cuboid(0.5, 0.5, 0.5), cube).truth(Effort::QUICK);
    assert!((truth.time * FRAC_PI_2 - 0.2277993).abs() < 1e-7, "{truth:?}");
}

#[test]
fn a_peg_moving_sideways_meets_its_hole_wall() {
    let scene = Scene::falling(plate_with_hole(0.25), Recipe::cylinder(0.24, 0.5), DVec3::ZERO, DVec3::X * 0.1);
    check(&scene, 0.1, -DVec3::X);
    assert!(scene.truth(Effort::QUICK).on_subtracted);
}

#[test]
fn a_tilted_peg_meets_the_rim_of_its_hole() {
    // Where the two rims cross, by bisection along the hole's rim in a few lines of another program.
    let tilt = Pose::new(DVec3::Z, DQuat::from_rotation_x(3f64.to_radians()));
    let peg = Motion::turning(tilt, DVec3::ZERO, DVec3::ZERO);
    let scene = Scene::new("peg", plate_with_hole(0.25), still(), Recipe::cylinder(0.24, 0.5), peg);
    let truth = scene.truth(Effort::THOROUGH);
    assert!((truth.time - 0.404924248220538).abs() < 1e-12, "{truth:?}");
    assert_eq!(truth.active, (2, 2));
}

#[test]
fn a_ball_in_a_hollow_ball_touches_where_the_radii_differ() {
    let shell = Recipe::cuboid(1.0, 1.0, 1.0).minus(Recipe::sphere(0.8));
    let dir = DVec3::new(0.6, 0.0, 0.8);
    check(&Scene::falling(shell, Recipe::sphere(0.3), DVec3::ZERO, dir), 0.5, dir * -1.0);
}

#[test]
fn parallel_faces_close_exactly_and_sliding_or_fitting_parts_stay_clear() {
    let cube = || Recipe::cuboid(0.5, 0.5, 0.5);
    check(&Scene::falling(cube(), cube(), DVec3::new(0.2, 0.1, 1.5), DVec3::NEG_Z), 0.5, DVec3::Z);
    check_clear(&Scene::falling(cube(), cube(), DVec3::new(0.0, 0.0, 1.0), DVec3::X * 0.3));
    check_clear(&Scene::falling(plate_with_hole(0.25), Recipe::cylinder(0.22, 0.5), DVec3::Z, DVec3::NEG_Z));
}

#[test]
fn a_cone_apex_is_a_vertex() {
    let floor = Recipe::cuboid(1.0, 1.0, 0.5);
    let tip_down = Pose::new(DVec3::Z * 2.0, DQuat::from_rotation_x(3.0));
    let cone = Motion::turning(tip_down, DVec3::ZERO, DVec3::ZERO);
    let truth = Scene::new("apex", floor, still(), Recipe::cone(0.3, 0.0, 0.5), cone).truth(Effort::QUICK);
    let time = (2.0 - 0.5 - 0.5 * 3f64.cos().abs()) / 2.0;
    assert!((truth.time - time).abs() < 1e-12, "{truth:?}, expected {time}");
    assert_eq!(truth.active, (1, 3));
}

#[test]
fn deep_overlap_at_the_start_is_told_with_its_depth() {
    let scene = Scene::falling(Recipe::sphere(1.0), Recipe::sphere(0.5), DVec3::Z * 1.2, DVec3::X);
    let truth = scene.truth(Effort::QUICK);
    assert_eq!(truth.verdict, Verdict::Overlap);
    assert!((truth.value + 0.15).abs() < 1e-9, "{truth:?}");
}

#[test]
fn random_scenes_meet_often_enough_and_the_swapped_pair_agrees() {
    let mut share = Share::default();
    for seed in 0..sized("CONTACTD_LAW_SCENES", 8) {
        let scene = scenes::any(&mut Random::new(seed));
        let (t, s) = (scene.truth(Effort::QUICK), scene.swapped().truth(Effort::QUICK));
        assert_eq!(t.verdict, s.verdict, "seed {seed} {}: {t:?} {s:?}", scene.class);
        match t.verdict {
            Verdict::Contact => share.contact += 1,
            Verdict::Clear => share.clear += 1,
            Verdict::Overlap => share.overlap += 1,
        }
        share.subtracted += usize::from(t.on_subtracted);
        if t.verdict == Verdict::Contact {
            assert!((t.time - s.time).abs() < 1e-10, "seed {seed} {}: {} {}", scene.class, t.time, s.time);
        }
    }
    share.assert_enough("reference");
}
