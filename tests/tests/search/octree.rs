//! Laws of stage 2's octree: the paper's tables, and membership in octree and tree, over random solids.

use contactd::bound::SBounds;
use contactd::octree::local::{Classifier, whole};
use contactd::octree::span::primitive_span;
use contactd::octree::tables::combine;
use contactd::octree::{Limits, Meet, Model, Node, NodeKind, meet};
use contactd::solid::local::{self, Truth};
use contactd::solid::primitive::{Cuboid, Cylinder, Primitive, Sphere};
use contactd::solid::{Label, Op, Sense, Solid, SolidBuilder};
use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_tests::random_solids::{Random, node, perforated_plate, shape, solid};
use contactd_tests::sweep::sized;
use glam::DVec3;

// The paper's rows, as printed: the commutative tables by their lower half.
const UNION: &str = "
grey  | grey
full  | full | full
empty | grey | full | empty
p     | grey | full | p     | grey
n     | grey | full | n     | grey  | grey
mixed | -    | full | mixed | mixed | mixed | mixed";
const INTERSECTION: &str = "
grey  | grey
full  | grey  | full
empty | empty | empty | empty
p     | grey  | p     | empty | grey
n     | grey  | n     | empty | grey  | grey
mixed | -     | mixed | empty | mixed | mixed | mixed";
const DIFFERENCE: &str = "
grey  | grey  | grey  | empty | grey  | grey  | -
full  | empty | empty | empty | empty | empty | empty
empty | grey  | full  | empty | p     | n     | mixed
p     | grey  | n     | empty | grey  | grey  | mixed
n     | grey  | p     | empty | grey  | grey  | mixed
mixed | -     | mixed | empty | mixed | mixed | mixed";
const COLLISION: &str = "
grey  | branches
full  | branches | pairs
empty | skip     | skip  | skip
p     | branches | pairs | skip | pairs
n     | branches | pairs | skip | pairs | pairs
mixed | branches | pairs | skip | pairs | pairs | pairs";

fn kind(word: &str) -> Option<NodeKind> {
    match word {
        "-" => None,
        "p" => Some(NodeKind::PSurface),
        "n" => Some(NodeKind::NSurface),
        w => Some(NodeKind::ALL.into_iter().find(|k| k.name() == w).unwrap_or_else(|| panic!("no kind {w}"))),
    }
}

/// Calls `check(row kind, column kind, word)` for every printed cell; returns their number.
fn cells(table: &str, mut check: impl FnMut(NodeKind, NodeKind, &str)) -> usize {
    let mut count = 0;
    for line in table.trim().lines() {
        let mut words = line.split('|').map(str::trim);
        let row = kind(words.next().unwrap()).unwrap();
        for (column, word) in words.enumerate() {
            check(row, NodeKind::ALL[column], word);
            count += 1;
        }
    }
    count
}

#[test]
fn every_cell_of_the_four_tables_is_the_papers() {
    let n = cells(UNION, |a, b, w| {
        assert_eq!(combine(Op::Union, a, b), kind(w));
        assert_eq!(combine(Op::Union, b, a), kind(w));
    });
    assert_eq!(n, 21);
    let n = cells(INTERSECTION, |a, b, w| {
        assert_eq!(combine(Op::Intersection, a, b), kind(w));
        assert_eq!(combine(Op::Intersection, b, a), kind(w));
    });
    assert_eq!(n, 21);
    let n = cells(DIFFERENCE, |row_b, column_a, w| assert_eq!(combine(Op::Difference, column_a, row_b), kind(w)));
    assert_eq!(n, 36);
    let n = cells(COLLISION, |a, b, w| {
        let expected = match w {
            "branches" => Meet::Branches,
            "pairs" => Meet::Pairs,
            _ => Meet::Skip,
        };
        assert_eq!((meet(a, b), meet(b, a)), (expected, expected));
    });
    assert_eq!(n, 21);
}

#[test]
fn the_tables_treat_grey_and_mixed_alike_but_for_the_name() {
    let mixed = |k: NodeKind| if k == NodeKind::Grey { NodeKind::Mixed } else { k };
    for op in [Op::Union, Op::Intersection, Op::Difference] {
        for a in NodeKind::ALL {
            for b in NodeKind::ALL {
                if let Some(r) = combine(op, a, b) {
                    // Two surfaces give grey, at the lowest level mixed: the same thing.
                    assert_eq!(Some(mixed(r)), combine(op, mixed(a), mixed(b)).map(mixed), "{a:?} {op:?} {b:?}");
                }
            }
        }
    }
}

