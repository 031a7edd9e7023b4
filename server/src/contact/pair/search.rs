//! Earliest contact of one pair over one step: from the question to the answer's fields.

use super::unbounded;
use crate::contact::cavity;
use crate::contact::convex::{self, Quick};
use crate::contact::exclusion::literal::{Faces, Side};
use crate::contact::instant::depth;
use crate::contact::instant::separation;
use crate::contact::instant::work::Work;
use crate::contact::query::outcome::{
    Contact, ContactKind, ContactPoint, Counters, Extent, NO_FACE, Outcome, Overlap, Penetration, Status, Verdict,
};
use crate::contact::query::question::PairQuery;
use crate::contact::query::task::{RAISES, Task, clear_of_walls, most_raised, raised, witness_level};
use crate::contact::queue::clock::Stage;
use crate::contact::queue::scratch::Scratch;
use crate::contact::queue::search::Search;
use crate::contact::witness::contacts::Contacts;
use crate::contact::witness::extent::{ACTIVE, INCIDENT, extent, note, noted, rank_of};
use crate::contact::witness::features::Features;
use crate::contact::witness::found::Ending;
use crate::contact::witness::found::Found;
use crate::contact::witness::known::Known;
use crate::contact::witness::newton::{Constraint, Problem, Solution};
use crate::contact::witness::retreat::{BACK, Climber};
use crate::contact::witness::touch::{CLIMBED, Touch};
use crate::motion::{Instant, Placed};
use crate::solid::Sense;
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// The resolution that a question's answer will tell: its own, or the least that its rounding allows.
pub fn resolution_of(query: &PairQuery) -> f64 {
    unbounded::resolution(query).unwrap_or_else(|| Task::of(query).0.delta)
}

/// Searches a pair to its end.
pub fn earliest_contact(query: &PairQuery, scratch: &mut Scratch) -> Outcome {
    let mut outcome = clear(query);
    find_earliest(query, scratch, &mut outcome);
    outcome
}

/// The same, written to a place: of thousands of pairs copies would take as long as the easiest of them.
pub fn find_earliest(query: &PairQuery, scratch: &mut Scratch, outcome: &mut Outcome) {
    scratch.enter(Stage::Front);
    match convex::balls(query) {
        Some(passage) => *outcome = passage.outcome(query),
        None => earliest(query, scratch, outcome),
    }
    scratch.enter(None);
}

/// The same for what is no pair of balls. A function of its own, so that what is told stays where it was written.
#[inline(never)]
fn earliest(query: &PairQuery, scratch: &mut Scratch, outcome: &mut Outcome) {
    *outcome = clear(query);
    let quick = whole(query, outcome);
    if !matches!(quick, Quick::Reported) {
        search(query, quick, outcome, scratch);
    }
}

/// What is told without a search of a pair that is no pair of balls; `outcome` is clear before.
fn whole(query: &PairQuery, outcome: &mut Outcome) -> Quick {
    if let Some(reported) = unbounded::answer(query) {
        *outcome = reported;
        return Quick::Reported;
    }
    convex::quick(query, outcome)
}

/// Answers what is not told without a search.
#[inline(never)]
fn search(query: &PairQuery, quick: Quick, outcome: &mut Outcome, scratch: &mut Scratch) {
    let (task, swapped) = Task::of(query);
    let mut search = PairSearch::of_task(query, task, swapped, (quick, outcome), std::mem::take(scratch));
    *outcome = search.run(f64::INFINITY).expect("a search without a horizon ends");
    *scratch = search.into_scratch();
}

/// What is told of two bodies that do not meet, so far.
fn clear(query: &PairQuery) -> Outcome {
    let mut outcome = Outcome::clear(query.resolution);
    outcome.counters.primitives = 2;
    outcome
}

/// What is told of two whole primitives without a search; `outcome` is clear before.
fn quick(query: &PairQuery, outcome: &mut Outcome) -> Quick {
    match convex::balls(query) {
        Some(passage) => {
            *outcome = passage.outcome(query);
            Quick::Reported
        }
        None => whole(query, outcome),
    }
}

/// Effort (`Counters::effort`) after which a coarser resolution is tried.
const PATIENCE: u64 = 100_000;

/// How much coarser, and how often.
const COARSER: f64 = 32.0;
const COARSENINGS: usize = 3;

/// The largest that a resolution becomes by that, relative to the smallest primitive.
const LARGEST_COARSE: f64 = 1e-3;

/// What a search that took too long has proven: no point is `depth` deep in both bodies before `free_until`, or before the contact found's
/// own goal.
#[derive(Debug)]
struct Open {
    resolution: f64,
    depth: f64,
    free_until: f64,
    /// A contact that is known, much later.
    found: Option<Found>,
}

