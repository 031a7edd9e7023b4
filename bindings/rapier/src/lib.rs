//! Rapier with contactd's contacts: exact solids with real holes, integrated and solved by rapier (`rapier3d-f64`).
//!
//! ```
//! use contactd_rapier::{Coupling, Settings};
//! use rapier3d_f64::prelude::*;
//!
//! let session = contactd::embedded(&contactd::ipc::ServerConfig::default())?;
//! let mut coupling = Coupling::new(session, Settings::default())?;
//! let mut world = coupling.world(Vector::new(0.0, 0.0, -9.81));
//! let plate = coupling.load("plate.csg", "difference() { cube(size = [4, 4, 1], center = true); cylinder(h = 3, r1 = 1, r2 = 1, center = true); }")?;
//! let ball = coupling.load("ball.csg", "sphere(r = 0.5);")?;
//! let plate = coupling.fixed("plate", &plate, &Pose::IDENTITY)?;
//! world.insert_collider(plate, None);
//! let body = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 0.0, 1.5));
//! let (ball, _) = world.insert(body, coupling.moving("ball", &ball)?);
//! for _ in 0..60 {
//!     coupling.step(&mut world)?;
//! }
//! assert!(world.bodies[ball].translation().z < -1.0, "through the hole");
//! # Ok::<(), contactd_client::Error>(())
//! ```
//!
//! # How
//! A collider's shape is a [`Solid`], which names its object in the session. Before rapier's step [`Coupling::prefetch`] sends the
//! poses of all awake solids in one request; the answer's points, reduced and named by [`Manifolds`], go into a table. rapier's
//! narrow phase asks the [`Dispatcher`] pair by pair, on whatever threads, and is answered from the table; ids of points are
//! parry's feature ids, by which the solver finds its impulses of the step before. Shapes of rapier's own meet each other as ever.
//!
//! Bodies rest [`Settings::gap`] apart (rapier's contact skin). Solids that an impact has driven into each other are told by the
//! face they came through, with the depth that they really have there.
//!
//! # Not served
//! A solid meets no shape of rapier's own. Rays and shape casts miss solids; points project to their boxes. Continuous
//! detection and its sub-steps (`ccd_enabled`, `soft_ccd_prediction` beyond [`Settings::prediction`]): what
//! moves through a solid within a step is not stopped. A solid keeps its pose within the collider's body for good, and a fixed one
//! its place. Models are in rapier's unit of length.
#![forbid(unsafe_code)]

mod dispatch;
mod solid;

pub use dispatch::Dispatcher;
pub use glam;
pub use solid::Solid;

use contactd::import::{Facets, Limits, import_csg};
use contactd_client::manifold::Manifolds;
use contactd_client::proto::{Pose as WorldPose, PoseRecord, Report, Rule};
use contactd_client::{Error, MassOptions, MassProperties, Object, Session, Transport};
use dispatch::Table;
use glam::{DQuat, DVec3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::shape::SharedShape;
use rapier3d_f64::prelude::{ColliderBuilder, ColliderSet, NarrowPhase, PhysicsWorld, RigidBodySet};
use solid::vector;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

/// The group of all solids in the session.
const GROUP: &str = "rapier";
/// How long a step may take.
const TIMEOUT: Duration = Duration::from_secs(60);
/// Error of a model's mass that is good enough, as a fraction.
const MASS_TOLERANCE: f64 = 1e-5;

/// Lengths of a coupling, in rapier's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Bodies at rest stand about this far apart. Clearances should be larger.
    pub gap: f64,
    /// rapier is told of points that are no farther apart than this and the gap: what a body may approach in a step.
    pub prediction: f64,
}

impl Default for Settings {
    /// For a scene in metres: a gap of 1 mm, a prediction of 1 cm.
    fn default() -> Self {
        Self { gap: 1e-3, prediction: 1e-2 }
    }
}

/// A model that was loaded.
#[derive(Clone, Debug)]
pub struct Model {
    id: u32,
    bounds: Aabb,
    mass: MassProperties,
}

impl Model {
    /// Volume, centre of mass and inertia at density 1.
    pub fn mass(&self) -> &MassProperties {
        &self.mass
    }
}

