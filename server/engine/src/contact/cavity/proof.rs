//! That a cut body stays inside a cavity for a while: sectors of directions times spans of time.
//!
//! A contact of depth delta of the body P with the wall of a round cavity (axis through o, radius R), within the half-spaces
//! n_k·x <= d_k, needs for the direction u from the axis to it and any multipliers μ, κ (`body`)
//!
//! ```text
//! φ = R|u| + o·u − κ − max over P of w·x  <=  −delta (|u| + |w| + |μ|),      w = u − μ,
//! ```
//!
//! as P and the half-spaces shrink by delta and the cavity grows by it. Let u go along the chord from u₁ to u₂, and w, μ, κ
//! linearly with it, by σ, and with time by s. Of a disc of P with radius r
//!
//! ```text
//! R|u| >= R(1−σ + σ) − R d_u,   d_u = σ(1−σ) D² / (1 + |u|),                    D = |u₁ − u₂|, |u₁| = |u₂| = 1,
//! r|w⊥| = r((1−σ)|w₁⊥| + σ|w₂⊥|) − r d_w,   d_w (2W − d_w) >= σ(1−σ) X,      X = |w₁⊥ − w₂⊥|² − (|w₁⊥| − |w₂⊥|)²,
//! ```
//!
//! W the larger |w⊥|. With Y = X/D², κ' (2W − κ' d) <= Y (2 − d) for d = 0 and for the largest d_u gives d_w >= κ' d_u: what
//! the wall bends away from its chord the disc does too, and with like curvatures the two cancel. So
//!
//! ```text
//! φ >= (1−σ) φ₁ + σ φ₂ − σ(1−σ) K,    K = (R − κ' r) D² / (1 + √(1 − D²/4)),  or half that D² where R < κ' r.
//! ```
//!
//! The planes that touch a cone lean: (u + l)·(x − o) <= R, l = −tan α a, a the axis to its wide end, o and R of its widest section. With
//! u + l for u all of this holds, l being the same along a chord: a point beyond the wall by delta at a height z has |x⊥| >= R(z) +
//! delta/cos α, R(z) its section there, 1/cos α = |u + l|. d_u is multiplied by R(z), for which R stands: it is no larger.
//!
//! In time, for every material point of P, (w·x)'' is at most 2|Δw|/h·V + |w·x''|, so between two moments φ is above the
//! line through its values there, less ½ Q s(1−s) h²; positive throughout where ½ Q h² <= (√φ₀ + √φ₁)².
//! A flat wall is one direction, and a plane that keeps P out is a bound with u = 0: for those D = 0.
//!
//! A disc that spins about its own axis stays what it is, though its points go round. So where the cavity does not turn and w stays,
//! Q is also taken from its centre c and axis a, with ω fixed to P: of the reach c·w + r G, G = |w⊥| = √(|w|² − s²), s = w·a,
//!
//! ```text
//! |c''·w| <= |w×ω| |ω×(c − o)|,    −G'' = s'² |w|²/G³ + s s''/G,    |s'| <= |w×ω| |ω×a|/|ω|,    |s''| <= |w×ω| |ω×a|,
//! ```
//!
//! o a point of P's axis of rotation: next to nothing where P spins nearly about its own axis.
//! Source: the duality is that of `body`; the rest is derived here.

use super::body::{Best, Bound, Moment};
use super::pierced::{CavityPair, Wall};
use glam::DVec3;
use smallvec::SmallVec;

/// Rectangles of directions and time that one proof may look at.
const MOST_RECTANGLES: usize = 600;
/// Narrowest sector (its chord) and shortest span (steps).
const NARROWEST: f64 = 1e-4;
const SHORTEST: f64 = 1e-6;
/// Part of a sector in which it is not divided.
const MARGIN: f64 = 0.02;
/// Least part of |w|² across a disc's axis for which its wobble is worked out; the rounding of what it adds up.
const LEANS: f64 = 1e-4;
const ROUNDED: f64 = 1.0 + 1e-12;
/// Least part of what is proven that is claimed: rounding of the few sums.
const CLAIMED: f64 = 1.0 - 1e-12;

