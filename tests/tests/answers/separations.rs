//! Separations against their own optimality: disjoint bodies are proven by a slab and by witnesses of equal distance.

use super::kinds::pairs;
use contactd::solid::{Shape, primitive as shape};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_tests::closed::{
    Ball, Best, Convex, Feature, ROWS, Round, Stand, clearance, meridian, miller, round_round, separation,
    separation_only, tangency_of_cavities,
};
use glam::{DMat3, DVec3};

/// Pseudo-random numbers (splitmix64), the same ones for the same seed.
struct Random(u64);

impl Random {
    /// A number of [lo, hi).
    fn within(&mut self, lo: f64, hi: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        lo + (hi - lo) * (((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64)
    }
    /// A point of the cube of half side `size` around the origin.
    fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::new(self.within(-size, size), self.within(-size, size), self.within(-size, size))
    }
}

/// Random numbers, bodies and where they stand.
struct Dice(Random);

impl Dice {
    fn shape(&mut self, kind: usize) -> Shape {
        let r = self.0.within(0.2, 1.0);
        let h = self.0.within(0.2, 1.0);
        match kind {
            0 => shape::Sphere { radius: r }.into(),
            1 => shape::Cylinder { radius: r, half_height: h }.into(),
            2 => shape::Cone { bottom: r, top: 0.0, half_height: h }.into(),
            3 => shape::Cone { bottom: 0.5 * r, top: r, half_height: h }.into(),
            4 => shape::Cuboid { half: DVec3::new(r, h, self.0.within(0.2, 1.0)) }.into(),
            _ => shape::Polyhedron::platonic([4, 8, 12, 20][kind % 4], r).expect("a regular body").into(),
        }
    }
    fn stand(&mut self, far: f64) -> Stand {
        let q = quat_of_rotation_vector(self.0.vector(2.0));
        Stand { origin: self.0.vector(far), axes: DMat3::from_quat(q) }
    }
    fn body(&mut self, kind: usize, far: f64) -> Convex {
        let stand = self.stand(far);
        Convex::of(&self.shape(kind)).expect("bounded").placed(&stand)
    }
}

const KINDS: usize = 9;

/// The body scaled about its middle by `k`.
fn shrink(body: &mut Convex, k: f64) {
    let middle = body.ball().0;
    let to = |p: &mut DVec3| *p = middle + (*p - middle) * k;
    match body {
        Convex::Ball(b) => b.radius *= k,
        Convex::Cylinder(r) | Convex::Cone(r) => {
            r.centers.iter_mut().for_each(to);
            r.radii = r.radii.map(|x| x * k);
        }
        Convex::Poly(p) => {
            p.vertices.iter_mut().for_each(to);
            p.edges.iter_mut().flat_map(|e| &mut e.ends).for_each(to);
            p.planes.iter_mut().for_each(|(n, d)| *d = n.dot(middle) + (*d - n.dot(middle)) * k);
        }
    }
}

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
    let mut dice = Dice(Random(1));
    let mut worst = 0.0f64;
    let mut failed = Vec::new();
    let (mut apart, count) = (0, pairs(20));
    for i in 0..KINDS {
        for j in 0..KINDS {
            for k in 0..count {
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
    assert!(3 * apart > 100 * count && failed.is_empty());
}

#[test]
fn a_negative_separation_has_a_common_point() {
    // Alternating projections are an independent verdict: they converge to a common point or to a gap.
    let mut dice = Dice(Random(2));
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
    let mut dice = Dice(Random(3));
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
    let mut dice = Dice(Random(4));
    for _ in 0..500 {
        let s = dice.stand(0.5);
        let place = |c: &Shape, o: DVec3| {
            let stand = Stand { origin: s.origin + s.axes * o, axes: s.axes };
            Convex::of(c).expect("bounded").placed(&stand)
        };
        let (a, b) = (dice.shape(1), dice.shape(1));
        let (a, b) = (place(&a, DVec3::ZERO), place(&b, dice.0.vector(2.5)));
        let (value, _) = separation_only(&a, &b, None);
        let (Convex::Cylinder(p), Convex::Cylinder(q)) = (&a, &b) else { unreachable!() };
        let mut best = Best::new(&a, &b, None);
        round_round::general(p, q, &mut best);
        assert!((best.value() - value).abs() < 1e-13, "{} {value}", best.value());
    }
}

#[test]
fn parallel_cones_agree_with_the_general_configurations() {
    let mut dice = Dice(Random(6));
    let mut apart = 0;
    for i in 0..600 {
        let s = dice.stand(0.5);
        let (ka, kb) = ([1, 2, 3][i % 3], [2, 3][i / 3 % 2]);
        let (a, b) = (dice.shape(ka), dice.shape(kb));
        let offset = if i % 5 == 0 { DVec3::Z * dice.0.within(-3.0, 3.0) } else { dice.0.vector(2.5) };
        let place = |c: &Shape, o: DVec3| {
            let stand = Stand { origin: s.origin + s.axes * o, axes: s.axes };
            Convex::of(c).expect("bounded").placed(&stand)
        };
        let (a, b) = (place(&a, DVec3::ZERO), place(&b, offset));
        let (Convex::Cylinder(p) | Convex::Cone(p), Convex::Cone(q)) = (&a, &b) else { unreachable!() };
        let (mut planar, mut general) = (Best::new(&a, &b, None), Best::new(&a, &b, None));
        assert!(meridian::parallel(p, q, &mut planar), "axes in one direction");
        if planar.value() > 0.0 {
            apart += 1;
            round_round::general(p, q, &mut general);
            assert!((general.value() - planar.value()).abs() < 1e-12, "{} {}", general.value(), planar.value());
        }
    }
    assert!(apart > 200, "{apart}");
}

#[test]
fn the_curve_of_two_cones_is_there_when_their_sides_cross_and_shrinks_to_the_touching_point() {
    let mut dice = Dice(Random(7));
    let (mut crossing, mut touching, mut apart) = (0, 0, 0);
    let mut worst = [0.0f64; 2];
    let count = 50 * pairs(30);
    for i in 0..count {
        let (ka, kb) = (2 + i % 2, 2 + i / 2 % 2);
        let (a, b) = (dice.body(ka, 1.2), dice.body(kb, 1.2));
        let (Convex::Cone(p), Convex::Cone(q)) = (&a, &b) else { unreachable!() };
        let sides = |q: &Round| (miller::Side::of(p).expect("a cone"), miller::Side::of(q).expect("a cone"));
        let (sa, sb) = sides(q);
        let points = miller::curve(&sa, &sb);
        // Every critical point lies on both bodies' surfaces.
        for x in &points {
            let off = a.distance(*x).0.abs().max(b.distance(*x).0.abs());
            // A generator's middle point on the curve lies inside B.
            assert!(a.distance(*x).0.abs() < 1e-9 || b.distance(*x).0.abs() < 1e-9, "{off:e}");
        }
        let s = separation(&a, &b, None);
        if s.value > 1e-9 {
            apart += 1;
            assert!(points.is_empty(), "apart by {} but the sides meet in {points:?}", s.value);
            // Moved together along the normal, the sides touch in the witness, if sides hold the witnesses.
            if s.features == [Feature::Face; 2]
                && [&a, &b].iter().zip([s.normal, -s.normal]).all(|(r, n)| {
                    let (Convex::Cone(r), c) = (r, n) else { return false };
                    (c.dot(r.axis) - r.lean).abs() < 1e-9
                })
            {
                touching += 1;
                let moved = |gap: f64| {
                    let shift = s.normal * (gap - s.value);
                    let c = Round { centers: q.centers.map(|c| c + shift), ..*q };
                    let sides = sides(&c);
                    (miller::critical_generators(&sides.0, &sides.1), miller::curve(&sides.0, &sides.1))
                };
                assert!(moved(1e-10).1.is_empty() && !moved(-1e-10).1.is_empty(), "the curve appears at touch");
                let nearest = moved(0.0).0.into_iter().map(|g| (g.discriminant, (g.point - s.points[0]).length()));
                let (d, off) = nearest.min_by(|x, y| x.1.total_cmp(&y.1)).expect("a critical generator");
                worst = [worst[0].max(d.abs()), worst[1].max(off)];
            }
        } else if !points.is_empty() {
            crossing += 1;
            assert!(s.value < 0.0, "crossing sides overlap: {}", s.value);
        }
    }
    println!(
        "{crossing} crossing, {apart} apart, {touching} brought to touch: discriminant {:.1e}, point {:.1e}",
        worst[0], worst[1]
    );
    assert!(8 * crossing > count && 8 * apart > count && 80 * touching > count);
    assert!(worst[0] < 1e-13 && worst[1] < 1e-6);
}

#[test]
fn the_clearance_in_a_cavity_is_that_of_its_nearest_point() {
    // The smallest clearance over many boundary points of the body never undercuts the closed form, and comes close:
    // for tilted and for parallel axes.
    let mut dice = Dice(Random(5));
    let mut counted = [[0; KINDS]; KINDS];
    for i in 0..KINDS {
        for j in 0..KINDS {
            for k in 0..40 {
                let s = dice.stand(0.1);
                let (a, b) = (dice.shape(i), dice.shape(j));
                let axes = if k % 4 == 0 { s.axes } else { dice.stand(0.0).axes };
                let stand = Stand { origin: s.origin + s.axes * dice.0.vector(0.1), axes };
                let mut a = Convex::of(&a).expect("bounded").placed(&stand);
                let b = Convex::of(&b).expect("bounded").placed(&s);
                // Small enough to find room: shrunk about its middle.
                let scale = dice.0.within(0.15, 0.6);
                shrink(&mut a, scale);
                let c = clearance(&a, &b);
                if c.value <= 0.0 {
                    continue;
                }
                counted[i][j] += 1;
                let mut least = -b.distance(c.point).0;
                assert!((least - c.value).abs() < 1e-13);
                assert!(a.distance(c.point).0.abs() < 1e-13, "the point lies on the body");
                for _ in 0..300 {
                    least = least.min(-b.distance(a.support(dice.0.vector(1.0))).0);
                }
                // Along the rims, which hold the extreme points of a round body.
                if let Convex::Cylinder(p) | Convex::Cone(p) = &a {
                    for rim in p.rims() {
                        for n in 0..400 {
                            let e = contactd::math::any_perpendicular(rim.axis);
                            let (sin, cos) = (f64::from(n) * std::f64::consts::TAU / 400.0).sin_cos();
                            let x = rim.center + (e * cos + rim.axis.cross(e) * sin) * rim.radius;
                            least = least.min(-b.distance(x).0);
                        }
                    }
                    assert!(least - c.value < 1e-3, "{} in {}: {} {least}", named(&a), named(&b), c.value);
                }
                assert!(least > c.value - 1e-13, "{} in {}: {} {least}", named(&a), named(&b), c.value);
            }
        }
    }
    assert!(counted.iter().flatten().all(|n| *n >= 3), "{counted:?}");
}

#[test]
fn cavities_touch_from_outside_and_from_inside() {
    let ball = |x: f64, radius: f64| Convex::Ball(Ball { center: DVec3::X * x, radius });
    assert_eq!(tangency_of_cavities(&ball(0.0, 1.0), &ball(1.5, 0.5)), [0.0, -1.0]);
    assert_eq!(tangency_of_cavities(&ball(0.0, 1.0), &ball(0.5, 0.5)), [-1.0, 0.0]);
    let hole = |x: f64, z: f64, radius: f64| {
        let stand = Stand { origin: DVec3::new(x, 0.0, z), axes: DMat3::IDENTITY };
        Convex::of(&shape::Cylinder { radius, half_height: 1.0 }.into()).expect("bounded").placed(&stand)
    };
    let near = |x: [f64; 2], y: [f64; 2]| (x[0] - y[0]).abs().max((x[1] - y[1]).abs()) < 1e-15;
    assert!(near(tangency_of_cavities(&hole(0.0, 0.0, 1.0), &hole(2.5, 0.0, 1.0)), [0.5, -2.5]));
    // The smaller one sticks out of the larger one's cap by a quarter.
    assert!(tangency_of_cavities(&hole(0.0, 0.0, 1.0), &hole(0.25, 0.25, 0.5))[1] == -0.25);
}