/// Asserts what a voxel's kind and references say at a point of the voxel; `slack` for points on a surface.
fn assert_membership(s: &Solid, kind: NodeKind, refs: &[u32], x: DVec3, slack: f64, what: &str) {
    let f = s.value(x);
    let psi = |i: usize| s.primitives[refs[i] as usize].value(x);
    let clear = |v: f64| v.abs() > slack;
    match kind {
        NodeKind::Full => {
            assert!(f <= slack, "{what}: full, but f = {f}");
            assert!(
                !refs.is_empty() && (0..refs.len()).all(|i| psi(i) <= slack),
                "{what}: full by a primitive beside it"
            );
        }
        NodeKind::Empty => assert!(f >= -slack, "{what}: empty, but f = {f}"),
        NodeKind::PSurface => {
            assert_eq!(refs.len(), 1);
            assert_eq!(s.senses[refs[0] as usize], Sense::Positive);
            assert!(!clear(f) || !clear(psi(0)) || (f < 0.0) == (psi(0) < 0.0), "{what}: p, f {f}, psi {}", psi(0));
        }
        NodeKind::NSurface => {
            assert_eq!(refs.len(), 2);
            assert_eq!((s.senses[refs[0] as usize], s.senses[refs[1] as usize]), (Sense::Positive, Sense::Negative));
            assert!(psi(0) <= slack, "{what}: n, the volume does not fill the voxel");
            assert!(!clear(f) || !clear(psi(1)) || (f < 0.0) == (psi(1) > 0.0), "{what}: n, f {f}, psi {}", psi(1));
        }
        NodeKind::Mixed | NodeKind::Grey => {
            assert!(kind == NodeKind::Grey || refs.len() > 1, "{what}: mixed by {refs:?}")
        }
    }
}

#[test]
fn combined_kinds_agree_with_dense_sampling_in_every_cell() {
    let mut seen = [[[0usize; 6]; 6]; 3];
    let (mut voxels, mut agree, mut sharper) = (0, 0, 0);
    for seed in 0..450u64 {
        let op = [Op::Union, Op::Intersection, Op::Difference][seed as usize % 3];
        // The operands by themselves, and both in one tree: the same seeds, the same primitives.
        let alone = |salt: u64| {
            let mut b = SolidBuilder::new();
            let root = node(&mut Random::new(seed * 2 + salt), &mut b, 2, 1.0, false);
            b.finish(root)
        };
        let (a, b) = (alone(0), alone(1));
        let mut builder = SolidBuilder::new();
        let left = node(&mut Random::new(seed * 2), &mut builder, 2, 1.0, false);
        let right = node(&mut Random::new(seed * 2 + 1), &mut builder, 2, 1.0, false);
        let root = builder.operation(op, &[left, right]);
        let both = builder.finish(root);
        // Bounds without the downward rule's help from the whole: the operands' own.
        let [bounds_a, bounds_b, bounds] = [&a, &b, &both].map(|solid| SBounds::new(solid, 0.0));
        let mut r = Random::new(seed + 77);
        for _ in 0..40 {
            // Half of the voxels where both surfaces are, or the rarer kinds never meet.
            let tries = if r.below(2) == 0 { 1 } else { 60 };
            let near = |x: &DVec3| a.value(*x).abs().max(b.value(*x).abs());
            let candidates = (0..tries).map(|_| r.vector(1.2)).collect::<Vec<_>>();
            let center = candidates.into_iter().min_by(|x, y| near(x).total_cmp(&near(y))).expect("one at least");
            let half = r.within(0.01, if tries == 1 { 0.3 } else { 0.1 });
            let classify = |s: &Solid, bounds: &SBounds| {
                let (mut out, mut refs) = (vec![], vec![]);
                let terms = whole(s, bounds);
                let mut c = Classifier { solid: s, bounds, center, half, work: 0 };
                (c.classify(&terms, &mut out, &mut refs).kind, refs)
            };
            let (ka, kb) = (classify(&a, &bounds_a).0, classify(&b, &bounds_b).0);
            let (k, refs) = classify(&both, &bounds);
            let table = combine(op, ka, kb).map(|k| if k == NodeKind::Grey { NodeKind::Mixed } else { k });
            seen[seed as usize % 3][ka as usize][kb as usize] += 1;
            // The bounds of the whole tree clip the operands' own, so that it sees less of them: sharper as a rule.
            agree += usize::from(Some(k) == table);
            sharper += usize::from(Some(k) != table && k != NodeKind::Mixed);
            voxels += 1;
            for i in 0..30 {
                let x = if i < 8 {
                    let s = |bit: usize| if i >> bit & 1 == 0 { -half } else { half };
                    center + DVec3::new(s(0), s(1), s(2))
                } else {
                    center + r.vector(half)
                };
                assert_membership(&both, k, &refs, x, 1e-12, &format!("seed {seed}: {ka:?} {op:?} {kb:?}"));
            }
        }
    }
    println!("{voxels} voxels: {agree} of the table's kind, {sharper} of a sharper one");
    assert!(agree * 10 > voxels * 9 && (agree + sharper) * 1000 > voxels * 999);
    for (op, table) in ["union", "intersection", "difference"].iter().zip(seen) {
        let at_lowest = [1, 2, 3, 4, 5].map(|i| [1, 2, 3, 4, 5].map(|j| table[i][j]));
        println!("{op}: voxels by kinds of operands (full empty p n mixed) {at_lowest:?}");
        assert!(at_lowest.iter().flatten().all(|n| *n > 0), "a cell of {op} was never met");
    }
}

