//! Scenes and robots from files through C: against closed forms, and bit for bit against the same session in Rust.

use crate::support::*;
use contactd::ipc::ServerConfig;
use contactd::load::{LoadOptions, LoadScene};
use contactd_capi::abi::{JointValue, Reply};
use contactd_capi::error::{ERROR_ARGUMENT, ERROR_NULL};
use contactd_capi::loaded::*;
use contactd_capi::model::{contactd_count_faces, contactd_get_face};
use contactd_capi::scene::contactd_rule_new;
use contactd_capi::scene::contactd_set_rules;
use contactd_proto::contact_record::CONTACT;
use contactd_proto::{ContactRecord, PoseRecord};
use std::collections::BTreeMap;
use std::ffi::CString;
use std::path::Path;
use std::ptr::{null, null_mut};
use std::time::Duration;

fn model() -> i32 {
    contactd_proto::ErrorCode::Model.number() as i32
}

/// Numbers from 0 to 1.
struct Random(u64);

impl Random {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1u64 << 53) as f64)
    }
}

/// A scene of a test, freed at its end.
struct Scene(*mut Loaded);

impl Scene {
    fn load(session: &Open, path: &Path) -> Self {
        let path = CString::new(path.to_str().unwrap()).unwrap();
        Self(out(|scene| unsafe { contactd_load_scene(session.0, path.as_ptr(), null(), scene) }))
    }

    fn find(&self, name: &str) -> u32 {
        let name = CString::new(name).unwrap();
        out(|id| unsafe { contactd_scene_find(self.0, name.as_ptr(), id) })
    }

    fn step(&self, session: &Open, joints: &[JointValue]) -> Reply {
        let (joints, count) = (joints.as_ptr(), joints.len());
        out(|reply| unsafe { contactd_scene_step(session.0, self.0, joints, count, 60.0, reply) })
    }

    fn value(&self, joint: usize) -> f64 {
        out(|joint_out| unsafe { contactd_scene_get_joint(self.0, joint, joint_out) }).value
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        done(unsafe { contactd_scene_free(&mut self.0) });
        assert!(self.0.is_null());
        done(unsafe { contactd_scene_free(&mut self.0) });
    }
}

/// A rod that turns about z towards a post: its side touches where the post's distance from the rod's line is both half widths.
#[test]
fn a_rod_meets_a_post_where_its_arc_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.urdf");
    let mut r = Random(7);
    for _ in 0..30 {
        let (far, radius, half) = (r.within(1.0, 2.0), r.within(0.05, 0.2), r.within(0.05, 0.2));
        let (begin, end) = (r.within(-1.0, 0.3), r.within(1.58, 2.5));
        let urdf = format!(
            "<robot name=\"arm\"><link name=\"post\"><collision><origin xyz=\"0 {far} 0\"/><geometry>\
             <cylinder radius=\"{radius}\" length=\"2\"/></geometry></collision></link><link name=\"rod\"><collision>\
             <origin xyz=\"{} 0 0\"/><geometry><box size=\"{} {} 0.2\"/></geometry></collision></link>\
             <joint name=\"turn\" type=\"revolute\"><parent link=\"post\"/><child link=\"rod\"/><axis xyz=\"0 0 1\"/>\
             <limit lower=\"-3\" upper=\"3\"/></joint></robot>",
            0.5 * far + 0.5,
            far + 1.0,
            2.0 * half
        );
        std::fs::write(&path, urdf).unwrap();
        let session = Open::embedded();
        let arm = Scene::load(&session, &path);
        let info = out(|info| unsafe { contactd_scene_get_info(arm.0, info) });
        assert_eq!((info.object_count, info.joint_count, info.note_count, info.dt), (2, 1, 0, 0.0));
        assert_eq!(string(info.unit), "m");
        let joint = out(|joint| unsafe { contactd_scene_get_joint(arm.0, 0, joint) });
        assert_eq!((string(joint.name), joint.turns, joint.low, joint.high), ("turn".into(), 1, -3.0, 3.0));
        // What a joint connects is not tested, but where the session's own rule says so.
        let rule = contactd_rule_new(c"default".as_ptr(), c"default".as_ptr());
        done(unsafe { contactd_set_rules(session.0, &rule, 1) });
        let turn = |value| [JointValue { name: c"turn".as_ptr(), value }];
        done(unsafe { contactd_scene_set_joints(session.0, arm.0, turn(begin).as_ptr(), 1) });
        assert_eq!(arm.value(0), begin);
        let reply = arm.step(&session, &turn(end));
        let met = records(&reply)[0];
        let touch = ((radius + half) / far).acos();
        let expected = (touch - begin) / (end - begin);
        assert!((met.time - expected).abs() < 1e-7 && met.status == CONTACT, "{met:?}, not {expected}");
        assert_eq!((met.a, met.b), (arm.find("post"), arm.find("rod")));
        assert_eq!(arm.value(0), end);
        done(unsafe { contactd_scene_stop_at(session.0, arm.0, met.time_lower) });
        assert!((arm.value(0) - touch).abs() < 1e-6);
        let object = out(|object| unsafe { contactd_scene_get_object(arm.0, 1, object) });
        let (faces, _) = {
            let mut counts = (0, 0);
            done(unsafe { contactd_count_faces(session.0, object.model, &mut counts.0, &mut counts.1) });
            counts
        };
        assert_eq!((string(object.name), object.object, faces), ("rod".into(), arm.find("rod"), 6));
        let face = out(|face| unsafe { contactd_get_face(session.0, object.model, 0, face) });
        assert_eq!(string(face.name), "cube");
        // The scene's own rule again, by which the two are not tested.
        done(unsafe { contactd_scene_set_rules(session.0, arm.0) });
        done(unsafe { contactd_scene_set_joints(session.0, arm.0, turn(begin).as_ptr(), 1) });
        assert_eq!(arm.step(&session, &turn(end)).record_count, 0);
    }
}

