//! Faces of one body that lie on each other or nearly so: skins of no thickness, the same part twice, walls down to nothing,
//! crescents, lattices of parts with common faces. Each scene has an answer, most that of a plainer solid.
//!
//! `CONTACTD_COINCIDENT_SCENES=N` for another number of scenes a class than the short one, `CONTACTD_COINCIDENT_FIRST=I` from another
//! one on; the long form prints what the dearest cost:
//! `CONTACTD_COINCIDENT_SCENES=1000 cargo test --release -p contactd-tests --test answers coincident:: -- --nocapture`

use contactd::contact::{DEFAULT_CELL_LIMIT, Outcome, PairQuery, Scratch, Status, earliest_contact};
use contactd::octree::Model;
use contactd::solid::primitive::{Cone, Cuboid, Cylinder, Polyhedron, Sphere};
use contactd::solid::{Shape, Solid};
use contactd_proto::{Motion, Pose};
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::engine::question_of;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Recipe, Scene};
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3};

/// A scene with what is known of its answer.
struct Known {
    scene: Scene,
    /// The same scene with a plainer solid in place of one, where there is such a solid.
    plain: Option<Scene>,
    /// How far the plainer solid's surface may be from this one's, a length.
    off: f64,
}

/// A number whose logarithm is uniform.
fn log_uniform(rng: &mut Random, lo: f64, hi: f64) -> f64 {
    rng.within(lo.ln(), hi.ln()).exp()
}

/// A primitive with its pose, and the same one about its own axis turned by any angle where it is round.
fn part(rng: &mut Random) -> (Recipe, Recipe) {
    let mut s = |lo: f64, hi: f64| rng.within(lo, hi);
    let (a, b, c) = (s(0.3, 1.0), s(0.3, 1.0), s(0.3, 1.0));
    let (shape, round): (Shape, bool) = match rng.below(6) {
        0 => (Sphere { radius: a }.into(), true),
        1 => (Cylinder { radius: a, half_height: b }.into(), true),
        2 => (Cone { bottom: a, top: 0.0, half_height: b }.into(), true),
        3 => (Cone { bottom: a, top: a * rng.within(0.3, 0.9), half_height: b }.into(), true),
        4 => (Cuboid { half: DVec3::new(a, b, c) }.into(), false),
        _ => (Polyhedron::platonic([4, 6, 8, 12, 20][rng.below(5)], a).expect("a count").into(), false),
    };
    let pose = Pose::new(rng.vector(0.3), rng.rotation());
    let turn = if round && rng.chance(0.5) { rng.within(-3.0, 3.0) } else { 0.0 };
    let again = pose.compose(&Pose::new(DVec3::ZERO, DQuat::from_rotation_z(turn)));
    (Recipe::Leaf(shape.clone(), pose), Recipe::Leaf(shape, again))
}

/// A tree of some parts and the same tree of parts turned about their axes.
fn twins(rng: &mut Random) -> (Recipe, Recipe) {
    let (a, b) = part(rng);
    match rng.below(5) {
        0..=2 => (a, b),
        3 => {
            let (c, d) = part(rng);
            (a.union(c), b.union(d))
        }
        _ => {
            let (c, d) = part(rng);
            (a.minus(c.clone()), b.minus(d))
        }
    }
}

/// The other body and both motions; sometimes a resolution of its own.
fn staged(rng: &mut Random, class: &'static str, a: Recipe, plain: Option<Recipe>, off: f64) -> Known {
    let leaves = 1 + rng.below(2);
    let b = if rng.chance(0.3) { Recipe::cuboid(2.0, 2.0, 0.4) } else { scenes::tree(rng, leaves) };
    let (motion_a, motion_b) = scenes::approach(rng, 1.0);
    let mut scene = Scene::new(class, a, motion_a, b, motion_b);
    scene.resolution = Some(if rng.chance(0.5) { 1.7e-9 } else { log_uniform(rng, 1e-10, 1e-4) });
    let plain = plain.map(|a| Scene { a, ..scene.clone() });
    Known { scene, plain, off }
}

