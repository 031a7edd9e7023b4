//! Where bodies stand after a step, to the bit, against a judge that works it out one body at a time; and batches that are refused,
//! with the record that is named and the code, after which nothing has changed.
//!
//! Worlds of bodies come, go, are restored and forget; batches name them in any order, with starts, ends and turns, and have
//! faults of every kind at random places. The judge shares the elementary functions of `contactd_proto` (rotation vectors) and
//! nothing else. For a long run:
//! `CONTACTD_BODY_STEPS=1000000 cargo test --release -p contactd-tests --test steps bodies:: -- --nocapture`

use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, StepError, StepOptions, World};
use contactd_proto::motion::{quat_of_rotation_vector, rotation_vector};
use contactd_proto::{ErrorCode, Motion, MotionState, Pose, PoseRecord};
use contactd_tests::random_solids::Random;
use contactd_tests::stepped::block;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Steps of a world.
const STEPS: usize = 30;
/// Most records of a batch.
const BATCH: usize = 48;
/// The flags of a record, as the protocol has them.
const END: u32 = 1;
const TURN: u32 = 2;
const START: u32 = 4;

fn bits(state: &MotionState) -> Vec<u64> {
    let Motion { start, velocity, spin } = state.motion;
    let poses = [start, state.end].map(|p| (p.position.to_array(), p.rotation.to_array()));
    let numbers = poses.iter().flat_map(|(p, q)| p.iter().chain(q)).copied();
    numbers.chain(velocity.to_array()).chain(spin.to_array()).map(f64::to_bits).collect()
}

/// What a record asks for.
#[derive(Clone, Copy)]
enum Asked {
    Start(Pose),
    End(Pose),
    Turn(DVec3, DVec3),
}

/// A body, as the judge has it.
#[derive(Clone)]
struct Judged {
    state: MotionState,
    is_static: bool,
    rotates: bool,
    max_speed: f64,
    reach: f64,
}

impl Judged {
    /// Where it stands once a part of its last motion is taken.
    fn at(&self, part: f64) -> Pose {
        let Motion { start, velocity, spin } = self.state.motion;
        match part == 1.0 {
            true => self.state.end,
            false => Pose { position: start.position + velocity * part, rotation: turned(start.rotation, spin * part) },
        }
    }

    fn rests(&self) -> bool {
        let numbers = bits(&self.state);
        let stands = self.state.motion.velocity == DVec3::ZERO && self.state.motion.spin == DVec3::ZERO;
        stands && numbers[..7] == numbers[7..14]
    }

    fn breaks_what_it_declared(&self, motion: &Motion, dt: f64) -> bool {
        let turns = motion.spin != DVec3::ZERO;
        let rim = if turns { motion.spin.length() * self.reach } else { 0.0 };
        let is_fast =
            self.max_speed < f64::INFINITY && (dt == 0.0 || motion.velocity.length() + rim > self.max_speed * dt);
        is_fast || (turns && !self.rotates)
    }
}

fn turned(rotation: DQuat, by: DVec3) -> DQuat {
    if by == DVec3::ZERO { rotation } else { (quat_of_rotation_vector(by) * rotation).normalize() }
}

/// A body's motion of a step, from where it starts.
fn motion_of(start: Pose, asked: Asked) -> MotionState {
    match asked {
        Asked::Start(pose) => {
            MotionState { motion: Motion { start: pose, velocity: DVec3::ZERO, spin: DVec3::ZERO }, end: pose }
        }
        Asked::End(end) => {
            let between = end.rotation * start.rotation.conjugate();
            let spin = if end.rotation == start.rotation { DVec3::ZERO } else { rotation_vector(between) };
            MotionState { motion: Motion { start, velocity: end.position - start.position, spin }, end }
        }
        Asked::Turn(position, spin) => MotionState {
            motion: Motion { start, velocity: position - start.position, spin },
            end: Pose { position, rotation: turned(start.rotation, spin) },
        },
    }
}

/// A record, read as docs/protocol.md has it.
fn read(record: &PoseRecord) -> Result<Asked, ErrorCode> {
    let [x, y, z] = record.position;
    let farthest = 1e150f64;
    // False for what is no number.
    let is_within = x * x + y * y + z * z <= farthest * farthest;
    if !is_within || record.rotation.iter().any(|c| !c.is_finite()) {
        return Err(ErrorCode::NotFinite);
    }
    let position = DVec3::new(x, y, z);
    let [a, b, c, d] = record.rotation;
    if record.flags == TURN {
        return match (a * a + b * b + c * c).is_finite() {
            false => Err(ErrorCode::NotFinite),
            true if d != 0.0 => Err(ErrorCode::BadCount),
            true => Ok(Asked::Turn(position, DVec3::new(a, b, c))),
        };
    }
    if record.flags != END && record.flags != START {
        return Err(ErrorCode::BadCount);
    }
    let off = |q: [f64; 4]| (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0).abs();
    let mut q = record.rotation;
    if off(q) > 1e-3 {
        return Err(ErrorCode::BadQuaternion);
    }
    // Normalised until it is unit, twice at most.
    for _ in 0..2 {
        if off(q) > 6.0 * f64::EPSILON {
            q = DQuat::from_array(q).normalize().to_array();
        }
    }
    let pose = Pose { position, rotation: DQuat::from_array(q) };
    Ok(if record.flags == END { Asked::End(pose) } else { Asked::Start(pose) })
}

