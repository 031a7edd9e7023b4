//! What floating-point rounding may do to a relative motion: bounds, not estimates.
//!
//! Every constant counts half units in the last place (u = 2⁻⁵³) of the operations on one path, by the standard model
//! fl(x ∘ y) = (x ∘ y)(1 + d), |d| <= u (N. J. Higham, "Accuracy and Stability of Numerical Algorithms", SIAM 2002, sections
//! 2.2 and 3.1), with sine and cosine right to one unit in the last place. docs/accuracy.md, "The rounding budget", counts
//! them one by one; `cargo test -p contactd-tests --test search rounding::` holds them against 160-bit arithmetic.
//!
//! What is exact by definition: the stored numbers of a motion, places and faces, and the time of an instant. Quaternions
//! are unit to four units in the last place; the rotation meant is that of the normalised quaternion.

use super::Relative;

/// Half a unit in the last place, with the room that products of errors need.
const U: f64 = 0.5 * f64::EPSILON * (1.0 + 1e-6);

/// |world from model, computed − exact| (largest stretch), of one body: half units.
const BODY_MATRIX: f64 = 115.0;
/// The same per radian that the body turns in the step: the angle's own rounding.
const BODY_MATRIX_TURN: f64 = 4.0;
/// Both bodies' matrices and their product.
const PAIR_MATRIX: f64 = 2.0 * BODY_MATRIX + 10.0;
/// What a point of A taken to B's frame adds to the matrix's own error, for its arm in A.
const POINT_ARM: f64 = 9.0;
/// For the difference of the two origins: its own rounding and that of A's matrix, which carries it into A's axes.
const POINT_ORIGINS: f64 = 135.0;
/// For the places of both models in their objects.
const POINT_PLACE: f64 = 49.0;
/// Rates and accelerations along a normal: both matrices, products of three vectors.
const RATE: f64 = 512.0;
/// Per radian that the bodies turn.
const RATE_TURN: f64 = 12.0;

/// Relative rounding of a norm or of a sum of norms.
pub(super) const NORM: f64 = 32.0 * U;

/// Bounds of the rounding errors of a relative motion, over the whole step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounding {
    /// |`Instant::b_from_a`, computed − exact|: by how much a unit vector may end elsewhere.
    pub matrix: f64,
    /// Error of `Instant::b_point` (length) for a point at A's centre of rotation …
    pub origin: f64,
    /// … and what each length of distance from there adds.
    pub arm: f64,
    /// Error of a rate n·v or acceleration, relative to the largest that the terms it is made of could give.
    pub rate: f64,
}

impl Rounding {
    pub(super) fn of(relative: &Relative) -> Self {
        let (a, b) = relative.placed();
        let turns = a.motion.spin.length() + b.motion.spin.length();
        let place = a.place.position.length() + b.place.position.length();
        Self::with(turns, relative.apart(), place)
    }

    /// From how far both bodies turn (radians), how far their centres of rotation come apart, and the sum of the distances
    /// of these from the models' origins; larger for larger ones.
    pub fn with(turns: f64, apart: f64, place: f64) -> Self {
        let matrix = PAIR_MATRIX + BODY_MATRIX_TURN * turns;
        // A time is itself rounded by up to u, in which the pair moves on: 2 D for the origins, and what the turns add.
        let moved = 2.0 + turns;
        let origins = matrix + POINT_ORIGINS + BODY_MATRIX_TURN * turns + moved;
        Self {
            matrix: matrix * U,
            origin: (origins * apart + POINT_PLACE * place) * U,
            arm: (matrix + POINT_ARM + turns) * U,
            rate: (RATE + RATE_TURN * turns) * U,
        }
    }

    /// Error (length) of a point of B's frame that is computed from one of A's, at this distance from A's centre of
    /// rotation.
    pub fn point(&self, arm: f64) -> f64 {
        self.origin + self.arm * arm
    }
}
