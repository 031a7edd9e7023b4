//! Stepped scenes, drawn: what happens to the objects of a session, step after step.
//!
//! The generator knows bodies, motions, rules and options as a caller has them, and nothing of how they are answered: bodies
//! fall, slide, turn, rest, tremble, are set back and put elsewhere, come and go, the rules change, and what is asked of a step.
//! One seed, one play; the only thing it is told is how much of the last step was free, as a loop would take it.

use crate::random_solids::{Random, shape_of_any_kind};
use crate::scenes::{self, Recipe};
use contactd::solid::Op;
use contactd::solid::primitive::HalfSpace;
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, World};
use contactd_proto::{Detect, InitialOverlap, Motion, MotionState, Pose, PoseRecord, Report, Rule};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// An object as it is to be added: the same for any number of worlds.
#[derive(Clone, Debug)]
pub struct Thing {
    /// Its id.
    pub id: u32,
    /// Index of its model in the play's recipes.
    pub model: usize,
    /// Its group.
    pub group: &'static str,
    /// It never moves.
    pub is_static: bool,
    /// The model in the object's frame.
    pub place: Pose,
    /// Where it first stands.
    pub pose: Pose,
}

impl Thing {
    /// What a world is given, with the parts of the play's models.
    pub fn spec(&self, parts: &[Arc<MeasuredModel>]) -> ObjectSpec {
        ObjectSpec {
            is_static: self.is_static,
            group: self.group.into(),
            place: self.place,
            ..ObjectSpec::new(self.id, &parts[self.model], self.pose)
        }
    }
}

/// What changes between two steps.
#[derive(Clone, Debug)]
pub enum Change {
    /// An object comes.
    Add(Thing),
    /// One goes.
    Remove(u32),
    /// Other rules.
    Rules(Vec<Rule>),
    /// Another resolution.
    Resolution(Option<f64>),
}

/// One step: what changes before it, its records and options.
#[derive(Clone, Debug)]
pub struct Act {
    /// What changes before.
    pub changes: Vec<Change>,
    /// The records.
    pub records: Vec<PoseRecord>,
    /// The options.
    pub options: StepOptions,
}

/// How a body goes on.
#[derive(Clone, Copy, Debug)]
enum Manner {
    /// Not named, or named where it is.
    Rests,
    /// At an even pace, pulled aside by `pull` a step.
    Goes { velocity: DVec3, spin: DVec3, pull: DVec3, jitter: f64 },
    /// To and fro between two poses.
    Swings { ends: [Pose; 2] },
    /// Around where it is.
    Trembles { by: f64 },
}

#[derive(Clone, Debug)]
struct Actor {
    thing: Thing,
    manner: Manner,
    /// Where it stands, as the play believes; taken anew from the worlds by `follow`.
    pose: Pose,
    /// Where it was put last.
    home: Pose,
}

/// A play in progress.
pub struct Play {
    rng: Random,
    /// The models that things are of.
    pub recipes: Vec<Recipe>,
    actors: Vec<Actor>,
    next_id: u32,
    options: StepOptions,
    /// Bodies stop where they meet.
    stops: bool,
    /// Side of the grid on which poses lie; 0: anywhere.
    grid: f64,
    /// Half the width of the stage.
    stage: f64,
    /// How often something is changed, put elsewhere, redrawn.
    unrest: f64,
    /// Bodies come together, and what has met stays as it is or presses on.
    settles: bool,
    begun: bool,
}

fn many(rng: &mut Random, most: usize) -> usize {
    // As many small numbers as large ones, by their logarithm.
    ((most as f64).powf(rng.within(0.0, 1.0)) as usize).clamp(1, most)
}

