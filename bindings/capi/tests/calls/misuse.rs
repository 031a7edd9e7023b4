//! What is answered to calls that should not have been made, and when things fail: code, sentence, index.

use crate::stub::{Script, scripted};
use crate::support::*;
use contactd_capi::Session;
use contactd_capi::abi::{Mass, Options, Pose, RayQuery};
use contactd_capi::error::*;
use contactd_capi::model::*;
use contactd_capi::query::*;
use contactd_capi::scene::*;
use contactd_capi::session::*;
use contactd_capi::step::*;
use contactd_client::Error;
use contactd_proto::query::{ObjectRay, PointRecord, RayRecord};
use contactd_proto::step::NO_INDEX;
use contactd_proto::{ErrorCode, PoseRecord};
use std::ptr::{null, null_mut};

fn number(code: ErrorCode) -> i32 {
    code.number() as i32
}

#[test]
fn every_function_refuses_a_session_that_is_null_or_closed() {
    let closed: *mut Session = {
        let mut session = Open::embedded();
        done(unsafe { contactd_close(&mut session.0) });
        session.0
    };
    assert!(closed.is_null());
    let s = closed;
    let object = contactd_object_new(c"a".as_ptr(), 1);
    let codes = unsafe {
        [
            contactd_get_opened(s, null_mut()),
            contactd_set_command_timeout(s, 1.0),
            contactd_reconnect(s, 1.0),
            contactd_load_model(s, null(), null(), 0, null_mut()),
            contactd_load_model_file(s, null(), null(), null(), 0, 0, null_mut()),
            contactd_count_faces(s, 1, null_mut(), null_mut()),
            contactd_get_face(s, 1, 0, null_mut()),
            contactd_get_warning(s, 1, 0, null_mut()),
            contactd_mass_properties(s, 1, 0.0, 0, null_mut()),
            contactd_get_distance(s, 1, 2, 0.0, null_mut()),
            contactd_get_points(s, null(), 0, null(), null_mut()),
            contactd_cast_rays(s, null(), 0, null(), null_mut()),
            contactd_add_object(s, &object, null_mut()),
            contactd_remove_object(s, 1),
            contactd_set_rules(s, null(), 0),
            contactd_set_resolution(s, 0.0),
            contactd_get_options(s, null_mut()),
            contactd_set_options(s, null()),
            contactd_set_advance(s, 1.0),
            contactd_begin_step(s, 1, null_mut()),
            contactd_send(s),
            contactd_finish(s, 1.0, null_mut()),
            contactd_resend(s, null_mut(), null_mut()),
            contactd_get_detail(s, 0, null_mut()),
            contactd_count_regions(s, 0, null_mut()),
            contactd_get_region(s, 0, 0, null_mut(), null_mut(), null_mut()),
        ]
    };
    assert_eq!(codes, [ERROR_NULL; 26]);
    refused_at(unsafe { contactd_send(s) }, ERROR_NULL, NO_INDEX, "the session (closed, or never opened) is NULL");
    refused(unsafe { contactd_close(null_mut()) }, ERROR_NULL, "session is NULL");
}