/// Walks down to `x`, expanding on the way while `deeper` says so; calls `check` on every node passed.
fn descend<'n>(m: &'n Model, x: DVec3, deeper: impl Fn(&Node) -> bool, mut check: impl FnMut(&'n Node)) {
    let mut at = m.octree.root();
    loop {
        check(at);
        let children = if deeper(at) { m.expand(at) } else { at.children() };
        let Some(children) = children else { return };
        at = children.iter().find(|c| c.aabb().contains(x)).expect("children cover their parent");
    }
}

#[test]
fn octree_membership_is_tree_membership_also_where_refined_later() {
    let mut r = Random::new(5);
    let (mut points, mut inside, mut by_kind, mut deepest) = (0, 0, [0usize; 6], 0);
    for i in 0..150 {
        let s = solid(&mut r, 1 + i % 4);
        let m = Model::with_limits(s, Limits { depth: 1 + (i % 5) as u8, ..Limits::default() });
        let slack = m.margin().max(1e-12);
        for k in 0..60 {
            let mut cube = m.octree.root();
            if k % 4 == 0 {
                // Down into the mixed ones, where random points hardly get.
                while let Some(children) = m.expand(cube) {
                    let mixed: Vec<&Node> = children.iter().filter(|c| m.expand(c).is_some()).collect();
                    if mixed.is_empty() || cube.depth() == 10 {
                        break;
                    }
                    cube = mixed[r.below(mixed.len())];
                }
            }
            let x = r.point_in(&cube.aabb());
            let f = m.solid.value(x);
            points += 1;
            inside += usize::from(f < 0.0);
            let (mut tokens, mut kinds) = (vec![], vec![]);
            let limit = if k % 2 == 0 { 11 } else { 0 };
            descend(
                &m,
                x,
                |n| n.depth() < limit,
                |n| {
                    let kind = if n.children().is_some() { NodeKind::Grey } else { n.kind() };
                    kinds.push(kind);
                    deepest = deepest.max(n.depth());
                    assert_membership(&m.solid, n.kind(), n.refs(), x, slack, &format!("solid {i}"));
                    // The bounds of f, and f of what is left, as far as the margin goes.
                    let clamped = f.clamp(-m.margin(), m.margin());
                    assert!(
                        n.f_lo <= clamped && clamped <= n.f_hi,
                        "solid {i}: f {f} outside [{}, {}]",
                        n.f_lo,
                        n.f_hi
                    );
                    let delta = 0.3 * m.margin();
                    tokens.clear();
                    match m.literals(n, delta, &mut tokens) {
                        Truth::True => assert!(f <= -delta),
                        Truth::False => assert!(f > -delta),
                        Truth::Open => {
                            let g = local::value(&tokens, &mut |face| m.solid.faces[face as usize].value(x));
                            assert_eq!(g <= -delta, f <= -delta, "solid {i}: f {f}, left {g}");
                            for l in local::literals(&tokens) {
                                let p = m.solid.face_owner[l.face() as usize];
                                assert!(n.refs().contains(&p), "solid {i}: an open literal of a primitive not named");
                                assert_eq!(m.solid.senses[p as usize], l.sense());
                            }
                        }
                    }
                },
            );
            by_kind[*kinds.last().unwrap() as usize] += 1;
        }
    }
    println!(
        "octree membership: {points} points, {:.0}% inside; leaves {:?}; down to depth {deepest}",
        100.0 * inside as f64 / points as f64,
        NodeKind::ALL.map(|k| (k.name(), by_kind[k as usize]))
    );
    assert!(inside * 10 > points && deepest >= 10);
    assert!(NodeKind::ALL.iter().all(|k| *k == NodeKind::Grey || by_kind[*k as usize] > 20));
}

