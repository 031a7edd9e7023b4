//! The client's side: the acts played through a session, whichever way it reaches its engine.
//!
//! Each step sends only what changes: a START for a body that is set back, an END for one that moves; bodies at rest
//! stay unnamed. The time of a step is taken around all of it, from the loan of the slots to the records in place.

use super::script::{Act, acts};
use contactd_client::transport::Transport;
use contactd_client::{Error, Object, Session};
use contactd_proto::contact_record::{CONTACT, ContactRecord, OVERLAP, UNDECIDED};
use contactd_proto::control::FaceName;
use contactd_proto::{Pose, PoseRecord};
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// How long a step may take before the demo gives up.
const PATIENCE: Duration = Duration::from_secs(120);

/// One contact that a step reported.
#[derive(Clone, Debug)]
pub struct Row {
    /// Step of the whole demo.
    pub step: usize,
    /// Index of the act.
    pub act: usize,
    /// Names of the two objects.
    pub names: [String; 2],
    /// The record as it came.
    pub record: ContactRecord,
    /// One of its faces belongs to a primitive that was subtracted.
    pub subtracted: bool,
}

/// All that a run of the demo brought.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Steps made.
    pub steps: usize,
    /// Steps with a contact.
    pub steps_with_contact: usize,
    /// All contacts, in the order of steps, then (time, a, b).
    pub rows: Vec<Row>,
    /// Pairs left undecided.
    pub undecided: usize,
    /// Time of each step as the client sees it.
    pub latency: Vec<Duration>,
    /// Cells refined in all.
    pub cells: u64,
}

/// Plays all acts; `progress` hears of every step before it is made.
///
/// # Errors
/// Whatever the session meets.
pub fn play<T: Transport>(session: &mut Session<T>, mut progress: impl FnMut(&Act, usize)) -> Result<Run, Error> {
    let acts = acts();
    let mut run = Run::default();
    let mut models: HashMap<&str, (u32, Vec<FaceName>)> = HashMap::new();
    for act in &acts {
        for body in &act.bodies {
            if !models.contains_key(body.part.name) {
                let info = session.load_model(body.part.name, body.part.text)?;
                models.insert(body.part.name, (info.id, info.faces));
            }
        }
    }
    for (k, act) in acts.iter().enumerate() {
        let mut ids = Vec::with_capacity(act.bodies.len());
        let mut poses: Vec<Pose> = act.step(0).iter().map(|leg| leg.start).collect();
        for (body, pose) in act.bodies.iter().zip(&poses) {
            let object = Object::new(&body.name, models[body.part.name].0).at(*pose);
            ids.push(session.add_object(if body.fixed { object.fixed() } else { object })?);
        }
        let mut batch = Vec::new();
        for i in 0..act.steps {
            progress(act, run.steps);
            let legs = act.step(i);
            batch.clear();
            for ((leg, id), pose) in legs.iter().zip(&ids).zip(&poses) {
                if leg.start != *pose {
                    batch.push(PoseRecord::start(*id, &leg.start));
                }
                if leg.end != leg.start {
                    batch.push(PoseRecord::end(*id, &leg.end));
                }
            }
            let from = Instant::now();
            session.begin_step(batch.len())?.copy_from_slice(&batch);
            let reply = session.finish(PATIENCE)?;
            run.latency.push(from.elapsed());
            run.cells += reply.header().counters.cells;
            let mut met = false;
            for record in reply.records() {
                run.undecided += (record.status == UNDECIDED) as usize;
                if record.status != CONTACT && record.status != OVERLAP {
                    continue;
                }
                met = true;
                let index = |id: u32| ids.iter().position(|i| *i == id).unwrap_or(0);
                let (a, b) = (index(record.a), index(record.b));
                let cut = |body: usize, faces: &[u32; 3]| {
                    let names = &models[act.bodies[body].part.name].1;
                    faces.iter().any(|f| names.get(*f as usize).is_some_and(|n| n.subtracted))
                };
                run.rows.push(Row {
                    step: run.steps,
                    act: k,
                    names: [act.bodies[a].name.clone(), act.bodies[b].name.clone()],
                    record: *record,
                    subtracted: cut(a, &record.faces_a) || cut(b, &record.faces_b),
                });
            }
            run.steps += 1;
            run.steps_with_contact += met as usize;
            for (pose, leg) in poses.iter_mut().zip(&legs) {
                *pose = leg.end;
            }
        }
        for id in ids {
            session.remove_object(id)?;
        }
    }
    Ok(run)
}
