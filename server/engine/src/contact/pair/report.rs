//! What is told of a contact that was found, and of an overlap: the point, its normal, what kind it is and which faces hold it.

use crate::contact::exclusion::literal::Side;
use crate::contact::instant::depth;
use crate::contact::instant::separation;
use crate::contact::instant::work::Work;
use crate::contact::query::outcome::{Contact, ContactKind, ContactPoint, Extent, NO_FACE, Outcome, Overlap, Verdict};
use crate::contact::query::task::{Task, witness_level};
use crate::contact::witness::balance;
use crate::contact::witness::extent::{ACTIVE, INCIDENT, extent, note, noted, rank_of};
use crate::contact::witness::features::Features;
use crate::contact::witness::found::Found;
use crate::contact::witness::known::Known;
use crate::contact::witness::newton::{Constraint, Problem, Solution};
use crate::contact::witness::retreat::{BACK, Climber};
use crate::contact::witness::touch::{CLIMBED, Touch};
use crate::motion::Instant;
use crate::solid::Sense;
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// What is told of a contact, along a's axes where it is the reference body; its witness is still along these.
pub(super) fn contact_of(task: &Task, resolution: f64, found: &Found) -> Contact {
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
    let problem = Problem { time_scale: 1.0, tolerance: task.rounding, ..Problem::of(task) };
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
    let mut features = if task.ignored_depth == 0.0 {
        Features::again(task, x, &at, tolerance, found.seen.as_ref())
    } else {
        Features::at(task, x, &at, None)
    };
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
pub(super) const DEPTHS: usize = 24;

/// The first of them, a part of the depth.
pub(super) const NEAR_DEPTH: f64 = 1e-3;

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
    // Between like faces steps may stop short, far from where the multipliers balance: the way tells more than these.
    (held && s.stationarity <= NEARLY && values.iter().all(|v| v.abs() <= most)).then_some(s)
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
    fits(values(held.0)).then(|| Touch::new(task, known).climbed(0.0, &held))
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
pub(super) fn fill_overlap(o: &mut Outcome, task: &Task, x: DVec3) {
    o.verdict = Verdict::OVERLAP;
    o.touching = true;
    if !task.query_options.point() {
        return;
    }
    o.counters.contacts += 1;
    let at = task.relative.at(0.0);
    let work = Work::new(task.limit.min(depth::MOST_CELLS));
    let (mut x, mut normal, mut depth, mut faces) = depth::some(task, &at, x, &work);
    // Where the faces that hold it, or those that decide there, are deepest in each other: a short climb does not come to that in a
    // thin overlap.
    let deciding = vec![(Side::A, task.a.deciding(x).1), (Side::B, task.b.deciding(at.b_point(x)).1)];
    // What bounded a whole box need not hold the point: a climb that begins at the deepest point goes nowhere.
    if [Side::A, Side::B].iter().any(|side| faces.iter().all(|f| f.0 != *side)) {
        faces.clone_from(&deciding);
    }
    for held in [faces.clone(), deciding] {
        let Some(((y, ..), way)) = balance::of_literals(task, &at, &held, x) else { continue };
        work.look(task.a.faces.len() + task.b.faces.len());
        let deeper = -separation::value(task, &at, y);
        if deeper > depth {
            (x, normal, depth, faces) = (y, way, deeper, held);
        }
    }
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
