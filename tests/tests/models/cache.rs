//! Models that are built on any number of threads, or read from their bytes, are the same models: every bit of them, and
//! every bit of what they answer. `CONTACTD_TREES` sets the number of random pairs (`CONTACTD_TREES=80`).

use contactd::cache::{decode, encode};
use contactd::contact::Outcome;
use contactd::import::{self, Facets, read_model};
use contactd::octree::{Limits, Model, Node};
use contactd::solid::{Op, Solid, SolidBuilder};
use contactd::world::{MeasuredModel, ObjectSpec, World};
use contactd_proto::Pose;
use contactd_tests::engine::ask_models;
use contactd_tests::random_solids::{Random, perforated_plate, placed, solid};
use contactd_tests::scenes::Recipe;
use contactd_tests::sweep::sized;
use glam::DVec3;
use std::path::Path;
use std::sync::mpsc::channel;
use std::sync::{Arc, RwLock};

/// All there is to say of a model: `Debug` prints every field, and numbers so that they come back as they were.
fn all(model: &Model) -> String {
    format!("{model:?}")
}

/// A model that has gone through its bytes; `notes` is what its import had to say.
fn kept(model: &Model, notes: &[import::Note]) -> Model {
    let bytes = encode(model, notes).expect("a tree of few levels");
    let (back, back_notes) = decode(&bytes).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(back_notes, notes);
    assert!(encode(&back, notes).as_ref() == Some(&bytes), "the same bytes again");
    back
}

/// Every bit of an answer, counters too: the trees and octrees must be the same ones.
fn bits(o: &Outcome) -> String {
    format!("{o:?}")
}

#[test]
fn the_projects_models_come_back_bit_for_bit() {
    let mut models = 0;
    let is_long = std::env::var_os("CONTACTD_TREES").is_some();
    for folder in ["../server/models", "models", "openscad"] {
        let mut files: Vec<_> = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder))
            .expect("the models")
            .map(|f| f.expect("a file").path())
            .collect();
        files.sort();
        for (i, path) in files.iter().filter(|f| f.extension().is_some_and(|e| e == "csg")).enumerate() {
            // Read as it is by default, and in one of the other two ways: one in three of them, or all in the long form.
            let other = [Facets::Exact, Facets::AsWritten][i % 2];
            for facets in [Facets::Auto, other].into_iter().take(if is_long || i % 3 == 0 { 2 } else { 1 }) {
                let Ok(import) = read_model(path, facets, &import::Limits::default()) else { continue };
                let model = Model::new(import.solid);
                assert!(all(&kept(&model, &import.notes)) == all(&model), "{}, {facets:?}", path.display());
                models += 1;
            }
        }
    }
    assert!(models >= 30, "{models}");
}

#[test]
fn random_solids_come_back_and_answer_as_before() {
    let mut r = Random::new(71);
    let mut met = 0;
    let count = sized("CONTACTD_TREES", 10);
    for i in 0..count {
        let models = [1 + i % 4, 1 + i % 3].map(|depth| Model::new(solid(&mut r, depth)));
        let back = models.each_ref().map(|m| kept(m, &[]));
        for (model, back) in models.iter().zip(&back) {
            assert!(all(model) == all(back), "solid {i}");
        }
        for _ in 0..3 {
            let [a, b] = [placed(&mut r, 2.5), placed(&mut r, 2.5)];
            let fresh = ask_models((&models[0], a), (&models[1], b), None);
            let again = ask_models((&back[0], a), (&back[1], b), None);
            assert_eq!(bits(&fresh), bits(&again), "solid {i}");
            met += usize::from(fresh.counters.cells > 0);
        }
        // Searches have decomposed voxels on either side; what is written is what was built at load, as before.
        for (model, back) in models.iter().zip(&back) {
            assert!(encode(model, &[]) == encode(&Model::new(model.solid.clone()), &[]), "solid {i}");
            assert!(encode(model, &[]) == encode(back, &[]), "solid {i}");
        }
    }
    assert!(8 * met > 3 * count, "{met} of {} questions needed cells", 3 * count);
}

