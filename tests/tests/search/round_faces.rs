//! Round faces near each other take few cells: what a fit with equally steep weights bounds, and what a small overlap has in common.
//!
//! 80 random scenes a test here; for more
//! `CONTACTD_ROUND=20000 cargo test -p contactd-tests --test search round_faces:: -- --nocapture`.

use contactd::contact::{Status, Verdict};
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::{SEARCH_ALONE, ask_scene_with};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{Recipe, Scene};
use contactd_tests::sweep::sized;
use glam::DVec3;
use std::f64::consts::TAU;

/// A plate with a conical hole, and a ball of a radius with its centre `gap` off touching the cone: where it is, and the height by
/// which it comes nearer for each length that it falls.
struct Seat {
    plate: Recipe,
    radius: f64,
    center: DVec3,
    fall: f64,
}

impl Seat {
    fn random(r: &mut Random, gap: f64) -> Self {
        // The hole's radius at heights −1 and 1.
        let (bottom, top) = (r.within(0.2, 0.8), r.within(1.2, 3.0));
        let plate = Recipe::cuboid(4.0, 4.0, 1.0).minus(Recipe::cone(bottom, top, 1.0));
        let slope = (top - bottom) / 2.0;
        let cos = 1.0 / (1.0 + slope * slope).sqrt();
        // The centre is seen along the cone's normal from the middle of its wall: the ball touches there alone.
        let at_wall = 0.5 * (bottom + top);
        let radius = r.within(0.1, 0.8) * at_wall * cos;
        let off = at_wall - (radius + gap) * cos;
        let (height, angle) = ((radius + gap) * cos * slope, r.within(0.0, TAU));
        let center = DVec3::new(off * angle.cos(), off * angle.sin(), height);
        Self { plate, radius, center, fall: slope * cos }
    }

    fn scene(self, velocity: DVec3, spin: DVec3) -> Scene {
        let still = Motion { start: Pose::IDENTITY, velocity: DVec3::ZERO, spin: DVec3::ZERO };
        Scene {
            class: "seats",
            a: self.plate,
            b: Recipe::sphere(self.radius),
            motion_a: still,
            motion_b: Motion { start: Pose::at(self.center), velocity, spin },
            resolution: None,
        }
    }
}

#[test]
fn a_ball_comes_down_in_a_cone() {
    let mut r = Random::new(0x0063_6f6e_6573);
    let (mut cells, mut most) = (0, 0);
    let count = sized("CONTACTD_ROUND", 80_usize);
    for i in 0..count {
        let gap = 10f64.powf(r.within(-7.0, -1.0));
        let seat = Seat::random(&mut r, gap);
        let (fall, spin) = (seat.fall, r.vector(0.3));
        let scene = seat.scene(DVec3::NEG_Z * 2.0 * gap / fall, spin);
        let o = ask_scene_with(&scene, SEARCH_ALONE);
        assert_eq!(o.status(), Status::Contact, "{i}: {o:?}");
        // Of the way: 2 gap / fall in the step.
        assert!((o.time() - 0.5).abs() * gap < 1e-13 + 1e-12 * gap, "{i}, {gap}: {o:?}");
        cells += o.counters.cells;
        most = most.max(o.counters.cells);
    }
    println!("{count} balls: {cells} cells, {most} at most");
    assert!(cells < 9 * count as u64 && most < 100, "{cells} cells for {count} balls, {most} at most");
}

#[test]
fn a_small_overlap_at_the_start_is_told_with_its_depth_by_few_cells() {
    let mut r = Random::new(0x0064_6565_7073);
    let (mut cells, mut most) = (0, 0);
    let count = sized("CONTACTD_ROUND", 80_usize);
    for i in 0..count {
        let depth = 10f64.powf(r.within(-7.0, -2.0));
        let seat = Seat::random(&mut r, -depth);
        let (velocity, spin) = (r.vector(1e-3), r.vector(1e-3));
        let o = ask_scene_with(&seat.scene(velocity, spin), SEARCH_ALONE);
        let Verdict::Overlap(overlap) = o.verdict else { panic!("{i}: {o:?}") };
        let told = -overlap.point.expect("a point").separation;
        assert!((told - depth).abs() < 1e-3 * depth + 1e-12, "{i}: {told} for {depth}");
        cells += o.counters.cells;
        most = most.max(o.counters.cells);
    }
    println!("{count} overlaps: {cells} cells, {most} at most");
    assert!(cells < 5 * count as u64 && most < 64, "{cells} cells for {count} overlaps, {most} at most");
}
