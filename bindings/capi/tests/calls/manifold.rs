//! Manifolds: the points and ids of Rust's; what is wrong with a call is named and changes nothing.

use crate::support::{Open, done, out, records, refused, refused_at};
use contactd_capi::abi::{Pose, Reply};
use contactd_capi::error::{ERROR_ARGUMENT, ERROR_NULL};
use contactd_capi::manifold::*;
use contactd_capi::scene::{contactd_rule_new, contactd_set_rules};
use contactd_client::Object;
use contactd_client::manifold::Manifolds as Rust;
use contactd_proto::{ErrorCode, PoseRecord, Report, Rule};
use glam::{DQuat, DVec3};
use std::ptr::{null, null_mut};
use std::time::Duration;

const FLOOR: &str = "cube(size = [40, 40, 4], center = true);";
const CUBE: &str = "cube(size = [4, 4, 4], center = true);";

/// Where the cube is put at step `k`: it slides and turns on the floor, hovers, is gone for a step.
fn put(k: u32) -> ([f64; 3], [f64; 4]) {
    let s = f64::from(k);
    let gap = if k % 10 == 7 { 3.0 } else { 1e-3 * f64::from(k % 3) };
    ([0.05 * s, -0.02 * s, 4.0 + gap], DQuat::from_rotation_z(0.01 * s).to_array())
}

fn start(object: u32, (position, rotation): ([f64; 3], [f64; 4])) -> PoseRecord {
    PoseRecord { object, flags: contactd_proto::pose_record::START, position, rotation }
}

fn poses_of(reply: &Reply, cube: ([f64; 3], [f64; 4])) -> Vec<Pose> {
    let (position, rotation) = cube;
    records(reply).iter().flat_map(|_| [Pose::IDENTITY, Pose { position, rotation }]).collect()
}

#[test]
fn points_and_ids_are_those_of_rust() {
    let session = Open::embedded();
    let (floor, cube) = (session.model("floor", c"cube(size = [40, 40, 4], center = true);"), CUBE);
    let cube = session.model("cube", &std::ffi::CString::new(cube).unwrap());
    session.object(c"floor", floor, |o| o.is_static = 1);
    session.object(c"cube", cube, |o| o.pose.position = [0.0, 0.0, 4.0]);
    let mut rule = contactd_rule_new(c"default".as_ptr(), c"default".as_ptr());
    (rule.effects.report, rule.effects.margin) = (Report::Patch as u32, 0.1);
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    let mut manifolds = out(|m| unsafe { contactd_manifolds_new(m) });

    let mut rust = contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
    let (floor, cube) = (rust.load_model("floor", FLOOR).unwrap(), rust.load_model("cube", CUBE).unwrap());
    rust.add_object(Object::new("floor", floor.id).fixed()).unwrap();
    rust.add_object(Object::new("cube", cube.id).at(contactd_proto::Pose::at(DVec3::Z * 4.0))).unwrap();
    rust.set_rules(&[Rule { report: Report::Patch, margin: 0.1, ..Rule::new(["default".into(), "default".into()]) }])
        .unwrap();
    let mut expected = Rust::default();

    let mut seen = std::collections::BTreeSet::new();
    for k in 0..40 {
        let reply = session.step(&[start(2, put(k))]);
        let poses = poses_of(&reply, put(k));
        done(unsafe { contactd_manifolds_update(manifolds, &reply, poses.as_ptr(), poses.len()) });
        rust.begin_step(1).unwrap()[0] = start(2, put(k));
        let answer = rust.finish(Duration::from_secs(60)).unwrap();
        let (position, rotation) = put(k);
        let cube = contactd_proto::Pose::new(DVec3::from_array(position), DQuat::from_array(rotation));
        expected.update(&answer, |object, _| if object == 2 { cube } else { contactd_proto::Pose::IDENTITY });

        assert_eq!(out(|n| unsafe { contactd_manifolds_count(manifolds, n) }), expected.pairs().len());
        for (i, pair) in expected.pairs().enumerate() {
            let found = out(|m| unsafe { contactd_manifolds_get(manifolds, i, m) });
            assert_eq!(found, out(|m| unsafe { contactd_manifolds_find(manifolds, pair.a, pair.b, m) }));
            assert_eq!((found.a, found.b, found.status), (pair.a, pair.b, pair.status.into()));
            assert_eq!((found.is_complete, found.point_count), (1, 4));
            let points = unsafe { std::slice::from_raw_parts(found.points, found.point_count) };
            assert_eq!(points, pair.points.iter().map(ManifoldPoint::from).collect::<Vec<_>>());
            seen.extend(points.iter().map(|p| (k / 10, p.id)));
            let corner = |p: &ManifoldPoint| p.on_b.map(f64::abs);
            assert!(points.iter().all(|p| corner(p).iter().all(|x| (x - 2.0).abs() < 1e-3)), "{points:?}");
        }
        if k % 10 == 7 {
            let none = out(|m| unsafe { contactd_manifolds_find(manifolds, 1, 2, m) });
            assert!(none.points.is_null() && none.point_count == 0);
        }
    }
    // The corners keep their names while the cube slides and turns; after a step away they have them anew.
    assert_eq!(seen.len(), 16, "{seen:?}");
    assert!(seen.iter().all(|(_, id)| *id < 4), "{seen:?}");
    done(unsafe { contactd_manifolds_free(&mut manifolds) });
    assert!(manifolds.is_null());
    done(unsafe { contactd_manifolds_free(&mut manifolds) });
}

