//! Mass properties of a solid: volume, centre of mass and inertia, each with a proven bound of its error.

use crate::Pose;
use glam::{DMat3, DVec3};

/// How exactly mass properties are computed, and at what cost at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassOptions {
    /// Error of the volume that is good enough, as a fraction of the volume; between 0 and 1.
    pub tolerance: f64,
    /// Boxes that may be looked at, at least 1 and at most [`MassOptions::MOST_BOXES`]; where many faces meet in a box it counts
    /// as several, by the work it takes. Where they do not suffice, the
    /// answer carries the larger bounds that were reached.
    pub boxes: u64,
}

impl MassOptions {
    /// Most boxes that may be asked for: they take some hundred bytes each while the answer is computed.
    pub const MOST_BOXES: u64 = 10_000_000;

    /// These options, if they are in their range.
    ///
    /// # Errors
    /// A sentence that names the option; its code is `BadNumber`.
    pub fn checked(self) -> Result<Self, String> {
        if !(self.tolerance > 0.0 && self.tolerance < 1.0) {
            return Err(format!("expected a tolerance between 0 and 1, found {}", self.tolerance));
        }
        if !(1..=Self::MOST_BOXES).contains(&self.boxes) {
            return Err(format!("expected a limit of 1 to {} boxes, found {}", Self::MOST_BOXES, self.boxes));
        }
        Ok(self)
    }
}

impl Default for MassOptions {
    /// A millionth of the volume, a million boxes.
    fn default() -> Self {
        Self { tolerance: 1e-6, boxes: 1_000_000 }
    }
}

/// Volume, centre of mass and inertia of a solid of even density.
///
/// Lengths are in the model's unit. Every true value lies within its error of the one given, component by component. A
/// solid without points has zeros everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Volume, length³.
    pub volume: f64,
    /// Bound of its error, length³.
    pub volume_error: f64,
    /// Centre of mass, in the frame of the properties: the model's, until [`MassProperties::placed`] leaves it.
    pub center: DVec3,
    /// Bounds of its error, a length along each axis.
    pub center_error: DVec3,
    /// Mass per volume; the server answers with 1.
    pub density: f64,
    /// Inertia tensor about the centre of mass, axes of the frame: the matrix' xx, yy, zz, xy, xz, yz (xx = ∫ y² + z² dm,
    /// xy = −∫ x y dm), density · length⁵.
    pub inertia: [f64; 6],
    /// Bounds of its error, in the same order and unit.
    pub inertia_error: [f64; 6],
    /// Boxes that were looked at; 0 where a closed formula answers.
    pub boxes: u64,
}

/// Places of xx, xy, xz; xy, yy, yz; xz, yz, zz among the six.
const PLACES: [[usize; 3]; 3] = [[0, 3, 4], [3, 1, 5], [4, 5, 2]];

impl MassProperties {
    /// Those of a solid without points.
    pub const NOTHING: Self = Self {
        volume: 0.0,
        volume_error: 0.0,
        center: DVec3::ZERO,
        center_error: DVec3::ZERO,
        density: 1.0,
        inertia: [0.0; 6],
        inertia_error: [0.0; 6],
        boxes: 0,
    };

    /// Density times volume.
    pub fn mass(&self) -> f64 {
        self.density * self.volume
    }

    /// Bound of the mass' error, the density taken as exact.
    pub fn mass_error(&self) -> f64 {
        self.density * self.volume_error
    }

    /// The inertia tensor as a matrix.
    pub fn inertia_matrix(&self) -> DMat3 {
        matrix(&self.inertia)
    }

    /// The same solid of another density (mass per volume, positive), which is taken as exact.
    pub fn with_density(&self, density: f64) -> Self {
        let scale = density / self.density;
        let rounding = 4.0 * f64::EPSILON * scale;
        let inertia = self.inertia.map(|i| i * scale);
        let mut inertia_error = self.inertia_error.map(|e| e * scale);
        for (e, i) in inertia_error.iter_mut().zip(&self.inertia) {
            *e += rounding * (i.abs() + *e);
        }
        Self { density, inertia, inertia_error, ..*self }
    }

