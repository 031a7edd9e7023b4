//! Scene files: models, objects with their motions over one step, rules.
//!
//! TOML, every key known or refused. Errors name the file, the line, the column, what was expected and what was found.
//! Nothing is guessed: NaN and infinity are refused, a quaternion is normalised only when it nearly is one. What is right but has
//! no effect (a rule for a group that no object has, which leaves its pairs without one) is a `Note`. The models'
//! files are read by `Scene::load_models`, so that a scene can be looked at without them.

mod raw;
mod rules;

use self::raw::{RawObject, RawPose, RawScene};
use super::format::{ModelBytes, Source};
use super::openscad::Access;
use super::problem::Problem;
use super::{Facets, Import, ImportError, Limits, Note, Place};
use contactd_proto::pose_record::{self, PoseRecord, unit_quaternion};
use contactd_proto::{Detect, Motion, MotionState, Pose, Report, Rule};
use glam::DVec3;
use std::collections::{HashMap, HashSet};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// The largest scene file, bytes: far beyond a million objects' worth of poses is a mistake.
const MAX_TEXT: u64 = 256 << 20;

/// A scene: what stands in its file, checked, with names resolved.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The unit's label; may be empty.
    pub unit: String,
    /// Resolution for every pair, length; `None` for the default of each pair.
    pub resolution: Option<f64>,
    /// Where the scene states its resolution.
    pub resolution_at: Option<Place>,
    /// Duration of the step in seconds, for objects with a declared largest speed.
    pub dt: Option<f64>,
    /// Models in file order.
    pub models: Vec<ModelSource>,
    /// Objects in file order.
    pub objects: Vec<SceneObject>,
    /// Rules in file order; none means every pair.
    pub rules: Vec<Rule>,
    /// What stands there without effect, in file order: most likely a slip of the pen.
    pub notes: Vec<Note>,
    /// What errors call the scene's file.
    pub file: String,
    /// Where its models' texts may import files from, and what flattens them.
    pub access: Access,
}

/// A model of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelSource {
    /// Its name in the scene.
    pub name: String,
    /// Its file, relative to the scene's folder unless absolute.
    pub path: PathBuf,
    /// Where the scene names that file.
    pub at: Place,
    /// What stands for its content where the scene's file tells the solid itself, as robots' files do: a flattened OpenSCAD text, in
    /// which names of files are relative to the folder of `path`.
    pub text: Option<String>,
}

impl ModelSource {
    /// What sentences call the text that lines are counted in: the file, or what OpenSCAD makes of it, or what is made of a link.
    pub fn text_name(&self) -> String {
        if self.text.is_some() {
            return format!("{}, {}", self.path.display(), self.name);
        }
        let flattened = if super::openscad::is_source(&self.path) { ", flattened" } else { "" };
        format!("{}{flattened}", self.path.display())
    }
}

/// An object of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneObject {
    /// Its name.
    pub name: String,
    /// Where the scene names it.
    pub at: Place,
    /// Index of its model in `Scene::models`.
    pub model: usize,
    /// Its group, for rules.
    pub group: String,
    /// Declared never to move.
    pub is_static: bool,
    /// The model in the object's frame.
    pub place: Pose,
    /// The object's frame over the step.
    pub motion: Motion,
    /// The same as a record of a step that begins at `motion.start`, numbers as they stand in the file; its object id is
    /// the caller's to set. `None` for an object that rests.
    pub record: Option<PoseRecord>,
    /// False when it is declared never to turn.
    pub rotates: bool,
    /// Declared largest speed of any of its points, length per second.
    pub max_speed: Option<f64>,
}

/// A pose as a scene file tells it: `{:?}` of a double is the shortest text that reads back to the same bits.
pub fn pose_text(pose: &Pose) -> String {
    format!("{{ position = {:?}, rotation = {:?} }}", pose.position.to_array(), pose.rotation.to_array())
}

