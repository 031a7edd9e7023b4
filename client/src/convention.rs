//! Named converters for the conventions of the field: quaternion order, direction of the normal, sign of the depth, point or
//! pair of points.
//!
//! contactd: quaternions x y z w; the unit normal points from a to b; the separation is positive apart, negative in
//! penetration; one point, half way between the surfaces. In each engine's contact its body 1 (A, first) is a. The same
//! converters for arrays are in the Python package (`contactd.convention`); docs/coupling.md has the table of engines.

use contactd_proto::Pose;
use glam::{DMat3, DQuat, DVec3};

/// How far a matrix may be off a rotation, in any element of RᵀR − I.
pub const ROTATION_TOLERANCE: f64 = 1e-6;

/// A matrix that is no rigid placement: scaled, skewed, mirrored, or with a last row other than 0 0 0 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a rigid placement: an orthonormal, right-handed matrix without scale, and a last row of 0 0 0 1")]
pub struct NotRigid;

/// x y z w from w x y z (MuJoCo, Drake, Isaac Sim, SAPIEN, the constructors of Eigen and nalgebra).
pub fn quaternion_from_wxyz([w, x, y, z]: [f64; 4]) -> DQuat {
    DQuat::from_xyzw(x, y, z, w)
}

/// w x y z from x y z w.
pub fn quaternion_to_wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

/// From MuJoCo's `xpos` and `xquat` (w x y z).
pub fn from_mujoco(xpos: [f64; 3], xquat: [f64; 4]) -> Pose {
    Pose::new(DVec3::from_array(xpos), quaternion_from_wxyz(xquat))
}

/// MuJoCo's `xpos` and `xquat` (w x y z).
pub fn to_mujoco(pose: &Pose) -> ([f64; 3], [f64; 4]) {
    (pose.position.to_array(), quaternion_to_wxyz(pose.rotation))
}

/// From the seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z.
pub fn from_drake([qw, qx, qy, qz, x, y, z]: [f64; 7]) -> Pose {
    from_mujoco([x, y, z], [qw, qx, qy, qz])
}

/// The seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z.
pub fn to_drake(pose: &Pose) -> [f64; 7] {
    let ([x, y, z], [qw, qx, qy, qz]) = to_mujoco(pose);
    [qw, qx, qy, qz, x, y, z]
}

/// From [R | p], three rows of four.
///
/// # Errors
/// `NotRigid`.
pub fn from_mat3x4(rows: [[f64; 4]; 3]) -> Result<Pose, NotRigid> {
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    let r = DMat3::from_cols(column(0), column(1), column(2));
    let off = r.transpose() * r - DMat3::IDENTITY;
    let near = off.to_cols_array().iter().all(|e| e.abs() <= ROTATION_TOLERANCE);
    let position = column(3);
    if near && r.determinant() > 0.0 && position.is_finite() {
        Ok(Pose::new(position, DQuat::from_mat3(&r).normalize()))
    } else {
        Err(NotRigid)
    }
}

/// [R | p], three rows of four.
pub fn to_mat3x4(pose: &Pose) -> [[f64; 4]; 3] {
    let (r, p) = (pose.matrix(), pose.position);
    std::array::from_fn(|i| [r.x_axis[i], r.y_axis[i], r.z_axis[i], p[i]])
}

/// From a homogeneous matrix, row by row, with the position in the last column (Drake, pinocchio, trimesh).
///
/// # Errors
/// `NotRigid`.
pub fn from_mat4([r0, r1, r2, last]: [[f64; 4]; 4]) -> Result<Pose, NotRigid> {
    if last == [0.0, 0.0, 0.0, 1.0] { from_mat3x4([r0, r1, r2]) } else { Err(NotRigid) }
}

/// A homogeneous matrix, row by row, with the position in the last column.
pub fn to_mat4(pose: &Pose) -> [[f64; 4]; 4] {
    let [r0, r1, r2] = to_mat3x4(pose);
    [r0, r1, r2, [0.0, 0.0, 0.0, 1.0]]
}