/// How far a pair has come.
#[expect(
    clippy::large_enum_variant,
    reason = "one a pair, which stays in its place: a box would be an allocation more"
)]
enum State<'a> {
    /// Answered without a search, whose memory is given back.
    Reported(Outcome, Scratch),
    /// Searched; and the ending that a shortcut in front of the search has found.
    Searching(Search<'a>, Option<Ending>),
}

/// The search of one pair, to be run piece by piece: a scene that asks only for its first contact runs each pair no
/// further than the earliest contact known.
pub struct PairSearch<'a> {
    task: Task<'a>,
    /// The query's b carries the cells.
    swapped: bool,
    /// 1 or 2: the depth that is searched, in resolutions.
    level: f64,
    state: State<'a>,
    /// The answer as far as it is known; its counters are of the searches that have ended.
    outcome: Outcome,
    resolution: f64,
    /// How often the resolution was raised since rounding left its depth untold.
    raised: usize,
    /// How often the resolution was made coarser since a search took too long, and what the first of these had proven.
    coarser: usize,
    /// No coarser resolution is to be tried: the search goes on until its work limit.
    insists: bool,
    open: Option<Box<Open>>,
    /// The bodies of the question as they move, where the search leaves out a spin that moves nothing: what closes in along a normal is
    /// told of these.
    spun: Option<Box<[Placed; 2]>>,
    /// Cells that the question allows.
    limit: u64,
    /// Cells' worth of work of the searches that have ended: at other depths.
    spent: u64,
}

impl<'a> PairSearch<'a> {
    /// Runs as `run` does, but refines at most `cells` more cells: a search that would need more is undecided.
    pub fn run_within(&mut self, until: f64, cells: u64) -> Option<Outcome> {
        if let State::Searching(search, _) = &mut self.state {
            let limit =
                self.limit.saturating_sub(self.spent).min(search.counters().spent(self.limit).saturating_add(cells));
            search.limit_to(limit);
            self.task.limit = limit;
        }
        self.run(until)
    }

    /// Prepares the search of a pair.
    pub fn new(query: &PairQuery<'a>, scratch: Scratch) -> Self {
        let (task, swapped) = Task::of(query);
        let mut outcome = clear(query);
        let quick = quick(query, &mut outcome);
        if let Quick::Reported = quick {
            return Self::at(query, task, swapped, outcome, State::Reported(outcome, scratch));
        }
        Self::of_task(query, task, swapped, (quick, &outcome), scratch)
    }

    /// A pair that has come so far, at the resolution of its task.
    fn at(query: &PairQuery<'a>, task: Task<'a>, swapped: bool, outcome: Outcome, state: State<'a>) -> Self {
        Self {
            task,
            swapped,
            level: 1.0,
            state,
            outcome,
            resolution: task.delta,
            raised: 0,
            coarser: 0,
            insists: false,
            open: None,
            spun: None,
            limit: query.cell_limit,
            spent: 0,
        }
    }

    /// Prepares the search of a task, of which a quick look has told something.
    fn of_task(
        query: &PairQuery<'a>,
        task: Task<'a>,
        swapped: bool,
        (quick, before): (Quick, &Outcome),
        scratch: Scratch,
    ) -> Self {
        let (a, b) = (task.a, task.b);
        let mut outcome = Outcome::clear(task.delta);
        outcome.counters.primitives = (a.primitives.len() + b.primitives.len()) as u64;
        outcome.counters.closed_forms = before.counters.closed_forms;
        let mut contacts = Contacts::new(task);
        let (mut ending, mut overlap) = (None, None);
        // Of what has no volume nothing is asked.
        let some = !a.is_empty() && !b.is_empty();
        match quick {
            Quick::Overlap(x) => overlap = Some(x),
            Quick::Open(along) if query.strategies.convex => ending = convex::answer(&mut contacts, along),
            _ => {}
        }
        if ending.is_none() && overlap.is_none() && some && query.strategies.cavities {
            ending = cavity::answer(&mut contacts);
        }
        let mut search = Search::new(contacts, scratch);
        if ending.is_none() && overlap.is_none() && some {
            search.start();
        }
        if query.strategies.coarser {
            search.patience = PATIENCE;
        }
        let spins = |(a, b): (Placed, Placed)| [a.motion.spin, b.motion.spin];
        let moving = if swapped { (query.b.placed, query.a.placed) } else { (query.a.placed, query.b.placed) };
        let spun = (spins(moving) != spins(task.relative.placed())).then(|| Box::new([query.a.placed, query.b.placed]));
        let mut pair = Self::at(query, task, swapped, outcome, State::Searching(search, ending));
        pair.spun = spun;
        if let Some(x) = overlap
            && !pair.goes_past(x, 0)
        {
            pair.state = State::Reported(pair.overlaps(x, Some(before)), pair.take_scratch());
        }
        pair
    }

