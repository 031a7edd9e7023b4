//! Laws of stage 2's walk: when cubes can meet, and that no pair of surfaces that meets is missed.

use contactd::bound::{CollisionRegion, Side, locate};
use contactd::motion::{Placed, Relative};
use contactd::octree::{Approach, Detail, Model, PairKind, Walk};
use contactd::solid::primitive::{Cuboid, Cylinder};
use contactd::solid::{Label, Node, Op, Sense, Solid, SolidBuilder};
use contactd_proto::{Motion, Pose};
use contactd_tests::random_solids::{Random, perforated_plate, placed, solid};
use contactd_tests::sweep::sized;
use glam::DVec3;

#[test]
fn cubes_never_meet_before_the_time_proven() {
    let mut r = Random::new(11);
    let (mut never, mut meet, mut tight) = (0, 0, 0);
    let pairs = 50 * sized("CONTACTD_PAIRS", 20);
    for i in 0..pairs {
        let (pa, pb) = (placed(&mut r, 1.0), placed(&mut r, 1.0));
        let (a, b) = ((r.vector(0.5), r.within(0.1, 0.7)), (r.vector(0.5), r.within(0.1, 0.7)));
        let approach = Approach::new(pa, pb, 0.0);
        let from = if i % 3 == 0 { r.within(0.0, 0.5) } else { 0.0 };
        let earliest = approach.earliest(a, b, from, 1.0);
        assert!(earliest.is_none_or(|t| (from..=1.0).contains(&t)));
        let mut first = f64::INFINITY;
        for k in 0..=300 {
            let t = from + (1.0 - from) * f64::from(k) / 300.0;
            let at = approach.relative().at(t);
            let inside = (0..20).any(|j| {
                // Points of A's cube, its corners first.
                let s = |bit: usize| if j >> bit & 1 == 0 { -a.1 } else { a.1 };
                let e = if j < 8 { DVec3::new(s(0), s(1), s(2)) } else { r.vector(a.1) };
                (at.b_point(a.0 + e) - b.0).abs().max_element() <= b.1
            });
            if inside {
                first = t;
                break;
            }
        }
        match earliest {
            None => assert!(first == f64::INFINITY, "pair {i} meets at {first}"),
            Some(t) => assert!(t <= first, "pair {i} meets at {first}, proven until {t}"),
        }
        never += usize::from(earliest.is_none());
        meet += usize::from(first.is_finite());
        tight += usize::from(first.is_finite() && earliest.is_some_and(|t| first - t < 0.02));
    }
    println!(
        "cubes: {pairs} pairs, {never} proven apart, {meet} seen to meet, {tight} of them within 0.02 of the bound"
    );
    assert!(meet * 10 > 3 * pairs && (never + meet) * 100 > 80 * pairs && tight * 2 > meet);
}

/// f at `x` and the primitive that decides it.
fn deciding(s: &Solid, n: u32, x: DVec3) -> (f64, u32) {
    match &s.nodes[n as usize] {
        Node::Empty => (f64::INFINITY, u32::MAX),
        Node::Primitive(p) => (s.primitives[*p as usize].value(x), *p),
        Node::Op(op, children) => {
            let values = children.iter().enumerate().map(|(i, c)| {
                let (v, p) = deciding(s, *c, x);
                (if *op == Op::Difference && i > 0 { -v } else { v }, p)
            });
            let by = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0);
            if *op == Op::Union { values.min_by(by) } else { values.max_by(by) }.expect("an operation has operands")
        }
    }
}

/// A point on the solid's surface (|f| below 1e-12), on a subtracted primitive if `negative` and one can be found.
fn surface_point(r: &mut Random, s: &Solid, negative: bool) -> Option<(DVec3, u32)> {
    let mut found = None;
    for _ in 0..200 {
        let (mut x, mut y) = (r.point_in(&s.aabb()), r.point_in(&s.aabb().grown(0.2)));
        if (s.value(x) < 0.0) == (s.value(y) < 0.0) {
            continue;
        }
        for _ in 0..70 {
            let m = (x + y) * 0.5;
            if (s.value(m) < 0.0) == (s.value(x) < 0.0) { x = m } else { y = m }
        }
        let (f, p) = deciding(s, s.root, x);
        if f.abs() < 1e-12 {
            found = Some((x, p));
            if !negative || s.senses[p as usize] == Sense::Negative {
                break;
            }
        }
    }
    found
}

