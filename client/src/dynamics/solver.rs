//! Impulses at all contact points together.
//!
//! Each point asks for a normal speed of at least its target (Signorini: impulse >= 0, impulse · excess = 0) and, with
//! friction, for a tangential impulse in the disc of radius µ · normal impulse that opposes slip (Coulomb's cone, not a
//! pyramid). Projected Gauss-Seidel (M. Jean and J. J. Moreau, 1992; E. Catto's sequential impulses, GDC 2006) goes over the
//! points there and back; the change of a sweep steers a nonlinear conjugate gradient (M. Silcowitz, S. Niebe, K. Erleben,
//! The Visual Computer 26, 2010), which takes a stack of ten from thousands of sweeps to some dozens.
//!
//! The normal is relaxed by its own effective mass, the tangents by the larger eigenvalue of theirs, so that a point that
//! slips has its friction exactly against the slip.

use super::body::{Entry, Twist};
use super::contacts::Point;
use glam::DVec3;

/// How a solve ended.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solved {
    /// Sweeps there and back.
    pub iterations: u64,
    /// Largest change of a relative speed in the last of them.
    pub residual: f64,
    /// The residual met the tolerance.
    pub converged: bool,
}

/// Where a solve may end.
#[derive(Clone, Copy, Debug)]
pub struct Ends {
    /// Largest change of a relative speed in the last sweep.
    pub speed: f64,
    /// Most sweeps there and back.
    pub iterations: u32,
}

/// Memory of the solves.
#[derive(Debug, Default)]
pub struct Scratch {
    before: Vec<DVec3>,
    way: Vec<DVec3>,
}

impl Point {
    /// Works out what follows from where the bodies stand; tangents only where there is friction.
    pub(super) fn prepare(&mut self, entries: &[Entry], closed: f64, friction: bool) {
        let [a, b] = self.bodies.map(|i| &entries[i]);
        let n = self.normal;
        let row = &mut self.row;
        row.arms = [self.position - a.pose.position, self.position - b.pose.position];
        row.restitution = a.restitution.max(b.restitution);
        row.closed = self.gap <= closed;
        let turn =
            |d: DVec3, arms: &[DVec3; 2]| [a.inverse_inertia * arms[0].cross(d), b.inverse_inertia * arms[1].cross(d)];
        // d·K e for unit impulses along e, felt along d: masses, then both turns.
        let gain = |d: DVec3, e: DVec3, turns: &[DVec3; 2], arms: &[DVec3; 2]| {
            (a.inverse_mass + b.inverse_mass) * d.dot(e)
                + turns[0].cross(arms[0]).dot(d)
                + turns[1].cross(arms[1]).dot(d)
        };
        row.turns[0] = turn(n, &row.arms);
        row.normal_gain = gain(n, n, &row.turns[0], &row.arms);
        if friction {
            row.friction = (a.friction * b.friction).sqrt();
            let (s, t) = n.any_orthonormal_pair();
            row.tangents = [s, t];
            row.turns[1] = turn(s, &row.arms);
            row.turns[2] = turn(t, &row.arms);
            let ss = gain(s, s, &row.turns[1], &row.arms);
            let tt = gain(t, t, &row.turns[2], &row.arms);
            let st = gain(s, t, &row.turns[2], &row.arms);
            row.tangent_gain = 0.5 * (ss + tt) + (0.25 * (ss - tt) * (ss - tt) + st * st).sqrt();
        }
    }

    /// Velocity of the second body's point as the first one's sees it.
    pub(super) fn relative(&self, twists: &[Twist]) -> DVec3 {
        let [a, b] = self.bodies;
        twists[b].at(self.row.arms[1]) - twists[a].at(self.row.arms[0])
    }

    /// Speed at which the surfaces part.
    pub(super) fn parting(&self, twists: &[Twist]) -> f64 {
        self.relative(twists).dot(self.normal)
    }

    /// Sum of its impulse, world axes, on the second body.
    pub(super) fn impulse(&self) -> DVec3 {
        let [s, t] = self.row.tangents;
        self.normal * self.row.impulse.x + s * self.row.impulse.y + t * self.row.impulse.z
    }

    /// Adds its impulse to the changes of momentum (linear, angular) of its bodies.
    pub(super) fn add_to(&self, changes: &mut [[DVec3; 2]]) {
        let [a, b] = self.bodies;
        let p = self.impulse();
        changes[a][0] -= p;
        changes[a][1] -= self.row.arms[0].cross(p);
        changes[b][0] += p;
        changes[b][1] += self.row.arms[1].cross(p);
    }