/// A plate with holes in rows.
pub fn plate(rng: &mut Random) -> Recipe {
    let n = 2 + rng.below(3);
    let side = rng.within(0.4, 0.7);
    let half = side * n as f64 * 0.5;
    let thick = rng.within(0.08, 0.3);
    let mut all = vec![Recipe::cuboid(half, half, thick)];
    for i in 0..n * n {
        let at = |k: usize| (k as f64 + 0.5) * side - half;
        let hole = match rng.below(4) {
            0 => Recipe::cuboid(0.25 * side, 0.2 * side, 1.0),
            1 => Recipe::cone(0.1 * side, 0.4 * side, thick * 1.5),
            _ => Recipe::cylinder(rng.within(0.1, 0.4) * side, 1.0),
        };
        all.push(hole.at(at(i % n), at(i / n), 0.0));
    }
    Recipe::Op(Op::Difference, all)
}

/// A box, an L, a prism: what has flat faces along its axes.
pub fn block(rng: &mut Random) -> Recipe {
    let mut s = || rng.within(0.1, 0.5);
    let (x, y, z) = (s(), s(), s());
    let bar = Recipe::cuboid(x, 0.3 * y, 0.3 * z);
    match rng.below(5) {
        0 => Recipe::cuboid(x, y, z),
        1 => bar.union(Recipe::cuboid(0.3 * x, 0.3 * y, z).at(0.7 * x, 0.0, z)),
        2 => Recipe::cuboid(x, y, z).union(Recipe::sphere(0.5 * (x + z))),
        3 => Recipe::cuboid(x, x, x).minus(Recipe::cuboid(0.6 * x, 0.6 * x, 1.0)),
        _ => Recipe::platonic([4, 6, 8, 12, 20][rng.below(5)], x),
    }
}

fn recipe(rng: &mut Random, crowd: bool) -> Recipe {
    let most = if crowd { 3 } else { 60 };
    match rng.below(if crowd { 4 } else { 7 }) {
        0 => scenes::primitive(rng, 0.6),
        1 => block(rng),
        2 => {
            let x = rng.within(0.15, 0.5);
            Recipe::cuboid(x, x * rng.within(0.5, 1.0), rng.within(0.15, 0.5))
        }
        3 | 4 => {
            let leaves = many(rng, most);
            scenes::tree(rng, leaves)
        }
        5 => scenes::any(rng).a,
        _ => plate(rng),
    }
}

/// One primitive of any kind, or a few in one tree.
fn of_any_kind(rng: &mut Random, _: bool) -> Recipe {
    let mut one = |size: f64| Recipe::of(shape_of_any_kind(rng, size));
    let (whole, other, small) = (one(0.5), one(0.4), one(0.3));
    let aside = |rng: &mut Random, recipe: Recipe| recipe.moved(&Pose::new(rng.vector(0.35), rng.rotation()));
    match rng.below(10) {
        0 | 1 => whole.minus(aside(rng, small)),
        2 => whole.union(aside(rng, other)),
        3 => whole.union(aside(rng, other)).minus(aside(rng, small)),
        4 => plate(rng).minus(aside(rng, other)),
        _ => whole,
    }
}

impl Play {
    /// The play of a seed.
    pub fn new(seed: u64) -> Self {
        Self::drawn(seed, recipe)
    }

    /// The same with primitives of all kinds, and small trees of them.
    pub fn of_all_kinds(seed: u64) -> Self {
        Self::drawn(seed, of_any_kind)
    }

    fn drawn(seed: u64, recipe: fn(&mut Random, bool) -> Recipe) -> Self {
        let mut rng = Random::new(seed);
        let count = if rng.chance(0.85) { 2 + many(&mut rng, 6) - 1 } else { many(&mut rng, 100).max(8) };
        let crowd = count > 8;
        let grid = if rng.chance(0.2) { 0.125 } else { 0.0 };
        let models = if crowd { 1 + rng.below(4) } else { count };
        let mut recipes: Vec<Recipe> = (0..models).map(|_| recipe(&mut rng, crowd)).collect();
        if rng.chance(0.1) {
            recipes.push(Recipe::of(HalfSpace));
        }
        let stage = (count as f64).cbrt() * rng.within(0.4, 1.2);
        let mut play = Self {
            rng,
            recipes,
            actors: Vec::new(),
            next_id: 1,
            options: StepOptions::default(),
            stops: false,
            grid,
            stage,
            unrest: 0.0,
            settles: false,
            begun: false,
        };
        play.stops = play.rng.chance(0.4);
        play.unrest = [0.0, 0.02, 0.1, 0.3][play.rng.below(4)];
        play.options = play.step_options();
        for k in 0..count {
            let thing = play.thing(k);
            play.enter(thing);
        }
        play
    }

