//! What each function does when it is called as it should be.

use crate::support::*;
use contactd_capi::abi::{Mass, Names, Options, Pose};
use contactd_capi::model::*;
use contactd_capi::query::*;
use contactd_capi::recording::*;
use contactd_capi::scene::*;
use contactd_capi::session::*;
use contactd_capi::step::*;
use contactd_client::MassOptions;
use contactd_proto::contact_record::{CONTACT, OVERLAP, SENSOR, VALID_POINT};
use contactd_proto::query::{NO_OBJECT, ObjectRay, PointOptions, RAY_HIT, RAY_MISS, RayOptions, Side};
use contactd_proto::rule::RuleNumbers;
use contactd_proto::step::{STEP_CLEAR, STEP_CONTACT};
use contactd_proto::{Detect, InitialOverlap, PoseRecord, Report, pose_record};
use std::ffi::{CStr, c_char};
use std::ptr::{null, null_mut};

#[test]
fn versions_are_the_package_s_and_the_protocol_s() {
    assert_eq!(string(contactd_version()), env!("CARGO_PKG_VERSION"));
    assert_eq!(contactd_protocol_version(), contactd_proto::names::PROTOCOL_VERSION);
}

#[test]
fn a_ball_meets_the_rim_of_a_hole() {
    let session = Open::embedded();
    let opened = out(|o| unsafe { contactd_get_opened(session.0, o) });
    assert!(opened.session == 1 && opened.epoch == 0 && opened.max_batch > 1000);
    done(unsafe { contactd_set_command_timeout(session.0, 60.0) });
    let (plate, ball) = session.scene();
    assert_eq!((plate, ball), (1, 2));
    session.begin(1)[0] = end(ball, [1.0, 0.0, 0.0]);
    done(unsafe { contactd_send(session.0) });
    let reply = session.finish();
    assert_eq!((reply.header.status, reply.record_count, reply.header.step), (STEP_CONTACT, 1, 1));
    let c = records(&reply)[0];
    assert_eq!((c.a, c.b, c.status), (plate, ball, CONTACT));
    // The rim comes within 2 of the line of fall: a ball of radius 5 stops √21 above it.
    assert!((c.time - (18.0 - 21f64.sqrt()) / 20.0).abs() < 1e-9, "{c:?}");
    assert!(reply.header.safe_time <= c.time);
    let mut again = null_mut();
    assert_eq!(unsafe { contactd_embedded(null(), &mut again) }, 0);
    assert_eq!(unsafe { (contactd_close(&mut again), contactd_close(&mut again)) }, (0, 0));
    assert!(again.is_null());
}

/// Two balls over the plate, the one on the other: the lower one falls, and the upper one goes along.
#[test]
fn a_part_that_is_attached_goes_along_and_a_rule_tells_clearances() {
    let session = Open::embedded();
    let (plate, ball) = session.scene();
    let model = session.model("small.csg", c"sphere(r = 1);");
    let part = session.object(c"part", model, |o| o.pose.position = [10.0, 0.0, 20.0]);
    let mut rule = contactd_rule_new(c"default".as_ptr(), c"default".as_ptr());
    rule.effects = RuleNumbers { clearance: 1e-9, ..rule.effects };
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    done(unsafe { contactd_attach(session.0, part, ball, null(), 0) });
    session.begin(1)[0] = end(ball, [10.0, 0.0, 12.0]);
    let reply = session.finish();
    // Not the two against each other; the part ends a radius of 1 above the plate's top at 2, and began as far from it as 8 more.
    let told = records(&reply);
    let clearance = |i| unsafe { *out(|slot| contactd_get_clearance(session.0, i, slot)) };
    let found: Vec<_> = told.iter().enumerate().map(|(i, c)| (c.a, c.b, clearance(i))).collect();
    assert_eq!(found.iter().map(|(a, b, _)| (*a, *b)).collect::<Vec<_>>(), [(plate, ball), (plate, part)]);
    for ((_, _, slot), expected) in found.iter().zip([5.0, 9.0]) {
        assert!(slot.lower <= expected + 1e-12 && expected <= slot.upper + 1e-12, "{slot:?}");
        assert!(slot.upper - slot.lower < 1e-9 && slot.time == 1.0 && slot.tolerance == 1e-9, "{slot:?}");
    }
    done(unsafe { contactd_allow(session.0, plate, part, 1) });
    done(unsafe { contactd_detach(session.0, part) });
    session.begin(0);
    let pairs: Vec<_> = records(&session.finish()).iter().map(|c| (c.a, c.b)).collect();
    assert_eq!(pairs, [(plate, ball), (ball, part)]);
    refused(unsafe { contactd_attach(session.0, part, part, null(), 0) }, 1006, "attached to itself");
    refused(unsafe { contactd_allow(session.0, part, 99, 1) }, 1006, "objects of this session");
}

