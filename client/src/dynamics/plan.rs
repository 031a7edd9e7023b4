//! The motions of a solve: what forces make of the velocities over a time, and what the contacts allow of it.
//!
//! With velocities v₀ now and v₁ = v₀ + (forces + contact impulses)/m the motion goes at the mean, ½ (v₀ + v₁): the position of a
//! constant acceleration is exact then, and so is the energy (midpoint rule; with contacts: J. J. Moreau's time stepping with
//! θ = ½). Contacts ask v₁ to part: a closed point at 0 or more; one with a gap may use it up within the time.

use super::body::{BodyKind, Entry, Twist};
use super::contacts::Point;
use super::report::Frame;
use super::solver::{self, Ends};
use super::{World, spin};
use crate::Transport;
use glam::DVec3;

/// Share of an overlap beyond half the resolution that a solve takes away.
const RECOVERY: f64 = 0.2;

impl<T: Transport> World<T> {
    /// Fills the plan of every body for the next `t` seconds.
    pub(super) fn plan(&mut self, t: f64, frame: &mut Frame) {
        self.pull(t, frame);
        self.spring(t, frame);
        for e in self.entries.iter_mut().filter(|e| e.is_active()) {
            let plan = &mut e.plan;
            let momentum = (e.momentum + plan.momentum) * 0.5;
            plan.mean.v = (e.now.v + plan.end.v) * 0.5;
            plan.mean.w = spin::angular_velocity(&e.inertia, &e.inverse, e.pose.rotation, momentum, t);
            plan.end.w = plan.mean.w * 2.0 - e.now.w;
        }
        self.hold_contacts(t, frame);
        self.stand_still(frame);
        for e in &mut self.entries {
            e.plan.moves = e.plan.mean != Twist::default();
        }
    }

    /// Gravity and damping.
    fn pull(&mut self, t: f64, frame: &mut Frame) {
        let effects = &self.settings.effects;
        for e in &mut self.entries {
            e.plan.mean = if e.kind == BodyKind::Driven { e.now } else { Twist::default() };
            e.plan.end = e.now;
            e.plan.momentum = e.momentum;
            e.plan.touches = false;
            e.plan.shift = DVec3::ZERO;
            if !e.is_active() {
                continue;
            }
            if let Some(g) = effects.gravity {
                e.plan.end.v += g * t;
                frame.counters.gravity += 1;
            }
            if let Some(d) = effects.damping {
                e.plan.end.v *= 1.0 / (1.0 + d.linear * t);
                e.plan.momentum *= 1.0 / (1.0 + d.angular * t);
                frame.counters.damping += 1;
            }
        }
    }

    /// Springs and dampers of overlaps: the impulse p of the implicit p = t (k (d − t v') − c v'), where
    /// v' = v + p·gain and v is what the other forces make of the speed of parting.
    fn spring(&mut self, t: f64, frame: &mut Frame) {
        let Some(penalty) = self.settings.effects.penalty else { return };
        for o in &self.contacts.overlaps {
            frame.counters.penalty += 1;
            let arms = o.bodies.map(|i| o.position - self.entries[i].pose.position);
            let [a, b] = o.bodies.map(|i| &self.entries[i]);
            let ahead = |e: &Entry| match e.kind {
                BodyKind::Free => Twist { v: e.plan.end.v, w: e.inverse_inertia * e.plan.momentum },
                _ => e.now,
            };
            let parting = (ahead(b).at(arms[1]) - ahead(a).at(arms[0])).dot(o.normal);
            let gain: f64 = [(a, arms[0]), (b, arms[1])]
                .iter()
                .map(|(e, r)| {
                    let lever = r.cross(o.normal);
                    e.inverse_mass + lever.dot(e.inverse_inertia * lever)
                })
                .sum();
            let stiff = penalty.damping + t * penalty.stiffness;
            let p = t * (penalty.stiffness * o.depth - stiff * parting) / (1.0 + t * stiff * gain);
            let p = o.normal * p.max(0.0);
            for (i, arm, sign) in [(o.bodies[0], arms[0], -1.0), (o.bodies[1], arms[1], 1.0)] {
                let e = &mut self.entries[i];
                if e.is_active() {
                    e.plan.end.v += p * (sign * e.inverse_mass);
                    e.plan.momentum += arm.cross(p) * sign;
                }
            }
        }
    }