/// Why a scene was not read.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read at all.
    #[error("{file}: expected a readable file, found {reason}")]
    Read {
        /// The file.
        file: String,
        /// The system's reason.
        reason: std::io::Error,
    },
    /// Not the TOML that a scene is made of.
    #[error("{file}:{at}: {message}")]
    Format {
        /// The file.
        file: String,
        /// Where.
        at: Place,
        /// The TOML reader's sentence.
        message: String,
    },
    /// A value that a scene cannot have.
    #[error("{file}:{at}: expected {expected}, found {found}")]
    Value {
        /// The file.
        file: String,
        /// Where.
        at: Place,
        /// What could stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// One of its models.
    #[error(transparent)]
    Model(#[from] ImportError),
}

impl SceneError {
    /// What is wrong with a file in which others read the same problems as in a model's text.
    pub(super) fn of_problem(file: String, at: Place, problem: Problem) -> Self {
        match problem {
            Problem::Syntax { expected, found } => Self::Value { file, at, expected, found },
            other => Self::Format { file, at, message: other.to_string() },
        }
    }
}

/// Reads a scene file.
pub fn read_scene(path: &Path) -> Result<Scene, SceneError> {
    let file = path.display().to_string();
    let read = |reason| SceneError::Read { file: file.clone(), reason };
    let large = || read(std::io::Error::other(format!("more than {MAX_TEXT} bytes")));
    if std::fs::metadata(path).map_err(read)?.len() > MAX_TEXT {
        return Err(large());
    }
    // A device or a pipe has no length, and perhaps no end.
    let mut text = String::new();
    let opened = std::fs::File::open(path).map_err(read)?;
    opened.take(MAX_TEXT + 1).read_to_string(&mut text).map_err(read)?;
    if text.len() as u64 > MAX_TEXT {
        return Err(large());
    }
    Scene::parse(&file, &text, path.parent().unwrap_or(Path::new("")))
}

impl Scene {
    /// True where the rules test a pair of objects, by their indices: the first rule that names them decides; without rules all are.
    pub fn is_tested(&self, a: usize, b: usize) -> bool {
        let objects = [a, b].map(|i| &self.objects[i]);
        let (groups, names) = (objects.map(|o| o.group.as_str()), objects.map(|o| o.name.as_str()));
        let deciding = self.rules.iter().find(|rule| rule.names(groups, names));
        self.rules.is_empty() || deciding.is_some_and(|rule| rule.detect != Detect::Off)
    }

    /// Reads a scene from its text; `file` is what errors call it, `folder` what its models' files are relative to.
    pub fn parse(file: &str, text: &str, folder: &Path) -> Result<Self, SceneError> {
        let checker = Checker { file, text };
        let raw: RawScene = toml::from_str(text).map_err(|e| {
            let at = e.span().map_or(Place::START, |s| Place::of_offset(text, s.start));
            let message = e.message().lines().map(str::trim).collect::<Vec<_>>().join(", ");
            SceneError::Format { file: file.to_owned(), at, message }
        })?;
        let resolution = raw.resolution.as_ref().map(|r| checker.positive("resolution", r)).transpose()?;
        let dt = raw.dt.as_ref().map(|dt| checker.positive("dt", dt)).transpose()?;

        let mut models = Vec::with_capacity(raw.model.len());
        let mut model_of: HashMap<String, usize> = HashMap::new();
        for m in &raw.model {
            checker.new_name("model", &m.name, &mut model_of)?;
            let path = folder.join(m.file.as_ref());
            models.push(ModelSource { name: m.name.as_ref().clone(), path, at: checker.place(&m.file), text: None });
        }
        let mut objects = Vec::with_capacity(raw.object.len());
        let mut object_of: HashMap<String, usize> = HashMap::new();
        for o in &raw.object {
            checker.new_name("object", &o.name, &mut object_of)?;
            let Some(&model) = model_of.get(o.model.as_ref()) else {
                return Err(checker.wrong(&o.model, "the name of a model", &format!("\"{}\"", o.model.as_ref())));
            };
            objects.push(checker.object(o, model)?);
            if let (Some(speed), None) = (&o.max_speed, dt) {
                let found = "none: a speed per second says nothing without it";
                return Err(checker.wrong(speed, "dt, the duration of the step in seconds, beside max_speed", found));
            }
        }
        let mut rules = Vec::with_capacity(raw.rule.len());
        for r in &raw.rule {
            rules.push(checker.rule(r, &object_of)?);
        }
        let notes = checker.without_effect(&raw, &objects);
        let unit = raw.unit.unwrap_or_default();
        let resolution_at = raw.resolution.as_ref().map(|r| checker.place(r));
        let root = raw.import_root.as_ref().map(|root| checker.root(folder, root)).transpose()?;
        let (file, access) = (file.to_owned(), Access { root, ..Access::default() });
        Ok(Self { unit, resolution, resolution_at, dt, models, objects, rules, notes, file, access })
    }

    /// Models as they stand, each an object at rest that is called as its file is, every pair told with its regions. What is
    /// wrong with one is told of its file: the scene has none.
    pub fn of_models(files: &[PathBuf]) -> Self {
        let mut names: Vec<String> = Vec::with_capacity(files.len());
        for file in files {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let again = (2..).map(|k| format!("{stem} {k}"));
            let name = std::iter::once(stem.clone()).chain(again).find(|n| !names.contains(n));
            names.push(name.unwrap_or(stem));
        }
        let model = |(file, name): (&PathBuf, &String)| ModelSource {
            name: name.clone(),
            path: file.clone(),
            at: Place::START,
            text: None,
        };
        let object = |(model, name): (usize, &String)| SceneObject {
            name: name.clone(),
            at: Place::START,
            model,
            group: "default".into(),
            is_static: false,
            place: Pose::IDENTITY,
            motion: MotionState::resting(Pose::IDENTITY).motion,
            record: None,
            rotates: true,
            max_speed: None,
        };
        let every = Rule { report: Report::Patch, ..Rule::new(["default".into(), "default".into()]) };
        Self {
            unit: String::new(),
            resolution: None,
            resolution_at: None,
            dt: None,
            models: files.iter().zip(&names).map(model).collect(),
            objects: names.iter().enumerate().map(object).collect(),
            rules: vec![every],
            notes: Vec::new(),
            file: String::new(),
            access: Access::default(),
        }
    }

    /// Reads every model of the scene, in order.
    pub fn load_models(&self, facets: Facets, limits: &Limits) -> Result<Vec<Import>, SceneError> {
        self.each_model(limits, |source| source.import(facets, limits))
    }

    /// What `read` makes of each of the models, in order, from its file.
    ///
    /// # Errors
    /// A file that cannot be read, and whatever `read` refuses.
    pub fn each_model<T>(
        &self,
        limits: &Limits,
        mut read: impl FnMut(&Source) -> Result<T, ImportError>,
    ) -> Result<Vec<T>, SceneError> {
        let each = self.models.iter().map(|m| {
            let bytes = match &m.text {
                None => ModelBytes::read(&m.path, &self.access, limits),
                Some(text) => Ok(ModelBytes::of_text(m.text_name(), text, &m.path, &self.access, limits)),
            };
            bytes.and_then(|file| read(&file.source())).map_err(|e| match e {
                ImportError::Read { file, reason } if !self.file.is_empty() => SceneError::Value {
                    file: self.file.clone(),
                    at: m.at,
                    expected: "a model file".into(),
                    found: format!("{file}: {reason}"),
                },
                // Places in a text that nobody has written help nobody.
                ImportError::Content { problem, .. } if m.text.is_some() => {
                    let is_hull = m.text.as_deref().is_some_and(|text| text.contains("hull()"));
                    let hint = match problem.is_of_a_mesh() && !is_hull {
                        true => "; its convex hull needs no closed mesh (--hulls)",
                        false => "",
                    };
                    SceneError::Format {
                        file: self.file.clone(),
                        at: m.at,
                        message: format!("the geometry of {:?}: {problem}{hint}", m.name),
                    }
                }
                other => other.into(),
            })
        });
        each.collect()
    }
}

/// A pose as it stands in the file, and what it means.
#[derive(Clone, Copy)]
struct Written {
    position: DVec3,
    rotation: [f64; 4],
    pose: Pose,
}

/// Turns raw values into checked ones, with places for what is wrong.
struct Checker<'a> {
    file: &'a str,
    text: &'a str,
}