/// How a proof ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ProofEnd {
    Proven,
    /// The bounds say that something is met at this moment in this direction.
    Met(f64, Wall),
    /// Neither shown.
    Open,
}

/// Two directions and two moments, with the best bounds at each: `[time][direction]`, by their places among all.
#[derive(Clone, Copy, Debug)]
struct Rectangle {
    walls: [Wall; 2],
    times: [usize; 2],
    best: [[usize; 2]; 2],
}

/// Bounds at the corners of a rectangle: those of each moment, or one row that is taken for both.
#[derive(Clone, Copy)]
struct Bounds<'a>([[&'a Bound; 2]; 2], usize);

/// What a proof keeps of a best bound.
#[derive(Clone, Copy, Debug)]
struct Corner {
    bound: Bound,
    phi: f64,
    /// What at least must be added for it to exclude a contact.
    reserve: f64,
    /// How fast φ grows with the direction.
    slope: f64,
}

/// What bounds say of a rectangle.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Worth {
    /// Even its corners are too low, or time takes too much.
    None,
    /// But for the bend between its two directions.
    Corners,
    All,
}

/// Which of a rectangle's corners differ: one moment's bounds may be taken for both, and a flat wall is one direction.
#[derive(Clone, Copy, Debug)]
struct Distinct {
    rows: usize,
    columns: usize,
}

impl Distinct {
    /// A number of each corner, worked out once for those that are alike.
    #[inline(always)] // In the innermost loop of a proof: a call would cost what is saved.
    fn spread<T: Copy>(self, of: impl Fn(usize, usize) -> T) -> [[T; 2]; 2] {
        let row = |e: usize| {
            let first = of(e, 0);
            [first, if self.columns == 1 { first } else { of(e, 1) }]
        };
        let first = row(0);
        [first, if self.rows == 1 { first } else { row(1) }]
    }
}

