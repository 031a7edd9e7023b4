//! Whatever lies in the folder, what comes back is what a fresh import gives, or it is imported again.

use super::file::{FORMAT, PROGRAM, seal, sealed, unseal};
use super::*;
use crate::import::{FORMATS, Format};
use crate::solid::primitive::Sphere;
use crate::solid::{Label, Op, SolidBuilder};
use contactd_proto::Pose;
use glam::DVec3;
use std::sync::atomic::AtomicUsize;

/// All kinds of primitives and operations, with a note: a cylinder of six sides.
const PART: &str = "difference() {
  union() { cube(size = [4, 4, 1], center = true); sphere(r = 1.2); cylinder(h = 3, r1 = 1, r2 = 0.5); }
  intersection() { cylinder(h = 9, r1 = 0.5, r2 = 0.5, center = true); cube(size = [inf, inf, 1], center = true); }
  multmatrix([[0, -1, 0, 1.5], [1, 0, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]]) { cylinder($fn = 6, h = 9, r1 = 0.3, r2 = 0.3); }
}
";

const BALL: &str = "sphere(r = 1);";

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

fn cache(folder: &Path) -> Cache {
    Cache::open(folder, DEFAULT_BYTES).expect("a cache")
}

fn key_of(format: &Format, text: &str, facets: Facets, limits: &Limits) -> Key {
    Key::of(format, text.as_bytes(), facets, limits)
}

fn key(text: &str) -> Key {
    key_of(&FORMATS[0], text, Facets::Auto, &Limits::default())
}

fn prepared(cache: Option<&Cache>, text: &str) -> Prepared {
    prepare(cache, &Source::named("part.csg", text.as_bytes()), Facets::Auto, &Limits::default()).expect("a valid text")
}

/// All there is to say of a model, every bit of its numbers.
fn all(p: &Prepared) -> String {
    format!("{:?} {:?}", p.model, p.notes)
}

/// That a cache builds the model anew and puts a good file in the bad one's place.
fn mends(cache: &Cache, text: &str, good: &[u8], trouble: bool, what: &str) {
    let again = prepared(Some(cache), text);
    assert_eq!(again.origin, Origin::Built, "{what}");
    assert_eq!(again.trouble.is_some(), trouble, "{what}: {:?}", again.trouble);
    assert!(fs::read(cache.path(&key(text))).expect("its file") == good, "{what}");
}

#[test]
fn a_kept_model_is_the_built_one_bit_for_bit() {
    let folder = folder();
    let cache = cache(&folder.path().join("not/there/yet"));
    let fresh = prepared(None, PART);
    let nodes = fresh.model.octree.census().nodes();
    assert!(!fresh.notes.is_empty() && nodes > 1000, "{:?}, {nodes} nodes", fresh.notes);
    let (first, second) = (prepared(Some(&cache), PART), prepared(Some(&cache), PART));
    assert_eq!((first.origin, second.origin), (Origin::Built, Origin::Kept));
    assert!(all(&fresh) == all(&first) && all(&fresh) == all(&second));
    assert_eq!((first.trouble, second.trouble), (None, None));
    let mode = fs::metadata(cache.path(&key(PART)).parent().expect("a folder")).expect("a folder").permissions().mode();
    assert_eq!(mode & 0o777, 0o700);
}

#[test]
fn a_key_is_told_apart_by_all_that_decides_the_import() {
    let limits = Limits::default();
    // Of as many letters.
    let another = Format { name: "gsc", ..FORMATS[0] };
    let keys = [
        key_of(&FORMATS[0], BALL, Facets::Auto, &limits),
        key_of(&another, BALL, Facets::Auto, &limits),
        key_of(&FORMATS[0], "sphere(r = 1); ", Facets::Auto, &limits),
        key_of(&FORMATS[0], BALL, Facets::Exact, &limits),
        key_of(&FORMATS[0], BALL, Facets::AsWritten, &limits),
        key_of(&FORMATS[0], BALL, Facets::Auto, &Limits { bytes: 5, ..limits }),
        key_of(&FORMATS[0], BALL, Facets::Auto, &Limits { nodes: 5, ..limits }),
        key_of(&FORMATS[0], BALL, Facets::Auto, &Limits { depth: 5, ..limits }),
        key_of(&FORMATS[0], BALL, Facets::Auto, &Limits { faces: 5, ..limits }),
        key_of(&FORMATS[0], BALL, Facets::Auto, &Limits { polyhedron_faces: 5, ..limits }),
        key_of(&FORMATS[0], BALL, Facets::Auto, &Limits { hull_faces: 5, ..limits }),
        key_of(&FORMATS[0], BALL, Facets::Auto, &Limits { values: 5, ..limits }),
    ];
    for (i, a) in keys.iter().enumerate() {
        assert!(keys[..i].iter().all(|b| a != b && a.to_string() != b.to_string()), "{i}");
    }
    assert_eq!(key(BALL), keys[0]);
    // What is kept of a text is of no use where the text would be refused.
    let folder = folder();
    let cache = cache(folder.path());
    prepared(Some(&cache), PART);
    let narrow = Limits { faces: 5, ..limits };
    assert!(prepare(Some(&cache), &Source::named("part.csg", PART.as_bytes()), Facets::Auto, &narrow).is_err());
}