#[test]
fn every_pointer_that_is_null_is_named_and_nothing_is_done() {
    let session = Open::embedded();
    let s = session.0;
    let (_, ball) = session.scene();
    let (name, csg) = (c"x".as_ptr(), BALL.as_ptr());
    let object = contactd_object_new(name, 1);
    let (mut id, mut count, mut size) = (0u32, 0u32, 0usize);
    let (mut region, mut patches) = (null(), null());
    let mut mass = out(|m| unsafe { contactd_mass_properties(s, 1, 0.0, 0, m) });
    unsafe {
        refused(contactd_connect(null(), null_mut()), ERROR_NULL, "session is NULL");
        refused(contactd_embedded(null(), null_mut()), ERROR_NULL, "session is NULL");
        refused(contactd_get_opened(s, null_mut()), ERROR_NULL, "opened is NULL");
        refused(contactd_load_model(s, null(), csg, 0, &mut id), ERROR_NULL, "name is NULL");
        refused(contactd_load_model(s, name, null(), 0, &mut id), ERROR_NULL, "csg is NULL");
        refused(contactd_load_model(s, name, csg, 0, null_mut()), ERROR_NULL, "model is NULL");
        let file = b"sphere(r = 5);";
        let of = |bytes, n, id| contactd_load_model_file(s, name, null(), bytes, n, 0, id);
        refused(contactd_load_model_file(s, null(), null(), file.as_ptr(), 14, 0, &mut id), ERROR_NULL, "name is NULL");
        refused(of(null(), 14, &mut id), ERROR_NULL, "bytes is NULL");
        refused(of(file.as_ptr(), 14, null_mut()), ERROR_NULL, "model is NULL");
        refused(contactd_count_faces(s, 1, null_mut(), &mut count), ERROR_NULL, "faces is NULL");
        refused(contactd_count_faces(s, 1, &mut count, null_mut()), ERROR_NULL, "warnings is NULL");
        refused(contactd_get_face(s, 1, 0, null_mut()), ERROR_NULL, "out is NULL");
        refused(contactd_get_warning(s, 1, 0, null_mut()), ERROR_NULL, "out is NULL");
        refused(contactd_mass_properties(s, 1, 0.0, 0, null_mut()), ERROR_NULL, "mass is NULL");
        let (points, rays) = ([[0.0; 3]], [ObjectRay { origin: [0.0; 3], direction: [1.0; 3], length: 1.0 }]);
        let (of_points, of_rays) = (contactd_point_query_new(), contactd_ray_query_new());
        let (mut point, mut ray) = (PointRecord::default(), RayRecord::default());
        refused(contactd_get_distance(s, 1, 2, 0.0, null_mut()), ERROR_NULL, "distance is NULL");
        refused(contactd_get_points(s, null(), 1, &of_points, &mut point), ERROR_NULL, "points is NULL");
        refused(contactd_get_points(s, points.as_ptr(), 1, null(), &mut point), ERROR_NULL, "query is NULL");
        refused(contactd_get_points(s, points.as_ptr(), 1, &of_points, null_mut()), ERROR_NULL, "answers is NULL");
        refused(contactd_cast_rays(s, null(), 1, &of_rays, &mut ray), ERROR_NULL, "rays is NULL");
        refused(contactd_cast_rays(s, rays.as_ptr(), 1, null(), &mut ray), ERROR_NULL, "query is NULL");
        refused(contactd_cast_rays(s, rays.as_ptr(), 1, &of_rays, null_mut()), ERROR_NULL, "answers is NULL");
        let some = RayQuery { object_count: 1, ..of_rays };
        refused(contactd_cast_rays(s, rays.as_ptr(), 1, &some, &mut ray), ERROR_NULL, "objects is NULL");
        refused(contactd_mass_placed(null(), &Pose::IDENTITY, &mut mass), ERROR_NULL, "mass is NULL");
        refused(contactd_mass_placed(&mass, null(), null_mut()), ERROR_NULL, "pose is NULL");
        refused(contactd_mass_placed(&mass, &Pose::IDENTITY, null_mut()), ERROR_NULL, "out is NULL");
        refused(contactd_mass_with_density(null(), 1.0, &mut mass), ERROR_NULL, "mass is NULL");
        refused(contactd_mass_with_density(&mass, 1.0, null_mut()), ERROR_NULL, "out is NULL");
        refused(contactd_add_object(s, null(), &mut id), ERROR_NULL, "object is NULL");
        refused(contactd_add_object(s, &object, null_mut()), ERROR_NULL, "id is NULL");
        refused(contactd_set_rules(s, null(), 1), ERROR_NULL, "rules is NULL");
        refused(contactd_get_options(s, null_mut()), ERROR_NULL, "options is NULL");
        refused(contactd_set_options(s, null()), ERROR_NULL, "options is NULL");
        refused(contactd_begin_step(s, 1, null_mut()), ERROR_NULL, "poses is NULL");
        refused(contactd_resend(s, null_mut(), &mut size), ERROR_NULL, "poses is NULL");
        session.begin(1)[0] = end(ball, [1.0, 0.0, 0.0]);
        refused(contactd_finish(s, 60.0, null_mut()), ERROR_NULL, "reply is NULL");
        // The step that was begun is still there.
        assert_eq!(session.finish().record_count, 1);
        refused(contactd_get_detail(s, 0, null_mut()), ERROR_NULL, "slot is NULL");
        refused(contactd_count_regions(s, 0, null_mut()), ERROR_NULL, "count is NULL");
        refused(contactd_get_region(s, 0, 0, null_mut(), &mut patches, &mut size), ERROR_NULL, "slot is NULL");
        refused(contactd_get_region(s, 0, 0, &mut region, null_mut(), &mut size), ERROR_NULL, "patches is NULL");
        refused(contactd_get_region(s, 0, 0, &mut region, &mut patches, null_mut()), ERROR_NULL, "patch_count is NULL");
    }
    let mut object = contactd_object_new(null(), 1);
    refused(unsafe { contactd_add_object(s, &object, &mut id) }, ERROR_NULL, "object.name is NULL");
    (object.name, object.group) = (name, null());
    refused(unsafe { contactd_add_object(s, &object, &mut id) }, ERROR_NULL, "object.group is NULL");
    assert_eq!(session.object(c"third", 1, |o| o.pose.position[0] = 900.0), 3, "no id was used up");
}