    /// A play of a few bodies that come together, stop where they meet, and then rest on each other or press on: all of their rules ask
    /// where they touch.
    pub fn settling(seed: u64) -> Self {
        Self::new(seed).settled()
    }

    /// The same play, its bodies come together as in one of settling.
    pub fn settled(self) -> Self {
        let mut play = self;
        play.settles = true;
        play.stops = true;
        play.unrest = if play.rng.chance(0.3) { 0.05 } else { 0.0 };
        play.actors.truncate(2 + play.rng.below(2));
        play.options = StepOptions { cell_limit: 50_000, clear: play.rng.chance(0.3), ..StepOptions::default() };
        for k in 0..play.actors.len() {
            let pose = play.actors[k].pose;
            let rotation = if play.rng.chance(0.4) { DQuat::IDENTITY } else { pose.rotation };
            let from = if k == 0 { DVec3::ZERO } else { play.rng.direction() * play.rng.within(0.8, 2.5) };
            let pose = Pose::new(from, rotation);
            let spin = if play.rng.chance(0.3) { play.rng.vector(0.2) } else { DVec3::ZERO };
            let velocity = (play.rng.vector(0.2) - from) * play.rng.within(0.3, 1.0);
            let manner = Manner::Goes { velocity, spin, pull: DVec3::ZERO, jitter: 0.0 };
            let thing = Thing { is_static: k == 0, pose, ..play.actors[k].thing.clone() };
            play.actors[k] = Actor { thing, manner, pose, home: pose };
        }
        play
    }

    /// A play of settling whose first body is a floor, or a wall, that reaches to infinity.
    pub fn on_floor(seed: u64) -> Self {
        Self::settling(seed).floored()
    }

    /// The same play of settling with such a floor.
    pub fn floored(self) -> Self {
        let mut play = self;
        let model = play.recipes.len();
        play.recipes.push(Recipe::of(HalfSpace));
        let rotation = if play.rng.chance(0.5) { DQuat::IDENTITY } else { play.rng.rotation() };
        let below = Pose::new(rotation * DVec3::Z * -play.rng.within(0.5, 1.0), rotation);
        let first = &mut play.actors[0];
        first.thing = Thing { model, is_static: true, place: Pose::IDENTITY, pose: below, ..first.thing.clone() };
        (first.pose, first.home, first.manner) = (below, below, Manner::Rests);
        // The others come down from above it.
        for actor in &mut play.actors[1..] {
            let up = rotation * DVec3::Z;
            let low = up.dot(actor.pose.position - below.position);
            actor.pose.position += up * (2.0 * low.abs() - low + 0.5 * (1.0 - low.signum()));
            actor.home = actor.pose;
            actor.thing.pose = actor.pose;
            if let Manner::Goes { velocity, .. } = &mut actor.manner {
                *velocity -= up * (up.dot(*velocity) + 0.3);
            }
        }
        play
    }

    fn snap(&self, x: DVec3) -> DVec3 {
        if self.grid > 0.0 { (x / self.grid).round() * self.grid } else { x }
    }

    fn somewhere(&mut self) -> Pose {
        let stage = self.stage * if self.rng.chance(0.1) { 4.0 } else { 1.0 };
        let at = self.rng.vector(stage);
        let rotation = if self.grid > 0.0 && self.rng.chance(0.7) { DQuat::IDENTITY } else { self.rng.rotation() };
        Pose::new(self.snap(at), rotation)
    }

