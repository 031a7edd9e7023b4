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
unsafe fn put(pose: Pose, position: *mut f64, rotation: *mut f64) -> Result<(), Failure> {
    // SAFETY: as promised by the caller.
    let (p, r) = unsafe { (room(position, "position")?, room(rotation, "rotation")?) };
    p.write(pose.position.to_array());
    r.write(pose.rotation.to_array());
    Ok(())
}

/// From `N` numbers of an engine to a pose.
///
/// # Safety
/// The caller's arrays (1).
unsafe fn from<const N: usize>(
    (given, name): (*const f64, &str),
    pose: impl FnOnce([f64; N]) -> Result<Pose, NotRigid>,
    position: *mut f64,
    rotation: *mut f64,
) -> i32 {
    free(|| {
        // SAFETY: as promised by the caller.
        let pose = pose(unsafe { numbers(given, name)? })?;
        // SAFETY: as promised by the caller.
        unsafe { put(pose, position, rotation) }
    })
}

/// From a pose to `N` numbers of an engine.
///
/// # Safety
/// The caller's arrays (1).
unsafe fn to<const N: usize>(
    position: *const f64,
    rotation: *const f64,
    numbers: impl FnOnce(&Pose) -> [f64; N],
    (out, name): (*mut f64, &str),
) -> i32 {
    free(|| {
        // SAFETY: as promised by the caller.
        let pose = unsafe { pose(position, rotation)? };
        // SAFETY: as promised by the caller.
        unsafe { room(out, name)? }.write(numbers(&pose));
        Ok(())
    })
}

/// Rows of four, one after the other.
fn rows<const N: usize, const R: usize>(matrix: [[f64; 4]; R]) -> [f64; N] {
    std::array::from_fn(|k| matrix[k / 4][k % 4])
}

/// The same back.
fn by_rows<const N: usize, const R: usize>(rows: [f64; N]) -> [[f64; 4]; R] {
    std::array::from_fn(|i| std::array::from_fn(|j| rows[4 * i + j]))
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
        unsafe { put(to_and_from::from_mujoco(xpos, xquat), position, rotation) }
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
    // SAFETY: the caller's arrays (1).
    unsafe { from((state, "state"), |state| Ok(to_and_from::from_drake(state)), position, rotation) }
}

/// The seven positions of a floating body in Drake's plant: quaternion w x y z, then x y z.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_drake(position: *const f64, rotation: *const f64, state: *mut f64) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe { to(position, rotation, to_and_from::to_drake, (state, "state")) }
}

/// A pose from [R | p], three rows of four: 12 numbers row by row. CONTACTD_ERROR_ARGUMENT when R is no rotation: scaled,
/// skewed, mirrored, by more than 1e-6 in an element of RᵀR − I.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_from_mat3x4(matrix: *const f64, position: *mut f64, rotation: *mut f64) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe { from((matrix, "matrix"), |rows: [f64; 12]| to_and_from::from_mat3x4(by_rows(rows)), position, rotation) }
}

/// [R | p] of a pose, three rows of four: 12 numbers row by row.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_mat3x4(position: *const f64, rotation: *const f64, matrix: *mut f64) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe { to::<12>(position, rotation, |pose| rows(to_and_from::to_mat3x4(pose)), (matrix, "matrix")) }
}

/// A pose from a homogeneous matrix, 16 numbers row by row, with the position in the last column (Drake, pinocchio,
/// trimesh). Refused as by contactd_from_mat3x4, and when the last row is not 0 0 0 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_from_mat4(matrix: *const f64, position: *mut f64, rotation: *mut f64) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe { from((matrix, "matrix"), |rows: [f64; 16]| to_and_from::from_mat4(by_rows(rows)), position, rotation) }
}

/// A homogeneous matrix of a pose, 16 numbers row by row, with the position in the last column.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_mat4(position: *const f64, rotation: *const f64, matrix: *mut f64) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe { to::<16>(position, rotation, |pose| rows(to_and_from::to_mat4(pose)), (matrix, "matrix")) }
}

/// A pose from 16 numbers column by column (OpenGL, three.js, Bullet's getOpenGLMatrix). Refused as by contactd_from_mat4.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_from_opengl(columns: *const f64, position: *mut f64, rotation: *mut f64) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe { from((columns, "columns"), to_and_from::from_opengl, position, rotation) }
}

/// 16 numbers column by column of a pose.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_to_opengl(position: *const f64, rotation: *const f64, columns: *mut f64) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe { to(position, rotation, to_and_from::to_opengl, (columns, "columns")) }
}
