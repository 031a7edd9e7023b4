//! Recordings: repeated to the bit, cut short, damaged, left out of, and looked at by others.

#[path = "recording/following.rs"]
mod following;
#[allow(dead_code, reason = "other tests use the rest of it")]
mod harness;
#[path = "recording/numbers.rs"]
mod numbers;
#[path = "recording/pictures.rs"]
mod pictures;
#[path = "recording/processes.rs"]
mod processes;

use contactd::ipc::{Embedded, ServerConfig};
use contactd::recording::{Entry, Recording};
use contactd::replay::{replay, scene_of};
use contactd_client::proto::control::{Facets, ModelFile};
use contactd_client::proto::{Detect, ErrorCode, InitialOverlap, Pose, PoseRecord, Report, Rule, StepRequest};
use contactd_client::{Object, Session, StepOptions, Transport};
use glam::DVec3;
use harness::{PATIENCE, runtime_folder};
use numbers::Numbers;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// Models of every kind of face, solid and file: name and text.
const MODELS: [(&str, &str); 14] = [
    ("ball.csg", "sphere($fn = 0, r = 1);"),
    ("box.csg", "cube(size = [2, 1, 0.5], center = true);"),
    ("cone.csg", "cylinder($fn = 0, h = 2, r1 = 1, r2 = 0.3, center = true);"),
    ("pin.csg", "cylinder($fn = 0, h = 3, r1 = 0.4, r2 = 0.4, center = true);"),
    ("prism.csg", "cylinder($fn = 6, h = 1, r1 = 1, r2 = 1, center = true);"),
    ("egg.csg", "multmatrix([[1.5,0,0,0],[0,1,0,0],[0,0,0.7,0],[0,0,0,1]]) { sphere($fn = 0, r = 0.8); }"),
    (
        "plate.csg",
        "difference() { cube(size = [6, 6, 1], center = true); cylinder($fn = 0, h = 9, r1 = 0.6, r2 = 0.6, center = true);
         multmatrix([[1,0,0,2],[0,1,0,1],[0,0,1,0],[0,0,0,1]]) { cylinder($fn = 0, h = 3, r1 = 0.3, r2 = 0.8, center = true); } }",
    ),
    ("lens.csg", "intersection() { sphere($fn = 0, r = 1); cube(size = [3, 3, 0.8], center = true); }"),
    ("ring.csg", "rotate_extrude($fn = 0, angle = 360) { multmatrix([[1,0,0,1],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) { circle($fn = 0, r = 0.3); } }"),
    ("bar.csg", "linear_extrude(height = 1, center = true) { polygon(points = [[0,0],[2,0],[2,0.5],[0.5,0.5],[0.5,2],[0,2]]); }"),
    ("tetra.csg", "polyhedron(points = [[0,0,0],[2,0,0],[0,2,0],[0,0,2]], faces = [[0,1,2],[0,3,1],[0,2,3],[1,3,2]]);"),
    ("hull.csg", "hull() { cube(size = [1, 1, 1]); multmatrix([[1,0,0,2],[0,1,0,0],[0,0,1,0],[0,0,0,1]]) { cube(size = [0.5, 0.5, 0.5]); } }"),
    ("wedge.off", "OFF\n6 5 0\n0 0 0\n2 0 0\n2 1 0\n0 1 0\n0 0 1\n0 1 1\n4 0 3 2 1\n4 0 1 2 3\n"),
    ("part.csg", "import(file = \"below/part.off\");"),
];

/// An L, as a mesh that is not convex.
const ELL: &str = "OFF\n12 8 0\n0 0 0\n2 0 0\n2 1 0\n1 1 0\n1 2 0\n0 2 0\n0 0 1\n2 0 1\n2 1 1\n1 1 1\n1 2 1\n0 2 1\n6 5 4 3 2 1 0\n\
    6 6 7 8 9 10 11\n4 0 1 7 6\n4 1 2 8 7\n4 2 3 9 8\n4 3 4 10 9\n4 4 5 11 10\n4 5 0 6 11\n";

/// A folder with the file that a model names, and the settings of an engine that may read it.
fn with_root(folder: &Path) -> ServerConfig {
    std::fs::create_dir_all(folder.join("below")).unwrap();
    std::fs::write(folder.join("below/part.off"), ELL).unwrap();
    ServerConfig { import_root: Some(folder.to_path_buf()), ..ServerConfig::default() }
}

