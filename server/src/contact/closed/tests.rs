//! Separations against their own optimality: disjoint bodies are proven by a slab and by witnesses of equal distance.

use super::*;
use crate::solid::{Shape, primitive as shape};
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DMat3, DVec3};

/// A small generator of our own: splitmix64.
struct Dice(u64);

impl Dice {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn range(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }
    fn vector(&mut self, r: f64) -> DVec3 {
        DVec3::new(self.range(-r, r), self.range(-r, r), self.range(-r, r))
    }
    fn shape(&mut self, kind: usize) -> Shape {
        let r = self.range(0.2, 1.0);
        let h = self.range(0.2, 1.0);
        match kind {
            0 => shape::Sphere { radius: r }.into(),
            1 => shape::Cylinder { radius: r, half_height: h }.into(),
            2 => shape::Cone { bottom: r, top: 0.0, half_height: h }.into(),
            3 => shape::Cone { bottom: 0.5 * r, top: r, half_height: h }.into(),
            4 => shape::Cuboid { half: DVec3::new(r, h, self.range(0.2, 1.0)) }.into(),
            _ => shape::Polyhedron::platonic([4, 8, 12, 20][kind % 4], r).expect("a regular body").into(),
        }
    }
    fn stand(&mut self, far: f64) -> Stand {
        let q = quat_of_rotation_vector(self.vector(2.0));
        Stand { origin: self.vector(far), axes: DMat3::from_quat(q) }
    }
    fn body(&mut self, kind: usize, far: f64) -> Convex {
        let stand = self.stand(far);
        Convex::of(&self.shape(kind)).expect("bounded").placed(&stand)
    }
}

const KINDS: usize = 9;

fn named(x: &Convex) -> &'static str {
    match x {
        Convex::Ball(_) => "Ball",
        Convex::Cylinder(_) => "Cylinder",
        Convex::Cone(_) => "Cone",
        Convex::Poly(_) => "Poly",
    }
}

#[test]
fn every_unordered_pair_of_kinds_has_one_row() {
    let mut rows: Vec<_> = ROWS.iter().map(|&(a, b)| if a < b { (a, b) } else { (b, a) }).collect();
    rows.sort();
    rows.dedup();
    assert_eq!((rows.len(), ROWS.len()), (10, 10));
}

#[test]
fn witnesses_and_slab_prove_each_other_when_apart() {
    let mut dice = Dice(1);
    let mut worst = 0.0f64;
    let mut failed = Vec::new();
    let mut apart = 0;
    for i in 0..KINDS {
        for j in 0..KINDS {
            for k in 0..60 {
                let (a, b) = (dice.body(i, 1.5), dice.body(j, 1.5));
                let s = separation(&a, &b, None);
                if s.value <= 0.0 {
                    continue;
                }
                apart += 1;
                let inside = a.distance(s.points[0]).0.max(b.distance(s.points[1]).0);
                let gap = (s.points[0] - s.points[1]).length() - s.value;
                worst = worst.max(gap);
                if inside > 1e-13 || gap.abs() > 1e-12 {
                    failed.push(format!("{} {} {k}: {:.3e} {gap:.3e} {inside:.3e}", named(&a), named(&b), s.value));
                }
            }
        }
    }
    println!("{apart} disjoint pairs, largest gap {worst:.2e}, failed {}", failed.len());
    for f in failed.iter().take(40) {
        println!("{f}");
    }
    assert!(apart > 2000 && failed.is_empty());
}

