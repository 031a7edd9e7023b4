//! The least clearance of a robot over ranges of its joints, proven; or a clash.
//!
//! Branch and bound over boxes of joint values (A. Land, A. Doig, Econometrica 28(3), 1960). At the middle of a box the distance d of
//! a pair of links is bounded on both sides ([`crate::contact::distance`]). From there to any other values in the box no point of
//! a link moves against the other one by more than Σ L_k h_k: h_k is half of what joint k has in the box, L_k is 1 of a slide, and of
//! a hinge how far the link's farthest point is from its axis at most, whatever the joints between them do. So d − Σ L_k h_k is a
//! bound for the whole box. Joints that move both links alike do not count.
//!
//! However near the bounds are to each other, a bound of 0 from below excludes no clash: where it is not proven that there is none
//! anywhere, boxes are halved on.
//!
//! Floor 10: imports `import`, `contact`, `terminal`.

use crate::contact::distance::{DEFAULT_LIMIT, DistanceQuery, at_instant};
use crate::contact::{
    PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, default_resolution, earliest_contact,
};
use crate::import::Scene;
use crate::import::robot::{DofKind, Robot, Values};
use crate::motion::Placed;
use crate::octree::Model;
use contactd_proto::{Motion, Pose, Report};
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashSet};
use std::sync::Arc;

/// Boxes that are looked at side by side: what comes of them does not depend on how many threads do it.
const SIDE_BY_SIDE: usize = 16;
/// Cells that a search for a common point may refine.
const MEETING: u64 = 20_000;
/// Part of the tolerance that a distance at the middle of a box may be off.
const DISTANCE_PART: f64 = 0.25;

/// What is asked.
#[derive(Clone, Debug)]
pub struct Question {
    /// Joints with their ranges, radians and metres.
    pub ranges: Vec<(String, [f64; 2])>,
    /// Values of the other joints.
    pub values: Values,
    /// How far apart the bounds may be, a length.
    pub tolerance: f64,
    /// It is enough to know whether the clearance is at least this.
    pub least: Option<f64>,
    /// Boxes that may be looked at.
    pub boxes: u64,
}

impl Question {
    /// True where bounds answer the question.
    fn is_enough(&self, lower: f64, upper: f64) -> bool {
        upper == 0.0
            || match self.least {
                Some(least) => lower >= least || upper < least,
                None => lower > 0.0 && upper - lower <= self.tolerance,
            }
    }

    /// True where nothing in a box counts, given the least that is known elsewhere.
    fn is_done(&self, lower: f64, upper: f64) -> bool {
        match self.least {
            Some(least) => lower >= least,
            None => lower > 0.0 && lower >= upper - self.tolerance,
        }
    }
}

/// The least clearance.
#[derive(Clone, Debug)]
pub struct Least {
    /// Proven: nowhere in the ranges two links that are tested are nearer. Infinite without a pair.
    pub lower: f64,
    /// At `values` two are so near; 0 where they clash, or touch for all that numbers tell.
    pub upper: f64,
    /// Values of the joints that have ranges.
    pub values: Values,
    /// The two links there; empty without a pair.
    pub names: [String; 2],
    /// Their points nearest to each other, world.
    pub points: [DVec3; 2],
    /// Pairs of links that were asked of.
    pub pairs: usize,
    /// Boxes that were looked at.
    pub boxes: u64,
    /// Distances that were worked out.
    pub distances: u64,
    /// The bounds are as near as was asked and exclude a clash, or decide what was asked.
    pub is_settled: bool,
}

/// A joint as it moves a link: which variable it follows, by which factor, and what it does.
#[derive(Clone, Copy)]
struct Mover {
    link: usize,
    dof: usize,
    variable: usize,
    factor: f64,
}

/// Two objects, and what moves each of them against the other, from the root on.
struct Pair {
    objects: [usize; 2],
    movers: [Vec<Mover>; 2],
}

/// A box of joint values for a pair. Of joints that do not move the two against each other it has the whole ranges, always.
#[derive(Clone)]
struct Cell {
    pair: u32,
    low: Vec<f64>,
    high: Vec<f64>,
    /// Proven of all in it.
    lower: f64,
    /// The variable to be halved.
    split: usize,
    /// It was looked at.
    is_known: bool,
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Cell {}
impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Cell {
    /// The lowest bound is the greatest; of equal ones the order of their corners decides.
    fn cmp(&self, other: &Self) -> Ordering {
        let corners = |cell: &Self| cell.low.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let order = other.lower.total_cmp(&self.lower).then(other.pair.cmp(&self.pair));
        order.then_with(|| corners(other).cmp(&corners(self)))
    }
}

/// A robot at joint values.
struct Stand {
    values: Values,
    poses: Vec<Pose>,
}

/// What a look at a box found.
struct Look {
    cell: Cell,
    /// A distance in the middle, and the points; `None` where balls around both say enough.
    near: Option<(f64, [DVec3; 2])>,
}

struct Search<'a> {
    robot: &'a Robot,
    question: &'a Question,
    models: Vec<&'a Model>,
    /// The link of each object.
    owners: Vec<usize>,
    /// A ball around each object's model, in the link's frame.
    balls: Vec<(DVec3, f64)>,
    pairs: Vec<Pair>,
    best: f64,
}

