//! Signed distances of points from random trees of all kinds of faces, against points of the surface that the judge finds.
//!
//! `CONTACTD_PROBE_POINTS=10000` sets the number of points (280 by default).

use super::judge::{Judge, solid};
use contactd::contact::probe::{PointAnswer, PointOptions, PosedModel, Side, points};
use contactd::octree::Model;
use contactd_proto::Pose;
use contactd_tests::meshes;
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::DVec3;

/// Points against one solid.
const EACH: usize = 10;
/// Directions in which the judge looks for the surface, and how often the nearest place is moved.
const WAYS: usize = 60;
const TRIES: usize = 300;
/// How far apart the bounds may be.
const TOLERANCE: f64 = 1e-6;

/// The nearest point of the surface that the judge finds: on segments to places on the other side, and moved.
fn nearest(judge: &Judge, x: DVec3, size: f64, r: &mut Random) -> f64 {
    let inside = judge.value(x) < 0.0;
    let crossing = |y: DVec3| {
        let (mut a, mut b) = (0.0, 1.0);
        for _ in 0..40 {
            let m = 0.5 * (a + b);
            if (judge.value(x + (y - x) * m) < 0.0) == inside { a = m } else { b = m }
        }
        x + (y - x) * b
    };
    let mut best: Option<DVec3> = None;
    let mut keep = |y: DVec3| {
        if (judge.value(y) < 0.0) != inside && best.is_none_or(|b| (y - x).length() < (b - x).length()) {
            let y = crossing(y);
            best = Some(y);
        }
        best
    };
    for _ in 0..WAYS {
        keep(x + r.direction() * size * r.within(0.0, 3.0));
    }
    let mut reach = 0.5;
    for i in 0..TRIES {
        let Some(y) = keep(x + r.direction() * size * 3.0) else { continue };
        if i % 30 == 29 {
            reach *= 0.5;
        }
        let beside = (y - x).length() * reach;
        let y = y + r.vector(1.0) * beside;
        keep(x + (y - x) * r.within(1.0 - 0.2 * reach, 1.0));
    }
    best.map_or(f64::INFINITY, |y| (y - x).length())
}

fn refuted(a: &PointAnswer, x: DVec3, judge: &Judge, size: f64, r: &mut Random) -> Option<String> {
    let f = judge.value(x);
    if a.lower > a.upper || (f > 1e-11 && a.upper < 0.0) || (f < -1e-11 && a.lower > 0.0) {
        return Some(format!("f is {f}: {a:?}"));
    }
    if a.side != Side::of_bounds(a.lower, a.upper, 1e-7) {
        return Some(format!("its side is not that of its bounds: {a:?}"));
    }
    let (least, most) = if f < 0.0 { (-a.upper, -a.lower) } else { (a.lower, a.upper) };
    if most.is_finite() {
        let on = judge.value(a.nearest);
        let away = (a.nearest - x).length();
        if on.abs() > 1e-9 || away > most + 1e-12 || away < least - 1e-12 {
            return Some(format!("f is {on} at its nearest point, {away} off: {a:?}"));
        }
    }
    let found = nearest(judge, x, size, r);
    (found < least - 1e-11).then(|| format!("there is a point of the surface {found} off: {a:?}"))
}

#[test]
fn no_point_of_the_surface_refutes_signed_distances_of_trees() {
    let count = sized("CONTACTD_PROBE_POINTS", 280usize);
    let (mut failures, mut sides, mut open, mut cells, mut most) = (Vec::new(), [0usize; 4], 0, 0, 0);
    for i in 0..count.div_ceil(EACH) {
        let mut r = Random::new(95_000 + i as u64);
        let tree = solid(&mut r, i);
        let pose = Pose::new(r.vector(2.0), r.rotation());
        let judge = Judge::new(&tree, &pose);
        let (aabb, size) = (tree.aabb().grown(0.2), tree.aabb().half().length());
        let asked: Vec<DVec3> = (0..EACH).map(|_| pose.point(r.point_in(&aabb))).collect();
        let model = Model::new(tree);
        let options = PointOptions { surface: 1e-7, tolerance: TOLERANCE, limit: 20_000 };
        for (k, answer) in points(&PosedModel { model: &model, pose }, &asked, &options).iter().enumerate() {
            sides[answer.side as usize] += 1;
            open += usize::from(!answer.is_settled);
            if !answer.is_settled {
                println!("solid {i} ({} primitives), point {k}: {answer:?}", model.solid.primitives.len());
            }
            (cells, most) = (cells + answer.cells, most.max(answer.cells));
            let found = refuted(answer, asked[k], &judge, size, &mut r);
            failures.extend(found.map(|text| format!("solid {i}, point {k}: {text}")));
        }
    }
    let all = sides.iter().sum::<usize>();
    println!("{all} points: inside, outside, on, undecided {sides:?}; {open} unsettled");
    println!("{} cells on average, {most} at most", cells / all as u64);
    assert!(failures.is_empty(), "{} refuted, such as {:#?}", failures.len(), &failures[..failures.len().min(5)]);
    assert!(200 * open <= all && 10 * sides[0] > all && 4 * sides[1] > all, "{sides:?}, {open} unsettled");
}

/// Of meshes the distance from all triangles is known, and the side by the solid angle.
#[test]
fn signed_distances_of_meshes_are_those_of_their_triangles() {
    let mut open = 0;
    for i in 0..sized("CONTACTD_PROBE_MESHES", 24usize) {
        let mut r = Random::new(96_000 + i as u64);
        let mesh = meshes::random(&mut r, 1.0);
        let shape = if i % 2 == 0 { meshes::solid(&mesh) } else { meshes::divided(&mesh) };
        let mut b = contactd::solid::SolidBuilder::new();
        let root = b.primitive(shape, Pose::IDENTITY, contactd::solid::Label::default());
        let model = Model::new(b.finish(root));
        let pose = Pose::new(r.vector(2.0), r.rotation());
        let own: Vec<DVec3> = (0..EACH).map(|_| r.vector(1.2)).collect();
        let asked: Vec<DVec3> = own.iter().map(|x| pose.point(*x)).collect();
        let options = PointOptions { surface: 1e-7, tolerance: TOLERANCE, limit: 20_000 };
        for (x, a) in own.iter().zip(points(&PosedModel { model: &model, pose }, &asked, &options)) {
            let away = meshes::distance(&mesh, *x);
            let truth = if meshes::winding(&mesh, *x).abs() > 0.5 { -away } else { away };
            // Corners in single precision may have been bent into planes.
            let slack = 2e-5;
            assert!(a.lower <= truth + slack && truth <= a.upper + slack, "mesh {i}: {truth}: {a:?}");
            assert!(a.lower <= a.upper, "mesh {i}: {a:?}");
            open += usize::from(!a.is_settled);
        }
    }
    assert!(open <= 3, "{open} unsettled");
}
