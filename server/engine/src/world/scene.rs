//! The world: bodies by id, rules, resolution, and how they change between steps.

use super::body::{Body, ObjectSpec};
use super::plan::PairPlan;
use super::roster::{Head, Roster, is_within};
use super::state::StepState;
use contactd_proto::{ErrorCode, MotionState, Pose, Rule};
use std::fmt;

/// Why a change of the world was refused; nothing has changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The code.
    pub code: ErrorCode,
    /// Offending index within what was given, if any.
    pub index: Option<u32>,
    /// What exactly was wrong.
    pub detail: String,
}

impl Refusal {
    /// A refusal with its detail.
    pub fn new(code: ErrorCode, detail: impl Into<String>) -> Self {
        Self { code, index: None, detail: detail.into() }
    }

    /// The same, at an index.
    pub fn at(mut self, index: usize) -> Self {
        self.index = Some(index as u32);
        self
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(index) = self.index {
            write!(f, "at index {index}: ")?;
        }
        write!(f, "{}", self.code)?;
        if self.detail.is_empty() { Ok(()) } else { write!(f, ": {}", self.detail) }
    }
}

impl std::error::Error for Refusal {}

/// The scene of one session.
#[derive(Debug)]
pub struct World {
    pub(super) roster: Roster,
    last_id: Option<u32>,
    max_objects: usize,
    /// Smallest primitive dimension and largest default resolution of any body so far.
    smallest: f64,
    coarsest: f64,
    pub(super) state: StepState,
}

impl World {
    /// An empty world that takes at most `max_objects` objects and `max_batch` records a step.
    pub fn new(max_objects: usize, max_batch: usize) -> Self {
        Self {
            roster: Roster::default(),
            last_id: None,
            max_objects,
            smallest: f64::INFINITY,
            coarsest: 0.0,
            state: StepState::new(max_batch),
        }
    }

    /// The bodies in the order of their ids.
    pub fn bodies(&self) -> &[Body] {
        &self.roster.bodies
    }

    /// The body of an id.
    pub fn body(&self, id: u32) -> Option<&Body> {
        self.roster.by_id.get(&id).map(|i| &self.roster.bodies[*i as usize])
    }

    /// The rules in force.
    pub fn rules(&self) -> &[Rule] {
        self.roster.plans.rules()
    }

    /// The plan of a pair of objects; `None` when it is never searched (or an id is unknown).
    pub fn plan_of(&self, a: u32, b: u32) -> Option<&PairPlan> {
        let (a, b) = (self.body(a)?, self.body(b)?);
        if a.id == b.id || (a.is_static && b.is_static) {
            return None;
        }
        self.roster.plans.of([a.group, b.group], [&a.name, &b.name]).map(|plan| self.roster.plans.plan(plan))
    }

    /// Adds an object.
    ///
    /// # Errors
    /// `LimitObjects`; `DuplicateObject` for an id that is not larger than all before; `NotFinite`; `BadNumber` for a
    /// speed that is not positive; `Resolution` when a pair's resolution would swallow a primitive.
    pub fn add_object(&mut self, mut spec: ObjectSpec) -> Result<(), Refusal> {
        let name = format!("object \"{}\"", spec.name);
        if self.roster.bodies.len() >= self.max_objects {
            return Err(Refusal::new(ErrorCode::LimitObjects, format!("the limit is {}", self.max_objects)));
        }
        if self.last_id.is_some_and(|last| spec.id <= last) {
            return Err(Refusal::new(ErrorCode::DuplicateObject, format!("{name}: id {} was used before", spec.id)));
        }
        for (pose, which) in [(&mut spec.place, "place"), (&mut spec.pose, "pose")] {
            *pose = check_pose(pose).map_err(|code| Refusal::new(code, format!("{name}: {which}")))?;
        }
        if spec.max_speed.is_nan() || spec.max_speed <= 0.0 {
            return Err(Refusal::new(ErrorCode::BadNumber, format!("{name}: max_speed must be positive")));
        }
        let smallest = self.smallest.min(spec.part.smallest);
        let coarsest = self.coarsest.max(spec.part.resolution);
        check_resolution(self.roster.resolution, smallest, coarsest)
            .map_err(|e| Refusal { detail: format!("{name}: {}", e.detail), ..e })?;
        (self.smallest, self.coarsest) = (smallest, coarsest);
        self.last_id = Some(spec.id);
        let group = self.roster.plans.group(&spec.group);
        self.roster.by_id.insert(spec.id, self.roster.bodies.len() as u32);
        // What the first search of a mesh would make: no step's time is spent on it.
        if let Some(primitive) = spec.part.model.solid.whole() {
            primitive.shape.geometry().facet_tree();
        }
        let body = Body::new(spec, group);
        self.roster.heads.push(Head::of(&body));
        self.roster.bodies.push(body);
        self.state.extend();
        Ok(())
    }