/// What may happen in a session, drawn: models are loaded, objects come and go, rules change, bodies are put and moved.
struct Play {
    r: Numbers,
    models: Vec<u32>,
    objects: Vec<u32>,
    fixed: Vec<u32>,
}

impl Play {
    fn new(seed: u64) -> Self {
        Self { r: Numbers::new(seed), models: vec![], objects: vec![], fixed: vec![] }
    }

    fn pose(&mut self) -> Pose {
        let at = self.r.vector() * 3.0;
        let rotation = if self.r.below(3) == 0 { glam::DQuat::IDENTITY } else { self.r.rotation() };
        Pose::new(at, rotation)
    }

    fn load<T: Transport>(&mut self, session: &mut Session<T>) {
        let (name, text) = MODELS[self.r.below(MODELS.len() as u64) as usize];
        let text = if name.ends_with(".off") { ELL } else { text };
        let facets = [Facets::Auto, Facets::Exact, Facets::AsWritten][self.r.below(3) as usize];
        let file = ModelFile::new(name, "", text);
        self.models.push(session.load_model_file(file, facets).unwrap_or_else(|e| panic!("{name}: {e}")).id);
    }

    fn add<T: Transport>(&mut self, session: &mut Session<T>) {
        let model = self.models[self.r.below(self.models.len() as u64) as usize];
        // Names may be empty and may be those of others.
        let name = ["", "part", "other \"part\"", "x"][self.r.below(4) as usize];
        let group = ["default", "cell"][self.r.below(2) as usize];
        let mut object = Object::new(name, model).group(group).at(self.pose());
        if self.r.below(3) == 0 {
            object = object.place(self.pose());
        }
        let fixed = self.r.below(6) == 0;
        object = if fixed { object.fixed() } else { object };
        object = if self.r.below(12) == 0 { object.without_rotation() } else { object };
        object = if self.r.below(12) == 0 { object.max_speed(1e6) } else { object };
        let id = session.add_object(object).expect("an object");
        if fixed { self.fixed.push(id) } else { self.objects.push(id) }
    }

    fn rules<T: Transport>(&mut self, session: &mut Session<T>) {
        let r = &mut self.r;
        let mut rules = Vec::new();
        for between in [["default", "default"], ["default", "cell"], ["cell", "cell"]] {
            if r.below(6) == 0 {
                continue;
            }
            rules.push(Rule {
                detect: [Detect::Continuous, Detect::Continuous, Detect::Discrete][r.below(3) as usize],
                report: Report::ALL[r.below(4) as usize],
                penetration: r.below(3) == 0,
                margin: if r.below(2) == 0 { 0.0 } else { 0.1 },
                initial_overlap: InitialOverlap::ALL[r.below(2) as usize],
                sensor: r.below(6) == 0,
                except: if r.below(4) == 0 { vec![["part".into(), "x".into()]] } else { vec![] },
                ..Rule::new(between.map(String::from))
            });
        }
        session.set_rules(&rules).expect("rules");
    }

    fn begin<T: Transport>(&mut self, session: &mut Session<T>) {
        (0..4).for_each(|_| self.load(session));
        (0..5).for_each(|_| self.add(session));
        self.rules(session);
    }

