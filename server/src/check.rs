//! One step of a scene file in this process, without a server: the same world and the same records that a session has.
//!
//! Object ids are the objects' indices in the file. Every pair that the rules allow is told, clear ones too, in the order
//! (time, a, b); with `first` only those whose bracket meets the earliest contact's.

use crate::contact::{Body, Ideas, PairQuery, certificate};
use crate::eco::Model;
use crate::import::Scene;
use crate::motion::Placed;
use crate::world::{ObjectSpec, Part, Refusal, StepError, StepOptions, StepOutcome, World};
use contactd_proto::{Detect, PoseRecord};
use std::sync::Arc;

/// Why a scene that was read cannot be stepped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CheckError {
    /// An object, a rule or the resolution.
    #[error("{file}: {refusal}")]
    World {
        /// The scene's file.
        file: String,
        /// The world's reason.
        refusal: Refusal,
    },
    /// An object's motion.
    #[error("{file}: object \"{object}\": {error}")]
    Step {
        /// The scene's file.
        file: String,
        /// The object; empty when it is the step as a whole.
        object: String,
        /// The world's reason.
        error: StepError,
    },
}

/// A scene as a world with the records of its step.
#[derive(Debug)]
pub struct Check {
    /// The world before the step, object ids in file order.
    pub world: World,
    /// The step: one record for every object that moves.
    pub records: Vec<PoseRecord>,
    /// Names of the objects that the records move.
    moving: Vec<String>,
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
        let refused = |refusal| CheckError::World { file: scene.file.clone(), refusal };
        let mut parts: Vec<Arc<Part>> = Vec::with_capacity(models.len());
        for model in models {
            let same = parts.iter().find(|p| Arc::ptr_eq(&p.model, model)).cloned();
            parts.push(same.unwrap_or_else(|| Arc::new(Part::new(model.clone()))));
        }
        let count = scene.objects.len();
        let mut world = World::new(count, count);
        world.set_resolution(resolution.or(scene.resolution)).map_err(refused)?;
        let (mut records, mut moving) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (id, o) in (0u32..).zip(&scene.objects) {
            let spec = ObjectSpec {
                id,
                name: o.name.clone(),
                group: o.group.clone(),
                part: parts[o.model].clone(),
                is_static: o.is_static,
                rotates: o.rotates,
                // A speed per second needs the step's duration, which a scene file does not have.
                max_speed: f64::INFINITY,
                place: o.place,
                pose: o.motion.start,
            };
            world.add_object(spec).map_err(refused)?;
            if let Some(record) = o.record {
                records.push(PoseRecord { object: id, ..record });
                moving.push(o.name.clone());
            }
        }
        world.set_rules(scene.rules.clone()).map_err(refused)?;
        Ok(Self { world, records, moving, file })
    }

    /// Takes the step.
    ///
    /// # Errors
    /// What the world refuses of a record.
    pub fn step(&mut self, first: bool) -> Result<&StepOutcome, CheckError> {
        let Self { world, records, moving, file } = self;
        let options = StepOptions { first, clear: true, ..StepOptions::default() };
        world.step(records, &options).map_err(|error| {
            let object = error.index.and_then(|i| moving.get(i as usize)).cloned().unwrap_or_default();
            CheckError::Step { file: file.clone(), object, error }
        })
    }

    /// The certificates of the answers of the step just taken (docs/certificate.md), and how many pairs have none.
    pub fn certificates(&self, outcome: &StepOutcome) -> (String, usize) {
        let (mut text, mut without) = (format!("{}\n", certificate::HEADER), 0);
        for p in &outcome.pairs {
            let [a, b] = [p.a, p.b].map(|id| {
                let body = self.world.body(id)?;
                Some(Body { model: &body.part.model, placed: Placed { place: body.place, motion: body.track.motion } })
            });
            let made = match (a, b) {
                (Some(a), Some(b)) if p.plan.detect != Detect::Discrete => {
                    let query = PairQuery {
                        a,
                        b,
                        resolution: p.outcome.resolution,
                        cell_limit: CERTIFICATE_CELLS,
                        ideas: Ideas::default(),
                        penetration: true,
                    };
                    certificate::certify(&query, &p.outcome)
                }
                _ => None,
            };
            match made {
                Some(made) => made.write((p.a as usize, p.b as usize), &mut text),
                None => without += 1,
            }
        }
        (text, without)
    }
}

/// Cells that one certificate may have: a hundred megabytes of text.
const CERTIFICATE_CELLS: u64 = 200_000;