impl CavityPair<'_> {
    /// What must be added to φ at each corner so that positive sums exclude a contact: delta times a linear function that is
    /// nowhere above the weight, less rounding. A norm is no less than the part along any one direction, here the corners' mean.
    fn reserves(&self, Bounds(bounds, _): Bounds, w: &[[DVec3; 2]; 2], distinct: Distinct) -> [[f64; 2]; 2] {
        let (mut sums, mut heaviest) = ([DVec3::ZERO; 3], 0.0f64);
        for e in 0..distinct.rows {
            for c in 0..distinct.columns {
                let b = bounds[e][c];
                sums[0] += b.u;
                sums[1] += w[e][c];
                sums[2] += b.mu;
                heaviest = heaviest.max(b.u.length() + w[e][c].length() + b.mu.length());
            }
        }
        let [u, v, m] = sums.map(DVec3::normalize_or_zero);
        distinct.spread(|e, c| {
            let b = bounds[e][c];
            let weight = b.u.dot(u) + w[e][c].dot(v) + b.mu.dot(m);
            self.delta * weight * CLAIMED - 2.0 * self.rounding * heaviest
        })
    }

    /// Whether bounds at the four corners exclude the rectangle.
    fn worth(&self, moments: [&Moment; 2], of_corners: Bounds) -> Worth {
        let Bounds(bounds, rows) = of_corners;
        let chord = (bounds[0][0].u - bounds[0][1].u).length_squared();
        let distinct = Distinct { rows, columns: if chord > 0.0 { 2 } else { 1 } };
        let w = distinct.spread(|e, c| bounds[e][c].w());
        let reserves = self.reserves(of_corners, &w, distinct);
        // What the motion may take.
        let h = moments[1].at.t - moments[0].at.t;
        let turns = self.relative.turns();
        let turned = if rows == 1 { 0.0 } else { (w[1][0] - w[0][0]).length().max((w[1][1] - w[0][1]).length()) };
        let mut half_q = 0.0;
        if turned > 0.0 || turns {
            let motion = self.relative.bounds(moments[0].at.t, h, self.reach);
            let mut pull: f64 = 0.0;
            for row in &w[..distinct.rows] {
                for w in &row[..distinct.columns] {
                    let bend = motion.bend * w.length();
                    pull = pull.max(motion.curvature(&moments[0].at, moments[0].at.a_vector(*w)) + bend);
                }
            }
            half_q = (turned * motion.speed + 0.5 * h * pull) * h;
        }
        // Across the discs' axis, which stays where nothing turns.
        let of_axes = if turns { Distinct { rows: 2, ..distinct } } else { distinct };
        let across = of_axes.spread(|e, c| moments[e].across(w[e][c]));
        let lengths = of_axes.spread(|e, c| across[e][c].length());
        let mut worth = Worth::All;
        let stays = turned == 0.0 && half_q > 0.0 && moments[0].at.spin_b == DVec3::ZERO;
        for i in 0..moments[0].discs.len() {
            let radius = moments[0].discs[i].1;
            let mut half_q = half_q;
            // Worked out where the way that points go takes too much, and only then.
            let takes = |ends: [f64; 2], half_q: f64| ends[0].min(ends[1]) > 0.0 && !holds(ends, half_q);
            let each = Distinct { rows: 2, ..distinct };
            let phi = each.spread(|e, c| {
                let b = bounds[e][c];
                b.base - b.kappa - moments[e].discs[i].0.dot(w[e][c]) - radius * lengths[e][c] + reserves[e][c]
            });
            let corners = [phi[0][0].min(phi[0][1]), phi[1][0].min(phi[1][1])];
            if stays && takes(corners, half_q) {
                half_q = half_q.min(self.wobble(moments, i, w[0]));
            }
            if !holds(corners, half_q) {
                // A wide sector's reserves are less than what its corners have alone.
                let own = each.spread(|e, c| {
                    let b = bounds[e][c];
                    phi[e][c] - reserves[e][c] + (self.delta * CLAIMED - 2.0 * self.rounding) * b.weight()
                });
                let alone = [own[0][0].min(own[0][1]), own[1][0].min(own[1][1])];
                if chord == 0.0 || !holds(alone, half_q) {
                    return Worth::None;
                }
                worth = Worth::Corners;
            }
            if chord > 0.0 && worth == Worth::All {
                let between =
                    [0, 1].map(|e| sagging(phi[e], bend(self.radius(), radius, chord, across[e], lengths[e])));
                if stays && takes(between, half_q) {
                    half_q = half_q.min(self.wobble(moments, i, w[0]));
                }
                if !holds(between, half_q) {
                    worth = Worth::Corners;
                }
            }
        }
        worth
    }

    /// ½ Q h² of one disc between two moments, by its centre and axis, for directions w on the segment between two.
    fn wobble(&self, moments: [&Moment; 2], i: usize, w: [DVec3; 2]) -> f64 {
        let at = &moments[0].at;
        let h = moments[1].at.t - at.t;
        let (center, radius) = self.body.discs[i];
        let omega = at.b_from_a * at.omega;
        let most = |f: &dyn Fn(DVec3) -> f64| f(w[0]).max(f(w[1]));
        let (length, across) = (most(&|w| w.length()), most(&|w| w.cross(omega).length()));
        let mut pull = across * at.omega.cross(center - at.center_a).length();
        if let Some(axis) = self.body.axis.filter(|_| radius > 0.0) {
            let (turning, spin) = (at.omega.cross(axis).length(), at.omega.length());
            let (first, second) = (across * turning / spin, across * turning);
            let seen = |m: &Moment| m.axis.map_or(0.0, |a| most(&|w| w.dot(a).abs()));
            let along = seen(moments[0]).max(seen(moments[1])) + 0.5 * h * first;
            // No shorter than the segment's distance from 0.
            let (from, way) = (w[0], w[1] - w[0]);
            let foot = if way == DVec3::ZERO { 0.0 } else { (-from.dot(way) / way.length_squared()).clamp(0.0, 1.0) };
            let room = (from + way * foot).length_squared() - along * along;
            if room <= LEANS * length * length {
                return f64::INFINITY;
            }
            let g = room.sqrt();
            pull += radius * (first * first * length * length / (g * g * g) + along * second / g);
        }
        let motion = self.relative.bounds(at.t, h, self.reach);
        0.5 * h * h * (pull * ROUNDED + 2.0 * motion.bend * length)
    }

    /// The worth of the best of a few ways to take multipliers over a rectangle: those of its end, of its start, or from
    /// the one to the other.
    fn worth_of(&self, moments: &[Moment], corners: &[Corner], r: &Rectangle) -> Worth {
        let both = [&moments[r.times[0]], &moments[r.times[1]]];
        let [start, end] = r.best.map(|row| row.map(|place| &corners[place].bound));
        let mut worth = Worth::None;
        for bounds in [Bounds([end; 2], 1), Bounds([start; 2], 1), Bounds([start, end], 2)] {
            let this = self.worth(both, bounds);
            if this == Worth::All {
                return this;
            }
            if this > worth {
                worth = this;
            }
        }
        worth
    }

    fn corner(&self, m: &Moment, wall: Wall) -> Corner {
        let best = self.best(m, wall);
        let reserve = (self.delta * CLAIMED - 2.0 * self.rounding) * best.bound.weight();
        Corner { bound: best.bound, phi: best.phi, reserve, slope: self.slope(&best) }
    }

    /// True when one plane keeps the body out from the start to `end`.
    pub(super) fn kept_out(&self, start: &Moment, end: &Moment) -> bool {
        self.planes.iter().any(|plane| {
            let bound = Bound { u: DVec3::ZERO, base: 0.0, mu: plane.normal, kappa: plane.offset };
            self.worth([start, end], Bounds([[&bound; 2]; 2], 1)) == Worth::All
        })
    }

    /// Proves that nothing is met from t = 0 to `end`, the round wall divided in the direction `toward` first.
    pub(super) fn prove(&self, end: f64, toward: Option<DVec3>) -> (ProofEnd, u64) {
        let mut moments: SmallVec<[Moment; 6]> = SmallVec::new();
        moments.push(self.moment(0.0));
        moments.push(self.moment(end));
        if self.kept_out(&moments[0], &moments[1]) {
            return (ProofEnd::Proven, 2);
        }
        let mut stack: SmallVec<[Rectangle; 16]> = SmallVec::new();
        let mut corners: SmallVec<[Corner; 16]> = SmallVec::new();
        let placed = |corners: &mut SmallVec<[Corner; 16]>, m: &Moment, wall: Wall| {
            corners.push(self.corner(m, wall));
            corners.len() - 1
        };
        for j in 0..self.flats.len() {
            let [s, e] = [0, 1].map(|k| placed(&mut corners, &moments[k], Wall::Flat(j)));
            stack.push(Rectangle { walls: [Wall::Flat(j); 2], times: [0, 1], best: [[s; 2], [e; 2]] });
        }
        if let Some(round) = &self.round {
            let u = toward.unwrap_or(self.directions[0]);
            let v = round.axis.cross(u);
            let around = [u, v, -u, -v];
            let rows = around.map(|u| [0, 1].map(|k| placed(&mut corners, &moments[k], Wall::Round(u))));
            for k in 0..4 {
                let l = (k + 1) % 4;
                let best = [[rows[k][0], rows[l][0]], [rows[k][1], rows[l][1]]];
                stack.push(Rectangle { walls: [around[k], around[l]].map(Wall::Round), times: [0, 1], best });
            }
        }
        for _ in 0..MOST_RECTANGLES {
            let Some(r) = stack.pop() else { return (ProofEnd::Proven, moments.len() as u64) };
            for (e, row) in r.best.iter().enumerate() {
                for (place, wall) in row.iter().zip(r.walls) {
                    let best = &corners[*place];
                    if best.phi + best.reserve <= 0.0 {
                        return (ProofEnd::Met(moments[r.times[e]].at.t, wall), moments.len() as u64);
                    }
                }
            }
            match self.worth_of(&moments, &corners, &r) {
                Worth::All => {}
                Worth::Corners => {
                    let [Wall::Round(from), Wall::Round(to)] = r.walls else { break };
                    if (to - from).length_squared() < NARROWEST * NARROWEST {
                        break;
                    }
                    // Where the end's φ is lowest, if it is within.
                    let slopes = r.best[1].map(|place| corners[place].slope);
                    let mut part = 0.5;
                    if slopes[0] < 0.0 && slopes[1] > 0.0 {
                        let lowest = slopes[0] / (slopes[0] - slopes[1]);
                        if (MARGIN..=1.0 - MARGIN).contains(&lowest) {
                            part = lowest;
                        }
                    }
                    let middle = Wall::Round(from.lerp(to, part).normalize());
                    let best = r.times.map(|t| placed(&mut corners, &moments[t], middle));
                    let [[a, b], [c, d]] = r.best;
                    stack.push(Rectangle { walls: [middle, r.walls[1]], best: [[best[0], b], [best[1], d]], ..r });
                    stack.push(Rectangle { walls: [r.walls[0], middle], best: [[a, best[0]], [c, best[1]]], ..r });
                }
                Worth::None => {
                    let [from, to] = r.times.map(|t| moments[t].at.t);
                    if to - from < SHORTEST || moments.len() > usize::from(u8::MAX) {
                        break;
                    }
                    let middle = 0.5 * (from + to);
                    let known = moments.iter().position(|m| m.at.t == middle);
                    let t = known.unwrap_or_else(|| {
                        moments.push(self.moment(middle));
                        moments.len() - 1
                    });
                    let best = r.walls.map(|wall| placed(&mut corners, &moments[t], wall));
                    stack.push(Rectangle { times: [t, r.times[1]], best: [best, r.best[1]], ..r });
                    stack.push(Rectangle { times: [r.times[0], t], best: [r.best[0], best], ..r });
                }
            }
        }
        (ProofEnd::Open, moments.len() as u64)
    }

    /// The direction between two at which φ is lowest at a moment; regula falsi on its slope.
    pub(super) fn lowest(&self, m: &Moment, mut ends: [Best; 2], rounds: usize) -> (DVec3, Best) {
        let mut slopes = ends.map(|best| self.slope(&best));
        let across = |best: &Best| self.round.map_or(best.bound.u, |round| round.across(&best.bound));
        for _ in 0..rounds {
            if !(slopes[0] < 0.0 && slopes[1] > 0.0) {
                break;
            }
            let part = (slopes[0] / (slopes[0] - slopes[1])).clamp(MARGIN, 1.0 - MARGIN);
            let middle = across(&ends[0]).lerp(across(&ends[1]), part).normalize();
            let best = self.best(m, Wall::Round(middle));
            let slope = self.slope(&best);
            // The other end's slope counts half (Illinois).
            if slope < 0.0 {
                (ends[0], slopes[0]) = (best, slope);
                slopes[1] *= 0.5;
            } else {
                (ends[1], slopes[1]) = (best, slope);
                slopes[0] *= 0.5;
            }
        }
        let best = if ends[0].phi <= ends[1].phi { ends[0] } else { ends[1] };
        (across(&best), best)
    }
}

