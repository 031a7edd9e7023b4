//! What a world keeps from step to step, and the memory that its steps use again.

use super::body::Body;
use super::boxes::SweptBoxes;
use super::distances::Distances;
use super::neighbours::Neighbours;
use super::notes::Notes;
use super::outcome::StepOutcome;
use super::roster::Head;
use super::search::{self, PairJob};
use super::swept_shapes::SweptShapes;
use crate::contact::Scratch;
use contactd_proto::{Pose, PoseRecord};

/// Memory of the steps.
#[derive(Debug)]
pub struct StepState {
    pub(super) max_batch: usize,
    pub(super) serial: u64,
    /// The records of the batch, checked, each with the index of its body in place of the id.
    pub(super) commands: Vec<PoseRecord>,
    /// Where bodies are put at the start of the step, by their indices.
    pub(super) put: Vec<(u32, Pose)>,
    /// Bodies that moved in the last step; and how many of them the batch names.
    pub(super) moving: Vec<u32>,
    pub(super) named: usize,
    /// When the step begins, in steps taken.
    pub(super) clock: f64,
    pub(super) neighbours: Neighbours,
    pub(super) boxes: SweptBoxes,
    pub(super) swept_shapes: SweptShapes,
    /// Neighbours that their path lengths don't prove apart.
    pub(super) near: Vec<usize>,
    /// How many of them a direction proved apart.
    pub(super) glanced: u32,
    pub(super) jobs: Vec<PairJob>,
    /// Time (as a key), ids and job of each told pair, to be ordered, and whether its regions are complete.
    pub(super) reported: Vec<(i64, u32, u32, u32, bool)>,
    pub(super) searches: search::Memory,
    /// Memory of what is asked beside the searches.
    pub(super) scratch: Scratch,
    pub(super) outcome: StepOutcome,
    pub(super) distances: Distances,
    /// What is noted for certificates of what is remembered, where somebody asks for them.
    pub(super) notes: Option<Box<Notes>>,
}

impl StepState {
    pub(super) fn new(max_batch: usize) -> Self {
        Self {
            max_batch,
            serial: 0,
            commands: Vec::new(),
            put: Vec::new(),
            moving: Vec::new(),
            named: 0,
            clock: 0.0,
            neighbours: Neighbours::default(),
            boxes: SweptBoxes::default(),
            swept_shapes: SweptShapes::default(),
            near: Vec::new(),
            glanced: 0,
            jobs: Vec::new(),
            reported: Vec::new(),
            searches: search::Memory::default(),
            scratch: Scratch::default(),
            outcome: StepOutcome::default(),
            distances: Distances::default(),
            notes: None,
        }
    }

    /// As of a world that has taken no step; whether notes are taken stays.
    pub(super) fn renew(&mut self) {
        let notes = self.notes.is_some().then(Box::default);
        *self = Self { notes, ..Self::new(self.max_batch) };
    }

    /// The list of neighbours.
    pub(super) fn neighbours(&self) -> &Neighbours {
        &self.neighbours
    }

    /// When the last step began, in steps taken.
    pub(super) fn clock(&self) -> f64 {
        self.clock
    }

    /// The pairs that were asked about in the last step.
    pub(super) fn jobs(&self) -> &[PairJob] {
        &self.jobs
    }

    /// There are more bodies than before; what is known of the others stays true.
    pub(super) fn extend(&mut self) {
        self.neighbours.extend();
    }

    /// Bodies, their places or the rules have changed: nothing is known any more.
    pub(super) fn forget(&mut self, bodies: &[Body], heads: &mut [Head]) {
        self.neighbours.forget();
        self.distances = Distances::default();
        self.moving.clear();
        for (i, (body, head)) in bodies.iter().zip(heads).enumerate() {
            head.is_moving = !body.motion_state.is_rest();
            self.moving.extend(head.is_moving.then_some(i as u32));
        }
    }
}