    /// The answer for an overlap at the start with the common point x, of which something may have been told.
    fn overlaps(&self, x: DVec3, reported: Option<&Outcome>) -> Outcome {
        let (task, mut outcome) = (&self.task, self.outcome);
        if let Some(reported) = reported {
            let counters = outcome.counters;
            outcome = Outcome { resolution: outcome.resolution, counters: reported.counters, ..*reported };
            outcome.counters += Counters { primitives: 0, closed_forms: 0, ..counters };
        } else {
            fill_overlap(&mut outcome, task, x);
            if self.swapped {
                outcome.swap_sides();
            }
        }
        if task.query_options.penetration {
            let at = task.relative.at(0.0);
            let work = Work::new(task.limit.min(depth::MOST_CELLS));
            let (deepest, direction, depth, _) = depth::deepest(task, &at, x, &work);
            let sign = if self.swapped { -1.0 } else { 1.0 };
            let penetration = Penetration {
                depth: 2.0 * depth,
                point: task.relative.world_point(&at, deepest),
                direction: (at.world_from_a * direction * sign).normalize(),
            };
            if let Verdict::Overlap(overlap) = &mut outcome.verdict {
                overlap.penetration = Some(penetration);
            }
            outcome.counters.instant_cells += work.cells();
            outcome.counters.penetrations += 1;
        }
        outcome
    }

    /// Searches on past an overlap at the start with the common point x, where that is asked for: for a contact deeper
    /// than the start by delta; `cells` were spent. False when it is not, or when the work allowed does not prove how deep the
    /// start is.
    fn goes_past(&mut self, x: DVec3, cells: u64) -> bool {
        if !self.task.query_options.past_overlap || self.task.ignored_depth > 0.0 {
            return false;
        }
        let work = Work::new(self.task.limit.min(depth::MOST_CELLS));
        let deepest = depth::at_most(&self.task, &self.task.relative.at(0.0), x, &work);
        self.outcome.counters.instant_cells += work.cells();
        // Of the question's limit, too: a search that is run piece by piece works out anew what it may still spend.
        self.spent += work.cells();
        let Some(deepest) = deepest else { return false };
        self.outcome.counters.past_overlaps += 1;
        (self.outcome.touching, self.outcome.past) = (true, true);
        self.task.ignored_depth = deepest;
        // What fits say holds for depths that are small against the bodies.
        self.task.strategies.fits = false;
        self.task.start_tolerance = 0.0;
        self.level = 1.0;
        self.restart(cells + work.cells());
        true
    }

    /// The depth that is searched for now: what is free until `earliest` is so of this depth.
    pub fn depth(&self) -> f64 {
        match &self.state {
            State::Reported(reported, _) => reported.depth,
            State::Searching(..) => self.task.delta,
        }
    }

    /// True when an overlap at the start is searched past.
    pub fn is_past(&self) -> bool {
        self.task.ignored_depth > 0.0
    }

    /// No contact of this pair is earlier; infinite when nothing is left to search.
    pub fn earliest(&self) -> f64 {
        match &self.state {
            State::Reported(Outcome { verdict: Verdict::Clear { .. }, .. }, _) => f64::INFINITY,
            State::Reported(reported, _) => reported.time_lower(),
            State::Searching(_, Some(Ending::Contact(found))) => found.goal,
            State::Searching(_, Some(_)) => f64::INFINITY,
            State::Searching(search, None) => search.earliest(),
        }
    }

    /// Runs until the answer is found, or until no contact before or at `until` is left to find: then `None`.
    pub fn run(&mut self, until: f64) -> Option<Outcome> {
        if let State::Reported(reported, _) = &self.state {
            return (reported.status() == Status::Clear || reported.time_lower() <= until).then_some(*reported);
        }
        loop {
            let (ending, cells) = self.ending(until)?;
            let answer = self.answer(ending, cells);
            if answer.is_some() {
                return answer;
            }
        }
    }

    /// How the search ends, and the cells' worth of work that it took; `None` where it comes to `until` first.
    fn ending(&mut self, until: f64) -> Option<(Ending, u64)> {
        let State::Searching(search, known) = &mut self.state else { return None };
        let ending = match known {
            Some(Ending::Contact(found)) if found.goal > until => None,
            Some(_) => known.take(),
            None => search.run(until),
        }?;
        // Rounding that no larger depth helps against: what is proven and a witness behind it are the answer.
        let last = matches!(ending, Ending::Rounding(_)) && self.raised == RAISES.len();
        let ending = if last { search.rescue().unwrap_or(ending) } else { ending };
        let cells = search.counters().spent(self.limit);
        self.spent += cells;
        self.outcome.counters += search.take_counters();
        Some((ending, cells))
    }

