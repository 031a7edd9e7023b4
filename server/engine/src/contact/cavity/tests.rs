//! What is proven of bodies in cavities, against what is known of them. The answers themselves: tests/tests/search/cavities.rs.

use super::body::{Moment, Plane};
use super::layers::layers;
use super::pierced::{CavityPair, Wall};
use super::proof::ProofEnd;
use super::{Sight, Unions};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::found::Ending;
use crate::contact::{PairQuery, PlacedModel, QueryOptions, Strategies, default_resolution};
use crate::math::random::Random;
use crate::motion::{Placed, Relative, Sweep};
use crate::octree::Model;
use crate::octree::testing::{pierced, simple};
use crate::solid::local::LiteralId;
use crate::solid::parts::Parts;
use crate::solid::primitive::{Cone, Cuboid, Cylinder, Sphere};
use crate::solid::{Label, Op, Sense, Shape, SolidBuilder};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use glam::{DVec3, dvec3};

/// A vector of length `size` across the cavity.
fn across(n: &mut Random, size: f64) -> DVec3 {
    let angle = n.within(0.0, std::f64::consts::TAU);
    dvec3(angle.cos(), angle.sin(), 0.0) * size
}

fn rest() -> Motion {
    Motion::resting(Pose::IDENTITY)
}

fn moving(at: DVec3, tilt: DVec3, by: DVec3, spin: DVec3) -> Motion {
    Motion::turning(Pose::new(at, quat_of_rotation_vector(tilt)), at + by, spin)
}

fn asked<'m>(a: PlacedModel<'m>, b: PlacedModel<'m>) -> PairQuery<'m> {
    PairQuery {
        a,
        b,
        resolution: default_resolution(a.model, b.model),
        cell_limit: 1000,
        strategies: Strategies::default(),
        query_options: QueryOptions::DEPTH,
    }
}

fn plate() -> Model {
    pierced(
        Cuboid { half: dvec3(0.5, 0.5, 0.1) },
        vec![(Cylinder { radius: 0.25, half_height: 0.5 }.into(), Pose::IDENTITY)],
    )
}

#[test]
fn what_is_shown_to_keep_apart_is_farther_apart() {
    let (plate, peg) = (plate(), simple(Cylinder { radius: 0.2, half_height: 0.5 }));
    let mut n = Random(17);
    let mut shown = 0;
    for i in 0..400 {
        // Upright, so that the gap between peg and wall is known.
        let off = n.within(0.0, 0.06);
        let at = across(&mut n, off) + DVec3::Z * n.within(-0.3, 0.3);
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let still = Motion::resting(Pose::new(at, quat_of_rotation_vector(DVec3::Z * n.within(0.0, 3.0))));
        let sides = [(&plate, rest()), (&peg, still)].map(|(model, m)| PlacedModel { model, placed: placed(m) });
        let [a, b] = if i % 2 == 0 { sides } else { [sides[1], sides[0]] };
        let query = asked(a, b);
        let (task, _) = Task::of(&query);
        let (gap, way) = (0.25 - 0.2 - off, n.within(0.0, 0.06));
        let kept = super::keeps_apart(&task, way);
        assert!(!kept || way <= gap, "{i}: {way} of {gap}");
        shown += u32::from(kept);
        // Half of it is lost to the weights.
        assert!(kept || way > 0.4 * gap, "{i}: {way} of {gap}");
    }
    assert!(shown > 60, "{shown}");
}

