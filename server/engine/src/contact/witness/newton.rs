//! The exact contact of a few literals: Newton on the optimality conditions of "deepest common point".
//!
//! Unknowns x (A's model frame), t and multipliers λ; for active constraints c_i with gradients g_i
//!
//! ```text
//! c_i(x, t) = −level,    Σ λ_i g_i = 0,    Σ λ_i = 1 (over literals)
//! ```
//!
//! Two literals: face against face; three: edge against face; four: vertex against face or edge against edge. A cone's
//! apex is a vertex of its own: its literal is replaced by three planes through the apex of the offset cone (moved by
//! level/sin α along the axis), whose multipliers are free in sign.
//! Steps are Levenberg-Marquardt with damping by the squared residual, so that degenerate sets (parallel faces,
//! redundant planes) converge to their nearest solution (Yamashita & Fukushima 2001). Where multipliers do not settle but
//! the surfaces do meet, minimum-norm steps on c_i = −level alone finish.
//! Nothing here is trusted: the search accepts a solution only when both whole trees confirm it.

use crate::contact::exclusion::literal::{Faces, Side};
use crate::contact::query::task::Task;
use crate::math::halt;
use crate::motion::{Instant, Relative};
use crate::solid::local::LiteralId;
use crate::solid::surface::{Apex, Curvature, FaceAt};
use crate::solid::{Face, Sense};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// How far from the step a solution is looked for, in steps; farther only while a slow pair has hardly moved by then.
const FARTHEST: f64 = 4.0;
/// Way, in scales, that hardly is one.
const HARDLY: f64 = 1e-6;
/// What a row of a system costs, in looks at a face.
const ROW: usize = 4;
/// Steps in which a slow pair passes its scale.
const SLOW: f64 = 1e3;
/// |Σ λ g| below which multipliers have settled.
pub(in crate::contact) const SETTLED: f64 = 1e-6;
/// Constraints that hold a point in space and time.
pub(in crate::contact) const HELD: usize = 4;
/// Most constraints a system may hold.
pub const MAX_ACTIVE: usize = 6;
/// Least damping: keeps a singular system (redundant planes, an apex on an apex) positive definite in rounded arithmetic.
const LEAST_DAMPING: f64 = 1e-14;
/// A guess from which the squared residual does not fall by `PROGRESS` in so many steps leads nowhere.
const PATIENCE: usize = 8;
const PROGRESS: f64 = 0.25;
/// Damped steps in a row that hardly lower it, after which one without damping is tried: along a rim in another's rim the system is so
/// nearly singular that the least damping is much …
const SLOW_STEPS: usize = 3;
/// … from a squared residual below this.
const NEAR: f64 = 1e-8;
/// Damped steps that follow one without.
const CORRECTIONS: usize = 4;
pub(in crate::contact) const MAX_UNKNOWNS: usize = MAX_ACTIVE + 4;

/// Active constraints, in place.
pub type Actives = SmallVec<[Constraint; MAX_ACTIVE]>;
/// Their multipliers, in place.
pub type Weights = SmallVec<[f64; MAX_ACTIVE]>;

/// One active constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constraint {
    /// A face of the solid, with its sense.
    Literal(Side, LiteralId),
    /// A plane through a cone's offset apex: direction `axis` index 0..3 (0 the axis, 1 and 2 perpendiculars) of cone face.
    Apex(Side, LiteralId, u8),
}

impl Constraint {
    /// The face, where it is one.
    pub fn literal(&self) -> Option<(Side, LiteralId)> {
        match *self {
            Self::Literal(side, id) => Some((side, id)),
            Self::Apex(..) => None,
        }
    }
}

/// A point of contact in space-time with its multipliers.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Point, A's model frame.
    pub x: DVec3,
    /// Time, fraction of the step.
    pub t: f64,
    /// The active constraints.
    pub active: Actives,
    /// Their multipliers.
    pub lambda: Weights,
    /// Largest |Σ λ g| left.
    pub stationarity: f64,
}

impl Solution {
    /// The point at a time between this solution's and a later one's, on the straight way from the one to the other.
    pub(in crate::contact) fn before(&self, later: &Solution, t: f64) -> DVec3 {
        self.x + (later.x - self.x) * ((t - self.t) / (later.t - self.t))
    }
}