    /// The answer that an ending is, `cells` after its search began; `None` where a search begins anew, at another depth.
    fn answer(&mut self, ending: Ending, cells: u64) -> Option<Outcome> {
        let anew = match ending {
            Ending::Deep(x) => return self.answer_within(x, cells),
            Ending::Contact(found) => {
                self.meets(&found);
                false
            }
            Ending::Clear => {
                // What a finer search has found is there all the same.
                if self.open.as_ref().is_some_and(|open| open.found.is_some()) {
                    self.leave_open(0.0);
                }
                false
            }
            Ending::Limit(t) => {
                self.leave_open(t);
                false
            }
            Ending::Long(t, found) => {
                let anew = self.coarsen(t, found) || !std::mem::replace(&mut self.insists, true);
                self.leave_open_unless(anew, t)
            }
            Ending::Rounding(t) => {
                // A depth that the motion comes to and stays at is told apart from a slightly larger one.
                let anew = self.raise() || self.coarsen(t, None);
                self.leave_open_unless(anew, t)
            }
        };
        if anew {
            self.restart(cells);
            return None;
        }
        if self.swapped {
            self.outcome.swap_sides();
        }
        self.outcome.depth = self.task.delta;
        Some(self.outcome)
    }

    /// The answer where x is deep in both bodies at the start: `None` where a search begins anew, at a larger depth.
    fn answer_within(&mut self, x: DVec3, cells: u64) -> Option<Outcome> {
        self.outcome.touching = true;
        if self.doubles_depth() || self.raises_depth(x) {
            self.restart(cells);
            return None;
        }
        (!self.goes_past(x, cells)).then(|| self.overlaps(x, None))
    }

    /// A body that was stopped at its contact starts at depth 0 ± rounding: the search is for twice the depth. False when it
    /// was, or when an overlap is searched past.
    fn doubles_depth(&mut self) -> bool {
        if self.level != 1.0 || self.task.ignored_depth != 0.0 {
            return false;
        }
        self.level = 2.0;
        self.task.start_tolerance = 0.0;
        true
    }

    /// A step that raised the resolution may have left the bodies a little deeper than 2 delta: raises it, too, where x is no
    /// deeper than that.
    fn raises_depth(&mut self, x: DVec3) -> bool {
        let most = 2.0 * most_raised(self.resolution, self.task.rounding);
        let depth = -separation::value(&self.task, &self.task.relative.at(0.0), x);
        self.task.ignored_depth == 0.0 && depth <= most && self.raise()
    }

    /// Leaves open what comes after `t`, unless the search begins `anew`; says whether it does.
    fn leave_open_unless(&mut self, anew: bool, t: f64) -> bool {
        if !anew {
            self.leave_open(t);
        }
        anew
    }

    /// The answer that a contact was found.
    fn meets(&mut self, found: &Found) {
        let continued = (found.touch.is_none() && self.task.continues()).then(|| self.continued(found));
        let found = continued.as_ref().unwrap_or(found);
        let mut contact = contact_of(&self.task, self.outcome.resolution, found);
        let x = found.witness;
        let x = if self.swapped { self.task.relative.at(found.upper).b_point(x) } else { x };
        contact.witness = Some(x);
        if let (Some(bodies), Some(o)) = (&self.spun, &mut contact.point) {
            let velocity = |body: &Placed| {
                let motion = &body.motion;
                motion.velocity + motion.spin.cross(o.point - motion.at(contact.time).position)
            };
            // The normal still points from the reference body.
            let sign = if self.swapped { -1.0 } else { 1.0 };
            o.normal_speed = sign * (velocity(&bodies[0]) - velocity(&bodies[1])).dot(o.normal);
        }
        self.outcome.counters.times += u64::from(self.task.query_options.time());
        self.outcome.counters.contacts += u64::from(contact.point.is_some());
        self.outcome.verdict = Verdict::Contact(contact);
    }

    /// A contact whose witness was kept for its time alone, with its touch. Where it has none: with the deepest point
    /// beside the witness, which lies as deep in the one body as in the other.
    fn continued(&mut self, found: &Found) -> Found {
        let climber = Climber::new(&self.task, BACK);
        let back = Touch { task: &self.task, known: Known::All };
        let touch = back.back(&found.deep, &climber);
        let mut deep = found.deep.clone();
        if touch.is_none() && deep.t == found.upper {
            let held = climber.deepest(deep.t, deep.x);
            if held.1 >= self.task.delta {
                deep = self.balanced(&back, back.climbed(deep.t, &held), held.1);
            }
        }
        self.outcome.counters.instant_cells += climber.cells();
        Found { touch, deep, ..found.clone() }
    }