/// The least clearance of the pairs that a scene of the robot tests, `models` those of the scene in order.
///
/// # Errors
/// A joint that is not there, that has a value of its own as well, or whose range is not within its limits; a link that is endless and
/// that a joint moves.
pub fn least(robot: &Robot, scene: &Scene, models: &[Arc<Model>], question: &Question) -> Result<Least, String> {
    let start = cell(robot, question)?;
    let mut search = Search::new(robot, scene, models, question)?;
    let pairs = search.pairs.len();
    let mut out = Least {
        lower: f64::INFINITY,
        upper: f64::INFINITY,
        values: Values::new(),
        names: [String::new(), String::new()],
        points: [DVec3::NAN; 2],
        pairs,
        boxes: 0,
        distances: 0,
        is_settled: true,
    };
    if pairs == 0 {
        return Ok(out);
    }
    let mut queue: BinaryHeap<Cell> =
        (0..pairs as u32).map(|pair| search.by_balls(Cell { pair, ..start.clone() })).collect();
    let (mut open, mut floor): (Vec<Cell>, f64) = (Vec::new(), f64::INFINITY);
    loop {
        open.clear();
        while open.len() < SIDE_BY_SIDE {
            let Some(cell) = queue.pop() else { break };
            match cell.is_known {
                _ if question.is_done(cell.lower, out.upper) => floor = floor.min(cell.lower),
                false => open.push(cell),
                true => {
                    let halves = cell.halves();
                    if halves.is_empty() {
                        floor = floor.min(cell.lower);
                    }
                    open.extend(halves);
                }
            }
        }
        if open.is_empty() {
            // What was left is no nearer, or has no width any more.
            out.lower = floor.max(0.0);
            out.is_settled = question.is_enough(out.lower, out.upper);
            return Ok(out);
        }
        let looks: Vec<Look> = open.par_iter().map(|cell| search.look(cell)).collect();
        for look in looks {
            out.boxes += 1;
            out.distances += u64::from(look.near.is_some());
            if let Some((upper, points)) = look.near.filter(|(upper, _)| *upper < out.upper) {
                out.upper = upper;
                out.names = search.pairs[look.cell.pair as usize].objects.map(|o| scene.objects[o].name.clone());
                out.points = points;
                out.values = search.middle(&look.cell);
            }
            queue.push(look.cell);
        }
        search.best = out.upper;
        out.lower = floor.min(queue.peek().map_or(f64::INFINITY, |cell: &Cell| cell.lower)).max(0.0);
        if question.is_enough(out.lower, out.upper) {
            return Ok(out);
        }
        if out.boxes >= question.boxes {
            out.is_settled = false;
            return Ok(out);
        }
    }
}

/// True where two bodies at rest share a point, or touch to within the resolution.
fn do_meet(a: PlacedModel, b: PlacedModel) -> bool {
    let query = PairQuery {
        a,
        b,
        resolution: default_resolution(a.model, b.model),
        cell_limit: MEETING,
        strategies: Strategies::default(),
        query_options: QueryOptions { report: Report::Hit, ..QueryOptions::CONTACT },
    };
    let found = earliest_contact(&query, &mut Scratch::default());
    found.touching || found.status() == Status::Overlap
}

