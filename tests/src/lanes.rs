//! Lanes: pairs of bodies that stand far from each other in one world, so that a step costs the sum of what its pairs cost.
//!
//! Positions are rounded to 2⁻³⁰ and lanes stand a power of two apart, so that every sum is exact: copies of a pair are the
//! same to the bit relative to each other, and so is their work. What is asked of a pair is the rule between the groups
//! "anchor" and that of its second body. Every step begins with everything where it was, and forgets: nothing is cheaper
//! for having been asked before.

use crate::primitive_pairs::{FAMILIES, rows};
use crate::random_solids::Random;
use crate::scenes::{self, Recipe, Scene};
use contactd::contact::Status;
use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, StepOutcome, World, record};
use contactd_proto::{Detect, EffectCounters, InitialOverlap, Motion, Pose, PoseRecord, Report, Rule};
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Two bodies over a step; the first one is of the group "anchor".
#[derive(Clone, Debug)]
pub struct Lane {
    /// Their models.
    pub parts: [Arc<MeasuredModel>; 2],
    /// Their motions.
    pub motions: [Motion; 2],
    /// Their models in their objects' frames.
    pub places: [Pose; 2],
    /// They are not declared to never turn.
    pub rotates: bool,
}

/// Rounded, so that sums with a lane's place are exact.
fn rounded(v: DVec3) -> DVec3 {
    const GRID: f64 = (1u64 << 30) as f64;
    (v * GRID).round() / GRID
}

impl Lane {
    /// Two models that move.
    pub fn new(models: [Arc<Model>; 2], motions: [Motion; 2], places: [Pose; 2]) -> Self {
        let motions = motions.map(|m| {
            let start = Pose::new(rounded(m.start.position), m.start.rotation);
            Motion { start, velocity: rounded(m.velocity), spin: m.spin }
        });
        Self { parts: models.map(|m| Arc::new(MeasuredModel::new(m))), motions, places, rotates: true }
    }

    /// A scene's two bodies.
    pub fn of(scene: &Scene) -> Self {
        let models = [&scene.a, &scene.b].map(|r| Arc::new(Model::new(r.build())));
        Self::new(models, [scene.motion_a, scene.motion_b], [Pose::IDENTITY; 2])
    }

    /// The same pair, not turning.
    pub fn without_spin(&self) -> Self {
        Self { motions: self.motions.map(|m| Motion { spin: DVec3::ZERO, ..m }), ..self.clone() }
    }

    /// What becomes of it by the default rule.
    pub fn status(&self) -> Status {
        let mut lanes = Lanes::new(&[(self, PLAIN)], &[rule(PLAIN, |_| ())]);
        lanes.step().pairs.first().map_or(Status::Clear, |p| p.outcome.status())
    }

    /// No point of its bodies is farther from the lane's origin during the step.
    fn reach(&self) -> f64 {
        let of = |k: usize| {
            let m = &self.motions[k];
            let model = self.parts[k].model.radius + self.places[k].position.length();
            // A model's ball need not be centred.
            m.start.position.length() + m.velocity.length() + 4.0 * model
        };
        of(0).max(of(1))
    }
}

/// The group of pairs that nothing special is asked of.
pub const PLAIN: &str = "plain";
/// The group of pairs that an effect is asked of.
pub const EFFECT: &str = "effect";

/// A rule between the anchors and a group.
pub fn rule(group: &str, change: impl FnOnce(&mut Rule)) -> Rule {
    let mut rule = Rule::new(["anchor".into(), group.into()]);
    change(&mut rule);
    rule
}

/// A world of lanes, and the batch that moves them.
#[derive(Debug)]
pub struct Lanes {
    world: World,
    records: Vec<PoseRecord>,
}

impl Lanes {
    /// Lanes, each with the group of its second body, under rules.
    pub fn new(lanes: &[(&Lane, &str)], rules: &[Rule]) -> Self {
        let reach = lanes.iter().map(|(lane, _)| lane.reach()).fold(1.0, f64::max);
        let spacing = (4.0 * reach).log2().ceil().exp2();
        let columns = (lanes.len() as f64).sqrt().ceil() as usize;
        let most = 2 * lanes.len() + 64;
        let mut world = World::new(most, 2 * most);
        world.set_rules(rules.to_vec()).expect("rules");
        let mut records = Vec::new();
        for (i, (lane, group)) in lanes.iter().enumerate() {
            let at = spacing * dvec3((i % columns) as f64, (i / columns) as f64, 0.0);
            for (k, group) in ["anchor", *group].into_iter().enumerate() {
                let id = (2 * i + k) as u32;
                let Motion { start, velocity, spin } = lane.motions[k];
                let start = Pose::new(start.position + at, start.rotation);
                let spec = ObjectSpec::new(id, &lane.parts[k], start);
                let (group, place, rotates) = (group.into(), lane.places[k], lane.rotates);
                let is_static = k == 0 && lane.motions[k].is_rest();
                world.add_object(ObjectSpec { group, place, is_static, rotates, ..spec }).expect("an object");
                if !lane.motions[k].is_rest() {
                    records.push(PoseRecord::start(id, &start));
                    records.push(PoseRecord::turn(id, start.position + velocity, spin));
                }
            }
        }
        Self { world, records }
    }

