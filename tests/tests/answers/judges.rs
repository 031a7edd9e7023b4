//! What the judges compute with, against truths of its own: equations, roots, distances of meshes, meshes that are closed.

use contactd_proto::Pose;
use contactd_tests::closed::trig::Trig;
use contactd_tests::meshes::{distance as from_mesh, random};
use contactd_tests::random_solids::Random;
use contactd_tests::reference::linear::least_squares;
use contactd_tests::shells::{
    arm, chain_link, cup, elbow, filleted, flange, gear, knot, nut, perforated, sampled, screw, sheet, spring, stone,
};
use contactd_tests::sweep::sized;
use contactd_tests::triangles::{Body, distance};
use glam::DVec3;
use std::collections::HashMap;
use std::f64::consts::PI;

#[test]
fn a_regular_system_is_solved_and_a_singular_one_takes_the_shortest_answer() {
    let x = least_squares(&[vec![2.0, 1.0], vec![1.0, 3.0]], &[5.0, 10.0], 1e-12);
    assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 3.0).abs() < 1e-14);
    let x = least_squares(&[vec![1.0, 1.0], vec![1.0, 1.0]], &[2.0, 2.0], 1e-12);
    assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 1.0).abs() < 1e-14);
}

#[test]
fn a_product_of_shifted_sines_has_their_roots() {
    // sin(θ − a) for four angles a: eight roots, a and a + π.
    let angles = [0.3, 1.1, 1.9, 2.6f64];
    let factor = |a: f64| Trig::linear(0.0, -a.sin(), a.cos());
    let product = angles.iter().map(|a| factor(*a)).reduce(|p, q| p.times(&q)).expect("four");
    for x in [0.0, 0.7, 2.0, 4.0, -1.0f64] {
        let direct: f64 = angles.iter().map(|a| (x - a).sin()).product();
        assert!((product.at(x) - direct).abs() < 1e-15);
    }
    let mut found = Vec::new();
    product.roots(|r| found.push(r.rem_euclid(PI)));
    found.sort_by(f64::total_cmp);
    assert_eq!(found.len(), 8);
    for (i, r) in found.iter().enumerate() {
        assert!((r - angles[i / 2]).abs() < 1e-13, "{found:?}");
    }
}

#[test]
fn the_slope_is_the_derivative() {
    let t = Trig::linear(0.3, 1.0, -0.4).times(&Trig::linear(1.0, 0.2, 0.7));
    for x in [0.1, 2.0, 5.0f64] {
        assert!((t.slope().at(x) - (t.at(x + 1e-6) - t.at(x - 1e-6)) / 2e-6).abs() < 1e-8);
    }
}

#[test]
fn two_meshes_are_as_far_apart_as_points_of_one_are_from_the_other_at_least() {
    let mut r = Random::new(4);
    let (mut met, mut apart) = (0, 0);
    let count = sized("CONTACTD_PAIRS", 20);
    for i in 0..count {
        let [a, b] = [random(&mut r, 0.7), random(&mut r, 0.7)];
        let at = Pose::new(r.direction() * r.within(0.4, 1.6), r.rotation());
        let place = Pose::new(r.vector(1.0), r.rotation());
        let [p, q] = [Body::mesh(&a), Body::mesh(&b)];
        let d = distance((&p, &place), (&q, &place.compose(&at)), 10.0);
        let e = distance((&q, &place.compose(&at)), (&p, &place), 10.0);
        assert!((d - e).abs() < 1e-12, "{i}: {d} {e}");
        // Points of the second mesh's triangles, against the first by brute force.
        let mut sampled = f64::INFINITY;
        for t in &b.1 {
            let [x, y, z] = t.map(|v| at.point(b.0[v as usize]));
            for (u, v) in (0..=12).flat_map(|u| (0..=12 - u).map(move |v| (f64::from(u) / 12.0, f64::from(v) / 12.0))) {
                sampled = sampled.min(from_mesh(&a, x + (y - x) * u + (z - x) * v));
            }
        }
        assert!(d <= sampled + 1e-12 && sampled <= d + 0.2, "{i}: {d} {sampled}");
        (met, apart) = (met + usize::from(d == 0.0), apart + usize::from(d > 0.0));
        let ball = distance((&p, &place), (&Body::ball(0.1), &place.compose(&at)), 10.0);
        assert!((ball - (from_mesh(&a, at.position) - 0.1).max(0.0)).abs() < 1e-12);
    }
    assert!(5 * met > count && 5 * apart > count, "{met} {apart}");
}

#[test]
fn every_edge_of_every_shell_has_two_triangles_that_run_along_it_either_way() {
    let field = |x: DVec3| (x.length() - 0.7).max(0.3 - x.truncate().length());
    let all = [
        flange(24, 4),
        filleted(24, 6),
        cup(16, 6),
        gear(12, 8, 3, 0.4),
        screw(24, 40, 8.0),
        nut(24, 16, 4.0),
        spring(80, 8),
        knot(90, 8),
        chain_link(24, 8),
        arm(16, 12),
        elbow(8, 16),
        stone(6),
        perforated(3, 24, 0.6, 0.05),
        sheet(8, 0.01),
        sampled(field, (DVec3::splat(-0.7), DVec3::splat(0.7)), 0.11),
    ];
    for (k, (points, triangles)) in all.iter().enumerate() {
        let mut along: HashMap<(u32, u32), i32> = HashMap::new();
        for t in triangles {
            (0..3).for_each(|i| *along.entry((t[i], t[(i + 1) % 3])).or_default() += 1);
        }
        for ((a, b), count) in &along {
            assert_eq!((*count, along.get(&(*b, *a))), (1, Some(&1)), "{k}: {a} {b}");
        }
        let volume: f64 =
            triangles.iter().map(|t| t.map(|v| points[v as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
        assert!(volume.abs() > 1e-3, "{k}: {volume}");
    }
}