#[test]
fn a_session_is_recorded_and_its_step_saved() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| std::ffi::CString::new(folder.path().join(name).to_str().unwrap()).unwrap();
    let session = Open::embedded();
    let (_, ball) = session.scene();
    done(unsafe { contactd_start_recording(session.0, path("run.mcap").as_ptr()) });
    assert_eq!(unsafe { contactd_start_recording(session.0, path("again.mcap").as_ptr()) }, 28);
    session.begin(1)[0] = end(ball, [1.0, 0.0, 0.0]);
    session.finish();
    done(unsafe { contactd_save_step(session.0, path("saved").as_ptr()) });
    assert!(folder.path().join("saved/scene.toml").is_file());
    let so_far = out(|r| unsafe { contactd_get_recording(session.0, r) });
    let told = out(|r| unsafe { contactd_stop_recording(session.0, r) });
    assert_eq!((so_far.steps, told.steps, told.dropped, told.without_picture), (1, 1, 0, 0));
    assert_eq!(std::fs::metadata(folder.path().join("run.mcap")).unwrap().len(), told.bytes);
    let mut none = told;
    assert_eq!(unsafe { contactd_stop_recording(session.0, &mut none) }, 28);
}

#[test]
fn an_embedded_engine_takes_a_server_s_settings() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("server.toml");
    std::fs::write(&file, "batch = 3\n").unwrap();
    let path = std::ffi::CString::new(file.to_str().unwrap()).unwrap();
    let mut session = Open(null_mut());
    done(unsafe { contactd_embedded(path.as_ptr(), &mut session.0) });
    assert_eq!(out(|o| unsafe { contactd_get_opened(session.0, o) }).max_batch, 3);
}

#[test]
fn faces_and_warnings_have_names() {
    let session = Open::embedded();
    let model = session.model("plate.csg", PLATE);
    let [mut faces, mut warnings] = [0; 2];
    done(unsafe { contactd_count_faces(session.0, model, &mut faces, &mut warnings) });
    assert_eq!((faces, warnings), (9, 0));
    let face = |face| out(|out| unsafe { contactd_get_face(session.0, model, face, out) });
    let (cube, hole) = (face(0), face(6));
    assert_eq!((string(cube.name), cube.primitive, cube.subtracted), ("cube".into(), 0, 0));
    assert_eq!((string(hole.name), hole.primitive, hole.subtracted), ("cylinder".into(), 1, 1));
    assert_ne!(string(face(0).face), string(face(1).face));
    assert_eq!(face(0).name, cube.name, "a string stays where it is");

    // A matrix as printed with six digits is snapped, with a warning.
    let rough =
        c"multmatrix([[0.866025, -0.5, 0, 0], [0.5, 0.866025, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) { sphere(r = 2); }";
    let model = session.model("rough.csg", rough);
    done(unsafe { contactd_count_faces(session.0, model, &mut faces, &mut warnings) });
    let texts: Vec<String> =
        (0..warnings).map(|w| string(out(|out| unsafe { contactd_get_warning(session.0, model, w, out) }))).collect();
    assert!(faces == 1 && !texts.is_empty() && texts.iter().all(|t| t.contains("a rough matrix")), "{texts:?}");
}

#[test]
fn facets_are_taken_as_asked() {
    let session = Open::embedded();
    let count = |facets| {
        let text = c"cylinder($fn = 6, h = 2, r1 = 1, r2 = 1);";
        let model = out(|m| unsafe { contactd_load_model(session.0, c"hex.csg".as_ptr(), text.as_ptr(), facets, m) });
        let [mut faces, mut warnings] = [0; 2];
        done(unsafe { contactd_count_faces(session.0, model, &mut faces, &mut warnings) });
        faces
    };
    assert_eq!([count(FACETS_AUTO), count(FACETS_EXACT), count(FACETS_AS_WRITTEN)], [8, 3, 8]);
}