/// From 16 numbers column by column (OpenGL, three.js, Bullet's `getOpenGLMatrix`, glam's `to_cols_array`).
///
/// # Errors
/// `NotRigid`.
pub fn from_opengl(columns: [f64; 16]) -> Result<Pose, NotRigid> {
    from_mat4(std::array::from_fn(|i| std::array::from_fn(|j| columns[4 * j + i])))
}

/// 16 numbers column by column.
pub fn to_opengl(pose: &Pose) -> [f64; 16] {
    let rows = to_mat4(pose);
    std::array::from_fn(|k| rows[k % 4][k / 4])
}

/// A contact in contactd's convention.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Half way between the surfaces, world frame.
    pub point: DVec3,
    /// Unit normal from a to b.
    pub normal: DVec3,
    /// Positive apart, negative in penetration.
    pub separation: f64,
}

impl Contact {
    /// A point on each surface: half the separation from the middle, along the normal.
    pub fn pair(&self) -> (DVec3, DVec3) {
        let half = self.normal * (self.separation / 2.0);
        (self.point - half, self.point + half)
    }

    /// From a point of each surface.
    fn between(on_a: DVec3, on_b: DVec3, normal: DVec3, separation: f64) -> Self {
        Self { point: (on_a + on_b) / 2.0, normal, separation }
    }

    /// From `mjContact`: `pos` half way, the first three numbers of `frame` from geom 1 to geom 2, `dist` < 0 in penetration.
    pub fn from_mujoco(pos: DVec3, frame: [f64; 9], dist: f64) -> Self {
        Self { point: pos, normal: DVec3::new(frame[0], frame[1], frame[2]), separation: dist }
    }

    /// `pos`, `frame` (the normal, then the two tangents that MuJoCo itself chooses) and `dist` of `mjContact`.
    pub fn to_mujoco(&self) -> (DVec3, [f64; 9], f64) {
        let n = self.normal;
        let axis = if n.y.abs() < 0.5 { DVec3::Y } else { DVec3::Z };
        let first = (axis - n * n.dot(axis)).normalize();
        let second = n.cross(first);
        let rows = [n, first, second];
        (self.point, std::array::from_fn(|k| rows[k / 3][k % 3]), self.separation)
    }

    /// From Drake's `PenetrationAsPointPair`: a point of each surface, the normal from B into A, `depth` > 0 in penetration.
    pub fn from_drake(p_wca: DVec3, p_wcb: DVec3, nhat_ba_w: DVec3, depth: f64) -> Self {
        Self::between(p_wca, p_wcb, -nhat_ba_w, -depth)
    }

    /// `p_WCa`, `p_WCb`, `nhat_BA_W`, `depth` of `PenetrationAsPointPair`.
    pub fn to_drake(&self) -> (DVec3, DVec3, DVec3, f64) {
        let (on_a, on_b) = self.pair();
        (on_a, on_b, -self.normal, -self.separation)
    }

    /// From PyBullet's `getContactPoints` (`btManifoldPoint`): a point of each surface, the normal on B towards A, distance < 0 in
    /// penetration.
    pub fn from_bullet(on_a: DVec3, on_b: DVec3, normal_on_b: DVec3, distance: f64) -> Self {
        Self::between(on_a, on_b, -normal_on_b, distance)
    }

    /// `positionOnA`, `positionOnB`, `contactNormalOnB`, `contactDistance`.
    pub fn to_bullet(&self) -> (DVec3, DVec3, DVec3, f64) {
        let (on_a, on_b) = self.pair();
        (on_a, on_b, -self.normal, self.separation)
    }

    /// From PhysX's `PxContactPairPoint`: one point, the normal from the second shape to the first, separation < 0 in penetration.
    pub fn from_physx(position: DVec3, normal: DVec3, separation: f64) -> Self {
        Self { point: position, normal: -normal, separation }
    }