#[test]
fn unions_that_are_shown_to_keep_apart_are_farther_apart() {
    // Steps of a stair, and a block with a ball in front of it: the ball over the middle of the step that is as far away as any.
    let stair = |depths: [f64; 3]| {
        let mut b = SolidBuilder::new();
        let block = |(i, depth): (usize, f64)| (Cuboid { half: dvec3(0.5 * depth, 0.5, 0.5) }, i as f64 - 1.0, depth);
        let steps = depths.into_iter().enumerate().map(block);
        let steps = steps.map(|(shape, y, depth)| (shape, Pose::at(dvec3(0.5 * depth, y, 0.0))));
        let steps: Vec<_> = steps.map(|(shape, pose)| b.primitive(shape, pose, Label::default())).collect();
        let all = b.operation(Op::Union, &steps);
        Model::new(b.finish(all))
    };
    let mut b = SolidBuilder::new();
    let parts = [
        b.primitive(Cuboid { half: dvec3(0.1, 0.1, 0.1) }, Pose::at(DVec3::X * 0.3), Label::default()),
        b.primitive(Sphere { radius: 0.2 }, Pose::IDENTITY, Label::default()),
    ];
    let whole = b.operation(Op::Union, &parts);
    let knob = Model::new(b.finish(whole));
    let mut n = Random(23);
    let mut shown = 0;
    for i in 0..300 {
        let depths = [n.within(0.5, 1.5), n.within(0.5, 1.5), n.within(0.5, 1.5)];
        let step = n.within(0.0, 3.0) as usize;
        // All others stand back by more than the ball's radius, so that they are farther.
        let depths = std::array::from_fn(|k| if k == step { depths[k] } else { depths[k].min(depths[step] - 0.1) });
        let stair = stair(depths);
        let gap = n.within(0.001, 0.04);
        // Straight in front of the step's middle the line between the middles tells; else the nearest points do.
        let aside = if i % 3 == 0 { 0.0 } else { 0.2 };
        let [y, z] = [0, 1].map(|_| n.within(-aside, aside));
        let at = dvec3(depths[step] + 0.2 + gap, step as f64 - 1.0 + y, z);
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let still = Motion::resting(Pose::at(at));
        let sides = [(&stair, rest()), (&knob, still)].map(|(model, m)| PlacedModel { model, placed: placed(m) });
        let [a, b] = if i % 2 == 0 { sides } else { [sides[1], sides[0]] };
        let query = asked(a, b);
        let (task, _) = Task::of(&query);
        let way = n.within(0.0, 0.04);
        let kept = super::keeps_apart(&task, way);
        assert_eq!(kept, way < gap, "{i}: {way} of {gap}");
        shown += u32::from(kept);
    }
    assert!(shown > 100, "{shown}");
}

#[test]
fn parts_that_touch_first_are_found_beside_others_that_are_deep_first() {
    // A ball, and beside it an edge of 90° that reaches lower by less than a resolution; the ball is asked first.
    let delta = 1e-7;
    let floor = simple(Cuboid { half: dvec3(2.0, 2.0, 0.5) });
    for lower in [0.2, 0.6] {
        let mut b = SolidBuilder::new();
        let edge = DVec3::Z * (0.08f64.sqrt() - lower * delta) + DVec3::X * 0.7;
        let turned = quat_of_rotation_vector(DVec3::X * std::f64::consts::FRAC_PI_4);
        let ball = Pose::at(dvec3(-0.7, 0.0, 0.25));
        let parts = [
            b.primitive(Sphere { radius: 0.25 }, ball, Label::default()),
            b.primitive(Cuboid { half: dvec3(0.2, 0.2, 0.2) }, Pose::new(edge, turned), Label::default()),
        ];
        let whole = b.operation(Op::Union, &parts);
        let pair = Model::new(b.finish(whole));
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let below = Motion::resting(Pose::at(DVec3::Z * -0.5));
        let falls = moving(DVec3::Z * 0.5, DVec3::ZERO, -DVec3::Z, DVec3::ZERO);
        let query = PairQuery {
            resolution: delta,
            ..asked(
                PlacedModel { model: &floor, placed: placed(below) },
                PlacedModel { model: &pair, placed: placed(falls) },
            )
        };
        let (task, _) = Task::of(&query);
        let [of_a, of_b] = [task.a, task.b].map(|solid| Parts::of(solid).expect("a union"));
        let pairs = of_a.all().iter().flat_map(|a| of_b.all().iter().map(|b| (*a, *b))).collect();
        let unions = Unions::new(&task, [&of_a, &of_b], pairs, true);
        let mut contacts = Contacts::new(task);
        for index in 0..2 {
            let parts = unions.convex(index).expect("two convex parts");
            let Sight::Apart(at_start) = parts.sight() else { panic!("apart by half of the step") };
            assert!(parts.meet(&mut contacts, &at_start, false), "{index}");
        }
        let Ending::Contact(found) = contacts.end() else { panic!("a contact") };
        let t = found.touch.expect("a touch").t;
        assert!((t - (0.5 - lower * delta)).abs() < 1e-12, "{lower}: {t}");
    }
}