#[test]
fn arguments_out_of_their_range_are_named() {
    let session = Open::embedded();
    let s = session.0;
    let (_, ball) = session.scene();
    let (mut id, mut count, mut text) = (0, 0, null());
    let name = c"x".as_ptr();
    let mut opened = null_mut();
    unsafe {
        refused(contactd_connect(c"A".as_ptr(), &mut opened), ERROR_ADDRESS, "\"A\" is not a server name");
        refused(contactd_connect(c"\xff".as_ptr(), &mut opened), ERROR_ARGUMENT, "name is not UTF-8");
        refused(contactd_embedded(c"/no/such.toml".as_ptr(), &mut opened), ERROR_CONFIG, "/no/such.toml: expected");
        assert!(opened.is_null());
        refused(contactd_set_command_timeout(s, f64::NAN), ERROR_ARGUMENT, "found NaN");
        refused(contactd_load_model(s, name, BALL.as_ptr(), 3, &mut id), ERROR_ARGUMENT, "facets of 0 to 2, found 3");
        let bad = c"sphere(r = 5);\n  torus(r = 2);";
        refused(contactd_load_model(s, name, bad.as_ptr(), 0, &mut id), number(ErrorCode::Model), "x:2:3");
        let step = c"step".as_ptr();
        let of =
            |format, bytes: &[u8], id| contactd_load_model_file(s, name, format, bytes.as_ptr(), bytes.len(), 0, id);
        let sentence = "expected one of the formats csg, stl, ";
        refused(of(step, b"sphere(r = 5);", &mut id), number(ErrorCode::Model), sentence);
        refused(
            of(null(), b"cube(1);\xff", &mut id),
            number(ErrorCode::Model),
            "expected text in UTF-8, found the byte 0xff",
        );
        refused(contactd_count_faces(s, 77, &mut count, &mut id), number(ErrorCode::UnknownModel), "no model");
        refused(contactd_get_warning(s, 1, 0, &mut text), ERROR_ARGUMENT, "warning 0: there are 0");
        let mut face = std::mem::MaybeUninit::uninit();
        refused(contactd_get_face(s, 1, 9, face.as_mut_ptr()), ERROR_ARGUMENT, "face 9: there are 9");
        let mut mass = out(|m| contactd_mass_properties(s, 1, 0.0, 0, m));
        let m: *mut Mass = &mut mass;
        refused(contactd_mass_properties(s, 77, 0.0, 0, m), number(ErrorCode::UnknownModel), "no model");
        refused(contactd_mass_properties(s, 1, 2.0, 0, m), number(ErrorCode::BadNumber), "tolerance");
        let bent = Pose { rotation: [0.0; 4], ..Pose::IDENTITY };
        refused(contactd_mass_placed(m, &bent, m), number(ErrorCode::BadQuaternion), "unit length");
        refused(contactd_mass_with_density(m, 0.0, m), ERROR_ARGUMENT, "positive density, found 0");
        refused(contactd_remove_object(s, 99), number(ErrorCode::UnknownObject), "no object");
        refused(contactd_set_resolution(s, -1.0), number(ErrorCode::Resolution), "resolution");
        refused(contactd_finish(s, -1.0, std::mem::MaybeUninit::uninit().as_mut_ptr()), ERROR_ARGUMENT, "found -1");
    }
    let add = |change: fn(&mut contactd_capi::abi::Object)| {
        let mut object = contactd_object_new(name, 1);
        change(&mut object);
        unsafe { contactd_add_object(s, &object, &mut 0) }
    };
    refused(add(|o| o.model = 77), number(ErrorCode::UnknownModel), "no model");
    refused(add(|o| o.pose.position[1] = f64::NAN), number(ErrorCode::NotFinite), "not a finite number");
    refused(add(|o| o.pose.rotation = [0.0, 0.0, 0.0, 1.1]), number(ErrorCode::BadQuaternion), "unit length");
    refused(add(|o| o.place.rotation = [1.0; 4]), number(ErrorCode::BadQuaternion), "unit length");
    refused(add(|o| o.is_static = 2), ERROR_ARGUMENT, "object.is_static of 0 to 1, found 2");
    refused(add(|o| o.rotates = 7), ERROR_ARGUMENT, "object.rotates of 0 to 1, found 7");
    refused(add(|o| o.reserved = 1), ERROR_ARGUMENT, "object.reserved of 0 to 0, found 1");
    let set = |change: fn(&mut contactd_proto::rule::RuleNumbers)| {
        let mut rule = contactd_rule_new(name, name);
        change(&mut rule.effects);
        unsafe { contactd_set_rules(s, &rule, 1) }
    };
    refused(set(|r| r.sensor = 2), ERROR_ARGUMENT, "rule.sensor of 0 to 1, found 2");
    refused(set(|r| r.detect = 3), ERROR_ARGUMENT, "rule.detect of 0 to 2, found 3");

    let mut options = out(|o| unsafe { contactd_get_options(s, o) });
    options.polling = 2;
    refused(unsafe { contactd_set_options(s, &options) }, ERROR_ARGUMENT, "options.polling of 0 to 1, found 2");
    let options = Options { polling: 0, reserved: 1, ..options };
    refused(unsafe { contactd_set_options(s, &options) }, ERROR_ARGUMENT, "options.reserved of 0 to 0, found 1");
    refused(unsafe { contactd_set_advance(s, 1.5) }, ERROR_ARGUMENT, "advance of 0 to 1, found 1.5");
    refused(unsafe { contactd_set_advance(s, f64::NAN) }, ERROR_ARGUMENT, "advance of 0 to 1, found NaN");
    let options = Options { reserved: 0, advance: -1.0, ..options };
    refused(unsafe { contactd_set_options(s, &options) }, ERROR_ARGUMENT, "options.advance of 0 to 1, found -1");
    let options = Options { advance: 1.0, dt: f64::INFINITY, ..options };
    refused(unsafe { contactd_set_options(s, &options) }, ERROR_ARGUMENT, "options.dt of 0 seconds or more, found inf");
    // What was set before counts still.
    session.begin(1)[0] = end(ball, [1.0, 0.0, 0.0]);
    done(unsafe { contactd_finish(s, 60.0, std::mem::MaybeUninit::uninit().as_mut_ptr()) });
}

