//! What a session told its server, kept so that a successor can be told again.
//!
//! Tracks are mirrored with the server's own arithmetic (`MotionState`), so a replayed session continues bit for bit. Most batches name
//! the objects of the one before, each with its end alone, and take all of the last step: then the end of an object is what that
//! batch says, and only the last two have anything to tell. They are kept as they are, and worked out when somebody asks.

use contactd_proto::control::{Command, Facets, ModelFile, ObjectSpec, WireFrame, WirePose, WireRule, WireTrack};
use contactd_proto::{MotionState, PoseRecord, Rule, Tracks};
use std::collections::BTreeMap;

#[derive(Clone, Debug)]
struct ModelEntry {
    file: ModelFile,
    facets: Facets,
}

/// Everything that makes a session, in the order in which it can be replayed.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    models: BTreeMap<u32, ModelEntry>,
    objects: BTreeMap<u32, ObjectSpec>,
    tracks: Tracks,
    rules: Vec<Rule>,
    resolution: Option<f64>,
    /// The two batches accepted last.
    recent: [Vec<PoseRecord>; 2],
    /// The batch that was sent last, whether it is like the one accepted last, and how much of the step before it takes.
    sent: (Vec<PoseRecord>, bool, f64),
    /// How many of them, from the last one back, are not in the tracks yet.
    unread: usize,
    /// What objects were before an act of several commands that is under way, of those that it has given other frames: where their models
    /// lie in them, and how they moved.
    before: Option<BTreeMap<u32, (WirePose, MotionState)>>,
}

impl Journal {
    /// A model was loaded.
    pub fn model(&mut self, id: u32, file: ModelFile, facets: Facets) {
        self.models.insert(id, ModelEntry { file, facets });
    }

    /// An object was added.
    pub fn object(&mut self, spec: ObjectSpec) {
        // The server accepted the pose, so it is one.
        if let Ok(pose) = spec.pose.checked() {
            self.tracks.put(spec.id, MotionState::resting(pose));
            self.objects.insert(spec.id, spec);
        }
    }

    /// An object was removed.
    pub fn removed(&mut self, id: u32) {
        self.objects.remove(&id);
        self.tracks.removed(id);
    }

    /// An object was given another frame.
    pub fn reframed(&mut self, frame: &WireFrame) {
        // The server accepted it, so its poses are some.
        if let (Ok((place, pose)), Some(spec)) = (frame.checked(), self.objects.get_mut(&frame.object)) {
            let former = std::mem::replace(&mut spec.place, place.into());
            self.settle();
            if let (Some(before), Some(motion_state)) = (&mut self.before, self.tracks.get(frame.object)) {
                before.entry(frame.object).or_insert((former, *motion_state));
            }
            self.tracks.put(frame.object, MotionState::resting(pose));
        }
    }

    /// An act of several commands begins.
    pub fn begin(&mut self) {
        self.before = Some(BTreeMap::new());
    }

    /// It has ended.
    pub fn end(&mut self) {
        self.before = None;
    }

    /// It was cut short: a successor is told what was before it, to the bit.
    pub fn undo(&mut self) {
        for (id, (place, motion_state)) in self.before.take().unwrap_or_default() {
            if let Some(spec) = self.objects.get_mut(&id) {
                spec.place = place;
                self.tracks.put(id, motion_state);
            }
        }
    }

    /// Rules were set.
    pub fn rules(&mut self, rules: &[Rule]) {
        self.rules = rules.to_vec();
    }

    /// A resolution was set.
    pub fn resolution(&mut self, resolution: Option<f64>) {
        self.resolution = resolution;
    }

    /// A batch was sent. It is copied here and compared, while the server works on it; nothing is known of it yet.
    pub fn sent(&mut self, records: &[PoseRecord], advance: f64) {
        let [_, last] = &self.recent;
        let is_alike = |(r, l): (&PoseRecord, &PoseRecord)| r.object == l.object && r.is_end() && l.is_end();
        // A batch like the last one: of what was before that nothing is left to tell.
        let follows = advance == 1.0 && records.len() == last.len() && records.iter().zip(last).all(is_alike);
        let (batch, is_like_last, part) = &mut self.sent;
        batch.clear();
        batch.extend_from_slice(records);
        (*is_like_last, *part) = (follows, advance);
    }

