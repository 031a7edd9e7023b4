//! Laws of mass properties: every bound holds, against closed forms, rays and each other; what bounds cost in boxes.
//! `CONTACTD_TREES` sets the number of random trees: `CONTACTD_TREES=30 cargo test -p contactd-tests --test models mass::`.

use contactd::import;
use contactd::ipc::ServerConfig;
use contactd::octree::Model;
use contactd::octree::mass::{MassError, mass_properties};
use contactd::solid::primitive::{Cone, Cuboid, Cylinder, HalfSpace, Polyhedron, Shape, Sphere};
use contactd::solid::{Label, Op, Solid, SolidBuilder};
use contactd_proto::{ErrorCode, MassOptions, MassProperties, Pose};
use contactd_tests::random_solids::{Random, shape, solid};
use contactd_tests::rays::{Integrals, integrals};
use contactd_tests::sweep::sized;
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

fn tree(op: Op, parts: &[(Shape, Pose)]) -> Model {
    let mut b = SolidBuilder::new();
    let leaves: Vec<_> = parts.iter().map(|(s, at)| b.primitive(s.clone(), *at, Label::default())).collect();
    let root = b.operation(op, &leaves);
    Model::new(b.finish(root))
}

/// A primitive as a tree that has no closed form: cut by a box around it.
fn disguised(shape: &Shape, at: Pose) -> Model {
    let around = Cuboid { half: DVec3::splat(20.0) };
    tree(Op::Intersection, &[(shape.clone(), at), (around.into(), Pose::at(at.position))])
}

fn mass(model: &Model, tolerance: f64) -> MassProperties {
    mass_properties(model, &MassOptions { tolerance, ..Default::default() }).expect("a bounded solid")
}

/// A ball of radius 1 with a bore through it that leaves a height of 1.6: π h³/6.
fn napkin_ring() -> (Model, f64) {
    let ring = [
        (Sphere { radius: 1.0 }.into(), Pose::IDENTITY),
        (Cylinder { radius: 0.6, half_height: 2.0 }.into(), Pose::IDENTITY),
    ];
    (tree(Op::Difference, &ring), PI * 1.6f64.powi(3) / 6.0)
}

/// Two rods of radius 1 that cross: 16 r³/3.
fn steinmetz() -> (Model, f64) {
    let rod: Shape = Cylinder { radius: 1.0, half_height: 2.0 }.into();
    let across = Pose::new(DVec3::ZERO, DQuat::from_rotation_x(FRAC_PI_2));
    (tree(Op::Intersection, &[(rod.clone(), Pose::IDENTITY), (rod, across)]), 16.0 / 3.0)
}

fn plate(holes: usize) -> (Model, f64) {
    let mut parts = vec![(Cuboid { half: DVec3::new(5.0, 2.0, 0.25) }.into(), Pose::IDENTITY)];
    for i in 0..holes {
        let at = DVec3::new((i / 2) as f64 * 1.9 - 3.8, (i % 2) as f64 * 1.7 - 0.8, 0.0);
        parts.push((Cylinder { radius: 0.4, half_height: 1.0 }.into(), Pose::at(at)));
    }
    (tree(Op::Difference, &parts), 20.0 - holes as f64 * PI * 0.16 * 0.5)
}

/// The integrals that mass properties of density 1 tell, about the model's origin.
fn as_integrals(m: &MassProperties) -> Integrals {
    let (v, c, i) = (m.volume, m.center, m.inertia);
    let half = (i[0] + i[1] + i[2]) / 2.0;
    let squares = [half - i[0], half - i[1], half - i[2], -i[3], -i[4], -i[5]];
    let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
    std::array::from_fn(|k| match k {
        0 => v,
        1..=3 => v * c[k - 1],
        _ => squares[k - 4] + v * c[pairs[k - 4].0] * c[pairs[k - 4].1],
    })
}

/// Mass properties of integrals, without bounds.
fn of_integrals(s: &Integrals) -> MassProperties {
    let center = DVec3::new(s[1], s[2], s[3]) / s[0];
    let about = |k: usize, i: usize, j: usize| s[k] - s[0] * center[i] * center[j];
    let (x, y, z) = (about(4, 0, 0), about(5, 1, 1), about(6, 2, 2));
    let inertia = [y + z, x + z, x + y, -about(7, 0, 1), -about(8, 0, 2), -about(9, 1, 2)];
    MassProperties { volume: s[0], center, inertia, ..MassProperties::NOTHING }
}

