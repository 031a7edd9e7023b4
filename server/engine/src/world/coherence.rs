//! What is known of a pair from earlier steps, so that the next one need not be searched.
//!
//! Of the five proofs of docs/algorithm/coherence.md three stand here, the cheapest first; neighbours and directions are in
//! `neighbours` and `swept_shapes`. *Clearance* is the gap of that page here, not the effect of that name:
//! * clearance: apart by that much when it was measured. While the ways that both bodies have gone since (their path lengths)
//!   stay below it they cannot meet: one comparison (`neighbours`);
//! * a predicted motion: both bodies were proven to keep a distance if they go on as they went. While their true motions stray from
//!   it by less than the distance leaves room for they cannot meet, however far they go (`contact::margin`);
//! * the last question: asked again to the bit, it has the same answer.
//!
//! Knowledge only says "clear", or repeats an answer; everything else is searched as if nothing were known. So the
//! answers are the same bits without it, and what was learned in which step never shows in them.
//! Source of the path length: B. Mirtich, Impulse-based Dynamic Simulation (1996), section 2.4, its queue of times to impact;
//! that of a predicted motion is worked out in `contact::margin` and `PredictedMotion::strays`.

use super::body::Body;
use crate::contact::{Counters, Outcome, PairQuery, QueryOptions, Region, Scratch, Status, margin};
use contactd_proto::Motion;
use glam::{DQuat, DVec3};

/// Longest predicted motion proven ahead, in steps.
const LONGEST: f64 = 64.0;
/// Convex bodies whose distance they could cover in no fewer steps than this need no predicted motion; what part of a shorter
/// distance a predicted motion leaves for straying.
const LONG: f64 = 6.0;
const HALF: f64 = 0.5;
/// First predicted motion of a pair, in steps.
const FIRST: f64 = 4.0;
/// Clearance of a pair's first predicted motion, relative to the smaller of both radii …
const FIRST_CLEARANCE: f64 = 1e-3;
/// … the most …
const MOST_CLEARANCE: f64 = 1.0 / 80.0;
/// … and the least that is tried, in resolutions.
const LEAST_CLEARANCE: f64 = 64.0;
/// A predicted motion may cost this many times what the pair's last search did, in cells and in evaluations of literals …
const FACTOR: u64 = 4;
/// … where what a search does beside its cells counts as so many of them.
const BESIDE_CELLS: [u64; 2] = [8, 256];
/// The end of a predicted motion is found to this part of a step.
const PROOF_SLACK: f64 = 0.25;
/// Predicted motions that fail, or save no step, double the steps that pass before the next one is tried, up to two to this power.
const MOST_WAIT: u32 = 6;

/// Which kind of knowledge has answered last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Via {
    /// None: the pair was searched.
    #[default]
    Search,
    /// The same question.
    Answer,
    /// A predicted motion.
    PredictedMotion,
    /// The distance at the start of the step.
    Clearance,
}

/// Two bodies as they were expected to go.
#[derive(Clone, Copy, Debug)]
pub struct PredictedMotion {
    /// Their motions over the step with which it begins.
    pub motions: [Motion; 2],
    /// When that step began, in steps.
    pub begin: f64,
    /// How many steps they are expected to go on like that; they stand afterwards.
    pub steps: f64,
    /// Until then, in steps, they keep their distance; infinite: standing, too.
    pub until: f64,
    /// How far they may stray together.
    pub clearance: f64,
}

/// A question and its answer.
#[derive(Clone, Copy, Debug)]
struct Answer {
    motions: [Motion; 2],
    /// When the step began in which it was searched, in steps.
    begin: f64,
    /// Of the first contact alone more is asked than of others.
    query_options: QueryOptions,
    /// Work that it might take. Another limit has the same answer where none of both cuts it.
    limit: u64,
    outcome: Outcome,
}

/// What was told of an answer beside it: whether the pair touches, and where.
#[derive(Debug)]
pub struct Reported {
    /// The outcome with it.
    pub outcome: Outcome,
    /// All of the regions; none where they were not looked for.
    pub regions: Vec<Region>,
}