/// Random joint values of the arm of three joints, one after the other, through C and in Rust: the same records, bit for bit.
#[test]
fn an_arm_driven_through_c_tells_the_bits_of_rust() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../server/models/robots/arm.urdf");
    let session = Open::embedded();
    let arm = Scene::load(&session, &path);
    let mut other = contactd::embedded(&ServerConfig::default()).unwrap();
    let mut same = other.load_scene(&path, &LoadOptions::default()).unwrap();
    let names: Vec<CString> = same.joints().iter().map(|j| CString::new(j.name.as_str()).unwrap()).collect();
    let (mut r, mut met) = (Random(11), 0);
    for step in 0..60 {
        let joint = &same.joints()[step % names.len()];
        let value = r.within(joint.range[0].max(-3.0), joint.range[1].min(3.0));
        let to = [JointValue { name: names[step % names.len()].as_ptr(), value }];
        // As a step of its own, or as records that the caller puts into a batch.
        let reply = if step % 3 == 0 {
            let mut room = [PoseRecord { object: 0, flags: 0, position: [0.0; 3], rotation: [0.0; 4] }; 5];
            let count = out(|written| unsafe {
                contactd_scene_records(session.0, arm.0, to.as_ptr(), 1, room.as_mut_ptr(), room.len(), written)
            });
            session.step(&room[..count])
        } else {
            arm.step(&session, &to)
        };
        let values = BTreeMap::from([(joint.name.clone(), value)]);
        let expected = same.step(&mut other, &values, Duration::from_secs(60)).unwrap();
        let bytes =
            |all: &[ContactRecord]| -> Vec<u8> { all.iter().flat_map(|c| format!("{c:?}").into_bytes()).collect() };
        assert_eq!(bytes(records(&reply)), bytes(expected.records()), "step {step}");
        assert_eq!(reply.header.safe_time.to_bits(), expected.header().safe_time.to_bits());
        met += records(&reply).iter().filter(|c| c.status == CONTACT).count();
        for (i, joint) in same.joints().iter().enumerate() {
            assert_eq!(arm.value(i).to_bits(), joint.value.to_bits());
        }
    }
    assert!(met > 5, "{met}");
}

#[test]
fn what_is_wrong_with_a_scene_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let session = Open::embedded();
    let load = |name: &str, text: &str, options: *const _| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let path = CString::new(path.to_str().unwrap()).unwrap();
        let mut scene = null_mut();
        let code = unsafe { contactd_load_scene(session.0, path.as_ptr(), options, &mut scene) };
        assert_eq!(code == 0, !scene.is_null());
        (code, scene)
    };
    refused(load("a.urdf", "<robot>\n<link/></robot>", null()).0, model(), "a.urdf:2:1: expected name of the link");
    refused(load("a.txt", "", null()).0, model(), "found another kind of file");
    let mut options = contactd_scene_options_new();
    options.hulls = 1;
    refused(load("s.toml", "", &options).0, model(), "beside joints, a keyframe, hulls");
    options.hulls = 2;
    refused(load("s.toml", "", &options).0, ERROR_ARGUMENT, "options.hulls");
    let link = |name: &str| {
        format!("<link name=\"{name}\"><collision><geometry><sphere radius=\"1\"/></geometry></collision></link>")
    };
    let joint = "<joint name=\"j\" type=\"prismatic\"><parent link=\"a\"/><child link=\"b\"/><limit lower=\"-1\" upper=\"2\"/></joint>";
    let robot = format!("<robot name=\"r\">{}{}{joint}</robot>", link("a"), link("b"));
    let begin = [JointValue { name: c"j".as_ptr(), value: 1.5 }];
    let mut options = contactd_scene_options_new();
    (options.joints, options.joint_count) = (begin.as_ptr(), 1);
    let scene = Scene(load("r.urdf", &robot, &options).1);
    assert_eq!(scene.value(0), 1.5);
    let set = |name: &std::ffi::CStr, value| {
        let joint = JointValue { name: name.as_ptr(), value };
        unsafe { contactd_scene_set_joints(session.0, scene.0, &joint, 1) }
    };
    refused(set(c"k", 0.0), model(), "expected one of the joints j, found \"k\"");
    refused(set(c"j", 2.5), model(), "expected -1 to 2 as j, found 2.5");
    refused_at(set(c"j", f64::NAN), ERROR_ARGUMENT, 0, "found NaN");
    assert_eq!(scene.value(0), 1.5);
    let mut id = 0;
    refused(unsafe { contactd_scene_find(scene.0, c"c".as_ptr(), &mut id) }, ERROR_ARGUMENT, "found \"c\"");
    refused(unsafe { contactd_scene_find(null_mut(), c"a".as_ptr(), &mut id) }, ERROR_NULL, "the scene");
    refused(unsafe { contactd_scene_stop_at(session.0, scene.0, 1.5) }, model(), "a time within the step, 0 to 1");
    let mut note = null();
    refused(unsafe { contactd_scene_get_note(scene.0, 0, &mut note) }, ERROR_ARGUMENT, "note 0: there are 0");
    let (mut room, mut written) = ([PoseRecord { object: 0, flags: 0, position: [0.0; 3], rotation: [0.0; 4] }], 0);
    let short = unsafe { contactd_scene_records(session.0, scene.0, null(), 0, room.as_mut_ptr(), 1, &mut written) };
    refused(short, ERROR_ARGUMENT, "expected room for 2 records, found 1");
    done(unsafe { contactd_scene_refused(scene.0) });
}