    /// `position`, `normal`, `separation` of `PxContactPairPoint`.
    pub fn to_physx(&self) -> (DVec3, DVec3, f64) {
        (self.point, -self.normal, self.separation)
    }

    /// From ODE's `dContactGeom`: one point, the normal into body 1, `depth` > 0 in penetration.
    pub fn from_ode(pos: DVec3, normal: DVec3, depth: f64) -> Self {
        Self { point: pos, normal: -normal, separation: -depth }
    }

    /// `pos`, `normal`, `depth` of `dContactGeom`.
    pub fn to_ode(&self) -> (DVec3, DVec3, f64) {
        (self.point, -self.normal, -self.separation)
    }

    /// From Coal's `Contact`: a point half way, the normal from object 1 to object 2, its `penetration_depth` < 0 in penetration.
    pub fn from_coal(pos: DVec3, normal: DVec3, penetration_depth: f64) -> Self {
        Self { point: pos, normal, separation: penetration_depth }
    }

    /// `pos`, `normal`, `penetration_depth` of Coal's `Contact`.
    pub fn to_coal(&self) -> (DVec3, DVec3, f64) {
        (self.point, self.normal, self.separation)
    }

    /// From parry's `Contact` in the world frame: a point of each shape, the normal out of shape 1, `dist` < 0 in penetration.
    pub fn from_rapier(point1: DVec3, point2: DVec3, normal1: DVec3, dist: f64) -> Self {
        Self::between(point1, point2, normal1, dist)
    }

