//! One step of a scene file in this process, without a server: the same world and the same records that a session has.
//!
//! Object ids are the objects' indices in the file. Every pair that the rules allow is told, clear ones too, in the order
//! (time, a, b); with `first` only those whose bracket meets the earliest contact's.

use crate::contact::{self, Clock, PairQuery, PlacedModel, Scratch, Strategies, certificate};
use crate::import::{Place, Scene, SceneObject};
use crate::motion::Placed;
use crate::octree::Model;
use crate::world::{MeasuredModel, ObjectSpec, PairOutcome, Refusal, StepOptions, StepOutcome, World};
use contactd_proto::{Detect, ErrorCode, InitialOverlap, Motion, PoseRecord, Report};
use std::sync::Arc;

/// Why a scene that was read cannot be stepped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CheckError {
    /// A resolution that the caller gave.
    #[error("{0}")]
    Resolution(Refusal),
    /// An object, a rule or the resolution.
    #[error("{file}{}: {refusal}", Line(*at))]
    World {
        /// The scene's file, or a model's that is taken as it stands.
        file: String,
        /// Where it says so; `None` of what no file says.
        at: Option<Place>,
        /// The world's reason.
        refusal: Refusal,
    },
    /// An object's motion.
    #[error("{file}:{at}: object \"{object}\": {code}")]
    Step {
        /// The scene's file.
        file: String,
        /// Where it names the object; its head when it is the step as a whole.
        at: Place,
        /// The object; empty when it is the step as a whole.
        object: String,
        /// The world's reason.
        code: ErrorCode,
    },
}

/// A place behind its file's name.
struct Line(Option<Place>);

impl std::fmt::Display for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.map_or(Ok(()), |at| write!(f, ":{at}"))
    }
}

/// A scene as a world with the records of its step.
#[derive(Debug)]
pub struct Check {
    /// The world before the step, object ids in file order.
    pub world: World,
    /// The step: one record for every object that moves.
    pub records: Vec<PoseRecord>,
    /// Names of the objects that the records move, and where the scene names them.
    moving: Vec<(String, Place)>,
    /// Duration of the step in seconds; 0: unknown.
    dt: f64,
    file: String,
}

impl Check {
    /// Puts the objects of `scene` into a world; `models` are its models, in order, and `resolution` (length) stands
    /// before the scene's own. Objects of one model share it, and so do models that are one.
    ///
    /// # Errors
    /// What the world refuses.
    pub fn new(scene: &Scene, models: &[Arc<Model>], resolution: Option<f64>) -> Result<Self, CheckError> {
        let file = scene.file.clone();
        let refused = |at| move |refusal| CheckError::World { file: scene.file.clone(), at: Some(at), refusal };
        // Of models that are taken as they stand no file has an object.
        let of_object = |o: &SceneObject| {
            let (file, at) = match scene.file.as_str() {
                "" => (scene.models[o.model].text_name(), None),
                file => (file.to_owned(), Some(o.at)),
            };
            move |refusal| CheckError::World { file, at, refusal }
        };
        let mut parts: Vec<Arc<MeasuredModel>> = Vec::with_capacity(models.len());
        for model in models {
            let same = parts.iter().find(|p| Arc::ptr_eq(&p.model, model)).cloned();
            parts.push(same.unwrap_or_else(|| Arc::new(MeasuredModel::new(model.clone()))));
        }
        let count = scene.objects.len();
        // Of any number of records: an object that is named twice is told as such.
        let mut world = World::new(count, usize::MAX);
        if let Some(given) = resolution {
            world.set_resolution(Some(given)).map_err(CheckError::Resolution)?;
        } else {
            world.set_resolution(scene.resolution).map_err(refused(scene.resolution_at.unwrap_or(Place::START)))?;
        }
        let (mut records, mut moving) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (id, o) in (0u32..).zip(&scene.objects) {
            let spec = ObjectSpec {
                id,
                name: o.name.clone(),
                group: o.group.clone(),
                part: parts[o.model].clone(),
                is_static: o.is_static,
                rotates: o.rotates,
                max_speed: o.max_speed.unwrap_or(f64::INFINITY),
                place: o.place,
                pose: o.motion.start,
            };
            world.add_object(spec).map_err(of_object(o))?;
            if let Some(record) = o.record {
                records.push(PoseRecord { object: id, ..record });
                moving.push((o.name.clone(), o.at));
            }
        }
        world.set_rules(scene.rules.clone()).map_err(refused(Place::START))?;
        Ok(Self { world, records, moving, dt: scene.dt.unwrap_or(0.0), file })
    }

