//! The committed header is the one that the sources make, and its sizes and offsets are Rust's.
//!
//! `CONTACTD_WRITE_HEADER=1 cargo test -p contactd-capi --test header` writes it anew after a change of the interface.

use cbindgen::{Builder, Config};
use contactd_capi::abi::{
    Distance, Face, Joint, JointValue, LoadedObject, Mass, Names, Object, Opened, Options, PointQuery, Pose, RayQuery,
    Recording, Reply, Rule, SceneInfo, SceneOptions,
};
use contactd_capi::manifold::{Manifold, ManifoldPoint};
use contactd_proto::effects::{self, EffectCounters};
use contactd_proto::query::{ObjectRay, PointRecord, RayRecord};
use contactd_proto::rule::{Effects, Field, RuleNumbers, Values};
use contactd_proto::step::WorkCounters;
use contactd_proto::{
    ClearanceSlot, ContactRecord, DetailSlot, ErrorCode, PatchSlot, PoseRecord, RegionSlot, StepReply,
};
use std::fmt::Write as _;
use std::mem::offset_of;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Stands for what is made of the tables of rules and effects, which cbindgen cannot read.
const TABLES: &str = "tables";

/// Sources of the header, in its order.
const SOURCES: [&str; 19] = [
    "src/error.rs",
    "../../proto/src/pose_record.rs",
    "../../proto/src/contact_record.rs",
    "../../proto/src/step.rs",
    "../../proto/src/query.rs",
    TABLES,
    "src/abi.rs",
    "src/handle.rs",
    "src/session.rs",
    "src/model.rs",
    "src/solid.rs",
    "src/scene.rs",
    "src/loaded.rs",
    "src/step.rs",
    "src/query.rs",
    "src/recording.rs",
    "src/manifold.rs",
    "src/convention/pose.rs",
    "src/convention/contact.rs",
];

const HEAD: &str = "\
// contactd: earliest contact of moving solids modelled by constructive solid geometry, from C and C++.
//
// Lengths are in the models' unit, times within a step a fraction 0..1, axes right-handed, quaternions x y z w, angles in
// radians. Every function that can fail returns CONTACTD_OK or another code; contactd_error_message() says what was wrong.
// A session belongs to the thread that opened it.
//
// Converters (contactd_from_…, contactd_to_…, contactd_contact_…) take and give arrays: `position`, `point`, `normal` and other
// vectors of 3 numbers, `rotation` of 4, as they are in contactd_pose_record and contactd_record. What goes in is read before
// anything is written. In an engine's contact its body 1 (A, first) is a.
//
// Not to be edited: made of the Rust sources by bindings/capi/tests/header.rs.";

/// Lines that state size and offsets of a structure to the C compiler.
macro_rules! asserts {
    ($out:ident, $($name:literal $type:ident { $($field:ident),+ $(,)? })+) => {$(
        let _ = writeln!($out, "CONTACTD_SIZE({}, {});", $name, size_of::<$type>());
        $(let _ = writeln!($out, "CONTACTD_AT({}, {}, {});", $name, stringify!($field), offset_of!($type, $field));)+
        // A field that the list leaves out does not build.
        #[allow(clippy::unneeded_field_pattern)]
        let _ = |it: $type| { let $type { $($field: _),+ } = it; };
    )+};
}

