//! Where a ball touches a solid: the feet of its centre, against boxes, and against a walk that knows membership alone.

use super::fronts::ball;
use contactd::contact::region::{Region, Regions, Way, in_one_way};
use contactd::contact::{Extent, QueryOptions};
use contactd::octree::Model;
use contactd::solid::primitive::Polyhedron;
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::{ask, question_of};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{Recipe, Scene};
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};
use rayon::prelude::*;

/// What one way tells of a scene at a time.
fn told(scene: &Scene, t: f64, tau: f64, way: Way) -> Option<Regions> {
    let models = [Model::new(scene.a.build()), Model::new(scene.b.build())];
    let mut query = question_of(scene, [&models[0], &models[1]], QueryOptions::DEPTH);
    query.cell_limit = 100_000;
    in_one_way(&query, t, tau, way)
}

/// A scene whose bodies meet, its ball, and when.
fn meeting(seed: u64) -> Option<(Scene, usize, f64, Random)> {
    let mut r = Random::new(29_000_000 + seed);
    let scene = ball(&mut r);
    let outcome = ask(&scene);
    let number = usize::from(scene.a.build().primitives.len() > 1);
    outcome.meets().then(|| (scene, number, outcome.time(), r))
}

/// Holds regions against others, each point to a part of a radius.
fn compare(told: &Regions, expected: &Regions, (radius, tau): (f64, f64), what: &impl Fn() -> String) {
    assert_eq!(told.regions.len(), expected.regions.len(), "{}", what());
    for (region, other) in told.regions.iter().zip(&expected.regions) {
        let of = |r: &Region| (r.extent, r.kind, r.faces_a, r.faces_b, r.points.len());
        assert_eq!(of(region), of(other), "{}", what());
        for (p, q) in region.points.iter().zip(&other.points) {
            let off = p.point.distance(q.point).max((p.separation - q.separation).abs());
            assert!(off <= 1e-6 * radius, "{off:e}, {}", what());
        }
        // Of a circle the normal is that of one place; boxes have that of a foot deep in the ball where F balances.
        let slack = 1e-5 + 0.5 * tau / radius;
        let is_one = region.extent != Extent::Point || region.normal.distance(other.normal) < slack;
        assert!(is_one, "{}", what());
    }
}

#[test]
fn the_feet_of_a_ball_are_the_points_that_boxes_find() {
    let count = sized("CONTACTD_FEET", 150_u64);
    // Beside random ones those in which a seam within the solid was once taken for its surface.
    let scenes: Vec<u64> = (0..count).chain([1029, 1084]).collect();
    let all: Vec<[usize; 3]> = scenes
        .into_par_iter()
        .map(|seed| {
            let Some((mut scene, number, t, mut r)) = meeting(seed) else { return [0; 3] };
            let radius = scene_ball(&scene, number).1;
            if r.chance(0.5) {
                touch_another(&mut scene, number, t, &mut r);
            }
            let tau = if r.chance(0.5) { 2.0 * scene.delta() } else { radius * 10f64.powf(r.within(-7.0, -1.5)) };
            let Some(feet) = told(&scene, t, tau, Way::Ball) else { return [1, 0, 0] };
            let boxes = told(&scene, t, tau, Way::Boxes).expect("boxes answer for any bodies");
            if !boxes.complete {
                return [1, 1, 0];
            }
            let what = || format!("scene {seed} at {t}, tau {tau:e} of {radius}: {feet:#?}\n{boxes:#?}");
            compare(&feet, &boxes, (radius, tau), &what);
            [1, 1, 1]
        })
        .collect();
    let [met, answered, compared] = [0, 1, 2].map(|k| all.iter().map(|a| a[k]).sum::<usize>());
    println!("{met} of {count} meet, {answered} by feet, {compared} compared");
    assert!(3 * answered > met && 10 * compared > 9 * answered && met > count as usize / 8);
}

/// Adds a block to the solid of a scene that its ball touches at a time, too.
fn touch_another(scene: &mut Scene, number: usize, t: f64, r: &mut Random) {
    let (center, radius) = scene_ball(scene, number);
    let motions = [scene.motion_a, scene.motion_b];
    let (of_ball, of_other) = (motions[number], motions[1 - number]);
    let at = of_ball.start.position + of_ball.velocity * t + of_ball.matrix_at(t) * center;
    let seen = of_other.matrix_at(t).transpose() * (at - of_other.start.position - of_other.velocity * t);
    let (way, half) = (r.direction(), radius * r.within(0.1, 1.0));
    let place = Pose::new(seen + way * (radius + half), DQuat::from_rotation_arc(DVec3::Z, way));
    let block = Recipe::cuboid(radius * r.within(0.1, 1.0), radius * r.within(0.1, 1.0), half).moved(&place);
    let solid = if number == 0 { &mut scene.b } else { &mut scene.a };
    *solid = solid.clone().union(block);
}

