//! Impacts: closed points at which bodies approach, with and without rebound.
//!
//! Newton's law at all closed points together: v_n⁺ >= −e v_n⁻, friction against the slip that is left. Without friction and
//! with one e this never makes energy; with several it can (T. R. Kane and D. A. Levinson, Dynamics, 1985). Therefore the
//! kinetic energy is looked at: where it grew, the solution without rebound is found too, which never gains, and the
//! largest share of the rebound that keeps the energy is taken between the two: impulses stay in their cones and
//! bodies apart, since both sets are convex.

use super::body::{BodyKind, Entry, Twist};
use super::contacts::Point;
use super::solver::{self, Ends, Scratch, Solved};
use glam::DVec3;

/// Rebound of the scene: slower points have none. `None`: no point has any.
pub type Threshold = Option<f64>;

/// What an impact needs beside the points.
#[derive(Clone, Copy, Debug)]
pub struct Law {
    /// Rebound.
    pub threshold: Threshold,
    /// Friction is on.
    pub friction: bool,
    /// Slower approaches are none.
    pub still: f64,
    /// The time ahead: slow points that are not closed yet may not close sooner.
    pub time: f64,
    /// What is slow where nothing rebounds.
    pub slow: f64,
    /// Where solves end.
    pub ends: Ends,
}

/// What an impact did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Impact {
    /// How its solves ended, added up.
    pub solved: Solved,
    /// Points solved.
    pub points: u64,
    /// Points whose rebound was computed.
    pub rebounds: u64,
    /// The rebound was cut to keep the energy.
    pub tamed: bool,
}

/// Memory of the impacts.
#[derive(Debug, Default)]
pub struct Memory {
    twists: Vec<Twist>,
    /// Changes of momentum of each body: of the solve, and of the one without rebound.
    changes: Vec<[DVec3; 2]>,
    plain: Vec<[DVec3; 2]>,
    scratch: Scratch,
}

/// Solves the impacts of this moment, if there are any, and gives the bodies their new velocities.
pub fn solve(points: &mut [Point], entries: &mut [Entry], law: &Law, memory: &mut Memory) -> Option<Impact> {
    let Memory { twists, changes, plain, scratch } = memory;
    let now = |twists: &mut Vec<Twist>, entries: &[Entry]| {
        twists.clear();
        twists.extend(entries.iter().map(|e| e.now));
    };
    now(twists, entries);
    // What an open point may come by: it is braked if it comes slowly, and met if it comes fast.
    let brakes = |p: &Point, parting: f64| {
        let slow = law.threshold.filter(|_| p.row.restitution > 0.0).map_or(law.slow, |t| law.slow.min(t));
        parting >= -slow && parting < -p.gap / law.time
    };
    let any = |p: &Point| {
        let parting = p.parting(twists);
        p.row.normal_gain() > 0.0 && if p.row.closed { parting < -law.still } else { brakes(p, parting) }
    };
    if !points.iter().any(any) {
        return None;
    }
    let mut impact = Impact::default();
    for p in points.iter_mut() {
        let row = p.row;
        let parting = p.parting(twists);
        p.row.active = row.normal_gain() > 0.0 && (row.closed || brakes(p, parting));
        p.row.impulse = DVec3::ZERO;
        p.row.target = if row.closed { 0.0 } else { -p.gap / law.time };
        impact.points += u64::from(p.row.active);
        if let Some(threshold) = law.threshold
            && p.row.active
            && row.closed
        {
            let approach = -parting;
            if approach > threshold {
                impact.rebounds += 1;
                p.row.target = row.restitution * approach;
            }
        }
    }
    let mut run = |points: &mut [Point], twists: &mut [Twist], changes: &mut Vec<[DVec3; 2]>, entries: &[Entry]| {
        let s = solver::solve(points, entries, twists, law.friction, law.ends, scratch);
        impact.solved.iterations += s.iterations;
        impact.solved.residual = impact.solved.residual.max(s.residual);
        impact.solved.converged = s.converged;
        changes.clear();
        changes.resize(entries.len(), [DVec3::ZERO; 2]);
        points.iter().filter(|p| p.row.active).for_each(|p| p.add_to(changes));
    };
    run(points, twists, changes, entries);
    if points.iter().any(|p| p.row.active && p.row.target > 0.0) {
        let gain = gained(entries, changes, None, 1.0);
        let size: f64 = entries.iter().map(Entry::kinetic).sum();
        if gain > 1e-12 * size {
            impact.tamed = true;
            now(twists, entries);
            for p in points.iter_mut() {
                (p.row.impulse, p.row.target) = (DVec3::ZERO, p.row.target.min(0.0));
            }
            run(points, twists, plain, entries);
            let share = largest_share(entries, plain, changes);
            for (c, p) in changes.iter_mut().zip(plain.iter()) {
                *c = [p[0] + (c[0] - p[0]) * share, p[1] + (c[1] - p[1]) * share];
            }
        }
    }
    for (e, c) in entries.iter_mut().zip(changes.iter()).filter(|(e, _)| e.is_active()) {
        e.now.v += c[0] * e.inverse_mass;
        e.momentum += c[1];
        e.now.w = e.inverse_inertia * e.momentum;
    }
    Some(impact)
}

/// Energy that changes of momentum bring, Σ p·v + ½ p²/m and the same of rotation; `from` and `share`: between two changes.
fn gained(entries: &[Entry], changes: &[[DVec3; 2]], from: Option<&[[DVec3; 2]]>, share: f64) -> f64 {
    let mut sum = 0.0;
    for (i, e) in entries.iter().enumerate().filter(|(_, e)| e.kind == BodyKind::Free && !e.asleep) {
        let [mut p, mut l] = changes[i];
        if let Some(from) = from {
            p = from[i][0] + (p - from[i][0]) * share;
            l = from[i][1] + (l - from[i][1]) * share;
        }
        sum += p.dot(e.now.v + p * (0.5 * e.inverse_mass)) + l.dot(e.now.w + e.inverse_inertia * l * 0.5);
    }
    sum
}

/// The largest share of the way from `plain` to `changes` that gains no energy: the gain is convex along it, <= 0 at its
/// beginning and above 0 at its end.
fn largest_share(entries: &[Entry], plain: &[[DVec3; 2]], changes: &[[DVec3; 2]]) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if gained(entries, changes, Some(plain), middle) <= 0.0 { low = middle } else { high = middle }
    }
    low
}
