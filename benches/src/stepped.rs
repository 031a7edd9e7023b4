//! Scenes stepped side by side in two worlds, one of which forgets before every step; both answer the same bits, which is
//! checked.
//!
//! `apart`: 512 balls, boxes and cylinders on a grid that each circle around their place and never come near; `peg`: a peg
//! comes down on its hole, 1 mm at a time, and slides in; `rest`: 64 drilled blocks lie on a floor, and are told as touching
//! in every step.
//!
//! Then a peg on its way into its hole (`approaches`), in steps of one world that remembers, and as one question to a world
//! that does not.

use contactd::contact::Status;
use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, StepError, StepOptions, World};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose, PoseRecord, Report, Rule};
use contactd_tests::scenes::Recipe;
use glam::DVec3;
use std::sync::Arc;
use std::time::Instant;

/// A scene: its objects, the first `fixed` of them static, and where the others are after a step.
pub struct Scene {
    /// A word.
    pub name: &'static str,
    /// Its objects.
    pub recipes: Vec<Recipe>,
    /// So many of them, the first ones, are static.
    pub fixed: usize,
    /// Where an object is after a step.
    pub pose: fn(usize, usize) -> Pose,
    /// How far objects are to fall in a step from where they are put at its start; `None`: they go from where the step before
    /// left them, to their pose.
    pub fall: Option<f64>,
    /// Rules of the world.
    pub rules: Vec<Rule>,
}

impl Scene {
    /// The records of a step.
    fn records(&self, step: usize) -> Vec<PoseRecord> {
        let mut records = Vec::new();
        for i in self.fixed..self.recipes.len() {
            let mut pose = (self.pose)(i, step);
            if let Some(fall) = self.fall {
                records.push(PoseRecord::start(i as u32, &pose));
                pose.position.z -= fall;
            }
            records.push(PoseRecord::end(i as u32, &pose));
        }
        records
    }
}

fn circling(object: usize, step: usize) -> Pose {
    let grid = DVec3::from([object % 8, object / 8 % 8, object / 64].map(|i| i as f64));
    let angle = 0.02 * step as f64 + object as f64;
    let at = 1.2 * grid + 0.05 * DVec3::new(angle.cos(), angle.sin(), (0.7 * angle).sin());
    Pose::new(at, quat_of_rotation_vector(DVec3::new(0.6, 0.0, 0.8) * (0.5 * angle)))
}

fn descending(object: usize, step: usize) -> Pose {
    if object == 0 { Pose::IDENTITY } else { Pose::at(DVec3::new(0.001, 0.002, 2.0 - 0.01 * step as f64)) }
}

fn lying(object: usize, _: usize) -> Pose {
    if object == 0 {
        return Pose::at(DVec3::new(0.0, 0.0, -1.0));
    }
    let i = object - 1;
    Pose::at(DVec3::new(1.5 * (i % 8) as f64, 1.5 * (i / 8) as f64, 0.2))
}

fn plate_and_peg() -> [Recipe; 2] {
    [Recipe::cuboid(0.8, 0.8, 0.2).minus(Recipe::cylinder(0.25, 1.0)), Recipe::cylinder(0.24, 0.5)]
}

/// The three scenes.
pub fn scenes() -> [Scene; 3] {
    let kinds = [Recipe::sphere(0.4), Recipe::cuboid(0.25, 0.3, 0.25), Recipe::cylinder(0.25, 0.3)];
    let [plate, peg] = plate_and_peg();
    let block = Recipe::cuboid(0.5, 0.4, 0.2).minus(Recipe::cylinder(0.15, 1.0));
    let mut lying_blocks = vec![Recipe::cuboid(20.0, 20.0, 1.0)];
    lying_blocks.resize(65, block);
    let patches = Rule { report: Report::Patch, ..Rule::new(["default".into(), "default".into()]) };
    [
        Scene {
            name: "apart",
            recipes: (0..512).map(|i| kinds[i % 3].clone()).collect(),
            fixed: 0,
            pose: circling,
            fall: None,
            rules: vec![],
        },
        Scene { name: "peg", recipes: vec![plate, peg], fixed: 1, pose: descending, fall: None, rules: vec![] },
        Scene { name: "rest", recipes: lying_blocks, fixed: 1, pose: lying, fall: None, rules: vec![patches] },
    ]
}

fn world(scene: &Scene) -> Result<World, Box<dyn std::error::Error>> {
    let mut world = World::new(scene.recipes.len(), 2 * scene.recipes.len());
    world.set_rules(scene.rules.clone())?;
    for (i, recipe) in scene.recipes.iter().enumerate() {
        let part = Arc::new(MeasuredModel::new(Arc::new(Model::new(recipe.build()))));
        let spec = ObjectSpec::new(i as u32, &part, (scene.pose)(i, 0));
        world.add_object(ObjectSpec { is_static: i < scene.fixed, ..spec })?;
    }
    Ok(world)
}

