//! Laws of stage 1: swept bounds, S-bounds, and the collision region of a pair, over random trees and motions.

use contactd::bound::{Pruned, SBounds, Side, Volumes, locate};
use contactd::math::{Aabb, Ball};
use contactd::motion::{Instant, Placed, Relative, Sweep};
use contactd::solid::{Node, Op, Solid};
use contactd_tests::random_solids::{Random, perforated_plate, placed, solid};
use contactd_tests::sweep::sized;
use glam::DVec3;

const VOLUMES: [Volumes; 4] = [Volumes::Both, Volumes::Balls, Volumes::Boxes, Volumes::Oriented];

fn random_box(r: &mut Random) -> Aabb {
    let half = DVec3::new(r.within(0.0, 1.0), r.within(0.0, 1.0), r.within(0.0, 1.0));
    Aabb::around(r.vector(1.0), half)
}

#[test]
fn a_ball_rule_holds_what_its_operands_hold() {
    let mut r = Random::new(1);
    let (mut lenses, mut empty) = (0, 0);
    for _ in 0..20_000 {
        let a = Ball::new(r.vector(1.0), r.within(0.01, 1.5));
        let b = Ball::new(r.vector(1.0), r.within(0.01, 1.5));
        let (join, meet) = (a.union(&b), a.intersection(&b));
        assert!(
            join.radius <= (a.radius + b.radius + (a.center - b.center).length()) * 0.5 * (1.0 + 1e-12)
                || join.radius == a.radius.max(b.radius)
        );
        assert!(meet.is_empty() || meet.radius <= a.radius.min(b.radius));
        lenses += usize::from(!meet.is_empty() && meet.radius < a.radius.min(b.radius));
        empty += usize::from(meet.is_empty());
        for _ in 0..8 {
            // Points on and in either sphere, poles of the line of centres among them.
            let along = (b.center - a.center).normalize() * if r.below(2) == 0 { 1.0 } else { -1.0 };
            let n = if r.below(4) == 0 { along } else { r.vector(1.0).normalize() };
            let s = if r.below(2) == 0 { a } else { b };
            let x = s.center + n * (s.radius * if r.below(2) == 0 { 1.0 } else { r.within(0.0, 1.0) });
            let inside = |c: &Ball| (x - c.center).length() <= c.radius;
            assert!((x - join.center).length() <= join.radius * (1.0 + 1e-15));
            assert!(!(inside(&a) && inside(&b)) || inside(&meet));
        }
    }
    println!("ball rules: 20000 pairs, {lenses} lenses, {empty} apart");
    assert!(lenses > 4000 && empty > 500);
}