#[test]
fn a_proof_does_not_jump_over_an_arc() {
    // A ball on an arm of .5 swings through an arc along a pipe with .05 to spare. The arc's middle is off the axis by .06, or by
    // .04 less its height.
    let pipe = pierced(
        Cylinder { radius: 0.5, half_height: 1.0 },
        vec![(Cylinder { radius: 0.25, half_height: 1.5 }.into(), Pose::IDENTITY)],
    );
    let ball = {
        let mut b = SolidBuilder::new();
        let n = b.primitive(Sphere { radius: 0.2 }, Pose::at(DVec3::X * 0.5), Label::default());
        Model::new(b.finish(n))
    };
    for (turn, met) in [(0.8, true), (0.2, false)] {
        let start = Pose::new(DVec3::X * (0.06 - 0.5), quat_of_rotation_vector(DVec3::Y * (-0.5 * turn)));
        let rise = 0.5 * (1.0 - (0.5 * turn).cos());
        let start = Pose { position: start.position - DVec3::X * (if met { 0.0 } else { rise + 0.02 }), ..start };
        let motion = Motion::turning(start, start.position, DVec3::Y * turn);
        let query = PairQuery {
            a: PlacedModel { model: &pipe, placed: Placed { place: Pose::IDENTITY, motion: rest() } },
            b: PlacedModel { model: &ball, placed: Placed { place: Pose::IDENTITY, motion } },
            resolution: default_resolution(&pipe, &ball),
            cell_limit: 1000,
            strategies: Strategies::default(),
            query_options: QueryOptions::DEPTH,
        };
        let (task, swapped) = Task::of(&query);
        let (placed_a, placed_b) = task.relative.placed();
        let seen = Relative::new(placed_b, placed_a);
        let (of_pipe, of_ball, side, relative) = if swapped {
            (task.model_b, task.a, Side::B, &task.relative)
        } else {
            (task.model_a, task.b, Side::A, &seen)
        };
        let [main, hole] = [0, 1].map(|i| &of_pipe.solid.primitives[i]);
        let pair =
            CavityPair::new(&task, &of_ball.primitives[0], (main, hole), side, relative).expect("a ball in a pipe");
        let ends = [0.0, 1.0].map(|t| pair.best(&pair.moment(t), Wall::Round(DVec3::X)).phi);
        assert!(ends.iter().all(|phi| *phi > 0.0), "{ends:?}");
        let (verdict, _) = pair.prove(1.0, None);
        assert_eq!(verdict == ProofEnd::Proven, !met, "{turn}: {verdict:?}");
    }
}

#[test]
fn no_point_of_a_body_is_in_the_wall_within_a_proven_span() {
    let plate = plate();
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    let mut r = Random(29);
    let (mut proven, mut met) = (0, 0);
    for i in 0..6000 {
        let radius = r.within(0.1, 0.245);
        let peg = simple(Cylinder { radius, half_height: r.within(0.05, 0.5) });
        let (at, tilt) = (across(&mut r, 0.5 * (0.25 - radius)), r.vector(1.0));
        let (by, spin) = (r.vector(0.1), r.vector(2.5));
        let motion = moving(at, tilt, by, spin);
        let query = PairQuery {
            a: PlacedModel { model: &plate, placed: placed(rest()) },
            b: PlacedModel { model: &peg, placed: placed(motion) },
            resolution: default_resolution(&plate, &peg),
            cell_limit: 1000,
            strategies: Strategies::default(),
            query_options: QueryOptions::DEPTH,
        };
        let (task, _) = Task::of(&query);
        let relative = Relative::new(placed(motion), placed(rest()));
        let [main, hole] = [0, 1].map(|k| &plate.solid.primitives[k]);
        let primitive = &peg.solid.primitives[0];
        let pair = CavityPair::new(&task, primitive, (main, hole), Side::A, &relative).expect("a peg in a hole");
        if pair.prove(1.0, None).0 != ProofEnd::Proven {
            met += 1;
            continue;
        }
        proven += 1;
        for k in 0..=40 {
            let m = pair.moment(f64::from(k) / 40.0);
            for j in 0..32 {
                let u = DVec3::X.rotate_z(std::f64::consts::TAU * f64::from(j) / 32.0);
                let x = pair.best(&m, Wall::Round(u)).x;
                let within = pair.planes.iter().all(|p| p.normal.dot(x) <= p.offset);
                assert!(!within || u.dot(x) <= 0.25, "{i}: {x} at {}", m.at.t);
            }
        }
    }
    assert!(proven > 200 && met > 2000, "{proven} {met}");
}

