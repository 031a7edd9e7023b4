//! The general search against the closed forms of whole primitives, on random pairs of every combination.
//!
//! The two share no bound, no clause and no root finder: the closed forms know supports and common normals, the search
//! knows faces and cells. Figure: |Δtime| × closing speed in units of the pair's size. `CONTACTD_PAIRS=1000` sets the
//! number of pairs per ordered combination, 16,000 in all (200 by default).
#![allow(missing_docs)]

use contactd::contact::closed::{Meeting, time_of_contact};
use contactd::contact::{Status, default_resolution};
use contactd::eco::Model;
use contactd::motion::{Placed, Relative};
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ask_models;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use glam::DVec3;

const SPHERE: usize = 0;
const CYLINDER: usize = 1;
const CONE: usize = 2;
const POLYHEDRON: usize = 3;

fn shape(r: &mut Random, kind: usize) -> Recipe {
    let (d, h) = (r.within(0.2, 1.0), r.within(0.2, 1.0));
    match kind {
        SPHERE => Recipe::sphere(d),
        CYLINDER => Recipe::cylinder(d, h),
        CONE if r.chance(0.5) => Recipe::cone(d, 0.0, h),
        CONE => Recipe::cone(d * r.within(0.1, 0.8), d, h),
        _ if r.chance(0.4) => Recipe::cuboid(d, h, r.within(0.2, 1.0)),
        _ => Recipe::platonic([4, 8, 12, 20][r.below(4)], d),
    }
}

/// A body that starts a few sizes away and heads roughly for the origin, turning.
fn motion(r: &mut Random, far: f64) -> Motion {
    let from = r.direction() * far;
    let spin = if r.chance(0.3) { DVec3::ZERO } else { r.vector(1.5) };
    Motion::turning(Pose::new(from, r.rotation()), r.vector(1.6), spin)
}

fn family(a: usize, b: usize) {
    let count: usize = std::env::var("CONTACTD_PAIRS").ok().and_then(|n| n.parse().ok()).unwrap_or(200);
    let mut r = Random::new(1000 + 10 * a as u64 + b as u64);
    let (mut gaps, mut contacts, mut clear, mut undecided) = (Vec::new(), 0, 0, 0);
    let (mut refuted, mut far_off, mut unanswered, mut open) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for i in 0..count {
        let (ma, mb) = (shape(&mut r, a), shape(&mut r, b));
        let (ma, mb) = (Model::new(ma.build()), Model::new(mb.build()));
        let place = Pose::IDENTITY;
        let pa = Placed { place, motion: motion(&mut r, 2.2) };
        let pb = Placed { place, motion: Motion::resting(Pose::new(r.vector(0.2), r.rotation())) };
        let size = default_resolution(&ma, &mb) / 1e-9;
        let (qa, qb) = (&ma.solid.primitives[0], &mb.solid.primitives[0]);
        let closed = time_of_contact(qa, qb, &Relative::new(pa, pb)).expect("convex primitives");
        let o = ask_models((&ma, pa), (&mb, pb), None);
        assert_eq!(o.counters.closed_forms, 0, "the search must stand on its own");
        if o.status == Status::Undecided {
            unanswered.push(i);
            continue;
        }
        match closed {
            Meeting::Contact(c) if o.status == Status::Contact => {
                contacts += 1;
                assert!(o.counters.cells > 0);
                open += usize::from(c.upper.is_infinite());
                let speed = c.speed.abs().max(o.normal_speed.abs());
                let gap = (c.time - o.time).abs() * speed / size;
                gaps.push(gap);
                if gap > 1e-12 {
                    far_off.push(format!("{i}: {gap:.1e} at speed {speed:.1e} ({:?})", o.kind));
                }
                // Brackets that exclude each other cannot both be right.
                if c.lower > o.time_upper + 1e-12 || c.upper < o.time_lower - 1e-12 {
                    refuted.push(format!("{i}: {c:?} against [{} {} {}]", o.time_lower, o.time, o.time_upper));
                }
            }
            Meeting::Clear if o.status == Status::Clear => clear += 1,
            Meeting::Overlap(_) if o.status == Status::Overlap => {}
            Meeting::Undecided(_) => undecided += 1,
            _ => refuted.push(format!("{i}: {closed:?} against {:?} at {}", o.status, o.time)),
        }
    }
    gaps.sort_by(f64::total_cmp);
    let at = |f: f64| gaps.get(((gaps.len() as f64 * f) as usize).min(gaps.len().saturating_sub(1))).copied();
    println!(
        "{count} pairs: {contacts} contacts, {clear} clear, {undecided} undecided here, {unanswered:?} by the search; gap median {:.1e} 99 % {:.1e} worst \
         {:.1e}; over 1e-12: {}; upper end open: {open}",
        at(0.5).unwrap_or(0.0),
        at(0.99).unwrap_or(0.0),
        at(1.0).unwrap_or(0.0),
        far_off.len()
    );
    assert!(refuted.is_empty(), "{} refuted:\n{}", refuted.len(), refuted.join("\n"));
    assert!(contacts * 5 > count && clear * 20 > count, "{contacts} contacts and {clear} clear say little");
    assert_eq!(undecided, 0);
    // The search may run out of cells where edges are nearly parallel; the closed form answers these.
    assert!(unanswered.len() * 100 <= count, "the search left {unanswered:?} open");
    assert!(far_off.is_empty(), "over 1e-12:\n{}", far_off.join("\n"));
    assert!(open * 100 <= contacts, "{open} contacts without a common point");
}

#[test]
fn sphere_against_sphere() {
    family(SPHERE, SPHERE);
}

#[test]
fn sphere_against_cylinder() {
    family(SPHERE, CYLINDER);
    family(CYLINDER, SPHERE);
}

#[test]
fn sphere_against_cone() {
    family(SPHERE, CONE);
    family(CONE, SPHERE);
}

#[test]
fn sphere_against_polyhedron() {
    family(SPHERE, POLYHEDRON);
    family(POLYHEDRON, SPHERE);
}

#[test]
fn cylinder_against_cylinder() {
    family(CYLINDER, CYLINDER);
}

#[test]
fn cylinder_against_cone() {
    family(CYLINDER, CONE);
    family(CONE, CYLINDER);
}

#[test]
fn cone_against_cone() {
    family(CONE, CONE);
}

#[test]
fn cylinder_against_polyhedron() {
    family(CYLINDER, POLYHEDRON);
    family(POLYHEDRON, CYLINDER);
}

#[test]
fn cone_against_polyhedron() {
    family(CONE, POLYHEDRON);
    family(POLYHEDRON, CONE);
}

#[test]
fn polyhedron_against_polyhedron() {
    family(POLYHEDRON, POLYHEDRON);
}
