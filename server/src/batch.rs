//! Many steps of one scene that know nothing of each other, on several threads: what a table of queries asks.
//!
//! Before each query the world stands as the scene has it and remembers nothing. So an answer's bits depend on its own query
//! alone: however a table is cut into parts, whatever was asked before, and on however many threads, they are the same.
//!
//! Floor 11: imports `check`, `report` and below.

use crate::cache::{Cache, Key, Prepared, prepare_scene};
use crate::check::{Check, CheckError};
use crate::import::{Facets, Limits, Scene, SceneError};
use crate::octree::Model;
use crate::report::Feature;
use crate::world::{StepOptions, record};
use contactd_proto::{ContactRecord, DetailSlot, ErrorCode, PoseRecord, pose_record};
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc;

/// Queries that a thread takes at a time.
const BLOCK: usize = 32;

/// Why a scene takes no queries.
#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    /// One of its models.
    #[error(transparent)]
    Model(#[from] SceneError),
    /// An object, a rule, the resolution.
    #[error(transparent)]
    World(#[from] CheckError),
}

/// What is asked of every query.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct BatchOptions {
    /// Only the pairs whose bracket meets the query's earliest contact.
    pub first: bool,
    /// Records of clear pairs, too.
    pub clear: bool,
    /// Most records of a query, the earliest first; 0: all.
    pub max_records: u32,
    /// Most cells of one pair's search; 0: the default.
    pub cell_limit: u64,
    /// Most cells of all searches of a query; 0: the default.
    pub batch_limit: u64,
    /// Threads; 0: as many as the machine has.
    pub threads: usize,
}

/// The answer to a query, beside its records.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// `STEP_CLEAR`, `STEP_CONTACT`, `STEP_UNDECIDED`; 0 for a query that was refused.
    pub status: u32,
    /// How many records it has.
    pub records: u32,
    /// True where `max_records` left records out.
    pub truncated: bool,
    /// Smallest time_lower over all pairs, a fraction of the step: nothing meets before.
    pub safe_time: f64,
    /// Cells that its searches refined.
    pub cells: u64,
    /// Why it was refused: one sentence that names the object.
    pub refusal: Option<String>,
}

/// The answers to queries, in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// One for each query.
    pub rows: Vec<Row>,
    /// Their records, one query's behind the other's, in the order (time, a, b). Slots of regions are not kept.
    pub records: Vec<ContactRecord>,
    /// A detail slot for each of `records`.
    pub details: Vec<DetailSlot>,
}

impl Answers {
    fn extend(&mut self, more: Self) {
        self.rows.extend(more.rows);
        self.records.extend(more.records);
        self.details.extend(more.details);
    }
}

/// A scene that takes queries. Its objects' ids are their places in the file.
#[derive(Debug)]
pub struct Batch {
    scene: Scene,
    models: Vec<Arc<Model>>,
    resolution: Option<f64>,
    key: String,
}

impl Batch {
    /// Reads the models of a scene; `resolution` (length) stands before the scene's own. What the import of a model notes is in
    /// the second part, one sentence each.
    ///
    /// # Errors
    /// A model or an object that is refused.
    pub fn new(
        scene: Scene,
        cache: Option<&Cache>,
        facets: Facets,
        resolution: Option<f64>,
    ) -> Result<(Self, Vec<String>), BatchError> {
        let limits = Limits::default();
        let prepared = prepare_scene(cache, &scene, facets, &limits)?;
        let key = key_of(&scene, facets, resolution)?;
        let models = prepared.iter().map(|p| p.model.clone()).collect();
        let this = Self { scene, models, resolution, key };
        Check::new(&this.scene, &this.models, resolution)?;
        let notes = this.notes(&prepared);
        Ok((this, notes))
    }

