//! The world of the loop: a session, its bodies, the settings.

use super::body::{BodyKind, Entry, Twist};
use super::contacts::Contacts;
use super::islands::Islands;
use super::{Body, Effects, Energy, Frame, Overlap, Point, State, impact, solver};
use crate::{Error, Session, Transport};
use contactd_proto::pose_record::unit_quaternion;
use contactd_proto::{MotionState, Pose, Report, Rule};
use glam::DVec3;
use std::time::Duration;

/// Numbers of the scheme. Lengths in the models' unit, times in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Duration of a frame.
    pub dt: f64,
    /// The engine's resolution for every pair: bodies never overlap by more than twice that.
    pub resolution: f64,
    /// Points are told up to this gap, and solved ahead so that they do not stop the world.
    pub margin: f64,
    /// Points up to this gap are closed: bodies rest on them.
    pub closed: f64,
    /// Most rounds of look, solve, propose in a frame; what is left of the frame then is reported, not simulated.
    pub substeps: u64,
    /// Most sweeps of a solve; a tenth of it for one of impacts, whose rest the next solve takes.
    pub iterations: u32,
    /// How long an answer may take.
    pub timeout: Duration,
    /// What the scene calls for.
    pub effects: Effects,
}

impl Settings {
    /// Settings for bodies of about this size: resolution 1e-9, closed 1e-7, margin 1e-4 of it; no effects.
    pub fn new(dt: f64, size: f64) -> Self {
        Self {
            dt,
            resolution: 1e-9 * size,
            margin: 1e-4 * size,
            closed: 1e-7 * size,
            substeps: 64,
            iterations: 5000,
            timeout: Duration::from_secs(60),
            effects: Effects::default(),
        }
    }

    /// The rule of pairs whose contacts are solved: all their points, within the margin.
    pub fn rule(&self, between: [&str; 2]) -> Rule {
        let mut rule = Rule::new(between.map(String::from));
        rule.report = Report::Patch;
        rule.margin = self.margin;
        rule.penetration = self.effects.penalty.is_some();
        rule
    }

    /// How far from each other bodies stop that meet: an engine's answer is clearest for bodies that do not overlap at all.
    pub(super) fn skin(&self) -> f64 {
        10.0 * self.resolution
    }

    /// Points that come no faster are held without an impact: they need a frame for the margin, and have no rebound.
    pub(super) fn slow(&self, restitution: f64) -> f64 {
        let slow = self.margin / self.dt;
        self.effects.restitution.filter(|_| restitution > 0.0).map_or(slow, |r| slow.min(r.threshold))
    }

    /// Slower than this is no speed: in a hundred thousand frames it does not make the resolution.
    pub(super) fn still(&self) -> f64 {
        1e-5 * self.resolution / self.dt
    }
}

/// Bodies on a session, stepped frame by frame.
#[derive(Debug)]
pub struct World<T: Transport> {
    /// May be changed between frames, but for the resolution, which the session is told once.
    pub settings: Settings,
    pub(super) session: Session<T>,
    pub(super) entries: Vec<Entry>,
    /// Index of a body by its object id.
    pub(super) index: Vec<usize>,
    pub(super) contacts: Contacts,
    pub(super) islands: Islands,
    pub(super) impacts: impact::Memory,
    pub(super) twists: Vec<Twist>,
    pub(super) changes: Vec<[DVec3; 2]>,
    pub(super) scratch: solver::Scratch,
    /// Fraction of the engine's last step that was taken.
    pub(super) taken: f64,
    /// The contacts are those of the present moment.
    pub(super) known: bool,
    total: Frame,
}

impl<T: Transport> World<T> {
    /// A world without bodies. The session's rules become one: all bodies of group "default" among themselves. Scenes with
    /// several groups set their own ([`Settings::rule`]).
    ///
    /// # Errors
    /// As `Session::set_rules` and `Session::set_resolution`.
    pub fn new(mut session: Session<T>, settings: Settings) -> Result<Self, Error> {
        session.set_resolution(Some(settings.resolution))?;
        session.set_rules(&[settings.rule(["default", "default"])])?;
        Ok(Self {
            settings,
            session,
            entries: Vec::new(),
            index: Vec::new(),
            contacts: Contacts::default(),
            islands: Islands::default(),
            impacts: impact::Memory::default(),
            twists: Vec::new(),
            changes: Vec::new(),
            scratch: solver::Scratch::default(),
            taken: 1.0,
            known: false,
            total: Frame::default(),
        })
    }

    /// The session, for models and rules. Objects that are added there are none of the world's, and records of them are not
    /// looked at; steps belong to the world.
    pub fn session(&mut self) -> &mut Session<T> {
        self.known = false;
        &mut self.session
    }