    /// The same solid seen from the parent of `place`: with an object's place, the model's properties become the object's.
    /// The centre moves along, the tensor turns, I' = R I Rᵀ; the bounds grow as they must, E' = |R| E |R|ᵀ and a few units
    /// in the last place.
    pub fn placed(&self, place: &Pose) -> Self {
        // A dozen products and sums; the largest number in play bounds what each of them rounds by.
        const ROUNDING: f64 = 16.0 * f64::EPSILON;
        let turn = place.matrix();
        let sizes = DMat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs());
        let center = place.point(self.center);
        let moved = place.position.abs() + DVec3::splat(self.center.length());
        let center_error = sizes * self.center_error + moved * ROUNDING;
        let inertia = turn * self.inertia_matrix() * turn.transpose();
        let spread = sizes * matrix(&self.inertia_error) * sizes.transpose();
        let largest: f64 = self.inertia.iter().map(|i| i.abs()).sum();
        let mut inertia_error = six(&spread);
        inertia_error.iter_mut().for_each(|e| *e = *e * (1.0 + ROUNDING) + largest * ROUNDING);
        Self { center, center_error, inertia: six(&inertia), inertia_error, ..*self }
    }
}

fn matrix(six: &[f64; 6]) -> DMat3 {
    DMat3::from_cols_array_2d(&PLACES.map(|row| row.map(|at| six[at])))
}

fn six(m: &DMat3) -> [f64; 6] {
    let rows = m.to_cols_array_2d();
    let half = |i: usize, j: usize| 0.5 * (rows[i][j] + rows[j][i]);
    [half(0, 0), half(1, 1), half(2, 2), half(0, 1), half(0, 2), half(1, 2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// A bar along x: mass 2, inertia 0 about its own axis nearly.
    fn bar() -> MassProperties {
        MassProperties {
            volume: 2.0,
            volume_error: 0.01,
            center: DVec3::new(1.0, 0.0, 0.0),
            center_error: DVec3::new(1e-3, 0.0, 0.0),
            inertia: [0.1, 2.0, 3.0, 0.0, 0.0, 0.0],
            inertia_error: [1e-3, 0.0, 0.0, 0.0, 0.0, 0.0],
            ..MassProperties::NOTHING
        }
    }

    #[test]
    fn a_quarter_turn_swaps_the_axes_and_their_bounds() {
        let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let seen = bar().placed(&Pose::new(DVec3::new(0.0, 0.0, 5.0), turn));
        assert!((seen.center - DVec3::new(0.0, 1.0, 5.0)).length() < 1e-15);
        assert!((seen.center_error.y - 1e-3).abs() < 1e-12 && seen.center_error.x < 1e-12);
        for (found, expected) in seen.inertia.iter().zip([2.0, 0.1, 3.0, 0.0, 0.0, 0.0]) {
            assert!((found - expected).abs() < 1e-15, "{seen:?}");
        }
        assert!((seen.inertia_error[1] - 1e-3).abs() < 1e-12 && seen.inertia_error[0] < 1e-12);
        assert_eq!(seen.volume, 2.0);
    }

    #[test]
    fn bounds_hold_under_any_turn() {
        // The corners of the bounds, turned, lie within the turned bounds.
        let turn = Pose::new(DVec3::new(3.0, -2.0, 0.5), DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0));
        let whole = MassProperties { inertia_error: [1e-3, 2e-3, 3e-3, 4e-4, 5e-4, 6e-4], ..bar() };
        let seen = whole.placed(&turn);
        for corner in 0..64u32 {
            let mut one = whole;
            for k in 0..6 {
                let sign = if corner >> k & 1 == 0 { -1.0 } else { 1.0 };
                one.inertia[k] += sign * whole.inertia_error[k];
            }
            let one = one.placed(&turn);
            for k in 0..6 {
                assert!((one.inertia[k] - seen.inertia[k]).abs() <= seen.inertia_error[k]);
            }
        }
    }

    #[test]
    fn density_scales_the_mass_and_the_inertia_alone() {
        let heavy = bar().with_density(7.0);
        assert_eq!((heavy.mass(), heavy.volume, heavy.center), (14.0, 2.0, bar().center));
        assert!((heavy.inertia[1] - 14.0).abs() < 1e-14 && heavy.inertia_error[0] >= 7e-3);
        let back = heavy.with_density(1.0);
        assert!((back.inertia[2] - 3.0).abs() < 1e-15);
        assert!((heavy.mass_error() - 0.07).abs() < 1e-15);
    }

    #[test]
    fn options_out_of_their_range_are_named() {
        assert_eq!(MassOptions::default().checked(), Ok(MassOptions::default()));
        for tolerance in [0.0, -1.0, 1.0, f64::NAN, f64::INFINITY] {
            let sentence = MassOptions { tolerance, ..Default::default() }.checked().unwrap_err();
            assert!(sentence.contains("tolerance"), "{sentence}");
        }
        for boxes in [0, MassOptions::MOST_BOXES + 1, u64::MAX] {
            let sentence = MassOptions { boxes, ..Default::default() }.checked().unwrap_err();
            assert!(sentence.contains("boxes"), "{sentence}");
        }
    }
}