/// Asserts that two answers about one solid agree within their bounds, and `slack` times the solid's own scales.
fn agree(a: &MassProperties, b: &MassProperties, slack: f64, what: &str) {
    let scale = a.volume.abs() * slack;
    assert!((a.volume - b.volume).abs() <= a.volume_error + b.volume_error + scale, "{what}: {a:?}\n{b:?}");
    for k in 0..3 {
        let bound = a.center_error[k] + b.center_error[k] + slack;
        assert!((a.center[k] - b.center[k]).abs() <= bound, "{what}: centre {k}: {a:?}\n{b:?}");
    }
    for k in 0..6 {
        let bound = a.inertia_error[k] + b.inertia_error[k] + scale;
        assert!((a.inertia[k] - b.inertia[k]).abs() <= bound, "{what}: inertia {k}: {a:?}\n{b:?}");
    }
}

#[test]
fn closed_forms_agree_with_boxes_under_any_pose() {
    let mut r = Random::new(5);
    let mut by_boxes = 0;
    let count = 6 * sized("CONTACTD_TREES", 4);
    for i in 0..count {
        let shape = match i % 6 {
            0 => Sphere { radius: r.within(0.3, 2.0) }.into(),
            1 => Cylinder { radius: r.within(0.3, 2.0), half_height: r.within(0.1, 2.0) }.into(),
            2 => Cone { bottom: r.within(0.3, 2.0), top: 0.0, half_height: r.within(0.3, 2.0) }.into(),
            3 => Cone { bottom: r.within(0.3, 1.0), top: r.within(1.1, 2.0), half_height: r.within(0.3, 2.0) }.into(),
            4 => Cuboid { half: r.vector(1.0).abs() + DVec3::splat(0.1) }.into(),
            _ => shape(&mut r, 1.0),
        };
        let at = Pose::new(r.vector(3.0), r.rotation());
        let exact = mass(&tree(Op::Union, &[(shape.clone(), at)]), 1e-3);
        assert_eq!(exact.boxes, 0);
        assert!(exact.volume_error <= 1e-11 * exact.volume, "{shape:?}: {exact:?}");
        assert!(exact.center_error.max_element() <= 1e-10 && exact.inertia_error.iter().all(|e| *e <= 1e-9));
        let boxes = mass(&disguised(&shape, at), 3e-3);
        assert!(boxes.boxes > 0 && boxes.volume_error <= 3e-3 * boxes.volume);
        agree(&exact, &boxes, 0.0, &format!("{shape:?} {at:?}"));
        by_boxes += usize::from(boxes.volume_error > 1e-9);
        // And by rays, which know neither.
        let solid = tree(Op::Union, &[(shape.clone(), at)]).solid;
        let rays = of_integrals(&integrals(&solid, &solid.aabb(), 150));
        agree(&exact, &rays, 3e-3, &format!("{shape:?} by rays"));
    }
    assert!(2 * by_boxes > count, "{by_boxes} with curved faces");
}

#[test]
fn what_has_planes_alone_is_exact_but_for_rounding() {
    let cube = |half: f64, at: DVec3| (Shape::from(Cuboid { half: DVec3::splat(half) }), Pose::at(at));
    let corner = mass(&tree(Op::Difference, &[cube(1.0, DVec3::ZERO), cube(1.0, DVec3::ONE)]), 1e-6);
    assert!((corner.volume - 7.0).abs() <= corner.volume_error && corner.volume_error < 1e-10, "{corner:?}");
    // Seven unit cubes: the missing one would balance them.
    assert!((corner.center - DVec3::splat(-0.5 / 7.0)).abs().cmple(corner.center_error).all());
    let hollow = mass(&tree(Op::Difference, &[cube(2.0, DVec3::X), cube(1.5, DVec3::X)]), 1e-6);
    assert_eq!(hollow.boxes, 0, "the inner box lies inside, with all its corners");
    assert!((hollow.volume - 37.0).abs() <= hollow.volume_error && hollow.volume_error < 1e-9);
    assert!((hollow.inertia[0] - (64.0 * 16.0 - 27.0 * 9.0) / 6.0).abs() <= hollow.inertia_error[0]);
    let mut r = Random::new(8);
    for _ in 0..sized("CONTACTD_TREES", 2) {
        let shapes = [4, 6, 8, 12, 20].map(|n| Polyhedron::platonic(n, 1.0).expect("a platonic count"));
        let parts: Vec<(Shape, Pose)> =
            (0..3).map(|_| (shapes[r.below(5)].clone().into(), Pose::new(r.vector(0.4), r.rotation()))).collect();
        for op in [Op::Union, Op::Intersection, Op::Difference] {
            let model = tree(op, &parts);
            let m = mass(&model, 1e-6);
            let scale = model.radius.powi(3);
            assert!(m.volume_error < 1e-9 * scale, "{op:?}: {m:?}");
            let rays = of_integrals(&integrals(&model.solid, &model.solid.aabb(), 120));
            if m.volume > 0.05 * scale {
                agree(&m, &rays, 3e-2, &format!("{op:?} of polyhedra"));
            }
        }
    }
}

