//! What a session told its server, kept so that a successor can be told again.
//!
//! Tracks are mirrored with the server's own arithmetic (`Track`), so a replayed session continues bit for bit.

use contactd_proto::control::{Command, Facets, ObjectSpec, WireRule, WireTrack};
use contactd_proto::pose_record::Order;
use contactd_proto::{PoseRecord, Rule, Track};
use std::collections::BTreeMap;

#[derive(Clone, Debug)]
struct ModelEntry {
    name: String,
    text: String,
    facets: Facets,
}

#[derive(Clone, Debug)]
struct Entry {
    spec: ObjectSpec,
    track: Track,
}

/// Everything that makes a session, in the order in which it can be replayed.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    models: BTreeMap<u32, ModelEntry>,
    objects: BTreeMap<u32, Entry>,
    rules: Vec<Rule>,
    resolution: Option<f64>,
    /// Objects whose track is not at rest; may name removed ones.
    moving: Vec<u32>,
}

impl Journal {
    /// A model was loaded.
    pub fn model(&mut self, id: u32, name: &str, text: &str, facets: Facets) {
        self.models.insert(id, ModelEntry { name: name.into(), text: text.into(), facets });
    }

    /// An object was added.
    pub fn object(&mut self, spec: ObjectSpec) {
        // The server accepted the pose, so it is one.
        if let Ok(pose) = spec.pose.checked() {
            self.objects.insert(spec.id, Entry { spec, track: Track::resting(pose) });
        }
    }

    /// An object was removed.
    pub fn removed(&mut self, id: u32) {
        self.objects.remove(&id);
    }

    /// Rules were set.
    pub fn rules(&mut self, rules: &[Rule]) {
        self.rules = rules.to_vec();
    }

    /// A resolution was set.
    pub fn resolution(&mut self, resolution: Option<f64>) {
        self.resolution = resolution;
    }

    /// The server accepted a batch.
    pub fn accepted(&mut self, records: &[PoseRecord], advance: f64) {
        for id in self.moving.drain(..) {
            if let Some(entry) = self.objects.get_mut(&id) {
                entry.track = Track::resting(entry.track.at(advance));
            }
        }
        // Starts come before motions, wherever they stand in the batch.
        for starts in [true, false] {
            for record in records {
                let (Ok(order), Some(entry)) = (record.decode(), self.objects.get_mut(&record.object)) else {
                    continue;
                };
                if matches!(order, Order::Start(_)) == starts {
                    entry.track = Track::ordered(entry.track.end, order);
                    if !entry.track.is_rest() {
                        self.moving.push(record.object);
                    }
                }
            }
        }
    }

    /// The commands that rebuild the session on a server that knows nothing of it.
    pub fn replay(&self) -> Vec<Command> {
        let models = self.models.iter().map(|(id, m)| Command::LoadModel {
            model: *id,
            name: m.name.clone(),
            text: m.text.clone(),
            facets: m.facets,
        });
        let objects = self.objects.values().map(|e| Command::AddObject(e.spec.clone()));
        let tracks = self.objects.iter().map(|(id, e)| WireTrack::of(*id, &e.track)).collect();
        let rest = [
            Command::SetRules(self.rules.iter().map(WireRule::from).collect()),
            Command::SetResolution(self.resolution),
            Command::Restore(tracks),
        ];
        models.chain(objects).chain(rest).collect()
    }
}