#[test]
fn damage_at_any_byte_and_any_cut_is_noticed() {
    let folder = folder();
    let cache = cache(folder.path());
    prepared(Some(&cache), BALL);
    let good = fs::read(cache.path(&key(BALL))).expect("its file");
    assert!(unseal(&good, &key(BALL)).is_ok());
    for at in 0..good.len() {
        for flip in [1, 0x80, 0xff] {
            let mut bad = good.clone();
            bad[at] ^= flip;
            assert!(unseal(&bad, &key(BALL)).is_err(), "byte {at} of {}", good.len());
        }
        assert!(unseal(&good[..at], &key(BALL)).is_err(), "cut at {at}");
        let mut twice = good.clone();
        twice.insert(at, good[at]);
        assert!(unseal(&twice, &key(BALL)).is_err(), "byte {at} twice");
    }
    assert!(unseal(&[good.as_slice(), b"\0"].concat(), &key(BALL)).is_err());
}

#[test]
fn bad_files_of_all_kinds_are_replaced() {
    let folder = folder();
    let cache = cache(folder.path());
    prepared(Some(&cache), PART);
    let path = cache.path(&key(PART));
    let good = fs::read(&path).expect("its file");
    let content = unseal(&good, &key(PART)).expect("its content");
    let (ball, other) = (encode(&prepared(None, BALL).model, &[]).expect("a content"), key(BALL));
    let mut own = *PROGRAM;
    own[0] ^= 1;
    let flipped = |at: usize| {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        bad
    };
    // Magic 0-7, format 8-11, checksum 12-43, program 44-107, key 108-139, content from 140.
    let bad = [
        ("the magic number", flipped(3), true),
        ("the format's number", flipped(9), false),
        ("the checksum", flipped(20), true),
        ("the program", flipped(60), true),
        ("the key", flipped(120), true),
        ("the first byte of the content", flipped(140), true),
        ("the middle of the content", flipped(good.len() / 2), true),
        ("the last byte", flipped(good.len() - 1), true),
        ("half of it", good[..good.len() / 2].to_vec(), true),
        ("its header alone", good[..140].to_vec(), true),
        ("nothing", vec![], true),
        ("a text", PART.into(), true),
        ("an older format", sealed(FORMAT - 1, PROGRAM, &key(PART), content), false),
        ("a later format", sealed(FORMAT + 1, PROGRAM, &key(PART), content), false),
        ("another program", sealed(FORMAT, &own, &key(PART), content), false),
        ("another text's file", seal(&other, &ball), true),
        ("no content, well sealed", seal(&key(PART), &[]), true),
        ("half a content, well sealed", seal(&key(PART), &content[..content.len() / 2]), true),
        ("more content, well sealed", seal(&key(PART), &[content, b"\0"].concat()), true),
    ];
    for (what, bytes, trouble) in bad {
        fs::write(&path, bytes).expect("a bad file");
        mends(&cache, PART, &good, trouble, what);
        assert_eq!(prepared(Some(&cache), PART).origin, Origin::Kept, "{what}");
    }
    // No file at all: a folder, which can't be replaced by renaming, and is left there.
    fs::remove_file(&path).expect("a good file");
    fs::create_dir(&path).expect("a folder");
    let built = prepared(Some(&cache), PART);
    assert_eq!((built.origin, all(&built)), (Origin::Built, all(&prepared(None, PART))));
    assert!(built.trouble.is_some_and(|t| t.contains("expected to keep a model")));
    assert_eq!(fs::read_dir(folder.path()).expect("the cache").count(), 1, "no unfinished file is left");
}

