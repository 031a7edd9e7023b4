//! Batches of records to a small world: a refused batch changes nothing, an accepted one has an answer in order.

use super::{Reader, Target, sound};
use crate::scenes::Recipe;
use contactd::contact::Status;
use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, World};
use contactd_proto::pose_record::{END, START, TURN};
use contactd_proto::{MotionState, Pose, PoseRecord, Rule};
use glam::DVec3;
use std::cell::RefCell;
use std::sync::Arc;

pub(super) const TARGET: Target =
    Target { name: "steps", run, seeds, words: &[], longest: 400, thorough_every: u64::MAX };

/// Cells a pair may cost: answers beyond are undecided, which is an answer, too.
const CELLS: u64 = 60;

fn seeds() -> Vec<Vec<u8>> {
    vec![vec![], (0..=255).collect(), (0..120).map(|i| (i * 37 % 256) as u8).collect()]
}

thread_local! {
    /// Parts are built once: an input is worth microseconds.
    static PARTS: RefCell<Option<[Arc<MeasuredModel>; 3]>> = const { RefCell::new(None) };
}

fn parts() -> [Arc<MeasuredModel>; 3] {
    let build = |recipe: Recipe| Arc::new(MeasuredModel::new(Arc::new(Model::new(recipe.build()))));
    PARTS.with_borrow_mut(|parts| {
        let plate = Recipe::cuboid(1.0, 1.0, 0.25).minus(Recipe::cylinder(0.5, 1.0));
        parts
            .get_or_insert_with(|| [build(plate), build(Recipe::sphere(0.5)), build(Recipe::cuboid(0.5, 0.5, 0.5))])
            .clone()
    })
}

/// A static plate with a hole (1), a ball (3), a cube that may not turn (4), a ball of limited speed (9).
fn world() -> World {
    let [plate, ball, cube] = parts();
    let mut world = World::new(8, 6);
    let mut add = |id, part: &Arc<MeasuredModel>, at: DVec3, is_static, rotates, max_speed| {
        let spec = ObjectSpec { is_static, rotates, max_speed, ..ObjectSpec::new(id, part, Pose::at(at)) };
        world.add_object(spec).expect("an object of the world");
    };
    add(1, &plate, DVec3::ZERO, true, true, f64::INFINITY);
    add(3, &ball, DVec3::Z, false, true, f64::INFINITY);
    add(4, &cube, DVec3::new(2.0, 0.0, 1.0), false, false, f64::INFINITY);
    add(9, &ball, DVec3::new(-2.0, 0.0, 1.0), false, true, 8.0);
    world
}

fn record(r: &mut Reader) -> PoseRecord {
    let object = if r.below(24) == 1 { r.one_of(&[1, 0, u32::MAX]) } else { r.one_of(&[3, 4, 9]) };
    let flags = if r.below(32) == 1 { r.one_of(&[END | START, 0, 8]) } else { r.one_of(&[END, TURN, START]) };
    let wild = r.below(16) == 1;
    if wild {
        return PoseRecord {
            object,
            flags,
            position: std::array::from_fn(|_| r.number()),
            rotation: std::array::from_fn(|_| r.number()),
        };
    }
    let position = match r.below(4) {
        0 => r.rough_vector() * 2.0,
        1 => r.round_vector() * r.one_of(&[1e-39, 1e-15, 1e3, 1e12]),
        _ => r.round_vector(),
    };
    let turn = r.turn();
    match flags {
        TURN => PoseRecord::turn(object, position, turn),
        _ => {
            let pose = Pose::new(position, contactd_proto::motion::quat_of_rotation_vector(turn));
            PoseRecord { flags, ..PoseRecord::end(object, &pose) }
        }
    }
}

fn run(bytes: &[u8], _: bool) -> Result<String, String> {
    let mut r = Reader::new(bytes);
    let mut world = world();
    let mut word = String::new();
    for _ in 0..3 {
        if r.below(6) == 1 {
            let margin = r.number();
            let rule = Rule { margin, ..Rule::new(["default".into(), "default".into()]) };
            word += &format!("rules {:?} ", world.set_rules(vec![rule]).err().map(|e| e.code));
        }
        let options = StepOptions {
            advance: if r.below(12) == 1 { r.number() } else { r.one_of(&[1.0, 0.5, 0.0, 0.3]) },
            dt: if r.below(12) == 1 { r.number() } else { r.one_of(&[1.0, 0.0, 0.01]) },
            first: r.below(2) == 1,
            clear: r.below(2) == 1,
            max_records: r.below(4) as u32,
            max_patch_slots: 0,
            cell_limit: CELLS,
            batch_limit: 0,
        };
        let count = r.one_of(&[1, 2, 3, 2, 1, 3, 4, 5, 7, 0]);
        let records: Vec<PoseRecord> = (0..count).map(|_| record(&mut r)).collect();
        word += &taken(&mut world, &records, &options)?;
        if r.is_done() {
            break;
        }
    }
    Ok(word)
}

fn taken(world: &mut World, records: &[PoseRecord], options: &StepOptions) -> Result<String, String> {
    let motion_states = |w: &World| w.bodies().iter().map(|b| b.motion_state).collect::<Vec<MotionState>>();
    let before = motion_states(world);
    let out = match world.step(records, options) {
        Ok(out) => out.clone(),
        Err(e) => {
            if motion_states(world) != before {
                return Err(format!("refused ({e}), and yet the world changed"));
            }
            if e.index.is_some_and(|i| i as usize >= records.len()) {
                return Err(format!("{e}, of {} records", records.len()));
            }
            return Ok(format!("{:?} ", e.code));
        }
    };
    let fine = |p: &Pose| p.position.is_finite() && (p.rotation.length() - 1.0).abs() < 1e-9;
    for body in world.bodies() {
        if !(fine(&body.motion_state.end) && fine(&body.motion_state.motion.start)) {
            return Err(format!("object {} stands at {:?}", body.id, body.motion_state));
        }
    }
    let mut earliest = f64::INFINITY;
    for pair in &out.pairs {
        sound(&pair.outcome).map_err(|e| format!("objects {} and {}: {e}", pair.a, pair.b))?;
        if pair.a >= pair.b {
            return Err(format!("objects {} and {} in this order", pair.a, pair.b));
        }
        earliest = earliest.min(pair.outcome.time_lower());
    }
    let key = |p: &contactd::world::PairOutcome| (p.outcome.time(), p.a, p.b);
    if !out.pairs.is_sorted_by(|p, q| key(p) < key(q)) {
        return Err("pairs out of order".into());
    }
    if !(0.0..=1.0).contains(&out.safe_time) || out.safe_time > earliest {
        return Err(format!("safe until {}, and yet a pair's bracket begins at {earliest}", out.safe_time));
    }
    let count = |s: Status| out.pairs.iter().filter(|p| p.outcome.status() == s).count().min(2);
    let counts = [Status::Contact, Status::Clear, Status::Overlap, Status::Undecided].map(count);
    Ok(format!("{counts:?}{}{} ", out.truncated, out.may_have_passed.min(1)))
}