#[test]
fn a_file_is_read_as_its_format_or_its_name_says() {
    let session = Open::embedded();
    let bytes = PLATE.to_bytes();
    let volume = |name: &CStr, format: *const c_char| {
        let (bytes, n) = (bytes.as_ptr(), bytes.len());
        let model = out(|m| unsafe { contactd_load_model_file(session.0, name.as_ptr(), format, bytes, n, 0, m) });
        out(|m| unsafe { contactd_mass_properties(session.0, model, 0.0, 0, m) }).volume
    };
    let text = session.model("plate.csg", PLATE);
    let of_text = out(|m| unsafe { contactd_mass_properties(session.0, text, 0.0, 0, m) }).volume;
    assert_eq!([volume(c"plate.csg", null()), volume(c"plate", c"CSG".as_ptr())], [of_text; 2]);
}

#[test]
fn mass_properties_are_those_of_rust() {
    let session = Open::embedded();
    let model = session.model("plate.csg", PLATE);
    let mass = out(|m| unsafe { contactd_mass_properties(session.0, model, 0.0, 0, m) });
    let mut own = contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
    own.load_model("plate.csg", PLATE.to_str().unwrap()).unwrap();
    let of_rust = own.mass_properties(1, &MassOptions::default()).unwrap();
    assert_eq!(mass, Mass::from(of_rust));
    assert!((mass.volume - (6400.0 - 36.0 * std::f64::consts::PI)).abs() <= mass.volume_error + 1e-9, "{mass:?}");
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let place = Pose { position: [1.0, 2.0, 3.0], rotation: [0.0, half, 0.0, half] };
    let placed = out(|m| unsafe { contactd_mass_placed(&mass, &place, m) });
    assert!((placed.center[0] - 1.0).abs() < 1e-6 && (placed.center[2] - 3.0).abs() < 1e-6, "{placed:?}");
    assert!((placed.inertia[0] / mass.inertia[2] - 1.0).abs() < 1e-9);
    let mut heavy = mass;
    let same: *mut Mass = &mut heavy;
    done(unsafe { contactd_mass_with_density(same, 2.5, same) });
    assert_eq!((heavy.density, heavy.volume, heavy.inertia[1]), (2.5, mass.volume, 2.5 * mass.inertia[1]));
}

#[test]
fn objects_carry_what_was_declared() {
    let session = Open::embedded();
    let model = session.model("ball.csg", BALL);
    let still = session.object(c"still", model, |o| o.is_static = 1);
    let upright = session.object(c"upright", model, |o| {
        (o.rotates, o.pose.position) = (0, [30.0, 0.0, 0.0]);
    });
    let slow = session.object(c"slow", model, |o| {
        (o.max_speed, o.pose.position, o.place.position) = (10.0, [60.0, 0.0, 0.0], [0.0, 0.0, 7.0]);
    });
    let code = |poses: &[PoseRecord]| {
        session.begin(poses.len()).copy_from_slice(poses);
        let mut reply = std::mem::MaybeUninit::uninit();
        unsafe { contactd_finish(session.0, 60.0, reply.as_mut_ptr()) }
    };
    let mut options = out(|o| unsafe { contactd_get_options(session.0, o) });
    options.dt = 1.0;
    done(unsafe { contactd_set_options(session.0, &options) });
    refused_at(code(&[end(slow, [61.0, 0.0, 0.0]), end(still, [1.0; 3])]), 5, 1, "static");
    let turn = PoseRecord {
        object: upright,
        flags: pose_record::TURN,
        position: [30.0, 0.0, 0.0],
        rotation: [0.0, 0.0, 1.0, 0.0],
    };
    refused_at(code(&[turn]), 10, 0, "no rotation");
    refused_at(code(&[end(slow, [80.0, 0.0, 0.0])]), 10, 0, "largest speed");
    done(code(&[end(slow, [65.0, 0.0, 0.0])]));
    done(unsafe { contactd_remove_object(session.0, slow) });
    refused_at(code(&[end(slow, [66.0, 0.0, 0.0])]), 3, 0, "no object");
}

