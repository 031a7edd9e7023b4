//! Converters: what Rust's give, by hand and there and back; nothing is written when something is wrong.

use crate::support::{done, refused};
use contactd_capi::convention::contact::*;
use contactd_capi::convention::pose::*;
use contactd_capi::error::{ERROR_ARGUMENT, ERROR_NULL};
use contactd_client::convention as rust;
use contactd_proto::Pose;
use glam::{DQuat, DVec3};
use std::f64::consts::FRAC_1_SQRT_2 as HALF;
use std::ptr::{null, null_mut};

fn poses() -> impl Iterator<Item = Pose> {
    (0..100).map(|k| {
        let s = f64::from(k);
        let q = DQuat::from_euler(glam::EulerRot::XYZ, 0.7 * s, 1.3 * s, 2.9 * s);
        Pose::new(DVec3::new(s, -0.5 * s, 1.0 / (1.0 + s)), q)
    })
}

/// A pose that a function writes as position and rotation.
fn pose_of(call: impl FnOnce(*mut f64, *mut f64) -> i32) -> Pose {
    let (mut p, mut q) = ([f64::NAN; 3], [f64::NAN; 4]);
    done(call(p.as_mut_ptr(), q.as_mut_ptr()));
    Pose::new(DVec3::from_array(p), DQuat::from_array(q))
}

/// A contact that a function writes as point, normal, separation.
fn contact_of(call: impl FnOnce(*mut f64, *mut f64, *mut f64) -> i32) -> rust::Contact {
    let (mut p, mut n, mut s) = ([f64::NAN; 3], [f64::NAN; 3], f64::NAN);
    done(call(p.as_mut_ptr(), n.as_mut_ptr(), &mut s));
    rust::Contact { point: DVec3::from_array(p), normal: DVec3::from_array(n), separation: s }
}

/// `N` numbers that a function writes.
fn out<const N: usize>(call: impl FnOnce(*mut f64) -> i32) -> [f64; N] {
    let mut found = [f64::NAN; N];
    done(call(found.as_mut_ptr()));
    found
}

#[test]
fn poses_by_hand() {
    // A quarter turn about z, at 1 2 3.
    let (p, q) = ([1.0, 2.0, 3.0], [0.0, 0.0, HALF, HALF]);
    assert_eq!(out(|w| unsafe { contactd_quaternion_to_wxyz(q.as_ptr(), w) }), [HALF, 0.0, 0.0, HALF]);
    assert_eq!(
        out(|q| unsafe { contactd_quaternion_from_wxyz([1.0, 2.0, 3.0, 4.0].as_ptr(), q) }),
        [2.0, 3.0, 4.0, 1.0]
    );
    assert_eq!(out(|s| unsafe { contactd_to_drake(p.as_ptr(), q.as_ptr(), s) }), [HALF, 0.0, 0.0, HALF, 1.0, 2.0, 3.0]);
    let near = |found: &[f64], expected: &[f64]| {
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-15), "{found:?}");
    };
    let rows = [0.0, -1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0];
    near(&out::<12>(|m| unsafe { contactd_to_mat3x4(p.as_ptr(), q.as_ptr(), m) }), &rows);
    let homogeneous: Vec<f64> = rows.into_iter().chain([0.0, 0.0, 0.0, 1.0]).collect();
    near(&out::<16>(|m| unsafe { contactd_to_mat4(p.as_ptr(), q.as_ptr(), m) }), &homogeneous);
    let columns = [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 2.0, 3.0, 1.0];
    near(&out::<16>(|m| unsafe { contactd_to_opengl(p.as_ptr(), q.as_ptr(), m) }), &columns);
}

#[test]
fn poses_are_those_of_rust_there_and_back() {
    for pose in poses() {
        let (p, q) = (pose.position.to_array(), pose.rotation.to_array());
        let (p, q) = (p.as_ptr(), q.as_ptr());
        let (mut xpos, mut xquat) = ([0.0; 3], [0.0; 4]);
        done(unsafe { contactd_to_mujoco(p, q, xpos.as_mut_ptr(), xquat.as_mut_ptr()) });
        assert_eq!((xpos, xquat), rust::to_mujoco(&pose));
        assert_eq!(pose_of(|p, q| unsafe { contactd_from_mujoco(xpos.as_ptr(), xquat.as_ptr(), p, q) }), pose);
        let state: [f64; 7] = out(|s| unsafe { contactd_to_drake(p, q, s) });
        assert_eq!(state, rust::to_drake(&pose));
        assert_eq!(pose_of(|p, q| unsafe { contactd_from_drake(state.as_ptr(), p, q) }), pose);
        let m: [f64; 12] = out(|m| unsafe { contactd_to_mat3x4(p, q, m) });
        assert_eq!(m.as_chunks::<4>().0, rust::to_mat3x4(&pose));
        let back = rust::from_mat3x4(rust::to_mat3x4(&pose)).unwrap();
        assert_eq!(pose_of(|p, q| unsafe { contactd_from_mat3x4(m.as_ptr(), p, q) }), back);
        let m: [f64; 16] = out(|m| unsafe { contactd_to_mat4(p, q, m) });
        assert_eq!(m.as_chunks::<4>().0, rust::to_mat4(&pose));
        assert_eq!(pose_of(|p, q| unsafe { contactd_from_mat4(m.as_ptr(), p, q) }), back);
        let m: [f64; 16] = out(|m| unsafe { contactd_to_opengl(p, q, m) });
        assert_eq!(m, rust::to_opengl(&pose));
        assert_eq!(pose_of(|p, q| unsafe { contactd_from_opengl(m.as_ptr(), p, q) }), back);
    }
}