    /// Where a climb to a depth has ended, or where its faces' equations have their solution then, which is about as deep:
    /// on a flat top rounding keeps a climb from the point where the faces oppose each other.
    fn balanced(&self, back: &Touch, climbed: Solution, depth: f64) -> Solution {
        let at = self.task.relative.at(climbed.t);
        let level_for = |t: f64| -> Option<Solution> {
            // Secants on the level whose contact comes at the time.
            let (mut level, mut s) = (depth * (1.0 - NEAR_DEPTH), back.mended(&climbed, depth)?);
            let mut last = (depth, s.t);
            for _ in 0..DEPTHS {
                if (s.t - t).abs() <= f64::EPSILON {
                    break;
                }
                s = back.mended(&s, level)?;
                let slope = (level - last.0) / (s.t - last.1);
                last = (level, s.t);
                level += (t - s.t) * slope;
                if level.is_nan() || (level - depth).abs() > 0.5 * depth {
                    break;
                }
            }
            Some(s)
        };
        let deep = |s: &Solution| -separation::value(&self.task, &at, s.x) >= depth - INCIDENT * self.task.rounding;
        let solved = level_for(climbed.t).filter(deep);
        solved.map_or(climbed.clone(), |s| Solution { t: climbed.t, ..s })
    }

    /// The answer that nothing more is known than that nothing is met before `t`, or what a finer search has proven and found.
    fn leave_open(&mut self, t: f64) {
        let here = Open { resolution: self.resolution, depth: self.task.delta, free_until: t, found: None };
        let open = self.open.take().map_or(here, |open| *open);
        self.outcome.resolution = open.resolution;
        self.task.delta = open.depth;
        match open.found {
            Some(found) => self.meets(&found),
            None => self.outcome.verdict = Verdict::Undecided { time_lower: open.free_until },
        }
    }

    /// Makes the resolution coarser, where a search has proven that nothing is met before `t` and would take too long to tell more.
    /// False where that was done often enough, and where a primitive would be hardly more than that large.
    fn coarsen(&mut self, t: f64, found: Option<Found>) -> bool {
        let models = [self.task.model_a, self.task.model_b];
        let resolution = clear_of_walls(COARSER * self.resolution, self.task.rounding, models);
        let primitives = self.task.a.primitives.iter().chain(&self.task.b.primitives);
        let smallest = primitives.map(|p| p.shape.geometry().smallest_dimension()).fold(f64::INFINITY, f64::min);
        // What is proven at the finest resolution is worth most, but for a contact that was found.
        if self.open.as_ref().is_none_or(|open| open.found.is_none() && found.is_some()) {
            let (resolution, depth) = (self.resolution, self.task.delta);
            self.open = Some(Box::new(Open { resolution, depth, free_until: t, found }));
        }
        let allowed = self.task.strategies.coarser && self.coarser < COARSENINGS;
        if !allowed || resolution > LARGEST_COARSE * smallest {
            return false;
        }
        self.coarser += 1;
        self.raised = 0;
        self.resolution = resolution;
        self.outcome.resolution = resolution;
        if self.task.ignored_depth == 0.0 {
            (self.level, self.task.start_tolerance) = (1.0, self.task.rounding);
        }
        true
    }

    /// Raises the resolution, unless that was done often enough.
    fn raise(&mut self) -> bool {
        let Some(more) = RAISES.get(self.raised) else { return false };
        self.raised += 1;
        self.resolution = raised(self.resolution, *more, self.task.rounding);
        self.outcome.resolution = self.resolution;
        // What was twice as deep as the resolution may be less than that now: then the promise is one for once.
        if self.task.ignored_depth == 0.0 {
            (self.level, self.task.start_tolerance) = (1.0, self.task.rounding);
        }
        true
    }

    /// Searches anew, at the depth that is to be searched by now; `cells` were spent.
    fn restart(&mut self, cells: u64) {
        self.task.delta = self.task.ignored_depth + self.level * self.resolution;
        self.task.limit = self.task.limit.saturating_sub(cells);
        let mut contacts = Contacts::new(self.task);
        let again = self.coarser > 0 && self.task.strategies.cavities;
        let ending = if again { cavity::answer(&mut contacts) } else { None };
        let mut search = Search::new(contacts, self.take_scratch());
        if ending.is_none() {
            search.start();
        }
        let tries = self.task.strategies.coarser && self.coarser < COARSENINGS && !self.insists;
        search.patience = if tries { PATIENCE } else { u64::MAX };
        self.state = State::Searching(search, ending);
    }

    /// The memory of what has ended; the state is to be set anew.
    fn take_scratch(&mut self) -> Scratch {
        match std::mem::replace(&mut self.state, State::Reported(self.outcome, Scratch::default())) {
            State::Reported(_, scratch) => scratch,
            State::Searching(search, _) => search.into_scratch(),
        }
    }

    /// Cells' worth of work done so far.
    pub fn spent(&self) -> u64 {
        self.spent
            + match &self.state {
                State::Reported(..) => 0,
                State::Searching(search, _) => search.counters().spent(self.limit),
            }
    }

    /// Work done so far.
    pub fn counters(&self) -> Counters {
        let mut counters = self.outcome.counters;
        if let State::Searching(search, _) = &self.state {
            counters += *search.counters();
        }
        counters
    }