    fn thing(&mut self, k: usize) -> Thing {
        let model = if k < self.recipes.len() { k } else { self.rng.below(self.recipes.len()) };
        let place = if self.rng.chance(0.7) { Pose::IDENTITY } else { scenes::pose(&mut self.rng, 0.2) };
        let is_static = self.rng.chance(if k == 0 { 0.5 } else { 0.1 });
        let pose = if k == 0 { Pose::IDENTITY } else { self.somewhere() };
        let group = ["default", "other"][usize::from(self.rng.chance(0.3))];
        self.next_id += 1 + u32::from(self.rng.chance(0.1));
        Thing { id: self.next_id, model, group, is_static, place, pose }
    }

    fn enter(&mut self, thing: Thing) {
        let manner = self.manner(&thing.pose);
        let pose = thing.pose;
        self.actors.push(Actor { thing, manner, pose, home: pose });
    }

    fn manner(&mut self, pose: &Pose) -> Manner {
        let r = &mut self.rng;
        let pace = 10f64.powf(r.within(-3.0, -0.3));
        match r.below(10) {
            0 | 1 => Manner::Rests,
            2 => Manner::Trembles { by: 10f64.powf(r.within(-16.0, -1.0)) },
            3 => {
                let other = Pose::new(pose.position + r.vector(2.0 * pace), r.rotation());
                let rotation = if r.chance(0.5) { pose.rotation } else { other.rotation };
                Manner::Swings { ends: [*pose, Pose { rotation, ..other }] }
            }
            _ => {
                // Mostly towards the middle, where the others are.
                let aim = r.vector(0.5 * self.stage) - pose.position;
                let way = if r.chance(0.8) { aim.normalize_or_zero() } else { r.direction() };
                let spin = match r.below(6) {
                    0..=2 => DVec3::ZERO,
                    3 => r.direction() * r.within(0.0, 7.0),
                    _ => r.vector(2.0 * pace),
                };
                let pull = if r.chance(0.4) { r.vector(0.1 * pace) } else { DVec3::ZERO };
                let jitter = if r.chance(0.7) { 0.0 } else { 10f64.powf(r.within(-12.0, -2.0)) };
                Manner::Goes { velocity: way * pace, spin, pull, jitter }
            }
        }
    }

    fn rules(&mut self) -> Vec<Rule> {
        let r = &mut self.rng;
        if r.chance(0.3) {
            return Vec::new();
        }
        let pairs = [["default", "default"], ["default", "other"], ["other", "other"]];
        let mut rules = Vec::new();
        for between in pairs {
            if r.chance(0.1) {
                continue;
            }
            let overlaps = InitialOverlap::ALL;
            rules.push(Rule {
                detect: [Detect::Continuous, Detect::Continuous, Detect::Continuous, Detect::Discrete][r.below(4)],
                report: Report::ALL[r.below(Report::ALL.len())],
                penetration: r.chance(0.2),
                margin: if r.chance(0.5) { 0.0 } else { 10f64.powf(r.within(-6.0, -0.3)) },
                initial_overlap: overlaps[r.below(overlaps.len())],
                sensor: r.chance(0.1),
                ..Rule::new(between.map(String::from))
            });
        }
        if self.settles {
            for rule in &mut rules {
                rule.report = if rule.margin > 0.0 && r.chance(0.5) { Report::Contact } else { Report::Patch };
                rule.sensor = false;
                // Regions of a margin that holds the bodies are those of all their faces.
                rule.margin = rule.margin.min(0.02);
            }
        }
        rules
    }

    fn step_options(&mut self) -> StepOptions {
        let r = &mut self.rng;
        StepOptions {
            advance: 1.0,
            dt: 0.0,
            first: r.chance(0.25),
            clear: r.chance(0.3),
            max_records: if r.chance(0.1) { 1 + r.below(4) as u32 } else { 0 },
            max_patch_slots: if r.chance(0.1) { 1 + r.below(8) as u32 } else { 0 },
            cell_limit: [1_000, 1_000, 1_000, 60][r.below(4)],
            batch_limit: if r.chance(0.05) { 200 } else { 0 },
        }
    }

    /// Where the bodies stand, as a world has it after its last step and before the next.
    pub fn follow(&mut self, world: &World) {
        for actor in &mut self.actors {
            if let Some(body) = world.body(actor.thing.id) {
                actor.pose = body.motion_state.end;
            }
        }
    }