/// Asks a model that was read whatever would follow an index of it.
fn asked(model: &Model) {
    fn visit(model: &Model, node: &crate::octree::Node, out: &mut Vec<u32>) {
        out.clear();
        let mut tokens = vec![];
        model.literals(node, 0.0, &mut tokens);
        out.extend(node.refs());
        for c in node.children().into_iter().flatten() {
            visit(model, c, out);
        }
    }
    for x in [DVec3::ZERO, DVec3::new(0.3, -1.0, 0.2)] {
        model.solid.value(x);
        model.octree.locate(x);
    }
    visit(model, model.octree.root(), &mut vec![]);
}

#[test]
fn well_sealed_nonsense_is_refused_or_a_model_that_can_be_asked() {
    // Few levels, so that every byte can be tried.
    let p = prepared(None, "difference() { cube(size = [4, 4, 1], center = true); sphere(r = 1); }");
    let shallow = Model::with_limits(p.model.solid.clone(), crate::octree::Limits::to_depth(1));
    let content = encode(&shallow, &prepared(None, PART).notes).expect("a content");
    let (mut refused, mut read) = (0, 0);
    for at in 0..content.len() {
        for value in [0, 1, 2, 7, 0x7f, 0x80, 0xfb, 0xfc, 0xfd, 0xff] {
            let mut other = content.clone();
            other[at] = value;
            match decode(&other) {
                Ok((model, _)) => {
                    asked(&model);
                    read += 1;
                }
                Err(Flaw::Content(_)) => refused += 1,
                Err(e) => panic!("{e}"),
            }
        }
        assert!(matches!(decode(&content[..at]), Err(Flaw::Content(_))), "cut at {at}");
    }
    // Other coordinates make another model; other counts, indices and kinds make none.
    assert!(refused > 1000 && read > 1000, "{refused} refused, {read} read");
}

#[test]
fn writers_and_readers_at_once_never_see_half_a_file() {
    let folder = folder();
    let texts: Vec<String> = (1..4).map(|i| format!("difference() {{ sphere(r = {i}); cube([1, 1, 9]); }}")).collect();
    let fresh: Vec<String> = texts.iter().map(|t| all(&prepared(None, t))).collect();
    let kept = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for writer in 0..4 {
            let (texts, fresh, kept, path) = (&texts, &fresh, &kept, folder.path());
            scope.spawn(move || {
                // A cache of its own, as another process has.
                let cache = cache(path);
                for round in 0..40 {
                    let i = (round + writer) % texts.len();
                    let p = prepared(Some(&cache), &texts[i]);
                    assert!(p.trouble.is_none(), "{:?}", p.trouble);
                    assert!(all(&p) == fresh[i]);
                    kept.fetch_add(usize::from(p.origin == Origin::Kept), Ordering::Relaxed);
                    match round % 4 {
                        0 => cache.write(&key(&texts[i]), &p.model, &p.notes).expect("a file"),
                        1 => drop(fs::remove_file(cache.path(&key(&texts[i])))),
                        _ => {}
                    }
                }
            });
        }
    });
    assert!(kept.into_inner() > 10, "the writers saw little of each other");
    let names: Vec<_> = fs::read_dir(folder.path()).expect("the cache").flatten().map(|e| e.file_name()).collect();
    assert!(names.len() <= 3, "no unfinished file is left: {names:?}");
}

#[test]
fn a_folder_that_cannot_be_used_is_a_sentence_and_nothing_more() {
    let folder = folder();
    let file = folder.path().join("file");
    fs::write(&file, "").expect("a file");
    for no_folder in [file.clone(), file.join("below")] {
        let sentence = Cache::open(&no_folder, DEFAULT_BYTES).expect_err("no folder");
        assert!(sentence.contains("expected a folder for preprocessed models, found "), "{sentence}");
    }
    let open = folder.path().join("open");
    fs::create_dir(&open).expect("a folder");
    fs::set_permissions(&open, fs::Permissions::from_mode(0o777)).expect("its owner");
    assert!(Cache::open(&open, DEFAULT_BYTES).expect_err("open to all").contains("all users may write"));
    // One that nobody can write to, the administrator neither: it is gone. Told once.
    let lost = folder.path().join("lost");
    let gone = cache(&lost);
    fs::remove_dir(&lost).expect("an empty folder");
    let (first, second) = (prepared(Some(&gone), PART), prepared(Some(&gone), PART));
    assert_eq!((first.origin, second.origin), (Origin::Built, Origin::Built));
    assert!(first.trouble.is_some_and(|t| t.contains("expected to keep a model, found ")) && second.trouble.is_none());
    assert!(all(&second) == all(&prepared(None, PART)));
}