/// What is known of one pair.
#[derive(Debug, Default)]
pub struct PairCache {
    prediction: Option<Box<PredictedMotion>>,
    /// The predicted motion still holds.
    on_prediction: bool,
    answer: Option<Box<Answer>>,
    /// The answer is still that of the last question that was searched.
    answered: bool,
    /// It is that of the question in hand.
    is_in_hand: bool,
    /// What was told of that answer, if all of it could be found out.
    reported: Option<Box<Reported>>,
    /// Steps and clearance of the next predicted motion; 0 until there was one.
    steps: f64,
    clearance: f64,
    /// Predicted motions in a row that saved no step, and steps to let pass before the next one.
    failures: u32,
    wait: u32,
    /// Cells and evaluations of the last search; `None` before the first one and after any that was not clear.
    work: Option<[u64; 2]>,
    /// What has answered last.
    via: Via,
}

/// What was found out about a pair in a step.
#[derive(Clone, Copy, Debug)]
pub struct Finding {
    /// The answer.
    pub outcome: Outcome,
    /// Apart by more than the touching distance at the start of the step, by this much at least; not positive: unknown.
    pub clearance: f64,
    /// No search was needed.
    pub known: bool,
    /// Known to stay farther apart than the touching distance.
    pub apart: bool,
}

/// A pair in a step.
pub struct Question<'a> {
    /// Its bodies, that of the smaller id first.
    pub bodies: [&'a Body; 2],
    /// What is asked of the search.
    pub query: PairQuery<'a>,
    /// Separation up to which touching is told.
    pub margin: f64,
    /// When the step begins, in steps.
    pub clock: f64,
}

impl PairCache {
    /// Forgets everything but the memory it took.
    pub fn empty(&mut self) {
        *self = Self { prediction: self.prediction.take(), answer: self.answer.take(), ..Self::default() };
    }

    /// True when nothing in it could answer a question.
    pub fn is_blank(&self) -> bool {
        !self.answered && !self.on_prediction && self.work.is_none()
    }

    /// Answers from what is known, or from what little work makes known; `None`: search. `counters` counts the work.
    fn recall(
        &mut self,
        q: &Question,
        scratch: &mut Scratch,
        counters: &mut Counters,
    ) -> Option<(Outcome, Option<f64>)> {
        self.is_in_hand = false;
        if let Some(last) = self.answer.as_ref().filter(|_| self.answered)
            && last.motions.iter().zip(&q.motions()).all(|(p, q)| same_bits(p, q))
            && last.query_options == q.query.query_options
            && (last.limit == q.query.cell_limit || last.outcome.counters.fits(q.query.cell_limit.min(last.limit)))
        {
            self.via = Via::Answer;
            self.is_in_hand = true;
            return Some((last.outcome, None));
        }
        let clear = || Outcome::clear(q.query.resolution);
        if let Some(prediction) = self.prediction.as_ref().filter(|_| self.on_prediction) {
            match prediction.strays(q) {
                Some(way) if way < prediction.clearance => {
                    self.failures = 0;
                    self.via = Via::PredictedMotion;
                    return Some((clear(), Some(0.0)));
                }
                Some(_) if !prediction.is_over(q) => {
                    // They stray: less far ahead, with more clearance. One that has saved no step has failed as one that was not proven.
                    if self.via == Via::PredictedMotion && prediction.begin + 1.0 >= q.clock {
                        self.put_off();
                    }
                    self.steps = (0.5 * self.steps).max(1.0);
                    self.clearance = (4.0 * self.clearance).min(MOST_CLEARANCE * q.size());
                }
                _ => self.steps = (2.0 * self.steps).min(LONGEST),
            }
            self.on_prediction = false;
        }
        // A pair that was never searched, or that met something, is searched first.
        let work = self.work?;
        if let Some(clearance) = margin::at_start(&q.query, q.margin) {
            counters.closed_forms += 1;
            let travel = q.travel();
            self.via = Via::Clearance;
            if clearance > LONG * travel || clearance > travel && self.wait > 0 {
                self.wait = self.wait.saturating_sub(1);
                return Some((clear(), Some(clearance)));
            }
            // They will be near soon: how they go on is worth more than how far apart they are.
            self.clearance = HALF * clearance;
            if clearance > 0.0 && self.try_prediction(q, work, scratch, counters) {
                return Some((clear(), Some(0.0)));
            }
            return (clearance > travel).then(|| (clear(), Some(clearance)));
        }
        self.try_prediction(q, work, scratch, counters).then(|| (clear(), Some(0.0)))
    }