#[test]
fn bounds_are_true_where_the_volume_is_known() {
    for (name, (model, exact)) in [("ring", napkin_ring()), ("rods", steinmetz()), ("plate", plate(10))] {
        for tolerance in [0.3, 0.1, 1e-2, 1e-3, 1e-4] {
            let m = mass(&model, tolerance);
            let off = (m.volume - exact).abs();
            assert!(off <= m.volume_error && m.volume_error <= tolerance * exact, "{name} {tolerance}: {m:?}");
            if name != "plate" {
                assert!(m.center.abs().cmple(m.center_error).all(), "{name}: the centre is the origin: {m:?}");
                assert!(m.inertia[3..].iter().zip(&m.inertia_error[3..]).all(|(i, e)| i.abs() <= *e), "{name}: {m:?}");
            }
        }
    }
    // Steinmetz: ∫ x² = ∫ (2√(1−x²))² x² dx = 16/15, the axes y and z alike by symmetry.
    let m = mass(&steinmetz().0, 1e-4);
    let squares = as_integrals(&m);
    let slack = m.inertia_error[0] + m.inertia_error[1] + m.inertia_error[2];
    assert!((squares[4] - 16.0 / 15.0).abs() <= slack, "{squares:?}");
    // A hollow ball in closed form, and cut in two so that it has none.
    let ball = |radius| (Shape::from(Sphere { radius }), Pose::at(DVec3::new(1.0, 2.0, 3.0)));
    let shell = mass(&tree(Op::Difference, &[ball(2.0), ball(1.0)]), 1e-3);
    assert!(shell.boxes == 0 && (shell.volume - 28.0 / 3.0 * PI).abs() <= shell.volume_error);
    assert!((shell.inertia[1] - 0.4 * 4.0 / 3.0 * PI * 31.0).abs() <= shell.inertia_error[1]);
    let half = (Shape::from(HalfSpace), Pose::at(DVec3::new(0.0, 0.0, 3.0)));
    let bowl = mass(&tree(Op::Difference, &[ball(2.0), ball(1.0), half]), 1e-3);
    assert!(bowl.boxes > 0 && (bowl.volume - 14.0 / 3.0 * PI).abs() <= bowl.volume_error);
    // Its centre: ∫ z = π (R⁴ − r⁴)/4.
    assert!((bowl.center.z - 3.0 - 15.0 * 3.0 / 56.0).abs() <= bowl.center_error.z, "{bowl:?}");
}

#[test]
fn bounds_are_true_for_random_trees() {
    let mut r = Random::new(2);
    let (mut reported, mut empty) = (0, 0);
    let count = sized("CONTACTD_TREES", 3);
    for i in 0..count {
        let solid: Solid = solid(&mut r, 1 + i % 3);
        let around = solid.aabb();
        // Faces along the rays lie between two of them: of grids of three widths one may miss that, not all.
        let [fine, coarse, other] = [112, 71, 97].map(|n| integrals(&solid, &around, n));
        let model = Model::new(solid);
        if fine[0] < 1e-3 {
            empty += 1;
            let m = mass_properties(&model, &MassOptions { tolerance: 0.1, boxes: 20_000 }).unwrap();
            assert!(m.volume - m.volume_error <= 2e-3, "{m:?}");
            continue;
        }
        let doubt: Integrals =
            std::array::from_fn(|k| 4.0 * (fine[k] - coarse[k]).abs().max((fine[k] - other[k]).abs()) + 2e-3 * fine[0]);
        for tolerance in [0.2, 0.02] {
            let m = mass(&model, tolerance);
            assert!(m.volume_error <= tolerance * m.volume, "solid {i}: {m:?}");
            let found = as_integrals(&m);
            assert!((found[0] - fine[0]).abs() <= m.volume_error + doubt[0], "solid {i}, {tolerance}: {m:?} {fine:?}");
            let rays = of_integrals(&fine);
            let doubt =
                (0..10).map(|k| doubt[k] / fine[0]).fold(0.0, f64::max) * (1.0 + around.half().length_squared());
            agree(&m, &rays, doubt, &format!("solid {i}, tolerance {tolerance}"));
            reported += usize::from(m.volume_error > doubt * fine[0]);
        }
    }
    // Where the bound is wider than the doubt about the rays it is the bound that was tested.
    assert!(3 * reported > 2 * count && 3 * empty < 2 * count, "{reported} {empty}");
}