    /// Adds a body; returns its index.
    ///
    /// # Errors
    /// `Misuse` with what is wrong with its numbers; otherwise as `Session::add_object`.
    pub fn add(&mut self, body: Body) -> Result<usize, Error> {
        if let Some(fault) = body.inertia.as_ref().and_then(super::Inertia::fault) {
            return Err(Error::Misuse(fault));
        }
        let coefficients = body.friction >= 0.0 && body.friction.is_finite() && (0.0..=1.0).contains(&body.restitution);
        if !coefficients {
            return Err(Error::Misuse("friction must be >= 0 and finite, restitution within 0..1"));
        }
        if !(body.velocity.is_finite() && body.omega.is_finite()) {
            return Err(Error::Misuse("velocities must be finite"));
        }
        let id = self.session.add_object(body.object.clone().at(body.pose))?;
        let mut entry = Entry::new(id, &body);
        // As the engine keeps it.
        if let Ok(rotation) = unit_quaternion(body.pose.rotation.to_array()) {
            entry.pose.rotation = rotation;
            entry.motion_state = MotionState::resting(entry.pose);
            entry.refresh();
        }
        let at = self.entries.len();
        self.index.resize(self.index.len().max(id as usize + 1), usize::MAX);
        self.index[id as usize] = at;
        self.entries.push(entry);
        self.known = false;
        Ok(at)
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// True without bodies.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Where a body is and how it moves.
    pub fn state(&self, body: usize) -> State {
        self.entries[body].state()
    }

    /// Pose of a body.
    pub fn pose(&self, body: usize) -> Pose {
        self.entries[body].pose
    }

    /// Sets the velocities of a body and wakes it: the only way to move a driven one.
    pub fn set_velocity(&mut self, body: usize, velocity: DVec3, omega: DVec3) {
        let e = &mut self.entries[body];
        if e.kind == BodyKind::Fixed {
            return;
        }
        e.still = 0;
        e.set_asleep(false);
        e.now = Twist { v: velocity, w: omega };
        if e.kind == BodyKind::Free {
            let r = e.pose.matrix();
            e.momentum = r * (e.inertia.tensor * (r.transpose() * omega));
        }
        // Sleepers that it touches may have to wake.
        self.known = false;
    }

    /// The contact points of the last look, with the forces of the last solve.
    pub fn points(&self) -> &[Point] {
        &self.contacts.points
    }

    /// The overlaps of the last look.
    pub fn overlaps(&self) -> &[Overlap] {
        &self.contacts.overlaps
    }

    /// All frames added up.
    pub fn total(&self) -> &Frame {
        &self.total
    }

    /// Energy and momentum of the free bodies; potential energy where gravity is on.
    pub fn energy(&self) -> Energy {
        let g = self.settings.effects.gravity.unwrap_or(DVec3::ZERO);
        let mut sum = Energy::default();
        for e in self.entries.iter().filter(|e| e.kind == BodyKind::Free) {
            let p = e.now.v * e.inertia.mass;
            sum.kinetic += e.kinetic();
            sum.potential -= e.inertia.mass * g.dot(e.pose.position);
            sum.linear += p;
            sum.angular += e.pose.position.cross(p) + e.momentum;
        }
        sum
    }

    /// One frame of `settings.dt`.
    ///
    /// # Errors
    /// Those of a step. The bodies then stand where the engine has them no longer for sure: make the world anew.
    pub fn frame(&mut self) -> Result<Frame, Error> {
        let mut frame = Frame { frames: 1, ..Frame::default() };
        if self.settings.effects.penalty.is_some_and(|p| p.instead_of_impulses) {
            self.sprung(&mut frame)?;
        } else {
            self.stepped(&mut frame)?;
        }
        self.count_still(&mut frame);
        self.total += frame;
        Ok(frame)
    }

    /// Frames until `seconds` have passed; what they did together.
    ///
    /// # Errors
    /// As `frame`.
    pub fn run(&mut self, seconds: f64) -> Result<Frame, Error> {
        let mut sum = Frame::default();
        for _ in 0..(seconds / self.settings.dt).round() as u64 {
            sum += self.frame()?;
        }
        Ok(sum)
    }

    /// Counts for how long bodies have been still.
    fn count_still(&mut self, frame: &mut Frame) {
        let Some(sleep) = self.settings.effects.sleep else { return };
        for e in self.entries.iter_mut().filter(|e| e.kind == BodyKind::Free) {
            if e.asleep {
                frame.counters.sleep += 1;
            } else if e.now.speed(e.radius) <= sleep.speed {
                e.still = e.still.saturating_add(1);
            } else {
                e.still = 0;
            }
        }
    }
}