fn region_of(a: &Model, pa: Placed, b: &Model, pb: Placed, margin: f64) -> Option<CollisionRegion> {
    let a = Side { solid: &a.solid, bounds: &a.bounds, placed: pa };
    let b = Side { solid: &b.solid, bounds: &b.bounds, placed: pb };
    locate(&a, &b, 0.0, 1.0, margin)
}

/// Pairs of random solids: `CONTACTD_PAIRS=120` is the long form.
#[test]
fn no_pair_of_surfaces_that_meets_is_missed() {
    let (mut r, count) = (Random::new(12), sized("CONTACTD_PAIRS", 30));
    let (mut met, mut subtracted, mut overlap, mut clear) = (0, 0, 0, 0);
    let (mut pairs_all, mut pairs_found) = (0, 0);
    for i in 0..count {
        let (a, b) = (Model::new(solid(&mut r, 1 + i % 4)), Model::new(solid(&mut r, 1 + i % 3)));
        // Let a point of A's surface and one of B's coincide at a time of the step; seldom when they overlap at the start.
        let t = [1.0, 1.0, r.within(0.0, 1.0)][r.below(3)];
        let want = (r.below(2) == 0, r.below(3) == 0);
        let surface = (i % 5 > 0)
            .then(|| surface_point(&mut r, &a.solid, want.0).zip(surface_point(&mut r, &b.solid, want.1)))
            .flatten();
        let (mut pa, mut pb) = (placed(&mut r, 1.5), placed(&mut r, 1.5));
        for attempt in 0..6 {
            if attempt > 0 {
                (pa, pb) = (placed(&mut r, 1.5), placed(&mut r, 1.5));
            }
            if let Some(((x, _), (y, _))) = surface {
                let world = |p: &Placed, x| p.motion.at(t).point(p.place.point(x));
                pb.motion.start.position += world(&pa, x) - world(&pb, y);
            }
            let at = Relative::new(pa, pb).at(0.0);
            let depth = |x: DVec3| a.solid.value(x).max(b.solid.value(at.b_point(x)));
            if (0..300).all(|_| depth(r.point_in(&a.solid.aabb())) > 0.0) {
                break;
            }
        }
        let margin = 0.5 * a.margin().min(b.margin());
        let region = region_of(&a, pa, &b, pb, margin);
        let relative = Relative::new(pa, pb);
        // Seen by sampling: overlap at the start, or somewhere in the step.
        let (mut at_start, mut within) = (false, false);
        for k in 0..400 {
            let at = relative.at(if k % 2 == 0 { 0.0 } else { r.within(0.0, 1.0) });
            let x = if k % 4 < 2 { r.point_in(&a.solid.aabb()) } else { at.a_point(r.point_in(&b.solid.aabb())) };
            if a.solid.value(x).max(b.solid.value(at.b_point(x))) < -margin {
                at_start |= k % 2 == 0;
                within = true;
            }
        }
        let Some(region) = region else {
            assert!(surface.is_none() && !within, "pair {i}: stage 1 misses it");
            clear += 1;
            continue;
        };
        let fine = Detail { finest: 0.02 * a.radius, ..Detail::default() };
        let detail = [Detail::default(), fine, Detail { node_pairs: 500, ..fine }][i % 3];
        let walk = Walk::new((&a, pa), (&b, pb), (i % 5 > 0).then(|| region.clone().into()), margin, detail);
        let found = walk.candidates();
        let mut sorted = found.pairs.clone();
        sorted.dedup();
        assert_eq!(sorted.len(), found.pairs.len(), "a pair twice");
        for p in &found.pairs {
            for (e, m) in [(p.a, &a), (p.b, &b)] {
                assert_eq!(e.complemented, m.solid.senses[e.surface as usize] == Sense::Negative);
                assert!(e.volume.is_none_or(|v| e.complemented && m.solid.senses[v as usize] == Sense::Positive));
            }
        }
        if let Some(((_, p), (_, q))) = surface {
            assert!(
                found.pairs.iter().any(|c| (c.a.surface, c.b.surface) == (p, q)),
                "pair {i}: surfaces {p} {q} at {t}"
            );
            subtracted += usize::from(
                a.solid.senses[p as usize] == Sense::Negative || b.solid.senses[q as usize] == Sense::Negative,
            );
        }
        pairs_all += a.solid.primitives.len() * b.solid.primitives.len();
        pairs_found += found.pairs.len();
        overlap += usize::from(at_start);
        met += usize::from(!at_start && (surface.is_some() || within));
        clear += usize::from(!at_start && surface.is_none() && !within);
    }
    println!(
        "walk: {count} pairs: {met} contact, {clear} clear, {overlap} overlap; {subtracted} on subtracted surfaces; \
         primitive pairs {pairs_all} -> {pairs_found}"
    );
    assert!(met * 10 >= 3 * count && subtracted * 100 >= 15 * count && 12 * clear > count && pairs_found < pairs_all);
}

