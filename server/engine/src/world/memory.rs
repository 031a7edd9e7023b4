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
use crate::contact::margin::{self, KeptProof};
use crate::contact::{self, Outcome, PairQuery, QueryOptions, Region, Scratch, Status, region};
use crate::motion::Placed;
use contactd_proto::{Motion, Pose};
use glam::DVec3;
use std::fmt::Write as _;

/// The first line of every certificate of what is remembered.
pub const HEADER: &str = "contactd-memory 3";

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
    /// A step that asks for its first contact has searched the pair no further than to prove it free until later than that.
    Horizon {
        /// What is told of it: clear until then.
        outcome: Outcome,
        /// The pair that meets first, by ids.
        first: (u32, u32),
        /// When it is known to have met.
        horizon: f64,
    },
}

/// What was told beside an answer that is repeated, as text; `None` where its proof takes more cells than it may.
#[derive(Clone, Debug, Default)]
pub struct Beside {
    /// That the pair does not touch, and until when it stays out of its margin.
    pub apart: Option<Option<String>>,
    /// Where it touches.
    pub regions: Option<Option<String>>,
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
        if job.is_left {
            let (horizon, first) = self.first()?;
            return Some(Remembered::Horizon { outcome: job.found.outcome, first, horizon });
        }
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

    /// When the first pair that a step stops for is known to have met, and its ids.
    fn first(&self) -> Option<(f64, (u32, u32))> {
        let stops = self.state.jobs().iter().filter(|job| !job.plan.sensor && job.found.outcome.meets());
        let first = stops.min_by(|p, q| p.found.outcome.time_upper().total_cmp(&q.found.outcome.time_upper()))?;
        let ids = [first.a, first.b].map(|i| self.roster.bodies[i as usize].id);
        Some((first.found.outcome.time_upper(), ids.into()))
    }

    fn job_of(&self, (a, b): (u32, u32)) -> Option<&PairJob> {
        self.job((*self.roster.by_id.get(&a)?, *self.roster.by_id.get(&b)?))
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
                let job = self.job_of((a, b))?;
                let q = job.question(&self.roster.bodies, &notes.options, self.state.clock());
                let share = SHARES.into_iter().find(|share| strays <= share * clearance)?;
                let part = if until.is_finite() { until / steps } else { 1.0 };
                let query = over(&q.query, motions, steps, cells);
                let proof = margin::certify_kept(&query, q.margin, (share * clearance, clearance), part)?;
                let _ = write!(out, "pair {a} {b} prediction since {since:e} steps {steps:e} until {until:e}");
                motions.iter().for_each(|m| write_motion(&mut out, m));
                out.push('\n');
                match proof {
                    KeptProof::Directions(all) => {
                        for (t, n) in all {
                            let _ = writeln!(out, "from {t:e} {}", numbers(&[n]));
                        }
                    }
                    KeptProof::Cells(proof) => write_cells(&proof, &mut out),
                }
            }
            // Of a search past an overlap nothing is proven that two certificates could say.
            Remembered::Answer { outcome, .. } | Remembered::Horizon { outcome, .. } if outcome.past => return None,
            Remembered::Answer { motions, outcome } => {
                let job = self.job_of((a, b))?;
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
            Remembered::Horizon { outcome, first: (c, d), horizon } => {
                let query = search::query(&self.roster.bodies, self.job_of((a, b))?, &notes.options);
                let query = PairQuery { cell_limit: cells, ..query };
                let witness = numbers(&[self.witness((c, d), horizon)?]);
                let until = outcome.time_lower();
                let _ = writeln!(out, "pair {a} {b} horizon {horizon:e} until {until:e} of {c} {d} witness {witness}");
                write_cells(&certificate::certify(&query, &outcome)?, &mut out);
            }
        }
        Some(out)
    }

    /// A point (world) in both bodies of a pair at the time at which it is known to have met.
    fn witness(&self, pair: (u32, u32), time: f64) -> Option<DVec3> {
        let notes = self.state.notes.as_deref()?;
        let query = search::query(&self.roster.bodies, self.job_of(pair)?, &notes.options);
        // Less may have been asked for than a point.
        let query = PairQuery { query_options: QueryOptions::CONTACT, ..query };
        let found = contact::earliest_contact(&query, &mut Scratch::default());
        if found.status() == Status::Overlap {
            return Some(found.point()?.point).filter(|_| time == 0.0);
        }
        certificate::witness_of(&query, &found).filter(|(t, _)| *t <= time).map(|(_, x)| x)
    }

    /// The certificates of what was told beside the answer that is repeated of a pair: that it does not touch, and where it does. `None`
    /// unless an answer is repeated of which that was told. Proofs may take `cells` cells; those of radius `left` (radii of the smaller
    /// body) in which the bodies seem to touch are left.
    pub fn certificates_beside(&self, a: u32, b: u32, (cells, left): (u64, f64)) -> Option<Beside> {
        let (a, b) = (a.min(b), a.max(b));
        let Remembered::Answer { motions, .. } = self.remembered(a, b)? else { return None };
        let notes = self.state.notes.as_deref()?;
        let job = self.job_of((a, b))?;
        let pair_cache = self.state.neighbours().pair_cache(job.pair?)?;
        let reported = pair_cache.reported()?;
        let outcome = &reported.outcome;
        let threshold = region::threshold(outcome.resolution, job.plan.margin);
        let query = search::query(&self.roster.bodies, job, &notes.options);
        let query = PairQuery { cell_limit: cells, query_options: QueryOptions::CONTACT, ..query };
        let since = self.state.clock() - pair_cache.answered_at()?;
        let mut beside = Beside::default();
        let head = |kind: &str, what: &str| {
            let mut out = format!("pair {a} {b} {kind} since {since:e} {what}");
            motions.iter().for_each(|m| write_motion(&mut out, m));
            out.push('\n');
            out
        };
        if !outcome.touching {
            let until =
                if outcome.status() == Status::Clear && job.plan.margin > 0.0 { outcome.margin_time } else { 0.0 };
            let proof = certificate::certify_level(&query, TOLD * threshold, 0.5 * threshold, until);
            beside.apart = Some(proof.map(|proof| {
                let mut out = head("apart", &format!("threshold {threshold:e} until {until:e}"));
                write_cells(&proof, &mut out);
                out
            }));
        }
        if !reported.regions.is_empty() {
            let time = outcome.contact().map_or(0.0, |contact| contact.time);
            let proof = certificate::certify_regions(&query, time, ALONE * threshold, left);
            beside.regions = Some(proof.map(|proof| {
                let what = format!("at {time:e} threshold {threshold:e} regions {}", reported.regions.len());
                let mut out = head("regions", &what);
                reported.regions.iter().for_each(|region| write_region(&mut out, region));
                write_cells(&proof, &mut out);
                out
            }));
        }
        Some(beside)
    }
}

/// Parts of a threshold: half of it is what both bodies are kept from each other's middle by, less a checker's room …
const TOLD: f64 = 0.4;
/// … and what of it is proven to be told. Where edges are sharp f lies below the distance: what it takes for nearer than the threshold
/// may be farther apart.
const ALONE: f64 = 0.125;

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

fn write_region(out: &mut String, region: &Region) {
    let _ =
        writeln!(out, "region {} {} points {}", region.extent.name(), numbers(&[region.normal]), region.points.len());
    for p in &region.points {
        let _ = writeln!(out, "point {} {:e}", numbers(&[p.point]), p.separation);
    }
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
