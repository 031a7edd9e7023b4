//! Convex bodies of all kinds: where they touch and how deep they overlap, against closed forms of how far each reaches.
//!
//! The judge knows the bodies' support functions: along a unit vector n a body reaches h(n). Two bodies are no nearer to each other than
//! −h_A(n) − h_B(−n), whatever n; points of both surfaces that are no farther apart prove that they are as near. Of an overlap F is
//! convex, so a point below which none lies near is the lowest of all.

use contactd::contact::pair::overlap;
use contactd::contact::region::{Region, regions, threshold};
use contactd::contact::{
    Extent, PairQuery, PlacedModel, QueryOptions, Scratch, Strategies, default_resolution, earliest_contact,
};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::FRAC_PI_2;

/// A body in its own frame, and how far it reaches along a unit vector.
struct Body {
    recipe: Recipe,
    reach: Box<dyn Fn(DVec3) -> f64>,
    name: &'static str,
}

/// How far a cone between two discs reaches, which a cylinder is, too.
fn discs(bottom: f64, top: f64, half: f64) -> impl Fn(DVec3) -> f64 {
    move |n| {
        let across = n.x.hypot(n.y);
        (top * across + half * n.z).max(bottom * across - half * n.z)
    }
}

fn body(r: &mut Random) -> Body {
    let [x, y, z] = [0; 3].map(|_| r.within(0.2, 0.9));
    let of = |name, recipe, reach: Box<dyn Fn(DVec3) -> f64>| Body { recipe, reach, name };
    match r.below(8) {
        0 => of("ball", Recipe::sphere(x), Box::new(move |_| x)),
        1 | 2 => of("ellipsoid", Recipe::ellipsoid(x, y, z), Box::new(move |n| (n * dvec3(x, y, z)).length())),
        3 => of("cylinder", Recipe::cylinder(x, z), Box::new(discs(x, x, z))),
        4 => of("frustum", Recipe::cone(x, y, z), Box::new(discs(x, y, z))),
        5 => of("cone", Recipe::cone(x, 0.0, z), Box::new(discs(x, 0.0, z))),
        6 => of("capsule", Recipe::capsule(z, x), Box::new(move |n| z * n.z.abs() + x)),
        _ => of("box", Recipe::cuboid(x, y, z), Box::new(move |n| n.abs().dot(dvec3(x, y, z)))),
    }
}

/// Any attitude, or along an axis, or nearly so.
fn attitude(r: &mut Random) -> DQuat {
    let aligned = DQuat::from_rotation_x(r.below(4) as f64 * FRAC_PI_2) * DQuat::from_rotation_z(r.below(4) as f64);
    match r.below(3) {
        0 => aligned,
        1 => {
            let lean = 10f64.powf(r.within(-9.0, -1.0));
            DQuat::from_scaled_axis(r.direction() * lean) * aligned
        }
        _ => r.rotation(),
    }
}

fn question<'m>(models: [&'m Model; 2], poses: [Pose; 2], velocity: DVec3) -> PairQuery<'m> {
    let placed =
        |pose, velocity| Placed { place: Pose::IDENTITY, motion: Motion { velocity, ..Motion::resting(pose) } };
    let [a, b] = models;
    PairQuery {
        a: PlacedModel { model: a, placed: placed(poses[0], velocity) },
        b: PlacedModel { model: b, placed: placed(poses[1], DVec3::ZERO) },
        resolution: default_resolution(a, b),
        cell_limit: 100_000,
        strategies: Strategies::default(),
        query_options: QueryOptions::DEPTH,
    }
}

/// Along n, a unit vector of the world, how far a body reaches that stands in a pose.
fn reach(body: &Body, pose: &Pose, n: DVec3) -> f64 {
    n.dot(pose.position) + (body.reach)(pose.rotation.inverse() * n)
}

/// Two bodies, the first of which has come to where it first touches the second.
struct Meeting {
    bodies: [Body; 2],
    models: [Model; 2],
    turns: [DQuat; 2],
    /// Away from the second one, which stands at the origin.
    along: DVec3,
    place: DVec3,
}

/// Bodies of any kinds on a straight way; `None` where they miss each other.
fn meeting(r: &mut Random) -> Option<Meeting> {
    let bodies = [body(r), body(r)];
    let turns = [attitude(r), attitude(r)];
    let along = if r.chance(0.5) { turns[1] * DVec3::AXES[r.below(3)] } else { r.direction() };
    let start = along * 5.0 + r.vector(0.3);
    let models = [0, 1].map(|k| Model::new(bodies[k].recipe.build()));
    let poses = [Pose::new(start, turns[0]), Pose::new(DVec3::ZERO, turns[1])];
    let o = earliest_contact(&question(models.each_ref(), poses, along * -6.0), &mut Scratch::default());
    let place = start - along * (6.0 * o.contact()?.time);
    Some(Meeting { bodies, models, turns, along, place })
}