/// Takes a batch whole or not at all; tells what is wrong with it.
fn take(bodies: &mut BTreeMap<u32, Judged>, records: &[PoseRecord], advance: f64, dt: f64) -> Result<(), StepError> {
    let of_batch = |code| Err(StepError { code, index: None });
    if records.len() > BATCH {
        return of_batch(ErrorCode::TooMany);
    }
    let is_sound = (0.0..=1.0).contains(&advance) && (0.0..f64::INFINITY).contains(&dt);
    if !is_sound {
        return of_batch(ErrorCode::BadNumber);
    }
    let (mut starts, mut motions) = (BTreeMap::new(), BTreeMap::new());
    for (index, record) in (0..).zip(records) {
        let refuse = |code| Err(StepError { code, index: Some(index) });
        let Some(body) = bodies.get(&record.object) else { return refuse(ErrorCode::UnknownObject) };
        let asked = match read(record) {
            Ok(asked) => asked,
            Err(code) => return refuse(code),
        };
        if body.is_static {
            return refuse(ErrorCode::StaticObject);
        }
        let list = if matches!(asked, Asked::Start(_)) { &mut starts } else { &mut motions };
        if list.insert(record.object, (index, asked)).is_some() {
            return refuse(ErrorCode::DuplicateObject);
        }
    }
    let start_of = |id: u32, body: &Judged| match starts.get(&id) {
        Some((_, Asked::Start(pose))) => *pose,
        _ => body.at(advance),
    };
    let mut in_order: Vec<_> = motions.iter().map(|(id, (index, asked))| (*index, *id, *asked)).collect();
    in_order.sort_by_key(|(index, ..)| *index);
    for (index, id, asked) in in_order {
        let body = &bodies[&id];
        let motion = motion_of(start_of(id, body), asked).motion;
        let code = if !motion.velocity.length_squared().is_finite() {
            ErrorCode::NotFinite
        } else if body.breaks_what_it_declared(&motion, dt) {
            ErrorCode::Declaration
        } else {
            continue;
        };
        return Err(StepError { code, index: Some(index) });
    }
    for (id, body) in bodies {
        body.state = match (motions.get(id), starts.get(id)) {
            (Some((_, asked)), _) => motion_of(start_of(*id, body), *asked),
            (None, Some((_, asked))) => motion_of(Pose::IDENTITY, *asked),
            (None, None) if body.rests() => continue,
            (None, None) => motion_of(Pose::IDENTITY, Asked::Start(body.at(advance))),
        };
    }
    Ok(())
}

/// A world, its bodies as the judge has them, and what is drawn.
struct Game {
    rng: Random,
    part: Arc<MeasuredModel>,
    world: World,
    specs: BTreeMap<u32, ObjectSpec>,
    judged: BTreeMap<u32, Judged>,
    last_id: u32,
    /// Steps whose answers were compared, and how many were accepted, and refused by code.
    compared: usize,
    seen: BTreeMap<&'static str, usize>,
}

impl Game {
    fn new(seed: u64) -> Self {
        let mut rng = Random::new(seed);
        let part = Arc::new(MeasuredModel::new(Arc::new(Model::new(block(&mut rng).build()))));
        let (specs, judged, seen) = Default::default();
        let world = World::new(1000, BATCH);
        let mut game = Self { rng, part, world, specs, judged, last_id: 0, compared: 0, seen };
        for _ in 0..1 + game.rng.below(30) {
            game.add();
        }
        game
    }

    fn quaternion(&mut self) -> DQuat {
        match self.rng.below(4) {
            0 => DQuat::IDENTITY,
            _ => quat_of_rotation_vector(self.rng.vector(2.0)),
        }
    }

    fn pose(&mut self) -> Pose {
        Pose::new(self.rng.vector(4.0), self.quaternion())
    }