    /// Impulses at all contact points together.
    fn hold_contacts(&mut self, t: f64, frame: &mut Frame) {
        let s = self.settings;
        let friction = s.effects.friction;
        let Self { contacts, entries, twists, changes, scratch, .. } = self;
        let points = &mut contacts.points;
        if points.is_empty() {
            return;
        }
        twists.clear();
        twists.extend(entries.iter().map(|e| e.now));
        for p in points.iter_mut() {
            let parting = p.parting(twists);
            let row = &mut p.row;
            row.active = row.normal_gain() > 0.0;
            // What comes fast is an impact: it is met, not braked.
            row.active &= row.closed || parting >= -s.slow(row.restitution);
            let out = if row.closed { RECOVERY * (-p.gap - 0.5 * s.resolution).max(0.0) / t } else { -p.gap / t };
            row.out = out;
            row.target = if row.lift > 0.0 { 2.0 * (out + row.lift) - parting } else { out };
            row.impulse = if row.active { p.force * t } else { DVec3::ZERO };
            if row.active {
                frame.points += 1;
                frame.counters.friction += u64::from(friction);
                if row.closed {
                    for i in p.bodies {
                        entries[i].plan.touches = true;
                    }
                }
            }
        }
        twists.clear();
        twists.extend(entries.iter().map(|e| e.plan.end));
        solver::start(points, entries, twists);
        let ends = Ends { speed: 0.1 * s.still(), iterations: s.iterations };
        let mut run = |points: &mut [Point], entries: &[Entry], changes: &mut Vec<[DVec3; 2]>| {
            let solved = solver::solve(points, entries, twists, friction, ends, scratch);
            frame.iterations += solved.iterations;
            frame.residual = frame.residual.max(solved.residual);
            frame.unconverged += u64::from(!solved.converged);
            changes.clear();
            changes.resize(entries.len(), [DVec3::ZERO; 2]);
            points.iter().filter(|p| p.row.active).for_each(|p| p.add_to(changes));
        };
        run(points, entries, changes);
        for (e, [p, l]) in entries.iter_mut().zip(changes.iter()).filter(|(e, _)| e.is_active()) {
            e.plan.mean.v += *p * (0.5 * e.inverse_mass);
            e.plan.mean.w += e.inverse_inertia * *l * 0.5;
        }
        if points.iter().any(|p| p.row.active && p.row.lift > 0.0) {
            // The motion is lifted, the velocity at its end by half of that: so it neither gains nor loses energy on the way
            // through a hollow.
            for p in points.iter_mut().filter(|p| p.row.lift > 0.0) {
                p.row.target = p.row.out + p.row.lift;
            }
            run(points, entries, changes);
        }
        for (e, [p, l]) in entries.iter_mut().zip(changes.iter()).filter(|(e, _)| e.is_active()) {
            e.plan.end.v += *p * e.inverse_mass;
            e.plan.end.w += e.inverse_inertia * *l;
            e.plan.momentum += *l;
        }
        for p in points.iter_mut() {
            p.force = if p.row.active { p.row.impulse / t } else { DVec3::ZERO };
            if p.row.active {
                carry(p, entries, t);
            }
        }
        for p in points.iter().filter(|p| p.row.active && p.row.lift > 0.0) {
            lifted(p, entries, t);
        }
    }

    /// Bodies in contact that hardly move stand still.
    fn stand_still(&mut self, frame: &mut Frame) {
        let Some(rest) = self.settings.effects.rest else { return };
        for e in self.entries.iter_mut().filter(|e| e.is_active() && e.plan.touches) {
            if e.now.speed(e.radius) <= rest.speed && e.plan.end.speed(e.radius) <= rest.speed {
                frame.counters.rest += 1;
                e.plan.mean = Twist::default();
                e.plan.end = Twist::default();
                e.plan.momentum = DVec3::ZERO;
            }
        }
    }
}

/// Moves a point's line of action to the middle of the motion, so that bodies that move on meanwhile keep their angular momentum
/// about the world's origin. Where one body is fixed the point goes along with the other one and nothing changes.
fn carry(p: &Point, entries: &mut [Entry], t: f64) {
    let [a, b] = p.bodies;
    let (u, w) = (entries[a].inverse_mass, entries[b].inverse_mass);
    let along = (entries[a].plan.mean.v * u + entries[b].plan.mean.v * w) / (u + w);
    let impulse = p.impulse();
    for (i, sign) in [(a, -1.0), (b, 1.0)] {
        let e = &mut entries[i];
        if e.is_active() {
            e.plan.momentum += (along - e.plan.mean.v).cross(impulse) * (0.5 * t * sign);
        }
    }
}

/// Two free bodies whose motion is lifted do not go along the mean of their velocities; what that would make of their angular
/// momentum about the world's origin is taken back.
fn lifted(p: &Point, entries: &mut [Entry], t: f64) {
    if p.bodies.iter().any(|i| !entries[*i].is_active()) {
        return;
    }
    for i in p.bodies {
        let e = &mut entries[i];
        let mean = (e.now.v + e.plan.end.v) * 0.5;
        e.plan.momentum -= (e.plan.mean.v * t - e.plan.shift).cross(mean * e.inertia.mass);
        e.plan.shift = e.plan.mean.v * t;
    }
}