#[test]
fn a_bad_rule_is_named_by_its_index() {
    let session = Open::embedded();
    let good = contactd_rule_new(c"a".as_ptr(), c"b".as_ptr());
    let set = |bad| unsafe { contactd_set_rules(session.0, [good, bad].as_ptr(), 2) };
    let mut bad = good;
    bad.effects.detect = 3;
    refused_at(set(bad), ERROR_ARGUMENT, 1, "index 1: expected rule.detect of 0 to 2, found 3");
    bad = good;
    bad.between.b = null();
    refused_at(set(bad), ERROR_NULL, 1, "rule.between is NULL");
    bad = good;
    bad.except_count = 1;
    refused_at(set(bad), ERROR_NULL, 1, "rule.except is NULL");
    bad = good;
    bad.effects.margin = -1.0;
    refused_at(set(bad), number(ErrorCode::BadRule), 1, "index 1: ");
}

#[test]
fn a_refused_batch_names_its_record_and_changes_nothing() {
    let session = Open::embedded();
    let (plate, ball) = session.scene();
    let finish = |poses: &[PoseRecord]| {
        session.begin(poses.len()).copy_from_slice(poses);
        unsafe { contactd_finish(session.0, 60.0, std::mem::MaybeUninit::uninit().as_mut_ptr()) }
    };
    let good = end(ball, [1.0, 0.0, 30.0]);
    let table = [
        (end(99, [0.0; 3]), ErrorCode::UnknownObject),
        (end(plate, [0.0; 3]), ErrorCode::StaticObject),
        (good, ErrorCode::DuplicateObject),
        (end(ball, [f64::INFINITY; 3]), ErrorCode::NotFinite),
        (PoseRecord { rotation: [0.0; 4], ..good }, ErrorCode::BadQuaternion),
        (PoseRecord { flags: 0, ..good }, ErrorCode::BadCount),
    ];
    for (bad, code) in table {
        refused_at(finish(&[good, bad]), number(code), 1, code.sentence());
    }
    let reply = session.step(&[end(ball, [1.0, 0.0, 0.0])]);
    assert!((records(&reply)[0].time - (18.0 - 21f64.sqrt()) / 20.0).abs() < 1e-9, "it fell from where it was added");
    let mut poses = null_mut();
    let limit = out(|o| unsafe { contactd_get_opened(session.0, o) }).max_batch as usize;
    refused(
        unsafe { contactd_begin_step(session.0, limit + 1, &mut poses) },
        number(ErrorCode::TooMany),
        "the limit is",
    );
}

