//! Contacts.

use super::{numbers, room, vector};
use crate::error::Failure;
use crate::handle::free;
use crate::raw::place;
use contactd_client::convention::Contact;
use glam::DVec3;

/// A contact.
///
/// # Safety
/// As of `numbers`.
unsafe fn contact(point: *const f64, normal: *const f64, separation: f64) -> Result<Contact, Failure> {
    // SAFETY: as promised by the caller.
    let (point, normal) = unsafe { (vector(point, "point")?, vector(normal, "normal")?) };
    Ok(Contact { point, normal, separation })
}

/// Writes a contact.
///
/// # Safety
/// As of `room`.
unsafe fn put_contact(c: Contact, point: *mut f64, normal: *mut f64, separation: *mut f64) -> Result<(), Failure> {
    // SAFETY: as promised by the caller.
    let (p, n) = unsafe { (room(point, "point")?, room(normal, "normal")?) };
    // SAFETY: as promised by the caller.
    let s = unsafe { place(separation, "separation")? };
    p.write(c.point.to_array());
    n.write(c.normal.to_array());
    s.write(c.separation);
    Ok(())
}

/// Writes an engine's contact of one point and a normal.
///
/// # Safety
/// As of `room`.
unsafe fn put_single(
    (point, normal, number): (DVec3, DVec3, f64),
    out: [*mut f64; 3],
    names: [&str; 3],
) -> Result<(), Failure> {
    // SAFETY: as promised by the caller.
    let (p, n) = unsafe { (room(out[0], names[0])?, room(out[1], names[1])?) };
    // SAFETY: as promised by the caller.
    let s = unsafe { place(out[2], names[2])? };
    p.write(point.to_array());
    n.write(normal.to_array());
    s.write(number);
    Ok(())
}

/// Writes an engine's contact of a point of each surface and a normal.
///
/// # Safety
/// As of `room`.
unsafe fn put_pair(
    (first, second, normal, number): (DVec3, DVec3, DVec3, f64),
    out: [*mut f64; 4],
    names: [&str; 4],
) -> Result<(), Failure> {
    // SAFETY: as promised by the caller.
    let (a, b) = unsafe { (room(out[0], names[0])?, room(out[1], names[1])?) };
    // SAFETY: as promised by the caller.
    let (n, s) = unsafe { (room(out[2], names[2])?, place(out[3], names[3])?) };
    a.write(first.to_array());
    b.write(second.to_array());
    n.write(normal.to_array());
    s.write(number);
    Ok(())
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
        let contact = Contact::from_mujoco(pos, frame, dist);
        // SAFETY: the caller's arrays (1).
        unsafe { put_contact(contact, point, normal, separation) }
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
        let contact = unsafe { contact(point, normal, separation)? };
        // SAFETY: the caller's arrays (1).
        let (p, f) = unsafe { (room(pos, "pos")?, room(frame, "frame")?) };
        // SAFETY: the caller's arrays (1).
        let d = unsafe { place(dist, "dist")? };
        let (pos, frame, dist) = contact.to_mujoco();
        p.write(pos.to_array());
        f.write(frame);
        d.write(dist);
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (p_wca, p_wcb, nhat_ba_w) =
            unsafe { (vector(p_wca, "p_wca")?, vector(p_wcb, "p_wcb")?, vector(nhat_ba_w, "nhat_ba_w")?) };
        let contact = Contact::from_drake(p_wca, p_wcb, nhat_ba_w, depth);
        // SAFETY: the caller's arrays (1).
        unsafe { put_contact(contact, point, normal, separation) }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let contact = unsafe { contact(point, normal, separation)? };
        // SAFETY: the caller's arrays (1).
        unsafe {
            put_pair(contact.to_drake(), [p_wca, p_wcb, nhat_ba_w, depth], ["p_wca", "p_wcb", "nhat_ba_w", "depth"])
        }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (on_a, on_b, normal_on_b) =
            unsafe { (vector(on_a, "on_a")?, vector(on_b, "on_b")?, vector(normal_on_b, "normal_on_b")?) };
        let contact = Contact::from_bullet(on_a, on_b, normal_on_b, distance);
        // SAFETY: the caller's arrays (1).
        unsafe { put_contact(contact, point, normal, separation) }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let contact = unsafe { contact(point, normal, separation)? };
        // SAFETY: the caller's arrays (1).
        unsafe {
            put_pair(
                contact.to_bullet(),
                [on_a, on_b, normal_on_b, distance],
                ["on_a", "on_b", "normal_on_b", "distance"],
            )
        }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (position, from_second) = unsafe { (vector(position, "position")?, vector(from_second, "from_second")?) };
        let contact = Contact::from_physx(position, from_second, gap);
        // SAFETY: the caller's arrays (1).
        unsafe { put_contact(contact, point, normal, separation) }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let contact = unsafe { contact(point, normal, separation)? };
        // SAFETY: the caller's arrays (1).
        unsafe { put_single(contact.to_physx(), [position, from_second, gap], ["position", "from_second", "gap"]) }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (pos, into_first) = unsafe { (vector(pos, "pos")?, vector(into_first, "into_first")?) };
        let contact = Contact::from_ode(pos, into_first, depth);
        // SAFETY: the caller's arrays (1).
        unsafe { put_contact(contact, point, normal, separation) }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let contact = unsafe { contact(point, normal, separation)? };
        // SAFETY: the caller's arrays (1).
        unsafe { put_single(contact.to_ode(), [pos, into_first, depth], ["pos", "into_first", "depth"]) }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (pos, to_second) = unsafe { (vector(pos, "pos")?, vector(to_second, "to_second")?) };
        let contact = Contact::from_coal(pos, to_second, penetration_depth);
        // SAFETY: the caller's arrays (1).
        unsafe { put_contact(contact, point, normal, separation) }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let contact = unsafe { contact(point, normal, separation)? };
        // SAFETY: the caller's arrays (1).
        unsafe {
            put_single(
                contact.to_coal(),
                [pos, to_second, penetration_depth],
                ["pos", "to_second", "penetration_depth"],
            )
        }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (point1, point2, normal1) =
            unsafe { (vector(point1, "point1")?, vector(point2, "point2")?, vector(normal1, "normal1")?) };
        let contact = Contact::from_rapier(point1, point2, normal1, dist);
        // SAFETY: the caller's arrays (1).
        unsafe { put_contact(contact, point, normal, separation) }
    })
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
    free(|| {
        // SAFETY: the caller's arrays (1).
        let contact = unsafe { contact(point, normal, separation)? };
        let (first, second, out, _, distance) = contact.to_rapier();
        // SAFETY: the caller's arrays (1).
        unsafe {
            put_pair(
                (first, second, out, distance),
                [point1, point2, normal1, dist],
                ["point1", "point2", "normal1", "dist"],
            )
        }
    })
}
