//! Two convex bodies at an instant: where F is lowest, as one convex program.
//!
//! Of a body that is the intersection of faces with convex psi f is convex, and so is F = max(f_A, f_B): lowest where they overlap most,
//! or of bodies that are apart where they are nearest to both. Each plane that touches a face is below it everywhere, so the lowest point of
//! all planes that were taken is a linear program whose multipliers prove a bound of F, whatever rounding left of them. Flat faces are their
//! own planes: one program is enough. A curved one gets another plane wherever F is looked at: where the last program has its lowest
//! point (J. E. Kelley, The cutting-plane method, J. SIAM 8(4), 1960), and where Newton's method on the faces that hold it leads from
//! there, which doubles its digits a step. Boxes would come to the same place with all faces of both bodies in each of them.

use super::work::Work;
use crate::contact::exclusion::literal::Side;
use crate::contact::exclusion::lp;
use crate::contact::query::task::Task;
use crate::math::Aabb;
use crate::math::linear::eliminated;
use crate::motion::Instant;
use crate::solid::local::LiteralId;
use crate::solid::{Face, Sense, Solid};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Planes whose heights are compared as fast as one face is looked at.
const PLANES_PER_LOOK: usize = 8;
/// By how much a bound may fall short of what the planes are at its point, in sizes of the program.
const SHORT: f64 = 1e-13;
/// Planes that are taken in one after the other.
const MOST_ADDED: usize = 96;
/// Times that another way is tried, and how much larger the box is then along each axis.
const MOST_TURNS: usize = 8;
const WIDER: DVec3 = DVec3::new(1.0625, 1.1, 1.03);
/// A bound is trusted up to so many roundings.
pub(super) const ROUNDINGS: f64 = 64.0;
/// Programs before it ends where it is.
const ROUNDS: usize = 64;
/// Programs in turn that tell nothing new, before it ends; once value and bound are this near, in sizes of the box, that do not halve
/// what is left between them.
const MOST_IDLE: usize = 3;
const FINE: f64 = 1e-12;
/// Newton's steps between two programs.
const STEPS: usize = 6;
/// Slopes that are more than this press against a side of the box, weights that are more hold a point.
const BALANCED: f64 = 1e-9;
/// What is added to the curvature, over the size of the box: what holds a point may leave it free along a line.
const REGULAR: f64 = 1e-4;
/// Faces that hold a point, and unknowns of a step: the point, the level, their multipliers.
const MOST_HELD: usize = 4;
const UNKNOWNS: usize = 4 + MOST_HELD;

/// A face of one of the bodies, along A's axes.
#[derive(Clone, Copy, Debug)]
struct Member {
    side: Side,
    id: LiteralId,
    face: Face,
}

/// The faces of two convex bodies along A's axes.
#[derive(Clone, Debug)]
pub(in crate::contact) struct Program {
    /// Flat ones first.
    faces: Vec<Member>,
    /// How many are flat.
    flat: usize,
}

/// Where F is lowest, and by what.
pub(in crate::contact) struct Lowest {
    pub x: DVec3,
    /// No point of the box has a lower F.
    pub bound: f64,
    /// The faces that hold it, with their weights.
    pub support: SmallVec<[(Side, LiteralId, f64); MOST_HELD]>,
}

/// Faces by their places, with their weights.
type Held = SmallVec<[(usize, f64); MOST_HELD]>;

/// A plane that touches a face: its gradient, its value at the centre of the box, the face's place.
type Cut = (DVec3, f64, usize);

/// Appends the faces of a whole convex solid.
fn members(side: Side, solid: &Solid, place: impl Fn(&Face) -> Face, out: &mut Vec<Member>) -> Option<()> {
    let faces = solid.whole()?.faces.listed();
    if faces.len() != solid.faces.len() || !solid.whole()?.is_convex() || !faces.iter().all(Face::is_convex) {
        return None;
    }
    out.extend(faces.iter().enumerate().map(|(i, face)| Member {
        side,
        id: LiteralId::new(i as u32, Sense::Positive),
        face: place(face),
    }));
    Some(())
}

