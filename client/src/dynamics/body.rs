//! A body of the loop: what it is, and where and how fast it is.

use super::{Inertia, spin};
use crate::Object;
use contactd_proto::{MotionState, Pose};
use glam::{DMat3, DVec3};

/// A body to be added to a world: an object with what physics needs of it.
#[derive(Clone, Debug)]
pub struct Body {
    pub(super) object: Object,
    pub(super) pose: Pose,
    pub(super) inertia: Option<Inertia>,
    pub(super) driven: bool,
    pub(super) velocity: DVec3,
    pub(super) omega: DVec3,
    pub(super) friction: f64,
    pub(super) restitution: f64,
}

impl Body {
    /// A body that moves as forces tell. Where the model's centre of mass is not its origin, give the object a `place`.
    pub fn new(object: Object, inertia: Inertia) -> Self {
        Self::of(object, Some(inertia))
    }

    /// A body that never moves.
    pub fn fixed(object: Object) -> Self {
        Self::of(object.fixed(), None)
    }

    /// A body that moves at the velocities it is given and that nothing turns aside.
    pub fn driven(object: Object) -> Self {
        Self { driven: true, ..Self::of(object, None) }
    }

    fn of(object: Object, inertia: Option<Inertia>) -> Self {
        Self {
            object,
            pose: Pose::IDENTITY,
            inertia,
            driven: false,
            velocity: DVec3::ZERO,
            omega: DVec3::ZERO,
            friction: 0.5,
            restitution: 0.0,
        }
    }

    /// Where it starts: the pose of its centre of mass.
    pub fn at(mut self, pose: Pose) -> Self {
        self.pose = pose;
        self
    }

    /// Its velocity (length/s) and angular velocity (rad/s, world axes) at the start.
    pub fn moving(mut self, velocity: DVec3, omega: DVec3) -> Self {
        (self.velocity, self.omega) = (velocity, omega);
        self
    }

    /// Coefficient of friction µ; a pair has √(µ₁ µ₂). Default 0.5.
    pub fn friction(mut self, mu: f64) -> Self {
        self.friction = mu;
        self
    }

    /// Coefficient of restitution, 0..1; a pair has the larger one. Default 0.
    pub fn restitution(mut self, e: f64) -> Self {
        self.restitution = e;
        self
    }
}

/// Where a body is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Pose of its centre of mass.
    pub pose: Pose,
    /// Velocity, length/s.
    pub velocity: DVec3,
    /// Angular velocity of this moment, rad/s, world axes.
    pub omega: DVec3,
    /// Angular momentum about its centre of mass, world axes; zero for bodies without mass.
    pub momentum: DVec3,
    /// True while it sleeps.
    pub asleep: bool,
}

/// How a body answers to impulses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// Never moves.
    Fixed,
    /// Moves as told.
    Driven,
    /// Moves as forces tell.
    Free,
}

/// Velocity of a body: of its origin, and about it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Length/s.
    pub v: DVec3,
    /// rad/s, world axes.
    pub w: DVec3,
}

impl Twist {
    /// Velocity of a point at `r` from the origin.
    pub fn at(&self, r: DVec3) -> DVec3 {
        self.v + self.w.cross(r)
    }

    /// The larger of the speeds of the origin and of a point at `radius`.
    pub fn speed(&self, radius: f64) -> f64 {
        self.v.length().max(self.w.length() * radius)
    }
}