impl Checker<'_> {
    fn place<T>(&self, value: &Spanned<T>) -> Place {
        Place::of_offset(self.text, value.span().start)
    }

    fn wrong<T>(&self, value: &Spanned<T>, expected: &str, found: &str) -> SceneError {
        let (expected, found) = (expected.to_owned(), found.to_owned());
        SceneError::Value { file: self.file.to_owned(), at: self.place(value), expected, found }
    }

    fn new_name(
        &self,
        what: &str,
        name: &Spanned<String>,
        known: &mut HashMap<String, usize>,
    ) -> Result<(), SceneError> {
        let next = known.len();
        if name.as_ref().is_empty() {
            return Err(self.wrong(name, &format!("a name for the {what}"), "an empty one"));
        }
        match known.insert(name.as_ref().clone(), next) {
            None => Ok(()),
            Some(_) => {
                let found = format!("a second {what} \"{}\"", name.as_ref());
                Err(self.wrong(name, &format!("a name that no other {what} has"), &found))
            }
        }
    }

    /// A folder that the scene names.
    fn root(&self, folder: &Path, value: &Spanned<String>) -> Result<PathBuf, SceneError> {
        let root = folder.join(value.as_ref());
        match root.is_dir() {
            true => Ok(root),
            false => Err(self.wrong(value, "a folder as import_root", &format!("{:?}", value.as_ref()))),
        }
    }

    fn positive(&self, name: &str, value: &Spanned<f64>) -> Result<f64, SceneError> {
        let v = *value.as_ref();
        if v > 0.0 && v.is_finite() {
            return Ok(v);
        }
        Err(self.wrong(value, &format!("a positive finite number as {name}"), &v.to_string()))
    }

    fn vector(&self, value: &Spanned<[f64; 3]>, what: &str) -> Result<DVec3, SceneError> {
        let v = DVec3::from_array(*value.as_ref());
        if v.is_finite() {
            return Ok(v);
        }
        Err(self.wrong(value, &format!("a finite {what}"), &format!("{:?}", value.as_ref())))
    }

    /// The quaternion as it stands in the file; it is one once normalised.
    fn quaternion(&self, value: &Spanned<[f64; 4]>) -> Result<[f64; 4], SceneError> {
        let q = *value.as_ref();
        if unit_quaternion(q).is_ok() {
            return Ok(q);
        }
        let found = format!("{q:?} with squared length {}", q.iter().map(|c| c * c).sum::<f64>());
        Err(self.wrong(value, "a unit quaternion [x, y, z, w] as rotation", &found))
    }

    /// `raw` with `default` for what it leaves out.
    fn pose(&self, raw: &RawPose, default: Written) -> Result<Written, SceneError> {
        let position = raw.position.as_ref().map(|p| self.vector(p, "position")).transpose()?;
        let rotation = raw.rotation.as_ref().map(|q| self.quaternion(q)).transpose()?;
        let (position, rotation) = (position.unwrap_or(default.position), rotation.unwrap_or(default.rotation));
        Ok(Written { position, rotation, pose: Pose::new(position, unit_quaternion(rotation).unwrap_or_default()) })
    }

    fn object(&self, o: &RawObject, model: usize) -> Result<SceneObject, SceneError> {
        let name = o.name.as_ref();
        let is_static = match &o.motion {
            None => false,
            Some(word) => match word.as_ref().as_str() {
                "static" => true,
                "moving" => false,
                other => return Err(self.wrong(word, "\"static\" or \"moving\"", &format!("\"{other}\""))),
            },
        };
        let origin = Written { position: DVec3::ZERO, rotation: [0.0, 0.0, 0.0, 1.0], pose: Pose::IDENTITY };
        let place = self.pose(&o.place, origin)?.pose;
        let start = self.pose(&o.start, origin)?;
        let end = self.pose(&o.end, start)?;
        let record = match &o.rotation_vector {
            Some(v) if o.end.rotation.is_some() => {
                let expected = format!("either end.rotation or rotation_vector of object \"{name}\"");
                return Err(self.wrong(v, &expected, "both"));
            }
            Some(v) => PoseRecord::turn(0, end.position, self.vector(v, "rotation_vector")?),
            None => PoseRecord {
                object: 0,
                flags: pose_record::END,
                position: end.position.to_array(),
                rotation: end.rotation,
            },
        };
        // The numbers were checked one by one: what a step would refuse has been refused.
        let motion_state =
            record.decode().map_or(MotionState::resting(start.pose), |order| MotionState::ordered(start.pose, order));
        let motion = motion_state.motion;
        let record = (!motion_state.is_rest()).then_some(record);
        if is_static && !motion_state.is_rest() {
            return Err(self.wrong(&o.name, &format!("a static object \"{name}\" that rests"), "one that moves"));
        }
        if o.rotates == Some(false) && motion.spin != DVec3::ZERO {
            let expected = format!("an object \"{name}\" with rotates = false that does not turn");
            return Err(self.wrong(&o.name, &expected, "one that does"));
        }
        let max_speed = o.max_speed.as_ref().map(|v| self.positive("max_speed", v)).transpose()?;
        Ok(SceneObject {
            name: name.clone(),
            at: self.place(&o.name),
            model,
            group: o.group.clone().unwrap_or_else(|| "default".into()),
            is_static,
            place,
            motion,
            record,
            rotates: o.rotates.unwrap_or(true),
            max_speed,
        })
    }

    /// What stands in a scene without effect: models of no object, rules that decide for no pair, exceptions that except none,
    /// and the duration of a step that no declaration asks for.
    fn without_effect(&self, raw: &RawScene, objects: &[SceneObject]) -> Vec<Note> {
        let mut notes = Vec::new();
        let mut note = |at: Place, text: String| notes.push(Note { at, text, amount: None });
        if let (Some(dt), true) = (&raw.dt, objects.iter().all(|o| o.max_speed.is_none())) {
            note(self.place(dt), "dt has no effect: no object has a max_speed".into());
        }
        let used: HashSet<usize> = objects.iter().map(|o| o.model).collect();
        for (_, m) in raw.model.iter().enumerate().filter(|(i, _)| !used.contains(i)) {
            note(self.place(&m.name), format!("no object is of the model \"{}\"", m.name.as_ref()));
        }
        self.rules_without_effect(&raw.rule, objects, &mut note);
        notes.sort_by_key(|n| (n.at.line, n.at.column));
        notes
    }

    /// Refuses a word that is none of some.
    fn wrong_word(&self, word: &Spanned<String>, words: impl Iterator<Item = &'static str>) -> SceneError {
        let expected = words.map(|w| format!("\"{w}\"")).collect::<Vec<_>>().join(" or ");
        self.wrong(word, &expected, &format!("\"{}\"", word.as_ref()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contactd_proto::InitialOverlap;
    use std::f64::consts::TAU;

    const MODELS: &str = "[[model]]\nname = \"m\"\nfile = \"m.csg\"\n";

    fn parse(text: &str) -> Result<Scene, String> {
        Scene::parse("s.toml", text, Path::new("parts")).map_err(|e| e.to_string())
    }

    /// A scene with one object that has `lines`.
    fn object(lines: &str) -> Result<Scene, String> {
        parse(&format!("{MODELS}[[object]]\nname = \"o\"\nmodel = \"m\"\n{lines}"))
    }

    #[test]
    fn everything_a_scene_can_say_is_read() {
        let text = r#"
            unit = "mm"
            dt = 0.5
            resolution = 1e-6
            [[model]]
            name = "plate"
            file = "plate.csg"
            [[object]]
            name = "plate"
            model = "plate"
            group = "cell"
            motion = "static"
            place = { position = [0, 0, -1] }
            [[object]]
            name = "gripper"
            model = "plate"
            group = "robot"
            start = { position = [0, 0, 5], rotation = [0, 0, 0.7071, 0.7071] }
            end = { position = [1, 0, 4] }
            rotation_vector = [0, 0, 6.283185307179586]
            max_speed = 3
            [[rule]]
            between = ["robot", "cell"]
            except = [["gripper", "plate"]]
            detect = "discrete"
            report = "patch"
            penetration = true
            margin = 0.5
            initial_overlap = "ignore_if_separating"
            sensor = true
        "#;
        let scene = parse(text).expect("a scene");
        assert_eq!((scene.unit.as_str(), scene.resolution), ("mm", Some(1e-6)));
        assert_eq!(scene.models[0].path, Path::new("parts/plate.csg"));
        let [plate, gripper] = scene.objects.as_slice() else { panic!("two objects") };
        assert!(plate.is_static && plate.motion.is_rest() && plate.record.is_none());
        assert_eq!(plate.place.position, DVec3::new(0.0, 0.0, -1.0));
        assert!(gripper.motion.start.rotation.is_normalized(), "0.7071 is nearly a quarter turn's half");
        assert_eq!(gripper.motion.spin, DVec3::new(0.0, 0.0, TAU));
        assert_eq!(gripper.motion.velocity, DVec3::new(1.0, 0.0, -1.0));
        assert_eq!((gripper.group.as_str(), gripper.max_speed), ("robot", Some(3.0)));
        let rule = &scene.rules[0];
        assert_eq!((rule.detect, rule.report, rule.margin), (Detect::Discrete, Report::Patch, 0.5));
        assert_eq!(rule.initial_overlap, InitialOverlap::IgnoreIfSeparating);
        assert!(rule.penetration && rule.sensor && rule.except.len() == 1);
    }

    #[test]
    fn what_is_left_out_has_its_default() {
        let scene = object("start = { rotation = [0, 0, 1, 0] }").expect("a scene");
        let o = &scene.objects[0];
        assert_eq!((scene.resolution, o.group.as_str(), o.rotates), (None, "default", true));
        assert!(o.motion.is_rest() && o.record.is_none(), "end is start, each field by itself");
        let turned = object("end = { rotation = [0, 0, 1, 0] }").expect("a scene");
        assert_eq!(turned.objects[0].motion.spin, DVec3::new(0.0, 0.0, TAU / 2.0));
        assert_eq!(turned.objects[0].motion.velocity, DVec3::ZERO);
    }

    #[test]
    fn an_objects_record_is_its_motion() {
        let scene =
            object("start = { rotation = [0.1, 0.2, 0.3, 0.927] }\nend = { position = [1, 2, 3] }").expect("a scene");
        let o = &scene.objects[0];
        let order = o.record.expect("it moves").decode().expect("a good record");
        assert_eq!(MotionState::ordered(o.motion.start, order).motion, o.motion);
        assert_eq!(o.motion.spin, DVec3::ZERO);
    }

    #[test]
    fn every_mistake_is_a_sentence_with_its_place() {
        let o = |lines: &str| format!("{MODELS}[[object]]\nname = \"o\"\nmodel = \"m\"\n{lines}");
        let rule = |lines: &str| o(&format!("[[rule]]\nbetween = [\"a\", \"b\"]\n{lines}"));
        let table = [
            (
                "colour = 1".into(),
                "1:1: unknown field `colour`, expected one of `unit`, `resolution`, `dt`, `import_root`, `model`, `object`, `rule`",
            ),
            ("unit = ".into(), "1:8: "),
            ("resolution = 0".into(), "1:14: expected a positive finite number as resolution, found 0"),
            ("resolution = nan".into(), "1:14: expected a positive finite number as resolution, found NaN"),
            (format!("{MODELS}{MODELS}"), "5:8: expected a name that no other model has, found a second model \"m\""),
            (
                o("[[object]]\nname = \"o\"\nmodel = \"m\""),
                "8:8: expected a name that no other object has, found a second object \"o\"",
            ),
            (o("[[object]]\nname = \"p\"\nmodel = \"x\""), "9:9: expected the name of a model, found \"x\""),
            (o("[[object]]\nname = \"\"\nmodel = \"m\""), "8:8: expected a name for the object, found an empty one"),
            (o("motion = \"dynamic\""), "7:10: expected \"static\" or \"moving\", found \"dynamic\""),
            (o("start = { position = [0, nan, 0] }"), "7:22: expected a finite position, found [0.0, NaN, 0.0]"),
            (o("end = { position = [0, 0] }"), "7:20: invalid length 2, expected an array of length 3"),
            (
                o("start = { rotation = [0, 0, 0, 0] }"),
                "7:22: expected a unit quaternion [x, y, z, w] as rotation, found [0.0, 0.0, 0.0, 0.0] with squared length 0",
            ),
            (
                o("end = { rotation = [0, 0, 0, 1.001] }"),
                "7:20: expected a unit quaternion [x, y, z, w] as rotation, found [0.0, 0.0, 0.0, 1.001] with squared length",
            ),
            (
                o("place = { rotation = [inf, 0, 0, 1] }"),
                "7:22: expected a unit quaternion [x, y, z, w] as rotation, found [inf, 0.0, 0.0, 1.0] with squared length inf",
            ),
            (o("rotation_vector = [0, 0, inf]"), "7:19: expected a finite rotation_vector, found [0.0, 0.0, inf]"),
            (
                o("rotation_vector = [0, 0, 1]\nend = { rotation = [0, 0, 0, 1] }"),
                "7:19: expected either end.rotation or rotation_vector of object \"o\", found both",
            ),
            (
                o("motion = \"static\"\nend = { position = [1, 0, 0] }"),
                "5:8: expected a static object \"o\" that rests, found one that moves",
            ),
            (
                o("rotates = false\nrotation_vector = [0, 0, 1]"),
                "5:8: expected an object \"o\" with rotates = false that does not turn, found one that does",
            ),
            (o("max_speed = -1"), "7:13: expected a positive finite number as max_speed, found -1"),
            (
                o("max_speed = 1"),
                "7:13: expected dt, the duration of the step in seconds, beside max_speed, found none",
            ),
            (o("speed = 1"), "7:1: unknown field `speed`, expected one of `name`, `model`, `group`, `motion`"),
            ("import_root = \"none\"".into(), "1:15: expected a folder as import_root, found \"none\""),
            (rule("detect = \"on\""), "9:10: expected \"off\" or \"discrete\" or \"continuous\", found \"on\""),
            (rule("report = \"all\""), "9:10: expected \"hit\" or \"time\" or \"contact\" or \"patch\", found \"all\""),
            (rule("initial_overlap = \"\""), "9:19: expected \"report\" or \"ignore_if_separating\", found \"\""),
            (rule("margin = -0.5"), "9:10: expected a finite margin that is not negative, found -0.5"),
            (rule("except = [[\"o\", \"p\"]]"), "9:17: expected the name of an object, found \"p\""),
        ];
        for (text, sentence) in table {
            let error = parse(&text).err().unwrap_or_else(|| panic!("{text}: was read"));
            let expected = format!("s.toml:{sentence}");
            assert!(error.starts_with(&expected), "{text}\n  said    {error}\n  not     {expected}");
            assert!(!error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn a_missing_model_file_is_told_where_the_scene_names_it() {
        let scene = parse(MODELS).expect("a scene");
        let error = scene.load_models(Facets::Auto, &Limits::default()).expect_err("no such file").to_string();
        assert!(error.starts_with("s.toml:3:8: expected a model file, found parts/m.csg: "), "{error}");
        let error = read_scene(Path::new("nowhere.toml")).expect_err("no such file").to_string();
        assert!(error.starts_with("nowhere.toml: expected a readable file, found "), "{error}");
    }

    #[test]
    fn what_has_no_effect_is_reported() {
        let objects = "[[object]]\nname = \"a\"\nmodel = \"m\"\ngroup = \"cell\"\n[[object]]\nname = \"b\"\nmodel = \"m\"\n\
            group = \"robot\"\n[[object]]\nname = \"c\"\nmodel = \"m\"\ngroup = \"robot\"\n";
        let notes = |rest: &str| -> Vec<String> {
            let scene = parse(&format!("{MODELS}{objects}{rest}")).unwrap_or_else(|e| panic!("{rest}: {e}"));
            scene.notes.iter().map(ToString::to_string).collect()
        };
        let rule = |lines: &str| notes(&format!("[[rule]]\n{lines}\n"));
        for lines in [
            "between = [\"cell\", \"robot\"]",
            "between = [\"robot\", \"robot\"]\nexcept = [[\"c\", \"b\"]]\n[[rule]]\nbetween = [\"robot\", \"robot\"]",
            "between = [\"robot\", \"cell\"]\nexcept = [[\"c\", \"a\"]]\ndetect = \"off\"",
        ] {
            assert_eq!(rule(lines), Vec::<String>::new(), "{lines}");
        }
        let none = "the rule decides for no pair";
        for (lines, note) in [
            ("between = [\"cel\", \"robot\"]", format!("17:12: {none}: no object is of the group \"cel\"")),
            ("between = [\"cell\", \"Robot\"]", format!("17:20: {none}: no object is of the group \"Robot\"")),
            ("between = [\"cell\", \"cell\"]", format!("17:12: {none}: the group \"cell\" has one object only")),
            (
                "between = [\"cell\", \"robot\"]\n[[rule]]\nbetween = [\"robot\", \"cell\"]",
                format!("19:12: {none}: one before it has the same groups and no exceptions"),
            ),
            (
                "between = [\"cell\", \"robot\"]\nexcept = [[\"b\", \"c\"]]",
                "18:12: the exception has no effect: \"b\" and \"c\" are no pair of the rule's groups".into(),
            ),
            (
                "between = [\"cell\", \"robot\"]\ndetect = \"off\"\nmargin = 1.0\nreport = \"time\"",
                "19:10: what the rule asks for has no effect beside detect = \"off\"".into(),
            ),
        ] {
            assert_eq!(rule(lines), [note], "{lines}");
        }
        let unused = notes("[[model]]\nname = \"n\"\nfile = \"n.csg\"");
        assert_eq!(unused, ["17:8: no object is of the model \"n\""]);
        let scene = parse(&format!("dt = 0.5\n{MODELS}{objects}")).expect("readable");
        assert_eq!(scene.notes[0].to_string(), "1:6: dt has no effect: no object has a max_speed");
    }
}