/// contactd's contacts for the solids of a rapier world.
#[derive(Debug)]
pub struct Coupling<T: Transport> {
    session: Session<T>,
    settings: Settings,
    table: Arc<RwLock<Table>>,
    manifolds: Manifolds,
    /// By object id.
    objects: Vec<PlacedObject>,
    batch: Vec<u32>,
    /// The answer to a request did not come in time; it is still to come.
    is_in_flight: bool,
    requests: u64,
}

/// An object as it stands.
#[derive(Clone, Copy, Debug)]
struct PlacedObject {
    /// Where rapier has it.
    pose: WorldPose,
    /// The session has it elsewhere.
    is_stale: bool,
}

impl<T: Transport> Coupling<T> {
    /// A coupling over a session of its own; the session's rules are replaced.
    ///
    /// # Errors
    /// `Misuse`: a gap or prediction that is not above 0; those of [`Session::set_rules`].
    pub fn new(mut session: Session<T>, settings: Settings) -> Result<Self, Error> {
        let is_length = |l: f64| l > 0.0 && l.is_finite();
        if !is_length(settings.gap) || !is_length(settings.prediction) {
            return Err(Error::Misuse("expected a gap and a prediction above 0"));
        }
        let mut rule = Rule::new([GROUP.into(), GROUP.into()]);
        rule.report = Report::Patch;
        rule.margin = settings.gap + settings.prediction;
        rule.penetration = true;
        session.set_rules(&[rule])?;
        session.options.details = true;
        Ok(Self {
            session,
            settings,
            table: Arc::default(),
            manifolds: Manifolds::default(),
            objects: Vec::new(),
            batch: Vec::new(),
            is_in_flight: false,
            requests: 0,
        })
    }

    /// An empty world whose narrow phase asks this coupling. Its parameters: the prediction; an allowed error of a quarter of the
    /// gap; no recycling of contacts over steps and no clustering of manifolds, for which points are exact and few enough.
    pub fn world(&self, gravity: Vector) -> PhysicsWorld {
        let mut world = PhysicsWorld { gravity, narrow_phase: self.narrow_phase(), ..PhysicsWorld::default() };
        let p = &mut world.integration_parameters;
        p.normalized_prediction_distance = self.settings.prediction;
        p.normalized_allowed_linear_error = 0.25 * self.settings.gap;
        p.contact_recycling = false;
        p.contact_clustering = false;
        world
    }

    /// A narrow phase that asks this coupling, for worlds put together by hand.
    pub fn narrow_phase(&self) -> NarrowPhase {
        NarrowPhase::with_query_dispatcher(self.dispatcher())
    }

    /// What answers rapier, from the table that each `prefetch` fills; for chains of dispatchers.
    pub fn dispatcher(&self) -> Dispatcher {
        Dispatcher { table: self.table.clone() }
    }

    /// Loads a model from OpenSCAD CSG text, with its mass properties; `name` stands in error sentences.
    ///
    /// # Errors
    /// Those of [`Session::load_model`] and [`Session::mass_properties`].
    pub fn load(&mut self, name: &str, text: &str) -> Result<Model, Error> {
        let id = self.session.load_model(name, text)?.id;
        let options = MassOptions { tolerance: MASS_TOLERANCE, ..MassOptions::default() };
        let mass = self.session.mass_properties(id, &options)?;
        let import = import_csg(name, text, Facets::Auto, &Limits::default());
        let bounds = import.map_err(|e| Error::System(e.to_string()))?.solid.aabb();
        Ok(Model { id, bounds: Aabb::new(vector(bounds.min), vector(bounds.max)), mass })
    }

    /// A collider that stands at `pose` for good; insert it without a body.
    ///
    /// # Errors
    /// Those of [`Session::add_object`].
    pub fn fixed(&mut self, name: &str, model: &Model, pose: &Pose) -> Result<ColliderBuilder, Error> {
        Ok(self.collider(name, model, pose, true)?.position(*pose))
    }

    /// A collider for a body; its mass follows from its density (1 unless set).
    ///
    /// # Errors
    /// Those of [`Session::add_object`].
    pub fn moving(&mut self, name: &str, model: &Model) -> Result<ColliderBuilder, Error> {
        self.collider(name, model, &Pose::IDENTITY, false)
    }

    /// Takes an object out of the session, when its collider has been removed.
    ///
    /// # Errors
    /// Those of [`Session::remove_object`].
    pub fn remove(&mut self, object: u32) -> Result<(), Error> {
        self.session.remove_object(object)
    }