    /// One step, and what changes before it; false for one that is refused.
    fn step<T: Transport>(&mut self, session: &mut Session<T>) -> bool {
        match self.r.below(40) {
            0 => self.load(session),
            1 if self.objects.len() < 9 => self.add(session),
            2 if self.objects.len() > 2 => {
                let k = self.r.below(self.objects.len() as u64) as usize;
                session.remove_object(self.objects.swap_remove(k)).expect("an object");
            }
            3 => self.rules(session),
            4 => {
                let resolution = [None, Some(1e-6), Some(1e-8)][self.r.below(3) as usize];
                session.set_resolution(resolution).expect("a resolution");
            }
            _ => {}
        }
        let r = &mut self.r;
        session.options = StepOptions {
            advance: [1.0, 1.0, 1.0, 0.0, 0.3][r.below(5) as usize],
            dt: [0.0, 0.01][r.below(2) as usize],
            first: r.below(5) == 0,
            details: r.below(2) == 0,
            clear: r.below(4) == 0,
            polling: false,
            max_records: [0, 0, 2][r.below(3) as usize],
            // Limits that cut: what is left open must be left open again.
            cell_limit: [2000, 2000, 300, 20][r.below(4) as usize],
            batch_limit: [0, 0, 0, 400][r.below(4) as usize],
        };
        let mut records = Vec::new();
        for id in self.objects.clone() {
            if self.r.below(4) == 0 {
                continue;
            }
            if self.r.below(6) == 0 {
                records.push(PoseRecord::start(id, &self.pose()));
            }
            records.push(match self.r.below(3) {
                0 => PoseRecord::turn(id, self.pose().position, self.r.vector() * 4.0),
                _ => PoseRecord::end(id, &self.pose()),
            });
        }
        let bad = self.r.below(25) == 0;
        if bad {
            let stranger = PoseRecord::end(9999, &Pose::IDENTITY);
            let fixed = self.fixed.first().map_or(stranger, |id| PoseRecord::end(*id, &Pose::at(DVec3::X)));
            records.push(if self.r.below(2) == 0 { stranger } else { fixed });
        }
        session.begin_step(records.len()).expect("slots").copy_from_slice(&records);
        match session.finish(PATIENCE).map(|_| ()) {
            Ok(()) => true,
            Err(e) => {
                let code = e.code().expect("a refusal");
                assert!(bad || code == ErrorCode::Declaration, "{e}");
                false
            }
        }
    }
}

/// `CONTACTD_RECORDED_STEPS` is how many steps are recorded in all; in the test command a few.
fn steps() -> u64 {
    std::env::var("CONTACTD_RECORDED_STEPS").map_or(96, |n| n.parse().expect("a number of steps"))
}

#[test]
fn random_sessions_are_repeated_bit_for_bit() {
    let folder = runtime_folder();
    let config = with_root(folder.path());
    // Short and many: what an opening leaves out is seen by the first steps behind it, if at all.
    let (each, sessions) = (steps() / 8, 8);
    let mut all = 0;
    for seed in 0..sessions {
        let path = folder.path().join(format!("{seed}.mcap"));
        let mut session = contactd::embedded(&config).unwrap();
        let mut play = Play::new(seed);
        // From its beginning, or with a past.
        let past = if seed % 2 == 0 { 0 } else { 30 };
        if past == 0 {
            session.record(&path).unwrap();
        }
        play.begin(&mut session);
        (0..past).for_each(|_| _ = play.step(&mut session));
        if past > 0 {
            session.record(&path).unwrap();
        }
        let taken = (0..each).filter(|_| play.step(&mut session)).count() as u64;
        assert_eq!(session.recording().unwrap().failure, "");
        let status = session.stop_recording().unwrap();
        assert_eq!(status.failure, "");
        assert_eq!((status.steps, status.dropped), (each, 0), "those that were refused stand in it, too");
        all += taken;
        // Files that models name are in the recording: they may go.
        let part = folder.path().join("below/part.off");
        std::fs::rename(&part, folder.path().join("away")).unwrap();
        let replayed = replay(&path, |_| {}).unwrap();
        std::fs::rename(folder.path().join("away"), &part).unwrap();
        assert_eq!((replayed.difference.clone(), replayed.steps), (None, each), "seed {seed}: {}", replayed.text());
        assert!(!replayed.is_cut && replayed.sessions == 1);
        println!("session {seed}: {each} steps, {taken} of them taken, {} bytes", status.bytes);
    }
    assert!(2 * all > sessions * each, "{all} of {} were taken", sessions * each);
}

/// A recording of a few steps, its bytes and the step messages in it: each with where it ends.
fn recorded(folder: &Path) -> (Vec<u8>, Vec<(usize, Vec<u8>)>) {
    let path = folder.join("whole.mcap");
    let mut session = contactd::embedded(&with_root(folder)).unwrap();
    session.record(&path).unwrap();
    let mut play = Play::new(5);
    play.begin(&mut session);
    for k in 0..40 {
        play.step(&mut session);
        if k % 16 == 15 {
            // Several chunks.
            std::thread::sleep(std::time::Duration::from_millis(260));
        }
    }
    assert_eq!(session.stop_recording().unwrap().steps, 40);
    let bytes = std::fs::read(&path).unwrap();
    let mut recording = Recording::open(&path).unwrap();
    let mut steps: Vec<(usize, Vec<u8>)> = Vec::new();
    while let Some(entry) = recording.next_entry().unwrap() {
        if let Entry::Step(step) = entry {
            let mut message = Vec::new();
            step.write(&mut message);
            let from = steps.last().map_or(0, |(end, _)| *end);
            let mut rest = bytes[from..].windows(message.len());
            let at =
                from + rest.position(|window| window == message).expect("its bytes, after those of the step before");
            steps.push((at + message.len(), message));
        }
    }
    assert!(recording.end.is_some() && steps.len() == 40);
    (bytes, steps)
}

