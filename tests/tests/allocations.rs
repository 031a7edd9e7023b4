//! A step that starts no search allocates nothing: whether pairs are known to be apart, are asked how far, meet or overlap. Nor
//! does what keeps a pair's points from step to step. A program of their own: counting costs the others a twentieth.
#![allow(missing_docs)]

use contactd::contact::Status;
use contactd::ipc::ServerConfig;
use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, StepOutcome, World};
use contactd_client::Object;
use contactd_client::manifold::Manifolds;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Pose, PoseRecord, Report, Rule};
use contactd_tests::scenes::Recipe;
use glam::DVec3;
use std::f64::consts::TAU;
use std::sync::Arc;
use std::time::Duration;

const OBJECTS: u32 = 27;
/// Steps of a round.
const PERIOD: f64 = 120.0;

/// Where an object is after a step: on its way round its place on a grid, turning once a round.
fn pose(spacing: f64, object: u32, step: u32) -> Pose {
    let grid = [object % 3, object / 3 % 3, object / 9].map(f64::from);
    let angle = TAU * f64::from(step) / PERIOD + f64::from(object);
    let at = spacing * DVec3::from(grid) + 0.05 * DVec3::new(angle.cos(), angle.sin(), (2.0 * angle).sin());
    Pose::new(at, quat_of_rotation_vector(DVec3::new(0.6, 0.0, 0.8) * angle))
}

fn part(recipe: &Recipe) -> Arc<MeasuredModel> {
    Arc::new(MeasuredModel::new(Arc::new(Model::new(recipe.build()))))
}

/// Objects on a grid, and what each of 900 steps did: the allocations it made, too. On one thread, which is the one that is
/// measured; a pool of several takes a block of memory for its own queue once in 63 steps.
fn walk(spacing: f64, recipes: &[Recipe], mut each: impl FnMut(u32, &StepOutcome, u64)) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let parts: Vec<Arc<MeasuredModel>> = recipes.iter().map(part).collect();
    let mut world = World::new(64, 64);
    for object in 0..OBJECTS {
        let spec = ObjectSpec::new(object + 1, &parts[object as usize % parts.len()], pose(spacing, object, 0));
        world.add_object(spec).expect("an object");
    }
    for step in 1..=WARM + 300 {
        let records = (0..OBJECTS).map(|o| PoseRecord::end(o + 1, &pose(spacing, o, step)));
        let records: Vec<PoseRecord> = records.collect();
        let mut measured = || {
            allocation_counter::measure(|| {
                world.step(&records, &StepOptions::default()).expect("a step");
            })
        };
        let info = pool.install(&mut measured);
        each(step, world.outcome(), info.count_total);
    }
}

/// In the first rounds lists and the memory of each pair grow to the size that they need.
const WARM: u32 = 600;

#[test]
fn a_warm_step_allocates_nothing() {
    let recipes = [
        Recipe::sphere(0.4),
        Recipe::cuboid(0.3, 0.35, 0.3),
        Recipe::cylinder(0.3, 0.4),
        Recipe::cylinder(0.4, 0.3).minus(Recipe::cylinder(0.2, 0.5)),
    ];
    let (mut warm, mut kept, mut asked) = (0, 0, 0);
    walk(1.3, &recipes, |step, out, allocations| {
        assert!(!out.contact && !out.undecided, "they keep apart");
        if step > WARM && out.known == out.searched {
            warm += 1;
            asked += usize::from(out.searched > 0);
            kept += usize::from(allocations == 0);
        }
    });
    println!("{warm} of 300 steps needed no search, {asked} of them asked about a pair; {kept} allocated nothing");
    assert!(warm > 150 && asked > 20, "the scene says little");
    assert_eq!(kept, warm);
}

#[test]
fn a_warm_step_of_bodies_that_meet_allocates_nothing() {
    let recipes = [Recipe::sphere(0.4), Recipe::cuboid(0.3, 0.35, 0.3), Recipe::cylinder(0.3, 0.4)];
    let (mut warm, mut kept, mut contacts, mut overlaps) = (0, 0, 0, 0);
    walk(0.75, &recipes, |step, out, allocations| {
        let reported = |status: Status| out.pairs.iter().filter(|p| p.outcome.status() == status).count();
        if step > WARM && out.counters.after_stage1 == 0 {
            warm += 1;
            contacts += reported(Status::Contact);
            overlaps += reported(Status::Overlap);
            kept += usize::from(allocations == 0);
        }
    });
    println!(
        "{warm} of 300 steps started no search: {contacts} contacts, {overlaps} overlaps; {kept} allocated nothing"
    );
    assert!(warm > 150 && contacts > 100 && overlaps > 1000, "the scene says little");
    assert_eq!(kept, warm);
}

/// A cylinder that turns over the hole of a plate, within the margin at which its points are told.
#[test]
fn an_update_of_points_that_is_warm_allocates_nothing() {
    let mut session = contactd::embedded(&ServerConfig::default()).expect("a session");
    let plate =
        "difference() { cube(size = [8, 8, 2], center = true); cylinder(h = 4, r1 = 0.25, r2 = 0.25, center = true); }";
    let cylinder = "cylinder(h = 2, r1 = 0.5, r2 = 0.5, center = true);";
    let [plate, body] = [plate, cylinder].map(|text| session.load_model("part.csg", text).expect("a model").id);
    let below = Pose::at(DVec3::NEG_Z);
    session.add_object(Object::new("plate", plate).fixed().at(below)).expect("an object");
    let body = session.add_object(Object::new("body", body).at(Pose::at(DVec3::Z * 9.0))).expect("an object");
    let mut rule = Rule::new(["default".into(), "default".into()]);
    (rule.report, rule.margin, rule.penetration) = (Report::Patch, 4e-3, true);
    session.set_rules(&[rule]).expect("a rule");
    session.options.details = true;
    let mut manifolds = Manifolds::default();
    for k in 0..40 {
        let turn = quat_of_rotation_vector(DVec3::Z * (0.1 * f64::from(k)));
        let pose = Pose::new(DVec3::new(0.01 * f64::from(k % 7), 0.0, 1.0 + 1e-3), turn);
        session.begin_step(1).expect("a batch")[0] = PoseRecord::start(body, &pose);
        let reply = session.finish(Duration::from_secs(60)).expect("a step");
        let of = |object: u32, _: f64| if object == body { pose } else { below };
        let made = allocation_counter::measure(|| manifolds.update(&reply, of)).count_total;
        assert!(k < 20 || made == 0, "step {k}: {made} allocations");
        assert_eq!(manifolds.pairs().next().expect("a pair").points.len(), 4);
    }
}