/// True when bounds that are above `f` and `g` at two moments stay positive between them, whatever the motion takes of them.
fn holds([f, g]: [f64; 2], half_q: f64) -> bool {
    if !(f > 0.0 && g > 0.0) {
        return false;
    }
    let root = f.sqrt() + g.sqrt();
    half_q <= root * root * CLAIMED
}

/// K: how far below its chord φ may sag between two directions, times four; from w⊥ there and its lengths.
fn bend(wall: f64, disc: f64, chord: f64, [w1, w2]: [DVec3; 2], [l1, l2]: [f64; 2]) -> f64 {
    let most = l1.max(l2);
    let flat = (1.0 - 0.25 * chord).max(0.0).sqrt();
    let deepest = 1.0 - flat;
    let x = ((w1 - w2).length_squared() - (l1 - l2) * (l1 - l2)).max(0.0);
    let y = x / chord;
    let mut share: f64 = 0.0;
    if most > 0.0 {
        let room = most * most - deepest * y * (2.0 - deepest);
        let far = if room >= 0.0 { y * (2.0 - deepest) / (most + room.sqrt()) } else { most / deepest };
        share = (y / most).min(far);
    }
    let k = wall - share * disc * CLAIMED;
    if k > 0.0 { k * chord / (1.0 + flat) } else { k * chord * 0.5 }
}