#[test]
fn boxes_grow_as_the_order_of_the_method_says() {
    let grows = |name: &str, model: &Model, most: f64| {
        let boxes: Vec<f64> = [1e-3, 1e-4, 1e-5].iter().map(|t| mass(model, *t).boxes as f64).collect();
        println!("{name}: {boxes:?} boxes for 1e-3, 1e-4, 1e-5");
        // Per decade: 10 for the second order, 100 for the first; 10^⅔ where one face is left, of the third.
        assert!(boxes.windows(2).all(|w| w[1] < most * w[0]), "{name}: {boxes:?}");
    };
    grows("ring", &napkin_ring().0, 6.0);
    grows("rods", &steinmetz().0, 6.0);
    // Developable surfaces bend one way alone: 10^⅓ per decade.
    grows("plate", &plate(1).0, 3.2);
    grows("plate of ten holes", &plate(10).0, 3.2);
}

#[test]
fn a_limit_of_boxes_is_told_by_the_bound() {
    let (model, exact) = napkin_ring();
    let mut last = f64::INFINITY;
    for boxes in [1, 2, 3, 100, 1000, 10_000] {
        let m = mass_properties(&model, &MassOptions { tolerance: 1e-9, boxes }).unwrap();
        assert!(m.boxes <= boxes && m.boxes + 2 > boxes.min(3), "{boxes}: {m:?}");
        assert!((m.volume - exact).abs() <= m.volume_error && m.volume_error <= last, "{boxes}: {m:?}");
        assert!(m.center.abs().cmple(m.center_error).all() && m.center_error.is_finite(), "{boxes}: {m:?}");
        last = m.volume_error;
    }
    assert!(last < 0.02);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let model = Model::new(solid(&mut Random::new(12), 3));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| format!("{:?}", mass(&model, 1e-2)))
    };
    assert_eq!(on(1), on(4));
}

#[test]
fn a_moved_model_has_its_properties_moved() {
    // The same tree, every primitive moved along: other boxes, the same body.
    let mut r = Random::new(21);
    for i in 0..12 {
        let shapes: Vec<(Shape, Pose)> =
            (0..3).map(|_| (shape(&mut r, 1.0), Pose::new(r.vector(0.5), r.rotation()))).collect();
        let op = [Op::Union, Op::Difference][i % 2];
        let move_by = Pose::new(r.vector(4.0), r.rotation());
        let moved: Vec<_> = shapes.iter().map(|(s, at)| (s.clone(), move_by.compose(at))).collect();
        let (here, there) = (mass(&tree(op, &shapes), 1e-2), mass(&tree(op, &moved), 1e-2));
        agree(&here.placed(&move_by), &there, 0.0, &format!("{op:?} {i}"));
        // Parallel axes: about any point the inertia grows by V (d² − d dᵀ).
        let about = |m: &MassProperties, o: DVec3| {
            let d = m.center - o;
            m.inertia_matrix() + (DMat3::IDENTITY * d.length_squared() - outer(d)) * m.volume
        };
        let (turn, o) = (move_by.matrix(), move_by.position);
        let both = turn * about(&here, DVec3::ZERO) * turn.transpose() - about(&there, o);
        let largest = both.to_cols_array().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        assert!(largest <= 0.1 * there.volume * 20.0, "{op:?} {i}: {both:?}");
    }
}

fn outer(d: DVec3) -> DMat3 {
    DMat3::from_cols(d * d.x, d * d.y, d * d.z)
}

