//! Meshes as operands: membership, values, volumes, certificates; against convex polyhedra and the exact solids that they facet.
//!
//! `CONTACTD_FACETS=1024` tessellates as finely, else in 64 pieces a turn.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers meshes:: -- --nocapture` sets the number of
//! pairs.

use super::kinds::{alone, pairs, past, placed, turning, values_and_volumes};
use contactd::contact::{Outcome, PairQuery, QueryOptions, Scratch, Status, Strategies, earliest_contact};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::octree::mass::mass_properties;
use contactd::solid::Shape;
use contactd::solid::primitive::Polyhedron;
use contactd_proto::control::{Facets, ModelFile};
use contactd_proto::{MassOptions, Motion, Pose};
use contactd_tests::certified::{certify_all, certify_trees};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::engine::question;
use contactd_tests::meshes::{self, Mesh, bumps, distance, prism, torus, winding};
use contactd_tests::random_solids::{Random, shape, shape_or_mesh, solid_of};
use contactd_tests::scenes::Recipe;
use contactd_tests::shells::lathe;
use contactd_tests::sweep::sized;
use glam::{DVec2, DVec3};

fn ask(a: &Model, b: &Model, motions: [Motion; 2]) -> Outcome {
    let [ma, mb] = motions.map(placed);
    earliest_contact(&question((a, ma), (b, mb), QueryOptions::DEPTH), &mut Scratch::default())
}

#[test]
fn a_point_is_inside_where_the_mesh_winds_around_it_and_f_is_no_more_than_its_distance() {
    let mut r = Random::new(5);
    let (mut inside, mut seen) = (0, 0);
    for i in 0..pairs(45) {
        let mesh = meshes::random(&mut r, 1.0);
        let model = alone(meshes::solid(&mesh));
        let around = model.solid.aabb();
        for k in 0..200 {
            let near = mesh.0[r.below(mesh.0.len())] + r.vector(1.0) * 10f64.powf(r.within(-8.0, -1.0));
            let x = if k % 2 == 0 { r.point_in(&around) } else { near };
            let (f, off) = (model.solid.value(x), distance(&mesh, x));
            assert!(f.abs() <= off + 1e-12, "mesh {i} at {x}: {f}, {off} off");
            if off > 1e-10 {
                let winds = winding(&mesh, x).round();
                assert!(winds == 0.0 || winds == 1.0);
                assert_eq!(f < 0.0, winds == 1.0, "mesh {i} at {x}: {f}, {off} off");
                assert!(f.abs() > 1e-3 * off.min(0.1), "mesh {i}: a seam at {x}, f {f}, {off} off");
                (inside, seen) = (inside + usize::from(f < 0.0), seen + 1);
            }
            let margin = model.margin();
            let within = model.value_within(x, margin).clamp(-margin, margin);
            let (off_margin, clamped) = (within - f.clamp(-margin, margin), f.abs() < margin);
            assert!(off_margin.abs() < 1e-13 || !clamped, "mesh {i} at {x}: {within} {f}");
        }
    }
    assert!(inside * 5 > seen, "{inside} of {seen}");
}

#[test]
fn trees_with_meshes_have_the_values_and_the_volumes_of_an_independent_evaluation() {
    values_and_volumes(shape_or_mesh, (pairs(90).div_ceil(75).min(9), 2, pairs(90) * 4), [56, 37]);
}