#[test]
fn calls_out_of_order_are_refused() {
    let session = Open::embedded();
    let s = session.0;
    let (_, ball) = session.scene();
    let mut reply = std::mem::MaybeUninit::uninit();
    let (mut slot, mut poses, mut n) = (null(), null_mut(), 0);
    unsafe {
        refused(contactd_send(s), ERROR_MISUSE, "no step was begun");
        refused(contactd_finish(s, 1.0, reply.as_mut_ptr()), ERROR_MISUSE, "no step was begun");
        refused(contactd_get_detail(s, 0, &mut slot), ERROR_MISUSE, "there is no reply");
        refused(contactd_resend(s, &mut poses, &mut n), ERROR_MISUSE, "no step was in flight");
        refused(contactd_reconnect(s, 1.0), ERROR_MISUSE, "an embedded session has no server");
        session.begin(1)[0] = end(ball, [1.0, 0.0, 0.0]);
        done(contactd_send(s));
        refused(contactd_send(s), ERROR_MISUSE, "no step was begun");
        refused(contactd_begin_step(s, 1, &mut poses), ERROR_MISUSE, "a step is in flight: finish it first");
        refused(contactd_remove_object(s, ball), ERROR_MISUSE, "a step is in flight: finish it first");
        assert_eq!(session.finish().record_count, 1);
        refused(contactd_get_detail(s, 1, &mut slot), ERROR_ARGUMENT, "record 1: there are 1");
        let (mut region, mut patches) = (null(), null());
        let code = contactd_get_region(s, 0, 0, &mut region, &mut patches, &mut n);
        refused(code, ERROR_ARGUMENT, "region 0 of record 0: there are 0");
        // The records of a step are gone with the next one's beginning.
        session.begin(0);
        refused(contactd_get_detail(s, 0, &mut slot), ERROR_MISUSE, "there is no reply");
    }
}