#[test]
fn no_point_of_a_body_is_in_the_wall_of_a_hole_of_layers_within_a_proven_span() {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    let mut r = Random(31);
    let (mut proven, mut met) = ([0; 4], 0);
    for i in 0..1500 {
        // A bore with a countersink, or with a counterbore, whose floor the bore goes through; some with a groove around, round or of
        // two cones, some with a square pocket from below.
        let deep = r.within(0.02, 0.08);
        let wide = 0.21 + r.within(0.0, 3.0) * deep;
        let (height, middle) = (0.5 * (deep + 0.01), Pose::at(DVec3::Z * (0.1 - 0.5 * (deep - 0.01))));
        let is_cone = i % 2 == 0;
        let mouth: Shape = if is_cone {
            Cone { bottom: r.within(0.15, 0.205), top: wide, half_height: height }.into()
        } else {
            Cylinder { radius: wide, half_height: height }.into()
        };
        let bore = (Cylinder { radius: 0.2, half_height: 0.5 }.into(), Pose::at(DVec3::X * r.within(-0.02, 0.02)));
        let mut holes = vec![bore, (mouth, middle)];
        let has_more = i % 4 / 2 == 1;
        if has_more {
            let (half, from) = (r.within(0.005, 0.02), r.within(-0.04, -0.01));
            let outer = 0.2 + r.within(0.0, 0.05);
            match i / 4 % 3 {
                0 => holes.push((Cylinder { radius: outer, half_height: half }.into(), Pose::at(DVec3::Z * from))),
                1 => {
                    let side = |bottom, top, z: f64| {
                        (Cone { bottom, top, half_height: half }.into(), Pose::at(DVec3::Z * (from + z)))
                    };
                    holes.extend([side(0.2, outer, -half), side(outer, 0.2, half)]);
                }
                _ => holes.push((
                    Cuboid { half: dvec3(0.19, outer, 0.05) }.into(),
                    Pose::at(DVec3::Z * (-0.1 - r.within(0.0, 0.04))),
                )),
            }
        }
        let plate = pierced(Cuboid { half: dvec3(0.5, 0.5, 0.1) }, holes);
        let radius = r.within(0.05, 0.22);
        let (top, half_height) = (radius * r.within(0.3, 1.2), r.within(0.05, 0.5));
        let peg: Shape = match i % 3 {
            0 => Cylinder { radius, half_height }.into(),
            1 => Cone { bottom: radius, top, half_height }.into(),
            _ => Sphere { radius }.into(),
        };
        let is_ball = i % 3 == 2;
        let peg = simple(peg);
        let at = across(&mut r, 0.6 * (0.2 - radius).max(0.0))
            + DVec3::Z * r.within(-0.4, 0.6) * if is_ball { 0.2 } else { 1.0 };
        let motion = moving(at, r.vector(0.5), r.vector(0.1), r.vector(0.5));
        let query = asked(
            PlacedModel { model: &plate, placed: placed(rest()) },
            PlacedModel { model: &peg, placed: placed(motion) },
        );
        let (task, _) = Task::of(&query);
        let relative = Relative::new(placed(motion), placed(rest()));
        let (main, holes) = plate.solid.primitives.split_at(1);
        let primitive = &peg.solid.primitives[0];
        let of =
            |hole| CavityPair::new(&task, primitive, (&main[0], hole), Side::A, &relative).expect("a peg in a hole");
        let all: Vec<CavityPair> = holes.iter().map(of).collect();
        let swept = Sweep::new(placed(motion), placed(rest())).of_box(&primitive.aabb, 0.0, 1.0);
        let reached = swept.intersection(&main[0].aabb);
        let center = at.clamp(reached.min, reached.max);
        let Some(pieces) = layers(&all, DVec3::Z, &reached, center, center) else { continue };
        if pieces.len() < 2 || !pieces.iter().all(|piece| piece.prove(1.0, None).0 == ProofEnd::Proven) {
            met += 1;
            continue;
        }
        proven[(i % 4) as usize] += 1;
        let grid = |j: i32, of: i32| f64::from(j) / f64::from(of);
        for k in 0..=10 {
            let at = relative.at(f64::from(k) / 10.0);
            let around = (0..24).map(|j| DVec3::X.rotate_z(std::f64::consts::TAU * grid(j, 24)));
            let mut points: Vec<DVec3> = Vec::new();
            for u in around {
                let discs = &pieces[0].body.discs;
                if is_ball {
                    let up = (-6..=6).map(|l| 1.5 * grid(l, 6));
                    points.extend(
                        up.map(|angle: f64| discs[0].0 + (u * angle.cos() + DVec3::Z * angle.sin()) * discs[0].1),
                    );
                } else {
                    let [from, to] = [discs[0], discs[1]].map(|(center, radius)| center + u * radius);
                    points.extend((0..=12).map(|l| from.lerp(to, grid(l, 12))));
                }
            }
            for x in points.into_iter().map(|x| at.b_point(x)) {
                assert!(plate.value(x) >= -task.delta, "{i}: {x} at {} is {} deep", at.t, -plate.value(x));
            }
        }
    }
    assert!(proven.iter().all(|n| *n > 15) && met > 100, "{proven:?} {met}");
}

