//! What is shown: models, and acts of steps, each step a scene of its own that is solved when somebody looks at it.

use super::buffers::{Buffers, Shown};
use crate::check::Check;
use crate::contact::{Outcome, Status};
use crate::import::{Scene, SceneObject};
use crate::math::Aabb;
use crate::octree::Model;
use crate::picture::camera::{self, USUAL};
use crate::picture::ray::Traced;
use crate::picture::view::{Camera, Thing, View};
use crate::report::{Answer, Feature, PairAnswer, PairReport, faces};
use crate::terminal::{number, time};
use crate::world::{StepOptions, StepOutcome};
use contactd_proto::{Detect, Motion, Pose, Report, Rule};
use glam::DVec3;
use serde::Serialize;
use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

/// Makes the scene of a step; its models are those of the act, in order.
pub type SceneOf = Box<dyn Fn(usize) -> Result<Scene, String> + Send + Sync>;

/// Steps with the same objects.
pub struct Act {
    /// What happens.
    pub title: String,
    /// How many steps there are; of one that grows, at most.
    pub steps: usize,
    /// Which of the show's models the scene's are, in the scene's order.
    pub models: Vec<usize>,
    /// The scene of a step below `steps`.
    pub scene: SceneOf,
}

impl std::fmt::Debug for Act {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Act {:?} of {} steps", self.title, self.steps)
    }
}

/// All that a page shows.
#[derive(Debug)]
pub struct Show {
    /// Its name: a file's, or "demo".
    pub title: String,
    /// Its models.
    pub models: Vec<Shown>,
    /// Its acts, one at least.
    pub acts: Vec<Act>,
    /// The models as numbers.
    pub buffers: Buffers,
    /// Where what is endless is cut off, a box in the frame of each model.
    pub extents: Vec<Aabb>,
    /// Of a show whose acts grow (`live`): which one it is, from 1, and how many steps each act has by now.
    pub growing: Option<(u64, Vec<Arc<AtomicUsize>>)>,
    /// Steps that were solved, as JSON.
    solved: Mutex<HashMap<(usize, usize), String>>,
}

/// Solved steps that are kept.
const KEPT: usize = 64;

/// A step without a page: what moves how, and what meets.
#[derive(Clone, Debug)]
pub struct Step {
    /// The label of the scene's unit; may be empty.
    pub unit: String,
    /// In the scene's order.
    pub objects: Vec<Moved>,
    /// Pairs that meet.
    pub contacts: Vec<Met>,
}

/// An object over a step.
#[derive(Clone, Debug)]
pub struct Moved {
    /// Its name.
    pub name: String,
    /// Which of the show's models it has.
    pub model: usize,
    /// The model in the object's frame.
    pub place: Pose,
    /// The object's frame over the step.
    pub motion: Motion,
}

/// Where two objects meet.
#[derive(Clone, Debug)]
pub struct Met {
    /// When, fraction of the step.
    pub time: f64,
    /// Where, world frame.
    pub point: DVec3,
    /// Unit normal, world frame.
    pub normal: DVec3,
    /// What became of the pair.
    pub sentence: String,
}

#[derive(Serialize)]
struct Told<'a> {
    title: &'a str,
    models: Vec<ModelTold<'a>>,
    acts: Vec<ActTold>,
    /// Of a show whose acts grow, which one it is.
    live: Option<u64>,
    rows: usize,
    words: usize,
    triangles: usize,
}

#[derive(Serialize)]
struct ModelTold<'a> {
    name: &'a str,
    file: &'a str,
    #[serde(flatten)]
    drawn: &'a super::buffers::Piece,
}

#[derive(Serialize)]
struct ActTold {
    title: String,
    steps: usize,
    unit: String,
    objects: Vec<ObjectTold>,
}

#[derive(Serialize)]
struct ObjectTold {
    name: String,
    model: usize,
    fixed: bool,
    group: String,
}

/// A step as the page has it.
#[derive(Serialize)]
struct StepTold {
    /// Of each object: position and rotation at t = 0, displacement and rotation vector over the step.
    motions: Vec<[f64; 13]>,
    /// Of each object: position and rotation (x, y, z, w) of the model in the object's frame.
    places: Vec<[f64; 7]>,
    summary: String,
    safe_time: f64,
    undecided: bool,
    pairs: Vec<PairTold>,
    /// Where the camera best stands, towards it from what it sees, and how many contacts it does not see from there.
    from: [f64; 3],
    hidden: usize,
}