#[test]
fn a_primitives_values_over_a_box_lie_within_its_span() {
    let mut r = Random::new(6);
    let (mut gaps, mut spans) = (vec![], 0);
    for _ in 0..4000 {
        let frame = contactd_proto::Pose::new(r.vector(1.0), r.rotation());
        let p = Primitive::new(shape(&mut r, 1.0), frame, Default::default(), 0);
        let size = [1e-3, 0.05, 0.5, 2.0][r.below(4)];
        let (c, e) = (r.vector(1.5), DVec3::new(r.within(0.0, size), r.within(0.0, size), r.within(0.0, size)));
        let (lo, hi) = primitive_span(&p, c, e);
        let (mut least, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..200 {
            let s = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let u = if i < 8 { DVec3::new(s(0), s(1), s(2)) } else { r.vector(1.0) };
            let v = p.value(c + e * u);
            (least, largest) = (least.min(v), largest.max(v));
        }
        assert!(lo <= least && largest <= hi, "{:?}: [{least}, {largest}] outside [{lo}, {hi}]", p.shape);
        // A convex function is largest at a corner: the upper bound is met.
        assert!(hi - largest < 1e-12);
        gaps.push((least - lo) / e.length());
        spans += 1;
    }
    gaps.sort_by(f64::total_cmp);
    println!("{spans} spans; lower bound below the sampled minimum by (per box diagonal): median {:.3}", gaps[2000]);
    assert!(gaps[2000] < 0.3);
}

#[test]
fn a_deep_chain_of_operations_is_no_special_case() {
    // (((block − ball) ∪ ball) − …): a thousand levels, each hidden by the next.
    let mut b = SolidBuilder::new();
    let mut r = Random::new(8);
    let mut root = b.primitive(Cuboid { half: DVec3::ONE }, contactd_proto::Pose::IDENTITY, Default::default());
    for i in 0..1000 {
        let ball = b.primitive(Sphere { radius: 0.3 }, contactd_proto::Pose::at(r.vector(1.0)), Default::default());
        root = b.operation(if i % 2 == 0 { Op::Difference } else { Op::Union }, &[root, ball]);
    }
    let m = Model::new(b.finish(root));
    let mut inside = 0;
    for _ in 0..2000 {
        let x = r.vector(1.1);
        let f = m.solid.value(x);
        inside += usize::from(f < 0.0);
        let Some(n) = m.octree.locate(x) else {
            assert!(f > 0.0);
            continue;
        };
        assert_membership(&m.solid, n.kind(), n.refs(), x, m.margin(), "chain");
    }
    println!("chain of 1000: depth {}, {} nodes, {inside} of 2000 inside", m.octree.depth(), m.octree.census().nodes());
    assert!(inside > 200 && inside < 1800);
}

#[test]
fn who_asks_first_does_not_matter() {
    let (eager, lazy) = (Limits::to_depth(5), Limits::to_depth(2));
    let (a, b) = (Model::with_limits(perforated_plate(3), eager), Model::with_limits(perforated_plate(3), lazy));
    fn compare(a: &Node, b: &Node, m: &Model, count: &mut usize) {
        *count += 1;
        assert_eq!((a.center, a.half, a.f_lo, a.f_hi), (b.center, b.half, b.f_lo, b.f_hi));
        assert_eq!((a.refs(), a.terms()), (b.refs(), b.terms()));
        assert!(a.kind() == b.kind() || (a.kind() == NodeKind::Grey && b.kind() == NodeKind::Mixed));
        if let Some(children) = a.children() {
            let others = m.expand(b).expect("a mixed node expands");
            children.iter().zip(others).for_each(|(x, y)| compare(x, y, m, count));
        }
    }
    let mut count = 0;
    std::thread::scope(|s| {
        // Two threads refine the same octree at once.
        s.spawn(|| compare(a.octree.root(), b.octree.root(), &b, &mut 0));
        compare(a.octree.root(), b.octree.root(), &b, &mut count);
    });
    assert_eq!(count, a.octree.census().nodes());
    assert!(count > 1000);
}

#[test]
fn the_budget_bounds_the_octree_of_a_large_part() {
    let plate = perforated_plate(64);
    assert_eq!(plate.primitives.len(), 8193);
    let start = std::time::Instant::now();
    let m = Model::new(plate);
    let took = start.elapsed();
    let census = m.octree.census();
    println!("8193 primitives: depth {}, {} nodes, {took:?}", m.octree.depth(), census.nodes());
    for (d, row) in census.by_depth.iter().enumerate() {
        println!("  depth {d}: {:?}", NodeKind::ALL.map(|k| (k.name(), row[k as usize])));
    }
    assert!(m.octree.depth() >= 2 && census.of(NodeKind::Mixed) > 0 && census.nodes() <= Limits::default().nodes);
}

#[test]
fn an_empty_and_an_unbounded_solid_have_their_octrees_too() {
    let mut b = SolidBuilder::new();
    let root = b.empty();
    let m = Model::new(b.finish(root));
    assert_eq!((m.octree.root().kind(), m.radius), (NodeKind::Empty, 0.0));
    let mut b = SolidBuilder::new();
    let root = b.primitive(contactd::solid::primitive::HalfSpace, contactd_proto::Pose::IDENTITY, Default::default());
    let m = Model::new(b.finish(root));
    assert_eq!(m.octree.root().kind(), NodeKind::Mixed);
    assert!(m.expand(m.octree.root()).is_none() && m.radius.is_infinite());
}

#[test]
fn a_voxel_that_a_surface_reaches_within_the_margin_is_neither_full_nor_empty() {
    let mut builder = SolidBuilder::new();
    let root = builder.primitive(Cuboid { half: DVec3::ONE }, Pose::IDENTITY, Label::default());
    let solid = builder.finish(root);
    let (margin, half) = (1e-3, 0.125);
    let bounds = SBounds::new(&solid, margin);
    for (distance, kind) in [
        (2.0 * margin, NodeKind::Empty),
        (0.5 * margin, NodeKind::PSurface),
        (-2.0 * half - 0.5 * margin, NodeKind::PSurface),
        (-2.0 * half - 2.0 * margin, NodeKind::Full),
    ] {
        let center = DVec3::X * (1.0 + half + distance);
        let mut classifier = Classifier { solid: &solid, bounds: &bounds, center, half, work: 0 };
        let found = classifier.classify(&whole(&solid, &bounds), &mut Vec::new(), &mut Vec::new());
        assert_eq!(found.kind, kind, "at a distance of {distance}");
    }
}

/// A point where f is about 0, on the way between two points of unlike signs.
fn on_surface(s: &Solid, mut inside: DVec3, mut outside: DVec3) -> DVec3 {
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        *if s.value(middle) < 0.0 { &mut inside } else { &mut outside } = middle;
    }
    0.5 * (inside + outside)
}