#[test]
fn a_rule_s_every_field_is_obeyed() {
    let session = Open::embedded();
    let ball = session.model("ball.csg", BALL);
    for (name, group, x) in [(c"a", c"left", 0.0), (c"b", c"right", 8.0), (c"c", c"right", -8.0)] {
        session.object(name, ball, |o| (o.group, o.pose.position) = (group.as_ptr(), [x, 0.0, 0.0]));
    }
    let except = [Names { a: c"a".as_ptr(), b: c"c".as_ptr() }];
    let mut rule = contactd_rule_new(c"left".as_ptr(), c"right".as_ptr());
    (rule.except, rule.except_count) = (except.as_ptr(), 1);
    let asked = rule.effects;
    (rule.effects.penetration, rule.effects.sensor) = (1, 1);
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    let mut options = out(|o| unsafe { contactd_get_options(session.0, o) });
    options.details = 1;
    done(unsafe { contactd_set_options(session.0, &options) });
    // a and b overlap by 2; a and c are excepted; b and c are named by no rule.
    let reply = session.step(&[]);
    let [c] = records(&reply) else { panic!("{:?}", records(&reply)) };
    assert_eq!((c.a, c.b, c.status, c.flags & SENSOR), (1, 2, OVERLAP, SENSOR));
    let detail = out(|slot| unsafe { contactd_get_detail(session.0, 0, slot) });
    assert!((unsafe { *detail }.penetration - 2.0).abs() < 1e-6, "{:?}", unsafe { *detail });

    // Past the overlap: b leaves.
    rule.effects = RuleNumbers { initial_overlap: InitialOverlap::IgnoreIfSeparating as u32, ..asked };
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    assert_eq!(session.step(&[end(2, [12.0, 0.0, 0.0])]).header.status, STEP_CLEAR);

    // A margin tells of a pair 1.5 apart, with its regions; discrete looks at the end alone, a hit tells no point.
    (rule.effects.margin, rule.effects.report) = (2.0, Report::Patch as u32);
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    let reply = session.step(&[end(2, [11.5, 0.0, 0.0])]);
    assert!((records(&reply)[0].separation - 2.0).abs() < 1e-9, "{:?}", records(&reply));
    assert_eq!(out(|n| unsafe { contactd_count_regions(session.0, 0, n) }), 1);
    (rule.effects.margin, rule.effects.report) = (0.0, Report::Hit as u32);
    rule.effects.detect = Detect::Discrete as u32;
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    let reply = session.step(&[end(2, [-11.5, 0.0, 0.0])]);
    assert_eq!((reply.record_count, reply.header.counters.may_have_passed), (0, 1));
    rule.effects.detect = Detect::Continuous as u32;
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    let reply = session.step(&[end(2, [11.5, 0.0, 0.0])]);
    assert_eq!((reply.record_count, records(&reply)[0].valid & VALID_POINT), (1, 0));
    rule.effects.detect = Detect::Off as u32;
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    assert_eq!(session.step(&[end(2, [-11.5, 0.0, 0.0])]).header.pairs, 0);
    done(unsafe { contactd_set_rules(session.0, null(), 0) });
    done(unsafe { contactd_set_resolution(session.0, 1e-6) });
    done(unsafe { contactd_set_resolution(session.0, 0.0) });
}

#[test]
fn a_resting_box_tells_its_region_and_its_corners_in_place() {
    let session = Open::embedded();
    let (floor, cube) = (c"cube(size = [40, 40, 4], center = true);", c"cube(size = [4, 4, 4], center = true);");
    let (floor, cube) = (session.model("floor.csg", floor), session.model("cube.csg", cube));
    session.object(c"floor", floor, |o| o.is_static = 1);
    session.object(c"box", cube, |o| o.pose.position = [0.0, 0.0, 4.0]);
    let mut rule = contactd_rule_new(c"default".as_ptr(), c"default".as_ptr());
    rule.effects.report = Report::Patch as u32;
    done(unsafe { contactd_set_rules(session.0, &rule, 1) });
    let reply = session.step(&[]);
    assert_eq!(reply.record_count, 1);
    assert_eq!(out(|n| unsafe { contactd_count_regions(session.0, 0, n) }), 1);
    let (mut region, mut patches, mut n) = (null(), null(), 0);
    done(unsafe { contactd_get_region(session.0, 0, 0, &mut region, &mut patches, &mut n) });
    let (region, patch) = unsafe { (*region, *patches) };
    assert_eq!((n, region.points, patch.count, patch.region[0]), (1, 4, 4, 0));
    assert_eq!(region.normal, [0.0, 0.0, 1.0]);
    for p in patch.points {
        assert!((p[0].abs() - 2.0).abs() < 1e-9 && (p[1].abs() - 2.0).abs() < 1e-9 && (p[2] - 2.0).abs() < 1e-9);
    }
    // In place: they lie among the reply's slots.
    let inside = slots(&reply).as_ptr_range();
    assert!(inside.contains(&patches.cast()));
    let detail = out(|slot| unsafe { contactd_get_detail(session.0, 0, slot) });
    assert!(detail.is_null(), "details were not asked for");
}