#[derive(Serialize)]
struct PairTold {
    objects: [u32; 2],
    #[serde(flatten)]
    answer: PairAnswer,
    faces: [Vec<FaceTold>; 2],
    sentence: String,
}

#[derive(Serialize)]
struct FaceTold {
    face: u32,
    text: String,
}

/// What a pick tells.
#[derive(Serialize)]
struct Picked {
    text: String,
    file: String,
    line: u32,
    column: u32,
    #[serde(flatten)]
    feature: Feature,
}

/// A contact of some step of an act.
#[derive(Serialize)]
struct Mark {
    step: usize,
    time: f64,
    status: &'static str,
}

impl Show {
    /// A show of one step: a scene with its models.
    ///
    /// # Errors
    /// What the scene's world refuses.
    pub fn of_scene(title: String, scene: Scene, models: &[Arc<Model>]) -> Result<Self, String> {
        let shown = scene.models.iter().zip(models).map(|(source, model)| Shown {
            name: source.name.clone(),
            file: source.text_name(),
            model: model.clone(),
        });
        let shown: Vec<Shown> = shown.collect();
        let models = (0..shown.len()).collect();
        let act = Act { title: title.clone(), steps: 1, models, scene: Box::new(move |_| Ok(scene.clone())) };
        Self::new(title, shown, vec![act])
    }

    /// A show of acts.
    ///
    /// # Errors
    /// A first step that is refused, or no act at all.
    pub fn new(title: String, models: Vec<Shown>, acts: Vec<Act>) -> Result<Self, String> {
        let mut extents = vec![Aabb::EMPTY; models.len()];
        for act in &acts {
            let scene = (act.scene)(0)?;
            let around = extent(&scene, act, &models);
            for o in &scene.objects {
                let (model, pose) = (act.models[o.model], o.motion.start.compose(&o.place).inverse());
                let seen = Aabb::of_points(around.corners().into_iter().map(|c| pose.point(c)));
                extents[model] = extents[model].union(&seen);
            }
        }
        if acts.is_empty() {
            return Err(format!("{title}: expected something to show, found nothing"));
        }
        let buffers = Buffers::new(&models, &extents);
        let show = Self { title, models, acts, buffers, extents, growing: None, solved: Mutex::default() };
        for act in 0..show.acts.len() {
            show.solved(act, 0)?;
        }
        Ok(show)
    }

    /// What the page asks first, as JSON.
    ///
    /// # Errors
    /// A first step that is refused.
    pub fn told(&self) -> Result<String, String> {
        let models = self.models.iter().zip(&self.buffers.pieces);
        let act = |act: &Act| {
            let scene = (act.scene)(0)?;
            let object = |o: &SceneObject| ObjectTold {
                name: o.name.clone(),
                model: act.models[o.model],
                fixed: o.is_static,
                group: o.group.clone(),
            };
            let objects = scene.objects.iter().map(object).collect();
            Ok(ActTold { title: act.title.clone(), steps: act.steps, unit: scene.unit, objects })
        };
        let mut acts = self.acts.iter().map(act).collect::<Result<Vec<_>, String>>()?;
        let growing = self.growing.iter().flat_map(|(_, steps)| steps);
        acts.iter_mut().zip(growing).for_each(|(act, steps)| act.steps = steps.load(Relaxed));
        json(&Told {
            title: &self.title,
            models: models.map(|(m, drawn)| ModelTold { name: &m.name, file: &m.file, drawn }).collect(),
            acts,
            live: self.growing.as_ref().map(|(number, _)| *number),
            rows: self.buffers.rows.len(),
            words: self.buffers.words.len(),
            triangles: self.buffers.triangles.len() / 3,
        })
    }

    /// A step with its answers, as JSON; `None` where there is no such step.
    ///
    /// # Errors
    /// What the world refuses.
    pub fn step(&self, act: usize, step: usize) -> Option<Result<String, String>> {
        self.acts.get(act).filter(|a| step < a.steps)?;
        Some(self.solved(act, step))
    }

    /// Position and rotation of every model at a moment of a step, as JSON: the engine's own motion.
    ///
    /// # Errors
    /// A scene that cannot be read.
    pub fn poses(&self, act: usize, step: usize, t: f64) -> Option<Result<String, String>> {
        let act = self.acts.get(act).filter(|a| step < a.steps)?;
        let poses = |scene: Scene| scene.objects.iter().map(|o| seven(&o.motion.at(t).compose(&o.place))).collect();
        Some((act.scene)(step).and_then(|scene| json::<Vec<[f64; 7]>>(&poses(scene))))
    }