/// The box of all ranges.
fn cell(robot: &Robot, question: &Question) -> Result<Cell, String> {
    let (mut low, mut high) = (Vec::new(), Vec::new());
    let mut seen = HashSet::new();
    for (name, range) in &question.ranges {
        let dof = robot.free().find(|d| d.name == *name);
        let Some(dof) = dof else {
            let names: Vec<&str> = robot.free().map(|d| d.name.as_str()).collect();
            return Err(format!("expected a range of one of the joints {}, found {name:?}", names.join(", ")));
        };
        let [from, to] = dof.range;
        if !(range[0] <= range[1] && range[0] >= from && range[1] <= to) {
            return Err(format!(
                "expected a range within {from} to {to} of {name}, found {} to {}",
                range[0], range[1]
            ));
        }
        if !seen.insert(name) || question.values.contains_key(name) {
            return Err(format!("expected one range or one value of {name}, found two"));
        }
        for follower in robot.links.iter().flat_map(|l| &l.dofs) {
            let Some((_, factor, offset)) = follower.mimic.as_ref().filter(|m| m.0 == *name) else { continue };
            let ends = range.map(|value| factor * value + offset);
            if ends.iter().any(|end| follower.is_beyond(*end)) {
                let ([from, to], follows) = (follower.range, &follower.name);
                return Err(format!(
                    "expected a range of {name} that keeps {follows}, which follows it, within {from} to {to}, found {} to {}",
                    ends[0], ends[1]
                ));
            }
        }
        low.push(range[0]);
        high.push(range[1]);
    }
    Ok(Cell { pair: 0, low, high, lower: f64::NEG_INFINITY, split: 0, is_known: false })
}

impl Cell {
    /// Its two halves; none of one that has no width.
    fn halves(&self) -> Vec<Self> {
        let k = self.split;
        if self.low.is_empty() || self.low[k] == self.high[k] {
            return Vec::new();
        }
        let middle = 0.5 * (self.low[k] + self.high[k]);
        let (mut below, mut above) = (self.clone(), self.clone());
        (below.high[k], above.low[k]) = (middle, middle);
        (below.is_known, above.is_known) = (false, false);
        vec![below, above]
    }
}

impl<'a> Search<'a> {
    fn new(robot: &'a Robot, scene: &Scene, models: &'a [Arc<Model>], question: &'a Question) -> Result<Self, String> {
        let owners = robot.owners();
        let models: Vec<&Model> = scene.objects.iter().map(|o| &*models[o.model]).collect();
        let ball = |model: &&Model| {
            let around = model.solid.aabb();
            if around.is_finite() { (around.center(), around.half().length()) } else { (DVec3::ZERO, f64::INFINITY) }
        };
        let balls = models.iter().map(ball).collect();
        let excepted: HashSet<[&str; 2]> = scene.rules[0]
            .except
            .iter()
            .flat_map(|[a, b]| [[a.as_str(), b.as_str()], [b.as_str(), a.as_str()]])
            .collect();
        let mut this = Self { robot, question, models, owners, balls, pairs: Vec::new(), best: f64::INFINITY };
        for a in 0..scene.objects.len() {
            for b in a + 1..scene.objects.len() {
                let names = [scene.objects[a].name.as_str(), scene.objects[b].name.as_str()];
                if !excepted.contains(&names) && !this.models[a].solid.is_empty() && !this.models[b].solid.is_empty() {
                    let pair = this.pair([a, b]);
                    this.pairs.push(pair);
                }
            }
        }
        for pair in &this.pairs {
            for (object, movers) in pair.objects.into_iter().zip(&pair.movers) {
                if this.balls[object].1.is_infinite() && !movers.is_empty() {
                    let name = &scene.objects[object].name;
                    return Err(format!("expected links that joints with ranges move to be bounded, found {name}"));
                }
            }
        }
        Ok(this)
    }

    /// What moves two objects against each other.
    fn pair(&self, objects: [usize; 2]) -> Pair {
        let chains = objects.map(|o| {
            let mut chain = vec![self.owners[o]];
            while let Some(parent) = self.robot.links[*chain.last().expect("a link")].parent {
                chain.push(parent);
            }
            chain.reverse();
            chain
        });
        let shared = chains[0].iter().zip(&chains[1]).take_while(|(a, b)| a == b).count();
        Pair { objects, movers: chains.map(|chain| self.movers(&chain[shared..])) }
    }

    /// Joints of links that follow a variable.
    fn movers(&self, links: &[usize]) -> Vec<Mover> {
        let variable = |name: &str| self.question.ranges.iter().position(|(own, _)| own == name);
        let mut movers = Vec::new();
        for link in links {
            for (i, dof) in self.robot.links[*link].dofs.iter().enumerate() {
                let (leader, factor) = dof.mimic.as_ref().map_or((&dof.name, 1.0), |(of, factor, _)| (of, *factor));
                let of = variable(leader).map(|variable| Mover { link: *link, dof: i, variable, factor });
                movers.extend(of);
            }
        }
        movers
    }

    /// Joint values in the middle of a box.
    fn middle(&self, cell: &Cell) -> Values {
        let names = self.question.ranges.iter().map(|(name, _)| name.clone());
        names.zip(cell.low.iter().zip(&cell.high).map(|(low, high)| 0.5 * (low + high))).collect()
    }

    /// Where the robot stands in the middle of a box.
    fn stand(&self, cell: &Cell) -> Stand {
        let mut values = self.question.values.clone();
        values.extend(self.middle(cell));
        Stand { poses: self.robot.poses(&values), values }
    }