    /// `copies` copies of each lane; the second bodies of the first `on` of them are of the group "effect", the others of
    /// the group "plain".
    pub fn shared(lanes: &[Lane], (on, copies): (usize, usize), rules: &[Rule]) -> Self {
        let group = |copy| if copy < on { EFFECT } else { PLAIN };
        let all: Vec<_> = (0..copies).flat_map(|copy| lanes.iter().map(move |lane| (lane, group(copy)))).collect();
        Self::new(&all, rules)
    }

    /// All lanes by the one rule.
    pub fn all(lanes: &[Lane], change: impl FnOnce(&mut Rule)) -> Self {
        Self::shared(lanes, (0, 1), &[rule(PLAIN, change)])
    }

    /// A body of a group, as far from every anchor as nothing else is.
    pub fn add_bystander(&mut self, part: &Arc<MeasuredModel>, group: &str) {
        let last = self.world.bodies().last().map_or(0, |b| b.id);
        let at = Pose::at(dvec3(-1e4 - 100.0 * f64::from(last), -1e4, 0.0));
        let spec = ObjectSpec { group: group.into(), ..ObjectSpec::new(last + 1, part, at) };
        self.world.add_object(spec).expect("an object");
    }

    /// The world; its bodies have the motions of the last step.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The step, all of it anew.
    pub fn step(&mut self) -> &StepOutcome {
        self.world.forget();
        self.step_on()
    }

    /// The step, with what earlier ones have proven.
    pub fn step_on(&mut self) -> &StepOutcome {
        self.world.step(&self.records, &StepOptions::default()).expect("a step")
    }
}

/// All that a step counts, by name: its work, and how often each effect was worked out.
pub fn counts(out: &StepOutcome) -> Vec<(&'static str, u64)> {
    let mut all = vec![
        ("searched", u64::from(out.searched)),
        ("records", out.pairs.len() as u64),
        ("regions", out.regions.len() as u64),
    ];
    all.extend(record::reply(out, false).counters.each());
    all.extend(out.effect_counters.each());
    all
}

/// Kinds of lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Pairs of primitives that move straight and meet.
    Translating,
    /// Pairs of primitives that turn and meet.
    Turning,
    /// Trees of several primitives that turn and meet.
    Trees,
    /// Pairs of primitives that stop when a tenth of their way is left.
    Short,
    /// Drilled blocks that come down on drilled plates, flat.
    Landing,
    /// Drilled blocks that lie on drilled plates.
    Resting,
    /// Pairs that start in overlap; half of them go on into each other, half separate.
    Overlapping,
}

impl Class {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Translating, Self::Turning, Self::Trees, Self::Short, Self::Landing, Self::Resting, Self::Overlapping];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Translating => "primitives, translating",
            Self::Turning => "primitives, turning",
            Self::Trees => "trees, turning",
            Self::Short => "stopping short",
            Self::Landing => "blocks landing",
            Self::Resting => "blocks at rest",
            Self::Overlapping => "starting in overlap",
        }
    }

    /// Its first `count` lanes, the same ones each time.
    pub fn lanes(self, count: usize) -> Vec<Lane> {
        let mut r = Random::new(61);
        match self {
            Self::Translating => of_tables("_translating", count).into_iter().map(|(lane, _)| lane).collect(),
            Self::Turning => of_tables("_turning", count).into_iter().map(|(lane, _)| lane).collect(),
            Self::Short => {
                let (mut all, turning) = (of_tables("_translating", count / 2), of_tables("_turning", count));
                all.extend(turning);
                all.truncate(count);
                all.into_iter().map(|(lane, time)| slowed(&lane, 0.9 * time)).collect()
            }
            Self::Landing => (0..count).map(|_| block(&mut r, 0.01, 0.02)).collect(),
            Self::Resting => (0..count).map(|_| block(&mut r, 0.0, 0.0)).collect(),
            Self::Trees => {
                let drawn = std::iter::repeat_with(|| Lane::of(&scenes::trees(&mut r)));
                drawn.filter(|lane| lane.status() == Status::Contact).take(count).collect()
            }
            Self::Overlapping => {
                let drawn = (0..).map(|i| {
                    let mut scene = if i % 2 == 0 { scenes::primitives(&mut r) } else { scenes::trees(&mut r) };
                    let back = if i % 4 < 2 { 0.3 } else { -0.3 };
                    for m in [&mut scene.motion_a, &mut scene.motion_b] {
                        *m = Motion { start: m.at(0.8), velocity: back * m.velocity, spin: back * m.spin };
                    }
                    Lane::of(&scene)
                });
                drawn.filter(|lane| lane.status() == Status::Overlap).take(count).collect()
            }
        }
    }
}