    /// The next step; `free`: how much of the last one nothing was met in.
    pub fn next(&mut self, free: f64) -> Act {
        let mut changes = Vec::new();
        if !self.begun {
            self.begun = true;
            changes.extend(self.actors.iter().map(|a| Change::Add(a.thing.clone())));
            changes.push(Change::Rules(self.rules()));
        } else {
            if self.rng.chance(0.2 * self.unrest) {
                let rules = self.rules();
                changes.push(Change::Rules(rules));
            }
            if self.rng.chance(0.1 * self.unrest) {
                let resolution =
                    if self.rng.chance(0.5) { None } else { Some(10f64.powf(self.rng.within(-9.0, -5.0))) };
                changes.push(Change::Resolution(resolution));
            }
            if self.rng.chance(0.3 * self.unrest) {
                let thing = self.thing(usize::MAX);
                changes.push(Change::Add(thing.clone()));
                self.enter(thing);
            }
            if self.actors.len() > 2 && self.rng.chance(0.3 * self.unrest) {
                let k = self.rng.below(self.actors.len());
                changes.push(Change::Remove(self.actors.remove(k).thing.id));
            }
            if self.rng.chance(self.unrest) {
                self.options = self.step_options();
            }
        }
        if self.settles && free < 1.0 && self.rng.chance(0.4) {
            self.actors.iter_mut().for_each(|actor| actor.manner = Manner::Rests);
        }
        let mut records = Vec::new();
        for k in 0..self.actors.len() {
            self.order(k, &mut records);
        }
        if self.rng.chance(0.2) {
            records.reverse();
        }
        let advance = match () {
            () if self.stops => free,
            () if self.rng.chance(0.5 * self.unrest) => [0.0, 1.0, self.rng.within(0.0, 1.0)][self.rng.below(3)],
            () => 1.0,
        };
        Act { changes, records, options: StepOptions { advance, ..self.options } }
    }

    /// Moves an actor on.
    fn order(&mut self, k: usize, records: &mut Vec<PoseRecord>) {
        let Actor { thing, manner, pose, home } = self.actors[k].clone();
        if thing.is_static {
            return;
        }
        let id = thing.id;
        let mut from = pose;
        if self.rng.chance(0.3 * self.unrest) {
            // Set back, or put elsewhere; at times where it is, to the last bit but one.
            from = match self.rng.below(4) {
                0 => home,
                1 => pose,
                2 => Pose { position: pose.position + DVec3::X * 1e-15, ..pose },
                _ => self.somewhere(),
            };
            self.actors[k].home = from;
            records.push(PoseRecord::start(id, &from));
            if self.rng.chance(0.3) {
                return;
            }
        }
        if self.rng.chance(0.2 * self.unrest) {
            self.actors[k].manner = self.manner(&from);
        }
        let goal = match manner {
            Manner::Rests => {
                if self.rng.chance(0.5) {
                    records.push(PoseRecord::end(id, &from));
                }
                return;
            }
            Manner::Trembles { by } => Pose { position: home.position + self.rng.vector(by), ..from },
            Manner::Swings { ends } => {
                let far = (from.position - ends[0].position).length() > (from.position - ends[1].position).length();
                ends[usize::from(!far)]
            }
            Manner::Goes { velocity, spin, pull, jitter } => {
                self.actors[k].manner = Manner::Goes { velocity: velocity + pull, spin, pull, jitter };
                let astray = self.rng.vector(1.0) * jitter;
                let position = self.snap(from.position + velocity + astray);
                if spin != DVec3::ZERO && self.rng.chance(0.5) {
                    records.push(PoseRecord::turn(id, position, spin));
                    return;
                }
                let motion = Motion::turning(from, position, spin);
                Pose { position, ..motion.at(1.0) }
            }
        };
        records.push(PoseRecord::end(id, &goal));
    }
}

/// The tracks of a world's bodies, to be restored in another one.
pub fn motion_states(world: &World) -> Vec<(u32, MotionState)> {
    world.bodies().iter().map(|b| (b.id, b.motion_state)).collect()
}