    /// The server accepted the batch that was sent last.
    pub fn accepted(&mut self) {
        let (batch, follows, advance) = std::mem::take(&mut self.sent);
        if !follows {
            self.settle();
            self.tracks.take(&batch, advance);
        }
        self.unread = if follows { (self.unread + 1).min(2) } else { 0 };
        let [older, last] = &mut self.recent;
        let spare = std::mem::replace(older, std::mem::replace(last, batch));
        self.sent.0 = spare;
    }

    /// Works out the tracks.
    fn settle(&mut self) {
        let recent = std::mem::take(&mut self.recent);
        for batch in &recent[2 - self.unread..] {
            self.tracks.take(batch, 1.0);
        }
        (self.recent, self.unread) = (recent, 0);
    }

    /// The commands that rebuild the session on a server that knows nothing of it.
    pub fn replay(&mut self) -> Vec<Command> {
        self.settle();
        let models =
            self.models.iter().map(|(id, m)| Command::LoadModel { model: *id, file: m.file.clone(), facets: m.facets });
        let objects = self.objects.values().map(|spec| Command::AddObject(spec.clone()));
        let motion_states = self.tracks.iter().map(|(id, track)| WireTrack::of(id, track)).collect();
        let rest = [
            Command::SetRules(self.rules.iter().map(WireRule::from).collect()),
            Command::SetResolution(self.resolution),
            Command::Restore(motion_states),
        ];
        models.chain(objects).chain(rest).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contactd_proto::Pose;
    use contactd_proto::motion::quat_of_rotation_vector;
    use glam::DVec3;

    /// Numbers from a fixed seed (an LCG of 64 bits, its upper half).
    struct Numbers(u64);

    impl Numbers {
        fn below(&mut self, n: u64) -> u64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) % n
        }

        fn vector(&mut self) -> DVec3 {
            DVec3::from([(); 3].map(|()| self.below(2000) as f64 / 1000.0 - 1.0))
        }

        fn pose(&mut self) -> Pose {
            Pose::new(self.vector(), quat_of_rotation_vector(self.vector()))
        }
    }

    /// Tracks of batches like the last one are worked out late; they are those that are worked out at once.
    #[test]
    fn what_is_worked_out_late_is_what_was_reported() {
        let mut r = Numbers(7);
        let (mut late, mut at_once) = (Journal::default(), Journal::default());
        for id in 1..=6 {
            let spec = ObjectSpec {
                id,
                model: 1,
                name: String::new(),
                group: String::new(),
                is_static: false,
                rotates: true,
                max_speed: f64::INFINITY,
                place: Pose::IDENTITY.into(),
                pose: r.pose().into(),
            };
            late.object(spec.clone());
            at_once.object(spec);
        }
        let motion_states = |j: &Journal| j.tracks.iter().map(|(id, track)| (id, *track)).collect::<Vec<_>>();
        let (mut alike, mut named) = ([0; 3], vec![1, 2, 3]);
        for step in 0..3000 {
            if r.below(6) == 0 {
                named = (1..=6).filter(|_| r.below(2) == 0).collect();
            }
            let mut records: Vec<PoseRecord> = named.iter().map(|id| PoseRecord::end(*id, &r.pose())).collect();
            let mut advance = 1.0;
            match (r.below(12), records.first_mut()) {
                (0, Some(first)) => *first = PoseRecord::turn(first.object, r.vector(), r.vector()),
                (1, Some(first)) => *first = PoseRecord::start(first.object, &r.pose()),
                (2, Some(first)) => {
                    let start = PoseRecord::start(first.object, &r.pose());
                    records.push(start);
                }
                (3, _) => advance = 0.5,
                (4, _) => records.reverse(),
                _ => {}
            }
            // A batch that is refused leaves nothing behind.
            if r.below(5) == 0 {
                let other: Vec<PoseRecord> = named.iter().map(|id| PoseRecord::end(*id, &r.pose())).collect();
                late.sent(&other[..r.below(other.len() as u64 + 1) as usize], 1.0);
            }
            late.sent(&records, advance);
            late.accepted();
            at_once.tracks.take(&records, advance);
            alike[late.unread] += 1;
            if r.below(1500) == 0 {
                let id = 1 + r.below(6) as u32;
                late.removed(id);
                at_once.removed(id);
            }
            let mut asked = late.clone();
            asked.settle();
            assert_eq!(motion_states(&asked), motion_states(&at_once), "after step {step}");
            if r.below(9) == 0 {
                late = asked;
            }
        }
        assert!(alike.iter().all(|n| *n > 200), "{alike:?}");
    }
}
