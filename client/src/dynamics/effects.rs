//! The effects of a scene, each a switch, and how often each was computed.

use glam::DVec3;

/// What a scene calls for. `None` or `false`: not computed at all. All are off by default: bodies then fly straight on, and
/// where they meet they part or stop without rebound and without friction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effects {
    /// Acceleration of every free body, length/s².
    pub gravity: Option<DVec3>,
    /// Rebound at impacts.
    pub restitution: Option<Restitution>,
    /// Coulomb friction with the coefficients of the two bodies.
    pub friction: bool,
    /// Damping of free bodies.
    pub damping: Option<Damping>,
    /// Bodies in contact that hardly move stand still.
    pub rest: Option<Rest>,
    /// Groups of bodies that touch and have stood still leave the computation until something touches them.
    pub sleep: Option<Sleep>,
    /// Springs where bodies overlap.
    pub penalty: Option<Penalty>,
}

impl Effects {
    /// What lies, slides and topples on the ground calls for: gravity, friction, rest below 1e-7 and sleep below 1e-3
    /// length/s for 60 frames.
    pub fn on_the_ground(gravity: DVec3) -> Self {
        Self {
            gravity: Some(gravity),
            friction: true,
            rest: Some(Rest { speed: 1e-7 }),
            sleep: Some(Sleep { speed: 1e-3, frames: 60 }),
            ..Self::default()
        }
    }
}

/// Rebound: a point that meets faster than the threshold leaves at the larger coefficient of its two bodies times that speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Restitution {
    /// Slower impacts have no rebound, length/s. Keep it above what gravity makes in a frame, or balls bounce for ever.
    pub threshold: f64,
}

/// Damping: velocities are divided by 1 + rate · time (implicit, so that no rate is too large).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damping {
    /// Of velocity, 1/s.
    pub linear: f64,
    /// Of angular momentum, 1/s.
    pub angular: f64,
}

/// Resting: a body that touches another one and is slower than this, before and after a solve, stands still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// Length/s, of the origin and of a point at the radius of gyration.
    pub speed: f64,
}

/// Sleeping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sleep {
    /// Slower bodies count as still, length/s.
    pub speed: f64,
    /// Frames for which all bodies of a group must have been still.
    pub frames: u32,
}

/// A spring and a damper along the normal of an overlap: force = stiffness · depth − damping · separation speed, never
/// pulling, taken implicitly over the time of a solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalty {
    /// Force per length.
    pub stiffness: f64,
    /// Force per speed.
    pub damping: f64,
    /// Springs are all there is: nothing stops at contacts, bodies sink in until their springs hold them. Without it
    /// springs act only on pairs that overlap already, which impulses cannot take apart.
    pub instead_of_impulses: bool,
}

/// How often each effect was computed. An effect that is off counts exactly 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Bodies accelerated, one each solve.
    pub gravity: u64,
    /// Points of impacts whose rebound was computed.
    pub restitution: u64,
    /// Points whose tangential directions were set up for friction, one each solve.
    pub friction: u64,
    /// Bodies damped, one each solve.
    pub damping: u64,
    /// Bodies that were held still, one each solve.
    pub rest: u64,
    /// Bodies left out of a frame since they sleep.
    pub sleep: u64,
    /// Springs computed.
    pub penalty: u64,
}

impl std::ops::AddAssign for Counters {
    fn add_assign(&mut self, o: Self) {
        self.gravity += o.gravity;
        self.restitution += o.restitution;
        self.friction += o.friction;
        self.damping += o.damping;
        self.rest += o.rest;
        self.sleep += o.sleep;
        self.penalty += o.penalty;
    }
}
