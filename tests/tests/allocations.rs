//! A step that needs no search allocates nothing, and neither does one that asks two convex bodies how far apart they are.
#![allow(missing_docs)]

use contactd::eco::Model;
use contactd::world::{ObjectSpec, Part, StepOptions, World};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Pose, PoseRecord};
use contactd_tests::scenes::Recipe;
use glam::DVec3;
use std::f64::consts::TAU;
use std::sync::Arc;

const OBJECTS: u32 = 27;
/// Steps of a round.
const PERIOD: f64 = 120.0;

/// Where an object is after a step: on its way round its place on a grid, turning once a round.
fn pose(object: u32, step: u32) -> Pose {
    let grid = [object % 3, object / 3 % 3, object / 9].map(f64::from);
    let angle = TAU * f64::from(step) / PERIOD + f64::from(object);
    let at = 1.3 * DVec3::from(grid) + 0.05 * DVec3::new(angle.cos(), angle.sin(), (2.0 * angle).sin());
    Pose::new(at, quat_of_rotation_vector(DVec3::new(0.6, 0.0, 0.8) * angle))
}

#[test]
fn a_warm_step_allocates_nothing() {
    let part = |recipe: Recipe| Arc::new(Part::new(Arc::new(Model::new(recipe.build()))));
    let parts = [
        part(Recipe::sphere(0.4)),
        part(Recipe::cuboid(0.3, 0.35, 0.3)),
        part(Recipe::cylinder(0.3, 0.4)),
        part(Recipe::cylinder(0.4, 0.3).minus(Recipe::cylinder(0.2, 0.5))),
    ];
    let mut world = World::new(64, 64);
    for object in 0..OBJECTS {
        let spec = ObjectSpec::new(object + 1, &parts[object as usize % parts.len()], pose(object, 0));
        world.add_object(spec).expect("an object");
    }
    let (mut warm, mut kept, mut asked) = (0, 0, 0);
    for step in 1..=600 {
        let records: Vec<PoseRecord> = (0..OBJECTS).map(|o| PoseRecord::end(o + 1, &pose(o, step))).collect();
        let info = allocation_counter::measure(|| {
            world.step(&records, &StepOptions::default()).expect("a step");
        });
        let out = world.outcome();
        assert!(!out.contact && !out.undecided, "they keep apart");
        // In the first rounds lists and the memory of each pair grow to the size that they need.
        if step > 300 && out.known == out.searched {
            warm += 1;
            asked += usize::from(out.searched > 0);
            kept += usize::from(info.count_total == 0);
        }
    }
    println!("{warm} of 300 steps needed no search, {asked} of them asked about a pair; {kept} allocated nothing");
    assert!(warm > 150 && asked > 20, "the scene says little");
    assert_eq!(kept, warm);
}