/// Skins of no thickness: A − A and the like, alone or with something beside them.
fn skin(rng: &mut Random) -> Known {
    let (a, same) = twins(rng);
    let (other, _) = part(rng);
    let (tree, plain) = match rng.below(6) {
        0 => (a.minus(same), None),
        1 => (a.clone().union(other.clone()).minus(same), Some(other.minus(a))),
        2 => (a.minus(same.union(other)), None),
        3 => (a.minus(same).union(other.clone()), Some(other)),
        4 => (a.intersection(other.clone().minus(same)), None),
        _ => (other.clone().minus(a.minus(same)), Some(other)),
    };
    staged(rng, "skin", tree, plain, 0.0)
}

/// The same twice.
fn twice(rng: &mut Random) -> Known {
    let (a, same) = twins(rng);
    let (other, _) = part(rng);
    let (tree, plain) = match rng.below(6) {
        0 => (a.clone().union(same), a),
        1 => (a.clone().intersection(same), a),
        2 => (a.clone().union(same.union(other.clone())), a.union(other)),
        3 => (a.clone().union(other.clone()).intersection(same), a),
        4 => (other.clone().minus(a.clone()).minus(same), other.minus(a)),
        _ => (a.clone().minus(other.clone()).union(same), a),
    };
    staged(rng, "twice", tree, Some(plain), 0.0)
}

/// A round part less itself made smaller by a wall, shifted or tilted by it, alone or with something beside it.
fn wall(rng: &mut Random) -> Known {
    let w = log_uniform(rng, 1e-12, 1e-3);
    let pose = Pose::new(rng.vector(0.3), rng.rotation());
    let (r, h) = (rng.within(0.3, 1.0), rng.within(0.3, 1.0));
    let how = rng.below(4);
    let thin = if how == 0 || how == 3 { w } else { 0.0 };
    let (outer, inner): (Shape, Shape) = match rng.below(4) {
        0 => (Sphere { radius: r }.into(), Sphere { radius: r - thin }.into()),
        1 => {
            let taller = if rng.chance(0.5) { h + 0.1 } else { h - thin };
            (Cylinder { radius: r, half_height: h }.into(), Cylinder { radius: r - thin, half_height: taller }.into())
        }
        2 => {
            let top = r * rng.within(0.3, 0.9);
            (
                Cone { bottom: r, top, half_height: h }.into(),
                Cone { bottom: r - thin, top: top - thin, half_height: h }.into(),
            )
        }
        _ => (
            Cone { bottom: r, top: 0.0, half_height: h }.into(),
            Cone { bottom: r - thin, top: 0.0, half_height: h }.into(),
        ),
    };
    let off = match how {
        1 => Pose::new(rng.direction() * w, DQuat::IDENTITY),
        2 => Pose::new(DVec3::ZERO, DQuat::from_scaled_axis(rng.direction() * w)),
        3 => Pose::new(rng.direction() * 0.5 * w, DQuat::from_scaled_axis(rng.direction() * 0.1 * w)),
        _ => Pose::IDENTITY,
    };
    let (outer, inner) = (Recipe::Leaf(outer, pose), Recipe::Leaf(inner, pose.compose(&off)));
    let shell = outer.minus(inner);
    let (other, _) = part(rng);
    let tree = if rng.chance(0.3) { shell.union(other) } else { shell };
    staged(rng, "wall", tree, None, 0.0)
}

/// A part and nearly the same once more.
fn nearly(rng: &mut Random) -> Known {
    let w = log_uniform(rng, 1e-13, 1e-3);
    let (a, same) = twins(rng);
    let off = Pose::new(rng.direction() * w, DQuat::from_scaled_axis(rng.direction() * w));
    let same = same.moved(&off);
    let (tree, plain) = match rng.below(3) {
        0 => (a.clone().union(same), a),
        1 => (a.clone().intersection(same), a),
        _ => (Recipe::cuboid(1.5, 1.5, 1.0).minus(a.clone()).minus(same), Recipe::cuboid(1.5, 1.5, 1.0).minus(a)),
    };
    staged(rng, "nearly", tree, Some(plain), 8.0 * w)
}

