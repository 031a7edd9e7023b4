//! Named converters for the conventions of the field, on plain arrays: `contactd_client::convention` for C.
//!
//! contactd: quaternions x y z w; the unit normal points from a to b; the separation is positive apart, negative in
//! penetration; one point, half way between the surfaces. In each engine's contact its body 1 (A, first) is a. `position` and
//! `rotation` may be those of a contactd_pose or of a contactd_pose_record, `point` and `normal` those of a contactd_record.
//! What goes in is read before anything is written, so an array may be converted in place.

use crate::error::Failure;
use crate::raw::{given, place};
use glam::DVec3;
use std::mem::MaybeUninit;

pub mod contact;
pub mod pose;

/// `N` numbers in a row.
///
/// # Safety
/// Point 1 of the contract: NULL, or `N` numbers.
unsafe fn numbers<const N: usize>(pointer: *const f64, what: &str) -> Result<[f64; N], Failure> {
    // SAFETY: as promised by the caller.
    unsafe { given(pointer.cast::<[f64; N]>(), what) }.copied()
}

/// Three of them.
///
/// # Safety
/// As of `numbers`.
unsafe fn vector(pointer: *const f64, what: &str) -> Result<DVec3, Failure> {
    // SAFETY: as promised by the caller.
    unsafe { numbers(pointer, what) }.map(DVec3::from_array)
}

/// Room for `N` numbers.
///
/// # Safety
/// Point 1 of the contract: NULL, or room for `N` numbers.
unsafe fn room<'a, const N: usize>(pointer: *mut f64, what: &str) -> Result<&'a mut MaybeUninit<[f64; N]>, Failure> {
    // SAFETY: as promised by the caller.
    unsafe { place(pointer.cast(), what) }
}