    /// A step with its contacts.
    ///
    /// # Errors
    /// What the world refuses.
    pub(super) fn moved(&self, act: usize, step: usize) -> Result<Step, String> {
        let scene = with_report((self.acts[act].scene)(step)?, Report::Contact);
        let mut check = self.check(act, &scene)?;
        let outcome = check.step_with(&StepOptions::default()).map_err(|e| e.to_string())?.clone();
        let met = |pair: PairTold| {
            let (point, normal) = (pair.answer.point?, pair.answer.normal?);
            let (time, sentence) = (pair.answer.time?, pair.sentence);
            Some(Met { time, point: point.into(), normal: normal.into(), sentence })
        };
        let contacts = self.pairs(act, &scene, &outcome).into_iter().filter_map(met).collect();
        let object = |o: SceneObject| Moved {
            name: o.name,
            model: self.acts[act].models[o.model],
            place: o.place,
            motion: o.motion,
        };
        Ok(Step { unit: scene.unit, objects: scene.objects.into_iter().map(object).collect(), contacts })
    }

    /// The size of what is bounded in a step, at both of its ends: half the diagonal of a box around it; 1 where nothing is.
    pub(super) fn size(&self, step: &Step) -> f64 {
        let mut whole = Aabb::EMPTY;
        for o in &step.objects {
            whole = whole.union(&swept(&self.models[o.model].model.solid.aabb(), &o.motion, &o.place));
        }
        if whole.is_empty() { 1.0 } else { whole.half().length() }
    }

    /// When something meets in each step of an act, as JSON.
    ///
    /// # Errors
    /// What the world refuses.
    pub fn marks(&self, act: usize) -> Option<Result<String, String>> {
        let steps = self.acts.get(act)?.steps;
        let marks = || {
            let mut marks = Vec::new();
            for step in 0..steps {
                let scene = (self.acts[act].scene)(step)?;
                let mut check = self.check(act, &scene)?;
                let outcome = check.step_with(&StepOptions::default()).map_err(|e| e.to_string())?;
                let told = outcome.pairs.iter().map(|p| &p.outcome).filter(|o| o.meets());
                marks.extend(told.map(|o| Mark { step, time: o.time(), status: o.status().name() }));
            }
            json(&marks)
        };
        Some(marks())
    }

    /// What a face is called, as JSON.
    ///
    /// # Errors
    /// None that a number of a face can bring about.
    pub fn face(&self, model: usize, face: u32) -> Option<Result<String, String>> {
        let shown = self.models.get(model)?;
        let feature = Feature::of_face(&shown.file, &shown.model.solid, face)?;
        let label = &shown.model.solid.primitives[feature.primitive as usize].label;
        let text = words(std::slice::from_ref(&feature)).remove(0);
        Some(json(&Picked { text, file: shown.file.clone(), line: label.line, column: label.column, feature }))
    }

    /// A step as JSON, solved once.
    fn solved(&self, act: usize, step: usize) -> Result<String, String> {
        let kept = || self.solved.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(told) = kept().get(&(act, step)) {
            return Ok(told.clone());
        }
        let told = json(&self.solve(act, step)?)?;
        let mut kept = kept();
        if kept.len() >= KEPT {
            kept.clear();
        }
        kept.insert((act, step), told.clone());
        Ok(told)
    }

    fn check(&self, act: usize, scene: &Scene) -> Result<Check, String> {
        let models: Vec<Arc<Model>> = self.acts[act].models.iter().map(|m| self.models[*m].model.clone()).collect();
        Check::new(scene, &models, None).map_err(|e| e.to_string())
    }

    fn solve(&self, act: usize, step: usize) -> Result<StepTold, String> {
        let scene = with_report((self.acts[act].scene)(step)?, Report::Patch);
        let mut check = self.check(act, &scene)?;
        let outcome = check.step_with(&StepOptions::default()).map_err(|e| e.to_string())?.clone();
        let pairs = self.pairs(act, &scene, &outcome);
        let (from, hidden) = self.best_view(&scene, &self.acts[act].models, &pairs);
        let motion = |o: &SceneObject| {
            let mut all = [0.0; 13];
            all[..7].copy_from_slice(&seven(&o.motion.start));
            all[7..10].copy_from_slice(&o.motion.velocity.to_array());
            all[10..].copy_from_slice(&o.motion.spin.to_array());
            all
        };
        Ok(StepTold {
            motions: scene.objects.iter().map(motion).collect(),
            places: scene.objects.iter().map(|o| seven(&o.place)).collect(),
            summary: summary(&pairs, outcome.safe_time),
            safe_time: outcome.safe_time,
            undecided: outcome.undecided,
            pairs,
            from: from.to_array(),
            hidden,
        })
    }