    /// Asks about all solids as they stand, then steps the world.
    ///
    /// # Errors
    /// Those of `prefetch`; the world has not moved then, and the step may be repeated.
    pub fn step(&mut self, world: &mut PhysicsWorld) -> Result<(), Error> {
        self.prefetch(&world.bodies, &world.colliders)?;
        world.step();
        Ok(())
    }

    /// Asks the session about all solids where they stand now, which is where rapier's next step looks for contacts: call it right
    /// before each step. Where all bodies sleep nothing is asked.
    ///
    /// # Errors
    /// Those of [`Session::finish`]; the table stays as it was. After a `Timeout` the next call first waits for the answer that is still
    /// to come.
    pub fn prefetch(&mut self, bodies: &RigidBodySet, colliders: &ColliderSet) -> Result<(), Error> {
        self.batch.clear();
        let mut any = false;
        for (_, collider) in colliders.iter() {
            let Some(solid) = collider.shape().as_shape::<Solid>() else { continue };
            let Some(placed) = self.objects.get_mut(solid.object as usize) else { continue };
            if solid.is_fixed {
                continue;
            }
            let body = collider.parent().and_then(|handle| bodies.get(handle));
            let local = collider.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY);
            let pose = world_pose(&body.map_or(*collider.position(), |b| *b.position() * local));
            let is_active = pose != placed.pose || !body.is_some_and(|b| b.is_sleeping());
            if is_active || placed.is_stale {
                placed.pose = pose;
                self.batch.push(solid.object);
            }
            any |= is_active;
        }
        if !any {
            return Ok(());
        }
        self.ask()?;
        let objects = &self.objects;
        let pose = |id: u32| objects.get(id as usize).map_or(WorldPose::IDENTITY, |o| o.pose);
        self.table.write().unwrap_or_else(PoisonError::into_inner).fill(&self.manifolds, pose);
        Ok(())
    }

    /// The points of the last `prefetch` that was answered, with their ids.
    pub fn manifolds(&self) -> &Manifolds {
        &self.manifolds
    }

    /// How many requests there were.
    pub fn requests(&self) -> u64 {
        self.requests
    }

    /// The session, for its options and models.
    pub fn session(&mut self) -> &mut Session<T> {
        &mut self.session
    }

    fn collider(&mut self, name: &str, model: &Model, pose: &Pose, is_fixed: bool) -> Result<ColliderBuilder, Error> {
        let pose = world_pose(pose);
        let object = Object::new(name, model.id).group(GROUP).at(pose);
        let object = self.session.add_object(if is_fixed { object.fixed() } else { object })?;
        // Ids count up from 1.
        let nowhere = PlacedObject { pose, is_stale: !is_fixed };
        self.objects.resize(object as usize + 1, nowhere);
        let solid = Solid { object, is_fixed, bounds: model.bounds, mass: model.mass };
        Ok(ColliderBuilder::new(SharedShape::new(solid)).contact_skin(0.5 * self.settings.gap))
    }

    /// One request for the batch.
    fn ask(&mut self) -> Result<(), Error> {
        if self.is_in_flight {
            // Of no use any more; whatever else it may be than late, it is over.
            if let Err(Error::Timeout) = self.session.finish(TIMEOUT) {
                return Err(Error::Timeout);
            }
            self.is_in_flight = false;
        }
        let slots = self.session.begin_step(self.batch.len())?;
        for (slot, object) in slots.iter_mut().zip(&self.batch) {
            let placed = &mut self.objects[*object as usize];
            *slot = PoseRecord::start(*object, &placed.pose);
            placed.is_stale = true;
        }
        self.requests += 1;
        let reply = match self.session.finish(TIMEOUT) {
            Ok(reply) => reply,
            Err(e) => {
                self.is_in_flight = e == Error::Timeout;
                return Err(e);
            }
        };
        // Not before there is an answer: without one, what is kept stays that of the last step.
        self.manifolds.start();
        for object in &self.batch {
            self.objects[*object as usize].is_stale = false;
        }
        for record in reply.records() {
            let [a, b] = [record.a, record.b].map(|id| self.objects[id as usize].pose);
            self.manifolds.add(&reply, record, &a, &b);
        }
        self.manifolds.finish();
        Ok(())
    }
}

fn world_pose(pose: &Pose) -> WorldPose {
    let rotation = DQuat::from_array(pose.rotation.to_array()).normalize();
    WorldPose::new(DVec3::from_array(pose.translation.to_array()), rotation)
}