fn offsets() -> String {
    let mut text = String::from(
        "// Sizes and offsets as the library was built with them.\n\
         #ifdef __cplusplus\n\
         #define CONTACTD_ASSERT static_assert\n\
         #else\n\
         #define CONTACTD_ASSERT _Static_assert\n\
         #endif\n\
         #define CONTACTD_SIZE(type, n) CONTACTD_ASSERT(sizeof(type) == n, \"size of \" #type)\n\
         #define CONTACTD_AT(type, field, n) CONTACTD_ASSERT(offsetof(type, field) == n, \"place of \" #type \".\" #field)\n",
    );
    let out = &mut text;
    asserts! { out,
        "contactd_pose_record" PoseRecord { object, flags, position, rotation }
        "contactd_record" ContactRecord {
            a, b, status, kind, extent, flags, valid, time, time_lower, point, normal, separation, normal_speed, faces_a,
            faces_b, slot, slots,
        }
        "contactd_detail_slot" DetailSlot {
            tag, reserved, time_upper, resolution, point_a, penetration, direction, cells, margin_time, spare,
        }
        "contactd_region_slot" RegionSlot {
            tag, region, kind, extent, reserved, points, normal, faces_a, faces_b, separation, spare,
        }
        "contactd_clearance_slot" ClearanceSlot {
            tag, flags, lower, upper, time, points, faces_a, faces_b, tolerance, cells, spare,
        }
        "contactd_patch_slot" PatchSlot { tag, count, points, separations, region }
        "contactd_step_reply" StepReply {
            step, epoch, status, error, index, records, slots, truncated, effects, pairs, safe_time, counters,
            effect_counters,
        }
        "contactd_work_counters" WorkCounters {
            box_tests, primitives, after_stage1, node_pairs, candidates, cells, clauses, newton, closed_forms,
            may_have_passed, instant_cells,
        }
        "contactd_pose" Pose { position, rotation }
        "contactd_opened" Opened { session, epoch, max_batch, reserved }
        "contactd_recording" Recording { steps, dropped, without_picture, bytes }
        "contactd_face" Face { primitive, subtracted, name, face }
        "contactd_mass" Mass {
            volume, volume_error, center, center_error, density, inertia, inertia_error, boxes,
        }
        "contactd_ray" ObjectRay { origin, direction, length }
        "contactd_point_query" PointQuery { surface, tolerance, limit, objects, object_count }
        "contactd_ray_query" RayQuery { depth, limit, objects, object_count }
        "contactd_point_record" PointRecord {
            object, side, settled, reserved, lower, upper, nearest, faces, spare, cells,
        }
        "contactd_ray_record" RayRecord {
            object, outcome, inside, reserved, lower, t, upper, point, normal, face, faces, cells,
        }
        "contactd_distance" Distance { lower, upper, point_a, point_b, cells, settled, reserved }
        "contactd_names" Names { a, b }
        "contactd_object" Object { name, group, model, is_static, rotates, reserved, max_speed, place, pose }
        "contactd_joint_value" JointValue { name, value }
        "contactd_scene_options" SceneOptions {
            joints, joint_count, key, packages, package_count, srdf, import_root, hulls, keeps_rules,
        }
        "contactd_scene_info" SceneInfo { unit, dt, object_count, joint_count, note_count }
        "contactd_scene_object" LoadedObject { name, object, model }
        "contactd_joint" Joint { name, turns, reserved, low, high, value }
        "contactd_options" Options {
            advance, dt, first, details, clear, polling, max_records, cell_limit, batch_limit, reserved,
        }
        "contactd_reply" Reply { header, records, record_count, slots, slot_count }
        "contactd_manifold_point" ManifoldPoint { id, group, position, normal, separation, on_a, on_b }
        "contactd_manifold" Manifold { a, b, status, is_complete, points, point_count }
    }
    let _ = writeln!(out, "CONTACTD_SIZE(contactd_effect_counters, {});", size_of::<EffectCounters>());
    for (i, effect) in effects::ALL.iter().enumerate() {
        let _ = writeln!(out, "CONTACTD_AT(contactd_effect_counters, {}, {});", effect.counter, size_of::<u64>() * i);
    }
    let _ = writeln!(out, "CONTACTD_SIZE(contactd_rule, {});", size_of::<Rule>());
    let pairs = [offset_of!(Rule, between), offset_of!(Rule, except), offset_of!(Rule, except_count)];
    let pairs = ["between", "except", "except_count"].into_iter().zip(pairs);
    let effects = RuleNumbers::OFFSETS.iter().map(|(name, at)| (*name, offset_of!(Rule, effects) + at));
    for (name, at) in pairs.chain(effects) {
        let _ = writeln!(out, "CONTACTD_AT(contactd_rule, {name}, {at});");
    }
    text + "#undef CONTACTD_AT\n#undef CONTACTD_SIZE\n#undef CONTACTD_ASSERT"
}

/// `UnknownObject` → `UNKNOWN_OBJECT`.
fn screaming(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_uppercase());
    }
    out
}

/// " How the pair …" → "how the pair …".
fn inner(doc: &str) -> String {
    let mut letters = doc.trim_start().chars();
    letters.next().map(|first| first.to_lowercase().chain(letters).collect()).unwrap_or_default()
}