    /// Ends the search and gives its memory back.
    pub fn into_scratch(self) -> Scratch {
        match self.state {
            State::Reported(_, scratch) => scratch,
            State::Searching(search, _) => search.into_scratch(),
        }
    }
}

/// What is told of a contact, along a's axes where it is the reference body; its witness is still along these.
fn contact_of(task: &Task, resolution: f64, found: &Found) -> Contact {
    let time = found.touch.as_ref().map_or(found.upper, |s| s.t.clamp(0.0, found.upper));
    let mut contact = Contact {
        time_lower: time.min(found.goal.max(0.0)),
        not_continued: found.touch.is_none(),
        ..Contact::at(time, found.upper)
    };
    contact.point = task.query_options.point().then(|| point_of(task, resolution, found, &contact));
    contact
}

/// Where bodies meet, and how.
fn point_of(task: &Task, resolution: f64, found: &Found, contact: &Contact) -> ContactPoint {
    let deep = &found.deep;
    let s = found.touch.as_ref().filter(|s| s.t >= 0.0).unwrap_or(deep);
    // Where the touch was before the start: the point on the way from it to the witness, now.
    let now = found.touch.as_ref().filter(|s| s.t < 0.0 && deep.t > 0.0).map(|s| s.before(deep, 0.0));
    let time = contact.time;
    let at = task.relative.at(time);
    let problem = Problem {
        a: Faces { solid: task.a, clip_planes: &[] },
        b: Faces { solid: task.b, clip_planes: &[] },
        relative: &task.relative,
        scale: task.scale,
        time_scale: 1.0,
        tolerance: task.rounding,
    };
    let common = |x: DVec3| task.model_a.value(x).max(task.model_b.value(at.b_point(x)));
    let mut x = now.filter(|x| common(*x) < common(s.x)).unwrap_or(s.x);
    // Of round faces the way from the touch to the witness bends: what holds the bodies at the start is solved for.
    let start = found.touch.as_ref().filter(|touch| touch.t < 0.0 && deep.t > 0.0);
    let balance = |c: &Constraint| problem.row(c, x, &at, 0.0).gradient;
    let start = start
        .filter(|_| s.active.iter().zip(&s.lambda).map(|(c, l)| balance(c) * *l).sum::<DVec3>().length() > BENT)
        .and_then(|touch| at_the_start(task, touch, deep));
    let climbed = |x: &DVec3| climbed_at_the_start(task, &at, *x, 2.0 * resolution);
    let start = start.or_else(|| [Some(x), now].iter().flatten().filter(|_| time == 0.0).find_map(climbed));
    let s = start.as_ref().unwrap_or(s);
    x = start.as_ref().map_or(x, |s| s.x);
    // Where the point is no touch, or one that was climbed to, faces pass as far from it as it is deep.
    let off = task.model_a.value(x).abs().max(task.model_b.value(at.b_point(x)).abs());
    let off = if off <= INCIDENT * task.rounding { 0.0 } else { off };
    // Deep in each other bodies show no faces in one point: those of the solution are told.
    let tolerance = BESIDE * off + INCIDENT * task.rounding;
    let mut features = Features::at(task, x, &at, (task.ignored_depth == 0.0).then_some(tolerance));
    if off > 0.0 && task.ignored_depth == 0.0 && !features.is_balanced(NEARLY) {
        // A face that holds the point with next to no weight may be farther from it than the point is deep: a move of
        // the point changes the depth by that weight of it.
        let wider = Features::at(task, x, &at, Some(WIDER * off + INCIDENT * task.rounding));
        if wider.is_balanced(NEARLY) {
            features = wider;
        }
    }
    let mut active = Active::of(&problem, s, (x, &at), &features);
    if active.extent == Extent::Point {
        active.add_incident(&features);
    }
    let kind = ContactKind::of_active(active.count[0], active.count[1]);
    let averaged_normal = kind == ContactKind::VertexVertex;
    let normal = if averaged_normal { active.average.unwrap_or(active.normal) } else { active.normal };
    let [faces_a, faces_b] = active.faces;
    ContactPoint {
        point: task.relative.world_point(&at, x),
        normal: (at.world_from_a * normal).normalize(),
        averaged_normal,
        // Of an overlap that is searched past: how deep the bodies then are.
        separation: match () {
            () if task.ignored_depth > 0.0 => -2.0 * task.delta,
            () if contact.not_continued => 2.0 * common(x).min(0.0),
            () => 0.0,
        },
        normal_speed: at.velocity(x).dot(normal),
        kind,
        extent: active.extent,
        faces_a,
        faces_b,
    }
}

/// A face that is this many times as far from a deep point as the point is deep passes it, too: it may hold it with next to
/// no weight.
const BESIDE: f64 = 1.0 + 1e-3;

/// How much farther than it is deep faces are looked for beside a point where those that pass it do not hold it.
const WIDER: f64 = 1.1;

/// What may be left of the gradients of faces that hold a point where it is deep.
const NEARLY: f64 = 1e-7;

