//! Imports, mass properties, queries and scenes that are written: what takes too long for the loop, and too long for other sessions to wait for.
//!
//! Each job has threads of its own, of low priority, so the system shares the cores between the jobs of all sessions
//! whatever they cost, and gives them to steps first. A session has one job at a time. What nobody waits for any more ends at
//! its next point (`math::halt`).

use super::models::{Loaded, Models};
use super::queries::Inquiry;
use super::scene::{Import, Integration, Save, refused};
use crate::math::halt::{self, Halt};
use crate::world::{Refusal, yield_to_others};
use contactd_proto::ErrorCode;
use contactd_proto::control::Answer;
use rayon::ThreadPool;
use std::sync::Arc;

/// What is to be done.
pub enum JobKind {
    /// A model to be imported.
    Import(Import),
    /// A model to be integrated over.
    Integrate(Integration),
    /// A step to be written.
    Save(Save),
    /// Objects that are asked about.
    Ask(Inquiry),
}

/// What came of it.
pub enum Finished {
    /// The model's id, the bytes of its file, and the model.
    Imported(u32, usize, Result<Arc<Loaded>, Refusal>),
    /// The answer.
    Answered(Answer),
}

impl JobKind {
    fn run(self, models: &Models) -> Finished {
        match self {
            JobKind::Import(i) => Finished::Imported(i.model, i.file.size(), models.load(&i.file, i.facets)),
            JobKind::Integrate(integration) => Finished::Answered(integration.answer()),
            JobKind::Save(save) => Finished::Answered(save.answer()),
            JobKind::Ask(inquiry) => Finished::Answered(inquiry.answer().map_or_else(refused, Answer::Told)),
        }
    }
}

/// A job under way; cancelled when dropped.
pub struct Job {
    halt: Arc<Halt>,
    _threads: ThreadPool,
}

impl Job {
    /// Starts work on so many threads; `done` is told what came of it, unless it is cancelled.
    ///
    /// # Errors
    /// `Internal` when no thread can be started.
    pub fn start(
        work: JobKind,
        threads: usize,
        models: Arc<Models>,
        done: impl FnOnce(Finished) + Send + 'static,
    ) -> Result<Self, Refusal> {
        let halt = Arc::new(Halt::default());
        let heeded = halt.clone();
        let start = move |_| {
            yield_to_others();
            halt::heed(Some(heeded.clone()));
        };
        let threads = rayon::ThreadPoolBuilder::new().num_threads(threads.max(1)).start_handler(start).build();
        let threads = threads.map_err(|e| no_thread(&e))?;
        threads.spawn(move || {
            // What a job's own handling of faults lets through must not end the server.
            let finished = halt::catch(|| work.run(&models))
                .unwrap_or_else(|_| Finished::Answered(refused(Refusal::new(ErrorCode::Internal, "the job failed"))));
            done(finished);
        });
        Ok(Self { halt, _threads: threads })
    }
}

impl Drop for Job {
    fn drop(&mut self) {
        self.halt.set();
    }
}

/// The refusal of what needs a thread that the system does not give.
fn no_thread(e: &dyn std::fmt::Display) -> Refusal {
    Refusal::new(ErrorCode::Internal, format!("no thread can be started: {e}"))
}

#[cfg(test)]
mod tests {
    use super::super::config::ServerConfig;
    use super::*;
    use contactd_proto::control::{Facets, ModelFile};
    use std::sync::mpsc::channel;
    use std::time::Duration;

    #[test]
    fn a_job_that_is_dropped_ends_without_its_result_and_others_finish() {
        let models = Arc::new(Models::new(&ServerConfig::default()));
        let (to, from) = channel();
        let sphere = |i: u32| {
            let (x, y) = (i % 150, i / 150);
            format!("multmatrix([[1,0,0,{x}],[0,1,0,{y}],[0,0,1,0],[0,0,0,1]]) {{ sphere($fn = 0, r = 0.7); }}\n")
        };
        let many: String = (0..20_000).map(sphere).collect();
        let import = |model, text: String| {
            let file = ModelFile::new("m.csg", "", text);
            JobKind::Import(Import { model, file, facets: Facets::Auto })
        };
        let start = |model, text: String| {
            let to = to.clone();
            Job::start(import(model, text), 1, models.clone(), move |finished| to.send((model, finished)).unwrap())
        };
        let large = start(1, format!("union() {{ {many} }}")).unwrap();
        drop(large);
        let _small = start(2, "sphere(r = 1);".into()).unwrap();
        let mut answers: Vec<(u32, bool)> = (0..2)
            .map(|_| match from.recv_timeout(Duration::from_secs(60)).unwrap() {
                (model, Finished::Imported(_, _, loaded)) => (model, loaded.is_ok()),
                (model, Finished::Answered(_)) => (model, false),
            })
            .collect();
        answers.sort_unstable();
        assert_eq!(answers, [(1, false), (2, true)]);
    }
}