#[test]
fn a_best_bound_is_the_reach_of_the_cut_body() {
    // Against the farthest of many points of a tilted cylinder, frustum or box below a plane.
    let mut r = Random(5);
    for i in 0..60 {
        let shape: Shape = match i % 3 {
            0 => Cylinder { radius: 0.24, half_height: 0.5 }.into(),
            1 => Cone { bottom: 0.1, top: 0.3, half_height: 0.4 }.into(),
            _ => Cuboid { half: dvec3(0.2, 0.1, 0.4) }.into(),
        };
        let model = simple(shape);
        let motion = moving(r.vector(0.3), r.vector(0.6), DVec3::ZERO, DVec3::ZERO);
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let relative = Relative::new(placed(motion), placed(rest()));
        let primitive = &model.solid.primitives[0];
        let literal = LiteralId::new(0, Sense::Positive);
        let planes = [Plane { normal: DVec3::Z, offset: r.within(-0.2, 0.2), literal }];
        let m = Moment::new(&super::body::CavityBody::of(primitive).expect("bounded"), relative.at(0.0), &planes);
        let u = across(&mut r, 1.0);
        let best = m.best(u, 0.0, &planes);
        let mut reach = f64::NEG_INFINITY;
        let inside = |x: DVec3| primitive.value(m.at.a_point(x)) <= 1e-9 && x.z <= planes[0].offset + 1e-9;
        assert!(inside(best.x), "{i}: {}", best.x);
        for _ in 0..4000 {
            let x = best.x + r.vector(0.3) * r.unit().powi(4);
            if primitive.value(m.at.a_point(x)) <= 0.0 && x.z <= planes[0].offset {
                reach = reach.max(u.dot(x));
            }
        }
        // No point reaches farther than the bound, and the body's own point as far.
        assert!(reach <= -best.phi + 1e-12, "{i}: {reach} beyond {}", -best.phi);
        assert!((u.dot(best.x) + best.phi).abs() < 1e-9, "{i}: {} for {}", u.dot(best.x), -best.phi);
        let own = best.bound.base - best.bound.kappa - m.reach(best.bound.w()).0;
        assert!((own - best.phi).abs() < 1e-12, "{i}");
    }
}
