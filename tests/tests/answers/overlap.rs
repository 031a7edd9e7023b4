//! Overlap at the start: the point that is told is the deepest of all, up to the thousandth that is promised.

use contactd::contact::Status;
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::engine::ask;
use contactd_tests::random_solids::Random;
use contactd_tests::reference::{Moving, deepest};
use contactd_tests::scenes::{Recipe, Scene, pose, tree};
use contactd_tests::sweep::sized;
use glam::DVec3;

/// What a thousandth may cost in depth, and what a bound of the search rounds away.
const PROMISED: f64 = 1.0 - 2e-3;

/// Depth that is told of two bodies that overlap at the start, held against the trees' own value at the told point.
#[track_caller]
fn reported(scene: &Scene) -> (f64, DVec3) {
    let o = ask(scene);
    assert_eq!(o.status(), Status::Overlap, "{o:?}");
    assert!(
        (o.at().normal.length() - 1.0).abs() < 1e-9 && (o.time_lower(), o.time(), o.time_upper()) == (0.0, 0.0, 0.0),
        "{o:?}"
    );
    assert!(o.counters.instant_cells > 0, "its work is counted: {o:?}");
    let value = |r: &Recipe, m: &Motion, x: DVec3| r.build().value(m.start.inverse().point(x));
    let common = |x| value(&scene.a, &scene.motion_a, x).max(value(&scene.b, &scene.motion_b, x));
    // The point that proves the overlap proves no more than it says, and no more than the deepest one.
    assert!((2.0 * common(o.at().point) - o.at().separation).abs() < 1e-9, "{o:?}");
    assert!(
        -o.at().separation <= o.penetration().map_or(0.0, |p| p.depth) + 1e-12
            && o.at().separation < -2.0 * o.resolution,
        "{o:?}"
    );
    let f = common(o.penetration().unwrap().point);
    assert!(
        (2.0 * f + o.penetration().map_or(0.0, |p| p.depth)).abs() < 1e-9,
        "depth {} where f is {f}",
        o.penetration().map_or(0.0, |p| p.depth)
    );
    assert!((o.penetration().unwrap().direction.length() - 1.0).abs() < 1e-9, "{o:?}");
    (0.5 * o.penetration().map_or(0.0, |p| p.depth), o.penetration().unwrap().point)
}

/// A body on many feet stands in a slab, each foot as deep as a random number says: the deepest counts, wherever the search
/// happens to begin.
#[test]
fn of_many_feet_the_deepest_is_reported() {
    let mut r = Random::new(61);
    for _ in 0..20 {
        let feet: Vec<(f64, f64)> = (0..7).map(|i| (2.0 * f64::from(i) - 6.0, r.within(0.05, 0.4))).collect();
        let foot = |(x, depth): &(f64, f64)| {
            if r.chance(0.5) {
                // Half way between the slab's face and the foot's.
                (Recipe::cuboid(0.5, 0.5, 1.0).at(*x, 0.0, 1.0 - depth), 0.5 * depth)
            } else {
                (Recipe::sphere(0.7).at(*x, 0.0, 0.7 - depth), 0.5 * depth)
            }
        };
        let (shapes, depths): (Vec<Recipe>, Vec<f64>) = feet.iter().map(foot).unzip();
        let body = shapes.into_iter().reduce(Recipe::union).expect("seven feet");
        let slab = Recipe::cuboid(9.0, 3.0, 2.0).at(0.0, 0.0, -2.0);
        let still = Motion::resting(Pose::IDENTITY);
        let (depth, point) = reported(&Scene::new("feet", slab, still, body, still));
        let most = depths.iter().copied().fold(0.0, f64::max);
        assert!(depth >= most * PROMISED && depth <= most * (1.0 + 1e-9), "{depth} of {most} at {point}");
    }
}

/// Random trees pushed into each other: the reference, which divides space without any of the search's bounds, finds nothing
/// deeper.
#[test]
fn the_reference_finds_nothing_deeper_in_random_trees() {
    let mut r = Random::new(62);
    let (mut seen, count) = (0, sized("CONTACTD_LAW_SCENES", 6));
    while seen < count {
        let (leaves_a, leaves_b) = (2 + r.below(4), 2 + r.below(4));
        let (a, b) = (tree(&mut r, leaves_a), tree(&mut r, leaves_b));
        let (at_a, at_b) = (pose(&mut r, 0.3), pose(&mut r, 0.3));
        let scene = Scene::new("pushed", a, Motion::resting(at_a), b, Motion::resting(at_b));
        let (solid_a, solid_b) = (scene.a.build(), scene.b.build());
        let moving = |solid, motion| Moving { solid, place: Pose::IDENTITY, motion };
        let (point, value) = deepest(moving(&solid_a, scene.motion_a), moving(&solid_b, scene.motion_b), 0.0);
        if value > -1e-3 {
            continue;
        }
        seen += 1;
        let (depth, x) = reported(&scene);
        assert!(depth >= -value * PROMISED, "{seen}: reported {depth} at {x}, and {} at {point}", -value);
    }
}
