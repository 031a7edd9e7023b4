//! What a scene is made of: models that were loaded, and objects to be added.

use contactd_proto::Pose;
use contactd_proto::control::{FaceName, ObjectSpec};

/// A model that was loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModelInfo {
    /// Its id.
    pub id: u32,
    /// Its faces by face id.
    pub faces: Vec<FaceName>,
    /// What the import snapped or dropped.
    pub warnings: Vec<String>,
}

/// An object to be added: a model, where it stands, and what is declared of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    spec: ObjectSpec,
}

impl Object {
    /// A moving object of group "default" at the origin.
    pub fn new(name: &str, model: u32) -> Self {
        let spec = ObjectSpec {
            id: 0,
            model,
            name: name.into(),
            group: "default".into(),
            is_static: false,
            rotates: true,
            max_speed: f64::INFINITY,
            place: Pose::IDENTITY.into(),
            pose: Pose::IDENTITY.into(),
        };
        Self { spec }
    }

    /// What the server is told of it, under the id that it is given.
    pub(crate) fn spec(self, id: u32) -> ObjectSpec {
        ObjectSpec { id, ..self.spec }
    }

    /// Its group, for rules.
    pub fn group(mut self, group: &str) -> Self {
        self.spec.group = group.into();
        self
    }

    /// It never moves.
    pub fn fixed(mut self) -> Self {
        self.spec.is_static = true;
        self
    }

    /// It never turns: a motion that turns it will be refused.
    pub fn without_rotation(mut self) -> Self {
        self.spec.rotates = false;
        self
    }

    /// No point of it is ever faster than this, length per second; steps then need `dt`.
    pub fn max_speed(mut self, speed: f64) -> Self {
        self.spec.max_speed = speed;
        self
    }

    /// Where the model sits in the object's frame.
    pub fn place(mut self, place: Pose) -> Self {
        self.spec.place = place.into();
        self
    }

    /// Where the object stands.
    pub fn at(mut self, pose: Pose) -> Self {
        self.spec.pose = pose.into();
        self
    }
}