    /// Changes velocities by an impulse along normal and tangents.
    fn push(&self, d: DVec3, entries: &[Entry], twists: &mut [Twist]) {
        let [a, b] = self.bodies;
        let row = &self.row;
        let mut p = self.normal * d.x;
        let mut turn = [row.turns[0][0] * d.x, row.turns[0][1] * d.x];
        if d.y != 0.0 || d.z != 0.0 {
            p += row.tangents[0] * d.y + row.tangents[1] * d.z;
            for k in 0..2 {
                turn[k] += row.turns[1][k] * d.y + row.turns[2][k] * d.z;
            }
        }
        twists[a].v -= p * entries[a].inverse_mass;
        twists[a].w -= turn[0];
        twists[b].v += p * entries[b].inverse_mass;
        twists[b].w += turn[1];
    }

    /// One relaxation; the change of relative speed that it made.
    fn relax(&mut self, entries: &[Entry], twists: &mut [Twist], friction: bool) -> f64 {
        let was = self.row.impulse;
        let short = self.row.target - self.parting(twists);
        let normal = (was.x + short / self.row.normal_gain).max(0.0);
        self.row.impulse.x = normal;
        if normal != was.x {
            self.push(DVec3::new(normal - was.x, 0.0, 0.0), entries, twists);
        }
        let mut change = (normal - was.x).abs() * self.row.normal_gain;
        if friction {
            let slip = self.relative(twists);
            let [s, t] = self.row.tangents;
            let gain = self.row.tangent_gain;
            let (mut y, mut z) = (was.y - slip.dot(s) / gain, was.z - slip.dot(t) / gain);
            let (length, limit) = ((y * y + z * z).sqrt(), self.row.friction * normal);
            if length > limit {
                let k = limit / length;
                (y, z) = (y * k, z * k);
            }
            (self.row.impulse.y, self.row.impulse.z) = (y, z);
            let d = DVec3::new(0.0, y - was.y, z - was.z);
            if d != DVec3::ZERO {
                self.push(d, entries, twists);
                change = change.max(d.length() * gain);
            }
        }
        change
    }
}

/// Solves the active points, from the impulses that they have; velocities include these already.
pub fn solve(
    points: &mut [Point],
    entries: &[Entry],
    twists: &mut [Twist],
    friction: bool,
    ends: Ends,
    scratch: &mut Scratch,
) -> Solved {
    let Scratch { before, way } = scratch;
    before.clear();
    before.resize(points.len(), DVec3::ZERO);
    way.clear();
    way.resize(points.len(), DVec3::ZERO);
    let mut solved = Solved::default();
    if !points.iter().any(|p| p.row.active) {
        return Solved { converged: true, ..solved };
    }
    let mut last = f64::INFINITY;
    while solved.iterations < u64::from(ends.iterations) {
        for (was, p) in before.iter_mut().zip(points.iter()) {
            *was = p.row.impulse;
        }
        let mut residual = 0.0f64;
        for p in points.iter_mut().filter(|p| p.row.active) {
            residual = residual.max(p.relax(entries, twists, friction));
        }
        for p in points.iter_mut().rev().filter(|p| p.row.active) {
            residual = residual.max(p.relax(entries, twists, friction));
        }
        solved.iterations += 1;
        solved.residual = residual;
        if residual <= ends.speed {
            solved.converged = true;
            break;
        }
        // The change of a sweep is minus the gradient; beta after Fletcher and Reeves, restarted where it grows.
        let square: f64 =
            before.iter().zip(points.iter()).map(|(was, p)| (p.row.impulse - *was).length_squared()).sum();
        let beta = square / last;
        last = square;
        let goes_on = beta <= 1.0 && solved.iterations < u64::from(ends.iterations);
        for ((was, way), p) in before.iter().zip(way.iter_mut()).zip(points.iter_mut()).filter(|(_, p)| p.row.active) {
            let step = p.row.impulse - *was;
            if goes_on {
                let more = *way * beta;
                *way = more + step;
                if more != DVec3::ZERO {
                    p.row.impulse += more;
                    p.push(more, entries, twists);
                }
            } else {
                *way = DVec3::ZERO;
            }
        }
    }
    solved
}

/// Applies the impulses that points start with.
pub fn start(points: &[Point], entries: &[Entry], twists: &mut [Twist]) {
    for p in points.iter().filter(|p| p.row.active && p.row.impulse != DVec3::ZERO) {
        p.push(p.row.impulse, entries, twists);
    }
}
