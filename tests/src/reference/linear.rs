//! Minimum-norm least squares for the handful of unknowns of a contact: one-sided Jacobi rotations (Hestenes 1958).

/// The shortest `x` that minimises |J x − b|, J given by columns; singular values below `cut` times the largest are
/// taken for zero.
pub fn least_squares(columns: &[Vec<f64>], b: &[f64], cut: f64) -> Vec<f64> {
    let n = columns.len();
    let mut u: Vec<Vec<f64>> = columns.to_vec();
    let mut v: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| f64::from(i == j)).collect()).collect();
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
    for _ in 0..40 {
        let mut turned = false;
        for p in 0..n {
            for q in p + 1..n {
                let (alpha, beta, gamma) = (dot(&u[p], &u[p]), dot(&u[q], &u[q]), dot(&u[p], &u[q]));
                if gamma == 0.0 || gamma.abs() <= 1e-16 * (alpha * beta).sqrt() {
                    continue;
                }
                turned = true;
                let zeta = (beta - alpha) / (2.0 * gamma);
                let t = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                let s = c * t;
                for m in [&mut u, &mut v] {
                    for i in 0..m[p].len() {
                        let (x, y) = (m[p][i], m[q][i]);
                        m[p][i] = c * x - s * y;
                        m[q][i] = s * x + c * y;
                    }
                }
            }
        }
        if !turned {
            break;
        }
    }
    let sigma: Vec<f64> = u.iter().map(|c| dot(c, c).sqrt()).collect();
    let top = sigma.iter().copied().fold(0.0, f64::max);
    let mut x = vec![0.0; n];
    for k in (0..n).filter(|k| sigma[*k] > cut * top) {
        let w = dot(&u[k], b) / (sigma[k] * sigma[k]);
        for i in 0..n {
            x[i] += w * v[k][i];
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_system_is_solved_and_a_singular_one_takes_the_shortest_answer() {
        let x = least_squares(&[vec![2.0, 1.0], vec![1.0, 3.0]], &[5.0, 10.0], 1e-12);
        assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 3.0).abs() < 1e-14);
        let x = least_squares(&[vec![1.0, 1.0], vec![1.0, 1.0]], &[2.0, 2.0], 1e-12);
        assert!((x[0] - 1.0).abs() < 1e-14 && (x[1] - 1.0).abs() < 1e-14);
    }
}