/// The tables of rules and effects as Rust that cbindgen reads.
fn tables() -> String {
    let mut text = String::new();
    let out = &mut text;
    for effect in effects::ALL {
        let doc = effect.doc.join("\n///");
        let _ = writeln!(out, "/// `effects`: {}\npub const {}: u32 = {};", inner(&doc), effect.bit, effect.value);
    }
    for field in Effects::FIELDS {
        let Values::Words(of, words) = field.values else { continue };
        for (code, word) in words.iter().enumerate() {
            let name = format!("{}_{}", screaming(of), word.word.to_uppercase());
            let _ = writeln!(out, "///{}\npub const {name}: u32 = {code};", word.doc.join("\n///"));
        }
    }
    let _ = writeln!(
        out,
        "/// How often each effect was worked out in a step. What an earlier step has proven need not be worked out again, so\n\
         /// counters are no part of the answer's bits.\n#[repr(C)]\npub struct EffectCounters {{"
    );
    for effect in effects::ALL {
        let _ = writeln!(out, "///{}\npub {}: u64,", effect.doc.join("\n///"), effect.counter);
    }
    let _ = writeln!(
        out,
        "}}\n/// What happens between two groups of objects. contactd_rule_new sets the defaults.\n#[repr(C)]\npub struct Rule {{\n\
         /// The two groups; both may be the same.\npub between: Names,\n\
         /// Single pairs, by object name, that this rule leaves out; NULL when there are none.\npub except: *const Names,\n\
         /// Number of them.\npub except_count: usize,"
    );
    for (name, _) in RuleNumbers::OFFSETS {
        let field = Field::of_name(name).expect("a field of the table");
        let doc = field.doc.join("\n///");
        let _ = match field.values {
            Values::Words(of, _) => {
                writeln!(out, "/// CONTACTD_{}_…: {}\npub {name}: u32,", screaming(of), inner(&doc))
            }
            Values::Flag(_) => writeln!(out, "/// 1: {}\npub {name}: u32,", inner(&doc)),
            Values::Length => writeln!(out, "///{doc}\npub {name}: f64,"),
        };
    }
    text + "}\n"
}

/// A source of the header.
fn source(name: &str) -> PathBuf {
    if name != TABLES {
        return Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    }
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    let make = || {
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("tables{}.rs", std::process::id()));
        std::fs::write(&file, tables()).expect("a file that can be written");
        file
    };
    MADE.get_or_init(make).clone()
}

fn codes() -> String {
    let mut text = format!(
        "\n#define CONTACTD_VERSION \"{}\"\n#define CONTACTD_PROTOCOL_VERSION {}\n\n// Why the server refused: numbers that \
         never change, each with its sentence.\n",
        env!("CARGO_PKG_VERSION"),
        contactd_proto::names::PROTOCOL_VERSION
    );
    for code in ErrorCode::ALL {
        let name = screaming(&format!("{code:?}"));
        let _ = writeln!(text, "\n// {}.\n#define CONTACTD_ERROR_{name} {}", code.sentence(), code.number());
    }
    text.trim_end().into()
}

/// Rust's links in comments, as C names: [`STEP_SLOT`] → CONTACTD_STEP_SLOT, [`PatchSlot`]s → contactd_patch_slot.
fn without_links(text: &str, config: &Config) -> String {
    let mut pieces = text.split("[`");
    let mut out = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let (path, rest) = piece.split_once("`]").expect("the end of a link");
        let name = path.rsplit("::").next().unwrap_or(path);
        match config.export.rename.get(name) {
            Some(renamed) => out += renamed,
            None if name.chars().all(|c| !c.is_ascii_lowercase()) => out += &format!("CONTACTD_{name}"),
            None => out += name,
        }
        out += rest;
    }
    out
}

fn made() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut config = Config::from_file(folder.join("cbindgen.toml")).expect("settings");
    config.header = Some(HEAD.into());
    config.after_includes = Some(codes());
    config.trailer = Some(offsets());
    let builder = SOURCES.iter().fold(Builder::new(), |builder, name| builder.with_src(source(name)));
    let mut bytes = Vec::new();
    builder.with_config(config.clone()).generate().expect("sources that cbindgen reads").write(&mut bytes);
    without_links(&String::from_utf8(bytes).expect("text"), &config)
}

#[test]
fn the_committed_header_is_the_one_that_the_sources_make() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/contactd.h");
    let made = made();
    if std::env::var_os("CONTACTD_WRITE_HEADER").is_some() {
        std::fs::write(&file, &made).expect("a file that can be written");
    }
    let committed = std::fs::read_to_string(&file).expect("include/contactd.h");
    let first = made.lines().zip(committed.lines()).position(|(a, b)| a != b);
    let first = first.unwrap_or(made.lines().count().min(committed.lines().count()));
    assert!(
        made == committed,
        "include/contactd.h is not what the sources make, from line {}: write it anew with \
         CONTACTD_WRITE_HEADER=1 cargo test -p contactd-capi --test header",
        first + 1
    );
}

#[test]
fn every_function_of_the_sources_is_declared() {
    let header = made();
    let mut functions = 0;
    // All that there are: one that is not among the header's would be missing there without a word.
    for path in sources_below(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src")) {
        let (name, text) = (path.display(), std::fs::read_to_string(&path).expect("a source"));
        for (at, _) in text.match_indices("extern \"C\" fn ") {
            let function = text[at..].split([' ', '(']).nth(3).expect("a name");
            assert!(header.contains(&format!("{function}(")), "{function} of {name} is not in the header");
            functions += 1;
        }
    }
    assert!(functions > 50, "{functions}");
}

fn sources_below(folder: &Path) -> Vec<PathBuf> {
    let each = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    each.flat_map(|path| if path.is_dir() { sources_below(&path) } else { vec![path] }).collect()
}
