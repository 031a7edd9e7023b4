//! Distances of random trees against brute force: what the bounds say is never refuted by points, whatever the tree.
//!
//! The judge has its own f (`reference::field`) and its own motion. From above: the two points that are told lie in their bodies and are
//! as far apart as the upper bound. From below: of thousands of points drawn in both bodies, and of the nearest of them moved nearer as
//! long as they stay inside, none are nearer than the lower bound. `CONTACTD_DISTANCE_TREES=2000` sets the number of pairs (6 by
//! default), each at an instant and over a step.

use contactd::contact::PlacedModel;
use contactd::contact::distance::{Distance, DistanceQuery, at_instant, over_step};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::Random;
use contactd_tests::reference::field::Field;
use contactd_tests::scenes::{self, Recipe};
use contactd_tests::sweep::sized;
use glam::DVec3;

/// Points drawn in each body, and how often the nearest are moved.
const POINTS: usize = 300;
const TRIES: usize = 1500;
/// Times at which a step is looked at.
const TIMES: usize = 12;

/// A body to the judge.
struct Body {
    field: Field,
    motion: Motion,
    points: Vec<DVec3>,
}

impl Body {
    fn new(recipe: &Recipe, motion: Motion, r: &mut Random) -> Self {
        let solid = recipe.build();
        let field = Field::new(&solid, &Pose::IDENTITY);
        let aabb = solid.aabb();
        let drawn = (0..60 * POINTS).map(|_| r.point_in(&aabb)).filter(|x| field.value(*x) <= 0.0);
        let points = drawn.take(POINTS).collect();
        Self { field, motion, points }
    }

    fn is_inside(&self, x: DVec3, t: f64, slack: f64) -> bool {
        self.field.value(self.motion.at(t).inverse().point(x)) <= slack
    }
}

/// The nearest that the judge finds at a time.
fn nearest(a: &Body, b: &Body, t: f64, r: &mut Random) -> f64 {
    let poses = [a.motion.at(t), b.motion.at(t)];
    let (of_a, of_b) = (a.points.iter().map(|x| poses[0].point(*x)), b.points.iter().map(|x| poses[1].point(*x)));
    let of_b: Vec<DVec3> = of_b.collect();
    let pairs = of_a.flat_map(|x| of_b.iter().map(move |y| (x, *y)));
    let Some((mut x, mut y)) = pairs.min_by(|p, q| (p.0 - p.1).length().total_cmp(&(q.0 - q.1).length())) else {
        return f64::INFINITY;
    };
    let mut reach = 0.3;
    for i in 0..TRIES {
        if i % 50 == 49 {
            reach *= 0.6;
        }
        let way = (y - x) * r.within(0.0, reach);
        let (p, q) = (x + way + r.vector(reach) * 0.5, y - way + r.vector(reach) * 0.5);
        let (p, q) = match i % 3 {
            0 => (p, q),
            1 => (p, y),
            _ => (x, q),
        };
        if (p - q).length() < (x - y).length() && a.is_inside(p, t, 0.0) && b.is_inside(q, t, 0.0) {
            (x, y) = (p, q);
        }
    }
    (x - y).length()
}

/// What a distance says that is refuted.
fn refuted(d: &Distance, a: &Body, b: &Body, times: &[f64], tolerance: f64, r: &mut Random) -> Option<String> {
    let (x, y) = (d.a.point, d.b.point);
    if !(a.is_inside(x, d.time, 1e-12) && b.is_inside(y, d.time, 1e-12)) {
        return Some(format!("its points are outside: {d:?}"));
    }
    if (x - y).length() > d.upper + 1e-12 || d.lower > d.upper {
        return Some(format!("its points are {} apart: {d:?}", (x - y).length()));
    }
    if !d.is_settled || d.upper - d.lower > tolerance {
        return Some(format!("it is not settled: {d:?}"));
    }
    for t in times {
        let found = nearest(a, b, *t, r);
        if found < d.lower - 1e-12 {
            return Some(format!("at {t} there are points {found} apart: {d:?}"));
        }
    }
    None
}