/// Gradients that miss each other by more than this are not of the point where the bodies hold each other.
const BENT: f64 = 1e-9;

/// Steps towards the depth that a contact has at a time.
const DEPTHS: usize = 24;

/// The first of them, a part of the depth.
const NEAR_DEPTH: f64 = 1e-3;

/// What a contact that touched before the start is at the start: its equations at the depth that it has reached by then.
fn at_the_start(task: &Task, touch: &Solution, deep: &Solution) -> Option<Solution> {
    let problem = Problem::of(task);
    // Depths and times before and after it.
    let (mut before, mut after) = ((0.0, touch.t), (witness_level(task.delta, task.rounding), deep.t));
    let mut s = deep.clone();
    let mut earlier = None;
    for _ in 0..DEPTHS {
        let level = before.0 - before.1 * (after.0 - before.0) / (after.1 - before.1);
        s = problem.solve(&s.active, s.x, s.t, &s.lambda, level, true)?;
        if s.t.abs() <= f64::EPSILON {
            break;
        }
        let is_before = s.t < 0.0;
        // An end that stays is taken for half as far (the Illinois rule): else the steps come from one side alone.
        let stays = if earlier == Some(is_before) { 0.5 } else { 1.0 };
        if is_before {
            (before, after.1) = ((level, s.t), after.1 * stays);
        } else {
            (after, before.1) = ((level, s.t), before.1 * stays);
        }
        earlier = Some(is_before);
    }
    // The same contact still, at a depth between.
    let at = task.relative.at(0.0);
    let most = witness_level(task.delta, task.rounding) + INCIDENT * task.rounding;
    let values = [task.model_a.value(s.x), task.model_b.value(at.b_point(s.x))];
    let held = s.lambda.iter().zip(&s.active).all(|(l, c)| *l >= -ACTIVE || matches!(c, Constraint::Apex(..)));
    (held && values.iter().all(|v| v.abs() <= most)).then_some(s)
}

/// The deepest point beside one that is deeper than `most` in a body, or in one of them alone, at the start: between
/// like faces and at edges the way from the touch to the witness leads off.
fn climbed_at_the_start(task: &Task, at: &Instant, x: DVec3, most: f64) -> Option<Solution> {
    let values = |x: DVec3| [task.model_a.value(x), task.model_b.value(at.b_point(x))];
    let fits = |v: [f64; 2]| v.iter().all(|v| *v <= INCIDENT * task.rounding && *v >= -most);
    if !task.continues() || fits(values(x)) {
        return None;
    }
    let known = Known::All;
    let held = Climber::new(task, BACK).deepest(0.0, x);
    fits(values(held.0)).then(|| Touch { task, known }.climbed(0.0, &held))
}

/// What a solution's multipliers say about the contact.
struct Active {
    count: [usize; 2],
    faces: [[u32; 3]; 2],
    /// Unit, from A, along A's axes.
    normal: DVec3,
    /// Average of the adjacent normals of both sides, where known.
    average: Option<DVec3>,
    /// Sides whose apex meets the other body.
    apex: [bool; 2],
    extent: Extent,
}

impl Active {
    /// What holds a solution at a point and an instant: its own constraints, as far as they are active there.
    fn of(problem: &Problem, s: &Solution, (x, at): (DVec3, &Instant), features: &Features) -> Self {
        let mut held: SmallVec<[(Constraint, f64); 6]> =
            s.active.iter().copied().zip(s.lambda.iter().copied()).collect();
        let is_active = |c: &Constraint, l: f64| match *c {
            Constraint::Literal(side, id) => l <= ACTIVE || features.has(side, id),
            // A cone's tip that the witness met may have been left by the start.
            Constraint::Apex(side, id, _) => features.is_apex(side, id),
        };
        let known = features.active.iter().all(|ids| !ids.is_empty());
        let balance = |held: &[(Constraint, f64)]| {
            held.iter().map(|(c, l)| problem.row(c, x, at, 0.0).gradient * *l).sum::<DVec3>().length()
        };
        if known && s.stationarity >= CLIMBED && balance(&held) > BENT {
            // Where a climb ended: what holds the bodies there is near what did on the way.
            held = features.held().map_or(held, SmallVec::from_vec);
        }
        if known && !held.iter().all(|(c, l)| is_active(c, *l)) {
            // Of faces in one plane that which is there; else what holds the bodies there is worked out anew.
            let mut renamed = held.clone();
            let all = renamed.iter_mut().all(|(c, l)| match *c {
                Constraint::Literal(side, id) if *l > ACTIVE && !features.has(side, id) => {
                    let other = features.in_plane_of(side, id);
                    *c = Constraint::Literal(side, other.unwrap_or(id));
                    other.is_some()
                }
                _ => is_active(c, *l),
            });
            if all {
                held = renamed;
            } else if let Some(anew) = features.held() {
                held = SmallVec::from_vec(anew);
            }
        }
        let (mut count, mut apex) = ([0; 2], [false; 2]);
        let mut faces = [[NO_FACE; 3]; 2];
        let (mut sums, mut weights) = ([DVec3::ZERO; 2], [0.0; 2]);
        let mut gradients: SmallVec<[DVec3; 6]> = SmallVec::new();
        let mut of_side: [SmallVec<[DVec3; 6]>; 2] = Default::default();
        let mut curvature = DMat3::ZERO;
        for (c, l) in &held {
            let row = problem.row(c, x, at, 0.0);
            let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *c;
            let k = side as usize;
            sums[k] += row.gradient * *l;
            weights[k] += l.abs();
            curvature += row.hessian * *l;
            let active = match c {
                Constraint::Literal(..) => *l > ACTIVE,
                Constraint::Apex(..) => true,
            };
            apex[k] |= matches!(c, Constraint::Apex(..));
            if active {
                gradients.push(row.gradient);
                of_side[k].push(row.gradient);
                note(&mut faces[k], id.face());
            }
        }
        // Faces in one plane are one, and those that share an edge two.
        for k in 0..2 {
            count[k] = if apex[k] { 3 } else { rank_of(&of_side[k]) };
        }
        let normal = normal_of(sums, weights).unwrap_or_else(|| gradients.first().copied().unwrap_or(DVec3::X));
        Self { count, faces, normal, average: None, apex, extent: extent(&gradients, curvature, problem.scale) }
    }

