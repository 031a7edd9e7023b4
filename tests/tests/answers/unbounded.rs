//! Pairs of unbounded bodies: answered at once, with a point that is in both, or clear where their planes look at each other.

use contactd::contact::{QueryOptions, Scratch, Status, earliest_contact};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::primitive::HalfSpace;
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::engine::question;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Recipe};
use glam::{DQuat, DVec3};

fn unbounded(r: &mut Random) -> Recipe {
    let half = || Recipe::of(HalfSpace);
    match r.below(4) {
        0 => half(),
        1 => half().minus(scenes::primitive(r, 0.8).moved(&scenes::pose(r, 1.0))),
        2 => half().union(scenes::tree(r, 3)),
        _ => half().moved(&scenes::pose(r, 2.0)).union(half().moved(&scenes::pose(r, 2.0))),
    }
}

#[test]
fn unbounded_bodies_overlap_far_out_and_are_told_so_at_once() {
    let mut r = Random::new(77_001);
    for k in 0..400 {
        let recipes = [unbounded(&mut r), unbounded(&mut r)];
        let models = [0, 1].map(|i| Model::new(recipes[i].build()));
        let placed = [0, 1].map(|_| {
            // Turned about a drawn axis: no planes look at each other.
            let turn = DQuat::from_scaled_axis(r.vector(2.0));
            let start = Pose::new(r.vector(3.0), r.rotation() * turn);
            let spin = if r.chance(0.5) { DVec3::ZERO } else { r.vector(1.0) };
            Placed { place: Pose::IDENTITY, motion: Motion { start, velocity: r.vector(1.0), spin } }
        });
        let query = question((&models[0], placed[0]), (&models[1], placed[1]), QueryOptions::DEPTH);
        let o = earliest_contact(&query, &mut Scratch::default());
        assert_eq!((o.status(), o.counters.cells), (Status::Overlap, 0), "{k}");
        for i in 0..2 {
            let depth = -models[i].solid.value(placed[i].motion.start.inverse().point(o.at().point));
            assert!(depth >= 0.999 * -0.5 * o.at().separation && o.at().separation < 0.0, "{k}: {depth}");
        }
        assert!((o.at().normal.length() - 1.0).abs() < 1e-12, "{k}");
    }
}

#[test]
fn half_spaces_that_look_at_each_other_are_clear_while_their_planes_are_apart() {
    let mut r = Random::new(77_002);
    let half = Model::new(Recipe::of(HalfSpace).build());
    for k in 0..200 {
        let start = scenes::pose(&mut r, 3.0);
        let gap = r.within(-1.0, 1.0);
        let speed = r.within(-1.0, 1.0);
        // Their solid sides are below their own z = 0.
        let up = start.rotation * DVec3::Z;
        let over = DQuat::from_rotation_x(std::f64::consts::PI);
        let other = Pose::new(start.position + up * gap + start.rotation * DVec3::X, start.rotation * over);
        let motion = |start, velocity| Motion { start, velocity, spin: DVec3::ZERO };
        let placed = [motion(start, DVec3::ZERO), motion(other, up * speed)]
            .map(|motion| Placed { place: Pose::IDENTITY, motion });
        let o = earliest_contact(
            &question((&half, placed[0]), (&half, placed[1]), QueryOptions::CONTACT),
            &mut Scratch::default(),
        );
        assert_eq!(o.counters.cells, 0, "{k}");
        let least = gap.min(gap + speed);
        match o.status() {
            Status::Clear => assert!(least > 0.0, "{k}: {least}"),
            // They meet all over at once, or are in each other all over: no record tells that.
            Status::Undecided => assert!(least < 1e-6 && o.time_lower() == 0.0, "{k}: {least}"),
            Status::Overlap => assert!(gap < -1e-6, "{k}: {gap}"),
            Status::Contact => panic!("{k}: a contact"),
        }
    }
}
