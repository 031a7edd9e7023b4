//! Where faces of two bodies balance at one instant: stationary points of F = max(f_A, f_B), its deepest ones among them.
//!
//! Unknowns x (A's model frame), the level ℓ and multipliers λ; for literals c_i with gradients g_i
//!
//! ```text
//! c_i(x) = ℓ,    Σ λ_i g_i = 0,    Σ λ_i = 1,    λ_i >= 0
//! ```
//!
//! They are the equations of a contact (`newton`) with the level in place of the time, and are solved as these are. Nothing here is
//! trusted: what asks confirms the point by both whole trees.

use super::newton::{Constraint, MAX_UNKNOWNS, Problem, damped_step};
use crate::contact::exclusion::literal::Side;
use crate::contact::query::task::Task;
use crate::motion::Instant;
use crate::solid::local::LiteralId;
use glam::{DMat3, DVec3};
use smallvec::{SmallVec, smallvec};

/// Multipliers below minus this, and sums of gradients above it, are no balance.
pub const BALANCE: f64 = 1e-7;

/// Faces of both sides together that balance, at most.
pub const MOST_BALANCED: usize = 4;

/// One for each face that balances.
pub type Multipliers = SmallVec<[f64; MOST_BALANCED]>;

/// A place where literals balance: point, level, multipliers.
pub type Balance = (DVec3, f64, Multipliers);

/// Where some literals of both bodies balance at an instant, looked for from `x` on (A's frame), with the direction from a to b there
/// along A's axes. `None` for those of one body, or too many.
pub fn of_literals(task: &Task, at: &Instant, lits: &[(Side, LiteralId)], x: DVec3) -> Option<(Balance, DVec3)> {
    let has = |side: Side| lits.iter().any(|l| l.0 == side);
    if lits.len() > MOST_BALANCED || !has(Side::A) || !has(Side::B) {
        return None;
    }
    let problem = Problem::of(task);
    let row = |i: usize, x: DVec3| problem.row(&Constraint::Literal(lits[i].0, lits[i].1), x, at, 0.0);
    let literal = |i: usize, x: DVec3| {
        let row = row(i, x);
        (row.value, row.gradient, Some(row.hessian))
    };
    let equations = Equations { count: lits.len(), size: task.scale, tolerance: task.rounding, literal };
    let found = balance(&equations, x)?;
    let pull = |i: usize| row(i, found.0).gradient * if lits[i].0 == Side::A { found.2[i] } else { -found.2[i] };
    let normal = (0..lits.len()).map(pull).sum::<DVec3>().try_normalize()?;
    Some((found, normal))
}

/// Literals at a point and a length: a literal's value and gradient there, its Hessian where it bends.
pub struct Equations<L> {
    /// How many literals there are.
    pub count: usize,
    /// The unit of length in which the equations stand.
    pub size: f64,
    /// By how much their levels may differ.
    pub tolerance: f64,
    /// The literal of a number at a point.
    pub literal: L,
}

/// Solves the equations from a point on; `None` where its steps end at no balance.
pub fn balance<L>(equations: &Equations<L>, mut x: DVec3) -> Option<Balance>
where
    L: Fn(usize, DVec3) -> (f64, DVec3, Option<DMat3>),
{
    let Equations { count: m, size, tolerance, ref literal } = *equations;
    let n = m + 4;
    let mut level = 0.0;
    let mut lambda: Multipliers = smallvec![1.0 / m as f64; m];
    let fill = |x: DVec3, level: f64, lambda: &[f64]| {
        let (mut f, mut jac) = ([0.0; MAX_UNKNOWNS], [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS]);
        let mut total = -1.0;
        for i in 0..m {
            let (value, normal, hessian) = literal(i, x);
            f[i] = (value - level) / size;
            jac[i][3] = -1.0;
            for k in 0..3 {
                jac[i][k] = normal[k];
                jac[m + k][4 + i] = normal[k];
                f[m + k] += lambda[i] * normal[k];
            }
            if let Some(hessian) = hessian {
                for (k, j) in (0..9).map(|n| (n / 3, n % 3)) {
                    jac[m + k][j] += lambda[i] * hessian.col(j)[k] * size;
                }
            }
            total += lambda[i];
            jac[m + 3][4 + i] = 1.0;
        }
        f[m + 3] = total;
        let square: f64 = f[..n].iter().map(|v| v * v).sum();
        (f, jac, square)
    };
    let (mut f, mut jac, mut best) = fill(x, level, &lambda);
    let mut damping = 1e-3;
    for _ in 0..40 {
        if best < 1e-32 {
            break;
        }
        let step = damped_step(&jac, &f, n, (damping * best.min(1e-2)).max(1e-15))?;
        let nx = x + DVec3::new(step[0], step[1], step[2]) * size;
        let nlevel = level + step[3] * size;
        let nlambda: Multipliers = lambda.iter().zip(&step[4..n]).map(|(l, s)| l + s).collect();
        let next = fill(nx, nlevel, &nlambda);
        if next.2 < best {
            let slow = next.2 > 0.25 * best && best < 1e-26;
            (x, level, lambda) = (nx, nlevel, nlambda);
            (f, jac, best) = next;
            damping = (damping * 0.1).max(1e-9);
            if slow {
                break;
            }
        } else {
            damping *= 16.0;
            if damping > 1e12 || best < 1e-26 {
                break;
            }
        }
    }
    let balanced = f[m..m + 3].iter().all(|v| v.abs() <= BALANCE);
    let held = lambda.iter().all(|l| *l >= -BALANCE);
    (balanced && held && x.is_finite() && f[..m].iter().all(|v| v.abs() * size <= tolerance))
        .then_some((x, level, lambda))
}
