//! Small systems of linear equations.

/// Solves a system by elimination with partial pivoting.
pub fn eliminated<const N: usize>(a: &mut [[f64; N]; N], mut f: [f64; N], n: usize) -> Option<[f64; N]> {
    let n = n.min(N);
    for k in 0..n {
        // As numbers without a sign are ordered, those that are none above all.
        let size = |row: &[f64; N]| row[k].abs().to_bits();
        let (mut p, mut most) = (k, size(&a[k]));
        for i in k + 1..n {
            if size(&a[i]) >= most {
                (p, most) = (i, size(&a[i]));
            }
        }
        if a[p][k] == 0.0 || !a[p][k].is_finite() {
            return None;
        }
        if p != k {
            a.swap(k, p);
            f.swap(k, p);
        }
        let (above, below) = a.split_at_mut(k + 1);
        let (row, own) = (&above[k][k..n], f[k]);
        for (low, f) in below.iter_mut().zip(&mut f[k + 1..n]) {
            let low = &mut low[k..n];
            let factor = low[0] / row[0];
            if factor != 0.0 {
                low.iter_mut().zip(row).skip(1).for_each(|(x, y)| *x -= factor * y);
                *f -= factor * own;
            }
        }
    }
    for k in (0..n).rev() {
        let mut rest = f[k];
        a[k][k + 1..n].iter().zip(&f[k + 1..n]).for_each(|(x, y)| rest -= x * y);
        f[k] = rest / a[k][k];
    }
    Some(f)
}