/// Enclosed volume, by signed tetrahedra.
fn volume((points, triangles): &Mesh) -> f64 {
    triangles.iter().map(|t| t.map(|v| points[v as usize])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

#[test]
fn the_volume_of_a_mesh_is_that_of_its_tetrahedra() {
    let mut r = Random::new(77);
    for i in 0..20 {
        let mesh = meshes::random(&mut r, 1.0);
        let m = mass_properties(&alone(meshes::solid(&mesh)), &MassOptions { tolerance: 1e-3, boxes: 300_000 });
        let m = m.expect("bounded");
        let exact = volume(&mesh);
        assert!((m.volume - exact).abs() <= m.volume_error && m.volume_error <= 1e-3 * exact, "{i}: {m:?}, {exact}");
    }
}

#[test]
fn certificates_of_meshes_against_every_kind_and_of_trees_with_them_hold() {
    let count = pairs(10);
    certify_all("kinds", (count, 0x3e_5105), |r| {
        let mesh = |r: &mut Random| Shape::from(meshes::solid(&meshes::random(r, 0.8)));
        let other = if r.chance(0.3) { mesh(r) } else { shape(r, 0.8) };
        [(alone(mesh(r)), placed(turning(r))), (alone(other), placed(past(r, 2.2)))]
    });
    certify_trees((count, 0x3e_5105), shape_or_mesh);
}

/// A mesh of some hundred triangles: more than a part holds.
fn fine(r: &mut Random) -> Mesh {
    let (n, m) = (8 + r.below(6) as u32, 6 + r.below(6) as u32);
    match r.below(3) {
        0 => torus((r.within(0.4, 0.5), r.within(0.15, 0.3)), n, m),
        1 => bumps(r, (n, m), (0.55, 0.7)),
        _ => {
            let radii: Vec<f64> = (0..4 * n).map(|_| r.within(0.5, 0.7)).collect();
            prism(&radii, 0.4)
        }
    }
}

#[test]
fn a_mesh_whose_formula_is_divided_meets_when_the_same_with_a_written_one_does_and_its_certificates_hold() {
    let mut r = Random::new(0xd1);
    let (mut contacts, mut worst) = (0, 0.0_f64);
    let count = pairs(8);
    for i in 0..count {
        let mesh = if r.chance(0.3) { meshes::random(&mut r, 0.8) } else { fine(&mut r) };
        let [whole, divided] = [alone(meshes::solid(&mesh)), alone(meshes::divided(&mesh))];
        for _ in 0..100 {
            let x = mesh.0[r.below(mesh.0.len())] + r.vector(1.0) * 10f64.powf(r.within(-8.0, 0.0));
            let (f, g) = (whole.solid.value(x), divided.solid.value(x));
            let off = distance(&mesh, x);
            assert!(g.abs() <= off + 1e-12 && (off <= 1e-10 || (f < 0.0) == (g < 0.0)), "{i} at {x}: {f} {g} {off}");
        }
        let other = if r.chance(0.3) { alone(meshes::divided(&fine(&mut r))) } else { alone(shape(&mut r, 0.8)) };
        let motions = [turning(&mut r), past(&mut r, 2.5)];
        let (o, p) = (ask(&whole, &other, motions), ask(&divided, &other, motions));
        assert_eq!(o.status(), p.status(), "{i}: {o:?}, {p:?}");
        if o.status() == Status::Contact && !o.not_continued() && !p.not_continued() {
            contacts += 1;
            let off = (o.time() - p.time()).abs() * o.at().normal_speed.abs().min(p.at().normal_speed.abs());
            worst = worst.max(off);
            assert!(off <= 1e-12, "{i}: {off:e}: {o:?}, {p:?}");
        }
    }
    println!("{contacts} contacts of {count}, the same to {worst:.1e}");
    assert!(contacts * 3 > count, "{contacts}");
    certify_all("divided", (count, 0xd1_51de), |r| {
        let place = |motion| Placed { place: Pose::IDENTITY, motion };
        let own = alone(meshes::divided(&fine(r)));
        let other = if r.chance(0.3) { Shape::from(meshes::divided(&meshes::random(r, 0.8))) } else { shape(r, 0.8) };
        [(own, place(turning(r))), (alone(other), place(past(r, 2.2)))]
    });
    certify_trees((count.max(10), 0x3e_5105), |r, size| {
        if r.chance(0.5) { meshes::divided(&meshes::random(r, size)).into() } else { shape(r, size) }
    });
}

/// A random motion, in every other case along a line.
fn moved(r: &mut Random, motion: Motion) -> Motion {
    if r.chance(0.5) { Motion { spin: DVec3::ZERO, ..motion } } else { motion }
}

#[test]
fn what_is_told_of_meshes_in_front_of_the_search_is_what_the_search_says() {
    let count = pairs(30);
    let (mut contacts, mut in_front, mut worst) = (0, 0, 0.0_f64);
    for i in 0..count {
        let mut r = Random::new(0xface_7000 + i as u64);
        let mesh = |r: &mut Random| if r.chance(0.5) { fine(r) } else { meshes::random(r, 0.8) };
        let solid = |r: &mut Random, mesh: &Mesh| {
            alone(if r.chance(0.5) { meshes::divided(mesh) } else { meshes::solid(mesh) })
        };
        let first = mesh(&mut r);
        let a = solid(&mut r, &first);
        let b = if r.chance(0.35) {
            let other = mesh(&mut r);
            solid(&mut r, &other)
        } else {
            alone(shape(&mut r, 0.6))
        };
        let motions = [turning(&mut r), past(&mut r, 2.2)].map(|m| moved(&mut r, m));
        let query = question((&a, placed(motions[0])), (&b, placed(motions[1])), QueryOptions::DEPTH);
        let alone = PairQuery { strategies: Strategies { facets: false, ..query.strategies }, ..query };
        let [o, p] = [query, alone].map(|q| earliest_contact(&q, &mut Scratch::default()));
        in_front += usize::from(o.counters.cells == 0 && o.counters.closed_forms > 0);
        if p.status() == Status::Undecided || (o.not_continued() || p.not_continued()) {
            continue;
        }
        assert_eq!(o.status(), p.status(), "{i}: {o:?}, {p:?}");
        assert!(o.time_lower() <= o.time() && o.time() <= o.time_upper(), "{i}: {o:?}");
        if o.status() == Status::Contact {
            contacts += 1;
            let off = (o.time() - p.time()).abs() * o.at().normal_speed.abs().min(p.at().normal_speed.abs());
            worst = worst.max(off);
            assert!(off <= 1e-12, "{i}: {off:e}: {o:?}, {p:?}");
        }
    }
    println!("{contacts} contacts of {count}, {in_front} told without a cell, the same to {worst:.1e}");
    assert!(contacts * 4 > count && in_front * 3 > count, "{contacts} {in_front} of {count}");
}

#[test]
fn a_body_within_a_mesh_overlaps_and_one_in_its_cavity_does_not() {
    let mut r = Random::new(17);
    let outer = bumps(&mut r, (24, 18), (0.9, 1.0));
    // The same with a cavity: a smaller one inside out.
    let inner = bumps(&mut r, (24, 18), (0.6, 0.7));
    let mut hollow = outer.clone();
    let first = hollow.0.len() as u32;
    hollow.0.extend(&inner.0);
    hollow.1.extend(inner.1.iter().map(|t| [t[0] + first, t[2] + first, t[1] + first]));
    let [whole, hollow] = [&outer, &hollow].map(|mesh| alone(meshes::solid(mesh)));
    let few = bumps(&mut r, (5, 4), (0.1, 0.2));
    for body in [alone(contactd::solid::primitive::Sphere { radius: 0.2 }), alone(meshes::solid(&few))] {
        let moving = Motion { velocity: DVec3::X * 0.05, ..Motion::resting(Pose::IDENTITY) };
        let still = Motion::resting(Pose::IDENTITY);
        assert_eq!(ask(&whole, &body, [still, moving]).status(), Status::Overlap);
        assert_eq!(ask(&body, &whole, [moving, still]).status(), Status::Overlap);
        assert_eq!(ask(&hollow, &body, [still, moving]).status(), Status::Clear);
        // And from within onto the wall of the cavity.
        let o = ask(&hollow, &body, [still, Motion { velocity: DVec3::X, ..moving }]);
        assert_eq!(o.status(), Status::Contact, "{o:?}");
        assert!(o.time() > 0.3 && o.time() < 0.65, "{o:?}");
        let outward = Motion { start: Pose::at(DVec3::X * 0.8), ..moving };
        assert_eq!(ask(&hollow, &body, [still, outward]).status(), Status::Overlap);
    }
}

/// A bar along x from the origin in `pieces`, of half the width and height that are told.
fn bar(long: f64, [width, height]: [f64; 2], pieces: u32) -> Mesh {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let ring =
        |i: u32| corners.map(|(y, z)| DVec3::new(long * f64::from(i) / f64::from(pieces), y * width, z * height));
    let mut triangles = vec![[0, 2, 1], [0, 3, 2]];
    for i in 0..pieces {
        for k in 0..4 {
            let [a, b] = [4 * i + k, 4 * i + (k + 1) % 4];
            triangles.extend([[a, b, b + 4], [a, b + 4, a + 4]]);
        }
    }
    let last = 4 * pieces;
    triangles.extend([[last, last + 1, last + 2], [last, last + 2, last + 3]]);
    ((0..=pieces).flat_map(ring).collect(), triangles)
}

/// A bar turns about z by an angle; a ball of radius q stands off the axis by d, at the angle α: the bar's side, w off its middle,
/// meets it at the angle α − asin((w + q)/d).
#[test]
fn a_bar_that_swings_meets_what_stands_in_its_way_when_its_side_has_come_there() {
    let mut r = Random::new(41);
    for i in 0..pairs(40) {
        let (long, w, q) = (r.within(2.0, 4.0), r.within(0.02, 0.2), r.within(0.02, 0.2));
        let whole = r.within(1.5, 3.0);
        let d = r.within(0.3, 0.9) * long;
        let lag = ((w + q) / d).asin();
        let angle = lag + (whole - lag) * r.within(0.1, 0.9);
        let frame = Pose::new(r.vector(1.0), r.rotation());
        let swing = Motion { spin: frame.vector(DVec3::Z * whole), ..Motion::resting(frame) };
        let at = frame.point(DVec3::new(d * angle.cos(), d * angle.sin(), 0.0));
        let height = r.within(0.05, 0.3);
        let bar = alone(meshes::solid(&bar(long, [w, height], 1 + r.below(40) as u32)));
        let ball = alone(contactd::solid::primitive::Sphere { radius: q });
        let still = Motion::resting(Pose::at(at));
        for o in [ask(&bar, &ball, [swing, still]), ask(&ball, &bar, [still, swing])] {
            let expected = (angle - lag) / whole;
            assert_eq!(o.status(), Status::Contact, "{i}: {expected}, {o:?}");
            assert!((o.time() - expected).abs() < 1e-11, "{i}: {expected}, {o:?}");
        }
    }
}

#[test]
fn a_convex_mesh_meets_when_the_polyhedron_of_its_points_does() {
    let mut r = Random::new(3);
    let (mut contacts, mut worst) = (0, 0.0_f64);
    let count = pairs(40);
    for i in 0..count {
        let mesh = if r.chance(0.5) {
            let radius = r.within(0.3, 0.8);
            prism(&vec![radius; 3 + r.below(20)], r.within(0.2, 0.8))
        } else {
            bumps(&mut r, (3, 5), (0.7, 0.7))
        };
        let faces: Vec<Vec<u32>> = mesh.1.iter().map(|t| vec![t[0], t[2], t[1]]).collect();
        let (polyhedron, fit) = Polyhedron::from_faces(&mesh.0, &faces).expect("a convex one");
        assert!(fit.moved == 0.0 && !fit.flipped, "{i}: {fit:?}");
        let [as_mesh, convex] = [alone(meshes::solid(&mesh)), alone(polyhedron)];
        let other = Model::new(solid_of(&mut r, 1, shape));
        let motions = [turning(&mut r), past(&mut r, 2.5)];
        let (o, p) = (ask(&as_mesh, &other, motions), ask(&convex, &other, motions));
        let decided = |o: &Outcome| o.status() != Status::Undecided;
        assert!(decided(&o) && decided(&p), "{i}: {o:?}, {p:?}");
        if o.status() == Status::Contact && p.status() == Status::Contact {
            if o.not_continued() || p.not_continued() {
                continue;
            }
            contacts += 1;
            let off = (o.time() - p.time()).abs() * o.at().normal_speed.abs().min(p.at().normal_speed.abs());
            worst = worst.max(off);
            assert!(off <= 1e-12, "{i}: {off:e}: {o:?}, {p:?}");
        } else {
            assert_eq!(o.status(), p.status(), "{i}: {o:?}, {p:?}");
        }
    }
    println!("{contacts} contacts of {count}, the same to {worst:.1e}");
    assert!(contacts * 4 > count, "{contacts}");
}

/// Facets with their corners on a solid lie no farther from it than `deviation`, and within a convex one: a mesh of them is met as
/// much earlier or later, and no earlier than what is convex.
fn facets_close_in(name: &str, (exact, is_convex): (Recipe, bool), counts: &[u32], make: impl Fn(u32) -> (Mesh, f64)) {
    let exact = Model::new(exact.build());
    let meshes: Vec<(Model, f64)> = counts
        .iter()
        .map(|n| {
            let (mesh, deviation) = make(*n);
            (alone(meshes::solid(&mesh)), deviation)
        })
        .collect();
    let mut r = Random::new(11);
    let mut contacts = vec![0; counts.len()];
    for i in 0..pairs(20) {
        // A ball small enough to come in from all sides, straight: its depth in the exact solid grows no faster than it moves.
        let ball = alone(contactd::solid::primitive::Sphere { radius: r.within(0.05, 0.5) });
        let start = r.direction() * 2.5;
        let velocity = (r.vector(0.8) - start) * 1.3;
        let motions = [Motion::resting(Pose::IDENTITY), Motion { start: Pose::at(start), velocity, spin: DVec3::ZERO }];
        let o = ask(&exact, &ball, motions);
        assert_ne!(o.status(), Status::Undecided, "{name} {i}");
        let mut coarser = f64::INFINITY;
        for (k, (model, deviation)) in meshes.iter().enumerate() {
            let m = ask(model, &ball, motions);
            assert_ne!(m.status(), Status::Undecided, "{name} {i}, {} facets: {m:?}", counts[k]);
            if m.status() != Status::Contact {
                assert!(coarser == f64::INFINITY || !is_convex, "{name} {i}, {}: clear after {coarser}", counts[k]);
                continue;
            }
            assert!(o.status() == Status::Contact || !is_convex, "{name} {i}: {o:?}, {m:?}");
            assert!(m.time() >= o.time() - 1e-12 || !is_convex, "{name} {i}, {}: {m:?} before {o:?}", counts[k]);
            // Corners of the coarser one are corners of the finer one, so a convex one holds the coarser one.
            assert!(m.time() <= coarser + 1e-12 || !is_convex, "{name} {i}, {}: {m:?} after {coarser}", counts[k]);
            coarser = m.time();
            // Where it meets the mesh the exact solid is no farther than the deviation.
            let depth = ball.solid.value(m.at().point - (start + velocity * m.time())).abs();
            assert!(depth < 1e-9, "{name} {i}: {depth}");
            let inside = -exact.solid.value(m.at().point);
            let most = deviation * (1.0 + 1e-9) + 1e-9;
            assert!(
                inside <= most && inside >= if is_convex { -1e-9 } else { -most },
                "{name} {i}: {inside} {deviation}"
            );
            contacts[k] += 1;
            if o.status() == Status::Contact && o.at().normal_speed > 0.5 * velocity.length() {
                let late = (m.time() - o.time()).abs() * velocity.length();
                assert!(late <= 8.0 * deviation, "{name} {i}: {late} {deviation}");
            }
        }
    }
    println!("{name}: contacts {contacts:?}");
    assert!(contacts.iter().all(|c| *c * 5 > pairs(20)), "{contacts:?}");
}

#[test]
fn finer_facets_meet_as_what_they_facet() {
    // Up to so many pieces a turn; `CONTACTD_FACETS=1024` is the long form.
    let most = sized("CONTACTD_FACETS", 64);
    let counts: Vec<u32> = [16, 32, 64, 128, 256, 512, 1024].into_iter().filter(|n| *n <= most).collect();
    let sagitta = |radius: f64, n: u32| radius * (1.0 - (std::f64::consts::PI / f64::from(n)).cos());
    facets_close_in("cylinder", (Recipe::cylinder(0.8, 0.5), true), &counts, |n| {
        (prism(&vec![0.8; n as usize], 0.5), sagitta(0.8, n))
    });
    facets_close_in("cone", (Recipe::cone(0.8, 0.0, 0.6), true), &counts, |n| {
        let profile = [DVec2::new(0.0, -0.6), DVec2::new(0.8, -0.6), DVec2::new(0.0, 0.6)];
        (lathe(&profile, n, false), sagitta(0.8, n))
    });
    facets_close_in("ball", (Recipe::sphere(0.8), true), &counts, |n| {
        let angle = |i: u32| std::f64::consts::PI * (f64::from(2 * i) / f64::from(n) - 0.5);
        let profile: Vec<DVec2> = (0..=n / 2)
            .map(|i| 0.8 * DVec2::new(if i % (n / 2) == 0 { 0.0 } else { angle(i).cos() }, angle(i).sin()))
            .collect();
        // Half the diagonal of a field at the equator, and a little for the sphere's bend.
        (lathe(&profile, n, false), 0.8 * (1.0 - (1.05 * 2.0_f64.sqrt() * std::f64::consts::PI / f64::from(n)).cos()))
    });
    facets_close_in("torus", (Recipe::torus(0.9, 0.3), false), &counts, |n| {
        (meshes::torus((0.9, 0.3), n, n / 2), sagitta(0.3, n / 2) + sagitta(1.2, n))
    });
}

#[test]
fn a_session_takes_the_bytes_of_a_mesh_by_the_name_of_their_format() {
    let config = contactd::ipc::ServerConfig::default();
    let mut session = contactd::embedded(&config).expect("a session");
    let tetrahedron = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
    let mut load = |name: &str, format: &str, bytes: &[u8]| {
        let file = ModelFile::new(name, format, bytes);
        session.load_model_file(file, Facets::Auto)
    };
    let info = load("a part", "off", tetrahedron.as_bytes()).expect("a tetrahedron");
    assert_eq!(info.faces.len(), 4);
    let (points, triangles) = meshes::torus((1.0, 0.3), 6, 5);
    let mut stl = vec![0; 80];
    stl.extend((triangles.len() as u32).to_le_bytes());
    for t in &triangles {
        stl.extend([0; 12]);
        let corners = t.iter().flat_map(|v| points[*v as usize].to_array());
        corners.for_each(|x| stl.extend((x as f32).to_le_bytes()));
        stl.extend([0; 2]);
    }
    let info = load("ring.stl", "", &stl).expect("a ring");
    assert!(info.warnings.iter().any(|w| w.to_string().contains("neither its unit")), "{:?}", info.warnings);
    let error = load("ring.stl", "", &stl[..stl.len() - 1]).expect_err("a byte is missing").to_string();
    assert!(error.contains("ring.stl:1:1: expected "), "{error}");
}
