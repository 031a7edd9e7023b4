//! A frame: look, impacts, solve, propose, go; again with what is left of the time.

use super::body::Twist;
use super::contacts::{self, Reading};
use super::report::Frame;
use super::solver::Ends;
use super::{Point, World, arc, impact};
use crate::{Error, Transport};
use contactd_proto::contact_record::{CONTACT, ContactRecord, SENSOR, UNDECIDED};
use contactd_proto::{Motion, MotionState, Pose, PoseRecord};
use glam::DVec3;

/// Most chords proposed to find where an arc meets; the last one is taken where it stops.
const CHORDS: u32 = 12;
/// Most times that a chord is lifted over a hollow surface, or a contact added that no look told.
const MENDS: u32 = 24;
/// Normals with a larger cosine are those of one contact.
const ALIKE: f64 = 0.999;
/// Before this fraction of a motion its depth says nothing of how it goes on.
const SOON: f64 = 1e-3;
/// Steepest lift of a chord, as a share of the speed: half the angle by which a surface may turn under a body in a sub-step.
const LIFT: f64 = 0.05;
/// Largest sag of a motion that is taken, as a share of the resolution.
const SAG: f64 = 1e-3;
/// What is left of a frame below this share of it is nothing.
const DONE: f64 = 1e-12;

/// Where a proposal stops.
#[derive(Clone, Copy, Debug)]
struct Stop {
    record: ContactRecord,
    bodies: [usize; 2],
    /// Fraction of the motion that can be taken.
    at: f64,
    /// A point of the resolution's depth exists then.
    deep: f64,
}

/// What becomes of a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mend {
    /// An impact lies ahead.
    Impact,
    /// The problem was mended: solve it again.
    Again,
    /// Solve it for this time.
    Shorter(f64),
}

impl Stop {
    fn meeting(&self) -> arc::Meeting {
        arc::Meeting {
            bodies: self.bodies,
            point: DVec3::from_array(self.record.point),
            normal: DVec3::from_array(self.record.normal),
            at: self.at,
        }
    }
}

impl<T: Transport> World<T> {
    /// A frame of contacts and impulses.
    pub(super) fn stepped(&mut self, frame: &mut Frame) -> Result<(), Error> {
        let dt = self.settings.dt;
        let mut left = dt;
        while left > DONE * dt {
            if frame.substeps == self.settings.substeps {
                frame.left_over += left;
                break;
            }
            self.look(frame)?;
            self.strike(left, frame);
            let taken = self.go(left, frame)?;
            frame.substeps += 1;
            frame.simulated += taken;
            left -= taken;
        }
        Ok(())
    }

    /// Asks where bodies touch now; groups sleep or wake by the answer.
    fn look(&mut self, frame: &mut Frame) -> Result<(), Error> {
        if !self.known {
            self.ask(frame)?;
            if let Some(sleep) = self.settings.effects.sleep {
                for i in &self.contacts.stirred {
                    self.entries[*i].still = 0;
                }
                if self.islands.update(&mut self.entries, &self.contacts.links, &sleep) {
                    // Contacts between sleepers were left out: the same answer again.
                    self.ask(frame)?;
                }
            }
            self.known = true;
        } else if let Some(sleep) = self.settings.effects.sleep {
            self.islands.update(&mut self.entries, &self.contacts.links, &sleep);
        }
        let (closed, friction) = (self.settings.closed, self.settings.effects.friction);
        for p in &mut self.contacts.points {
            p.prepare(&self.entries, closed, friction);
        }
        Ok(())
    }

    fn ask(&mut self, frame: &mut Frame) -> Result<(), Error> {
        frame.looks += 1;
        self.session.begin_step(0)?;
        self.question(false);
        let reply = self.session.finish(self.settings.timeout)?;
        let reading = Reading { index: &self.index, entries: &self.entries, closed: self.settings.closed };
        self.contacts.read(&reply, &reading, frame);
        self.taken = 1.0;
        Ok(())
    }

    /// Sets what is asked of the engine's next step.
    fn question(&mut self, first: bool) {
        let o = &mut self.session.options;
        (o.advance, o.dt, o.first, o.details, o.clear) = (self.taken, self.settings.dt, first, first, false);
    }

