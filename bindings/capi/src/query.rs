//! What a session is asked about its objects where its last step has left them.

use crate::abi::{Distance, PointQuery, RayQuery};
use crate::error::Failure;
use crate::handle::{Session, State, on};
use crate::raw::{given, place, row};
use contactd_proto::query::{ObjectRay, PointOptions, PointRecord, RayOptions, RayRecord};
use std::mem::MaybeUninit;
use std::ptr::null;

/// How far two objects are apart: certified bounds to a tolerance (a length), and a point of each. Queries change nothing, and no
/// step's answer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_distance(
    session: *mut Session,
    a: u32,
    b: u32,
    tolerance: f64,
    distance: *mut Distance,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's variable (1).
        let place = unsafe { place(distance, "distance")? };
        let d = state.session.distance(a, b, tolerance)?;
        let ([point_a, point_b], settled) = (d.points, d.is_settled.into());
        place.write(Distance {
            lower: d.lower,
            upper: d.upper,
            point_a,
            point_b,
            cells: d.cells,
            settled,
            reserved: 0,
        });
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// A query of points with defaults.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_point_query_new() -> PointQuery {
    let PointOptions { surface, tolerance, limit } = PointOptions::default();
    PointQuery { surface, tolerance, limit, objects: null(), object_count: 0 }
}

/// A query of rays with defaults.
#[unsafe(no_mangle)]
pub extern "C" fn contactd_ray_query_new() -> RayQuery {
    let RayOptions { depth, limit } = RayOptions::default();
    RayQuery { depth, limit, objects: null(), object_count: 0 }
}

/// The least signed distance of `n` points from the objects that are asked, certified: `answers` has room for as many.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_get_points(
    session: *mut Session,
    points: *const [f64; 3],
    n: usize,
    query: *const PointQuery,
    answers: *mut PointRecord,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's points and structure (1).
        let (points, query) = unsafe { (row(points, n, "points")?, given(query, "query")?) };
        // SAFETY: the caller's ids, and room for as many answers (1).
        let (objects, answers) = unsafe { (ids(query.objects, query.object_count)?, room(answers, n)?) };
        let options = PointOptions { surface: query.surface, tolerance: query.tolerance, limit: query.limit };
        let told = state.session.points(points, &options, objects)?;
        answers.iter_mut().zip(&told).for_each(|(to, from)| _ = to.write(from.into()));
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// What `n` rays meet first of the objects that are asked, certified: `answers` has room for as many.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_cast_rays(
    session: *mut Session,
    rays: *const ObjectRay,
    n: usize,
    query: *const RayQuery,
    answers: *mut RayRecord,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's rays and structure (1).
        let (rays, query) = unsafe { (row(rays, n, "rays")?, given(query, "query")?) };
        // SAFETY: the caller's ids, and room for as many answers (1).
        let (objects, answers) = unsafe { (ids(query.objects, query.object_count)?, room(answers, n)?) };
        let options = RayOptions { depth: query.depth, limit: query.limit };
        let told = state.session.rays(rays, &options, objects)?;
        answers.iter_mut().zip(&told).for_each(|(to, from)| _ = to.write(from.into()));
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// Ids of objects; `None` for all.
///
/// # Safety
/// Point 1 of the contract: NULL, or `n` ids.
unsafe fn ids<'a>(pointer: *const u32, n: usize) -> Result<Option<&'a [u32]>, Failure> {
    if pointer.is_null() && n == 0 {
        return Ok(None);
    }
    // SAFETY: the caller's.
    unsafe { row(pointer, n, "objects") }.map(Some)
}

/// Room for `n` answers.
///
/// # Safety
/// Point 1 of the contract: NULL, or room for `n` of them that nobody else uses during the call.
unsafe fn room<'a, T>(pointer: *mut T, n: usize) -> Result<&'a mut [MaybeUninit<T>], Failure> {
    let pointer = pointer.cast::<MaybeUninit<T>>();
    // SAFETY: the caller's.
    let length = unsafe { row(pointer.cast_const(), n, "answers")? }.len();
    if length == 0 {
        return Ok(&mut []);
    }
    // SAFETY: as above, and nobody else uses it.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, length) })
}