/// Abutting cubes and coaxial cylinders, some left out, some drilled along a common axis.
fn lattice(rng: &mut Random) -> Known {
    let n = 2 + rng.below(2);
    let s = 1.0 / n as f64;
    let round = rng.below(3);
    let mut tree: Option<Recipe> = None;
    for i in 0..n * n * n {
        if rng.chance(0.4) {
            continue;
        }
        let [x, y, z] = [i % n, i / n % n, i / n / n].map(|k| (2.0 * k as f64 - (n as f64 - 1.0)) * s);
        let cell = match round {
            0 => Recipe::cuboid(s, s, s),
            1 => Recipe::cylinder(s, s),
            _ => Recipe::cuboid(s, s, s).minus(Recipe::cylinder(0.6 * s, if rng.chance(0.5) { s } else { 1.5 * s })),
        };
        let cell = cell.at(x, y, z);
        tree = Some(match tree {
            Some(t) => t.union(cell),
            None => cell,
        });
    }
    let tree = tree.unwrap_or_else(|| Recipe::cuboid(s, s, s));
    let tree = if rng.chance(0.3) { tree.minus(Recipe::cylinder(s, 2.0)) } else { tree };
    staged(rng, "lattice", tree, None, 0.0)
}

fn ask(scene: &Scene, limit: u64) -> Outcome {
    let models = [Model::new(scene.a.build()), Model::new(scene.b.build())];
    let query = question_of(scene, [&models[0], &models[1]], contactd::contact::QueryOptions::DEPTH);
    let resolution = scene.resolution.unwrap_or(query.resolution);
    earliest_contact(&PairQuery { resolution, cell_limit: limit, ..query }, &mut Scratch::default())
}

/// x of the world in a body at a time.
fn within(motion: &Motion, t: f64, x: DVec3) -> DVec3 {
    motion.at(t).inverse().point(x)
}

/// Points that are deep in a solid: beside its faces, as deep as they may be there, and anywhere.
fn deep_points(rng: &mut Random, solid: &Solid, depth: f64, count: usize) -> Vec<DVec3> {
    let hull = solid.aabb();
    let mut points = Vec::new();
    if hull.is_empty() {
        return points;
    }
    for _ in 0..count {
        let mut x = rng.point_in(&hull);
        if rng.chance(0.8) {
            let face = solid.faces[rng.below(solid.faces.len())];
            let below = depth * rng.within(1.001, 1.2);
            for _ in 0..2 {
                let at = face.at(x);
                x -= at.normal * (at.value + if rng.chance(0.5) { below } else { -below });
            }
        }
        if solid.value(x) <= -depth {
            points.push(x);
        }
    }
    points
}

/// What is wrong with an answer: a common point of that depth before `time_lower`, or surfaces that do not meet at `time`.
fn wrong(rng: &mut Random, known: &Known, o: &Outcome) -> Option<String> {
    let scene = &known.scene;
    let solids = [scene.a.build(), scene.b.build()];
    let motions = [scene.motion_a, scene.motion_b];
    let depth = (1.0 + 1e-6) * o.depth + 1e-13;
    for side in 0..if o.status() == Status::Overlap { 0 } else { 2 } {
        let (own, other) = (side, 1 - side);
        for x in deep_points(rng, &solids[own], depth, 300) {
            for k in 0..40 {
                let t = o.time_lower() * (k as f64 + rng.within(0.0, 1.0)) / 40.0;
                if solids[other].value(within(&motions[other], t, motions[own].at(t).point(x))) <= -depth {
                    return Some(format!("common point at {t}, {x} of side {own}"));
                }
            }
        }
    }
    if o.status() == Status::Contact {
        let size = 1.0 + o.at().point.length();
        for side in 0..2 {
            let f = solids[side].value(within(&motions[side], o.time(), o.at().point));
            if f.abs() > 1e-9 * size + if o.not_continued() { 4.0 * o.resolution } else { 0.0 } {
                return Some(format!("f of side {side} is {f:e} at the point of contact"));
            }
        }
    }
    if let Some(plain) = &known.plain {
        let p = ask(plain, DEFAULT_CELL_LIMIT);
        if p.status() == Status::Undecided {
            return None;
        }
        let speed = scene.speed();
        // Sharp edges and slow contacts: the depth is reached later than the touch; both answers say by how much.
        let slack = known.off + 1e-9;
        let late = (p.time_upper() - p.time_lower()).max(o.time_upper() - o.time_lower());
        let same = p.status() == o.status() && (p.time() - o.time()).abs() <= late + slack;
        let touches = |o: &Outcome| o.touching || o.status() != Status::Clear && o.time() < 1e-6;
        let grazes = known.off > 0.0 || (touches(&p) && touches(o));
        if !same && !grazes {
            return Some(format!(
                "{:?} at {}, the plain solid {:?} at {} (speed {speed})",
                o.status(),
                o.time(),
                p.status(),
                p.time()
            ));
        }
    } else if known.scene.class == "skin" && o.status() != Status::Clear {
        return Some(format!("{:?} at {} with nothing", o.status(), o.time()));
    }
    None
}