/// The least of (1−σ) a + σ b − σ(1−σ) k over [0, 1].
fn sagging([a, b]: [f64; 2], k: f64) -> f64 {
    let low = a.min(b);
    if k <= (b - a).abs() {
        // Lowest at an end; without a bend, or where one end falls to the other all the way.
        return low;
    }
    let fall = k - (b - a);
    a - fall * fall / (4.0 * k)
}

#[cfg(test)]
mod tests {
    use super::{bend, sagging};
    use glam::DVec3;

    #[test]
    fn a_sagging_chord_is_lowest_where_sampled() {
        for (a, b, k) in
            [(1.0, 1.0, 2.0), (1.0, 2.0, 0.5), (0.1, 3.0, 4.0), (3.0, 0.1, 4.0), (1.0, 2.0, -1.0), (0.0, 1.0, 1.0)]
        {
            let at = |s: f64| (1.0 - s) * a + s * b - s * (1.0 - s) * k;
            let least = (0..=1000).map(|i| at(f64::from(i) / 1000.0)).fold(f64::INFINITY, f64::min);
            assert!((sagging([a, b], k) - least).abs() < 1e-5, "{a} {b} {k}");
        }
    }

    #[test]
    fn the_bend_bounds_the_difference_of_two_norms() {
        let at = |a: f64, s: f64| DVec3::new(a.cos(), s * a.sin(), 0.3 * s * a.cos());
        for (wall, disc, stretch) in
            [(0.25, 0.24, 1.0), (0.25, 0.25, 1.02), (0.25, 0.2, 0.7), (0.1, 0.4, 1.0), (0.25, 0.0, 1.0)]
        {
            for (from, to) in [(0.1, 0.8), (1.2, 1.3), (3.0, 3.001), (2.0, 2.785)] {
                let [u1, u2] = [at(from, 1.0), at(to, 1.0)].map(|u| DVec3::new(u.x, u.y, 0.0));
                let [w1, w2] = [at(from, stretch), at(to, stretch)];
                let chord = (u1 - u2).length_squared();
                let k = bend(wall, disc, chord, [w1, w2], [w1.length(), w2.length()]);
                let value = |s: f64| wall * u1.lerp(u2, s).length() - disc * w1.lerp(w2, s).length();
                for i in 0..=100 {
                    let s = f64::from(i) / 100.0;
                    let line = (1.0 - s) * value(0.0) + s * value(1.0);
                    let slack = value(s) - line + s * (1.0 - s) * k;
                    assert!(slack >= -1e-15, "{wall} {disc} {stretch}: {slack:e}");
                }
            }
        }
    }
}