    /// Counts the faces that pass through a point of contact without being needed to hold it there: where a vertex meets
    /// a vertex, two edges already do. The adjacent normals are averaged as the paper does.
    fn add_incident(&mut self, features: &Features) {
        let mut sum = DVec3::ZERO;
        for (side, sign) in [(Side::A, 1.0), (Side::B, -1.0)] {
            let k = side as usize;
            let ids = &features.active[k];
            if ids.is_empty() {
                continue;
            }
            let (mut normals, mut each, mut is_apex) = (DVec3::ZERO, Vec::new(), self.apex[k]);
            for id in ids {
                let n = features.normal(side, *id);
                is_apex |= features.is_apex(side, *id);
                each.push(n);
                normals += if id.sense() == Sense::Positive { n } else { -n };
            }
            let list = &mut self.faces[k];
            if ids.len() > list.len() {
                // More faces than are told: the first ones, whichever of them hold the contact.
                list.iter_mut().zip(ids).for_each(|(f, id)| *f = id.face());
            }
            for id in ids {
                note(list, id.face());
            }
            // Faces that share one edge make an edge, however many they are; faces of one tangent plane are one.
            self.count[k] = if is_apex { 3 } else { rank_of(&each) };
            let normals = if side == Side::A { normals } else { features.turned(normals) };
            sum += normals.normalize_or_zero() * sign;
        }
        self.average = sum.try_normalize();
    }
}

/// The normal that both bodies' weighted gradients make, unit, from A. Where they miss each other it is that of the body
/// whose own cancel less: of one face exact, while two that are next to opposite, as at the tip of a crescent, make of
/// the rounding of a point what they like.
fn normal_of(sums: [DVec3; 2], weights: [f64; 2]) -> Option<DVec3> {
    let sum = if (sums[0] + sums[1]).length() <= BENT * (sums[0] - sums[1]).length() {
        sums[0] - sums[1]
    } else if sums[0].length() * weights[1] >= sums[1].length() * weights[0] {
        sums[0]
    } else {
        -sums[1]
    };
    sum.try_normalize()
}

/// Overlap at the start: from a common point to one that tells a direction.
fn fill_overlap(o: &mut Outcome, task: &Task, x: DVec3) {
    o.verdict = Verdict::OVERLAP;
    o.touching = true;
    if !task.query_options.point() {
        return;
    }
    o.counters.contacts += 1;
    let at = task.relative.at(0.0);
    let work = Work::new(task.limit.min(depth::MOST_CELLS));
    let (x, normal, depth, faces) = depth::some(task, &at, x, &work);
    o.counters.instant_cells += work.cells();
    let [mut faces_a, mut faces_b] = [[NO_FACE; 3]; 2];
    for (side, id) in faces {
        let list = if side == Side::A { &mut faces_a } else { &mut faces_b };
        note(list, id.face());
    }
    let point = ContactPoint {
        point: task.relative.world_point(&at, x),
        normal: (at.world_from_a * normal).normalize(),
        separation: -2.0 * depth,
        normal_speed: at.velocity(x).dot(normal),
        kind: ContactKind::of_active(noted(&faces_a), noted(&faces_b)),
        faces_a,
        faces_b,
        ..ContactPoint::default()
    };
    o.verdict = Verdict::Overlap(Overlap { time: 0.0, point: Some(point), penetration: None });
}
