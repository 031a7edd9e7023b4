//! Queries of one scene, each against a session that was made for it: whatever was asked before, on however many threads.
//!
//! `CONTACTD_BATCH=20000 cargo test --release -p contactd-tests --test models batch::` sets the number of queries (100 by default).

use contactd::batch::{Answers, Batch, BatchOptions, Row};
use contactd::import::{Facets, Scene};
use contactd::ipc::ServerConfig;
use contactd_client::{Error, Object, StepOptions};
use contactd_proto::{ContactRecord, DetailSlot, Pose, PoseRecord};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::DQuat;
use std::path::Path;
use std::time::Duration;

const MODELS: [(&str, &str); 4] = [
    ("plate", "difference() { cube([40, 40, 4], center = true); cylinder(h = 9, r = 3, center = true); }"),
    ("peg", "cylinder(h = 20, r1 = 2.5, r2 = 2.9, center = true);"),
    ("bush", "difference() { sphere(r = 6); cylinder(h = 20, r = 3, center = true); }"),
    ("block", "cube([6, 4, 5], center = true);"),
];

/// Objects: name, model, fixed, where they stand.
type Objects = Vec<(String, usize, bool, Pose)>;

fn pose(r: &mut Random, spread: f64) -> Pose {
    let position = r.direction() * r.within(0.0, spread);
    Pose::new(position, DQuat::from_axis_angle(r.direction(), r.within(0.0, 3.0)))
}

fn objects(r: &mut Random) -> Objects {
    let count = 3 + r.below(3);
    (0..count).map(|i| (format!("o{i}"), r.below(MODELS.len()), i == 0 && r.chance(0.6), pose(r, 25.0))).collect()
}

fn scene(folder: &Path, objects: &Objects) -> Scene {
    let mut text = String::new();
    for (name, solid) in MODELS {
        std::fs::write(folder.join(format!("{name}.csg")), solid).unwrap();
        text += &format!("[[model]]\nname = \"{name}\"\nfile = \"{name}.csg\"\n");
    }
    for (name, model, fixed, at) in objects {
        let (p, q) = (at.position.to_array(), at.rotation.to_array());
        let fixed = if *fixed { "motion = \"static\"\n" } else { "" };
        let model = MODELS[*model].0;
        text += &format!("[[object]]\nname = \"{name}\"\nmodel = \"{model}\"\n{fixed}");
        text += &format!("start = {{ position = {p:?}, rotation = {q:?} }}\n");
    }
    Scene::parse("scene.toml", &text, folder).unwrap()
}

/// A query, and what is wrong with it: a part of the sentence.
fn query(r: &mut Random, objects: &Objects) -> (Vec<PoseRecord>, Option<&'static str>) {
    let movable: Vec<u32> = (0..).zip(objects).filter(|(_, o)| !o.2).map(|(i, _)| i).collect();
    let mut records = Vec::new();
    let near = if r.chance(0.5) { 6.0 } else { 20.0 };
    for id in &movable {
        if r.chance(0.4) {
            continue;
        }
        let put = r.chance(0.6);
        if put {
            records.push(PoseRecord::start(*id, &pose(r, near)));
        }
        if !put || r.chance(0.8) {
            let to = pose(r, near);
            let turn = r.direction() * r.within(0.0, 8.0);
            records.push(if r.chance(0.3) {
                PoseRecord::turn(*id, to.position, turn)
            } else {
                PoseRecord::end(*id, &to)
            });
        }
    }
    let wrong = match r.below(12) {
        _ if records.is_empty() => None,
        0 => {
            records.push(PoseRecord { object: 77, ..records[0] });
            Some("object 77: ")
        }
        1 => {
            let at = r.below(records.len());
            records[at].position[r.below(3)] = f64::NAN;
            Some("object \"o")
        }
        2 => {
            records.push(records[0]);
            Some("object \"o")
        }
        _ => None,
    };
    (records, wrong)
}

/// What a session says that was made for a query.
fn alone(objects: &Objects, records: &[PoseRecord], options: &BatchOptions) -> Result<Answers, Error> {
    let mut session = contactd::embedded(&ServerConfig::default())?;
    for (at, (name, model, fixed, stands)) in (0..).zip(objects) {
        let (file, text) = MODELS[*model];
        let model = session.load_model(&format!("{file}.csg"), text)?;
        let object = Object::new(name, model.id).at(*stands);
        // Its ids count from another number: records below are told by places.
        let id = session.add_object(if *fixed { object.fixed() } else { object })?;
        assert_eq!(id, at + 1);
    }
    session.options = StepOptions {
        details: true,
        first: options.first,
        clear: options.clear,
        max_records: options.max_records,
        cell_limit: options.cell_limit as u32,
        batch_limit: options.batch_limit as u32,
        ..StepOptions::default()
    };
    let slots = session.begin_step(records.len())?;
    for (slot, record) in slots.iter_mut().zip(records) {
        *slot = PoseRecord { object: record.object + 1, ..*record };
    }
    let reply = session.finish(Duration::from_secs(60))?;
    let header = *reply.header();
    let row = Row {
        status: header.status,
        records: header.records,
        truncated: header.truncated != 0,
        safe_time: header.safe_time,
        cells: header.counters.cells,
        refusal: None,
    };
    let told = |i: usize| {
        let record: ContactRecord = reply.records()[i];
        ContactRecord { a: record.a - 1, b: record.b - 1, slot: 0, slots: 0, ..record }
    };
    let n = header.records as usize;
    let details: Vec<DetailSlot> = reply.records().iter().filter_map(|r| reply.detail(r).copied()).collect();
    Ok(Answers { rows: vec![row], records: (0..n).map(told).collect(), details })
}

