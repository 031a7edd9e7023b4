//! What the accuracy benchmark asks: classes of questions, each with what is known of its answers.
//!
//! Families of primitive pairs come with their tables' times. The other classes of primitives have closed forms, written
//! where their cases are made, and so has a ball in a pipe. Other parts have none: they are held against the engine's own
//! answer at the finest resolution.

use crate::facets::{Drilled, Outline, compound, mesh};
use crate::peer;
use contactd::check::Check;
use contactd::import::{self, Facets, Limits, read_model};
use contactd::octree::Model;
use contactd::solid::primitive::{Cone, Cylinder, Sphere};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use contactd_tests::primitive_pairs::{FAMILIES, rows};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::Recipe;
use glam::{DQuat, DVec2, DVec3, dvec3};
use parry3d_f64::shape::SharedShape;
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is known of an answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truth {
    /// They meet first at this time, a fraction of the step.
    Meets(f64),
    /// They do not meet.
    Clear,
    /// Nothing but what the engine says at its finest.
    Unknown,
}

/// Two models over a step.
#[derive(Clone, Debug)]
pub struct Case {
    /// First model.
    pub a: Arc<Model>,
    /// Its motion.
    pub motion_a: Motion,
    /// Second model.
    pub b: Arc<Model>,
    /// Its motion.
    pub motion_b: Motion,
    /// Where the models stand in their objects' frames.
    pub places: [Pose; 2],
    /// What is known of the answer.
    pub truth: Truth,
}

impl Case {
    /// The larger bounding radius: resolutions and errors are told in it.
    pub fn size(&self) -> f64 {
        self.a.radius.max(self.b.radius)
    }

    /// The smallest dimension of any of its primitives: resolutions near it are refused.
    pub fn smallest_dimension(&self) -> f64 {
        let primitives = self.a.solid.primitives.iter().chain(&self.b.solid.primitives);
        primitives.map(|p| p.shape.geometry().smallest_dimension()).fold(f64::INFINITY, f64::min)
    }
}

/// What a user would take for a class today: shapes with N facets a circle against an exact convex one.
#[derive(Clone)]
pub struct Peer {
    /// The drilled body as parry's `Compound` and as its `TriMesh`.
    pub drilled: Arc<dyn Fn(usize) -> [SharedShape; 2]>,
    /// The other body.
    pub other: peer::Body,
}

/// Cases of one kind.
#[derive(Clone)]
pub struct Class {
    /// A few words.
    pub name: String,
    /// Family, part or hard: how figures group them.
    pub group: &'static str,
    /// The cases.
    pub cases: Vec<Case>,
    /// Who else can be asked.
    pub peer: Option<Peer>,
}

impl Class {
    fn new(name: &str, group: &'static str, cases: Vec<Case>) -> Self {
        Self { name: name.into(), group, cases, peer: None }
    }

    /// The same cases of models made anew, each model once.
    pub fn remade(&self, remake: impl Fn(&Model) -> Model) -> Self {
        let mut made: Vec<(*const Model, Arc<Model>)> = Vec::new();
        let mut of = |m: &Arc<Model>| {
            if let Some((_, known)) = made.iter().find(|(from, _)| *from == Arc::as_ptr(m)) {
                return known.clone();
            }
            let new = Arc::new(remake(m));
            made.push((Arc::as_ptr(m), new.clone()));
            new
        };
        let cases = self.cases.iter().map(|c| Case { a: of(&c.a), b: of(&c.b), ..c.clone() }).collect();
        Self { cases, ..self.clone() }
    }
}

/// All classes, with up to `count` cases each.
///
/// # Errors
/// A model or a scene cannot be read.
pub fn classes(count: usize) -> Result<Vec<Class>, Box<dyn Error>> {
    let mut all = families(count);
    all.extend(hard(count));
    all.extend(parts(count));
    all.extend(models(count)?);
    Ok(all)
}

fn model(recipe: &Recipe) -> Arc<Model> {
    Arc::new(Model::new(recipe.build()))
}

fn rest() -> Motion {
    Motion::resting(Pose::IDENTITY)
}