/// Asserts that the model says of its tree at a point what the tree says.
fn assert_reported(m: &Model, x: DVec3, what: &str) {
    let s = &m.solid;
    let f = s.value(x);
    assert_eq!(m.value(x), f, "{what}");
    let mut psi = |face: u32| s.faces[face as usize].value(x);
    assert_eq!(m.deciding(x), local::deciding(&s.normal_form, &mut psi), "{what}");
    for level in [1e-12, 1e-4, 0.1, 0.45, 2.0, 1e3].map(|part| part * m.margin()) {
        for level in [level, -level] {
            let reported = m.value_within(x, level);
            assert_eq!(
                (reported <= level, reported < level),
                (f <= level, f < level),
                "{what}: {reported} for {f} at {level}"
            );
        }
        assert_eq!(m.value_within(x, level).clamp(-level, level), f.clamp(-level, level), "{what}");
        let (mut near, mut all) = (vec![], vec![]);
        let truth = m.literals_at(x, level, &mut near);
        let expected = local::prune(&s.normal_form, &mut all, &mut |id| {
            let v = s.faces[id.face() as usize].value(x);
            local::truth_of(id.sense(), (v, v), 0.0, level)
        });
        assert_eq!((truth, near), (expected, all), "{what}: within {level}");
    }
}