impl Program {
    /// That of a pair at an instant; `None` where a body is not one convex primitive.
    pub fn of(task: &Task, at: &Instant) -> Option<Self> {
        let mut faces = Vec::with_capacity(task.a.faces.len() + task.b.faces.len());
        members(Side::A, task.a, |face| *face, &mut faces)?;
        let into_a = |face: &Face| face.moved(|x| at.a_point(x), |v| at.a_vector(v));
        members(Side::B, task.b, into_a, &mut faces)?;
        faces.sort_by_key(|m| !m.face.is_flat());
        let flat = faces.partition_point(|m| m.face.is_flat());
        Some(Self { faces, flat })
    }

    /// Where F is lowest in a finite box. Ends once `is_enough` says so of the lowest F that was seen and the bound, or where rounding
    /// does.
    pub fn lowest(&self, within: &Aabb, is_enough: impl Fn(f64, f64) -> bool, work: &Work) -> Lowest {
        let (center, half) = (within.center(), within.half());
        let mut cuts: Vec<Cut> = Vec::with_capacity(self.faces.len() + 8);
        for (i, m) in self.faces[..self.flat].iter().enumerate() {
            let at = m.face.at(center);
            cuts.push((at.normal, at.value, i));
        }
        let mut best = (f64::INFINITY, center);
        let mut proven = Solved { y: DVec3::ZERO, bound: f64::NEG_INFINITY, slope: DVec3::ZERO, held: Held::new() };
        let mut idle = 0;
        self.look(center, center, &mut cuts, &mut best, proven.bound, work);
        for _ in 0..ROUNDS {
            let before = best.0 - proven.bound;
            let solved = solve(&cuts, half, work);
            let y = solved.y;
            if solved.bound > proven.bound {
                proven = solved;
            }
            self.look(center + y, center, &mut cuts, &mut best, proven.bound, work);
            if self.flat == self.faces.len() || is_enough(best.0, proven.bound) {
                break;
            }
            if let Some((x, held)) = self.balance(best.1, &proven, within, work) {
                let found = self.proof(x, held, within);
                if found.bound > proven.bound {
                    proven = found;
                }
                self.look(x, center, &mut cuts, &mut best, proven.bound, work);
                if is_enough(best.0, proven.bound) {
                    break;
                }
            }
            let gap = best.0 - proven.bound;
            let is_better = if gap > FINE * half.max_element() { gap < before } else { gap < 0.5 * before };
            idle = if is_better { 0 } else { idle + 1 };
            if work.is_spent() || idle > MOST_IDLE {
                break;
            }
        }
        // Where F is smooth its value says little of the place, the gradients tell.
        if self.flat < self.faces.len()
            && let Some((x, _)) = self.balance(best.1, &proven, within, work)
        {
            let mut other = (f64::INFINITY, x);
            self.look(x, center, &mut cuts, &mut other, f64::INFINITY, work);
            if other.0 <= best.0 + SHORT * half.max_element() {
                best = other;
            }
        }
        let mut support: SmallVec<[(Side, LiteralId, f64); MOST_HELD]> = SmallVec::new();
        for (i, weight) in proven.held {
            let Member { side, id, .. } = self.faces[i];
            match support.iter_mut().find(|s| (s.0, s.1) == (side, id)) {
                Some(held) => held.2 += weight,
                None => support.push((side, id, weight)),
            }
        }
        Lowest { x: best.1, bound: proven.bound, support }
    }

    /// Looks at F at a point: notes the lowest, and adds the planes that touch curved faces there, if they are above the bound.
    fn look(&self, x: DVec3, center: DVec3, cuts: &mut Vec<Cut>, best: &mut (f64, DVec3), bound: f64, work: &Work) {
        let y = x - center;
        let flat = cuts[..self.flat].iter().map(|(n, b, _)| b + n.dot(y)).fold(f64::NEG_INFINITY, f64::max);
        let mut value = flat;
        for (i, m) in self.faces.iter().enumerate().skip(self.flat) {
            let at = m.face.at(x);
            value = value.max(at.value);
            if at.value >= bound {
                cuts.push((at.normal, at.value - at.normal.dot(y), i));
            }
        }
        work.look(self.flat.div_ceil(PLANES_PER_LOOK) + self.faces.len() - self.flat);
        if value < best.0 {
            *best = (value, x);
        }
    }