/// Steps in which the slowest motion that is told from rest passes the scale of a pair.
const SLOWEST: f64 = 1e12;

/// What the equations are about.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// A's faces.
    pub a: Faces<'a>,
    /// B's faces.
    pub b: Faces<'a>,
    /// Relative motion.
    pub relative: &'a Relative,
    /// Length scale of the pair.
    pub scale: f64,
    /// Time in which the pair moves by about its scale.
    pub time_scale: f64,
    /// Residual of the constraints below which they count as met.
    pub tolerance: f64,
}

/// Where the steps stand: place and time, multipliers, residual, Jacobian, squared residual.
type State = ((DVec3, f64), Weights, [f64; MAX_UNKNOWNS], [[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS], f64);

/// A constraint's value, gradient, Hessian, time derivatives; A's axes.
pub struct Row {
    pub(crate) value: f64,
    pub(crate) gradient: DVec3,
    pub(crate) hessian: DMat3,
    pub(crate) rate: f64,
    pub(crate) gradient_rate: DVec3,
}

/// Hessian of psi of a face at a point, in the face's own frame.
pub(in crate::contact) fn hessian(face: &Face, x: DVec3) -> DMat3 {
    hessian_at(face, x, &face.at(x))
}

/// The same where what the face is at `x` is known.
pub(in crate::contact) fn hessian_at(face: &Face, x: DVec3, at: &FaceAt) -> DMat3 {
    face.curvature(x, at).matrix()
}

impl<'a> Problem<'a> {
    /// The equations of a contact, in the pair's units.
    pub fn of(task: &'a Task) -> Self {
        let speed = task.relative.bounds(0.0, 1.0, task.scale).speed;
        Self {
            a: Faces { solid: task.a, clip_planes: &[] },
            b: Faces { solid: task.b, clip_planes: &[] },
            relative: &task.relative,
            scale: task.scale,
            // However slow the pair: else equations that only time can meet look as if they had no solution.
            time_scale: (task.scale / speed.max(f64::MIN_POSITIVE)).min(SLOWEST),
            tolerance: 0.5 * task.rounding,
        }
    }
}

impl Problem<'_> {
    /// The constraint at (x, instant), for a contact at depth `level`: value is c + level.
    pub fn row(&self, c: &Constraint, x: DVec3, at: &Instant, level: f64) -> Row {
        let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *c;
        let face = if side == Side::A { self.a.get(id.face()) } else { self.b.get(id.face()) };
        let own = if side == Side::A { x } else { at.b_point(x) };
        let (value, mut gradient, mut curvature) = match *c {
            Constraint::Literal(..) => {
                let f = face.at(own);
                let curvature = face.curvature(own, &f);
                if id.sense() == Sense::Positive {
                    (f.value + level, f.normal, curvature)
                } else {
                    (-f.value + level, -f.normal, curvature.negated())
                }
            }
            Constraint::Apex(_, _, k) => {
                let apex = face.apex().expect("a constraint at an apex is of a face that has one");
                let n = apex.directions()[k as usize];
                let shift = if k == 0 { level / apex.sin } else { 0.0 };
                (n.dot(own - apex.point) - shift, n, Curvature::NONE)
            }
        };
        let (mut rate, mut gradient_rate) = (0.0, DVec3::ZERO);
        if side == Side::B {
            gradient = at.a_vector(gradient);
            curvature.along = at.a_vector(curvature.along);
            if curvature.other != 0.0 {
                curvature.beside = at.a_vector(curvature.beside);
            }
            let v = at.velocity(x);
            rate = gradient.dot(v);
            // B's field turns with −omega against A and is passed through at v.
            gradient_rate = curvature.times(v) - at.omega.cross(gradient);
        }
        Row { value, gradient, hessian: curvature.matrix(), rate, gradient_rate }
    }

    /// Solves from a starting guess. `None` when it does not converge to finite numbers, or, where one is not `patient` and the
    /// constraints leave something open, not steadily.
    pub fn solve(
        &self,
        active: &[Constraint],
        x: DVec3,
        t: f64,
        lambda: &[f64],
        level: f64,
        patient: bool,
    ) -> Option<Solution> {
        let found = self.descend(active, x, t, lambda, level, patient);
        let is_settled = found.as_ref().is_some_and(|s| s.stationarity < SETTLED);
        if is_settled || active.len() < HELD {
            return found;
        }
        self.settle(active, x, t, level).filter(|s| s.stationarity < SETTLED).or(found)
    }

    /// The place and time of constraints that leave neither open, and the multipliers that balance there. Where one column of
    /// the whole system is small against the others (how fast a body moves that is small against its partner) or two
    /// faces are nearly opposite (a rim in its hole's rim), the damped steps of the whole stop short of it.
    fn settle(&self, active: &[Constraint], x: DVec3, t: f64, level: f64) -> Option<Solution> {
        let (x, t) = self.meet(active, x, t, level)?;
        let at = self.relative.at(t);
        let m = active.len();
        let gradients: SmallVec<[DVec3; MAX_ACTIVE]> =
            active.iter().map(|c| self.row(c, x, &at, level).gradient).collect();
        // What is summed to 1; of apexes alone the first one is held at −1.
        let literal = |i: usize| f64::from(u8::from(matches!(active[i], Constraint::Literal(..))));
        let any = (0..m).any(|i| literal(i) > 0.0);
        let (weight, total) =
            (|i: usize| if any { literal(i) } else { f64::from(u8::from(i == 0)) }, if any { 1.0 } else { -1.0 });
        let mut lambda: Weights = SmallVec::from_elem(0.0, m);
        let mut sum = DVec3::ZERO;
        // Least squares, once more for what the damping left.
        for _ in 0..3 {
            let (mut gram, mut rhs) = ([[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS], [0.0; MAX_UNKNOWNS]);
            let left = total - (0..m).map(|i| weight(i) * lambda[i]).sum::<f64>();
            for i in 0..m {
                for j in 0..m {
                    gram[i][j] = gradients[i].dot(gradients[j]) + weight(i) * weight(j);
                }
                gram[i][i] += LEAST_DAMPING;
                rhs[i] = weight(i) * left - gradients[i].dot(sum);
            }
            let step = cholesky_solve(&mut gram, rhs, m)?;
            lambda.iter_mut().zip(&step).for_each(|(l, s)| *l += s);
            sum = gradients.iter().zip(&lambda).map(|(g, l)| *g * *l).sum();
        }
        let left = (total - (0..m).map(|i| weight(i) * lambda[i]).sum::<f64>()).abs();
        let stationarity = sum.abs().max_element().max(left);
        let active = Actives::from_slice(active);
        stationarity.is_finite().then_some(Solution { x, t, active, lambda, stationarity })
    }

    /// Damped steps on place, time and multipliers together; see `solve`.
    fn descend(
        &self,
        active: &[Constraint],
        x: DVec3,
        t: f64,
        lambda: &[f64],
        level: f64,
        patient: bool,
    ) -> Option<Solution> {
        let m = active.len();
        debug_assert!(m <= MAX_ACTIVE && lambda.len() == m);
        let n = m + 4;
        let (mut x, mut t, mut lambda) = (x, t, Weights::from_slice(lambda));
        let mut f = [0.0; MAX_UNKNOWNS];
        let mut jac = [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS];
        let mut best: f64 = self.fill(active, (x, t), &lambda, level, (&mut f, &mut jac));
        if self.time_scale > SLOW {
            // Multipliers first: in the time that a slow pair takes to turn its normals towards wrong ones it is far away.
            let mut still = jac;
            still.iter_mut().for_each(|row| row[..4].fill(0.0));
            let step = damped_step(&still, &f, n, LEAST_DAMPING)?;
            lambda.iter_mut().zip(&step[4..n]).for_each(|(l, s)| *l += s);
            best = self.fill(active, (x, t), &lambda, level, (&mut f, &mut jac));
        }
        let mut damping = 1.0;
        let far = FARTHEST.max(HARDLY * self.time_scale);
        let mut checked = best;
        let mut slow = 0;
        for round in 0..60 {
            if best < 1e-30 {
                break;
            }
            // Where steps were slow before they came so near they are as slow along a face: none is tried in that row.
            if slow == SLOW_STEPS && best < NEAR {
                slow = 0;
                if let Some(next) = self.undamped(active, (x, t, &lambda), level, (&f, &jac, best), far) {
                    ((x, t), lambda, f, jac, best) = next;
                    continue;
                }
            }
            if !patient && round % PATIENCE == PATIENCE - 1 {
                if best > checked * PROGRESS && best > 1e-20 {
                    return None;
                }
                checked = best;
            }
            let mu = damping * best.min(1e-2);
            let step = damped_step(&jac, &f, n, mu.max(LEAST_DAMPING))?;
            let shrink = (0.5 * far / (step[3] * self.time_scale).abs()).min(1.0);
            let step = step.map(|s| s * shrink);
            let sx = DVec3::new(step[0], step[1], step[2]) * self.scale;
            let st = step[3] * self.time_scale;
            if !(sx.is_finite() && st.is_finite()) {
                return None;
            }
            let (nx, nt) = (x + sx, t + st);
            let nl: Weights = lambda.iter().zip(&step[4..n]).map(|(l, s)| l + s).collect();
            let (mut nf, mut nj) = ([0.0; MAX_UNKNOWNS], [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS]);
            if nt.abs() > far {
                damping *= 16.0;
                if damping > 1e12 {
                    return None;
                }
                continue;
            }
            let next = self.fill(active, (nx, nt), &nl, level, (&mut nf, &mut nj));
            if next < best {
                slow = if next > PROGRESS * best { slow + 1 } else { 0 };
                let stalled = next > 0.25 * best && best < 1e-26;
                (x, t, lambda, f, jac, best) = (nx, nt, nl, nf, nj, next);
                damping = (damping * 0.1).max(1e-6);
                if stalled {
                    break;
                }
            } else {
                if best < 1e-26 {
                    break;
                }
                damping *= 16.0;
                if damping > 1e14 {
                    break;
                }
            }
        }
        (x, t) = self.meet(active, x, t, level)?;
        let at = self.relative.at(t);
        let sum = active.iter().zip(&lambda).map(|(c, l)| self.row(c, x, &at, level).gradient * *l).sum::<DVec3>();
        Some(Solution { x, t, active: Actives::from_slice(active), lambda, stationarity: sum.abs().max_element() })
    }

    /// A step without damping, or a part of it, after which the squared residual is less than `PROGRESS` of what it was, be it at an
    /// earlier time or at a later one. Damped steps lead back to the surfaces where it left them, as a long step along a rim does.
    fn undamped(
        &self,
        active: &[Constraint],
        (x, t, lambda): (DVec3, f64, &Weights),
        level: f64,
        (f, jac, best): (&[f64; MAX_UNKNOWNS], &[[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS], f64),
        far: f64,
    ) -> Option<State> {
        let n = active.len() + 4;
        let step = eliminate(&mut jac.clone(), *f, n)?;
        for part in [1.0, 0.25] {
            let mut step = step.map(|s| -part * s);
            let (mut x, mut at, mut lambda) = (x, t, lambda.clone());
            for _ in 0..=CORRECTIONS {
                x += DVec3::new(step[0], step[1], step[2]) * self.scale;
                at += step[3] * self.time_scale;
                if !(x.is_finite() && at.abs() <= far) {
                    break;
                }
                lambda.iter_mut().zip(&step[4..n]).for_each(|(l, s)| *l += s);
                let (mut nf, mut nj) = ([0.0; MAX_UNKNOWNS], [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS]);
                let next = self.fill(active, (x, at), &lambda, level, (&mut nf, &mut nj));
                if next < PROGRESS * best {
                    return Some(((x, at), lambda, nf, nj, next));
                }
                step = damped_step(&nj, &nf, n, LEAST_DAMPING)?;
            }
        }
        None
    }

    /// True when the multiplied normals of every apex in a solution lie in its normal cone: within the right angle less
    /// the half angle of the direction away from the cone.
    pub(in crate::contact) fn holds_at_apexes(&self, s: &Solution, at: &Instant) -> bool {
        s.active.iter().all(|c| {
            let Constraint::Apex(side, id, 0) = *c else { return true };
            let faces = if side == Side::A { &self.a } else { &self.b };
            let Some(apex) = faces.get(id.face()).apex() else { return false };
            let Apex { axis, sin, .. } = apex;
            let axis = if side == Side::A { axis } else { at.a_vector(axis) };
            let same = s
                .active
                .iter()
                .zip(&s.lambda)
                .filter(|(o, _)| matches!(**o, Constraint::Apex(os, oid, _) if (os, oid) == (side, id)));
            let sum: DVec3 = same.map(|(o, l)| self.row(o, s.x, at, 0.0).gradient * *l).sum();
            if apex.rows.is_some() {
                let own = if side == Side::A { sum } else { at.b_from_a * sum };
                return apex.holds(own, -sum.dot(axis), 1e-6 * sum.length());
            }
            -sum.dot(axis) >= sum.length() * (sin - 1e-6)
        })
    }

    /// Plain Newton steps on the same square system, from a good guess: `Err(true)` where the system is singular, which
    /// `solve` copes with, `Err(false)` where the guess leads nowhere. Nothing is allocated.
    pub fn refine(
        &self,
        active: &[Constraint],
        mut x: DVec3,
        mut t: f64,
        mut lambda: Weights,
        level: f64,
    ) -> Result<Solution, bool> {
        const STEPS: usize = 9;
        /// Squared residual of rounding.
        const MET: f64 = 1e-29;
        /// Squared residual from which the surfaces alone are met.
        const SMALL: f64 = 1e-20;
        let n = active.len() + 4;
        let mut f = [0.0; MAX_UNKNOWNS];
        let mut last = f64::INFINITY;
        for _ in 0..STEPS {
            let mut jac = [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS];
            let square = self.fill(active, (x, t), &lambda, level, (&mut f, &mut jac));
            if square <= MET || (square <= SMALL && square > 1e-3 * last) {
                if square > MET {
                    (x, t) = self.meet(active, x, t, level).ok_or(false)?;
                }
                let n = active.len();
                let stationarity = f[n..n + 3].iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                return Ok(Solution { x, t, active: Actives::from_slice(active), lambda, stationarity });
            }
            // Newton gains or is lost; a first step or two may go astray.
            if !square.is_finite() || square > 1e2 * last.max(1e-2) {
                return Err(false);
            }
            last = square;
            let step = eliminate(&mut jac, f, n).ok_or(true)?;
            x -= DVec3::new(step[0], step[1], step[2]) * self.scale;
            t -= step[3] * self.time_scale;
            lambda.iter_mut().zip(&step[4..n]).for_each(|(l, s)| *l -= s);
            if !(-1.0..=2.0).contains(&t) {
                return Err(false);
            }
        }
        Err(false)
    }

    /// The constraints met by minimum-norm steps, the multipliers kept as they are: for lines and patches of contacts, which
    /// leave x open. `None` when the constraints cannot be met or the multipliers do not balance to rounding: a tilt of 1e-9
    /// decides at which end of a line the bodies touch.
    pub fn along(&self, active: &[Constraint], x: DVec3, t: f64, mut lambda: Weights, level: f64) -> Option<Solution> {
        /// Imbalance of unit normals that rounding leaves.
        const BALANCED: f64 = 1e-13;
        if let [Constraint::Literal(..), Constraint::Literal(..)] = active {
            // Two unit normals balance at equal weights or not at all.
            lambda.fill(0.5);
        }
        let (x, t) = self.meet(active, x, t, level)?;
        let at = self.relative.at(t);
        let sum: DVec3 = active.iter().zip(&lambda).map(|(c, l)| self.row(c, x, &at, level).gradient * *l).sum();
        let stationarity = sum.abs().max_element();
        let active = Actives::from_slice(active);
        (stationarity <= BALANCED).then_some(Solution { x, t, active, lambda, stationarity })
    }

    /// Minimum-norm steps on the constraints alone until they are met to rounding; `None` when they can't be.
    fn meet(&self, active: &[Constraint], mut x: DVec3, mut t: f64, level: f64) -> Option<(DVec3, f64)> {
        let m = active.len();
        let mut last = f64::INFINITY;
        for _ in 0..12 {
            halt::work(ROW * active.len());
            let at = self.relative.at(t);
            let (mut g, mut v, mut residual) = ([[0.0; 4]; MAX_ACTIVE], [0.0; MAX_ACTIVE], 0.0f64);
            for (i, c) in active.iter().enumerate() {
                let r = self.row(c, x, &at, level);
                g[i] = [r.gradient.x, r.gradient.y, r.gradient.z, r.rate * self.time_scale / self.scale];
                v[i] = r.value / self.scale;
                residual = residual.max(r.value.abs());
            }
            if !residual.is_finite() {
                return None;
            }
            if residual == 0.0 || residual >= 0.5 * last {
                last = last.min(residual);
                break;
            }
            last = residual;
            // Gram matrix of the rows, a trace of damping for redundant ones.
            let (mut gram, mut rhs) = ([[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS], [0.0; MAX_UNKNOWNS]);
            for i in 0..m {
                for j in 0..m {
                    gram[i][j] = (0..4).map(|k| g[i][k] * g[j][k]).sum();
                }
                gram[i][i] += 1e-12;
                rhs[i] = -v[i];
            }
            let y = cholesky_solve(&mut gram, rhs, m)?;
            let step: [f64; 4] = std::array::from_fn(|k| (0..m).map(|i| g[i][k] * y[i]).sum());
            x += DVec3::new(step[0], step[1], step[2]) * self.scale;
            t += step[3] * self.time_scale;
        }
        (last <= self.tolerance).then_some((x, t))
    }

    /// Scaled residual and Jacobian; returns the squared residual.
    fn fill(
        &self,
        active: &[Constraint],
        (x, t): (DVec3, f64),
        lambda: &[f64],
        level: f64,
        (f, jac): (&mut [f64; MAX_UNKNOWNS], &mut [[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS]),
    ) -> f64 {
        let m = active.len();
        halt::work(ROW * m);
        let at = self.relative.at(t);
        let (mut sum, mut curvature, mut sum_rate, mut total, mut literals) =
            (DVec3::ZERO, DMat3::ZERO, DVec3::ZERO, 0.0, false);
        for (i, c) in active.iter().enumerate() {
            let r = self.row(c, x, &at, level);
            f[i] = r.value / self.scale;
            for k in 0..3 {
                jac[i][k] = r.gradient[k];
                jac[m + k][4 + i] = r.gradient[k];
            }
            jac[i][3] = r.rate * self.time_scale / self.scale;
            sum += r.gradient * lambda[i];
            curvature += r.hessian * lambda[i];
            sum_rate += r.gradient_rate * lambda[i];
            if matches!(c, Constraint::Literal(..)) {
                total += lambda[i];
                jac[m + 3][4 + i] = 1.0;
                literals = true;
            }
        }
        for k in 0..3 {
            f[m + k] = sum[k];
            for j in 0..3 {
                jac[m + k][j] = curvature.col(j)[k] * self.scale;
            }
            jac[m + k][3] = sum_rate[k] * self.time_scale;
        }
        if literals {
            f[m + 3] = total - 1.0;
        } else {
            // Apex on apex: any scale of the multipliers will do; hold the first one, outwards against its axis.
            f[m + 3] = lambda[0] + 1.0;
            jac[m + 3][4] = 1.0;
        }
        f[..m + 4].iter().map(|v| v * v).sum()
    }
}

/// Solves J step = f by elimination with partial pivoting; `None` when J is nearly singular.
fn eliminate(
    a: &mut [[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS],
    f: [f64; MAX_UNKNOWNS],
    n: usize,
) -> Option<[f64; MAX_UNKNOWNS]> {
    debug_assert!((6..=10).contains(&n), "{n} unknowns: between two and six faces meet");
    // Of a size that is known beforehand the loops hold no tests of their own.
    match n {
        6 => eliminate_of::<6>(a, f),
        7 => eliminate_of::<7>(a, f),
        8 => eliminate_of::<8>(a, f),
        9 => eliminate_of::<9>(a, f),
        10 => eliminate_of::<10>(a, f),
        // No step leads on where the faces of one body alone would meet: whoever asks has other ways.
        _ => None,
    }
}

fn eliminate_of<const N: usize>(
    a: &mut [[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS],
    mut f: [f64; MAX_UNKNOWNS],
) -> Option<[f64; MAX_UNKNOWNS]> {
    /// A pivot below this, of rows of about unit size, leaves a direction undetermined.
    const SINGULAR: f64 = 1e-9;
    for k in 0..N {
        let (mut p, mut largest) = (k, a[k][k].abs());
        for i in k + 1..N {
            if a[i][k].abs() > largest {
                (p, largest) = (i, a[i][k].abs());
            }
        }
        if largest.is_nan() || largest < SINGULAR {
            return None;
        }
        if p != k {
            a.swap(k, p);
            f.swap(k, p);
        }
        let row = a[k];
        let inverse = 1.0 / row[k];
        for i in k + 1..N {
            // Most of the system is zeros.
            if a[i][k] != 0.0 {
                let factor = a[i][k] * inverse;
                for j in k + 1..N {
                    a[i][j] -= factor * row[j];
                }
                f[i] -= factor * f[k];
            }
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            f[k] -= a[k][j] * f[j];
        }
        f[k] /= a[k][k];
    }
    Some(f)
}

/// Solves (JᵀJ + μ I) step = −Jᵀ f.
pub(in crate::contact) fn damped_step(
    jac: &[[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS],
    f: &[f64; MAX_UNKNOWNS],
    n: usize,
    mu: f64,
) -> Option<[f64; MAX_UNKNOWNS]> {
    debug_assert!((6..=10).contains(&n), "{n} unknowns: between two and six faces meet");
    // Of a size that is known beforehand the loops hold no tests of their own.
    match n {
        6 => damped_step_of::<6>(jac, f, mu),
        7 => damped_step_of::<7>(jac, f, mu),
        8 => damped_step_of::<8>(jac, f, mu),
        9 => damped_step_of::<9>(jac, f, mu),
        10 => damped_step_of::<10>(jac, f, mu),
        // No step leads on where the faces of one body alone would meet: whoever asks has other ways.
        _ => None,
    }
}

fn damped_step_of<const N: usize>(
    jac: &[[f64; MAX_UNKNOWNS]; MAX_UNKNOWNS],
    f: &[f64; MAX_UNKNOWNS],
    mu: f64,
) -> Option<[f64; MAX_UNKNOWNS]> {
    // Of J the rows of constraints hold nothing of the multipliers: but for the last four a block of 4 by 4. Sums stand side by
    // side; each is summed in the order of the rows.
    let m = N - 4;
    debug_assert!(jac[..m].iter().all(|row| row[4..].iter().all(|v| *v == 0.0)));
    let (mut a, mut b) = ([[0.0; N]; N], [0.0; N]);
    for (row, f) in jac[..m].iter().zip(f) {
        for i in 0..4 {
            for j in 0..4 {
                a[i][j] += row[i] * row[j];
            }
            b[i] -= row[i] * f;
        }
    }
    let last: [[f64; N]; 4] = std::array::from_fn(|k| std::array::from_fn(|j| jac[m + k][j]));
    for i in 0..N {
        let mut sums = a[i];
        for (row, f) in last.iter().zip(&f[m..N]) {
            for j in 0..N {
                sums[j] += row[i] * row[j];
            }
            b[i] -= row[i] * f;
        }
        a[i] = sums;
        a[i][i] += mu;
    }
    // Cholesky's factors, column by column: what is behind a column is updated at once.
    for k in 0..N {
        let d = a[k][k];
        if d.is_nan() || d <= 0.0 {
            return None;
        }
        let root = d.sqrt();
        let mut column = [0.0; N];
        for i in k..N {
            a[i][k] /= root;
            column[i] = a[i][k];
        }
        for i in k + 1..N {
            if column[i] != 0.0 {
                for j in k + 1..N {
                    a[i][j] -= column[i] * column[j];
                }
            }
        }
    }
    let mut step = [0.0; MAX_UNKNOWNS];
    step[..N].copy_from_slice(&substituted(&a, b, N));
    Some(step)
}

/// Solves a symmetric positive definite system in place.
#[inline]
pub(in crate::contact) fn cholesky_solve<const N: usize>(
    a: &mut [[f64; N]; N],
    b: [f64; N],
    n: usize,
) -> Option<[f64; N]> {
    for j in 0..n {
        for k in 0..j {
            let l = a[j][k];
            for i in j..n {
                a[i][j] -= a[i][k] * l;
            }
        }
        let d = a[j][j];
        if d.is_nan() || d <= 0.0 {
            return None;
        }
        let r = d.sqrt();
        for i in j..n {
            a[i][j] /= r;
        }
    }
    Some(substituted(a, b, n))
}

/// Solves L Lᵀ x = b, of which L is the lower triangle of `a`.
#[inline(always)]
fn substituted<const N: usize>(a: &[[f64; N]; N], mut b: [f64; N], n: usize) -> [f64; N] {
    for i in 0..n {
        for k in 0..i {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[k][i] * b[k];
        }
        b[i] /= a[i][i];
    }
    b
}