    /// `point1`, `point2`, `normal1`, `normal2`, `dist` of parry's `Contact`, world frame.
    pub fn to_rapier(&self) -> (DVec3, DVec3, DVec3, DVec3, f64) {
        let (on_a, on_b) = self.pair();
        (on_a, on_b, self.normal, -self.normal, self.separation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_1_SQRT_2 as HALF;

    const P: [f64; 3] = [1.0, 2.0, 3.0];
    /// A quarter turn about z takes x to y.
    const QUARTER: DQuat = DQuat::from_xyzw(0.0, 0.0, HALF, HALF);

    fn pose() -> Pose {
        Pose::new(DVec3::from_array(P), QUARTER)
    }

    fn poses() -> impl Iterator<Item = Pose> {
        (0..200).map(|k| {
            let s = f64::from(k);
            let q = DQuat::from_euler(glam::EulerRot::XYZ, 0.7 * s, 1.3 * s, 2.9 * s);
            Pose::new(DVec3::new(s, -0.5 * s, 1.0 / (1.0 + s)), q)
        })
    }

    #[test]
    fn poses_by_hand() {
        assert_eq!(quaternion_from_wxyz([1.0, 2.0, 3.0, 4.0]), DQuat::from_xyzw(2.0, 3.0, 4.0, 1.0));
        assert_eq!(to_mujoco(&pose()), (P, [HALF, 0.0, 0.0, HALF]));
        assert_eq!(to_drake(&pose()), [HALF, 0.0, 0.0, HALF, 1.0, 2.0, 3.0]);
        let flat = [[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]];
        for (found, expected) in to_mat3x4(&pose()).iter().flatten().zip(flat.iter().flatten()) {
            assert!((found - expected).abs() < 1e-15);
        }
        let column = [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 1.0];
        for (found, expected) in to_opengl(&pose()).iter().zip(column) {
            assert!((found - expected).abs() < 1e-15);
        }
        assert!(from_mat3x4(flat).is_ok_and(|p| p.rotation.dot(QUARTER).abs() > 1.0 - 1e-15));
    }

    #[test]
    fn poses_there_and_back() {
        for pose in poses() {
            let (xpos, xquat) = to_mujoco(&pose);
            assert_eq!(from_mujoco(xpos, xquat), pose);
            assert_eq!(from_drake(to_drake(&pose)), pose);
            for back in [from_mat3x4(to_mat3x4(&pose)), from_mat4(to_mat4(&pose)), from_opengl(to_opengl(&pose))] {
                let back = back.unwrap();
                assert_eq!(back.position, pose.position);
                assert!(back.rotation.dot(pose.rotation).abs() > 1.0 - 1e-14 && back.rotation.is_normalized());
            }
        }
    }

    #[test]
    fn what_is_no_placement_is_refused() {
        let good = to_mat4(&pose());
        let with = |i: usize, j: usize, value: f64| {
            let mut m = good;
            m[i][j] = value;
            m
        };
        let mut mirrored = good;
        mirrored[2][2] = -1.0;
        for bad in [
            with(0, 0, 1e-3),
            with(3, 3, 2.0),
            with(3, 0, 1e-9),
            with(1, 1, f64::NAN),
            with(0, 3, f64::INFINITY),
            mirrored,
        ] {
            assert_eq!(from_mat4(bad), Err(NotRigid), "{bad:?}");
        }
    }

    /// A ball a of radius 1 at the origin, a ball b of radius 1 at x = 1.9: they share .1.
    const DEEP: Contact = Contact { point: DVec3::new(0.95, 0.0, 0.0), normal: DVec3::X, separation: -0.1 };

    #[test]
    fn contacts_by_hand() {
        let near = |p: DVec3, x: f64| (p - DVec3::X * x).length() < 1e-15;
        assert_eq!(DEEP.to_mujoco(), (DEEP.point, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], -0.1));
        // The point of A is A's deepest in B, at x = 1; that of B at x = .9. The normal points out of B into A.
        let (a, b, nhat, depth) = DEEP.to_drake();
        assert!(near(a, 1.0) && near(b, 0.9) && nhat == DVec3::NEG_X && depth == 0.1);
        let (a, b, normal, distance) = DEEP.to_bullet();
        assert!(near(a, 1.0) && near(b, 0.9) && normal == DVec3::NEG_X && distance == -0.1);
        assert_eq!(DEEP.to_physx(), (DEEP.point, DVec3::NEG_X, -0.1));
        assert_eq!(DEEP.to_ode(), (DEEP.point, DVec3::NEG_X, 0.1));
        assert_eq!(DEEP.to_coal(), (DEEP.point, DVec3::X, -0.1));
        let (a, b, n1, n2, dist) = DEEP.to_rapier();
        assert!(near(a, 1.0) && near(b, 0.9) && n1 == DVec3::X && n2 == DVec3::NEG_X && dist == -0.1);
    }

    #[test]
    fn contacts_there_and_back() {
        for (k, pose) in poses().enumerate() {
            let c =
                Contact { point: pose.position, normal: pose.rotation * DVec3::Z, separation: 0.1 - 0.01 * k as f64 };
            let same = |found: Contact| {
                found.normal == c.normal && found.separation == c.separation && (found.point - c.point).length() < 1e-12
            };
            let (pos, frame, dist) = c.to_mujoco();
            assert!(same(Contact::from_mujoco(pos, frame, dist)));
            let frame = DMat3::from_cols_array(&frame);
            assert!((frame.transpose() * frame - DMat3::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-14));
            assert!(frame.determinant() > 0.0);
            let (a, b, n, depth) = c.to_drake();
            assert!(same(Contact::from_drake(a, b, n, depth)));
            let (a, b, n, distance) = c.to_bullet();
            assert!(same(Contact::from_bullet(a, b, n, distance)));
            let (p, n, s) = c.to_physx();
            assert!(same(Contact::from_physx(p, n, s)));
            let (p, n, depth) = c.to_ode();
            assert!(same(Contact::from_ode(p, n, depth)));
            let (p, n, s) = c.to_coal();
            assert!(same(Contact::from_coal(p, n, s)));
            let (a, b, n, _, s) = c.to_rapier();
            assert!(same(Contact::from_rapier(a, b, n, s)));
        }
    }
}