#[test]
fn a_swept_box_or_ball_holds_every_moved_point() {
    let mut r = Random::new(2);
    let (mut looseness, mut tight, mut turning) = (vec![], vec![], 0);
    let count = 10 * sized("CONTACTD_PAIRS", 20);
    for i in 0..count {
        let (mover, observer) = (placed(&mut r, 3.0), placed(&mut r, 3.0));
        let b = random_box(&mut r);
        let ball = Ball::new(b.center(), b.half().max_element());
        let t0 = if i % 2 == 0 { 0.0 } else { r.within(0.0, 0.9) };
        let t1 = if i % 3 == 0 { 1.0 } else { r.within(t0, 1.0) };
        let sweep = Sweep::new(mover, observer);
        let (swept, swept_ball) = (sweep.of_box(&b, t0, t1), sweep.of_ball(&ball, t0, t1));
        let (around, along) = (sweep.around_ball(&ball, t0, t1), sweep.along_mover(&b, t0, t1));
        turning += usize::from(observer.motion.spin != DVec3::ZERO && mover.motion.spin != DVec3::ZERO);
        let mut seen = Aabb::EMPTY;
        for k in 0..=400 {
            let t = t0 + (t1 - t0) * f64::from(k) / 400.0;
            let world = |x: DVec3| mover.motion.at(t).point(mover.place.point(x));
            let back = observer.place.inverse().compose(&observer.motion.at(t).inverse());
            for x in b.corners().into_iter().chain([r.point_in(&b)]) {
                let y = back.point(world(x));
                assert!(swept.contains(y), "{i} at {t}: {y} outside {swept:?}");
                let own = along.axes.transpose() * (y - along.center);
                assert!(own.abs().cmple(along.half).all(), "{i} at {t}: {own} outside {along:?}");
                seen = seen.union(&Aabb::of_points([y]));
            }
            let n = r.vector(1.0).normalize();
            let y = back.point(world(ball.center + n * ball.radius));
            assert!(swept_ball.contains(y) && (y - around.center).length() <= around.radius);
        }
        if t1 - t0 < 0.1 {
            tight.push(along.half.element_product() / swept.half().element_product());
        }
        looseness.push((swept.half() / seen.half()).max_element());
    }
    looseness.sort_by(f64::total_cmp);
    println!(
        "swept boxes: {count}, both bodies turning {turning}; side against sampled side: median {:.4}, p90 {:.4}, worst {:.2}",
        looseness[count / 2],
        looseness[count * 9 / 10],
        looseness[count - 1]
    );
    tight.sort_by(f64::total_cmp);
    println!(
        "along the mover's axes, over less than a tenth: {} boxes, volume against the other's {:.2}",
        tight.len(),
        tight[tight.len() / 2]
    );
    assert!(
        5 * turning > count && looseness[count / 2] < 1.05 && 30 * tight.len() > count && tight[tight.len() / 2] < 1.0
    );
}

/// f of the subtree when every node is +infinity outside its bound.
fn bounded_value(s: &Solid, b: &SBounds, n: u32, x: DVec3) -> f64 {
    if !b.node(n).aabb.contains(x) || (x - b.node(n).ball.center).length() > b.node(n).ball.radius {
        return f64::INFINITY;
    }
    match &s.nodes[n as usize] {
        Node::Empty => f64::INFINITY,
        Node::Primitive(p) => s.primitives[*p as usize].value(x),
        Node::Op(op, children) => {
            let mut v = children.iter().map(|c| bounded_value(s, b, *c, x));
            match op {
                Op::Union => v.fold(f64::INFINITY, f64::min),
                Op::Intersection => v.fold(f64::NEG_INFINITY, f64::max),
                Op::Difference => {
                    let first = v.next().unwrap();
                    v.fold(first, |m, w| m.max(-w))
                }
            }
        }
    }
}

#[test]
fn s_bounds_hold_their_solid_and_what_they_leave_out_contributes_nothing() {
    let mut r = Random::new(3);
    let (mut inside, mut primitives, mut points, mut rounds) = (0, 0, 0, vec![]);
    let mut pruned = [0; VOLUMES.len()];
    for i in 0..400 {
        let s = solid(&mut r, 1 + i % 4);
        let margin = [0.0, 1e-6, 0.02][i % 3];
        let bounds = VOLUMES.map(|volumes| SBounds::with_volumes(&s, margin, volumes));
        rounds.push(bounds[0].rounds());
        primitives += s.primitives.len();
        for (count, b) in pruned.iter_mut().zip(&bounds) {
            *count += s.primitives.len() - b.primitives_left(&s);
        }
        let root = s.aabb().grown(0.1);
        assert!(root.is_finite(), "the generator makes bounded solids");
        for _ in 0..300 {
            let x = r.point_in(&root);
            let f = s.value(x);
            points += 1;
            inside += usize::from(f <= 0.0);
            for b in &bounds {
                if f <= margin {
                    assert!(b.root().aabb.contains(x), "seed {i}: f {f} outside the root's box");
                    assert!((x - b.root().ball.center).length() <= b.root().ball.radius);
                }
                let g = bounded_value(&s, b, s.root, x);
                assert_eq!(f.clamp(-margin, margin), g.clamp(-margin, margin), "seed {i} at {x}: f {f}, bounded {g}");
                assert_eq!(f <= margin, g <= margin);
            }
        }
    }
    rounds.sort();
    println!(
        "S-bounds: 400 solids, {primitives} primitives, {pruned:?} pruned by {VOLUMES:?}; {points} points, {:.0}% inside; rounds: median {}, p95 {}, most {}",
        100.0 * inside as f64 / points as f64,
        rounds[200],
        rounds[380],
        rounds[399]
    );
    assert!(inside * 20 > points && pruned[0] * 50 > primitives && rounds[380] < 8);
    // Balls and boxes together tell more than either.
    assert!(pruned[0] > pruned[1].max(pruned[2]));
}