    fn add(&mut self) {
        self.last_id += 1 + self.rng.below(3) as u32;
        let pose = self.pose();
        let mut spec = ObjectSpec::new(self.last_id, &self.part, pose);
        match self.rng.below(12) {
            0 => spec.is_static = true,
            1 => spec.rotates = false,
            2 => spec.max_speed = self.rng.within(5.0, 60.0),
            _ => {}
        }
        self.world.add_object(spec.clone()).expect("an object");
        let body = self.world.body(spec.id).expect("the body");
        let (is_static, rotates, max_speed) = (spec.is_static, spec.rotates, spec.max_speed);
        let judged = Judged { state: body.motion_state, is_static, rotates, max_speed, reach: body.reach() };
        assert_eq!(judged.state.end.position, spec.pose.position);
        self.judged.insert(spec.id, judged);
        self.specs.insert(spec.id, spec);
    }

    /// Something else than a step happens.
    fn between(&mut self) {
        match self.rng.below(24) {
            0 => self.add(),
            1 => {
                let ids: Vec<u32> = self.judged.keys().copied().collect();
                if let Some(id) = ids.get(self.rng.below(ids.len().max(1))) {
                    self.world.remove_object(*id).expect("a body");
                    self.judged.remove(id);
                    self.specs.remove(id);
                }
            }
            2 => self.world.forget(),
            3 => self.world.renew(),
            4 => self.restore(),
            _ => {}
        }
    }

    fn restore(&mut self) {
        let mut states = Vec::new();
        for (id, body) in &mut self.judged {
            if body.is_static || self.rng.below(3) > 0 {
                continue;
            }
            // A track may lead anywhere: a server believes its client.
            let far = [1.0, 1.0, 1.0, 1e151, 1e200][self.rng.below(5)];
            let start = Pose::new(self.rng.vector(4.0), DQuat::IDENTITY);
            let motion = Motion { start, velocity: self.rng.vector(far), spin: self.rng.vector(1.0) };
            let end = Pose::new(self.rng.vector(4.0), DQuat::IDENTITY);
            body.state = MotionState { motion, end };
            states.push((*id, body.state));
        }
        self.world.restore(&states).expect("tracks");
    }

    /// The records of a sound batch.
    fn batch(&mut self) -> Vec<PoseRecord> {
        let mut ids: Vec<u32> = self.judged.iter().filter(|(_, b)| !b.is_static).map(|(id, _)| *id).collect();
        let (share, starts) = ([1, 1, 2, 4][self.rng.below(4)], self.rng.below(3));
        ids.retain(|_| self.rng.below(share) == 0);
        let only_ends = self.rng.below(3) == 0;
        let mut records = Vec::new();
        for id in ids {
            let body = self.judged[&id].clone();
            if starts == 0 && self.rng.below(2) == 0 {
                let pose = if self.rng.below(2) == 0 { body.state.end } else { self.pose() };
                records.push(PoseRecord::start(id, &pose));
                if self.rng.below(4) == 0 {
                    continue;
                }
            }
            let mut pose = self.pose();
            match self.rng.below(6) {
                // Where it stands; or there but for its way; or not turned.
                0 => pose = body.state.end,
                1 => pose.position = body.state.end.position,
                2 => pose = Pose::new(body.state.end.position + self.rng.vector(0.2), body.state.end.rotation),
                3 if !body.rotates => pose.rotation = body.state.end.rotation,
                4 => pose.rotation *= 1.0 + self.rng.within(-4e-4, 4e-4),
                _ => {}
            }
            let turns = !only_ends && self.rng.below(4) == 0;
            let by = if self.rng.below(4) == 0 { DVec3::ZERO } else { self.rng.vector(5.0) };
            records.push(if turns { PoseRecord::turn(id, pose.position, by) } else { PoseRecord::end(id, &pose) });
        }
        if self.rng.below(3) == 0 {
            for i in (1..records.len()).rev() {
                records.swap(i, self.rng.below(i + 1));
            }
        }
        records.truncate(BATCH);
        records
    }

    /// Puts a fault into a batch, of any kind and at any place.
    fn spoil(&mut self, records: &mut Vec<PoseRecord>) {
        let place = self.rng.below(records.len() + 1);
        let id = self.judged.keys().copied().nth(self.rng.below(self.judged.len().max(1))).unwrap_or(9);
        let sound = PoseRecord::end(id, &self.pose());
        let bad = [f64::NAN, f64::INFINITY, -1e300, 1.1e150][self.rng.below(4)];
        let axis = self.rng.below(3);
        let mut new = records.get(self.rng.below(records.len().max(1))).copied().unwrap_or(sound);
        match self.rng.below(10) {
            0 => new = PoseRecord { object: [0, 777_777, u32::MAX][axis], ..sound },
            1 => new.position[axis] = bad,
            2 => new.rotation[axis] = bad,
            3 => new.rotation = new.rotation.map(|c| c * (1.0 + self.rng.within(6e-4, 1e-2))),
            4 => new.flags = [0, 3, 5][axis],
            5 => new = PoseRecord { rotation: [0.1, 0.2, 0.3, 0.5], flags: TURN, ..sound },
            6 => new = PoseRecord { rotation: [1e200, 0.0, 0.0, 0.0], flags: TURN, ..sound },
            7 => new = sound,
            8 => new = PoseRecord { flags: START, ..sound },
            _ => {}
        }
        match self.rng.below(12) {
            0 => {
                *records =
                    records.iter().cycle().take(if records.is_empty() { 0 } else { BATCH + 1 }).copied().collect()
            }
            1 | 2 if place < records.len() => records[place] = new,
            _ => records.insert(place, new),
        }
    }