    /// A box with the bound that the balls around both objects give.
    fn by_balls(&self, cell: Cell) -> Cell {
        let at = self.stand(&cell);
        let bound = self.balls_apart(&cell, &at) - self.reach(&cell, &at, &mut |_, _| {});
        // What the box had proven holds in its halves; endless objects have no balls.
        Cell { lower: if bound.is_nan() { cell.lower } else { bound.max(cell.lower) }, ..cell }
    }

    fn balls_apart(&self, cell: &Cell, at: &Stand) -> f64 {
        let [a, b] = self.pairs[cell.pair as usize].objects;
        let [x, y] = [a, b].map(|o| at.poses[self.owners[o]].point(self.balls[o].0));
        x.distance(y) - self.balls[a].1 - self.balls[b].1
    }

    /// Bounds a box from its middle.
    fn look(&self, cell: &Cell) -> Look {
        let at = self.stand(cell);
        let mut weights = vec![0.0_f64; cell.low.len()];
        let reach = self.reach(cell, &at, &mut |variable, part| weights[variable] += part);
        let split = (0..weights.len()).max_by(|i, j| weights[*i].total_cmp(&weights[*j])).unwrap_or(0);
        let bound = self.balls_apart(cell, &at) - reach;
        let mut cell = Cell { is_known: true, split, ..cell.clone() };
        if self.question.is_done(bound, self.best) {
            cell.lower = cell.lower.max(bound);
            return Look { cell, near: None };
        }
        let placed = |o: usize| PlacedModel {
            model: self.models[o],
            placed: Placed { place: Pose::IDENTITY, motion: Motion::resting(at.poses[self.owners[o]]) },
        };
        let [a, b] = self.pairs[cell.pair as usize].objects.map(placed);
        let ask = |tolerance: f64| at_instant(&DistanceQuery { a, b, tolerance, limit: DEFAULT_LIMIT }, 0.0);
        let mut d = ask(DISTANCE_PART * self.question.tolerance);
        // Where it is not decided the box must be smaller, or the distance finer than that.
        let level = self.question.least.unwrap_or(0.0);
        if d.upper > 0.0 && d.upper >= level && d.lower - reach <= level {
            let finer = DISTANCE_PART * reach.max(d.upper - level);
            if finer < d.upper - d.lower {
                d = ask(finer);
            }
        }
        cell.lower = cell.lower.max(d.lower - reach);
        // Where bodies hardly lie in each other the distance ends beside what they share: that there is such a point a search tells.
        let is_near = d.lower <= 0.0 && d.upper <= self.question.tolerance;
        let upper = if d.upper <= d.rounding || is_near && do_meet(a, b) { 0.0 } else { d.upper };
        Look { cell, near: Some((upper, [d.a.point, d.b.point])) }
    }

    /// How far a pair's objects may have moved against each other from the middle of a box; `part` hears what each variable does to it.
    fn reach(&self, cell: &Cell, at: &Stand, part: &mut impl FnMut(usize, f64)) -> f64 {
        let mut whole = 0.0;
        let pair = &self.pairs[cell.pair as usize];
        for (object, movers) in pair.objects.into_iter().zip(&pair.movers) {
            let (center, radius) = self.balls[object];
            let center = at.poses[self.owners[object]].point(center);
            // From the innermost joint outwards: how far points have come by those that are farther in.
            let mut moved = 0.0;
            for mover in movers.iter().rev() {
                let half = 0.5 * (cell.high[mover.variable] - cell.low[mover.variable]) * mover.factor.abs();
                let speed = match self.axis(mover, at) {
                    None => 1.0,
                    Some((point, axis)) => (center - point).cross(axis).length() + radius + moved,
                };
                let by = speed * half * (1.0 + 1e-12);
                part(mover.variable, by);
                moved += by;
            }
            whole += moved;
        }
        whole
    }

    /// A point on a hinge's axis and its direction, world; `None` of a slide.
    fn axis(&self, mover: &Mover, at: &Stand) -> Option<(DVec3, DVec3)> {
        let link = &self.robot.links[mover.link];
        let DofKind::Hinge { anchor, axis } = link.dofs[mover.dof].kind else { return None };
        // The joint's frame: the link's, without what the joints behind it do.
        let mut frame = at.poses[mover.link];
        for dof in link.dofs[mover.dof + 1..].iter().rev() {
            frame = frame.compose(&dof.pose(self.robot.value(dof, &at.values)).inverse());
        }
        // A point on the axis and its direction are where they were, whatever the joint's own value.
        Some((frame.point(anchor), frame.vector(axis)))
    }
}