#[test]
fn a_negative_separation_has_a_common_point() {
    // Alternating projections are an independent verdict: they converge to a common point or to a gap.
    let mut dice = Dice(2);
    let mut overlapping = 0;
    for i in 0..KINDS {
        for j in 0..KINDS {
            for k in 0..20 {
                let (a, b) = (dice.body(i, 0.9), dice.body(j, 0.9));
                let s = separation(&a, &b, None);
                if s.value > -1e-3 {
                    continue;
                }
                overlapping += 1;
                let mut x = b.ball().0;
                for _ in 0..20_000 {
                    let y = b.project(x);
                    if (x - y).length() < 1e-6 && a.distance(y).0 < 1e-6 {
                        break;
                    }
                    x = a.project(y);
                }
                let d = (x - b.project(x)).length();
                assert!(d < 1e-4, "{} {} {k}: {} but {d} apart", named(&a), named(&b), s.value);
            }
        }
    }
    assert!(overlapping > 500, "{overlapping}");
}

#[test]
fn swapping_the_pair_turns_the_normal() {
    let mut dice = Dice(3);
    for i in 0..KINDS {
        for j in 0..KINDS {
            let (a, b) = (dice.body(i, 1.5), dice.body(j, 1.5));
            let ((s, n), (t, m)) = (separation_only(&a, &b, None), separation_only(&b, &a, None));
            assert!((s - t).abs() < 1e-12, "{s} {t}");
            assert!(s < 1e-3 || (n + m).length() < 1e-5, "{} {}: {s} {n} {m}", named(&a), named(&b));
        }
    }
}

#[test]
fn parallel_cylinders_agree_with_the_general_configurations() {
    let mut dice = Dice(4);
    for _ in 0..500 {
        let s = dice.stand(0.5);
        let place = |c: &Shape, o: DVec3| {
            let stand = Stand { origin: s.origin + s.axes * o, axes: s.axes };
            Convex::of(c).expect("bounded").placed(&stand)
        };
        let (a, b) = (dice.shape(1), dice.shape(1));
        let (a, b) = (place(&a, DVec3::ZERO), place(&b, dice.vector(2.5)));
        let (value, _) = separation_only(&a, &b, None);
        let (Convex::Cylinder(p), Convex::Cylinder(q)) = (&a, &b) else { unreachable!() };
        let mut best = Best::new(&a, &b, None);
        round_round::general(p, q, &mut best);
        assert!((best.value - value).abs() < 1e-13, "{} {value}", best.value);
    }
}

#[test]
fn the_clearance_in_a_cavity_is_that_of_its_nearest_point() {
    // The smallest clearance over many boundary points of the body never undercuts the closed form, and comes close.
    let mut dice = Dice(5);
    let mut counted = 0;
    for i in 0..KINDS {
        for j in 0..KINDS {
            for _ in 0..20 {
                let s = dice.stand(0.1);
                let (a, b) = (dice.shape(i), dice.shape(j));
                let shift = s.axes * DVec3::new(0.05, -0.03, 0.02);
                let a = Convex::of(&a).expect("bounded").placed(&Stand { origin: s.origin + shift, axes: s.axes });
                let b = Convex::of(&b).expect("bounded").placed(&s);
                let Some(c) = clearance(&a, &b) else { continue };
                if c.value <= 0.0 {
                    continue;
                }
                counted += 1;
                let mut least = -b.distance(c.point).0;
                assert!((least - c.value).abs() < 1e-13);
                assert!(a.distance(c.point).0.abs() < 1e-13, "the point lies on the body");
                for _ in 0..300 {
                    let p = a.support(dice.vector(1.0));
                    least = least.min(-b.distance(p).0);
                }
                assert!(least > c.value - 1e-12, "{} in {}: {} {least}", named(&a), named(&b), c.value);
            }
        }
    }
    assert!(counted > 100, "{counted}");
}

#[test]
fn spherical_cavities_touch_from_outside_and_from_inside() {
    let ball = |x: f64, radius: f64| Ball { center: DVec3::X * x, radius };
    assert_eq!(tangency_of_cavities(&ball(0.0, 1.0), &ball(1.5, 0.5)), [0.0, -1.0]);
    assert_eq!(tangency_of_cavities(&ball(0.0, 1.0), &ball(0.5, 0.5)), [-1.0, 0.0]);
}