#[test]
fn convex_bodies_touch_where_their_reaches_say() {
    let first = sized("CONTACTD_CONVEX_SEED", 0x636f_6e76_u64);
    let count = sized("CONTACTD_CONVEX", 150);
    let (mut extents, mut cells, mut exact, mut cut) = ([0; 3], [0; 3], 0, 0);
    for i in 0..count {
        let mut r = Random::new(first + i);
        let Some(Meeting { bodies, models: [a, b], turns, along, place }) = meeting(&mut r) else { continue };
        let tau = threshold(default_resolution(&a, &b), 10f64.powf(r.within(-6.0, -2.5)));
        let gap = if r.chance(0.2) { 0.0 } else { tau * r.within(0.0, 0.9) };
        let poses = [Pose::new(place + along * gap, turns[0]), Pose::new(DVec3::ZERO, turns[1])];
        let found = regions(&question([&a, &b], poses, DVec3::ZERO), 0.0, tau);
        let what = format!("{i}: {} and {}, tau {tau:e}", bodies[0].name, bodies[1].name);
        assert!(!found.regions.is_empty(), "{what}: {found:?}");
        if !found.complete {
            cut += 1;
            continue;
        }
        let nearest = found.regions.iter().min_by(|p, q| p.separation().total_cmp(&q.separation())).expect("some");
        let n = nearest.normal;
        let is_point = nearest.extent == Extent::Point;
        // Along a line or an area the told normal is one for all of it.
        for p in nearest.points.iter().filter(|_| is_point) {
            for (model, pose, side) in [(&a, &poses[0], -0.5), (&b, &poses[1], 0.5)] {
                let foot = pose.inverse().point(p.point + n * (side * p.separation));
                let off = model.solid.value(foot).abs();
                assert!(off <= 1e-8 + 1e-3 * tau, "{what}: {off:e} off at {p:?} of {nearest:?}");
            }
        }
        let apart = -reach(&bodies[0], &poses[0], n) - reach(&bodies[1], &poses[1], -n);
        let off = nearest.separation() - apart;
        // A line or an area has the normal of a face, which may reach beyond it. Curves that nearly run along each other are followed by
        // boxes, to a part of the threshold.
        let is_right = off.abs() <= 1e-9 + 0.5 * tau || !is_point && off > 0.0;
        assert!(is_right, "{what}: {:e} told, {apart:e} along {n}: {found:?}", nearest.separation());
        exact += usize::from(is_point && off.abs() <= 1e-9);
        extents[nearest.extent as usize] += 1;
        cells[nearest.extent as usize] += found.cells;
    }
    println!("points, lines, patches: {extents:?}, {cells:?} cells; {exact} points to 1e-9, {cut} cut");
    assert!(extents.iter().all(|n| *n >= count / 100), "{extents:?}");
    assert!(1000 * cut <= count, "{cut} pairs ran out of work");
    assert!(100 * exact as u64 >= 95 * extents[0], "{exact} of {extents:?}");
    // Boxes would need hundreds.
    assert!(cells[0] <= 40 * extents[0], "{cells:?} cells for {extents:?}");
}