/// Centre and radius of a scene's ball, in its own frame.
fn scene_ball(scene: &Scene, number: usize) -> (DVec3, f64) {
    let solid = if number == 0 { scene.a.build() } else { scene.b.build() };
    let [face] = solid.faces.listed() else { panic!("a ball has one face") };
    face.ball().expect("a ball")
}

#[test]
fn what_a_ball_touches_leads_to_one_of_its_feet() {
    let count = sized("CONTACTD_FEET", 150_u64);
    let walked: usize = (0..count)
        .into_par_iter()
        .map(|seed| {
            let Some((scene, number, t, mut r)) = meeting(1_000_000 + seed) else { return 0 };
            let (center, radius) = scene_ball(&scene, number);
            let tau = radius * r.within(0.01, 0.1);
            let Some(feet) = told(&scene, t, tau, Way::Ball) else { return 0 };
            let motions = [scene.motion_a, scene.motion_b];
            let (of_ball, of_other) = (motions[number], motions[1 - number]);
            let solid = if number == 0 { scene.b.build() } else { scene.a.build() };
            let at = of_ball.start.position + of_ball.velocity * t + of_ball.matrix_at(t) * center;
            let is_in = |x: DVec3| {
                solid.value(of_other.matrix_at(t).transpose() * (x - of_other.start.position - of_other.velocity * t))
                    <= 0.0
            };
            // From what lies within the threshold ever nearer to the centre, within the solid: that ends at a foot.
            let mut walks = 0;
            for _ in 0..400 {
                let mut x = at + r.direction() * (radius + tau * r.within(-0.5, 0.9));
                if !is_in(x) {
                    continue;
                }
                walks += 1;
                // A direction from the centre, and how far along it: inwards, or aside and a little inwards.
                let (mut u, mut far) = ((x - at).normalize(), x.distance(at));
                let mut step = 0.1;
                while step > 1e-6 {
                    let aside = (0..24).map(|_| ((u + r.vector(step)).normalize(), far - 2e-3 * step * radius));
                    let next = [(u, far - step * radius)].into_iter().chain(aside);
                    match next.into_iter().find(|(u, far)| *far > 0.0 && is_in(at + *u * *far)) {
                        Some(nearer) => (u, far) = nearer,
                        None => step *= 0.5,
                    }
                }
                x = at + u * far;
                // What reaches into the ball by more than the threshold is no foot.
                if x.distance(at) < radius - 0.99 * tau {
                    continue;
                }
                let foot = |p: DVec3, gap: f64| p + (p - at).normalize() * (0.5 * gap);
                let near = |r: &Region| foot(r.points[0].point, r.points[0].separation).distance(x) < 0.1 * radius;
                assert!(
                    feet.regions.iter().any(near),
                    "scene {seed}: from the ball at {at}, radius {radius}, {x} ({}) is no foot within {tau}: {feet:#?}",
                    x.distance(at) - radius
                );
            }
            usize::from(walks > 0)
        })
        .sum();
    println!("walks in {walked} of {count} scenes");
    assert!(walked as u64 > count / 12, "{walked} of {count}");
}