    fn notes(&self, prepared: &[Prepared]) -> Vec<String> {
        let of_models = self.scene.models.iter().zip(prepared);
        let of_models = of_models.flat_map(|(source, p)| p.notes.iter().map(|n| format!("{}:{n}", source.text_name())));
        let of_scene = self.scene.notes.iter().map(|n| format!("{}:{n}", self.scene.file));
        of_scene.chain(of_models).chain(prepared.iter().filter_map(|p| p.trouble.clone())).collect()
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// What the faces of each model are called, by face id: "side of subtracted cylinder 26".
    pub fn faces(&self) -> Vec<Vec<String>> {
        let of_model = |model: &Arc<Model>| {
            let features = (0..).map_while(|face| Feature::of_face("", &model.solid, face));
            features.map(|feature| feature.to_string()).collect()
        };
        self.models.iter().map(of_model).collect()
    }

    /// A hash of all that answers depend on beside the queries and their options: objects, rules, resolution, the models' content,
    /// and this version. Names of files and lines are no part of it.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// Answers queries: query i is the batch `records[offsets[i]..offsets[i + 1]]`, as a session takes it. Objects that it does not
    /// name stand as in the scene.
    ///
    /// # Panics
    /// When `offsets` do not go up, or not within `records`.
    pub fn solve(&self, offsets: &[usize], records: &[PoseRecord], options: &BatchOptions) -> Answers {
        let queries = offsets.len().saturating_sub(1);
        assert!(offsets.is_sorted() && offsets.last().is_none_or(|end| *end <= records.len()), "offsets of queries");
        let blocks = queries.div_ceil(BLOCK);
        let available = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = if options.threads == 0 { available() } else { options.threads }.clamp(1, blocks.max(1));
        let next = AtomicUsize::new(0);
        let work = |told: &mut dyn FnMut(usize, Answers)| {
            let mut solver = Solver::new(self);
            loop {
                let block = next.fetch_add(1, Relaxed);
                if block >= blocks {
                    return;
                }
                let mut answers = Answers::default();
                for i in block * BLOCK..queries.min((block + 1) * BLOCK) {
                    solver.solve(&records[offsets[i]..offsets[i + 1]], options, &mut answers);
                }
                told(block, answers);
            }
        };
        let mut parts: Vec<Option<Answers>> = Vec::new();
        parts.resize_with(blocks, || None);
        if threads == 1 {
            work(&mut |block, answers| parts[block] = Some(answers));
        } else {
            std::thread::scope(|scope| {
                let (to, from) = mpsc::channel();
                for _ in 0..threads {
                    let (to, work) = (to.clone(), &work);
                    scope.spawn(move || {
                        work(&mut |block, answers| {
                            // Who asked is still there: it waits for all of them.
                            let _ = to.send((block, answers));
                        });
                    });
                }
                drop(to);
                from.iter().for_each(|(block, answers)| parts[block] = Some(answers));
            });
        }
        let mut all = Answers::default();
        parts.into_iter().flatten().for_each(|part| all.extend(part));
        all
    }
}

/// What `Batch::key` will be; models are read for it, but not preprocessed.
///
/// # Errors
/// A model's file that cannot be read.
pub fn key_of(scene: &Scene, facets: Facets, resolution: Option<f64>) -> Result<String, SceneError> {
    let limits = &Limits::default();
    let mut text = format!("{} {resolution:?} {:?} {:?}\n", env!("CARGO_PKG_VERSION"), scene.resolution, scene.dt);
    let keys = scene.each_model(limits, |source| {
        let key = Key::of(source.format()?, source.bytes, facets, limits);
        Ok(key.with(source.attached.unwrap_or_default()).to_string())
    })?;
    for o in &scene.objects {
        let poses = (&o.place, &o.motion.start);
        let declared = (o.is_static, o.rotates, o.max_speed);
        let _ = writeln!(text, "{:?} {} {:?} {declared:?} {poses:?}", o.name, keys[o.model], o.group);
    }
    let _ = writeln!(text, "{:?}", scene.rules);
    Ok(blake3::hash(text.as_bytes()).to_hex().to_string())
}

/// One thread's world.
struct Solver<'a> {
    of: &'a Batch,
    check: Check,
    /// Objects that do not stand where the scene has them.
    displaced: Vec<u32>,
    /// Working memory: what the world is told, and the objects that a query puts somewhere itself.
    batch: Vec<PoseRecord>,
    put: Vec<u32>,
}