    /// What was told of the answer that was recalled.
    pub fn reported(&self) -> Option<&Reported> {
        self.reported.as_deref()
    }

    /// Remembers what is told beside the answer to the question in hand. What is told where something else has shown the pair apart belongs
    /// to no answer that is kept.
    pub fn report(&mut self, reported: Reported) {
        if self.answered && self.is_in_hand {
            self.reported = Some(Box::new(reported));
        }
    }

    /// Plans a predicted motion, unless others have failed of late.
    fn try_prediction(&mut self, q: &Question, work: [u64; 2], scratch: &mut Scratch, counters: &mut Counters) -> bool {
        if self.wait > 0 {
            self.wait -= 1;
            return false;
        }
        self.plan_prediction(q, work, scratch, counters)
    }

    /// The answer to a question: what is known, or what little work makes known; `counters` (0 before) counts that work. `None`:
    /// it takes a search, whose outcome is to be learned.
    pub fn ask(&mut self, q: &Question, scratch: &mut Scratch, counters: &mut Counters) -> Option<Finding> {
        let (outcome, clearance) = self.recall(q, scratch, counters)?;
        let outcome = Outcome { counters: *counters, ..outcome };
        Some(Finding { outcome, clearance: clearance.unwrap_or(0.0), known: true, apart: clearance.is_some() })
    }

    /// After another failure: the next predicted motion is tried twice as many steps later.
    fn put_off(&mut self) {
        self.failures += 1;
        self.wait = 1 << self.failures.min(MOST_WAIT);
    }

    /// Tries to prove a predicted motion from here; true when it holds over this step at least.
    fn plan_prediction(
        &mut self,
        q: &Question,
        work: [u64; 2],
        scratch: &mut Scratch,
        counters: &mut Counters,
    ) -> bool {
        let size = q.size();
        if self.steps == 0.0 {
            self.steps = FIRST;
        }
        if self.clearance == 0.0 {
            self.clearance = FIRST_CLEARANCE * size;
        }
        self.clearance = self.clearance.max(LEAST_CLEARANCE * q.query.resolution);
        let mut query = q.query;
        for body in [&mut query.a, &mut query.b] {
            body.placed.motion.velocity *= self.steps;
            body.placed.motion.spin *= self.steps;
        }
        let [cells, evaluations] = std::array::from_fn(|k| FACTOR * (BESIDE_CELLS[k] + work[k]));
        query.cell_limit = query.cell_limit.min(cells);
        let limits = (PROOF_SLACK / self.steps, evaluations);
        let kept = margin::keep(&query, q.margin, self.clearance, limits, scratch);
        *counters += kept.counters;
        let until = if kept.until >= 1.0 { f64::INFINITY } else { kept.until * self.steps };
        if until < 1.0 {
            self.put_off();
            self.steps = (0.5 * self.steps).max(1.0);
            self.clearance *= 0.25;
            return false;
        }
        let motions = q.motions();
        let prediction =
            PredictedMotion { motions, begin: q.clock, steps: self.steps, until, clearance: kept.clearance };
        put(&mut self.prediction, prediction);
        self.on_prediction = true;
        self.via = Via::PredictedMotion;
        true
    }

    /// When the step began in which the last answer was searched, in steps.
    pub fn answered_at(&self) -> Option<f64> {
        self.answer.as_ref().filter(|_| self.answered).map(|answer| answer.begin)
    }

    /// What has answered last, and the predicted motion it was.
    pub fn via(&self) -> (Via, Option<&PredictedMotion>) {
        (self.via, self.prediction.as_deref())
    }

    /// Forgets the last answer, and what was told beside it.
    pub fn forget_answer(&mut self) {
        (self.answered, self.is_in_hand, self.reported) = (false, false, None);
    }

    /// Learns from a search that was allowed so much work.
    pub fn learn(&mut self, q: &Question, limit: u64, outcome: &Outcome) {
        self.via = Via::Search;
        let Counters { cells, evaluations, .. } = outcome.counters;
        self.work = (outcome.status() == Status::Clear && !outcome.touching).then_some([cells, evaluations]);
        // More work might tell an overlap that was to be searched past.
        let open = outcome.status() == Status::Overlap && q.query.query_options.past_overlap;
        // What moves is hardly ever asked the same again, and what took no search is found as quickly as it is kept.
        let cheap = outcome.counters.cells + outcome.counters.instant_cells == 0;
        let moves = || [&q.query.a, &q.query.b].iter().any(|body| !body.placed.motion.is_rest());
        self.answered = outcome.status() != Status::Undecided && !open && !(cheap && moves());
        if self.answered {
            let (motions, query_options) = (q.motions(), q.query.query_options);
            self.is_in_hand = true;
            put(&mut self.answer, Answer { motions, begin: q.clock, query_options, limit, outcome: *outcome });
            self.reported = None;
        }
    }
}