#[test]
fn no_points_refute_the_distances_of_trees() {
    let count = sized("CONTACTD_DISTANCE_TREES", 6usize);
    let (mut failures, mut cells, mut apart) = (Vec::new(), [0, 0], [0, 0]);
    let mut most = [0, 0];
    for i in 0..count {
        let mut r = Random::new(7000 + i as u64);
        let leaves = 1 + r.below(6);
        let (tree_a, tree_b) = (scenes::tree(&mut r, leaves), scenes::tree(&mut r, 1 + (leaves + i) % 5));
        let models = [&tree_a, &tree_b].map(|t| Model::new(t.build()));
        let away = r.direction() * r.within(0.8, 3.0);
        let spin = |r: &mut Random| if r.chance(0.4) { DVec3::ZERO } else { r.vector(1.5) };
        let start_a = Pose::new(r.vector(1.0), r.rotation());
        let motion_a = Motion { start: start_a, velocity: r.vector(0.5), spin: spin(&mut r) };
        let place = motion_a.start.position + away;
        let motion_b = Motion { start: Pose::new(place, r.rotation()), velocity: r.vector(0.7), spin: spin(&mut r) };
        let (a, b) = (Body::new(&tree_a, motion_a, &mut r), Body::new(&tree_b, motion_b, &mut r));
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let tolerance = 1e-6;
        let query = DistanceQuery {
            a: PlacedModel { model: &models[0], placed: placed(motion_a) },
            b: PlacedModel { model: &models[1], placed: placed(motion_b) },
            tolerance,
            limit: 40_000,
        };
        let t = r.within(0.0, 1.0);
        let times: Vec<f64> = (0..=TIMES).map(|k| k as f64 / TIMES as f64).collect();
        for (k, (d, times)) in
            [(at_instant(&query, t), &[t][..]), (over_step(&query), &times[..])].into_iter().enumerate()
        {
            cells[k] += d.cells;
            most[k] = most[k].max(d.cells);
            apart[k] += usize::from(d.lower > 0.0);
            failures.extend(refuted(&d, &a, &b, times, tolerance, &mut r).map(|text| format!("pair {i}, {k}: {text}")));
        }
    }
    println!(
        "{count} pairs, apart {apart:?}, {:?} cells on average, {most:?} at most",
        cells.map(|c| c / count as u64)
    );
    assert!(failures.is_empty(), "{} refuted, such as {:#?}", failures.len(), &failures[..failures.len().min(5)]);
    assert!(2 * apart[0] > count && 3 * apart[1] > count, "{apart:?} of {count} are apart");
}

#[test]
fn bodies_that_share_points_are_told_to() {
    let count = sized("CONTACTD_DISTANCE_TREES", 100usize);
    let (mut shared, mut missed) = (0, Vec::new());
    for i in 0..count {
        let mut r = Random::new(91_000 + i as u64);
        let (of_a, of_b) = (1 + r.below(3), 1 + r.below(2));
        let trees = [scenes::tree(&mut r, of_a), scenes::tree(&mut r, of_b)];
        let place = r.direction() * r.within(0.0, 1.2);
        let motions = [Pose::IDENTITY, Pose::new(place, r.rotation())].map(Motion::resting);
        let [a, b] = [0, 1].map(|k| Body::new(&trees[k], motions[k], &mut r));
        // A ball of a hundredth about a point of both is in both.
        let is_deep = |x: &DVec3| a.is_inside(*x, 0.0, -0.01) && b.is_inside(*x, 0.0, -0.01);
        let of_b = b.points.iter().map(|x| motions[1].start.point(*x));
        if !a.points.iter().copied().chain(of_b).any(|x| is_deep(&x)) {
            continue;
        }
        shared += 1;
        let models = trees.map(|t| Model::new(t.build()));
        let [a, b] = [0, 1].map(|k| {
            let placed = Placed { place: Pose::IDENTITY, motion: motions[k] };
            PlacedModel { model: &models[k], placed }
        });
        let d = at_instant(&DistanceQuery { a, b, tolerance: 1e-6, limit: 40_000 }, 0.0);
        if d.upper > 0.0 {
            missed.push(format!("pair {i}: {d:?}"));
        }
    }
    println!("{shared} of {count} share points");
    assert!(missed.is_empty(), "{} missed, such as {:#?}", missed.len(), &missed[..missed.len().min(3)]);
    assert!(5 * shared > count, "{shared} of {count}");
}
