//! Integrals of 1, the coordinates and their products over a body, and sums of many of them.

use glam::{DMat3, DVec3};

/// Number of integrals.
pub const COUNT: usize = 10;

/// The coordinates whose product is integrated by place 4 and the following.
pub const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// ∫ 1, x, y, z, xx, yy, zz, xy, xz, yz over a body, about the origin of some coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments(pub [f64; COUNT]);

impl Moments {
    /// Those of the box of half extents `half` around the origin.
    pub fn of_box(half: DVec3) -> Self {
        let volume = 8.0 * half.x * half.y * half.z;
        let [x, y, z] = (half * half * (volume / 3.0)).to_array();
        Self([volume, 0.0, 0.0, 0.0, x, y, z, 0.0, 0.0, 0.0])
    }

    /// Those of a body with ∫ z = `first` and a diagonal ∫ xxᵀ.
    pub fn diagonal(volume: f64, first: f64, squares: DVec3) -> Self {
        Self([volume, 0.0, 0.0, first, squares.x, squares.y, squares.z, 0.0, 0.0, 0.0])
    }

    /// Volume.
    pub fn volume(&self) -> f64 {
        self.0[0]
    }

    /// Integrals of the coordinates.
    pub fn first(&self) -> DVec3 {
        DVec3::new(self.0[1], self.0[2], self.0[3])
    }

    /// ∫ (a·x)² + (b·x)².
    pub fn square_along(&self, [a, b]: &[DVec3; 2]) -> f64 {
        let twice = |i: usize, j: usize| if i == j { 1.0 } else { 2.0 };
        let terms = PAIRS.iter().zip(&self.0[4..]);
        terms.map(|(&(i, j), x)| twice(i, j) * (a[i] * a[j] + b[i] * b[j]) * x).sum()
    }

    /// Adds another body's.
    pub fn add(&mut self, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a += b);
    }

    /// The body without another one.
    pub fn less(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] - other.0[k]))
    }

    /// Both bodies' times a factor.
    pub fn mean(&self, other: &Self, factor: f64) -> Self {
        Self(std::array::from_fn(|k| factor * (self.0[k] + other.0[k])))
    }

    /// The body stretched by `by` along each axis.
    pub fn stretched(&self, by: DVec3) -> Self {
        let volume = by.x * by.y * by.z;
        Self(std::array::from_fn(|k| {
            self.0[k]
                * match k {
                    0 => volume,
                    1..=3 => volume * by[k - 1],
                    _ => volume * by[PAIRS[k - 4].0] * by[PAIRS[k - 4].1],
                }
        }))
    }

    /// The image of the body under a linear map M: |det M| times V, M ∫ x, M ∫ xxᵀ Mᵀ.
    pub fn mapped(&self, map: &DMat3) -> Self {
        let mut second = [[0.0; 3]; 3];
        for (k, (i, j)) in PAIRS.into_iter().enumerate() {
            (second[i][j], second[j][i]) = (self.0[4 + k], self.0[4 + k]);
        }
        let (first, second) = (*map * self.first(), *map * DMat3::from_cols_array_2d(&second) * map.transpose());
        let (by, second) = (map.determinant().abs(), second.to_cols_array_2d());
        Self(std::array::from_fn(|k| {
            by * match k {
                0 => self.volume(),
                1..=3 => first[k - 1],
                _ => second[PAIRS[k - 4].0][PAIRS[k - 4].1],
            }
        }))
    }

    /// The body moved by `by`: ∫ (x + s)(y + t) = ∫ xy + s ∫ y + t ∫ x + s t V, the parallel-axis theorem.
    pub fn moved(&self, by: DVec3) -> Self {
        let (volume, first) = (self.volume(), self.first());
        Self(std::array::from_fn(|k| {
            self.0[k]
                + match k {
                    0 => 0.0,
                    1..=3 => by[k - 1] * volume,
                    _ => {
                        let (i, j) = PAIRS[k - 4];
                        by[i] * first[j] + by[j] * first[i] + by[i] * by[j] * volume
                    }
                }
        }))
    }
}

/// A compensated sum: what each addition rounds off is carried along, so that n terms are summed to 2 ε of the result and
/// n ε² of the terms' sizes. A. Neumaier, ZAMM 54, 1974.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    sum: f64,
    lost: f64,
}

impl Sum {
    /// Adds a term.
    pub fn add(&mut self, term: f64) {
        let sum = self.sum + term;
        self.lost += if self.sum.abs() >= term.abs() { (self.sum - sum) + term } else { (term - sum) + self.sum };
        self.sum = sum;
    }

    /// The sum of all terms.
    pub fn value(&self) -> f64 {
        self.sum + self.lost
    }
}

/// Compensated sums of moments.
#[derive(Clone, Copy, Debug, Default)]
pub struct MomentSums([Sum; COUNT]);

impl MomentSums {
    /// Adds a body's.
    pub fn add(&mut self, body: &Moments) {
        self.0.iter_mut().zip(&body.0).for_each(|(sum, term)| sum.add(*term));
    }

    /// The sums.
    pub fn value(&self) -> Moments {
        Moments(self.0.map(|sum| sum.value()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_and_stretched_cube_is_a_box() {
        let half = DVec3::new(0.5, 2.0, 3.0);
        let stretched = Moments::of_box(DVec3::ONE).stretched(half);
        for (a, b) in stretched.0.iter().zip(&Moments::of_box(half).0) {
            assert!((a - b).abs() < 1e-14 * b.abs().max(1.0));
        }
        // ∫ xy over [1, 2] × [3, 7] × [0, 6] is 3/2 · 20 · 6.
        let moved = stretched.moved(DVec3::new(1.5, 5.0, 3.0));
        assert!((moved.0[7] - 180.0).abs() < 1e-12 && (moved.0[0] - 24.0).abs() < 1e-14);
        assert!((moved.0[4] - (8.0 - 1.0) / 3.0 * 24.0).abs() < 1e-12);
    }

    #[test]
    fn a_sum_keeps_what_a_plain_one_loses() {
        let mut sum = Sum::default();
        for term in [1.0, 1e100, 1.0, -1e100] {
            sum.add(term);
        }
        assert_eq!(sum.value(), 2.0);
    }
}