/// A union of balls in a chain of nested unions: as many levels as balls.
fn chain(count: usize) -> Solid {
    let mut b = SolidBuilder::new();
    let ball = |b: &mut SolidBuilder, i: usize| {
        let at = Pose::at(DVec3::new(0.7 * i as f64, (i % 7) as f64 * 0.1, 0.0));
        b.primitive(contactd::solid::primitive::Sphere { radius: 0.5 }, at, Default::default())
    };
    let mut root = ball(&mut b, 0);
    for i in 1..count {
        let next = ball(&mut b, i);
        root = b.operation(if i % 3 == 0 { Op::Difference } else { Op::Union }, &[root, next]);
    }
    b.finish(root)
}

#[test]
fn any_number_of_threads_builds_the_same_bits() {
    let mut r = Random::new(5);
    // The first two are large enough to be shared: flat levels of thousands of nodes, and a tall tree.
    let mut solids = vec![perforated_plate(28), chain(300), perforated_plate(3)];
    solids.extend((0..8).map(|i| solid(&mut r, 2 + i % 3)));
    let build = |threads: usize| -> Vec<String> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| solids.iter().map(|s| all(&Model::new(s.clone()))).collect())
    };
    let one = build(1);
    for threads in [2, 5] {
        for (i, (a, b)) in one.iter().zip(build(threads)).enumerate() {
            assert!(*a == b, "solid {i} on {threads} threads");
        }
    }
}

/// The nodes of a subtree, those that searches have made too.
fn nodes(node: &Node) -> usize {
    1 + node.children().into_iter().flatten().map(nodes).sum::<usize>()
}

#[test]
fn a_kept_octree_goes_on_refining_like_a_fresh_one() {
    let fresh = Model::with_limits(perforated_plate(2), Limits::to_depth(2));
    let back = kept(&fresh, &[]);
    fn expand(model: &Model, node: &Node, depth: u8) {
        if node.depth() < depth {
            model.expand(node).into_iter().flatten().for_each(|c| expand(model, c, depth));
        }
    }
    let before = nodes(back.octree.root());
    for model in [&fresh, &back] {
        expand(model, model.octree.root(), 4);
    }
    assert!(nodes(back.octree.root()) > 2 * before);
    assert!(all(&fresh) == all(&back));
}

#[test]
fn what_searches_make_on_demand_is_made_without_other_threads() {
    // They make it within a lock: a thread that waited there for others could take up another search that asks for the
    // same. So all others are held up here, and still it is made.
    let model = Arc::new(Model::with_limits(perforated_plate(24), Limits::to_depth(0)));
    let (held, hold) = (Arc::new(RwLock::new(())), channel());
    let release = held.write().expect("nobody has it");
    {
        let (held, holding) = (held.clone(), hold.0);
        rayon::spawn_broadcast(move |_| {
            holding.send(()).expect("the test");
            drop(held.read());
        });
    }
    for _ in 0..rayon::current_num_threads() {
        hold.1.recv().expect("a thread");
    }
    let (done, finished) = channel();
    std::thread::spawn(move || {
        let wide = model.bounds_for(0.5 * model.radius);
        let children = model.expand(model.octree.root()).expect("a mixed root");
        let deeper = children.iter().filter_map(|c| model.expand(c)).count();
        done.send((wide.margin() > model.margin(), wide.primitives_left(&model.solid), deeper)).expect("the test");
    });
    let made = finished.recv_timeout(std::time::Duration::from_secs(30));
    drop(release);
    assert_eq!(made, Ok((true, 1153, 8)));
}

#[test]
fn a_thousand_instances_are_one_model() {
    let model = Arc::new(Model::new(Recipe::cuboid(0.5, 0.5, 0.1).minus(Recipe::cylinder(0.25, 0.5)).build()));
    let part = Arc::new(MeasuredModel::new(model.clone()));
    let mut world = World::new(1000, 1000);
    for id in 0..1000 {
        let at = Pose::at(DVec3::new(2.0 * f64::from(id), 0.0, 0.0));
        world.add_object(ObjectSpec::new(id, &part, at)).expect("an object");
    }
    assert!(world.bodies().iter().all(|b| Arc::ptr_eq(&b.part.model, &model) && Arc::ptr_eq(&b.part, &part)));
    // The part's own reference and this one; what a search learns of the model, all of them have learnt.
    assert_eq!(Arc::strong_count(&model), 2);
}
