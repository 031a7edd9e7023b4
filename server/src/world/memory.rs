//! Certificates of what a step has answered without a search: what was proven, when, for which motions, and what is left of it.
//!
//! A world that is asked for them (`World::certify`) notes, beside each proof that it keeps, where the bodies stood and which
//! direction it was; the rest is worked out when a certificate is asked for (`World::remembered`). Nobody who does not ask pays
//! more than one look at an empty place for each pair that a direction or a box has excluded.
//!
//! What a certificate says is checked by `tests/src/verifier/memory.rs` against the true motions of the step. Format and what
//! follows from what: docs/certificate.md, "What is remembered".

use super::coherence::Via;
use super::notes::{Clearance, Decided, axis_between};
use super::scene::World;
use super::search::{self, PairJob};
use crate::contact::certificate::{self, Certificate};
use crate::contact::clearance::{self, Distance};
use crate::contact::{self, Outcome, PairQuery, QueryOptions, Scratch, Status};
use crate::motion::Placed;
use contactd_proto::{Motion, Pose};
use glam::DVec3;
use std::fmt::Write as _;

/// The first line of every certificate of what is remembered.
pub const HEADER: &str = "contactd-memory 2";

/// What has answered for a pair in the last step.
// One at a time, and only where somebody asks.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Remembered {
    /// Nothing was remembered: it was searched.
    Nothing,
    /// A distance measured before, of which the bodies have not gone as much since. Of pairs beyond each other's boxes, too: these
    /// stood as far apart when the list of neighbours was taken.
    Clearance(Clearance),
    /// Directions at the start and at the end of the step, one going over into the other.
    Directions([DVec3; 2]),
    /// A predicted motion.
    PredictedMotion {
        /// The motions over the step with which it began.
        motions: [Motion; 2],
        /// Steps since then.
        since: f64,
        /// Steps that they were expected to go on so.
        steps: f64,
        /// Steps until which they were proven to keep their distance; infinite: standing afterwards, too.
        until: f64,
        /// How far they may stray together.
        clearance: f64,
        /// How far they stray in this step, at most.
        strays: f64,
    },
    /// The answer to the same question.
    Answer {
        /// The motions that were asked about.
        motions: [Motion; 2],
        /// What was answered.
        outcome: Outcome,
    },
}

/// Parts of a predicted motion's room for which its proof is made: the smallest that holds what the bodies stray serves many steps.
const SHARES: [f64; 4] = [0.5, 0.9, 0.99, 0.999];

impl World {
    /// Notes from now on what certificates of remembered answers need, or no longer. What was remembered is forgotten.
    pub fn certify(&mut self, on: bool) {
        self.forget();
        self.state.notes = on.then(Box::default);
    }

    /// What has answered for the pair of two objects in the last step; `None` for a pair that is never asked about, and unless
    /// `certify` was called before the step.
    pub fn remembered(&self, a: u32, b: u32) -> Option<Remembered> {
        let notes = self.state.notes.as_deref()?;
        let (a, b) = (a.min(b), a.max(b));
        self.plan_of(a, b)?;
        let pair = (*self.roster.by_id.get(&a)?, *self.roster.by_id.get(&b)?);
        let neighbours = self.state.neighbours();
        let clearance = || notes.clearances.get(&(a, b)).copied().map_or(Remembered::Nothing, Remembered::Clearance);
        match notes.decided.get(&pair) {
            Some(Decided::Clearance) => return Some(clearance()),
            Some(Decided::Directions(n)) => return Some(Remembered::Directions(*n)),
            None => {}
        }
        let Some(place) = neighbours.find(pair.0, pair.1) else {
            let ((p, own), (q, other)) = (neighbours.home(pair.0), neighbours.home(pair.1));
            let along = axis_between(own, other);
            return Some(Remembered::Clearance(Clearance { poses: [*p, *q], along, clearance: own.gap(other) }));
        };
        let Some(job) = self.job(pair) else { return Some(clearance()) };
        let (Some(pair_cache), true) = (neighbours.pair_cache(place), job.found.known) else {
            return Some(Remembered::Nothing);
        };
        let q = job.question(&self.roster.bodies, &notes.options, self.state.clock());
        let motions = [q.query.a.placed.motion, q.query.b.placed.motion];
        Some(match pair_cache.via() {
            (Via::Search, _) | (Via::PredictedMotion, None) => Remembered::Nothing,
            (Via::Answer, _) => Remembered::Answer { motions, outcome: job.found.outcome },
            (Via::Clearance, _) => clearance(),
            (Via::PredictedMotion, Some(prediction)) => Remembered::PredictedMotion {
                motions: prediction.motions,
                since: self.state.clock() - prediction.begin,
                steps: prediction.steps,
                until: prediction.until,
                clearance: prediction.clearance,
                strays: prediction.strays(&q).unwrap_or(f64::INFINITY),
            },
        })
    }