    /// Impacts: at closed points, and at points that would close too early within `t` seconds.
    fn strike(&mut self, t: f64, frame: &mut Frame) {
        let s = self.settings;
        let law = impact::Law {
            threshold: s.effects.restitution.map(|r| r.threshold),
            friction: s.effects.friction,
            still: s.still(),
            time: t,
            slow: s.margin / s.dt,
            ends: Ends { speed: 0.1 * s.still(), iterations: (s.iterations / 10).max(1) },
        };
        let points = &mut self.contacts.points;
        if let Some(done) = impact::solve(points, &mut self.entries, &law, &mut self.impacts) {
            frame.impacts += 1;
            frame.points += done.points;
            frame.counters.restitution += done.rebounds;
            frame.counters.friction += if law.friction { done.points } else { 0 };
            frame.tamed += u64::from(done.tamed);
            frame.iterations += done.solved.iterations;
            frame.residual = frame.residual.max(done.solved.residual);
            frame.unconverged += u64::from(!done.solved.converged);
        }
    }

    /// Moves the world by up to `left` seconds, to the next contact; returns the seconds taken.
    fn go(&mut self, left: f64, frame: &mut Frame) -> Result<f64, Error> {
        let tolerance = SAG * self.settings.resolution;
        let mut t = left;
        let (mut chords, mut mends) = (0, 0);
        loop {
            self.plan(t, frame);
            let got = self.propose(t, frame)?;
            let Some(stop) = got else {
                self.take(1.0);
                return Ok(t);
            };
            if mends < MENDS && stop.record.status == CONTACT {
                mends += 1;
                match self.mend(&stop, t, frame) {
                    Mend::Impact => {}
                    Mend::Again => {
                        self.undo();
                        continue;
                    }
                    Mend::Shorter(shorter) => {
                        t = shorter;
                        self.undo();
                        continue;
                    }
                }
            }
            chords += 1;
            let sag = arc::sag(&self.entries, t, stop.at);
            if chords >= CHORDS || stop.record.status == UNDECIDED || sag <= tolerance {
                // Bodies stop a little before they meet.
                let back = self.settings.skin() / stop.record.normal_speed.max(f64::MIN_POSITIVE);
                let at = (stop.at - back).max(0.5 * stop.at);
                self.take(at);
                return Ok(at * t);
            }
            t = arc::meeting(&self.entries, &stop.meeting(), t, self.settings.skin());
            self.undo();
        }
    }

    /// Sends the plans; where they stop, if they do.
    fn propose(&mut self, t: f64, frame: &mut Frame) -> Result<Option<Stop>, Error> {
        let count = self.entries.iter().filter(|e| e.plan.moves).count();
        if count == 0 {
            return Ok(None);
        }
        frame.proposals += 1;
        frame.sent += count as u64;
        let slots = self.session.begin_step(count)?;
        for (slot, e) in slots.iter_mut().zip(self.entries.iter_mut().filter(|e| e.plan.moves)) {
            *slot = PoseRecord::turn(e.id, e.pose.position + e.plan.mean.v * t, e.plan.mean.w * t);
            if let Ok(order) = slot.decode() {
                e.motion_state = MotionState::ordered(e.pose, order);
            }
        }
        // An overlap meets first, always: the others are then searched to their ends.
        self.question(self.contacts.overlaps.is_empty());
        self.session.options.details = true;
        let reply = self.session.finish(self.settings.timeout)?;
        let reading = Reading { index: &self.index, entries: &self.entries, closed: self.settings.closed };
        let mut stop: Option<Stop> = None;
        for record in reply.records() {
            let Some(bodies) = reading.bodies(record) else { continue };
            let free = bodies.iter().any(|i| self.entries[*i].kind == super::body::BodyKind::Free);
            let at = match record.status {
                CONTACT if record.flags & SENSOR != 0 => {
                    frame.sensed += 1;
                    continue;
                }
                CONTACT if free && contacts::acts(record) => record.time,
                UNDECIDED if free && record.flags & SENSOR == 0 => {
                    frame.undecided += 1;
                    record.time_lower
                }
                _ => continue,
            };
            if stop.is_none_or(|s| at < s.at) {
                let deep = reply.detail(record).map_or(at, |d| d.time_upper);
                stop = Some(Stop { record: *record, bodies, at, deep });
            }
        }
        Ok(stop)
    }

