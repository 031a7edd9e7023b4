//! Small systems of linear equations.

/// Solves a system by elimination with partial pivoting.
pub fn eliminated<const N: usize>(a: &mut [[f64; N]; N], mut f: [f64; N], n: usize) -> Option<[f64; N]> {
    for k in 0..n {
        let p = (k..n).max_by(|p, q| a[*p][k].abs().total_cmp(&a[*q][k].abs()))?;
        if a[p][k] == 0.0 || !a[p][k].is_finite() {
            return None;
        }
        a.swap(k, p);
        f.swap(k, p);
        let row = a[k];
        for i in k + 1..n {
            let factor = a[i][k] / row[k];
            if factor != 0.0 {
                for j in k + 1..n {
                    a[i][j] -= factor * row[j];
                }
                f[i] -= factor * f[k];
            }
        }
    }
    for k in (0..n).rev() {
        for j in k + 1..n {
            f[k] -= a[k][j] * f[j];
        }
        f[k] /= a[k][k];
    }
    Some(f)
}