    fn job(&self, (i, j): (u32, u32)) -> Option<&PairJob> {
        self.state.jobs().iter().find(|job| (job.a, job.b) == (i, j) && job.pair.is_some())
    }

    /// The certificate of what has answered for a pair (see [`World::remembered`]) as text; proofs of predicted motions and answers may
    /// take `cells` cells. `None` where there is nothing to certify or the proof takes more.
    pub fn certificate_of(&self, a: u32, b: u32, cells: u64) -> Option<String> {
        let (a, b) = (a.min(b), a.max(b));
        let notes = self.state.notes.as_deref()?;
        let mut out = String::new();
        match self.remembered(a, b)? {
            Remembered::Nothing => return None,
            Remembered::Clearance(Clearance { poses, along, clearance }) => {
                let _ = write!(out, "pair {a} {b} clearance {clearance:e} along {}", numbers(&[along]));
                poses.iter().for_each(|p| write_pose(&mut out, p));
                out.push('\n');
            }
            Remembered::Directions([n0, n1]) => {
                let _ = writeln!(out, "pair {a} {b} directions {} {}", numbers(&[n0]), numbers(&[n1]));
            }
            Remembered::PredictedMotion { motions, since, steps, until, clearance, strays } => {
                let job = self.job((*self.roster.by_id.get(&a)?, *self.roster.by_id.get(&b)?))?;
                let q = job.question(&self.roster.bodies, &notes.options, self.state.clock());
                let share = SHARES.into_iter().find(|share| strays <= share * clearance)?;
                let part = if until.is_finite() { until / steps } else { 1.0 };
                let query = over(&q.query, motions, steps, cells);
                let proof = clearance::certify_kept(&query, q.margin, (share * clearance, clearance), part)?;
                let _ = write!(out, "pair {a} {b} prediction since {since:e} steps {steps:e} until {until:e}");
                motions.iter().for_each(|m| write_motion(&mut out, m));
                out.push('\n');
                match proof {
                    Distance::Directions(all) => {
                        for (t, n) in all {
                            let _ = writeln!(out, "from {t:e} {}", numbers(&[n]));
                        }
                    }
                    Distance::Cells(proof) => write_cells(&proof, &mut out),
                }
            }
            // Of a search past an overlap nothing is proven that two certificates could say.
            Remembered::Answer { outcome, .. } if outcome.past => return None,
            Remembered::Answer { motions, outcome } => {
                let job = self.job((*self.roster.by_id.get(&a)?, *self.roster.by_id.get(&b)?))?;
                let query = search::query(&self.roster.bodies, job, &notes.options);
                let query = PairQuery { cell_limit: cells, query_options: QueryOptions::CONTACT, ..query };
                let _ = write!(out, "pair {a} {b} answer");
                motions.iter().for_each(|m| write_motion(&mut out, m));
                out.push('\n');
                if outcome.status() == Status::Overlap {
                    // Less may have been asked for than a point.
                    let found = contact::earliest_contact(&query, &mut Scratch::default());
                    let _ = writeln!(out, "overlap {}", numbers(&[found.point()?.point]));
                } else {
                    write_cells(&certificate::certify(&query, &outcome)?, &mut out);
                }
            }
        }
        Some(out)
    }
}

/// A question about the motions of a predicted motion, all of its steps taken as one.
fn over<'a>(query: &PairQuery<'a>, motions: [Motion; 2], steps: f64, cells: u64) -> PairQuery<'a> {
    let mut query = PairQuery { cell_limit: cells, ..*query };
    for (body, motion) in [&mut query.a, &mut query.b].into_iter().zip(motions) {
        let motion = Motion { velocity: motion.velocity * steps, spin: motion.spin * steps, ..motion };
        body.placed = Placed { motion, ..body.placed };
    }
    query
}

fn write_cells(proof: &Certificate, out: &mut String) {
    proof.write((0, 1), out);
}

fn write_pose(out: &mut String, pose: &Pose) {
    let q = pose.rotation;
    let _ = write!(out, " pose {} {:e} {:e} {:e} {:e}", numbers(&[pose.position]), q.x, q.y, q.z, q.w);
}

fn write_motion(out: &mut String, motion: &Motion) {
    write_pose(out, &motion.start);
    let _ = write!(out, " {}", numbers(&[motion.velocity, motion.spin]));
}

fn numbers(points: &[DVec3]) -> String {
    let all: Vec<String> = points.iter().flat_map(|p| p.to_array()).map(|v| format!("{v:e}")).collect();
    all.join(" ")
}