    /// One step, compared with the judge's; and its answer with that of a world that never saw a step.
    fn step(&mut self, compared: bool) {
        self.between();
        let mut records = self.batch();
        for _ in 0..[0, 0, 0, 1, 1, 2][self.rng.below(6)] {
            self.spoil(&mut records);
        }
        let (mut advance, mut dt) = ([1.0, 1.0, 0.5, 0.0, self.rng.within(0.0, 1.0)][self.rng.below(5)], 1.0);
        match self.rng.below(40) {
            0 => advance = [-0.1, 1.1, f64::NAN][self.rng.below(3)],
            1 => dt = [-1.0, f64::INFINITY, f64::NAN][self.rng.below(3)],
            2 => dt = 0.0,
            3 => dt = 0.01,
            _ => {}
        }
        let options = StepOptions { advance, dt, ..StepOptions::default() };
        let before: Vec<(u32, MotionState)> = self.judged.iter().map(|(id, body)| (*id, body.state)).collect();
        let expected = take(&mut self.judged, &records, advance, dt);
        let told = self.world.step(&records, &options).map(answer);
        assert_eq!(told.as_ref().err(), expected.as_ref().err(), "{records:?} {options:?}");
        *self.seen.entry(expected.err().map_or("accepted", |e| e.code.sentence())).or_default() += 1;
        let stand: BTreeSet<u32> = self.world.bodies().iter().map(|body| body.id).collect();
        assert!(stand.iter().eq(self.judged.keys()));
        for body in self.world.bodies() {
            let judged = &self.judged[&body.id].state;
            assert_eq!(bits(&body.motion_state), bits(judged), "object {}: {records:?} {options:?}", body.id);
        }
        // What an astray track has led beyond all records cannot be told to another world.
        let is_near = |p: &Pose| p.position.length() <= 1e150;
        let is_told = before.iter().all(|(_, state)| is_near(&state.motion.start) && is_near(&state.end));
        if let (Ok(told), true) = (told, compared && is_told) {
            self.compared += 1;
            let mut cold = World::new(1000, BATCH);
            self.specs.values().for_each(|spec| cold.add_object(spec.clone()).expect("an object"));
            cold.restore(&before).expect("tracks");
            assert_eq!(told, answer(cold.step(&records, &options).expect("a step")));
        }
    }
}

/// What is told of pairs: ids, status and time.
fn answer(out: &contactd::world::StepOutcome) -> Vec<(u32, u32, String, u64)> {
    let pairs = out.pairs.iter();
    pairs.map(|p| (p.a, p.b, format!("{:?}", p.outcome.status()), p.outcome.time().to_bits())).collect()
}

#[test]
fn bodies_stand_where_one_after_the_other_would_and_refused_batches_move_none() {
    let games = sized("CONTACTD_BODY_STEPS", 1_500usize).div_ceil(STEPS) as u64;
    let play = |seed| {
        let mut game = Game::new(seed);
        (0..STEPS).for_each(|k| game.step(k % 5 == 4));
        game.seen.insert("compared", game.compared);
        game.seen
    };
    let seen = (0..games).into_par_iter().map(play).reduce(BTreeMap::new, |mut all, one| {
        one.into_iter().for_each(|(code, n)| *all.entry(code).or_default() += n);
        all
    });
    println!("{} steps: {seen:?}", games * STEPS as u64);
    let codes = [
        ErrorCode::TooMany,
        ErrorCode::BadNumber,
        ErrorCode::UnknownObject,
        ErrorCode::NotFinite,
        ErrorCode::BadQuaternion,
        ErrorCode::BadCount,
        ErrorCode::StaticObject,
        ErrorCode::DuplicateObject,
        ErrorCode::Declaration,
    ];
    for code in codes.map(|code| code.sentence()).into_iter().chain(["accepted", "compared"]) {
        assert!(seen.get(code).is_some_and(|n| *n >= 4), "{code}: too few to say anything: {seen:?}");
    }
}