    /// The answers of a step.
    fn pairs(&self, act: usize, scene: &Scene, outcome: &StepOutcome) -> Vec<PairTold> {
        let models = &self.acts[act].models;
        let shown = |id: u32| &self.models[models[scene.objects[id as usize].model]];
        let mut pairs = Vec::with_capacity(outcome.pairs.len());
        for p in &outcome.pairs {
            let [a, b] = [p.a, p.b].map(|id| &scene.objects[id as usize].name);
            let report = PairReport {
                names: [a, b],
                solids: [&shown(p.a).model.solid, &shown(p.b).model.solid],
                files: [&shown(p.a).file, &shown(p.b).file],
                outcome: &p.outcome,
                report: p.plan.report,
                regions: outcome.regions_of(p),
                regions_complete: p.regions_complete,
                clearance: outcome.clearance_of(p),
                discrete: p.plan.detect == Detect::Discrete,
            };
            pairs.push(PairTold::new([p.a, p.b], &report));
        }
        pairs
    }

    /// Where the camera best stands to see the contacts of a step, each with its two objects where they meet.
    fn best_view(&self, scene: &Scene, models: &[usize], pairs: &[PairTold]) -> (DVec3, usize) {
        let mut times: HashMap<u32, f64> = HashMap::new();
        for p in pairs {
            for id in p.objects {
                let t = times.entry(id).or_insert(1.0);
                *t = t.min(p.answer.time.unwrap_or(1.0));
            }
        }
        let traced: Vec<Traced<'_>> = self.models.iter().map(|m| Traced::new(&m.model.solid)).collect();
        let things = (0u32..).zip(&scene.objects).filter_map(|(id, o)| {
            let t = times.get(&id).copied().unwrap_or(1.0);
            let traced = &traced[models[o.model]];
            let seen = traced.aabb().is_finite() && !traced.aabb().is_empty();
            let (pose, color) = (o.motion.at(t).compose(&o.place), [0.5; 3]);
            seen.then_some(Thing { traced, pose, color, cut: None })
        });
        let points: Vec<DVec3> = pairs.iter().filter_map(|p| p.answer.point).map(DVec3::from_array).collect();
        let things: Vec<Thing<'_>> = things.collect();
        let boxes: Vec<Aabb> = things.iter().map(Thing::aabb).collect();
        if points.is_empty() || boxes.is_empty() {
            return (USUAL, 0);
        }
        let camera = Camera::framing(&boxes, USUAL, SIZE);
        let mut view = View { things, camera, ground: None, samples: 1 };
        camera::turn(&mut view, &points[..points.len().min(LOOKED_AT)])
    }
}

/// The image that is thought of when a side is chosen, pixels.
const SIZE: (usize, usize) = (1280, 720);

/// Contacts that the camera is chosen by.
const LOOKED_AT: usize = 24;

impl PairTold {
    fn new(objects: [u32; 2], report: &PairReport<'_>) -> Self {
        let answer = Answer::of_pairs(std::slice::from_ref(report)).pairs.remove(0);
        let ids = report.outcome.point().map_or([[u32::MAX; 3]; 2], |p| [p.faces_a, p.faces_b]);
        let face = |side: usize| {
            let feature = |face: &u32| {
                let feature = Feature::of_face(report.files[side], report.solids[side], *face)?;
                Some(FaceTold { face: *face, text: words(&[feature]).remove(0) })
            };
            ids[side].iter().filter_map(feature).collect()
        };
        let told = answer.features.is_some();
        let faces = if told { [face(0), face(1)] } else { [Vec::new(), Vec::new()] };
        let sentence = sentence(&answer, report.outcome);
        Self { objects, answer, faces, sentence }
    }
}