/// What stepping a scene cost: the world that remembers first, then the one that forgets.
#[derive(Debug, Default)]
pub struct Walked {
    /// Seconds of each step.
    pub times: [Vec<f64>; 2],
    /// Cells in all.
    pub cells: [u64; 2],
    /// Pairs told, asked about, and known without a search, in all.
    pub reported: usize,
    /// See `reported`.
    pub asked: u32,
    /// See `reported`.
    pub known: u32,
}

/// Steps a scene.
///
/// # Errors
/// The two worlds do not agree, or one refuses the scene.
pub fn walk(scene: &Scene, steps: usize) -> Result<Walked, Box<dyn std::error::Error>> {
    let mut worlds = [world(scene)?, world(scene)?];
    let mut walked = Walked::default();
    for step in 1..=steps {
        let records = scene.records(step);
        worlds[1].forget();
        // Who goes first changes from step to step.
        for k in [step % 2, 1 - step % 2] {
            let from = Instant::now();
            let out = worlds[k].step(&records, &StepOptions::default())?;
            // The first step is cold in both.
            if step > 1 {
                walked.times[k].push(from.elapsed().as_secs_f64());
                walked.cells[k] += out.counters.cells + out.counters.instant_cells;
            }
        }
        let [warm, cold] = worlds.each_ref().map(World::outcome);
        let same = warm
            .pairs
            .iter()
            .map(|p| (p.a, p.b, p.outcome.time()))
            .eq(cold.pairs.iter().map(|p| (p.a, p.b, p.outcome.time())));
        if !same || warm.safe_time != cold.safe_time {
            return Err(format!("{}: step {step} has another answer when all is forgotten", scene.name).into());
        }
        walked.reported += warm.pairs.len();
        walked.asked += warm.searched;
        walked.known += warm.known;
    }
    Ok(walked)
}

/// A peg on its way into its hole.
pub struct Approach {
    /// A word.
    pub name: &'static str,
    /// The peg's motion; the plate stands.
    motion: Motion,
}

/// Straight, so that it slides in without meeting anything; tilted, and tilted and turning, so that it meets the rim.
pub fn approaches() -> [Approach; 3] {
    let of = |name, tilt: DVec3, spin: DVec3| {
        let start = Pose::new(DVec3::new(0.001, 0.002, 2.0), quat_of_rotation_vector(tilt));
        Approach { name, motion: Motion::turning(start, start.position - 1.7 * DVec3::Z, spin) }
    };
    let (tilt, spin) = (DVec3::new(0.05, 0.02, 0.0), DVec3::new(0.03, -0.05, 0.4));
    [of("straight", DVec3::ZERO, DVec3::ZERO), of("tilted", tilt, DVec3::ZERO), of("turning", tilt, spin)]
}

/// What an approach cost.
#[derive(Debug, Default)]
pub struct Approached {
    /// It ended in a contact.
    pub met: bool,
    /// Seconds and cells of each step, up to the contact.
    pub steps: Vec<(f64, f64)>,
    /// The same of the whole way as one question.
    pub query: Vec<(f64, f64)>,
}

/// Goes an approach in so many steps, and as one; `times` over.
///
/// # Errors
/// The two do not agree on whether they meet.
pub fn approach(approach: &Approach, steps: usize, times: usize) -> Result<Approached, Box<dyn std::error::Error>> {
    let mut world = World::new(2, 2);
    for (i, recipe) in plate_and_peg().iter().enumerate() {
        let part = Arc::new(MeasuredModel::new(Arc::new(Model::new(recipe.build()))));
        let spec = ObjectSpec::new(i as u32, &part, if i == 0 { Pose::IDENTITY } else { approach.motion.start });
        world.add_object(ObjectSpec { is_static: i == 0, ..spec })?;
    }
    let n = steps as f64;
    let turn = |to: f64, part: f64| PoseRecord::turn(1, approach.motion.at(to).position, approach.motion.spin * part);
    let start = PoseRecord::start(1, &approach.motion.start);
    let mut reported = Approached::default();
    for _ in 0..times {
        timed(&mut world, start)?;
        reported.met = false;
        for k in 1..=steps {
            let (met, cost) = timed(&mut world, turn(k as f64 / n, 1.0 / n))?;
            reported.steps.push(cost);
            reported.met = met;
            if met {
                break;
            }
        }
        timed(&mut world, start)?;
        world.forget();
        let (met, cost) = timed(&mut world, turn(1.0, 1.0))?;
        reported.query.push(cost);
        if met != reported.met {
            return Err(format!("{}: met in steps: {}, at once: {met}", approach.name, reported.met).into());
        }
    }
    Ok(reported)
}

/// A step of one record: whether it has a contact; its seconds and cells.
fn timed(world: &mut World, record: PoseRecord) -> Result<(bool, (f64, f64)), StepError> {
    let from = Instant::now();
    let out = world.step(&[record], &StepOptions::default())?;
    let took = from.elapsed().as_secs_f64();
    let met = out.pairs.iter().any(|p| p.outcome.status() == Status::Contact);
    Ok((met, (took, (out.counters.cells + out.counters.instant_cells) as f64)))
}