#[test]
fn the_octree_tells_f_at_a_point_as_the_whole_tree_does_whatever_was_decomposed() {
    let (mut solids, mut points, mut near) = (0, 0, 0);
    for seed in 0..60 {
        let mut r = Random::new(seed + 4_000);
        let s = if seed % 10 == 0 { perforated_plate(2 + seed as usize / 10) } else { solid(&mut r, 3) };
        if s.primitives.len() <= 8 {
            continue;
        }
        let built = Model::new(s.clone());
        if built.bounds.root().is_empty() {
            continue;
        }
        solids += 1;
        let bare = Model::with_limits(s, Limits::to_depth(0));
        let around = built.bounds.root().aabb.grown(0.1);
        let mut last: Option<(DVec3, bool)> = None;
        for i in 0..60 {
            let x = r.point_in(&around);
            let inside = built.solid.value(x) < 0.0;
            let mut at = vec![x];
            if let Some((y, other)) = last
                && other != inside
            {
                let (inside, outside) = if inside { (x, y) } else { (y, x) };
                let edge = on_surface(&built.solid, inside, outside);
                let off = r.direction() * built.margin();
                at.extend([0.0, 0.3, 0.9, 3.0].map(|k| edge + off * k));
                near += 1;
            }
            last = Some((x, inside));
            for x in at {
                let what = format!("seed {seed}, point {i}: {x}");
                assert_reported(&built, x, &what);
                assert_reported(&bare, x, &what);
                if i % 4 == 0 && bare.octree.root().aabb().contains(x) {
                    // All the way down there, then again.
                    descend(&bare, x, |_| true, |_| {});
                    assert_reported(&bare, x, &what);
                }
                points += 1;
            }
        }
    }
    println!("{points} points in {solids} solids, {near} of them on a surface");
    assert!(solids > 20 && near > 200, "{solids} {near}");
}

#[test]
fn what_is_evaluated_at_a_point_does_not_grow_with_the_solid() {
    let mut most = vec![];
    // Up to so many holes a side; `CONTACTD_HOLES=70` is the long form.
    let largest = sized("CONTACTD_HOLES", 30);
    for n in [3, 10, 30, 70].into_iter().filter(|n| *n <= largest) {
        let s = perforated_plate(n);
        // Nothing decomposed at load: what a model of millions of primitives would be.
        for limits in [Limits::default(), Limits::to_depth(0)] {
            let m = Model::with_limits(s.clone(), limits);
            let mut r = Random::new(9);
            let points: Vec<DVec3> = (0..2000)
                .map(|_| {
                    let hole = &m.solid.primitives[1 + 2 * r.below(n * n)];
                    hole.ball.center
                        + r.direction().with_z(0.0).normalize_or_zero() * 0.2
                        + DVec3::Z * r.within(-0.2, 0.2)
                })
                .collect();
            let mut terms = 0;
            for x in &points {
                assert_eq!(m.value_within(*x, 0.1 * m.margin()) <= 0.0, m.solid.value(*x) <= 0.0);
                terms = terms.max(m.octree.locate(*x).expect("within the plate").terms().len());
            }
            let nodes = m.octree.census().nodes();
            points.iter().for_each(|x| _ = m.value(*x));
            assert_eq!(m.octree.census().nodes(), nodes, "nothing is decomposed twice");
            most.push((s.primitives.len(), terms));
        }
    }
    println!("primitives and most terms evaluated at a point: {most:?}");
    assert!(most.iter().all(|(_, terms)| *terms <= 64), "{most:?}");
}

#[test]
fn where_many_faces_meet_points_decompose_no_further_than_is_worthwhile() {
    let mut b = SolidBuilder::new();
    let blades: Vec<_> = (0..100)
        .map(|k| {
            let turn = quat_of_rotation_vector(DVec3::Z * (std::f64::consts::PI * f64::from(k) / 100.0));
            b.primitive(Cuboid { half: DVec3::new(5.0, 0.01, 5.0) }, Pose::new(DVec3::ZERO, turn), Label::default())
        })
        .collect();
    let ring = b.operation(Op::Union, &blades);
    let drill = b.primitive(Cylinder { radius: 0.02, half_height: 6.0 }, Pose::IDENTITY, Label::default());
    let root = b.operation(Op::Difference, &[ring, drill]);
    let m = Model::with_limits(b.finish(root), Limits::to_depth(0));
    let mut r = Random::new(3);
    for _ in 0..3000 {
        // On the wall of the drill, where all blades end.
        let x = r.direction().with_z(0.0).normalize_or_zero() * 0.02 + DVec3::Z * r.within(-5.0, 5.0);
        assert_eq!(m.value(x), m.solid.value(x));
    }
    let nodes = m.octree.census().nodes();
    println!("{nodes} nodes");
    assert!(nodes < 2000, "{nodes}");
}
