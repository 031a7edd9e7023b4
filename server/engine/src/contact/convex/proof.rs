//! What a direction proves: how long two convex bodies stay apart along it.
//!
//! The formulas are those of `convex`; both the advance and what goes ahead of it use them.

use glam::DVec3;
use smallvec::SmallVec;

/// Evaluations of φ that one proof may take.
const PROOF: usize = 24;

/// The gap along a direction at a time.
#[derive(Clone, Copy)]
pub struct Gap {
    /// The time, a fraction of the step.
    pub t: f64,
    /// World axes.
    pub n: DVec3,
    /// φ.
    pub phi: f64,
}

/// How fast a gap may change.
#[derive(Clone, Copy)]
pub struct Pace {
    /// |v₀| + ω_A ρ_A + ω_B ρ_B.
    pub speed: f64,
    /// ω_A² ρ_A + ω_B² ρ_B.
    pub pull: f64,
    /// φ above this excludes a contact of depth delta.
    pub least: f64,
}

impl Pace {
    /// Up to where between two gaps a contact of depth delta is excluded; the end if all of it is.
    pub fn proven(&self, p: &Gap, q: &Gap) -> f64 {
        let h = q.t - p.t;
        if h <= 0.0 {
            return if p.phi > self.least { q.t } else { p.t };
        }
        let turn = (q.n - p.n).length() / h;
        let longest = p.n.length().max(q.n.length());
        let curve = 0.5 * h * h * (2.0 * turn * self.speed + longest * self.pull);
        // In s: c s² + (φ₂ − φ₁ − c) s + φ₁ − least > 0; a unit direction's least, so the longest is 1.
        let (f1, f2) = (p.phi - self.least, q.phi - self.least);
        if f1 <= 0.0 {
            return p.t;
        }
        let slope = f2 - f1 - curve;
        let root = slope * slope - 4.0 * curve * f1;
        if f2 > 0.0 && (root < 0.0 || slope >= 0.0 || -slope >= 2.0 * curve) {
            return q.t;
        }
        if root < 0.0 {
            // Cannot be: f2 <= 0 has a root in [0, 1].
            return p.t;
        }
        // The smaller root, without cancellation.
        let s = 2.0 * f1 / (-slope + root.sqrt());
        p.t + (0.999_999 * s).min(1.0) * h
    }

    /// How far from `p` towards `q` a contact is excluded, the direction going over linearly, in halves where need be;
    /// `gap_at` tells the gap at a time along a direction.
    pub fn prove(&self, p: Gap, q: Gap, gap_at: impl Fn(f64, DVec3) -> Gap) -> f64 {
        let mut stack: SmallVec<[Gap; PROOF]> = SmallVec::new();
        stack.push(q);
        let mut p = p;
        for _ in 0..PROOF {
            let Some(q) = stack.last().copied() else { break };
            let until = self.proven(&p, &q);
            if until >= q.t {
                p = q;
                stack.pop();
                continue;
            }
            let middle = 0.5 * (p.t + q.t);
            if stack.len() == PROOF || middle <= p.t {
                return until;
            }
            let n = 0.5 * (p.n + q.n);
            let Some(n) = n.try_normalize() else { return until };
            let gap = gap_at(middle, n);
            if gap.phi <= self.least {
                return until;
            }
            stack.push(gap);
        }
        p.t
    }
}