    /// A contact that is none of its own but belongs to the solve. One that comes slowly gets a point of its own, to which the
    /// motion may go and no further, and so does an impact that has no way left to go. One at a point that the solve had in
    /// hand means that its chord cuts into a hollow surface, or that a rim rolls and dips: the chord is lifted, or
    /// shortened where it would have to be lifted steeply.
    fn mend(&mut self, stop: &Stop, t: f64, frame: &mut Frame) -> Mend {
        let s = self.settings;
        let at = DVec3::from_array(stop.record.point);
        let normal = DVec3::from_array(stop.record.normal);
        let back = stop.at * t;
        let speed: f64 = stop.bodies.iter().map(|i| self.entries[*i].reach_speed(at)).sum();
        let stuck = back * speed <= 2.0 * s.skin();
        // Where the point is now on each body, and how fast they close in there.
        let [a, b] = stop.bodies.map(|i| {
            let e = &self.entries[i];
            let arm = at - (e.pose.position + e.plan.mean.v * back);
            let now = at - e.plan.mean.at(arm) * back;
            (now, e.now.at(now - e.pose.position))
        });
        let [e, f] = stop.bodies.map(|i| self.entries[i].restitution);
        let fast = (a.1 - b.1).dot(normal) > s.slow(e.max(f));
        if fast && !stuck {
            return Mend::Impact;
        }
        let reach = s.margin + 2.0 * back * speed;
        let near = |p: &Point| {
            p.bodies == stop.bodies
                && p.row.active
                && p.normal.dot(normal) > ALIKE
                && p.position.distance_squared(at) <= reach * reach
        };
        if fast || !self.contacts.points.iter().any(near) {
            let gap = if fast { 0.0 } else { (b.0 - a.0).dot(normal).max(0.0) };
            let position = (a.0 + b.0) * 0.5;
            let mut point = Point { bodies: stop.bodies, position, normal, gap, ..Point::default() };
            point.prepare(&self.entries, s.closed, s.effects.friction);
            self.contacts.points.push(point);
            frame.added += 1;
            self.strike(t, frame);
            return Mend::Again;
        }
        // The chord's depth grows with the square of time, and is the resolution at `deep`.
        let depth = if stop.deep > SOON { s.resolution / (stop.deep * stop.deep) } else { 4.0 * s.resolution };
        let was = self.contacts.points.iter().filter(|p| near(p)).map(|p| p.row.lift).fold(0.0, f64::max);
        let lift = (1.05 * depth / t).max(2.0 * was);
        let most = s.slow(0.0).max(LIFT * speed);
        if lift > most && !stuck {
            return Mend::Shorter(0.9 * t * most / lift);
        }
        self.contacts.points.iter_mut().filter(|p| near(p)).for_each(|p| p.row.lift = lift.min(speed));
        frame.lifts += 1;
        Mend::Again
    }

    /// Takes the fraction `s` of the proposed motions.
    fn take(&mut self, s: f64) {
        self.known &= !self.entries.iter().any(|e| e.plan.moves);
        if !self.known {
            self.taken = s;
        }
        for e in &mut self.entries {
            if e.plan.moves {
                e.pose = e.motion_state.at(s);
            }
            if !e.is_active() {
                continue;
            }
            if s == 1.0 {
                (e.now.v, e.momentum) = (e.plan.end.v, e.plan.momentum);
            } else {
                e.now.v += (e.plan.end.v - e.now.v) * s;
                e.momentum += (e.plan.momentum - e.momentum) * s;
            }
            e.refresh();
        }
    }

    /// Goes back to where the proposed motions began, as the engine will.
    fn undo(&mut self) {
        self.taken = 0.0;
        for e in self.entries.iter_mut().filter(|e| e.plan.moves) {
            e.pose = e.motion_state.at(0.0);
        }
    }

    /// A frame of springs alone: bodies are put where they go, and the engine is asked how deep they overlap there.
    pub(super) fn sprung(&mut self, frame: &mut Frame) -> Result<(), Error> {
        let t = self.settings.dt;
        let count = self.entries.iter().filter(|e| e.plan.moves).count();
        frame.looks += 1;
        frame.sent += count as u64;
        let slots = self.session.begin_step(count)?;
        for (slot, e) in slots.iter_mut().zip(self.entries.iter().filter(|e| e.plan.moves)) {
            *slot = PoseRecord::start(e.id, &e.pose);
        }
        self.question(false);
        let reply = self.session.finish(self.settings.timeout)?;
        let reading = Reading { index: &self.index, entries: &self.entries, closed: self.settings.closed };
        self.contacts.read(&reply, &reading, frame);
        self.contacts.points.clear();
        (self.taken, self.known) = (1.0, false);
        self.plan(t, frame);
        for e in &mut self.entries {
            if e.plan.moves {
                let Twist { v, w } = e.plan.mean;
                let motion = Motion::turning(e.pose, e.pose.position + v * t, w * t);
                e.pose = Pose::new(e.pose.position + v * t, motion.at(1.0).rotation);
                e.motion_state = MotionState::resting(e.pose);
            }
            if e.is_active() {
                (e.now.v, e.momentum) = (e.plan.end.v, e.plan.momentum);
                e.refresh();
            }
        }
        frame.substeps += 1;
        frame.simulated += t;
        Ok(())
    }
}