#[test]
fn options_come_back_as_they_were_set() {
    let session = Open::embedded();
    let (_, ball) = session.scene();
    let default = out(|o| unsafe { contactd_get_options(session.0, o) });
    assert_eq!((default.advance, default.first, default.max_records, default.batch_limit), (1.0, 0, 0, 0));
    let set = Options {
        advance: 0.5,
        dt: 0.01,
        first: 1,
        details: 1,
        clear: 1,
        polling: 1,
        max_records: 2,
        cell_limit: 3000,
        batch_limit: 40_000,
        reserved: 0,
    };
    done(unsafe { contactd_set_options(session.0, &set) });
    assert_eq!(out(|o| unsafe { contactd_get_options(session.0, o) }), set);
    let reply = session.step(&[end(ball, [1.0, 0.0, 12.0])]);
    assert_eq!((reply.header.status, reply.record_count, reply.slot_count), (STEP_CLEAR, 1, 2));
    assert_eq!(out(|o| unsafe { contactd_get_options(session.0, o) }), Options { advance: 1.0, ..set });
    // A quarter of the way from 20 to 12, then on to 0: contact √21 above the rim.
    done(unsafe { contactd_set_advance(session.0, 0.25) });
    let reply = session.step(&[end(ball, [1.0, 0.0, 0.0])]);
    assert!((records(&reply)[0].time - (16.0 - 21f64.sqrt()) / 18.0).abs() < 1e-9);
}

#[test]
fn queries_are_those_of_rust() {
    let session = Open::embedded();
    let (plate, ball) = session.scene();
    let mut own = contactd::embedded(&contactd::ipc::ServerConfig::default()).unwrap();
    for (name, text) in [("plate.csg", PLATE), ("ball.csg", BALL)] {
        own.load_model(name, text.to_str().unwrap()).unwrap();
    }
    let seen = out(|d| unsafe { contactd_get_distance(session.0, plate, ball, 1e-9, d) });
    assert!(seen.settled == 1 && seen.lower <= seen.upper && seen.upper > 0.0, "{seen:?}");
    let way = (0..3).map(|k| (seen.point_a[k] - seen.point_b[k]).powi(2)).sum::<f64>().sqrt();
    assert!((way - seen.upper).abs() < 1e-9, "{seen:?}");
    // The corner of the plate, within it, and the middle of its hole.
    let points = [[30.0, 0.0, 0.0], [19.0, 19.0, 1.0], [0.0, 0.0, 0.0]];
    let query = contactd_point_query_new();
    let asked = PointOptions { surface: query.surface, tolerance: query.tolerance, limit: query.limit };
    assert_eq!(asked, PointOptions::default());
    let only = [plate];
    let query = contactd_capi::abi::PointQuery { objects: only.as_ptr(), object_count: 1, ..query };
    let mut told = [Default::default(); 3];
    done(unsafe { contactd_get_points(session.0, points.as_ptr(), 3, &query, told.as_mut_ptr()) });
    assert_eq!(told.map(|t| t.side), [Side::Outside as u8, Side::Inside as u8, Side::Outside as u8]);
    assert_eq!(told.map(|t| t.object), [plate; 3]);
    for (t, d) in told.iter().zip([10.0, -1.0, 3.0]) {
        assert!(t.settled == 1 && t.lower <= d + 1e-12 && d <= t.upper + 1e-12 && t.upper - t.lower < 1e-5, "{t:?}");
    }
    let ray = |x: f64, z: f64| ObjectRay { origin: [x, 0.0, 9.0], direction: [0.0, 0.0, z], length: 100.0 };
    let rays = [ray(10.0, -2.0), ray(0.0, -1.0), ray(10.0, 1.0)];
    let query = contactd_ray_query_new();
    assert_eq!((query.depth, query.limit), (RayOptions::default().depth, RayOptions::default().limit));
    let query = contactd_capi::abi::RayQuery { objects: only.as_ptr(), object_count: 1, ..query };
    let mut told = [Default::default(); 3];
    done(unsafe { contactd_cast_rays(session.0, rays.as_ptr(), 3, &query, told.as_mut_ptr()) });
    assert_eq!(told.map(|t| t.outcome), [RAY_HIT, RAY_MISS, RAY_MISS]);
    assert!((told[0].t - 7.0).abs() < 1e-12 && told[0].normal == [0.0, 0.0, 1.0], "{:?}", told[0]);
    assert_eq!(told.map(|t| t.object), [plate, NO_OBJECT, NO_OBJECT]);
    done(unsafe { contactd_get_points(session.0, null(), 0, &contactd_point_query_new(), null_mut()) });
}