#[test]
fn a_file_that_is_cut_anywhere_is_read_up_to_the_cut() {
    let folder = runtime_folder();
    let (bytes, steps) = recorded(folder.path());
    let mut r = Numbers::new(3);
    let is_long = std::env::var_os("CONTACTD_RECORDED_STEPS").is_some();
    let (places, apart) = if is_long { (24, 9) } else { (12, 12) };
    let cuts = (0..places).map(|_| r.below(bytes.len() as u64) as usize);
    let around = steps.iter().step_by(apart).flat_map(|(end, _)| [end - 1, *end, end + 1]);
    let path = folder.path().join("cut.mcap");
    let mut counts = std::collections::BTreeSet::new();
    for cut in cuts.chain(around).chain([0, 1, 8, bytes.len() - 1]) {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        match replay(&path, |_| {}) {
            Ok(replayed) => {
                let whole = steps.iter().filter(|(end, _)| *end <= cut).count() as u64;
                assert_eq!(
                    (replayed.steps, replayed.difference.clone(), replayed.is_cut),
                    (whole, None, true),
                    "cut at {cut}"
                );
                assert!(replayed.text().contains("it was cut"));
                counts.insert(whole);
            }
            // So short that it does not say what it is.
            Err(e) => assert!(cut < 400 && e.to_string().contains("its first bytes alone"), "cut at {cut}: {e}"),
        }
    }
    assert!(counts.len() > 8, "{counts:?}");
}

#[test]
fn a_changed_bit_is_found_and_its_step_named() {
    let folder = runtime_folder();
    let (bytes, steps) = recorded(folder.path());
    let path = folder.path().join("changed.mcap");
    let told = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        replay(&path, |_| {})
    };
    assert_eq!(told(&bytes).unwrap().difference, None);
    let head = 16 + size_of::<StepRequest>() + size_of::<contactd_client::proto::StepReply>();
    let mut found = 0;
    for (k, (end, message)) in steps.iter().enumerate() {
        let from = end - message.len();
        let records = u32::from_le_bytes(message[8..12].try_into().unwrap()) as usize;
        let slots = u32::from_le_bytes(message[12..16].try_into().unwrap()) as usize;
        // The lowest bit of safe_time; of the time of the first record.
        let mut places = vec![from + 16 + size_of::<StepRequest>() + 48];
        if slots > 0 {
            places.push(from + head + 64 * records + 16);
        }
        if k % 8 != 0 {
            places.truncate(usize::from(k % 8 == 1));
        }
        for place in places {
            let mut changed = bytes.clone();
            changed[place] ^= 1;
            let difference = told(&changed).unwrap().difference.expect("a difference");
            assert_eq!(difference.step, k as u64 + 1, "{difference:?}");
            assert!(difference.what.contains(" was ") && difference.what.contains(", is "), "{difference:?}");
            found += 1;
        }
    }
    assert!(found > 8, "{found}");
    // Another pose: what follows is another answer, or the file's own sum tells.
    let (end, message) = &steps[20];
    let mut changed = bytes.clone();
    changed[end - message.len() + head + 14] ^= 0x10;
    let said = told(&changed).map(|replayed| replayed.difference.map(|d| d.step));
    assert!(matches!(said, Ok(Some(21..)) | Err(_)), "{said:?}");
    // What no answer depends on, a picture, is found by the sum of its chunk.
    let mut changed = bytes.clone();
    let place = bytes.windows(9).position(|w| w == b"frame_loc").unwrap();
    changed[place] ^= 1;
    let said = told(&changed).map(|_| ()).unwrap_err().to_string();
    assert!(said.contains("found damage after"), "{said}");
    // A chunk that is taken for a record of another kind is passed over, or stands there twice: the number of steps tells.
    let chunk = chunk_at(&bytes, steps[39].0);
    let mut lost = bytes.clone();
    lost[chunk.start] ^= 0x80;
    let twice = [&bytes[..chunk.end], &bytes[chunk.start..]].concat();
    let said = told(&lost).map(|_| ()).unwrap_err().to_string();
    assert!(said.contains("expected 40 steps, as it says at its end, found "), "{said}");
    // What comes a second time may have another answer.
    if let Ok(replayed) = told(&twice) {
        assert!(replayed.difference.is_some(), "{}", replayed.text());
    }
    // Whatever byte of a record's head is changed: one sentence.
    for place in (chunk.start..chunk.start + 60).chain(8..60) {
        let mut changed = bytes.clone();
        changed[place] ^= 0x41;
        if let Err(e) = told(&changed) {
            let said = e.to_string();
            assert!(!said.contains('\n') && !said.contains('\u{1b}'), "{place}: {said}");
        }
    }
}