#[test]
fn each_query_has_the_bits_of_a_session_that_was_made_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let all = sized("CONTACTD_BATCH", 100);
    let (mut r, mut asked, mut refused, mut met, mut limited) = (Random::new(12), 0, 0, 0, 0);
    while asked < all {
        let objects = objects(&mut r);
        let (batch, notes) = Batch::new(scene(folder.path(), &objects), None, Facets::Auto, None).unwrap();
        assert!(notes.iter().all(|n| n.contains(": no object is of the model ")), "{notes:?}");
        let (mut offsets, mut records, mut wrong) = (vec![0], Vec::new(), Vec::new());
        let mut last = query(&mut r, &objects);
        for _ in 0..80 {
            // What was asked before and is remembered would be known, whatever the limit.
            let (query, why) = if r.chance(0.2) { last.clone() } else { query(&mut r, &objects) };
            last = (query.clone(), why);
            records.extend(query);
            offsets.push(records.len());
            wrong.push(why);
        }
        let kinds = [
            BatchOptions::default(),
            BatchOptions { clear: true, ..BatchOptions::default() },
            BatchOptions { first: true, max_records: 1, ..BatchOptions::default() },
            // What such limits leave open depends on what is remembered.
            BatchOptions { cell_limit: 1, batch_limit: 1, ..BatchOptions::default() },
        ];
        let options = BatchOptions { threads: 1 + r.below(3), ..kinds[r.below(kinds.len())] };
        let Answers { rows, records: found, details } = batch.solve(&offsets, &records, &options);
        assert_eq!((rows.len(), found.len()), (80, details.len()));
        let mut first = 0;
        for (i, row) in rows.iter().enumerate() {
            let query = &records[offsets[i]..offsets[i + 1]];
            asked += 1;
            let n = row.records as usize;
            match (alone(&objects, query, &options), wrong[i]) {
                (Err(Error::Refused { code, .. }), Some(part)) => {
                    let sentence = row.refusal.as_deref().expect("a refusal");
                    assert!(sentence.starts_with(part) && sentence.ends_with(&code.to_string()), "{sentence}");
                    refused += 1;
                }
                (Ok(expected), None) => {
                    assert_eq!(*row, expected.rows[0], "query {i}: {query:?}");
                    let own = Answers {
                        rows: vec![row.clone()],
                        records: found[first..first + n].to_vec(),
                        details: details[first..first + n].to_vec(),
                    };
                    let bits = |a: &Answers| {
                        let slots = a.details.iter().map(|d| ContactRecord::from(*d));
                        let all: Vec<ContactRecord> = a.records.iter().copied().chain(slots).collect();
                        bytemuck::cast_slice::<_, u8>(&all).to_vec()
                    };
                    assert_eq!(bits(&own), bits(&expected), "query {i}: {query:?}");
                    met += n;
                    limited += usize::from(row.status == contactd_proto::step::STEP_UNDECIDED);
                }
                (other, why) => panic!("query {i}: {other:?}, {why:?}, {row:?}"),
            }
            first += n;
        }
    }
    println!("{asked} queries, {met} records, {refused} refused, {limited} left open by a limit");
    assert!(met > all / 4 && refused > all / 20 && limited > 0, "{met} {refused} {limited}");
}

#[test]
fn a_key_changes_with_all_that_answers_depend_on() {
    let folder = tempfile::tempdir().unwrap();
    let mut r = Random::new(3);
    let objects = objects(&mut r);
    let key = |objects: &Objects, resolution| {
        Batch::new(scene(folder.path(), objects), None, Facets::Auto, resolution).unwrap().0.key().to_owned()
    };
    let before = key(&objects, None);
    assert_eq!(key(&objects, None), before);
    assert_ne!(key(&objects, Some(1e-4)), before);
    let changes: [fn(&mut Objects); 4] = [
        |o| o[1].3.position.x = o[1].3.position.x.next_up(),
        |o| o[1].1 = (o[1].1 + 1) % MODELS.len(),
        |o| o[0].2 = !o[0].2,
        |o| o[2].0 = "another".into(),
    ];
    for change in changes {
        let mut other = objects.clone();
        change(&mut other);
        assert_ne!(key(&other, None), before);
    }
}