    /// What the planes that touch some faces at a point prove, with weights for them.
    fn proof(&self, x: DVec3, mut held: Held, within: &Aabb) -> Solved {
        let y = x - within.center();
        let sum: f64 = held.iter().map(|h| h.1).sum();
        let (mut height, mut slope) = (0.0, DVec3::ZERO);
        for (i, weight) in &mut held {
            *weight /= sum;
            let at = self.faces[*i].face.at(x);
            height += *weight * (at.value - at.normal.dot(y));
            slope += at.normal * *weight;
        }
        let bound = height - slope.abs().dot(within.half());
        Solved { y, bound: if bound.is_nan() { f64::NEG_INFINITY } else { bound }, slope, held }
    }

    /// Where the faces that hold the lowest point of the planes balance, in the box, and their weights: from x on.
    fn balance(&self, x: DVec3, lowest: &Solved, within: &Aabb, work: &Work) -> Option<(DVec3, Held)> {
        let mut active = Held::new();
        for &(i, weight) in lowest.held.iter().filter(|held| held.1 > BALANCED) {
            match active.iter_mut().find(|a| a.0 == i) {
                Some(a) => a.1 += weight,
                None => active.push((i, weight)),
            }
        }
        let size = within.half().max_element();
        let is_within = |found: &(DVec3, Held)| within.contains(found.0);
        // What flat faces hold, as two that are parallel, may be more than a point: the nearest of it to x, unless a curved face is
        // higher there. That bounds it, too.
        if active.len() < MOST_HELD && active.iter().all(|a| a.0 < self.flat) {
            let near = self.newton(x, active.clone(), [None; 3], size, work).filter(is_within);
            let at = near.as_ref().map_or(x, |near| near.0);
            let value = |i: usize| self.faces[i].face.value(at);
            let curved = (self.flat..self.faces.len()).map(|i| (value(i), i)).max_by(|p, q| p.0.total_cmp(&q.0));
            let level = active.iter().map(|a| value(a.0)).fold(f64::NEG_INFINITY, f64::max);
            match curved {
                Some((height, i)) if near.is_none() || height > level => active.push((i, 0.0)),
                _ => return near,
            }
        }
        self.newton(x, active.clone(), [None; 3], size, work).filter(is_within).or_else(|| {
            let (center, half) = (within.center(), within.half());
            let side = |k: usize| center[k] - half[k].copysign(lowest.slope[k]);
            let pressed: [bool; 3] = std::array::from_fn(|k| lowest.slope[k].abs() > BALANCED);
            if !pressed.contains(&true) {
                return None;
            }
            let sides = std::array::from_fn(|k| pressed[k].then(|| side(k)));
            self.newton(x, active, sides, size, work).filter(is_within)
        })
    }

    /// Steps of Newton's method from x to where some faces balance: equally high, their gradients' weighted sum zero but along axes
    /// whose coordinate a side of the box holds.
    fn newton(
        &self,
        mut x: DVec3,
        mut active: Held,
        sides: [Option<f64>; 3],
        size: f64,
        work: &Work,
    ) -> Option<(DVec3, Held)> {
        let m = active.len();
        if m == 0 {
            return None;
        }
        for _ in 0..STEPS {
            work.look(m);
            let mut hessian = DMat3::from_diagonal(DVec3::splat(REGULAR / size));
            let (mut a, mut f) = ([[0.0; UNKNOWNS]; UNKNOWNS], [0.0; UNKNOWNS]);
            for (k, &(i, weight)) in active.iter().enumerate() {
                let face = &self.faces[i].face;
                let at = face.at(x);
                hessian += face.curvature(x, &at).matrix() * weight;
                // f + g·d = level.
                f[4 + k] = -at.value;
                a[4 + k][3] = -1.0;
                for c in 0..3 {
                    a[4 + k][c] = at.normal[c];
                    a[c][4 + k] = at.normal[c];
                }
                a[3][4 + k] = 1.0;
            }
            f[3] = 1.0;
            for (r, c) in (0..9).map(|n| (n / 3, n % 3)) {
                a[r][c] = hessian.col(c)[r];
            }
            for (k, to) in sides.iter().enumerate() {
                if let Some(to) = to {
                    a[k] = std::array::from_fn(|c| f64::from(u8::from(c == k)));
                    f[k] = to - x[k];
                }
            }
            let step = eliminated(&mut a, f, 4 + m)?;
            let d = DVec3::from_slice(&step[..3]);
            if !d.is_finite() {
                return None;
            }
            x += d;
            for (k, a) in active.iter_mut().enumerate() {
                a.1 = step[4 + k].max(0.0);
            }
            if d.length() <= f64::EPSILON * size {
                break;
            }
        }
        Some((x, active))
    }
}