/// The 18 families of primitive pairs, translating and turning.
pub fn families(count: usize) -> Vec<Class> {
    let class = |family: &&str| {
        let cases = rows(family).into_iter().take(count).map(|(scene, time)| Case {
            a: model(&scene.a),
            motion_a: scene.motion_a,
            b: model(&scene.b),
            motion_b: scene.motion_b,
            places: [Pose::IDENTITY; 2],
            truth: if time < 0.0 { Truth::Clear } else { Truth::Meets(time) },
        });
        Class::new(&family.replace('_', " "), "pairs", cases.collect())
    };
    FAMILIES.iter().map(class).collect()
}

/// A sphere of radius 1 passes another one, off its touch by 1e-7 to 1e-3 of the radius to one side (`sign` 1) or the other.
fn passing(r: &mut Random, sign: f64) -> Case {
    let off = 2.0 + sign * 10f64.powf(r.within(-7.0, -3.0));
    let ball = model(&Recipe::sphere(1.0));
    let (from, speed) = (r.within(3.0, 4.0), 6.0);
    let start = Pose::at(dvec3(-from, off, 0.0));
    // |d|² = (from − speed t)² + off² = 4.
    let reach = (2.0 - off) * (2.0 + off);
    let truth = if reach > 0.0 { Truth::Meets((from - reach.sqrt()) / speed) } else { Truth::Clear };
    let motion_b = Motion::turning(start, start.position + DVec3::X * speed, DVec3::ZERO);
    Case { a: ball.clone(), motion_a: rest(), b: ball, motion_b, places: [Pose::IDENTITY; 2], truth }
}

/// A body whose lowest point is `low` under its origin falls on a floor at z = 0 while it turns about z.
fn falling(r: &mut Random, floor: &Arc<Model>, body: &Arc<Model>, low: f64, at: DVec3) -> Case {
    let (height, way) = (r.within(0.5, 1.0), r.within(1.2, 2.0));
    let turn = DQuat::from_rotation_z(r.within(0.0, TAU));
    let size = low.max(1.0);
    let start = Pose::new(at + DVec3::Z * (low + height * size), turn);
    let motion_b = Motion::turning(start, start.position - DVec3::Z * (way * size), DVec3::Z * r.within(-1.0, 1.0));
    let motion_a = Motion::resting(Pose::at(at));
    let truth = Truth::Meets(height / way);
    Case { a: floor.clone(), motion_a, b: body.clone(), motion_b, places: [Pose::IDENTITY; 2], truth }
}