/// Asks scenes of a class; no answer may be undecided or wrong, nor dearer than `most` cells (the median than `median`).
fn hold(name: &str, draw: fn(&mut Random) -> Known, [median, most]: [u64; 2]) {
    let (first, count) = (sized("CONTACTD_COINCIDENT_FIRST", 0), sized("CONTACTD_COINCIDENT_SCENES", 10));
    let limit = sized("CONTACTD_COINCIDENT_CELLS", 100_000_u64);
    let mut cells = Vec::new();
    let mut faults = Vec::new();
    let mut shares = std::collections::BTreeMap::<&str, usize>::new();
    for i in first..first + count {
        let mut rng = Random::new(0xC01C_1DE0 ^ (i as u64) << 8 ^ name.len() as u64);
        let known = draw(&mut rng);
        let o = ask(&known.scene, limit);
        cells.push(o.counters.cells);
        *shares
            .entry(match o.status() {
                Status::Contact => "contact",
                Status::Clear => "clear",
                Status::Overlap => "overlap",
                Status::Undecided => "undecided",
            })
            .or_default() += 1;
        if o.status() == Status::Undecided {
            faults.push(format!("{name} {i}: undecided from {} at {:e}", o.time_lower(), o.resolution));
        } else if let Some(what) = wrong(&mut rng, &known, &o) {
            faults.push(format!("{name} {i}: {what}"));
        }
        if (o.counters.cells > most && std::env::var_os("CONTACTD_COINCIDENT_SCENES").is_some())
            || std::env::var_os("CONTACTD_COINCIDENT_SHOW").is_some()
        {
            println!("{name} {i}: {} cells, {:?} at {:e}", o.counters.cells, o.status(), o.resolution);
            if std::env::var_os("CONTACTD_COINCIDENT_SHOW").is_some() {
                println!("{o:?}");
            }
            if std::env::var_os("CONTACTD_COINCIDENT_SHOW").is_some() {
                println!("{:?}", known.scene);
            }
        }
    }
    cells.sort_unstable();
    let at = |share: f64| cells[((cells.len() - 1) as f64 * share) as usize];
    println!("{name}: {count} scenes {shares:?}; cells p50 {} p99 {} most {}", at(0.5), at(0.99), at(1.0));
    for fault in &faults {
        println!("{fault}");
    }
    assert!(faults.is_empty(), "{} of {count} {name} scenes", faults.len());
    assert!(at(0.5) <= median && at(0.98) <= most, "{name}: {} cells in the median, {}", at(0.5), at(0.98));
}

#[test]
fn what_has_no_thickness_is_not_there() {
    hold("skin", skin, [60, 3_000]);
}

#[test]
fn the_same_twice_is_the_same() {
    hold("twice", twice, [100, 3_000]);
}

#[test]
fn thin_walls_are_there_or_not() {
    hold("wall", wall, [200, 5_000]);
}

#[test]
fn nearly_the_same_twice() {
    hold("nearly", nearly, [200, 5_000]);
}

#[test]
fn lattices_of_parts_with_common_faces() {
    hold("lattice", lattice, [200, 5_000]);
}
