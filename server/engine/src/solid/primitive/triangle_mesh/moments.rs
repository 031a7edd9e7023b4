//! Moments of a mesh: the signed tetrahedra that its triangles span with the middle of its box.

use crate::math::Moments;
use crate::math::moments::{COUNT, PAIRS, Sum};
use glam::DVec3;

/// Rounding of one tetrahedron's volume, relative to the product of its sides at the middle.
const TETRAHEDRON: f64 = 32.0 * f64::EPSILON;

/// Moments about `middle`, and a bound of what rounding does to the volume, planes being known to `planes` (a length).
///
/// Of a tetrahedron with one corner at the origin, the others x₁, x₂, x₃, volume V and sum s of corners: ∫ x = V s/4,
/// ∫ xxᵀ = V (s sᵀ + Σ xᵢxᵢᵀ)/20.
pub fn of(vertices: &[DVec3], triangles: &[[u32; 3]], middle: DVec3, planes: f64) -> (Moments, f64) {
    let mut sums = [Sum::default(); COUNT];
    let mut doubt = 0.0;
    for t in triangles {
        let x = t.map(|v| vertices[v as usize] - middle);
        let volume = x[0].dot(x[1].cross(x[2])) / 6.0;
        let s = x[0] + x[1] + x[2];
        sums[0].add(volume);
        (0..3).for_each(|k| sums[1 + k].add(0.25 * volume * s[k]));
        for (k, (i, j)) in PAIRS.into_iter().enumerate() {
            let squares: f64 = x.iter().map(|x| x[i] * x[j]).sum();
            sums[4 + k].add(0.05 * volume * (s[i] * s[j] + squares));
        }
        let area = 0.5 * (x[1] - x[0]).cross(x[2] - x[0]).length();
        doubt += TETRAHEDRON * x[0].length() * x[1].length() * x[2].length() + planes * area;
    }
    (Moments(sums.map(|s| s.value())), doubt)
}