    /// Takes the step.
    ///
    /// # Errors
    /// What the world refuses of a record.
    pub fn step(&mut self, first: bool) -> Result<&StepOutcome, CheckError> {
        self.step_with(&StepOptions { first, clear: true, ..StepOptions::default() })
    }

    /// Takes the step and tells what `options` ask for; its duration is the scene's.
    ///
    /// # Errors
    /// What the world refuses of a record.
    pub fn step_with(&mut self, options: &StepOptions) -> Result<&StepOutcome, CheckError> {
        let Self { world, records, moving, dt, file } = self;
        let options = StepOptions { dt: *dt, ..*options };
        world.step(records, &options).map_err(|error| {
            let named = error.index.and_then(|i| moving.get(i as usize)).cloned();
            let (object, at) = named.unwrap_or((String::new(), Place::START));
            CheckError::Step { file: file.clone(), at, object, code: error.code }
        })
    }

    /// The certificates of the answers of the step just taken (docs/certificate.md), and how many pairs have none.
    pub fn certificates(&self, outcome: &StepOutcome) -> (String, usize) {
        let (mut text, mut without) = (format!("{}\n", certificate::HEADER), 0);
        for p in &outcome.pairs {
            // One proves where the first contact of the whole step is, or that there is none.
            let whole = p.plan.detect != Detect::Discrete && p.plan.report >= Report::Contact;
            let past = p.outcome.touching && p.plan.initial_overlap != InitialOverlap::Report;
            let query = self.query(p, CERTIFICATE_CELLS).filter(|_| whole && !past);
            let made = query.and_then(|query| certificate::certify(&query, &p.outcome));
            match made {
                Some(made) => made.write((p.a as usize, p.b as usize), &mut text),
                None => without += 1,
            }
        }
        (text, without)
    }

    /// Where the time of each told pair went: each that the step searched is asked anew, with nothing remembered, some times
    /// over; the least is told. `None`: the step needed no search, as boxes or one direction told the pair apart.
    pub fn clocks(&self, outcome: &StepOutcome) -> Vec<Option<Clock>> {
        let mut scratch = Scratch::timed();
        let timed = |p: &PairOutcome| {
            if p.outcome.counters.primitives == 0 {
                return None;
            }
            let query = self.query(p, contact::DEFAULT_CELL_LIMIT)?;
            let once = |_| {
                contact::earliest_contact(&query, &mut scratch);
                scratch.take_clock()
            };
            (0..ASKED).filter_map(once).min_by_key(Clock::total)
        };
        outcome.pairs.iter().map(timed).collect()
    }

    /// What the step asked of a pair.
    fn query(&self, p: &PairOutcome, cell_limit: u64) -> Option<PairQuery<'_>> {
        let side = |id: u32| {
            let body = self.world.body(id)?;
            let discrete = p.plan.detect == Detect::Discrete;
            let motion = if discrete { Motion::resting(body.motion_state.end) } else { body.motion_state.motion };
            Some(PlacedModel { model: &body.part.model, placed: Placed { place: body.place, motion } })
        };
        let (a, b) = (side(p.a)?, side(p.b)?);
        Some(PairQuery {
            a,
            b,
            resolution: p.outcome.resolution,
            cell_limit,
            strategies: Strategies::default(),
            query_options: p.plan.query_options(),
        })
    }
}

/// How often a pair is asked for its times: the first one also pays for memory and caches.
const ASKED: usize = 5;

/// Cells that one certificate may have: a hundred megabytes of text.
const CERTIFICATE_CELLS: u64 = 200_000;