#[test]
fn a_session_belongs_to_its_thread() {
    let session = Open::embedded();
    session.scene();
    let address = session.0 as usize;
    std::thread::spawn(move || {
        let mut handle = address as *mut Session;
        let words = "belongs to the thread that opened it";
        refused(unsafe { contactd_remove_object(handle, 1) }, ERROR_MISUSE, words);
        refused(unsafe { contactd_close(&mut handle) }, ERROR_MISUSE, words);
        assert!(!handle.is_null());
    })
    .join()
    .unwrap();
    // A failure of another thread is not this one's.
    assert_eq!(sentence(), "");
    done(unsafe { contactd_remove_object(session.0, 1) });
}

#[test]
fn what_a_server_does_to_a_step_comes_with_its_code() {
    let script = Script::default();
    let session = scripted(&script);
    let mut reply = std::mem::MaybeUninit::uninit();
    let mut finish = |failure: Error| {
        session.begin(1)[0] = end(1, [0.0; 3]);
        script.borrow_mut().push_back(Box::new(move || Err(failure)));
        unsafe { contactd_finish(session.0, 1.0, reply.as_mut_ptr()) }
    };
    refused(finish(Error::System("no room".into())), ERROR_SYSTEM, "no room");
    refused(finish(Error::Version { min: 2, max: 3 }), number(ErrorCode::Version), "versions 2 to 3");
    refused(finish(Error::NoServer("x".into())), ERROR_NO_SERVER, "contactd serve --name x");
    refused(finish(Error::ReplyLost), ERROR_REPLY_LOST, "could not deliver");
    done(unsafe { contactd_reconnect(session.0, 1.0) });
    refused(finish(Error::Timeout), ERROR_TIMEOUT, "still in flight");
    assert_eq!(session.finish().header.epoch, 7, "the step that was in flight");
    refused(finish(Error::ServerLost), ERROR_SERVER_LOST, "reconnect");
    let mut poses = null_mut();
    refused(unsafe { contactd_begin_step(session.0, 1, &mut poses) }, ERROR_SERVER_LOST, "the server is gone");
    done(unsafe { contactd_reconnect(session.0, 1.0) });
    let mut n = 0;
    done(unsafe { contactd_resend(session.0, &mut poses, &mut n) });
    assert_eq!((n, unsafe { *poses }), (1, end(1, [0.0; 3])));
    assert_eq!(session.finish().header.status, 1);
}

#[test]
fn a_session_is_closed_whatever_is_under_way() {
    type Failures = [Option<Error>; 2];
    let table: [Failures; 4] = [
        [None, None],
        [Some(Error::Timeout), None],
        [Some(Error::Timeout), Some(Error::Timeout)],
        [Some(Error::ServerLost), None],
    ];
    for failures in table {
        let script = Script::default();
        let mut session = scripted(&script);
        session.begin(0);
        done(unsafe { contactd_send(session.0) });
        for failure in failures.into_iter().flatten() {
            script.borrow_mut().push_back(Box::new(move || Err(failure)));
        }
        done(unsafe { contactd_close(&mut session.0) });
        assert!(session.0.is_null());
    }
}

#[test]
fn a_call_from_within_a_call_is_refused() {
    let script = Script::default();
    let session = scripted(&script);
    let handle = session.0;
    script.borrow_mut().push_back(Box::new(move || {
        refused(unsafe { contactd_send(handle) }, ERROR_MISUSE, "a call of this session is under way");
        let mut own = handle;
        refused(unsafe { contactd_close(&mut own) }, ERROR_MISUSE, "a call of this session is under way");
        Ok(())
    }));
    session.step(&[]);
}

#[test]
fn a_panic_stays_inside_and_ends_the_session() {
    let script = Script::default();
    let mut session = scripted(&script);
    script.borrow_mut().push_back(Box::new(|| panic!("of the test's own")));
    session.begin(0);
    let mut reply = std::mem::MaybeUninit::uninit();
    let code = unsafe { contactd_finish(session.0, 1.0, reply.as_mut_ptr()) };
    refused(code, ERROR_PANIC, "contactd failed internally: of the test's own");
    refused(unsafe { contactd_set_advance(session.0, 1.0) }, ERROR_PANIC, "close it");
    done(unsafe { contactd_close(&mut session.0) });
    assert!(session.0.is_null());
    // Other sessions go on.
    Open::embedded().scene();
}
