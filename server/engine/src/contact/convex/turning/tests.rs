//! What is proven of turning pairs, against their gaps at many times in between.

use super::super::tests::{Bodies, pose};
use super::*;
use crate::contact::convex::overlap::Look;
use crate::math::random::Random;
use crate::solid::primitive::{Cuboid, Cylinder};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use std::f64::consts::FRAC_PI_2;

/// Rods and blocks that turn by up to two radians near each other, and rods that come down on a floor and swing by up to half
/// a turn: the end that is nearer at first is not always the one that hits it.
fn pairs(mut look: impl FnMut(usize, &Turning, DVec3)) {
    let mut numbers = Random(31);
    for i in 0..2500 {
        let rod = Cylinder { radius: numbers.within(0.02, 0.2), half_height: numbers.within(0.3, 0.9) };
        let (block, frames, motions) = if i < 1500 {
            let block = Cuboid { half: numbers.vector(0.4).abs() + 0.05 };
            let motions = [0, 1].map(|_| {
                let start = pose(&mut numbers, 0.9);
                Motion::turning(start, numbers.vector(0.4), numbers.vector(1.2))
            });
            (block, [0, 1].map(|_| pose(&mut numbers, 0.2)), motions)
        } else {
            let lying = quat_of_rotation_vector(DVec3::Y * (FRAC_PI_2 + numbers.within(-1.0, 1.0)));
            let above = DVec3::Z * numbers.within(0.2, 1.4);
            let (spin, end) = (DVec3::Y * numbers.within(-3.5, 3.5), above - DVec3::Z * numbers.within(0.0, 2.5));
            let floor = Motion::resting(Pose::at(DVec3::Z * -0.5));
            let swinging = Motion::turning(Pose::new(above, lying), end, spin);
            (Cuboid { half: DVec3::new(3.0, 3.0, 0.5) }, [Pose::IDENTITY; 2], [floor, swinging])
        };
        Bodies::new([block.into(), rod.into()], frames, motions).with(|pair| {
            let start = Start::new(pair).expect("bounded");
            if let Look::Apart(n) = start.look(&mut 0)
                && let Some(turning) = Turning::new(&start, pair.spins())
            {
                look(i, &turning, n);
            }
        });
    }
}

#[test]
fn between_two_gaps_no_gap_is_smaller_than_is_proven() {
    let (mut all, mut part) = (0, 0);
    pairs(|i, turning, n| {
        let ends = [turning.turns.at(0.0), turning.turns.at(1.0)];
        let p = turning.gap(&ends[0], n.normalize());
        let q = turning.nearest(&ends[1], p.n, TRIES[0].0).unwrap_or_else(|| turning.gap(&ends[1], p.n));
        for q in [q, turning.gap(&ends[1], p.n)] {
            let until = turning.pace.proven(&p, &q);
            (all, part) = (all + u32::from(until == 1.0), part + u32::from(until > 0.0 && until < 1.0));
            for k in 0..=100 {
                let t = until * f64::from(k) / 100.0;
                let phi = turning.gap(&turning.turns.at(t), p.n + (q.n - p.n) * t).phi;
                assert!(phi > turning.pace.least, "{i}: {phi} at {t}, proven until {until}");
            }
        }
    });
    assert!(all > 40 && part > 1500, "{all} proven to the end, {part} for a part");
}

/// A wider gap near a direction, where that one proves nothing: by trial, smaller and smaller.
fn widened(turning: &Turning, m: &Posed, n: DVec3, numbers: &mut Random) -> Gap {
    let mut best = turning.gap(m, n.normalize_or(DVec3::X));
    let mut step = 0.3;
    while best.phi <= turning.pace.least && step > 1e-7 {
        let tried = (0..12).map(|_| turning.gap(m, (best.n + numbers.vector(step)).normalize()));
        let better = tried.max_by(|p, q| p.phi.total_cmp(&q.phi)).expect("some are tried");
        if better.phi > best.phi { best = better } else { step *= 0.7 }
    }
    best
}

#[test]
fn what_is_told_of_a_turning_pair_leaves_a_gap_at_all_times_before() {
    let (mut hits, mut misses, mut numbers) = (0, 0, Random(32));
    pairs(|i, turning, n| {
        let mut out = Outcome::clear(turning.pair.delta);
        if turning.meet(n, QueryOptions::CONTACT, &mut out).is_none() {
            return;
        }
        (hits, misses) = (hits + u32::from(out.time() < 1.0), misses + u32::from(out.time() == 1.0));
        let mut along = n;
        for k in 0..200 {
            let m = turning.turns.at(out.time() * f64::from(k) / 200.0);
            let near =
                [Some(along), turning.nearest(&m, along, TRIES[1].0).map(|g| g.n), out.point().map(|p| p.normal)];
            let wide = near.into_iter().flatten().map(|n| widened(turning, &m, n, &mut numbers));
            let wide = wide.max_by(|p, q| p.phi.total_cmp(&q.phi)).expect("a direction");
            assert!(wide.phi > turning.pace.least, "{i}: {} at {} of {}", wide.phi, m.t, out.time());
            along = wide.n;
        }
    });
    println!("{hits} hits, {misses} misses");
    assert!(hits > 300 && misses > 300, "{hits} hits, {misses} misses");
}