/// True for motions of the same numbers, a zero's sign included: an answer's own zeros have theirs from it.
fn same_bits(p: &Motion, q: &Motion) -> bool {
    let bits = |m: &Motion| {
        let [x, y, z] = m.start.position.to_array().map(f64::to_bits);
        let rotation = m.start.rotation.to_array().map(f64::to_bits);
        ([x, y, z], rotation, m.velocity.to_array().map(f64::to_bits), m.spin.to_array().map(f64::to_bits))
    };
    bits(p) == bits(q)
}

/// Writes to the place, which is made when there is none.
fn put<T>(place: &mut Option<Box<T>>, value: T) {
    match place {
        Some(place) => **place = value,
        None => *place = Some(Box::new(value)),
    }
}

impl Question<'_> {
    fn motions(&self) -> [Motion; 2] {
        [self.query.a.placed.motion, self.query.b.placed.motion]
    }

    /// The smaller of both radii.
    fn size(&self) -> f64 {
        self.query.a.model.radius.min(self.query.b.model.radius)
    }

    /// How far the farthest points of both bodies go in the step.
    fn travel(&self) -> f64 {
        self.bodies.iter().map(|b| b.travel(1.0)).sum()
    }
}

impl PredictedMotion {
    /// True once the bodies are expected to stand.
    fn is_over(&self, q: &Question) -> bool {
        q.clock - self.begin >= self.steps
    }

    /// How far both bodies stray from it over the step; `None` where nothing was proven.
    pub fn strays(&self, q: &Question) -> Option<f64> {
        let begin = q.clock - self.begin;
        let end = begin + 1.0;
        // A step that begins before the bodies are expected to stand and ends later has a bend in it.
        let stands = self.is_over(q);
        if !stands && end > self.steps.min(self.until) || stands && self.until < f64::INFINITY {
            return None;
        }
        let mut sum = 0.0;
        let now = q.motions();
        for ((expected, motion), body) in self.motions.iter().zip(&now).zip(q.bodies) {
            let time = begin.min(self.steps);
            let (velocity, spin) = if stands { (DVec3::ZERO, DVec3::ZERO) } else { (expected.velocity, expected.spin) };
            let pose = expected.at(time);
            let off = motion.start.position - pose.position;
            let later = off + (motion.velocity - velocity);
            let turned = half_angle_sine(motion.start.rotation, pose.rotation);
            // Chords of the angle at the start and of what it grows by, at the farthest point.
            let turning = 2.0 * turned + (motion.spin - spin).length();
            // Of a body without bounds every point is off by as much, or there is no telling by how much.
            let reach = match body.reach() {
                reach if reach.is_finite() => reach,
                _ if motion.start.rotation == pose.rotation && motion.spin == spin => {
                    let size = motion.start.position.abs().max_element() + pose.position.abs().max_element();
                    sum += off.length().max(later.length()) + size * ROUNDING;
                    continue;
                }
                _ => return None,
            };
            let size = motion.start.position.abs().max_element() + pose.position.abs().max_element() + reach;
            // Within a margin it is f that counts: of points that may lie farther out than that.
            let beyond = body.part.reach_of_level(if q.margin > 0.0 { 0.5 * (q.margin + self.clearance) } else { 0.0 });
            let arm = reach + self.clearance.max(beyond);
            sum += off.length().max(later.length()) + turning.min(2.0) * arm + size * ROUNDING;
        }
        Some(sum)
    }
}

/// Relative rounding of a pose that is carried over a predicted motion, against the one that is given.
const ROUNDING: f64 = 1e-13;

/// Sine of half the angle between two rotations.
fn half_angle_sine(p: DQuat, q: DQuat) -> f64 {
    let r = p * q.conjugate();
    DVec3::new(r.x, r.y, r.z).length()
}