/// Classes that cost other engines their accuracy, each with a closed form.
pub fn hard(count: usize) -> Vec<Class> {
    let class = |name: &str, seed: u64, mut draw: Box<dyn FnMut(&mut Random) -> Case>| {
        let mut r = Random::new(seed);
        Class::new(name, "hard", (0..count).map(|_| draw(&mut r)).collect())
    };
    let floor = model(&Recipe::cuboid(5.0, 5.0, 0.5).at(0.0, 0.0, -0.5));
    let ball = model(&Recipe::sphere(1.0));
    let dust = model(&Recipe::sphere(1e-6));
    let cone = model(&Recipe::of(Cone { bottom: 0.5, top: 0.0, half_height: 1.0 }));
    let rod = model(
        &Recipe::of(Cylinder { radius: 0.01, half_height: 2.0 })
            .moved(&Pose::new(DVec3::ZERO, DQuat::from_rotation_y(FRAC_PI_2))),
    );
    let bead = model(&Recipe::sphere(0.05));
    let log = model(&Recipe::cylinder(0.5, 1.0));
    let down = quat_of_rotation_vector(DVec3::X * std::f64::consts::PI);
    let at_floor = floor.clone();
    let (far_floor, far_ball) = (floor.clone(), ball.clone());
    vec![
        class("easy", 31, Box::new(move |r| falling(r, &at_floor, &ball, 1.0, DVec3::ZERO))),
        // They pass in each other by 1e-7 to 1e-3 of the radius …
        class("grazing", 32, Box::new(|r| passing(r, -1.0))),
        // … or pass each other by as much.
        class("near touch", 33, Box::new(|r| passing(r, 1.0))),
        class(
            "parallel",
            34,
            Box::new(move |r| {
                let turn = r.rotation();
                let (gap, way) = (r.within(0.2, 1.0), r.within(1.2, 2.0));
                let start = Pose::new(turn * (DVec3::X * (1.0 + gap)), turn);
                let motion_b = Motion::turning(start, turn * (DVec3::X * (1.0 + gap - way)), DVec3::ZERO);
                let motion_a = Motion::resting(Pose::new(DVec3::ZERO, turn));
                let truth = Truth::Meets(gap / way);
                Case { a: log.clone(), motion_a, b: log.clone(), motion_b, places: [Pose::IDENTITY; 2], truth }
            }),
        ),
        class(
            "apex",
            35,
            Box::new(move |r| {
                let mut case = falling(r, &floor, &cone, 1.0, DVec3::ZERO);
                case.motion_b.start.rotation *= down;
                case
            }),
        ),
        class(
            "fast spin",
            36,
            Box::new(move |r| {
                // A rod turns about z through up to 80 turns; the bead's surface stands asin(.06 / 1.5) before its centre.
                let (turns, angle) = (10f64.powf(r.within(0.0, 1.9)), r.within(0.2, 3.0));
                let bead_at = 1.5 * dvec3(angle.cos(), angle.sin(), 0.0);
                let motion_a = Motion { start: Pose::IDENTITY, velocity: DVec3::ZERO, spin: DVec3::Z * (turns * TAU) };
                let time = (angle - (0.06f64 / 1.5).asin()) / (turns * TAU);
                let motion_b = Motion::resting(Pose::at(bead_at));
                let (a, b, truth) = (rod.clone(), bead.clone(), Truth::Meets(time));
                Case { a, motion_a, b, motion_b, places: [Pose::IDENTITY; 2], truth }
            }),
        ),
        class(
            "size ratio 1e6",
            37,
            Box::new({
                let floor = model(&Recipe::cuboid(5.0, 5.0, 0.5).at(0.0, 0.0, -0.5));
                move |r| {
                    let mut case = falling(r, &floor, &dust, 1e-6, DVec3::ZERO);
                    // A height that is a whole number of the floor's last places.
                    case.motion_b.start.rotation = DQuat::IDENTITY;
                    case
                }
            }),
        ),
        class(
            "offset 1e7",
            38,
            Box::new(move |r| {
                let at = DVec3::splat(1e7);
                let mut case = falling(r, &far_floor, &far_ball, 1.0, at);
                // Positions out there are whole multiples of 2⁻²⁹: the truth is of what was rounded to.
                let height = case.motion_b.start.position.z - at.z - 1.0;
                case.truth = Truth::Meets(height / -case.motion_b.velocity.z);
                case
            }),
        ),
    ]
}