/// The lowest point of some planes over a box.
struct Solved {
    /// From the box's centre.
    y: DVec3,
    /// What the multipliers prove for it.
    bound: f64,
    /// The planes' weighted slopes: what sides of the box hold.
    slope: DVec3,
    /// The multipliers, by the planes' faces.
    held: Held,
}

/// Solves for the lowest point of some planes over a box about the point their values are of.
fn solve(cuts: &[Cut], half: DVec3, work: &Work) -> Solved {
    let all: Vec<usize> = (0..cuts.len()).collect();
    let mut best = solve_some(cuts, &all, half, work);
    let size = cuts.iter().fold(half.max_element(), |size, (_, b, _)| size.max(b.abs()));
    let highest = |y: DVec3| {
        let heights = cuts.iter().map(|(n, b, _)| b + n.dot(y)).enumerate();
        heights.max_by(|p, q| p.1.total_cmp(&q.1)).unwrap_or((0, f64::NEG_INFINITY))
    };
    let mut lowest = (highest(best.y).1, best.y);
    if best.bound >= lowest.0 - SHORT * size {
        return best;
    }
    // Among many planes that all but meet in one point the simplex method loses its digits: of the fewest that tell, one more at a
    // time, it keeps most of them.
    let (mut some, mut around, mut turns) = (vec![highest(DVec3::ZERO).0], half, 0);
    for _ in 0..MOST_ADDED {
        let solved = solve_some(cuts, &some, around, work);
        work.look(cuts.len().div_ceil(PLANES_PER_LOOK));
        let (over, height) = highest(solved.y);
        if height < lowest.0 && solved.y.abs().cmple(half).all() {
            lowest = (height, solved.y);
        }
        if solved.bound > best.bound {
            best = solved;
        }
        if lowest.0 <= best.bound + SHORT * size {
            break;
        }
        if some.contains(&over) {
            // The simplex method went in a circle, as it may where several planes are as good. It takes another way over a box that is a
            // little larger, not the same along each axis; what holds there holds here.
            turns += 1;
            around *= WIDER;
            if turns > MOST_TURNS {
                break;
            }
        } else {
            some.push(over);
        }
    }
    Solved { y: lowest.1, ..best }
}

/// The same of some of the planes.
fn solve_some(cuts: &[Cut], some: &[usize], half: DVec3, work: &Work) -> Solved {
    let mut planes = lp::Planes::default();
    planes.set(some.iter().map(|i| (cuts[*i].0, cuts[*i].1)));
    let mut warm = lp::Warm::default();
    let found = lp::min_max(&mut planes, half, &mut warm);
    work.look((some.len() * (1 + warm.pivots as usize)).div_ceil(PLANES_PER_LOOK));
    // The bound is that of the multipliers as they are, not what the program takes it for.
    let support = &found.support[..found.count];
    let sum: f64 = support.iter().map(|s| s.1).sum();
    let of = |s: &(u32, f64)| (cuts[some[s.0 as usize]], s.1 / sum);
    let height: f64 = support.iter().map(of).map(|((_, b, _), weight)| b * weight).sum();
    let slope: DVec3 = support.iter().map(of).map(|((n, ..), weight)| n * weight).sum();
    let bound = if sum > 0.0 { height - slope.abs().dot(half) } else { f64::NEG_INFINITY };
    let held = support.iter().map(|s| (cuts[some[s.0 as usize]].2, s.1)).collect();
    Solved { y: found.y, bound, slope, held }
}
