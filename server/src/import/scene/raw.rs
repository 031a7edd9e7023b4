//! A scene's file as it is read, before anything is checked. What is said of each key here is what docs/reference/scene.md says.

use super::rules::RawRule;
use serde::Deserialize;
use toml::Spanned;

/// A scene's file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScene {
    /// Label of the models' unit of length, for what is printed, such as "mm".
    pub(super) unit: Option<String>,
    /// Resolution of every pair, length > 0; else 1e-9 of the larger bounding radius of the two.
    pub(super) resolution: Option<Spanned<f64>>,
    /// Duration of the step in seconds, > 0; needed beside `max_speed`.
    pub(super) dt: Option<Spanned<f64>>,
    /// The folder, with all below it, that models' texts may import files from, relative to the scene's; else each text's own.
    pub(super) import_root: Option<Spanned<String>>,
    /// The models: one `[[model]]` each.
    #[serde(default)]
    pub(super) model: Vec<RawModel>,
    /// The objects: one `[[object]]` each.
    #[serde(default)]
    pub(super) object: Vec<RawObject>,
    /// The rules: one `[[rule]]` each; without any every pair is searched.
    #[serde(default)]
    pub(super) rule: Vec<RawRule>,
}

/// A model.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawModel {
    /// Its name, which no other model has.
    pub(super) name: Spanned<String>,
    /// Its file, relative to the scene's folder; its ending tells the format.
    pub(super) file: Spanned<String>,
}

/// An object.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawObject {
    /// Its name, which no other object has.
    pub(super) name: Spanned<String>,
    /// The name of its model.
    pub(super) model: Spanned<String>,
    /// Its group, which rules name; else "default".
    pub(super) group: Option<String>,
    /// "static": declared never to move, and never asked about with another static one; or "moving", as without it.
    pub(super) motion: Option<Spanned<String>>,
    /// The model in the object's frame.
    #[serde(default)]
    pub(super) place: RawPose,
    /// The object's frame at the start of the step, in the world.
    #[serde(default)]
    pub(super) start: RawPose,
    /// The same at the end of the step; what it leaves out is as at the start.
    #[serde(default)]
    pub(super) end: RawPose,
    /// The rotation over the step in place of the rotation in `end`: axis times angle in radians, in the world; half a turn and more.
    pub(super) rotation_vector: Option<Spanned<[f64; 3]>>,
    /// false: declared never to turn.
    pub(super) rotates: Option<bool>,
    /// Declared largest speed of any of its points, length per second.
    pub(super) max_speed: Option<Spanned<f64>>,
}

/// A pose, as far as it is stated.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPose {
    /// x, y, z; else 0, 0, 0.
    pub(super) position: Option<Spanned<[f64; 3]>>,
    /// A unit quaternion x, y, z, w; else no rotation.
    pub(super) rotation: Option<Spanned<[f64; 4]>>,
}