/// A body within the loop.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Id of its object.
    pub id: u32,
    /// What moves it.
    pub kind: BodyKind,
    /// Mass properties; those of a unit ball where none count.
    pub inertia: Inertia,
    /// Inverse of the tensor in its own frame.
    pub inverse: DMat3,
    /// Radius of gyration.
    pub radius: f64,
    /// Coefficient of friction.
    pub friction: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
    /// Its motion as the engine has it.
    pub motion_state: MotionState,
    /// Where it stands.
    pub pose: Pose,
    /// Its velocity now.
    pub now: Twist,
    /// Angular momentum; zero unless free.
    pub momentum: DVec3,
    /// 1/mass as impulses see it: 0 for all that they do not move.
    pub inverse_mass: f64,
    /// Inverse tensor in the world as impulses see it.
    pub inverse_inertia: DMat3,
    /// Left out until something touches it.
    pub asleep: bool,
    /// Frames for which it has been still.
    pub still: u32,
    /// What a solve proposes for it.
    pub plan: Plan,
}

/// A body's motion until the end of a solve's time, if nothing stops it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plan {
    /// Constant velocities of the motion.
    pub mean: Twist,
    /// Velocities at its end.
    pub end: Twist,
    /// Angular momentum at its end.
    pub momentum: DVec3,
    /// How much of the way has been accounted for where the motion is lifted.
    pub shift: DVec3,
    /// It is in the batch.
    pub moves: bool,
    /// It touches something at a closed point.
    pub touches: bool,
}

impl Entry {
    pub(super) fn new(id: u32, body: &Body) -> Self {
        let kind = match (body.inertia, body.driven) {
            (Some(_), _) => BodyKind::Free,
            (None, true) => BodyKind::Driven,
            (None, false) => BodyKind::Fixed,
        };
        let inertia = body.inertia.unwrap_or(Inertia::sphere(1.0, 1.0));
        let mut entry = Self {
            id,
            kind,
            inertia,
            inverse: inertia.tensor.inverse(),
            radius: inertia.radius(),
            friction: body.friction,
            restitution: body.restitution,
            motion_state: MotionState::resting(body.pose),
            pose: body.pose,
            now: Twist { v: body.velocity, w: body.omega },
            momentum: DVec3::ZERO,
            inverse_mass: 0.0,
            inverse_inertia: DMat3::ZERO,
            asleep: false,
            still: 0,
            plan: Plan::default(),
        };
        if kind == BodyKind::Free {
            let r = body.pose.matrix();
            entry.momentum = r * (inertia.tensor * (r.transpose() * body.omega));
        }
        entry.refresh();
        entry
    }

    /// True for a free body that is awake.
    pub fn is_active(&self) -> bool {
        self.kind == BodyKind::Free && !self.asleep
    }

    /// Speed that no point of the body at the distance of `x` exceeds in its plan.
    pub fn reach_speed(&self, x: DVec3) -> f64 {
        self.plan.mean.v.length() + self.plan.mean.w.length() * x.distance(self.pose.position)
    }

    /// Brings what depends on the pose and on sleeping up to date.
    pub fn refresh(&mut self) {
        if self.is_active() {
            self.inverse_mass = 1.0 / self.inertia.mass;
            self.inverse_inertia = spin::inverse_in_world(&self.inverse, self.pose.rotation);
            self.now.w = self.inverse_inertia * self.momentum;
        } else {
            self.inverse_mass = 0.0;
            self.inverse_inertia = DMat3::ZERO;
        }
    }

    /// Puts it to sleep or wakes it.
    pub fn set_asleep(&mut self, asleep: bool) {
        if self.asleep != asleep {
            self.asleep = asleep;
            if asleep {
                (self.now, self.momentum) = (Twist::default(), DVec3::ZERO);
            }
            self.refresh();
        }
    }

    /// Kinetic energy.
    pub fn kinetic(&self) -> f64 {
        match self.kind {
            BodyKind::Free => {
                let w = spin::inverse_in_world(&self.inverse, self.pose.rotation) * self.momentum;
                0.5 * (self.inertia.mass * self.now.v.length_squared() + self.momentum.dot(w))
            }
            _ => 0.0,
        }
    }

    /// What callers see.
    pub fn state(&self) -> State {
        State { pose: self.pose, velocity: self.now.v, omega: self.now.w, momentum: self.momentum, asleep: self.asleep }
    }
}