#[test]
fn empty_unbounded_and_bad_options() {
    let mut b = SolidBuilder::new();
    let root = b.empty();
    assert_eq!(mass(&Model::new(b.finish(root)), 1e-6), MassProperties::NOTHING);
    let apart = [
        (Shape::from(Sphere { radius: 1.0 }), Pose::IDENTITY),
        (Sphere { radius: 1.0 }.into(), Pose::at(DVec3::X * 3.0)),
    ];
    assert_eq!(mass(&tree(Op::Intersection, &apart), 1e-6), MassProperties::NOTHING);
    // What is taken from itself: its bounds are not empty, its normal form is.
    for shape in [Shape::from(Cuboid { half: DVec3::ONE }), Cylinder { radius: 1.0, half_height: 2.0 }.into()] {
        let (twice, beside) = ((shape.clone(), Pose::IDENTITY), (Sphere { radius: 1.0 }.into(), Pose::IDENTITY));
        for parts in [vec![twice.clone(), twice.clone()], vec![twice.clone(), twice.clone(), beside]] {
            assert_eq!(mass(&tree(Op::Difference, &parts), 1e-6), MassProperties::NOTHING);
        }
    }
    let both = mass(&tree(Op::Union, &apart), 1e-6);
    assert!(both.boxes == 0 && (both.volume - 8.0 / 3.0 * PI).abs() <= both.volume_error);
    assert!((both.center.x - 1.5).abs() <= both.center_error.x);
    let half = tree(Op::Union, &[(HalfSpace.into(), Pose::IDENTITY)]);
    let refused = mass_properties(&half, &MassOptions::default()).unwrap_err();
    assert_eq!((refused.clone(), refused.code()), (MassError::Unbounded, ErrorCode::Unbounded));
    for options in [MassOptions { tolerance: 0.0, boxes: 1 }, MassOptions { tolerance: 0.5, boxes: 0 }] {
        let refused = mass_properties(&half, &options).unwrap_err();
        assert_eq!(refused.code(), ErrorCode::BadNumber, "{refused}");
    }
}

#[test]
fn a_session_answers_and_names_what_is_bad() {
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    let plate = "difference() { cube(size = [4, 4, 1]); multmatrix([[1, 0, 0, 2], [0, 1, 0, 2], [0, 0, 1, -1], [0, 0, 0, 1]]) { cylinder(h = 9, r1 = 1, r2 = 1); } }";
    let plate = session.load_model("plate.csg", plate).unwrap();
    let options = MassOptions { tolerance: 1e-4, ..Default::default() };
    let m = session.mass_properties(plate.id, &options).unwrap();
    assert!((m.volume - (16.0 - PI)).abs() <= m.volume_error && m.volume_error <= 1e-4 * m.volume);
    assert!((m.center - DVec3::new(2.0, 2.0, 0.5)).abs().cmple(m.center_error).all(), "{m:?}");
    assert_eq!(m, session.mass_properties(plate.id, &options).unwrap());
    for (model, options, code) in [
        (plate.id + 1, options, ErrorCode::UnknownModel),
        (plate.id, MassOptions { tolerance: 1.0, ..options }, ErrorCode::BadNumber),
        (plate.id, MassOptions { tolerance: f64::NAN, ..options }, ErrorCode::BadNumber),
        (plate.id, MassOptions { boxes: 0, ..options }, ErrorCode::BadNumber),
        (plate.id, MassOptions { boxes: u64::MAX, ..options }, ErrorCode::BadNumber),
    ] {
        let error = session.mass_properties(model, &options).unwrap_err();
        assert_eq!(error.code(), Some(code), "{error}");
    }
}

/// The table of docs/algorithm/mass.md:
/// `cargo test --release -p contactd-tests --test models mass::table -- --ignored --nocapture`.
#[test]
#[ignore = "prints a table"]
fn table() {
    let imported = |name: &str| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name);
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let limits = import::Limits::default();
        let prepared = contactd::cache::prepare(
            None,
            &import::Source::named(name, text.as_bytes()),
            import::Facets::Auto,
            &limits,
        )
        .expect("a model");
        std::sync::Arc::into_inner(prepared.model).expect("nobody else has it")
    };
    let mut cases = vec![
        ("plate, one hole".to_owned(), plate(1)),
        ("plate, ten holes".to_owned(), plate(10)),
        ("napkin ring".to_owned(), napkin_ring()),
        ("Steinmetz solid".to_owned(), steinmetz()),
    ];
    for name in
        ["server/models/flange.csg", "server/models/bolt.csg", "server/models/gear.csg", "tests/models/part_40_40.csg"]
    {
        cases.push((name.to_owned(), (imported(name), f64::NAN)));
    }
    println!("| solid | boxes for 1e-2 | 1e-3 | 1e-4 | 1e-5 | 1e-6 | bound reached | error there |");
    println!("|---|---|---|---|---|---|---|---|");
    for (name, (model, exact)) in &cases {
        let found: Vec<MassProperties> = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6].iter().map(|t| mass(model, *t)).collect();
        let counts: Vec<String> = found.iter().map(|m| m.boxes.to_string()).collect();
        let last = found.last().expect("five of them");
        let off = (last.volume - exact).abs() / last.volume;
        let off = if off.is_nan() { "unknown".into() } else { format!("{off:.1e}") };
        println!("| {name} | {} | {:.1e} | {off} |", counts.join(" | "), last.volume_error / last.volume);
    }
}