#[test]
fn a_folder_that_is_only_read_serves_what_it_has() {
    let folder = folder();
    prepared(Some(&cache(folder.path())), PART);
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o500)).expect("its owner");
    let cache = cache(folder.path());
    assert_eq!(prepared(Some(&cache), PART).origin, Origin::Kept);
    let ball = prepared(Some(&cache), BALL);
    assert_eq!(ball.origin, Origin::Built);
    // The administrator writes there nonetheless.
    let may_write = fs::write(folder.path().join("x"), "").is_ok();
    assert_eq!(ball.trouble.is_some(), !may_write);
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o700)).expect("its owner");
}

#[test]
fn what_was_used_longest_ago_makes_room() {
    let folder = folder();
    let texts = ["sphere(r = 1);", "sphere(r = 2);", "sphere(r = 3);"];
    let large = cache(folder.path());
    prepared(Some(&large), texts[0]);
    let one = fs::metadata(large.path(&key(texts[0]))).expect("its file").len();
    let small = Cache::open(folder.path(), 2 * one + one / 2).expect("a cache");
    let age = |text: &str, seconds: u64| {
        let file = File::open(small.path(&key(text))).expect("its file");
        file.set_modified(SystemTime::now() - Duration::from_secs(seconds)).expect("its owner");
    };
    prepared(Some(&small), texts[1]);
    age(texts[0], 200);
    age(texts[1], 100);
    // Used again, so that the other is the older one.
    assert_eq!(prepared(Some(&small), texts[0]).origin, Origin::Kept);
    prepared(Some(&small), texts[2]);
    let there = texts.map(|t| small.path(&key(t)).exists());
    assert_eq!(there, [true, false, true]);
    // Larger than all there may be: not kept, and nothing else goes for it.
    let tiny = Cache::open(folder.path(), one / 2).expect("a cache");
    assert_eq!(prepared(Some(&tiny), PART).trouble, None);
    assert!(!tiny.path(&key(PART)).exists() && tiny.path(&key(texts[2])).exists());
}

#[test]
fn what_a_killed_process_left_is_swept_and_nothing_else() {
    let folder = folder();
    let [abandoned, young, foreign] = [".contactd-a.tmp", ".contactd-b.tmp", "c.tmp"].map(|n| folder.path().join(n));
    for path in [&abandoned, &young, &foreign] {
        fs::write(path, "x").expect("a file");
    }
    for path in [&abandoned, &foreign] {
        let past = SystemTime::now() - 2 * ABANDONED;
        File::options().write(true).open(path).expect("a file").set_modified(past).expect("its owner");
    }
    cache(folder.path());
    assert!(!abandoned.exists() && young.exists() && foreign.exists());
}

#[test]
fn models_of_one_text_in_a_scene_are_one() {
    let folder = folder();
    for (file, text) in [("a.csg", PART), ("b.csg", PART), ("c.csg", BALL)] {
        fs::write(folder.path().join(file), text).expect("a file");
    }
    let models = ["a", "b", "c"].map(|m| format!("[[model]]\nname = \"{m}\"\nfile = \"{m}.csg\"\n")).concat();
    fs::write(folder.path().join("s.toml"), models).expect("a file");
    let scene = crate::import::read_scene(&folder.path().join("s.toml")).expect("a scene");
    let p = prepare_scene(None, &scene, Facets::Auto, &Limits::default()).expect("its models");
    assert!(Arc::ptr_eq(&p[0].model, &p[1].model) && !Arc::ptr_eq(&p[0].model, &p[2].model));
}

#[test]
fn a_tree_too_deep_to_be_read_again_is_not_kept() {
    let built = |levels: usize| {
        let mut b = SolidBuilder::new();
        let ball = |b: &mut SolidBuilder| b.primitive(Sphere { radius: 1.0 }, Pose::IDENTITY, Label::default());
        let mut root = ball(&mut b);
        for level in 1..levels {
            let other = ball(&mut b);
            // Alternating, so that no level is folded away; what is subtracted leaves nothing to decompose.
            root = b.operation(if level % 2 == 0 { Op::Union } else { Op::Difference }, &[other, root]);
        }
        Model::with_limits(b.finish(root), crate::octree::Limits::to_depth(0))
    };
    let work = move || (encode(&built(100), &[]).is_some(), encode(&built(2001), &[]).is_some());
    let thread = std::thread::Builder::new().stack_size(256 << 20).spawn(work).expect("a thread");
    assert_eq!(thread.join().expect("an answer"), (true, false));
}
