//! Contacts.

use super::{numbers, room, vector};
use crate::error::Failure;
use crate::handle::free;
use crate::raw::place;
use contactd_client::convention::Contact;
use glam::DVec3;

/// Vectors and a number with the names of their arrays: what an engine calls a contact.
struct Own<P, const N: usize> {
    vectors: [(P, &'static str); N],
    number: (P, &'static str),
}

/// contactd's contact.
fn ours<P>(point: P, normal: P, separation: P) -> Own<P, 2> {
    Own { vectors: [(point, "point"), (normal, "normal")], number: (separation, "separation") }
}

impl<const N: usize> Own<*mut f64, N> {
    /// Writes one.
    ///
    /// # Safety
    /// As of `room`, for each array.
    unsafe fn put(self, vectors: [DVec3; N], number: f64) -> Result<(), Failure> {
        // SAFETY: as promised by the caller.
        let last = unsafe { place(self.number.0, self.number.1)? };
        let mut rooms = [const { None }; N];
        for (room_of, (pointer, name)) in rooms.iter_mut().zip(self.vectors) {
            // SAFETY: as promised by the caller.
            *room_of = Some(unsafe { room(pointer, name)? });
        }
        for (room_of, vector) in rooms.into_iter().flatten().zip(vectors) {
            room_of.write(vector.to_array());
        }
        last.write(number);
        Ok(())
    }
}

/// Vectors with the names of their arrays.
///
/// # Safety
/// As of `numbers`, for each array.
unsafe fn read<const N: usize>(arrays: [(*const f64, &'static str); N]) -> Result<[DVec3; N], Failure> {
    let mut read = [DVec3::ZERO; N];
    for (vector_of, (pointer, name)) in read.iter_mut().zip(arrays) {
        // SAFETY: as promised by the caller.
        *vector_of = unsafe { vector(pointer, name)? };
    }
    Ok(read)
}

/// From an engine's vectors to contactd's contact.
///
/// # Safety
/// The caller's arrays (1).
unsafe fn from<const N: usize>(
    vectors: [(*const f64, &'static str); N],
    contact: impl FnOnce([DVec3; N]) -> Contact,
    out: Own<*mut f64, 2>,
) -> i32 {
    free(|| {
        // SAFETY: as promised by the caller.
        let c = contact(unsafe { read(vectors)? });
        // SAFETY: as promised by the caller.
        unsafe { out.put([c.point, c.normal], c.separation) }
    })
}

/// From contactd's contact to an engine's vectors and its number.
///
/// # Safety
/// The caller's arrays (1).
unsafe fn to<const N: usize>(
    [point, normal]: [*const f64; 2],
    separation: f64,
    own: impl FnOnce(Contact) -> ([DVec3; N], f64),
    out: Own<*mut f64, N>,
) -> i32 {
    free(|| {
        // SAFETY: as promised by the caller.
        let [point, normal] = unsafe { read([(point, "point"), (normal, "normal")])? };
        let (vectors, number) = own(Contact { point, normal, separation });
        // SAFETY: as promised by the caller.
        unsafe { out.put(vectors, number) }
    })
}

/// From MuJoCo's `mjContact`: `pos` half way, `frame` of 9 numbers whose first three point from geom 1 to geom 2, `dist` <
/// 0 in penetration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_from_mujoco(
    pos: *const f64,
    frame: *const f64,
    dist: f64,
    point: *mut f64,
    normal: *mut f64,
    separation: *mut f64,
) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (pos, frame) = unsafe { (vector(pos, "pos")?, numbers(frame, "frame")?) };
        let c = Contact::from_mujoco(pos, frame, dist);
        // SAFETY: the caller's arrays (1).
        unsafe { ours(point, normal, separation).put([c.point, c.normal], c.separation) }
    })
}

/// `pos`, `frame` (the normal, then the two tangents that MuJoCo itself chooses: 9 numbers) and `dist` of `mjContact`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_to_mujoco(
    point: *const f64,
    normal: *const f64,
    separation: f64,
    pos: *mut f64,
    frame: *mut f64,
    dist: *mut f64,
) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let [point, normal] = unsafe { read([(point, "point"), (normal, "normal")])? };
        let (centre, axes, distance) = Contact { point, normal, separation }.to_mujoco();
        // SAFETY: the caller's arrays (1).
        let rows = unsafe { room(frame, "frame")? };
        // SAFETY: the caller's arrays (1).
        unsafe { Own { vectors: [(pos, "pos")], number: (dist, "dist") }.put([centre], distance)? };
        rows.write(axes);
        Ok(())
    })
}