#[test]
fn a_pair_outside_its_collision_region_never_meets_and_inside_pruning_changes_nothing() {
    let mut r = Random::new(4);
    let (mut contact, mut overlap, mut subtracted, mut before) = (0, 0, 0, 0);
    let (mut none, mut after) = ([0; VOLUMES.len()], [0; VOLUMES.len()]);
    let pairs = 5 * sized("CONTACTD_PAIRS", 24);
    for i in 0..pairs {
        let (sa, sb) = (solid(&mut r, 1 + i % 4), solid(&mut r, 1 + i % 3));
        let margin = [0.0, 1e-7, 0.01][i % 3];
        let bounds = VOLUMES.map(|v| [&sa, &sb].map(|s| SBounds::with_volumes(s, 1e-6, v)));
        // The deepest common point seen at a time: of the solids' own boxes, in turn.
        let depth = |r: &mut Random, at: &Instant, k: usize| {
            let x = if k.is_multiple_of(2) { r.point_in(&sa.aabb()) } else { at.a_point(r.point_in(&sb.aabb())) };
            let y = at.b_point(x);
            (x, y, sa.value(x), sb.value(y))
        };
        // Two pairs in three are led together late in the step; one that overlaps at the start is placed anew.
        let inner = |r: &mut Random, s: &Solid| {
            let points: Vec<DVec3> = (0..50).map(|_| r.point_in(&s.aabb())).collect();
            points.into_iter().min_by(|x, y| s.value(*x).total_cmp(&s.value(*y))).expect("fifty points")
        };
        let (mut pa, mut pb) = (placed(&mut r, 1.5), placed(&mut r, 1.5));
        let mut overlaps = true;
        for attempt in 0..8 {
            if attempt > 0 {
                (pa, pb) = (placed(&mut r, 1.5), placed(&mut r, 1.5));
            }
            if i % 3 > 0 {
                let t = r.within(0.7, 1.0);
                let world = |p: &Placed, x| p.motion.at(t).point(p.place.point(x));
                pb.motion.start.position += world(&pa, inner(&mut r, &sa)) - world(&pb, inner(&mut r, &sb));
            }
            let at = Relative::new(pa, pb).at(0.0);
            overlaps = (0..200).any(|k| {
                let (_, _, fa, fb) = depth(&mut r, &at, k);
                fa.max(fb) <= margin
            });
            if !overlaps {
                break;
            }
        }
        let regions = bounds.each_ref().map(|[ba, bb]| {
            let a = Side { solid: &sa, bounds: ba, placed: pa };
            let b = Side { solid: &sb, bounds: bb, placed: pb };
            locate(&a, &b, 0.0, 1.0, margin)
        });
        let relative = Relative::new(pa, pb);
        let (mut met, mut met_cut) = (false, false);
        for k in 0..800 {
            let at = relative.at(r.within(0.0, 1.0));
            let (x, y, fa, fb) = depth(&mut r, &at, k);
            if fa.max(fb) <= margin {
                met = true;
                met_cut |= cut_nearby(&sa, x) || cut_nearby(&sb, y);
                for region in &regions {
                    let region = region.as_ref().expect("a meeting pair has a region");
                    assert!(region.a.aabb.contains(x) && region.b.aabb.contains(y), "pair {i}");
                }
            }
            for g in regions.iter().flatten() {
                for (s, p, x, f) in [(&sa, &g.a, x, fa), (&sb, &g.b, y, fb)] {
                    if p.aabb.contains(x) {
                        let v = p.value(s, x);
                        assert_eq!(v.clamp(-margin, margin), f.clamp(-margin, margin), "pair {i} at {x}: {v} {f}");
                        assert_eq!(v <= margin, f <= margin);
                    }
                }
            }
        }
        overlap += usize::from(overlaps);
        contact += usize::from(met && !overlaps);
        subtracted += usize::from(met_cut && !overlaps);
        before += sa.primitives.len() + sb.primitives.len();
        for (k, region) in regions.iter().enumerate() {
            none[k] += usize::from(region.is_none());
            after[k] += region.as_ref().map_or(0, |g| g.a.primitives + g.b.primitives);
        }
    }
    let clear = pairs - contact - overlap;
    println!(
        "collision regions: {pairs} pairs, {contact} contact ({subtracted} at subtracted surfaces), {clear} clear ({none:?} \
         without a region, by {VOLUMES:?}), {overlap} overlap; primitives {before} -> {after:?}"
    );
    assert!(contact * 10 >= pairs * 3 && subtracted * 100 >= pairs * 15 && none[0] * 20 > pairs && after[0] < before);
    let [both, balls, boxes, oriented] = after;
    assert!(both < balls && both < boxes && oriented < both && none[3] >= none[0] && none[0] > none[1].max(none[2]));
}