#[test]
fn misuse_of_manifolds_is_named_and_changes_nothing() {
    let session = Open::embedded();
    let (_, ball) = session.scene();
    let mut rule = contactd_rule_new(c"default".as_ptr(), c"default".as_ptr());
    rule.effects.report = Report::Patch as u32;
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    let mut manifolds = out(|m| unsafe { contactd_manifolds_new(m) });
    let at = ([1.0, 0.0, 3.0], [0.0, 0.0, 0.0, 1.0]);
    let reply = session.step(&[crate::support::end(ball, at.0)]);
    let mut poses = poses_of(&reply, at);
    assert_eq!(poses.len(), 2);
    let update = |reply: *const Reply, poses: &[Pose], n| unsafe {
        contactd_manifolds_update(manifolds, reply, poses.as_ptr(), n)
    };
    done(update(&reply, &poses, 2));
    let count = || out(|n| unsafe { contactd_manifolds_count(manifolds, n) });
    assert_eq!(count(), 1);
    refused(update(&reply, &poses, 1), ERROR_ARGUMENT, "expected 2 poses, two for each of 1 records, found 1");
    refused(update(null(), &poses, 2), ERROR_NULL, "reply is NULL");
    poses[1].rotation = [0.0; 4];
    refused_at(update(&reply, &poses, 2), ErrorCode::BadQuaternion.number() as i32, 1, "index 1");
    assert_eq!(count(), 1);
    let mut found = out(|m| unsafe { contactd_manifolds_get(manifolds, 0, m) });
    refused(unsafe { contactd_manifolds_get(manifolds, 1, &mut found) }, ERROR_ARGUMENT, "pair 1: there are 1");
    refused(unsafe { contactd_manifolds_get(null_mut(), 0, &mut found) }, ERROR_NULL, "the manifolds");
    refused(unsafe { contactd_manifolds_find(manifolds, 1, 2, null_mut()) }, ERROR_NULL, "out is NULL");
    refused(unsafe { contactd_manifolds_count(manifolds, null_mut()) }, ERROR_NULL, "count is NULL");
    refused(unsafe { contactd_manifolds_new(null_mut()) }, ERROR_NULL, "manifolds is NULL");
    refused(unsafe { contactd_manifolds_free(null_mut()) }, ERROR_NULL, "manifolds is NULL");
    done(unsafe { contactd_manifolds_free(&mut manifolds) });
}
