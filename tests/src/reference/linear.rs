//! Minimum-norm least squares for the handful of unknowns of a contact: one-sided Jacobi rotations (Hestenes 1958).

/// The shortest `x` that minimises |J x − b|, J given by columns as long as b; singular values below `cut` times the
/// largest are taken for zero.
pub fn least_squares(columns: &[Vec<f64>], b: &[f64], cut: f64) -> Vec<f64> {
    let (n, rows) = (columns.len(), b.len());
    // Columns one after the other, with their squares: a turn changes two of them.
    let mut u: Vec<f64> = columns.concat();
    let mut v = vec![0.0; n * n];
    (0..n).for_each(|k| v[k * n + k] = 1.0);
    let column = |k: usize| k * rows..(k + 1) * rows;
    let mut squares: Vec<f64> = columns.iter().map(|c| dot(c, c)).collect();
    for _ in 0..40 {
        let mut turned = false;
        for p in 0..n {
            for q in p + 1..n {
                let (alpha, beta, gamma) = (squares[p], squares[q], dot(&u[column(p)], &u[column(q)]));
                if gamma == 0.0 || gamma.abs() <= 1e-16 * (alpha * beta).sqrt() {
                    continue;
                }
                turned = true;
                let zeta = (beta - alpha) / (2.0 * gamma);
                let t = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                turn(&mut u, rows, [p, q], (c, c * t));
                turn(&mut v, n, [p, q], (c, c * t));
                for k in [p, q] {
                    squares[k] = dot(&u[column(k)], &u[column(k)]);
                }
            }
        }
        if !turned {
            break;
        }
    }
    let top = squares.iter().copied().fold(0.0, f64::max).sqrt();
    let mut x = vec![0.0; n];
    for k in (0..n).filter(|k| squares[*k].sqrt() > cut * top) {
        let sigma = squares[k].sqrt();
        let w = dot(&u[column(k)], b) / (sigma * sigma);
        for i in 0..n {
            x[i] += w * v[k * n + i];
        }
    }
    x
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut sum, b) = (0.0, &b[..a.len()]);
    for i in 0..a.len() {
        sum += a[i] * b[i];
    }
    sum
}

/// Turns two columns of `len` numbers, p before q, into each other.
fn turn(columns: &mut [f64], len: usize, [p, q]: [usize; 2], (c, s): (f64, f64)) {
    let (before, from) = columns.split_at_mut(q * len);
    let (one, other) = (&mut before[p * len..][..len], &mut from[..len]);
    for i in 0..len {
        let (x, y) = (one[i], other[i]);
        one[i] = c * x - s * y;
        other[i] = s * x + c * y;
    }
}