    /// Removes an object. Its id is not used again.
    ///
    /// # Errors
    /// `UnknownObject`.
    pub fn remove_object(&mut self, id: u32) -> Result<(), Refusal> {
        let Some(index) = self.roster.by_id.remove(&id) else {
            return Err(Refusal::new(ErrorCode::UnknownObject, format!("object id {id}")));
        };
        self.roster.bodies.remove(index as usize);
        self.roster.heads.remove(index as usize);
        for (i, body) in self.roster.bodies.iter().enumerate().skip(index as usize) {
            self.roster.by_id.insert(body.id, i as u32);
        }
        self.forget();
        Ok(())
    }

    /// Replaces the rules.
    ///
    /// # Errors
    /// `BadRule` at the index of a rule with a margin, or another length, that is not finite and >= 0.
    pub fn set_rules(&mut self, rules: Vec<Rule>) -> Result<(), Refusal> {
        for (i, rule) in rules.iter().enumerate() {
            if let Some((field, length)) = rule.effects().bad_length() {
                let detail = format!("a {field} must be a finite length >= 0, not {length}");
                return Err(Refusal::new(ErrorCode::BadRule, detail).at(i));
            }
        }
        self.roster.plans.set(rules);
        self.forget();
        Ok(())
    }

    /// Sets the resolution of every pair; `None`: each pair its default, 1e-9 of the larger bounding radius.
    ///
    /// # Errors
    /// `Resolution` when it is not a positive length well below every primitive's smallest dimension.
    pub fn set_resolution(&mut self, resolution: Option<f64>) -> Result<(), Refusal> {
        if let Some(d) = resolution
            && !(d.is_finite() && d > 0.0)
        {
            return Err(Refusal::new(ErrorCode::Resolution, format!("{d} is not a positive length")));
        }
        check_resolution(resolution, self.smallest, self.coarsest)?;
        self.roster.resolution = resolution;
        self.forget();
        Ok(())
    }

    /// Puts objects on the tracks that they had: the next step continues from there.
    ///
    /// # Errors
    /// `UnknownObject`, `StaticObject`, `NotFinite`, `BadQuaternion`, at the index of the track.
    pub fn restore(&mut self, motion_states: &[(u32, MotionState)]) -> Result<(), Refusal> {
        let mut places = Vec::with_capacity(motion_states.len());
        for (i, (id, motion_state)) in motion_states.iter().enumerate() {
            let Some(index) = self.roster.by_id.get(id) else {
                return Err(Refusal::new(ErrorCode::UnknownObject, format!("object id {id}")).at(i));
            };
            let refuse = |code| Refusal::new(code, format!("object id {id}")).at(i);
            check_pose(&motion_state.motion.start).and(check_pose(&motion_state.end)).map_err(refuse)?;
            if self.roster.bodies[*index as usize].is_static && !motion_state.is_rest() {
                return Err(refuse(ErrorCode::StaticObject));
            }
            places.push(*index);
        }
        for (index, (_, motion_state)) in places.into_iter().zip(motion_states) {
            self.roster.bodies[index as usize].motion_state = *motion_state;
            self.roster.is_astray |= !is_within(motion_state);
        }
        self.forget();
        Ok(())
    }