impl<'a> Solver<'a> {
    fn new(of: &'a Batch) -> Self {
        let check = Check::new(&of.scene, &of.models, of.resolution).expect("it was made before");
        Self { of, check, displaced: Vec::new(), batch: Vec::new(), put: Vec::new() }
    }

    /// Appends the answer to one query.
    fn solve(&mut self, records: &[PoseRecord], asked: &BatchOptions, answers: &mut Answers) {
        let told = (answers.records.len(), answers.details.len());
        let row = catch_unwind(AssertUnwindSafe(|| self.step(records, asked, answers))).unwrap_or_else(|_| {
            // Nothing of that world can be trusted any more.
            *self = Self::new(self.of);
            answers.records.truncate(told.0);
            answers.details.truncate(told.1);
            refused(ErrorCode::Internal.to_string())
        });
        answers.rows.push(row);
    }

    fn step(&mut self, records: &[PoseRecord], asked: &BatchOptions, answers: &mut Answers) -> Row {
        let before = self.begin(records);
        let options = StepOptions {
            dt: self.of.scene.dt.unwrap_or(0.0),
            first: asked.first,
            clear: asked.clear,
            max_records: asked.max_records,
            cell_limit: asked.cell_limit,
            batch_limit: asked.batch_limit,
            ..StepOptions::default()
        };
        let Check { world, .. } = &mut self.check;
        if let Err(error) = world.step(&self.batch, &options) {
            // The world is as it was, and so is what stands elsewhere in it.
            return refused(self.sentence(records, error.index.map(|i| i as usize - before), error.code));
        }
        self.displaced.clear();
        self.displaced.extend(records.iter().map(|r| r.object));
        self.displaced.sort_unstable();
        self.displaced.dedup();
        let (world, out) = (&*world, world.outcome());
        let header = record::reply(out, true);
        for (i, pair) in out.pairs.iter().enumerate() {
            // Where further slots stand is told of a reply that nobody has.
            answers.records.push(ContactRecord { slot: 0, slots: 0, ..record::slot(world, out, true, i) });
            answers.details.push(record::detail(world, pair));
        }
        Row {
            status: header.status,
            records: header.records,
            truncated: header.truncated != 0,
            safe_time: header.safe_time,
            cells: header.counters.cells,
            refusal: None,
        }
    }

    /// Forgets what is known and makes the batch of a query: what stands elsewhere is put where the scene has it. How many records come
    /// before the query's own.
    fn begin(&mut self, records: &[PoseRecord]) -> usize {
        self.check.world.renew();
        self.put.clear();
        self.put.extend(records.iter().filter(|r| r.flags == pose_record::START).map(|r| r.object));
        self.put.sort_unstable();
        self.batch.clear();
        for id in self.displaced.iter().filter(|id| self.put.binary_search(id).is_err()) {
            self.batch.push(PoseRecord::start(*id, &self.of.scene.objects[*id as usize].motion.start));
        }
        let before = self.batch.len();
        self.batch.extend_from_slice(records);
        before
    }

    /// Why a query is refused, and of which object.
    fn sentence(&self, records: &[PoseRecord], at: Option<usize>, code: ErrorCode) -> String {
        let Some(record) = at.and_then(|i| records.get(i)) else { return code.to_string() };
        let which = if record.flags == pose_record::START { "start" } else { "end" };
        match self.of.scene.objects.get(record.object as usize) {
            Some(object) => format!("object \"{}\": {which}: {code}", object.name),
            None => format!("object {}: {code}", record.object),
        }
    }
}

fn refused(sentence: String) -> Row {
    Row { status: 0, records: 0, truncated: false, safe_time: 0.0, cells: 0, refusal: Some(sentence) }
}