/// From Drake's `PenetrationAsPointPair`: `p_WCa`, `p_WCb` a point of each surface, `nhat_BA_W` from B into A, `depth` > 0
/// in penetration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_from_drake(
    p_wca: *const f64,
    p_wcb: *const f64,
    nhat_ba_w: *const f64,
    depth: f64,
    point: *mut f64,
    normal: *mut f64,
    separation: *mut f64,
) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe {
        from(
            [(p_wca, "p_wca"), (p_wcb, "p_wcb"), (nhat_ba_w, "nhat_ba_w")],
            |[p_wca, p_wcb, nhat_ba_w]| Contact::from_drake(p_wca, p_wcb, nhat_ba_w, depth),
            ours(point, normal, separation),
        )
    }
}

/// `p_WCa`, `p_WCb`, `nhat_BA_W`, `depth` of Drake's `PenetrationAsPointPair`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_to_drake(
    point: *const f64,
    normal: *const f64,
    separation: f64,
    p_wca: *mut f64,
    p_wcb: *mut f64,
    nhat_ba_w: *mut f64,
    depth: *mut f64,
) -> i32 {
    let own = |contact: Contact| {
        let (p_wca, p_wcb, nhat_ba_w, depth) = contact.to_drake();
        ([p_wca, p_wcb, nhat_ba_w], depth)
    };
    let out = Own { vectors: [(p_wca, "p_wca"), (p_wcb, "p_wcb"), (nhat_ba_w, "nhat_ba_w")], number: (depth, "depth") };
    // SAFETY: the caller's arrays (1).
    unsafe { to([point, normal], separation, own, out) }
}

/// From Bullet's `btManifoldPoint`: a point of each surface, the normal on B towards A, `distance` < 0 in penetration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_from_bullet(
    on_a: *const f64,
    on_b: *const f64,
    normal_on_b: *const f64,
    distance: f64,
    point: *mut f64,
    normal: *mut f64,
    separation: *mut f64,
) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe {
        from(
            [(on_a, "on_a"), (on_b, "on_b"), (normal_on_b, "normal_on_b")],
            |[on_a, on_b, normal_on_b]| Contact::from_bullet(on_a, on_b, normal_on_b, distance),
            ours(point, normal, separation),
        )
    }
}

/// The points on A and on B, the normal on B and the distance of Bullet's `btManifoldPoint`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_to_bullet(
    point: *const f64,
    normal: *const f64,
    separation: f64,
    on_a: *mut f64,
    on_b: *mut f64,
    normal_on_b: *mut f64,
    distance: *mut f64,
) -> i32 {
    let own = |contact: Contact| {
        let (on_a, on_b, normal_on_b, distance) = contact.to_bullet();
        ([on_a, on_b, normal_on_b], distance)
    };
    let out =
        Own { vectors: [(on_a, "on_a"), (on_b, "on_b"), (normal_on_b, "normal_on_b")], number: (distance, "distance") };
    // SAFETY: the caller's arrays (1).
    unsafe { to([point, normal], separation, own, out) }
}

/// From PhysX's `PxContactPairPoint`: its `position`, its `normal` (here `from_second`: from the second shape to the first)
/// and its `separation` (here `gap`), < 0 in penetration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_from_physx(
    position: *const f64,
    from_second: *const f64,
    gap: f64,
    point: *mut f64,
    normal: *mut f64,
    separation: *mut f64,
) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe {
        from(
            [(position, "position"), (from_second, "from_second")],
            |[position, from_second]| Contact::from_physx(position, from_second, gap),
            ours(point, normal, separation),
        )
    }
}