fn still() -> Placed {
    Placed { place: Pose::IDENTITY, motion: Motion::resting(Pose::IDENTITY) }
}

fn moving(from: DVec3, to: DVec3, spin: DVec3) -> Placed {
    Placed { place: Pose::IDENTITY, motion: Motion::turning(Pose::at(from), to, spin) }
}

#[test]
fn a_peg_in_its_hole_is_an_n_pair_that_names_the_plate_too() {
    let plate = Model::new(perforated_plate(10));
    let mut b = SolidBuilder::new();
    let root = b.primitive(Cylinder { radius: 0.15, half_height: 0.5 }, Pose::IDENTITY, Label::default());
    let peg = Model::new(b.finish(root));
    let down = moving(DVec3::new(0.5, 0.5, 0.9), DVec3::new(0.5, 0.5, 0.0), DVec3::Z);
    let region = region_of(&plate, still(), &peg, down, 1e-9).expect("they are close");
    let all = plate.solid.primitives.len() * peg.solid.primitives.len();
    for (finest, most) in [(f64::INFINITY, 3), (0.02, 3)] {
        let walk = Walk::new(
            (&plate, still()),
            (&peg, down),
            Some(region.clone().into()),
            1e-9,
            Detail { finest, ..Detail::default() },
        );
        let found = walk.candidates();
        println!("peg: {all} pairs, p/n/nn {:?} after {} node pairs", found.count(), found.node_pairs);
        assert!(found.pairs.len() <= most);
        let hole = found.pairs.iter().find(|p| p.kind() == PairKind::N).expect("the hole's surface");
        let p = &plate.solid.primitives[hole.a.surface as usize];
        assert!((p.frame.position - DVec3::new(0.5, 0.5, 0.0)).length() < 1e-12 && hole.a.complemented);
    }
    // Two plates, hole over hole: nn-pairs. Without stage 1 the walk alone finds what matters.
    let across = moving(DVec3::new(0.0, 0.0, 0.7), DVec3::new(0.05, 0.0, 0.1), DVec3::ZERO);
    let detail = Detail { node_pairs: 300_000, ..Detail::default() };
    let walk = Walk::new((&plate, still()), (&plate, across), None, 1e-9, detail);
    let found = walk.candidates();
    println!("two plates: {} pairs, p/n/nn {:?} after {} node pairs", 201 * 201, found.count(), found.node_pairs);
    assert!(found.count().iter().all(|n| *n > 0) && found.pairs.len() * 10 < 201 * 201);
}

#[test]
fn an_n_surface_names_volume_and_boundary() {
    // A block with a large ball taken out of its middle: most voxels at the hole's wall see only block and ball.
    let mut b = SolidBuilder::new();
    let block = b.primitive(Cuboid { half: DVec3::splat(1.0) }, Pose::IDENTITY, Label::default());
    let ball = b.primitive(contactd::solid::primitive::Sphere { radius: 0.7 }, Pose::IDENTITY, Label::default());
    let root = b.operation(Op::Difference, &[block, ball]);
    let socket = Model::new(b.finish(root));
    let mut b = SolidBuilder::new();
    let root = b.primitive(contactd::solid::primitive::Sphere { radius: 0.1 }, Pose::IDENTITY, Label::default());
    let ball = Model::new(b.finish(root));
    let path = moving(DVec3::ZERO, DVec3::new(0.65, 0.1, 0.0), DVec3::ZERO);
    let found = Walk::new((&socket, still()), (&ball, path), None, 1e-9, Detail::default()).candidates();
    let pair = found.pairs.iter().find(|p| p.kind() == PairKind::N).expect("the wall");
    assert_eq!((pair.a.surface, pair.a.volume, pair.b.surface, pair.b.volume), (1, Some(0), 0, None));
}