/// True when the surface of a subtracted primitive passes within 0.1 of `x`.
fn cut_nearby(s: &Solid, x: DVec3) -> bool {
    let negative = |i: usize| s.senses[i] == contactd::solid::Sense::Negative;
    s.primitives.iter().enumerate().any(|(i, p)| negative(i) && p.value(x).abs() < 0.1)
}

#[test]
fn a_peg_over_one_hole_of_many_leaves_that_hole() {
    use contactd::solid::primitive::Cylinder;
    use contactd::solid::{Label, SolidBuilder};
    use contactd_proto::{Motion, Pose};
    let plate = perforated_plate(10);
    let mut b = SolidBuilder::new();
    let peg = b.primitive(Cylinder { radius: 0.15, half_height: 0.5 }, Pose::IDENTITY, Label::default());
    let peg = b.finish(peg);
    let (ba, bb) = (SBounds::new(&plate, 0.0), SBounds::new(&peg, 0.0));
    let start = Pose::at(DVec3::new(0.5, 0.5, 1.0));
    let a = Side {
        solid: &plate,
        bounds: &ba,
        placed: Placed { place: Pose::IDENTITY, motion: Motion::resting(Pose::IDENTITY) },
    };
    let down = Motion::turning(start, DVec3::new(0.5, 0.5, 0.0), DVec3::Z);
    let b = Side { solid: &peg, bounds: &bb, placed: Placed { place: Pose::IDENTITY, motion: down } };
    let region = locate(&a, &b, 0.0, 1.0, 1e-6).expect("the peg enters the plate's box");
    assert_eq!(region.a.primitives_before, 201);
    assert!(region.a.primitives <= 3, "{}", region.a.primitives);
    let whole = Pruned::whole(&plate, &ba).expect("a plate");
    assert_eq!(whole.primitives, 201);
    // Withdrawn upwards there is nothing to meet.
    let up = Motion::turning(start, DVec3::new(0.5, 0.5, 2.0), DVec3::Z);
    let b = Side { placed: Placed { place: Pose::IDENTITY, motion: up }, ..b };
    assert!(locate(&a, &b, 0.0, 1.0, 1e-6).is_none());
}