/// Points of both surfaces, the normal and the number that a function writes.
fn pair_of(call: impl FnOnce(*mut f64, *mut f64, *mut f64, *mut f64) -> i32) -> ([f64; 3], [f64; 3], [f64; 3], f64) {
    let (mut a, mut b, mut n, mut s) = ([f64::NAN; 3], [f64::NAN; 3], [f64::NAN; 3], f64::NAN);
    done(call(a.as_mut_ptr(), b.as_mut_ptr(), n.as_mut_ptr(), &mut s));
    (a, b, n, s)
}

#[test]
fn contacts_are_those_of_rust_there_and_back() {
    for (k, pose) in poses().enumerate() {
        let normal = pose.rotation * DVec3::Z;
        let c = rust::Contact { point: pose.position, normal, separation: 0.1 - 0.01 * k as f64 };
        let (p, n, s) = (c.point.to_array(), c.normal.to_array(), c.separation);
        let (p, n) = (p.as_ptr(), n.as_ptr());
        let same = |found: rust::Contact| {
            assert_eq!((found.normal, found.separation), (c.normal, c.separation));
            assert!((found.point - c.point).length() < 1e-12, "{found:?} {c:?}");
        };
        let triple = |(p, n, s): (DVec3, DVec3, f64)| (p, n, s);
        let pair = |(a, b, n, s): (DVec3, DVec3, DVec3, f64)| (a.to_array(), b.to_array(), n.to_array(), s);

        let (mut pos, mut frame, mut dist) = ([0.0; 3], [0.0; 9], 0.0);
        done(unsafe { contactd_contact_to_mujoco(p, n, s, pos.as_mut_ptr(), frame.as_mut_ptr(), &mut dist) });
        assert_eq!((DVec3::from_array(pos), frame, dist), c.to_mujoco());
        same(contact_of(|p, n, s| unsafe {
            contactd_contact_from_mujoco(pos.as_ptr(), frame.as_ptr(), dist, p, n, s)
        }));

        let (a, b, m, d) = pair_of(|a, b, m, d| unsafe { contactd_contact_to_drake(p, n, s, a, b, m, d) });
        assert_eq!((a, b, m, d), pair(c.to_drake()));
        same(contact_of(|p, n, s| unsafe {
            contactd_contact_from_drake(a.as_ptr(), b.as_ptr(), m.as_ptr(), d, p, n, s)
        }));
        let (a, b, m, d) = pair_of(|a, b, m, d| unsafe { contactd_contact_to_bullet(p, n, s, a, b, m, d) });
        assert_eq!((a, b, m, d), pair(c.to_bullet()));
        same(contact_of(|p, n, s| unsafe {
            contactd_contact_from_bullet(a.as_ptr(), b.as_ptr(), m.as_ptr(), d, p, n, s)
        }));
        let (a, b, m, d) = pair_of(|a, b, m, d| unsafe { contactd_contact_to_rapier(p, n, s, a, b, m, d) });
        let (point1, point2, normal1, _, distance) = c.to_rapier();
        assert_eq!((a, b, m, d), pair((point1, point2, normal1, distance)));
        same(contact_of(|p, n, s| unsafe {
            contactd_contact_from_rapier(a.as_ptr(), b.as_ptr(), m.as_ptr(), d, p, n, s)
        }));

        let found = contact_of(|a, m, d| unsafe { contactd_contact_to_physx(p, n, s, a, m, d) });
        assert_eq!((found.point, found.normal, found.separation), triple(c.to_physx()));
        let (a, m, d) = (found.point.to_array(), found.normal.to_array(), found.separation);
        same(contact_of(|p, n, s| unsafe { contactd_contact_from_physx(a.as_ptr(), m.as_ptr(), d, p, n, s) }));
        let found = contact_of(|a, m, d| unsafe { contactd_contact_to_ode(p, n, s, a, m, d) });
        assert_eq!((found.point, found.normal, found.separation), triple(c.to_ode()));
        let (a, m, d) = (found.point.to_array(), found.normal.to_array(), found.separation);
        same(contact_of(|p, n, s| unsafe { contactd_contact_from_ode(a.as_ptr(), m.as_ptr(), d, p, n, s) }));
        let found = contact_of(|a, m, d| unsafe { contactd_contact_to_coal(p, n, s, a, m, d) });
        assert_eq!((found.point, found.normal, found.separation), triple(c.to_coal()));
        let (a, m, d) = (found.point.to_array(), found.normal.to_array(), found.separation);
        same(contact_of(|p, n, s| unsafe { contactd_contact_from_coal(a.as_ptr(), m.as_ptr(), d, p, n, s) }));
    }
}

