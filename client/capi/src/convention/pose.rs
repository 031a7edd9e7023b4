//! Quaternions, poses and matrices.

use super::{numbers, room, vector};
use crate::error::Failure;
use crate::handle::free;
use contactd_client::convention::{self as to_and_from, NotRigid};
use contactd_proto::Pose;
use glam::DQuat;

impl From<NotRigid> for Failure {
    fn from(error: NotRigid) -> Self {
        Self::argument(error.to_string())
    }
}

/// A pose.
///
/// # Safety
/// As of `numbers`.
unsafe fn pose(position: *const f64, rotation: *const f64) -> Result<Pose, Failure> {
    // SAFETY: as promised by the caller.
    let (position, rotation) = unsafe { (vector(position, "position")?, numbers(rotation, "rotation")?) };
    Ok(Pose::new(position, DQuat::from_array(rotation)))
}

/// Writes a pose.
///
/// # Safety
/// As of `room`.
unsafe fn put_pose(pose: Pose, position: *mut f64, rotation: *mut f64) -> Result<(), Failure> {
    // SAFETY: as promised by the caller.
    let (p, r) = unsafe { (room(position, "position")?, room(rotation, "rotation")?) };
    p.write(pose.position.to_array());
    r.write(pose.rotation.to_array());
    Ok(())
}

/// x y z w from w x y z (MuJoCo, Drake, Isaac Sim, SAPIEN, the constructors of Eigen): four numbers to four.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_quaternion_from_wxyz(wxyz: *const f64, rotation: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let wxyz = unsafe { numbers(wxyz, "wxyz")? };
        // SAFETY: the caller's arrays (1).
        unsafe { room(rotation, "rotation")? }.write(to_and_from::quaternion_from_wxyz(wxyz).to_array());
        Ok(())
    })
}

/// w x y z from x y z w: four numbers to four.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_quaternion_to_wxyz(rotation: *const f64, wxyz: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let rotation = DQuat::from_array(unsafe { numbers(rotation, "rotation")? });
        // SAFETY: the caller's arrays (1).
        unsafe { room(wxyz, "wxyz")? }.write(to_and_from::quaternion_to_wxyz(rotation));
        Ok(())
    })
}

/// A pose from MuJoCo's `xpos` (3 numbers) and `xquat` (4, w x y z).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_from_mujoco(
    xpos: *const f64,
    xquat: *const f64,
    position: *mut f64,
    rotation: *mut f64,
) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (xpos, xquat) = unsafe { (numbers(xpos, "xpos")?, numbers(xquat, "xquat")?) };
        // SAFETY: the caller's arrays (1).
        unsafe { put_pose(to_and_from::from_mujoco(xpos, xquat), position, rotation) }
    })
}

/// MuJoCo's `xpos` (3 numbers) and `xquat` (4, w x y z) of a pose.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_mujoco(
    position: *const f64,
    rotation: *const f64,
    xpos: *mut f64,
    xquat: *mut f64,
) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let pose = unsafe { pose(position, rotation)? };
        // SAFETY: the caller's arrays (1).
        let places = unsafe { (room(xpos, "xpos")?, room(xquat, "xquat")?) };
        let (xpos, xquat) = to_and_from::to_mujoco(&pose);
        places.0.write(xpos);
        places.1.write(xquat);
        Ok(())
    })
}

/// A pose from the seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_from_drake(state: *const f64, position: *mut f64, rotation: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let given = unsafe { numbers(state, "state")? };
        let pose = to_and_from::from_drake(given);
        // SAFETY: the caller's arrays (1).
        unsafe { put_pose(pose, position, rotation) }
    })
}

/// The seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_drake(position: *const f64, rotation: *const f64, state: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let pose = unsafe { pose(position, rotation)? };
        // SAFETY: the caller's arrays (1).
        unsafe { room(state, "state")? }.write(to_and_from::to_drake(&pose));
        Ok(())
    })
}

/// A pose from [R | p], three rows of four: 12 numbers row by row. CONTACTD_ERROR_ARGUMENT when R is no rotation: scaled,
/// skewed, mirrored, by more than 1e-6 in an element of RᵀR − I.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_from_mat3x4(matrix: *const f64, position: *mut f64, rotation: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let given: [f64; 12] = unsafe { numbers(matrix, "matrix")? };
        let pose = to_and_from::from_mat3x4(std::array::from_fn(|i| std::array::from_fn(|j| given[4 * i + j])))?;
        // SAFETY: the caller's arrays (1).
        unsafe { put_pose(pose, position, rotation) }
    })
}

/// [R | p] of a pose, three rows of four: 12 numbers row by row.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_mat3x4(position: *const f64, rotation: *const f64, matrix: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let pose = unsafe { pose(position, rotation)? };
        let rows = to_and_from::to_mat3x4(&pose);
        // SAFETY: the caller's arrays (1).
        unsafe { room(matrix, "matrix")? }.write(std::array::from_fn::<f64, 12, _>(|k| rows[k / 4][k % 4]));
        Ok(())
    })
}

/// A pose from a homogeneous matrix, 16 numbers row by row, with the position in the last column (Drake, pinocchio,
/// trimesh). Refused as by contactd_from_mat3x4, and when the last row is not 0 0 0 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_from_mat4(matrix: *const f64, position: *mut f64, rotation: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let given: [f64; 16] = unsafe { numbers(matrix, "matrix")? };
        let pose = to_and_from::from_mat4(std::array::from_fn(|i| std::array::from_fn(|j| given[4 * i + j])))?;
        // SAFETY: the caller's arrays (1).
        unsafe { put_pose(pose, position, rotation) }
    })
}

/// A homogeneous matrix of a pose, 16 numbers row by row, with the position in the last column.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_mat4(position: *const f64, rotation: *const f64, matrix: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let pose = unsafe { pose(position, rotation)? };
        let rows = to_and_from::to_mat4(&pose);
        // SAFETY: the caller's arrays (1).
        unsafe { room(matrix, "matrix")? }.write(std::array::from_fn::<f64, 16, _>(|k| rows[k / 4][k % 4]));
        Ok(())
    })
}

/// A pose from 16 numbers column by column (OpenGL, three.js, Bullet's getOpenGLMatrix). Refused as by contactd_from_mat4.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_from_opengl(columns: *const f64, position: *mut f64, rotation: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let given = unsafe { numbers(columns, "columns")? };
        let pose = to_and_from::from_opengl(given)?;
        // SAFETY: the caller's arrays (1).
        unsafe { put_pose(pose, position, rotation) }
    })
}

/// 16 numbers column by column of a pose.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_opengl(position: *const f64, rotation: *const f64, columns: *mut f64) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let pose = unsafe { pose(position, rotation)? };
        // SAFETY: the caller's arrays (1).
        unsafe { room(columns, "columns")? }.write(to_and_from::to_opengl(&pose));
        Ok(())
    })
}
