//! Lengths and directions of vectors whose squares are too large or too small for a double.

use glam::DVec3;

/// The length of a vector, wherever that is a double; infinite where it is none.
pub fn length(v: DVec3) -> f64 {
    let most = v.abs().max_element();
    if most > 0.0 && most.is_finite() { most * (v / most).length() } else { most }
}

/// The unit vector along a vector of any finite length but 0.
pub fn direction(v: DVec3) -> Option<DVec3> {
    let most = v.abs().max_element();
    (most > 0.0 && v.is_finite()).then(|| (v / most).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_every_length_have_it_and_a_direction() {
        for power in -307..=307 {
            let size = 10f64.powi(power);
            let v = DVec3::new(2.0, -3.0, 6.0) * size;
            assert!((length(v) / size - 7.0).abs() < 1e-14, "{v:?}");
            let far = direction(v).unwrap() - DVec3::new(2.0, -3.0, 6.0) / 7.0;
            assert!(far.length() < 1e-15, "{v:?}");
        }
        assert_eq!(direction(DVec3::Z * -f64::from_bits(1)), Some(-DVec3::Z));
        assert_eq!((direction(DVec3::ZERO), direction(DVec3::X * f64::INFINITY)), (None, None));
        assert_eq!((length(DVec3::ZERO), length(DVec3::splat(f64::MAX))), (0.0, f64::INFINITY));
    }
}