/// Small parts that a user would tessellate.
pub fn parts(count: usize) -> Vec<Class> {
    type Draw = Box<dyn FnMut(&mut Random) -> (Motion, Truth)>;
    let class = |name: &str, seed: u64, a: Recipe, b: Recipe, peer: Option<Peer>, mut draw: Draw| {
        let (a, b) = (model(&a), model(&b));
        let mut r = Random::new(seed);
        let case = |_| {
            let (motion_b, truth) = draw(&mut r);
            Case { a: a.clone(), motion_a: rest(), b: b.clone(), motion_b, places: [Pose::IDENTITY; 2], truth }
        };
        Class { peer, ..Class::new(name, "parts", (0..count).map(case).collect()) }
    };
    let plate = || Recipe::cuboid(0.5, 0.5, 0.1).minus(Recipe::cylinder(0.25, 0.5));
    let peg = || Recipe::cylinder(0.24, 0.5);
    let drilled = |part: Drilled, other: peer::Body| {
        let drilled = Arc::new(move |n: usize| [compound(&[part], n), mesh(&[part], n)]);
        Some(Peer { drilled, other })
    };
    let block =
        Drilled { center: DVec3::ZERO, outline: Outline::Rectangle(DVec2::splat(0.5)), hole: 0.25, half_height: 0.1 };
    let pipe = Drilled { center: DVec3::ZERO, outline: Outline::Circle(0.35), hole: 0.25, half_height: 1.0 };
    let shaft = peer::Body::of(&Cylinder { radius: 0.24, half_height: 0.5 }.into(), &Pose::IDENTITY);
    let ball = peer::Body::of(&Sphere { radius: 0.2 }.into(), &Pose::IDENTITY);
    vec![
        class(
            "peg tilted",
            41,
            plate(),
            peg(),
            drilled(block, shaft.clone()),
            Box::new(move |r| {
                let at = sideways(r) * 0.005 + DVec3::Z;
                let down = DVec3::Z * -r.within(0.8, 1.0);
                (moving(at, sideways(r) * r.within(0.03, 0.12), down, DVec3::ZERO), Truth::Unknown)
            }),
        ),
        class(
            "peg sideways, turning",
            42,
            plate(),
            peg(),
            drilled(block, shaft),
            Box::new(move |r| {
                let by = sideways(r) * r.within(0.02, 0.1);
                (moving(sideways(r) * 0.003, DVec3::ZERO, by, r.vector(0.05)), Truth::Unknown)
            }),
        ),
        class(
            "ball in pipe",
            43,
            Recipe::cylinder(0.35, 1.0).minus(Recipe::cylinder(0.25, 1.5)),
            Recipe::sphere(0.2),
            drilled(pipe, ball),
            Box::new(move |r| {
                let (at, by) = (sideways(r) * r.within(0.0, 0.03), sideways(r) * r.within(0.1, 0.2));
                // Its centre comes to .05 from the axis: |at + by t|² = .0025.
                let (square, along) = (by.length_squared(), at.dot(by));
                let root = along * along + square * (0.05 * 0.05 - at.length_squared());
                (moving(at, DVec3::ZERO, by, DVec3::ZERO), Truth::Meets((root.sqrt() - along) / square))
            }),
        ),
        class(
            "ball into countersink",
            44,
            Recipe::cuboid(0.9, 0.9, 0.3).minus(Recipe::of(Cone { bottom: 0.1, top: 0.6, half_height: 0.35 })),
            Recipe::sphere(0.3),
            None,
            Box::new(move |r| {
                let at = sideways(r) * r.within(0.0, 0.2) + DVec3::Z;
                (moving(at, DVec3::ZERO, DVec3::Z * -r.within(0.9, 1.1), r.vector(0.3)), Truth::Unknown)
            }),
        ),
        class("slotted rods passing", 45, slotted_rod(0.8), slotted_rod(-0.5), None, {
            Box::new(move |r| {
                // They pass at up to a third of their length; half of the pairs miss.
                let side = sideways(r) * r.within(0.0, 0.35);
                let at = side + dvec3(0.0, 0.0, 1.2);
                (moving(at, r.vector(0.4), DVec3::Z * -2.4, DVec3::ZERO), Truth::Unknown)
            })
        }),
    ]
}

/// A long rod with a slot through it, standing oblique in its own model: what boxes along axes fit badly.
fn slotted_rod(tilt: f64) -> Recipe {
    let along = |r: Recipe| r.moved(&Pose::new(DVec3::ZERO, quat_of_rotation_vector(dvec3(tilt, 0.9, 0.0))));
    let slot = along(Recipe::cuboid(0.02, 0.2, 0.4));
    along(Recipe::cylinder(0.06, 1.0)).minus(slot)
}

fn sideways(r: &mut Random) -> DVec3 {
    DQuat::from_rotation_z(r.within(0.0, TAU)) * DVec3::X
}

fn moving(at: DVec3, tilt: DVec3, by: DVec3, spin: DVec3) -> Motion {
    Motion::turning(Pose::new(at, quat_of_rotation_vector(tilt)), at + by, spin)
}