#[test]
fn bodies_in_overlap_are_told_where_they_come_apart() {
    let first = sized("CONTACTD_CONVEX_SEED", 0x6170_6294_u64);
    let count = sized("CONTACTD_CONVEX", 150);
    let (mut extents, mut cells, mut exact, mut cut) = ([0; 3], 0, 0, 0);
    for i in 0..count {
        let mut r = Random::new(first + i);
        let Some(Meeting { bodies, models: [a, b], turns, along, place }) = meeting(&mut r) else { continue };
        let tau = threshold(default_resolution(&a, &b), 10f64.powf(r.within(-6.0, -2.5)));
        let beyond = 10f64.powf(r.within(-6.0, -0.7));
        let poses = [Pose::new(place - along * beyond, turns[0]), Pose::new(DVec3::ZERO, turns[1])];
        let query = question([&a, &b], poses, DVec3::ZERO);
        let scratch = &mut Scratch::default();
        let o = earliest_contact(&query, scratch);
        let Some(penetration) = o.penetration() else { continue };
        let found = overlap::regions(&query, penetration, tau, scratch);
        let what = format!("{i}: {} and {}, tau {tau:e}, {penetration:?}", bodies[0].name, bodies[1].name);
        cells += found.cells;
        if !found.complete {
            println!("CUT {what} {found:?}");
            cut += 1;
            continue;
        }
        // How far off a region is from how far apart the bodies are along its normal, less than nothing.
        let off = |region: &Region| {
            let n = region.normal;
            let apart = -reach(&bodies[0], &poses[0], n) - reach(&bodies[1], &poses[1], -n);
            assert!(apart < 0.0, "{what}: apart along {n}: {found:?}");
            region.separation() - apart
        };
        let lowest = found.regions.iter().map(Region::separation).fold(f64::INFINITY, f64::min);
        assert!(lowest.is_finite(), "{what}: no region");
        // An apex within the threshold is told, too, where its cone reaches farther beside it: the deepest is one of those that are as
        // deep to a threshold.
        let deepest = found.regions.iter().filter(|region| region.separation() <= lowest + tau);
        let nearest = deepest.min_by(|p, q| off(p).abs().total_cmp(&off(q).abs())).expect("the lowest is one");
        let (is_point, off_of_it) = (nearest.extent == Extent::Point, off(nearest));
        let is_right = off_of_it.abs() <= 1e-9 + 0.5 * tau || !is_point && off_of_it > 0.0;
        assert!(is_right, "{what}: {off_of_it:e} off along {}: {found:?}", nearest.normal);
        // None is told deeper than the bodies reach into each other.
        let least = found.regions.iter().map(off).fold(f64::INFINITY, f64::min);
        assert!(least >= -1e-9 - 0.5 * tau, "{what}: {least:e} deeper than they reach: {found:?}");
        // No shorter way parts them than their depth, which is that of a ball.
        assert!(-lowest >= penetration.depth * (1.0 - 1e-3) - tau, "{what}: {found:?}");
        exact += usize::from(is_point && off_of_it.abs() <= 1e-9);
        extents[nearest.extent as usize] += 1;
    }
    println!("points, lines, patches: {extents:?}, {cells} cells; {exact} points to 1e-9, {cut} cut");
    assert!(extents.iter().all(|n| *n >= count / 100), "{extents:?}");
    assert!(1000 * cut <= count, "{cut} pairs did not come apart");
    assert!(100 * exact as u64 >= 95 * extents[0], "{exact} of {extents:?}");
}

#[test]
fn the_deepest_point_of_convex_bodies_has_none_deeper_near_it() {
    let first = sized("CONTACTD_CONVEX_SEED", 0x6465_6570_u64);
    let (mut deep, mut cells) = (0, 0);
    let count = sized("CONTACTD_CONVEX", 150);
    for i in 0..count {
        let mut r = Random::new(first + i);
        let bodies = [body(&mut r), body(&mut r)];
        let [a, b] = [0, 1].map(|k| Model::new(bodies[k].recipe.build()));
        let poses = [0, 1].map(|_| Pose::new(r.vector(0.5), attitude(&mut r)));
        let o = earliest_contact(&question([&a, &b], poses, DVec3::ZERO), &mut Scratch::default());
        let Some(found) = o.penetration() else { continue };
        let back = poses.map(|pose| pose.inverse());
        let f = |x: DVec3| a.solid.value(back[0].point(x)).max(b.solid.value(back[1].point(x)));
        let lowest = f(found.point);
        let place = format!("{i}: {} and {}, {found:?}", bodies[0].name, bodies[1].name);
        assert!((2.0 * lowest + found.depth).abs() <= 1e-12, "{place}: F {lowest:e}");
        for k in 0..200 {
            let x = found.point + r.direction() * 10f64.powf(-1.0 - f64::from(k % 8));
            assert!(f(x) >= lowest * (1.0 + 1e-3), "{place}: {:e} at {x}", f(x));
        }
        // Along the direction told the bodies overlap by more than a ball of that size does.
        let n = found.direction;
        let along = reach(&bodies[0], &poses[0], n) + reach(&bodies[1], &poses[1], -n);
        assert!(along >= found.depth - 1e-12, "{place}: {along:e} along it");
        if o.counters.instant_cells > 40 {
            println!("DEAR {} {place}", o.counters.instant_cells);
        }
        deep += 1;
        cells += o.counters.instant_cells;
    }
    println!("{deep} pairs, {cells} cells");
    assert!(deep >= count / 3 && cells <= 20 * deep, "{deep} pairs, {cells} cells");
}