/// Where the record around a place lies in a recording: the opcode, eight bytes of length, the rest.
fn chunk_at(bytes: &[u8], place: usize) -> std::ops::Range<usize> {
    let mut at = 8;
    loop {
        let long = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        let end = at + 9 + long;
        if place <= end {
            assert_eq!(bytes[at], 6, "messages stand in chunks");
            return at..end;
        }
        at = end;
    }
}

/// A disk that takes nothing until it is let.
#[derive(Clone, Default)]
struct SlowDisk {
    open: Arc<AtomicBool>,
    bytes: Arc<Mutex<Vec<u8>>>,
}

impl std::io::Write for SlowDisk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        while !self.open.load(Ordering::Relaxed) {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        self.bytes.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_slow_disk_costs_whole_steps_which_are_counted_and_no_step_waits_for_it() {
    const BALLS: u32 = 3;
    let disk = SlowDisk::default();
    let mut session: Session<Embedded> = contactd::embedded(&ServerConfig::default()).unwrap();
    let ball = session.load_model("ball.csg", "sphere($fn = 0, r = 1);").unwrap();
    let home = |i: u32| Pose::at(DVec3::new(3.0 * f64::from(i % 80), 3.0 * f64::from(i / 80), 0.0));
    let ids: Vec<u32> = (0..BALLS).map(|i| session.add_object(Object::new("", ball.id).at(home(i))).unwrap()).collect();
    session.transport_mut().record_over("a slow disk", Box::new(disk.clone())).unwrap();
    let step = |session: &mut Session<Embedded>, k: u64| {
        let slots = session.begin_step(ids.len()).unwrap();
        for (i, slot) in slots.iter_mut().enumerate() {
            let aside = if i == 0 { 0.3 * (k % 8) as f64 } else { 0.0 };
            *slot = PoseRecord::end(ids[i], &Pose::at(home(i as u32).position + DVec3::X * aside));
        }
        session.finish(PATIENCE).map(|_| ()).unwrap();
    };
    // The queue takes 16,384 items: the disk has taken nothing when it is full.
    let mut k = 0;
    while session.recording().unwrap().dropped < 20 {
        step(&mut session, k);
        k += 1;
        assert!(k < 20_000, "nothing was left out");
    }
    disk.open.store(true, Ordering::Relaxed);
    let first = session.recording().unwrap().steps;
    while session.recording().unwrap().steps < first + 5 {
        step(&mut session, k);
        k += 1;
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let status = session.stop_recording().unwrap();
    assert_eq!(status.steps + status.dropped, k, "{status:?}");
    assert!(status.dropped >= 20 && status.without_picture > 0 && status.failure.is_empty(), "{status:?}");
    let folder = runtime_folder();
    let path = folder.path().join("slow.mcap");
    std::fs::write(&path, &*disk.bytes.lock().unwrap()).unwrap();
    let mut recording = Recording::open(&path).unwrap();
    let (mut openings, mut counted, mut numbers) = (0, 0, Vec::new());
    while let Some(entry) = recording.next_entry().unwrap() {
        match entry {
            Entry::Opening(_, opening) => (openings, counted) = (openings + 1, counted + opening.dropped),
            Entry::Step(step) => numbers.push(step.request.step),
            Entry::Change(..) => panic!("nothing was changed"),
        }
    }
    assert_eq!((openings, counted), (2, status.dropped), "what was left out is told where it was");
    assert_eq!(recording.end.unwrap()["dropped"], status.dropped.to_string());
    assert_eq!(numbers.len() as u64, status.steps);
    let gaps: Vec<u64> = numbers.windows(2).map(|w| w[1] - w[0] - 1).filter(|n| *n > 0).collect();
    assert_eq!(gaps, [status.dropped]);
    let replayed = replay(&path, |_| {}).unwrap();
    assert_eq!((replayed.difference, replayed.steps, replayed.dropped), (None, status.steps, status.dropped));
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_contactd"));
    let out = command.arg("replay").arg(&path).output().unwrap();
    let said = String::from_utf8(out.stdout).unwrap();
    assert!(out.status.code() == Some(3) && said.contains("were left out when it was recorded"), "{said}");
}

/// A disk that has room for some bytes and then refuses so many times.
#[derive(Clone)]
struct FullDisk {
    refusals: usize,
    bytes: Arc<Mutex<Vec<u8>>>,
}

impl std::io::Write for FullDisk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut taken = self.bytes.lock().unwrap();
        let n = if self.refusals > 0 { bytes.len().min(40_000 - taken.len()) } else { bytes.len() };
        if n == 0 {
            self.refusals -= 1;
            return Err(std::io::Error::new(std::io::ErrorKind::StorageFull, "there is no room"));
        }
        taken.extend_from_slice(&bytes[..n]);
        Ok(n)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_disk_without_room_is_asked_again_and_then_ends_the_recording_and_no_step() {
    // Refuses five times, and for ever.
    for refusals in [5, usize::MAX] {
        let disk = FullDisk { refusals, bytes: Arc::default() };
        let mut session: Session<Embedded> = contactd::embedded(&ServerConfig::default()).unwrap();
        let ball = session.load_model("ball.csg", "sphere($fn = 0, r = 1);").unwrap();
        let id = session.add_object(Object::new("", ball.id)).unwrap();
        session.transport_mut().record_over("a full disk", Box::new(disk.clone())).unwrap();
        let mut k = 0;
        loop {
            session.begin_step(1).unwrap()[0] = PoseRecord::end(id, &Pose::at(DVec3::X * f64::from(k % 8)));
            session.finish(PATIENCE).map(|_| ()).unwrap();
            k += 1;
            let status = session.recording().unwrap();
            if !status.failure.is_empty() || refusals == 5 && status.bytes > 80_000 {
                break;
            }
            assert!(k < 100_000, "the disk was never full");
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let status = session.stop_recording().unwrap();
        let folder = runtime_folder();
        let path = folder.path().join("full.mcap");
        std::fs::write(&path, &*disk.bytes.lock().unwrap()).unwrap();
        let replayed = replay(&path, |_| {}).unwrap();
        assert_eq!(replayed.difference, None);
        if refusals == 5 {
            assert_eq!((&*status.failure, status.steps, status.dropped), ("", k as u64, 0));
            assert!(!replayed.is_cut && replayed.steps == k as u64, "{}", replayed.text());
        } else {
            let said = &status.failure;
            assert!(said.starts_with("a full disk: ") && said.ends_with("there is no room"), "{said}");
            assert!(replayed.is_cut, "{}", replayed.text());
            // What was taken and does not stand in the file is left out, as what came afterwards.
            assert_eq!(status.steps + status.dropped, k as u64);
            assert!(status.steps <= replayed.steps, "{} of {}", replayed.steps, status.steps);
        }
    }
}

/// The answer of `contactd check` to a scene: ids from 0, times and points.
fn checked(scene: &Path) -> Vec<(u32, u32, [u64; 5])> {
    use contactd::import::{Facets, Limits, read_scene};
    let scene = read_scene(scene).unwrap_or_else(|e| panic!("{e}"));
    let prepared = contactd::cache::prepare_scene(None, &scene, Facets::Auto, &Limits::default()).expect("models");
    let models: Vec<_> = prepared.iter().map(|p| p.model.clone()).collect();
    let mut check = contactd::check::Check::new(&scene, &models, None).expect("a scene");
    let out = check.step(false).expect("a step");
    let line = |p: &contactd::world::PairOutcome| {
        let point = p.outcome.point().map_or([0.0; 3], |point| point.point.to_array());
        let all = [p.outcome.time(), p.outcome.time_lower(), point[0], point[1], point[2]];
        (p.a, p.b, all.map(f64::to_bits))
    };
    out.pairs.iter().map(line).collect()
}

#[test]
fn a_step_that_was_saved_is_checked_to_the_answer_that_was_given() {
    let folder = runtime_folder();
    let root = folder.path().join("root");
    let mut session = contactd::embedded(&with_root(&root)).unwrap();
    let path = folder.path().join("steps.mcap");
    session.record(&path).unwrap();
    let mut play = Play::new(11);
    for (name, text) in MODELS.iter().filter(|(name, _)| name.ends_with(".csg")) {
        play.models.push(session.load_model(name, *text).unwrap().id);
    }
    (0..8).for_each(|_| play.add(&mut session));
    session
        .set_rules(&[Rule::new(["default".into(), "cell".into()]), Rule::new(["default".into(), "default".into()])])
        .unwrap();
    let (mut compared, mut contacts, mut last) = (0, 0, None);
    for k in 1..=12u64 {
        session.options = StepOptions {
            clear: true,
            dt: 0.01,
            advance: if k % 4 == 0 { 0.4 } else { 1.0 },
            ..StepOptions::default()
        };
        let ids = play.objects.clone();
        let records: Vec<PoseRecord> = ids
            .iter()
            .filter(|id| (u64::from(**id) + k) % 5 != 0)
            .map(|id| match k % 3 {
                0 => PoseRecord::turn(*id, play.pose().position, DVec3::ZERO),
                _ => PoseRecord::end(*id, &Pose::at(play.pose().position)),
            })
            .collect();
        session.begin_step(records.len()).unwrap().copy_from_slice(&records);
        let Ok(reply) = session.finish(PATIENCE) else { continue };
        let mut all: Vec<u32> = play.objects.iter().chain(&play.fixed).copied().collect();
        all.sort_unstable();
        let place = |id: u32| all.iter().position(|x| *x == id).unwrap() as u32;
        let told: Vec<_> = reply
            .records()
            .iter()
            .map(|r| {
                (place(r.a), place(r.b), [r.time, r.time_lower, r.point[0], r.point[1], r.point[2]].map(f64::to_bits))
            })
            .collect();
        contacts += reply.records().iter().filter(|r| r.status == 1).count();
        let saved = session.save_step(folder.path().join(format!("saved-{k}"))).unwrap();
        assert_eq!(checked(&saved), told, "step {k}");
        last = saved.parent().map(Path::to_path_buf);
        compared += told.len();
    }
    assert!(compared > 60 && contacts > 3, "{compared} pairs, {contacts} contacts");
    // The folder is new, or nothing is written.
    let again = session.save_step(last.expect("a step that was taken")).unwrap_err();
    assert!(
        again.code() == Some(ErrorCode::Recording) && again.to_string().contains("expected to make a new folder"),
        "{again}"
    );
    let steps = session.stop_recording().unwrap().steps;
    for k in 1..=steps {
        let to = folder.path().join(format!("step-{k}"));
        match scene_of(&path, k) {
            Ok(scene) => scene.write(&to).unwrap(),
            Err(e) => {
                assert!(e.to_string().contains("it was refused"), "{e}");
                continue;
            }
        }
        let saved = folder.path().join(format!("saved-{k}/scene.toml"));
        assert_eq!(checked(&to.join("scene.toml")), checked(&saved), "step {k} of the recording");
    }
    let beyond = scene_of(&path, steps + 1).unwrap_err().to_string();
    assert!(beyond.contains(&format!("expected a step from 1 to {steps}, found {}", steps + 1)), "{beyond}");
}

#[test]
fn what_cannot_be_recorded_is_refused_with_one_sentence() {
    let folder = runtime_folder();
    let path = folder.path().join("a.mcap");
    let mut session = contactd::embedded(&ServerConfig { deadline_ms: 5, ..ServerConfig::default() }).unwrap();
    let said = session.record(&path).unwrap_err();
    assert!(said.code() == Some(ErrorCode::Recording) && said.to_string().contains("answers depend on time"), "{said}");
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    assert!(session.stop_recording().unwrap_err().to_string().contains("nothing is being recorded"));
    session.record(&path).unwrap();
    assert!(
        session
            .record(folder.path().join("b.mcap"))
            .unwrap_err()
            .to_string()
            .contains("a recording runs already, into")
    );
    assert_eq!(session.stop_recording().unwrap().steps, 0);
    assert!(session.record(&path).unwrap_err().to_string().contains("expected to make a new file"));
    assert!(session.record(folder.path().join("no/a.mcap")).unwrap_err().to_string().contains("No such file"));
    // An empty one is a recording; others are none.
    let none = replay(&path, |_| {}).unwrap();
    assert_eq!((none.steps, none.text().starts_with("no step is in the file: nothing was repeated\n")), (0, true));
    let text = folder.path().join("text.mcap");
    std::fs::write(&text, "no such thing, and longer than the first bytes of one").unwrap();
    let said = replay(&text, |_| {}).unwrap_err().to_string();
    assert!(said.contains("text.mcap: expected an MCAP file"), "{said}");
    let said = replay(&folder.path().join("none.mcap"), |_| {}).unwrap_err().to_string();
    assert!(said.contains("none.mcap: expected a readable file"), "{said}");
}

/// A recording in a browser: each run of steps with the same objects is an act, and its steps have the recorded contacts.
#[test]
fn a_recording_is_shown_as_it_was() {
    let folder = runtime_folder();
    let path = folder.path().join("shown.mcap");
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    session.record(&path).unwrap();
    let ball = session.load_model("ball.csg", "sphere($fn = 0, r = 1);").unwrap().id;
    let ids = [0.0, 10.0].map(|x| session.add_object(Object::new("", ball).at(Pose::at(DVec3::X * x))).unwrap());
    let mut expected = Vec::new();
    for k in 0..4 {
        if k == 2 {
            session.add_object(Object::new("third", ball).at(Pose::at(DVec3::Y * 30.0)).fixed()).unwrap();
        }
        let to = [6.0, 1.0, 9.0, 0.5][k];
        session.begin_step(1).unwrap()[0] = PoseRecord::end(ids[1], &Pose::at(DVec3::X * to));
        let reply = session.finish(PATIENCE).unwrap();
        expected.push(reply.records().iter().filter(|r| r.status != 2).map(|r| r.time).collect::<Vec<_>>());
    }
    session.stop_recording().unwrap();
    let (runs, are_more) = contactd::replay::runs(&path, 100).unwrap();
    assert!(!are_more && runs.iter().map(|run| run.scenes.len()).collect::<Vec<_>>() == [2, 2]);
    assert_eq!((runs[0].first, runs[1].first), (1, 3));
    let scenes: Vec<&String> = runs.iter().flat_map(|run| &run.scenes).collect();
    for (scene, times) in scenes.iter().zip(&expected) {
        let scene = contactd::import::Scene::parse("recorded", scene, Path::new("")).unwrap();
        let solid = contactd::import::import_csg(
            "ball.csg",
            "sphere($fn = 0, r = 1);",
            Default::default(),
            &Default::default(),
        );
        let model = std::sync::Arc::new(contactd::octree::Model::new(solid.unwrap().solid));
        let models = vec![model; scene.models.len()];
        let mut check = contactd::check::Check::new(&scene, &models, None).unwrap();
        let outcome = check.step(false).unwrap();
        let found: Vec<f64> = outcome.pairs.iter().filter(|p| p.outcome.meets()).map(|p| p.outcome.time()).collect();
        assert_eq!(
            found.iter().map(|t| t.to_bits()).collect::<Vec<_>>(),
            times.iter().map(|t| t.to_bits()).collect::<Vec<_>>()
        );
    }
    assert_eq!(contactd::replay::runs(&path, 3).unwrap().0.iter().map(|run| run.scenes.len()).sum::<usize>(), 3);
    assert!(contactd::replay::runs(&path, 3).unwrap().1);
    // The program has it, too: as one file for programs that draw.
    let glb = folder.path().join("shown.glb");
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_contactd"));
    let out = command.arg("view").arg(&path).arg("--gltf").arg(&glb).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8_lossy(&std::fs::read(&glb).unwrap()).into_owned();
    assert!(text.contains("session 1, 2 steps from 3 on") && text.contains("first meets"), "an act for each run");
}
