//! Free rotation that keeps angular momentum and energy, with the constant angular velocity that a step has.
//!
//! The state is the angular momentum L in the world, which nothing but impulses changes. Over a step of duration T the body
//! turns by exp(T ω) with ω = J⁻¹ ½ (H L + H⁻¹ L), where H = exp(½ T ω) and J is the tensor half way, R½ I R½ᵀ, R½ = H R₀. Then
//! the body's own momentum Π = Rᵀ L has Π₁ + Π₀ = 2 R½ᵀ J ω and Π₁ − Π₀ along R½ᵀ (ω × L), so that the change of energy,
//! ½ (Π₁ − Π₀)·I⁻¹ (Π₁ + Π₀), is (multiple of ω × L)·ω = 0: both are kept to rounding for any T. It is the implicit midpoint
//! rule on the rotation group (J. C. Simo and K. K. Wong, Int. J. Numer. Methods Eng. 31, 1991; M. Austin,
//! P. S. Krishnaprasad, L.-S. Wang, J. Comput. Phys. 107, 1993).

use super::Inertia;
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DMat3, DQuat, DVec3};

/// Most rounds of the fixed-point iteration; it gains a factor T |ω| · (difference of moments) a round.
const ROUNDS: usize = 64;

/// Inverse tensor in the world of a body turned by `rotation`.
pub fn inverse_in_world(inverse: &DMat3, rotation: DQuat) -> DMat3 {
    let r = DMat3::from_quat(rotation);
    r * *inverse * r.transpose()
}

/// The constant angular velocity of a step of duration `t` for a body of angular momentum `l`.
pub fn angular_velocity(inertia: &Inertia, inverse: &DMat3, rotation: DQuat, l: DVec3, t: f64) -> DVec3 {
    let mut omega = inverse_in_world(inverse, rotation) * l;
    if inertia.is_round() || l == DVec3::ZERO {
        return omega;
    }
    for _ in 0..ROUNDS {
        let half = quat_of_rotation_vector(omega * (0.5 * t));
        let mean = (half * l + half.conjugate() * l) * 0.5;
        let next = inverse_in_world(inverse, half * rotation) * mean;
        let change = (next - omega).length();
        omega = next;
        if change <= 4.0 * f64::EPSILON * omega.length() {
            break;
        }
    }
    omega
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tumbling_box_keeps_its_energy() {
        // About the axis of the middle moment: the rotation that flips over and over.
        let inertia = Inertia::principal(1.0, DVec3::new(1.0, 2.0, 3.0));
        let inverse = inertia.tensor.inverse();
        let l = DVec3::new(0.01, 6.0, 0.02);
        let energy = |q| 0.5 * l.dot(inverse_in_world(&inverse, q) * l);
        let mut q = DQuat::IDENTITY;
        let (before, mut most, mut flipped) = (energy(q), 0.0f64, false);
        for _ in 0..10_000 {
            let omega = angular_velocity(&inertia, &inverse, q, l, 0.01);
            q = (quat_of_rotation_vector(omega * 0.01) * q).normalize();
            most = most.max((energy(q) / before - 1.0).abs());
            flipped |= (q * DVec3::Y).y < -0.9;
        }
        println!("energy off by {most:e}");
        assert!(flipped && most < 1e-12);
    }
}