/// Parts from files: a comb of pegs, a part of forty primitives minus forty, the flange and screws of the assembly, and what the demo plays.
///
/// # Errors
/// A model or a scene cannot be read.
pub fn models(count: usize) -> Result<Vec<Class>, Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let read = |name: &str| -> Result<Arc<Model>, Box<dyn Error>> {
        let path = root.join("tests/models").join(name).with_extension("csg");
        Ok(Arc::new(Model::new(read_model(&path, Facets::Auto, &Limits::default())?.solid)))
    };
    let case = |a: &Arc<Model>, motion_a: Motion, b: &Arc<Model>, motion_b: Motion| Case {
        a: a.clone(),
        motion_a,
        b: b.clone(),
        motion_b,
        places: [Pose::IDENTITY; 2],
        truth: Truth::Unknown,
    };
    let mut all = Vec::new();
    let (plate, comb, part) = (read("plate_100")?, read("comb_100")?, read("part_40_40")?);
    let mut r = Random::new(51);
    let cases = (0..count.min(12)).map(|_| {
        let tilt = r.direction() * 10f64.powf(r.within(-3.0, -1.0));
        let at = sideways(&mut r) * r.within(0.0, 0.008) + DVec3::Z * (1.0 + 5.5 * tilt.length());
        case(&plate, rest(), &comb, moving(at, tilt, DVec3::Z * -0.7, DVec3::ZERO))
    });
    all.push(Class::new("comb of 100 pegs", "parts", cases.collect()));
    for (name, seed, spins, aside) in
        [("40-40 and copy", 52, false, 0.3), ("40-40, turning", 53, true, 0.3), ("40-40 passing by", 54, false, 2.0)]
    {
        let mut r = Random::new(seed);
        let cases = (0..count.min(20)).map(|_| {
            let (way, p, q) = (r.direction(), r.rotation(), r.rotation());
            let spin = if spins { [r.vector(0.5), r.vector(0.5)] } else { [DVec3::ZERO; 2] };
            let start = 3.0 * way + if aside > 1.0 { way.cross(r.direction()) * aside } else { DVec3::ZERO };
            let by = -(if aside > 1.0 { 6.0 } else { 1.5 }) * way + r.vector(0.3);
            let a = Motion::turning(Pose::new(DVec3::ZERO, p), DVec3::ZERO, spin[0]);
            case(&part, a, &part, Motion::turning(Pose::new(start, q), start + by, spin[1]))
        });
        all.push(Class::new(name, "parts", cases.collect()));
    }
    let screws = of_scene(&root.join("server/models/assembly.toml"))?;
    all.push(Class::new("flange and screws", "parts", screws.into_iter().take(count).collect()));
    all.push(Class::new("demo", "parts", demo(count.min(16))?));
    Ok(all)
}

/// The pairs of a scene that its step had to search.
fn of_scene(path: &Path) -> Result<Vec<Case>, Box<dyn Error>> {
    let scene = import::read_scene(path)?;
    let imports = scene.load_models(Facets::Auto, &Limits::default())?;
    let models: Vec<Arc<Model>> = imports.into_iter().map(|i| Arc::new(Model::new(i.solid))).collect();
    let mut check = Check::new(&scene, &models, None)?;
    let pairs = check.step(false)?.pairs.clone();
    let bodies = check.world.bodies();
    let searched = pairs.iter().filter(|p| p.outcome.counters.primitives > 0);
    let case = |p: &contactd::world::PairOutcome| {
        let [a, b] = [p.a, p.b].map(|id| &bodies[id as usize]);
        Case {
            a: a.part.model.clone(),
            motion_a: a.motion_state.motion,
            b: b.part.model.clone(),
            motion_b: b.motion_state.motion,
            places: [a.place, b.place],
            truth: Truth::Unknown,
        }
    };
    Ok(searched.map(case).collect())
}

/// Searched pairs of the demo's steps, from all over it.
fn demo(count: usize) -> Result<Vec<Case>, Box<dyn Error>> {
    let folder = Folder(std::env::temp_dir().join(format!("contactd-accuracy-{}", std::process::id())));
    let total: usize = contactd::demo::script::acts().iter().map(|a| a.steps).sum();
    let mut cases = Vec::new();
    // Twice as many steps as cases: some have no pair that is near.
    for i in 0..2 * count {
        let step = (2 * i + 1) * total / (4 * count);
        let found = of_scene(&contactd::demo::scene::write(step, &folder.0)?)?;
        cases.extend(found.into_iter().take(2));
        if cases.len() >= count && i >= count {
            break;
        }
    }
    // Evenly thinned out.
    let n = cases.len();
    let keep = count.min(n);
    Ok((0..keep).map(|k| cases[k * n / keep].clone()).collect())
}

/// A folder that goes when it is done with.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