/// `position`, `normal` and `separation` of PhysX's `PxContactPairPoint`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_to_physx(
    point: *const f64,
    normal: *const f64,
    separation: f64,
    position: *mut f64,
    from_second: *mut f64,
    gap: *mut f64,
) -> i32 {
    let own = |contact: Contact| {
        let (position, from_second, gap) = contact.to_physx();
        ([position, from_second], gap)
    };
    let out = Own { vectors: [(position, "position"), (from_second, "from_second")], number: (gap, "gap") };
    // SAFETY: the caller's arrays (1).
    unsafe { to([point, normal], separation, own, out) }
}

/// From ODE's `dContactGeom`: `pos`, its `normal` (here `into_first`: into body 1) and `depth` > 0 in penetration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_from_ode(
    pos: *const f64,
    into_first: *const f64,
    depth: f64,
    point: *mut f64,
    normal: *mut f64,
    separation: *mut f64,
) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe {
        from(
            [(pos, "pos"), (into_first, "into_first")],
            |[pos, into_first]| Contact::from_ode(pos, into_first, depth),
            ours(point, normal, separation),
        )
    }
}

/// `pos`, `normal` and `depth` of ODE's `dContactGeom`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_to_ode(
    point: *const f64,
    normal: *const f64,
    separation: f64,
    pos: *mut f64,
    into_first: *mut f64,
    depth: *mut f64,
) -> i32 {
    let own = |contact: Contact| {
        let (pos, into_first, depth) = contact.to_ode();
        ([pos, into_first], depth)
    };
    let out = Own { vectors: [(pos, "pos"), (into_first, "into_first")], number: (depth, "depth") };
    // SAFETY: the caller's arrays (1).
    unsafe { to([point, normal], separation, own, out) }
}

/// From Coal's `Contact`: `pos` half way, its `normal` (here `to_second`: from object 1 to object 2) and
/// `penetration_depth` < 0 in penetration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_from_coal(
    pos: *const f64,
    to_second: *const f64,
    penetration_depth: f64,
    point: *mut f64,
    normal: *mut f64,
    separation: *mut f64,
) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe {
        from(
            [(pos, "pos"), (to_second, "to_second")],
            |[pos, to_second]| Contact::from_coal(pos, to_second, penetration_depth),
            ours(point, normal, separation),
        )
    }
}

/// `pos`, `normal` and `penetration_depth` of Coal's `Contact`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_to_coal(
    point: *const f64,
    normal: *const f64,
    separation: f64,
    pos: *mut f64,
    to_second: *mut f64,
    penetration_depth: *mut f64,
) -> i32 {
    let own = |contact: Contact| {
        let (pos, to_second, penetration_depth) = contact.to_coal();
        ([pos, to_second], penetration_depth)
    };
    let out =
        Own { vectors: [(pos, "pos"), (to_second, "to_second")], number: (penetration_depth, "penetration_depth") };
    // SAFETY: the caller's arrays (1).
    unsafe { to([point, normal], separation, own, out) }
}

/// From parry's `Contact` in the world frame: a point of each shape, the normal out of shape 1, `dist` < 0 in penetration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_from_rapier(
    point1: *const f64,
    point2: *const f64,
    normal1: *const f64,
    dist: f64,
    point: *mut f64,
    normal: *mut f64,
    separation: *mut f64,
) -> i32 {
    // SAFETY: the caller's arrays (1).
    unsafe {
        from(
            [(point1, "point1"), (point2, "point2"), (normal1, "normal1")],
            |[point1, point2, normal1]| Contact::from_rapier(point1, point2, normal1, dist),
            ours(point, normal, separation),
        )
    }
}

/// `point1`, `point2`, `normal1` and `dist` of parry's `Contact`, world frame; its `normal2` is the opposite of `normal1`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_contact_to_rapier(
    point: *const f64,
    normal: *const f64,
    separation: f64,
    point1: *mut f64,
    point2: *mut f64,
    normal1: *mut f64,
    dist: *mut f64,
) -> i32 {
    let own = |contact: Contact| {
        let (point1, point2, normal1, _, dist) = contact.to_rapier();
        ([point1, point2, normal1], dist)
    };
    let out = Own { vectors: [(point1, "point1"), (point2, "point2"), (normal1, "normal1")], number: (dist, "dist") };
    // SAFETY: the caller's arrays (1).
    unsafe { to([point, normal], separation, own, out) }
}