/// What became of a pair, in a sentence.
fn sentence(p: &PairAnswer, outcome: &Outcome) -> String {
    let (a, b) = (&p.a, &p.b);
    let bracket = |lower: f64, upper: f64| match upper - lower {
        wide if wide > 5e-10 => format!(" (proven between {} and {})", time(lower), time(upper)),
        _ => String::new(),
    };
    let proven = bracket(outcome.time_lower(), p.time_upper.unwrap_or(outcome.time_lower()));
    match outcome.status() {
        Status::Contact => match (p.time, p.kind) {
            (Some(t), Some(kind)) => format!("{a} first meets {b} at t = {}, {kind}{proven}.", time(t)),
            (Some(t), None) => format!("{a} first meets {b} at t = {}{proven}.", time(t)),
            (None, _) => format!("{a} meets {b}."),
        },
        Status::Overlap => match &p.penetration {
            Some(x) => format!("{a} and {b} overlap from the start, {} deep.", number(x.depth, p.resolution, 6)),
            None => format!("{a} and {b} overlap from the start."),
        },
        Status::Undecided => {
            format!("{a} and {b} are undecided; they are proven apart until t = {}.", time(outcome.time_lower()))
        }
        Status::Clear if p.touching => format!("{a} touches {b} and does not go deeper."),
        Status::Clear => match p.margin_time {
            Some(t) => format!("{a} and {b} come within their margin, but not before t = {}.", time(t)),
            None => format!("{a} and {b} do not meet."),
        },
    }
}

/// How many pairs there are of each kind that is told, and until when all are clear.
fn summary(pairs: &[PairTold], safe: f64) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for p in pairs {
        *counts.entry(p.answer.status).or_default() += 1;
    }
    let mut told: Vec<String> = Vec::new();
    for (word, many) in [("contact", "contacts"), ("overlap", "overlaps"), ("undecided", "undecided pairs")] {
        match counts.get(word) {
            Some(1) => told.push(format!("1 {}", if word == "undecided" { "undecided pair" } else { word })),
            Some(n) => told.push(format!("{n} {many}")),
            None => {}
        }
    }
    let what = if told.is_empty() { "Nothing meets".into() } else { told.join(", ") };
    match safe {
        1.0 if pairs.iter().any(|p| p.answer.discrete) => {
            format!("{what}; the whole step is proven clear, of discrete pairs its end.")
        }
        1.0 => format!("{what}; the whole step is proven clear."),
        t if t <= 0.0 => format!("{what}; no part of the step is proven clear."),
        t if pairs.iter().any(|p| p.answer.discrete) => {
            format!("{what}; pairs are proven clear until t = {}, discrete ones at the end alone.", time(t))
        }
        t => format!("{what}; all pairs are proven clear until t = {}.", time(t)),
    }
}

/// Faces as `check` calls them.
fn words(features: &[Feature]) -> Vec<String> {
    faces(features).into_iter().map(|(_, text)| text).collect()
}

/// The scene with so much told of all pairs that its rules search.
fn with_report(scene: Scene, report: Report) -> Scene {
    let mut rules = scene.rules.clone();
    if rules.is_empty() {
        let mut groups: Vec<&String> = scene.objects.iter().map(|o| &o.group).collect();
        groups.sort();
        groups.dedup();
        for (i, a) in groups.iter().enumerate() {
            rules.extend(groups[i..].iter().map(|b| Rule::new([(*a).clone(), (*b).clone()])));
        }
    }
    rules.iter_mut().for_each(|rule| rule.report = report);
    Scene { rules, ..scene }
}

/// A box around all that is bounded in a scene, at both ends of its step, and as much again on every side.
fn extent(scene: &Scene, act: &Act, models: &[Shown]) -> Aabb {
    let mut whole = Aabb::EMPTY;
    for o in &scene.objects {
        whole = whole.union(&swept(&models[act.models[o.model]].model.solid.aabb(), &o.motion, &o.place));
    }
    if whole.is_empty() { Aabb::around(DVec3::ZERO, DVec3::ONE) } else { whole.grown(2.0 * whole.half().length()) }
}

/// A box around a model at both ends of a step; empty of one that is endless.
fn swept(own: &Aabb, motion: &Motion, place: &Pose) -> Aabb {
    if !own.is_finite() {
        return Aabb::EMPTY;
    }
    let at = |t: f64| {
        let pose = motion.at(t).compose(place);
        Aabb::of_points(own.corners().into_iter().map(|c| pose.point(c)))
    };
    at(0.0).union(&at(1.0))
}

fn seven(pose: &Pose) -> [f64; 7] {
    let (p, q) = (pose.position, pose.rotation);
    [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
}

fn json<T: Serialize>(told: &T) -> Result<String, String> {
    serde_json::to_string(told).map_err(|e| format!("expected numbers that JSON can tell, found {e}"))
}