#[test]
fn arrays_are_converted_in_place() {
    let mut q = [1.0, 2.0, 3.0, 4.0];
    // One pointer to read from and to write to, as C has it.
    let at = q.as_mut_ptr();
    done(unsafe { contactd_quaternion_from_wxyz(at, at) });
    assert_eq!(q, [2.0, 3.0, 4.0, 1.0]);
    let at = q.as_mut_ptr();
    done(unsafe { contactd_quaternion_to_wxyz(at, at) });
    assert_eq!(q, [1.0, 2.0, 3.0, 4.0]);
    let (mut p, mut n, mut s) = ([1.0, 2.0, 3.0], [0.0, 0.6, 0.8], -0.5);
    let (at, along) = (p.as_mut_ptr(), n.as_mut_ptr());
    done(unsafe { contactd_contact_to_ode(at, along, s, at, along, &mut s) });
    assert_eq!((p, n, s), ([1.0, 2.0, 3.0], [0.0, -0.6, -0.8], 0.5));
}

#[test]
fn what_is_wrong_is_named_and_nothing_is_written() {
    let mut m = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let (mut p, mut q) = ([7.0; 3], [7.0; 4]);
    done(unsafe { contactd_from_mat4(m.as_ptr(), p.as_mut_ptr(), q.as_mut_ptr()) });
    assert_eq!((p, q), ([0.0; 3], [0.0, 0.0, 0.0, 1.0]));
    (p, q) = ([7.0; 3], [7.0; 4]);
    for (at, value) in [(0, 1.001), (10, -1.0), (3, f64::NAN)] {
        let before = std::mem::replace(&mut m[at], value);
        for convert in [contactd_from_mat3x4, contactd_from_mat4] {
            let code = unsafe { convert(m.as_ptr(), p.as_mut_ptr(), q.as_mut_ptr()) };
            refused(code, ERROR_ARGUMENT, "a rigid placement");
        }
        m[at] = before;
    }
    m[15] = 2.0;
    refused(unsafe { contactd_from_mat4(m.as_ptr(), p.as_mut_ptr(), q.as_mut_ptr()) }, ERROR_ARGUMENT, "0 0 0 1");
    let code = unsafe { contactd_from_opengl(m.as_ptr(), p.as_mut_ptr(), q.as_mut_ptr()) };
    refused(code, ERROR_ARGUMENT, "0 0 0 1");
    m[15] = 1.0;
    refused(unsafe { contactd_from_mat4(null(), p.as_mut_ptr(), q.as_mut_ptr()) }, ERROR_NULL, "matrix is NULL");
    refused(unsafe { contactd_from_mat4(m.as_ptr(), p.as_mut_ptr(), null_mut()) }, ERROR_NULL, "rotation is NULL");
    let odd = m.as_ptr().cast::<u8>().wrapping_add(4).cast::<f64>();
    refused(unsafe { contactd_from_mat4(odd, p.as_mut_ptr(), q.as_mut_ptr()) }, ERROR_ARGUMENT, "not aligned");
    let (n, mut d) = ([0.0, 0.0, 1.0], 7.0);
    let code = unsafe {
        contactd_contact_to_bullet(n.as_ptr(), n.as_ptr(), 0.0, p.as_mut_ptr(), null_mut(), q.as_mut_ptr(), &mut d)
    };
    refused(code, ERROR_NULL, "on_b is NULL");
    let code = unsafe { contactd_contact_to_coal(n.as_ptr(), null(), 0.0, p.as_mut_ptr(), q.as_mut_ptr(), &mut d) };
    refused(code, ERROR_NULL, "normal is NULL");
    assert_eq!((p, q, d), ([7.0; 3], [7.0; 4], 7.0));
}