/// A ball on the axis of what it lies on: on the rim of a hole, in a seat, on a countersink; beside it by none of the threshold, or some.
#[test]
fn a_ball_on_an_axis_stands_on_the_circle_that_boxes_find() {
    let count = sized("CONTACTD_FEET", 150_u64);
    let all: Vec<[usize; 2]> = (0..count)
        .into_par_iter()
        .map(|seed| {
            let mut r = Random::new(39_000_000 + seed);
            let (hole, radius) = (r.within(0.1, 0.5), r.within(0.3, 0.8));
            let block = Recipe::cuboid(1.0, 1.0, 0.5).minus(Recipe::cylinder(hole, 2.0));
            let (seat, depth) = (hole + r.within(0.1, 0.4), r.within(0.1, 0.4));
            let solid = match r.below(3) {
                0 => block,
                1 => block.minus(Recipe::cone(hole, seat, 0.5 * depth).at(0.0, 0.0, 0.5 - 0.5 * depth)),
                _ => block.union(Recipe::cuboid(0.2, 2.0, 0.1).at(r.within(-0.5, 0.5), 0.0, r.within(0.0, 0.5))),
            };
            // Let down along the axis until it lies on something.
            let place = Pose::new(r.vector(0.2), if r.chance(0.3) { DQuat::IDENTITY } else { r.rotation() });
            let (start, end) = (place.point(DVec3::Z * 2.0), place.point(DVec3::ZERO));
            let of_ball = Motion::turning(Pose::new(start, r.rotation()), end, DVec3::ZERO);
            let rests = Motion::turning(place, place.position, DVec3::ZERO);
            let mut scene = Scene::new("ring", solid, rests, Recipe::sphere(radius), of_ball);
            let outcome = ask(&scene);
            if !outcome.meets() {
                return [0; 2];
            }
            let tau = if r.chance(0.3) { 2.0 * scene.delta() } else { radius * 10f64.powf(r.within(-7.0, -2.5)) };
            let aside = r.vector(1.0).reject_from(DVec3::Z) * tau * [0.0, 0.005, 0.5][r.below(3)];
            scene.motion_b.start.position += place.rotation * aside;
            let Some(feet) = told(&scene, outcome.time(), tau, Way::Ball) else { return [0; 2] };
            let boxes = told(&scene, outcome.time(), tau, Way::Boxes).expect("boxes answer for any bodies");
            if !boxes.complete {
                return [1, 0];
            }
            let what = || format!("scene {seed}, tau {tau:e} of {radius}, {aside} aside: {feet:#?}\n{boxes:#?}");
            // Boxes may tell a curve beside a point as well, where the threshold is large.
            let lines = |told: &Regions| told.regions.iter().filter(|r| r.extent == Extent::Line).count();
            if boxes.regions.len() > feet.regions.len() && lines(&boxes) > lines(&feet) {
                return [1, 0];
            }
            compare(&feet, &boxes, (radius, tau), &what);
            [1, usize::from(feet.regions.iter().any(|r| r.extent == Extent::Line))]
        })
        .collect();
    let [answered, rings] = [0, 1].map(|k| all.iter().map(|a| a[k]).sum::<usize>());
    println!("{answered} of {count} answered, {rings} of them stand on a circle");
    assert!(4 * rings > count as usize, "{rings} of {answered}");
}

/// A ball on the apex of a pyramid as flat as may be, or as steep, that touches a wall beside it: both are told, or boxes decide.
#[test]
fn a_ball_on_a_flat_apex_is_told_with_all_that_it_touches() {
    let mut answered = 0;
    for seed in 0..sized("CONTACTD_FEET", 150_u64) {
        let mut r = Random::new(49_000_000 + seed);
        let slope = 10f64.powf(r.within(-5.0, 0.0));
        let sides = 3 + r.below(2);
        let corner = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / sides as f64;
            dvec3(3.0 * angle.cos(), 3.0 * angle.sin(), -3.0 * slope)
        };
        let below: Vec<DVec3> = (0..sides).map(corner).collect();
        let sunk = below.iter().map(|c| *c - DVec3::Z);
        let pyramid = Polyhedron::hull(below.iter().copied().chain(sunk).chain([DVec3::ZERO]).collect());
        let solid = Recipe::of(pyramid.expect("a pyramid")).union(Recipe::cuboid(0.5, 3.0, 1.0).at(1.5, 0.0, 1.5));
        let (place, apart) = (Pose::new(r.vector(0.2), r.rotation()), 10f64.powf(r.within(-9.0, -4.0)));
        let rests = Motion::resting(place);
        let of_ball = Motion::resting(Pose::at(place.point(dvec3(-apart * r.within(0.0, 0.9), 0.0, 1.0))));
        let scene = Scene::new("apex", solid, rests, Recipe::sphere(1.0), of_ball);
        // Of the flattest hull there is no apex.
        if scene.a.build().value(DVec3::ZERO).abs() > 1e-12 {
            continue;
        }
        let Some(feet) = told(&scene, 0.0, apart, Way::Ball) else { continue };
        answered += 1;
        let near = |x: DVec3| {
            feet.regions.iter().any(|r| place.inverse().point(r.points[0].point).distance(x) < 1e-3 + 2.0 * apart)
        };
        assert!(near(DVec3::ZERO) && near(dvec3(1.0, 0.0, 1.0)), "scene {seed}, slope {slope:e}, {apart:e}: {feet:#?}");
    }
    assert!(answered > 10, "{answered}");
}