/// Rows of the tables whose names end so, one of each in turn, with the times at which they meet.
fn of_tables(end: &str, count: usize) -> Vec<(Lane, f64)> {
    let families: Vec<_> = FAMILIES.iter().filter(|f| f.ends_with(end)).collect();
    let each = count.div_ceil(families.len());
    let met = |family: &&str| rows(family).into_iter().filter(|(_, time)| *time > 0.0).take(each).collect::<Vec<_>>();
    let tables: Vec<_> = families.into_iter().map(met).collect();
    let all = (0..each).flat_map(|i| tables.iter().filter_map(move |t| t.get(i)));
    all.map(|(scene, time)| (Lane::of(scene), *time)).take(count).collect()
}

/// The pair with a share of its motion.
fn slowed(lane: &Lane, share: f64) -> Lane {
    let motions = lane.motions.map(|m| Motion { velocity: rounded(share * m.velocity), spin: share * m.spin, ..m });
    Lane { motions, ..lane.clone() }
}

/// A drilled block that stands `gap` above a drilled plate and comes down by `way`.
fn block(r: &mut Random, gap: f64, way: f64) -> Lane {
    let plate = Recipe::cuboid(0.8, 0.8, 0.2).minus(Recipe::cylinder(0.25, 1.0));
    let block = Recipe::cuboid(0.5, 0.4, 0.2).minus(Recipe::cylinder(0.15, 1.0));
    let start = dvec3(r.within(-0.3, 0.3), r.within(-0.3, 0.3), 0.4 + gap);
    let start = Pose::new(start, DQuat::from_rotation_z(r.within(0.0, TAU)));
    let motion = Motion::turning(start, start.position - DVec3::Z * way, DVec3::ZERO);
    Lane::of(&Scene::new("block", plate, Motion::resting(Pose::IDENTITY), block, motion))
}

/// A margin that few pairs come within, in lengths of lanes.
pub const NARROW: f64 = 1e-3;
/// One that many do.
pub const WIDE: f64 = 0.25;

/// What can be asked of pairs, and of which ones it is worth asking.
#[derive(Clone, Copy, Debug)]
pub struct Effect {
    /// In words.
    pub name: &'static str,
    /// Lanes on which it has something to do.
    pub class: Class,
    /// The rule of pairs without it.
    pub plain: fn(&mut Rule),
    /// The rule of pairs with it.
    pub on: fn(&mut Rule),
    /// Its counter; exactly 0 without it.
    pub counter: fn(&EffectCounters) -> u64,
}

/// All effects of rules, each against what asks for a little less.
pub const EFFECTS: [Effect; 10] = [
    Effect {
        name: "search (off before)",
        class: Class::Trees,
        plain: |r| (r.detect, r.report) = (Detect::Off, Report::Hit),
        on: |r| r.report = Report::Hit,
        counter: |c| c.continuous,
    },
    Effect {
        name: "continuous (discrete before)",
        class: Class::Trees,
        plain: |r| r.detect = Detect::Discrete,
        on: |_| (),
        counter: |c| c.continuous,
    },
    Effect {
        name: "time (hit before)",
        class: Class::Trees,
        plain: |r| r.report = Report::Hit,
        on: |r| r.report = Report::Time,
        counter: |c| c.times,
    },
    Effect {
        name: "contact (time before)",
        class: Class::Trees,
        plain: |r| r.report = Report::Time,
        on: |_| (),
        counter: |c| c.contacts,
    },
    Effect {
        name: "patch",
        class: Class::Landing,
        plain: |_| (),
        on: |r| r.report = Report::Patch,
        counter: |c| c.patches,
    },
    Effect {
        name: "penetration",
        class: Class::Overlapping,
        plain: |_| (),
        on: |r| r.penetration = true,
        counter: |c| c.penetrations,
    },
    Effect {
        name: "ignore_if_separating",
        class: Class::Overlapping,
        plain: |_| (),
        on: |r| r.initial_overlap = InitialOverlap::IgnoreIfSeparating,
        counter: |c| c.past_overlaps,
    },
    Effect {
        name: "margin, narrow",
        class: Class::Short,
        plain: |_| (),
        on: |r| r.margin = NARROW,
        counter: |c| c.margins,
    },
    Effect {
        name: "margin, wide",
        class: Class::Short,
        plain: |_| (),
        on: |r| r.margin = WIDE,
        counter: |c| c.margins,
    },
    Effect {
        name: "sensor",
        class: Class::Translating,
        plain: |_| (),
        on: |r| r.sensor = true,
        counter: |c| c.sensors,
    },
];

impl Effect {
    /// Rules by which the group "effect" has the effect and the group "plain" has not.
    pub fn rules(&self) -> [Rule; 2] {
        [rule(PLAIN, self.plain), rule(EFFECT, self.on)]
    }

    /// Its lanes, `copies` of each, of which the first `on` have the effect.
    pub fn lanes(&self, lanes: &[Lane], share: (usize, usize)) -> Lanes {
        Lanes::shared(lanes, share, &self.rules())
    }
}