    /// Gives objects other frames: each is the id, the model in its new frame, and that frame in the world, where the object then rests.
    /// A motion is one of an object's frame, whose origin goes straight while it turns; so what is to turn about an axis needs a frame
    /// that has its origin on it. All of them, or none.
    ///
    /// # Errors
    /// `UnknownObject`, `StaticObject`, `NotFinite`, `BadQuaternion`, at the index of the frame.
    pub fn reframe(&mut self, frames: &[(u32, Pose, Pose)]) -> Result<(), Refusal> {
        let mut checked = Vec::with_capacity(frames.len());
        for (i, (id, place, pose)) in frames.iter().enumerate() {
            let index = self.index_of(*id).map_err(|e| e.at(i))?;
            let refuse = |code| Refusal::new(code, format!("object id {id}")).at(i);
            if self.roster.bodies[index].is_static {
                return Err(refuse(ErrorCode::StaticObject));
            }
            checked.push((index, check_pose(place).map_err(refuse)?, check_pose(pose).map_err(refuse)?));
        }
        for (index, place, pose) in checked {
            self.roster.bodies[index].reframe(place, pose);
        }
        self.forget();
        Ok(())
    }

    /// The frame of `carrier` for an object, where `advance` (0..1) of the last step leaves both: the object's model in that frame,
    /// and the frame.
    ///
    /// # Errors
    /// `UnknownObject`; `BadNumber` for a part of a step that is none.
    pub fn frame_of(&self, object: u32, carrier: u32, advance: f64) -> Result<(Pose, Pose), Refusal> {
        if !(0.0..=1.0).contains(&advance) {
            return Err(Refusal::new(ErrorCode::BadNumber, format!("{advance} of a step")));
        }
        let [object, carrier] = [object, carrier].map(|id| self.index_of(id).map(|i| &self.roster.bodies[i]));
        let (object, frame) = (object?, carrier?.motion_state.at(advance));
        let place = frame.inverse().compose(&object.motion_state.at(advance)).compose(&object.place);
        Ok((place, frame))
    }

    fn index_of(&self, id: u32) -> Result<usize, Refusal> {
        let unknown = || Refusal::new(ErrorCode::UnknownObject, format!("object id {id}"));
        self.roster.by_id.get(&id).map(|index| *index as usize).ok_or_else(unknown)
    }

    /// Forgets what was proven in earlier steps. It changes no answer, only the work of the next ones.
    pub fn forget(&mut self) {
        self.state.forget(&self.roster.bodies, &mut self.roster.heads);
    }

    /// Forgets all that steps keep for each other. From here on the world is as one that was made now, of the same bodies on the same
    /// tracks: its answers are that one's to the bit, also where a limit of work cuts them.
    pub fn renew(&mut self) {
        self.state.renew();
        for head in &mut self.roster.heads {
            head.named = [0; 2];
        }
        self.forget();
    }

    /// The name of a body's group.
    pub fn group_of(&self, body: &Body) -> &str {
        self.roster.plans.group_name(body.group)
    }

    /// The resolution of every pair; `None`: each pair its default.
    pub fn resolution(&self) -> Option<f64> {
        self.roster.resolution
    }
}

/// The pose as a record with a start would set it.
fn check_pose(pose: &Pose) -> Result<Pose, ErrorCode> {
    contactd_proto::pose::check_position(pose.position)?;
    Ok(Pose::new(pose.position, contactd_proto::pose_record::unit_quaternion(pose.rotation.to_array())?))
}

/// A resolution must stay below a quarter of the smallest dimension: deeper than that a primitive has no inside left.
fn check_resolution(fixed: Option<f64>, smallest: f64, coarsest: f64) -> Result<(), Refusal> {
    let resolution = fixed.unwrap_or(coarsest);
    if resolution.is_finite() && smallest <= 4.0 * resolution {
        let detail = format!("resolution {resolution:e} against a primitive of size {smallest:e}");
        return Err(Refusal::new(ErrorCode::Resolution, detail));
    }
    Ok(())
}
