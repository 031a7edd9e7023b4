//! Scenes and robots from files into a session, over shared memory or embedded.
//!
//! The files are read here, by the client: models, meshes and what else they name are sent with them, so the server needs none of them.
//! Objects, motions and rules are those of `contactd check FILE`, to the bit.
//!
//! A robot is driven by its joints. Links go on their true arcs: an object's motion is one of its frame, whose origin goes straight
//! while it turns, so each link that moves in a step first gets a frame on the axis that turns it (`Session::reframe`).
//!
//! Floor 10: imports `import`.

use crate::import::robot::{self, Ask, DofKind, LinkPath, Robot, Values};
use crate::import::{Attachment, Limits, Note, Place, Scene, SceneError, read_scene};
use contactd_client::{Error, Frame, ModelInfo, Object, Reply, Session, Transport};
use contactd_proto::control::{Facets, ModelFile};
use contactd_proto::{Pose, PoseRecord, Rule};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How a scene is loaded.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Where a robot's joints stand: radians, metres; of others what the file says.
    pub joints: Values,
    /// The keyframe that joints begin at, of MJCF.
    pub key: Option<String>,
    /// Meshes are taken as their convex hulls, as MuJoCo does anyway.
    pub hulls: bool,
    /// Folders in which packages are looked for (`package://NAME/…`, `model://NAME/…`), before the file's own and those above it.
    pub packages: Vec<PathBuf>,
    /// An SRDF file with pairs that are not to be tested.
    pub srdf: Option<PathBuf>,
    /// The folder that texts may import files from; `None`: each from its own.
    pub import_root: Option<PathBuf>,
    /// The session's rules and resolution stay as they are; the scene's rules are in [`LoadedScene::rules`].
    pub keeps_rules: bool,
}

/// Why a scene was not loaded, or a robot not moved; the session has what it had.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// What is wrong with its files, or with joint values.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// What a server refuses of it.
    #[error("{file}:{at}: {what}: {error}")]
    Refused {
        /// The scene's file.
        file: String,
        /// Where it says so.
        at: Place,
        /// The model, the object, or the rules.
        what: String,
        /// Why.
        error: Error,
    },
    /// Something was asked of a scene that only robots have, or a file that is no scene.
    #[error("{file}: expected {expected}, found {found}")]
    Kind {
        /// The scene's file.
        file: String,
        /// What could stand there.
        expected: &'static str,
        /// What does.
        found: String,
    },
    /// A call of the session.
    #[error(transparent)]
    Session(#[from] Error),
}

/// An object of a scene that was loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LoadedObject {
    /// Its name.
    pub name: String,
    /// Its id in the session.
    pub id: u32,
    /// The id of its model.
    pub model: u32,
}

/// A joint of a robot: a degree of freedom that has a value of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// It turns, and its value is an angle in radians; otherwise it slides, metres.
    pub turns: bool,
    /// Its limits; infinite where it has none.
    pub range: [f64; 2],
    /// Where it stands.
    pub value: f64,
}

/// A scene that was loaded into a session. The session's calls do all that they do; this knows names, and drives robots.
#[derive(Debug)]
pub struct LoadedScene {
    /// Its objects, in the order of the file.
    pub objects: Vec<LoadedObject>,
    /// Its models, each once: their ids and their faces.
    pub models: Vec<ModelInfo>,
    /// Its rules, by names of groups and objects.
    pub rules: Vec<Rule>,
    /// The unit of length; may be empty.
    pub unit: String,
    /// What has no effect, was left out or was taken in another way, a sentence each.
    pub notes: Vec<String>,
    /// Duration of the step in seconds that a scene file says, for objects with a declared largest speed.
    pub dt: Option<f64>,
    file: String,
    kind: Kind,
    /// The frame that each object has, as it was told last: its model in the frame, and the frame; `None`: it has moved since.
    frames: Vec<Option<(Pose, Pose)>>,
    /// Objects that never move.
    fixed: Vec<bool>,
}

#[derive(Debug)]
enum Kind {
    /// A scene file: each object's step.
    Steps(Vec<LinkPath>),
    /// A robot.
    Robot(Box<Driven>),
}

#[derive(Debug)]
struct Driven {
    path: PathBuf,
    robot: Robot,
    /// The link of each object.
    owners: Vec<usize>,
    /// Where the joints stand, of those that were told; and where they stood before the last step.
    values: Values,
    before: Values,
}

/// What a file tells, before it is in a session.
struct Told {
    scene: Scene,
    kind: Kind,
}

/// Sessions that take scenes from files.
pub trait LoadScene {
    /// Loads a scene file (`.toml`) or a robot or world (URDF, SDFormat, MJCF) into the session, beside what it has. The scene's rules and
    /// resolution replace the session's, where it has any, unless `options.keeps_rules`.
    ///
    /// # Errors
    /// One sentence with file, line and column; the session keeps what it had, but for models.
    fn load_scene(&mut self, path: impl AsRef<Path>, options: &LoadOptions) -> Result<LoadedScene, LoadError>;
}

impl<T: Transport> LoadScene for Session<T> {
    fn load_scene(&mut self, path: impl AsRef<Path>, options: &LoadOptions) -> Result<LoadedScene, LoadError> {
        let told = read(path.as_ref(), options)?;
        let mut ids = Vec::new();
        put(self, told, options.keeps_rules, &mut ids).inspect_err(|_| {
            for id in ids {
                // Where the session is lost nothing is left of it anyway.
                let _ = self.remove_object(id);
            }
        })
    }
}

/// Reads a scene's file.
fn read(path: &Path, options: &LoadOptions) -> Result<Told, LoadError> {
    let LoadOptions { joints, key, hulls, packages, srdf, import_root, .. } = options;
    let wrong =
        |expected, found: &str| LoadError::Kind { file: path.display().to_string(), expected, found: found.to_owned() };
    let mut told = if robot::is_robot(path) {
        let (from, to) = (joints.clone(), Values::new());
        let (key, packages, srdf) = (key.clone(), packages.clone(), srdf.clone());
        let ask = Ask { from, to, hulls: *hulls, packages, key, srdf };
        let robot = robot::read_robot(path, &ask)?;
        let scene = robot::scene_of(path, &robot, &ask)?;
        let (owners, values) = (robot.owners(), ask.from);
        let driven = Driven { path: path.to_owned(), robot, owners, before: values.clone(), values };
        Told { scene, kind: Kind::Robot(Box::new(driven)) }
    } else if path.extension().is_some_and(|e| e == "toml") {
        let robots = "a robot (URDF, SDFormat, MJCF) beside joints, a keyframe, hulls, packages and an SRDF file";
        if !joints.is_empty() || key.is_some() || *hulls || !packages.is_empty() || srdf.is_some() {
            return Err(wrong(robots, "a scene file"));
        }
        let scene = read_scene(path)?;
        let step = |o: &crate::import::SceneObject| LinkPath { place: o.place, motion: o.motion, record: o.record };
        let kind = Kind::Steps(scene.objects.iter().map(step).collect());
        Told { scene, kind }
    } else {
        return Err(wrong("a scene (.toml) or a robot (.urdf, .sdf, .world, .xml, .mjcf)", "another kind of file"));
    };
    if let Some(root) = import_root {
        told.scene.access.root = Some(root.clone());
    }
    Ok(told)
}

/// The models of a scene as they are sent, in its order.
fn files(scene: &Scene) -> Result<Vec<ModelFile>, SceneError> {
    scene.each_model(&Limits::default(), |source| {
        let attached = source.attached.map(<[Attachment]>::to_vec);
        Ok(ModelFile { attached, ..ModelFile::new(source.name, source.format()?.name, source.bytes) })
    })
}

/// Puts a scene into a session; `ids` are those of the objects that came to be in it.
fn put<T: Transport>(
    session: &mut Session<T>,
    Told { scene, kind }: Told,
    keeps_rules: bool,
    ids: &mut Vec<u32>,
) -> Result<LoadedScene, LoadError> {
    let refused = |at: Place, what: String| {
        let file = scene.file.clone();
        move |error| LoadError::Refused { file, at, what, error }
    };
    let mut notes: Vec<String> = scene.notes.iter().map(|n: &Note| format!("{}:{n}", scene.file)).collect();
    let mut known: HashMap<(String, Vec<u8>, Option<Vec<Attachment>>), u32> = HashMap::new();
    let (mut models, mut infos) = (Vec::with_capacity(scene.models.len()), Vec::new());
    for (file, source) in files(&scene)?.into_iter().zip(&scene.models) {
        let key = (file.format.clone(), file.bytes.clone(), file.attached.clone());
        let id = match known.get(&key) {
            Some(id) => *id,
            None => {
                let loaded = session.load_model_file(file, Facets::Auto);
                let info = loaded.map_err(refused(source.at, format!("model \"{}\"", source.name)))?;
                notes.extend(info.warnings.iter().map(|w| format!("{}:{w}", source.text_name())));
                let id = info.id;
                known.insert(key, id);
                infos.push(info);
                id
            }
        };
        models.push(id);
    }
    let mut objects = Vec::with_capacity(scene.objects.len());
    for o in &scene.objects {
        let mut object = Object::new(&o.name, models[o.model]).group(&o.group).place(o.place).at(o.motion.start);
        object = if o.is_static { object.fixed() } else { object };
        object = if o.rotates { object } else { object.without_rotation() };
        object = object.max_speed(o.max_speed.unwrap_or(f64::INFINITY));
        let id = session.add_object(object).map_err(refused(o.at, format!("object \"{}\"", o.name)))?;
        ids.push(id);
        objects.push(LoadedObject { name: o.name.clone(), id, model: models[o.model] });
    }
    let before = session.rules().to_vec();
    if !keeps_rules && !scene.rules.is_empty() {
        session.set_rules(&scene.rules).map_err(refused(Place::START, "rules".into()))?;
    }
    if let Some(resolution) = scene.resolution.filter(|_| !keeps_rules) {
        let at = scene.resolution_at.unwrap_or(Place::START);
        if let Err(error) = session.set_resolution(Some(resolution)) {
            // Where the session is lost nothing is left of it anyway.
            let _ = session.set_rules(&before);
            return Err(refused(at, "resolution".into())(error));
        }
    }
    Ok(LoadedScene {
        objects,
        frames: scene.objects.iter().map(|o| Some((o.place, o.motion.start))).collect(),
        fixed: scene.objects.iter().map(|o| o.is_static).collect(),
        models: infos,
        rules: scene.rules,
        unit: scene.unit,
        notes,
        dt: scene.dt,
        file: scene.file,
        kind,
    })
}

impl LoadedScene {
    /// The id of the object of a name.
    pub fn id(&self, name: &str) -> Option<u32> {
        self.objects.iter().find(|o| o.name == name).map(|o| o.id)
    }

    /// The joints that have values of their own, in the order of the file; none of a scene file.
    pub fn joints(&self) -> Vec<Joint> {
        let Kind::Robot(driven) = &self.kind else { return Vec::new() };
        let joint = |dof: &robot::Dof| Joint {
            name: dof.name.clone(),
            turns: matches!(dof.kind, DofKind::Hinge { .. }),
            range: dof.range,
            value: driven.robot.value(dof, &driven.values),
        };
        driven.robot.free().map(joint).collect()
    }

    /// Puts a robot where its joints have these values, the others as they stand; nothing is searched. What is attached to a link goes
    /// with it.
    ///
    /// # Errors
    /// A joint that is not there, or a value beyond its limits, in one sentence; whatever the session refuses.
    pub fn set_joints<T: Transport>(&mut self, session: &mut Session<T>, values: &Values) -> Result<(), LoadError> {
        let Kind::Robot(driven) = &self.kind else { return Err(self.no_robot()) };
        let mut all = driven.values.clone();
        all.extend(values.clone());
        let (paths, _) = robot::paths_of(&driven.path, &driven.robot, &all, &Values::new())?;
        let paths: Vec<LinkPath> = driven.owners.iter().map(|link| paths[*link]).collect();
        self.reframe(session, &paths)?;
        if let Kind::Robot(driven) = &mut self.kind {
            (driven.before, driven.values) = (all.clone(), all);
        }
        Ok(())
    }

    /// The records of a step in which a robot's joints go from where they stand to these values at constant rates, to be put among those
    /// of other objects; after it they stand there. Of a scene file its own step, from its beginning, by no values.
    ///
    /// # Errors
    /// As `set_joints`; a link that two hinges turn at once, whose path is no arc: move one after the other.
    pub fn records<T: Transport>(
        &mut self,
        session: &mut Session<T>,
        to: &Values,
    ) -> Result<Vec<PoseRecord>, LoadError> {
        let paths: Vec<LinkPath> = match &self.kind {
            Kind::Steps(_) if !to.is_empty() => return Err(self.no_robot()),
            Kind::Steps(paths) => paths.clone(),
            Kind::Robot(driven) => {
                let (paths, _) = robot::paths_of(&driven.path, &driven.robot, &driven.values, to)?;
                driven.owners.iter().map(|link| paths[*link]).collect()
            }
        };
        self.reframe(session, &paths)?;
        if let Kind::Robot(driven) = &mut self.kind {
            driven.before = driven.values.clone();
            driven.values.extend(to.clone());
        }
        let mut records = Vec::new();
        for ((object, frame), path) in self.objects.iter().zip(&mut self.frames).zip(&paths) {
            if let Some(record) = path.record {
                records.push(PoseRecord { object: object.id, ..record });
                *frame = None;
            }
        }
        Ok(records)
    }

    /// The same as a step of its own: its records are sent and answered.
    ///
    /// # Errors
    /// As `records`, and as `Session::finish`.
    pub fn step<'s, T: Transport>(
        &mut self,
        session: &'s mut Session<T>,
        to: &Values,
        timeout: Duration,
    ) -> Result<Reply<'s>, LoadError> {
        let records = self.records(session, to)?;
        let sent = session.begin_step(records.len()).map(|slots| slots.copy_from_slice(&records));
        match sent.and_then(|()| session.finish(timeout)) {
            Ok(reply) => Ok(reply),
            Err(error) => {
                // What is refused here was not sent.
                if matches!(error, Error::Refused { .. } | Error::Misuse(_)) {
                    self.refused();
                }
                Err(error.into())
            }
        }
    }

    /// The step of the last `records` was refused: nothing has moved, and a robot's joints are where they were.
    pub fn refused(&mut self) {
        if let Kind::Robot(driven) = &mut self.kind {
            driven.values = driven.before.clone();
        }
    }

    /// Puts a robot where its joints were at a time, 0..1, of the last step: where it met something, say.
    ///
    /// # Errors
    /// As `set_joints`; a time beyond the step.
    pub fn stop_at<T: Transport>(&mut self, session: &mut Session<T>, time: f64) -> Result<(), LoadError> {
        let Kind::Robot(driven) = &self.kind else { return Err(self.no_robot()) };
        if !(0.0..=1.0).contains(&time) {
            let (expected, found) = ("a time within the step, 0 to 1", time.to_string());
            return Err(LoadError::Kind { file: self.file.clone(), expected, found });
        }
        let mut values = driven.values.clone();
        for dof in driven.robot.free() {
            let [from, to] = [&driven.before, &driven.values].map(|values| driven.robot.value(dof, values));
            if from != to {
                values.insert(dof.name.clone(), from + time * (to - from));
            }
        }
        self.set_joints(session, &values)
    }

    /// Gives each object the frame that its step begins in, where it has another one.
    fn reframe<T: Transport>(&mut self, session: &mut Session<T>, paths: &[LinkPath]) -> Result<(), LoadError> {
        let mut frames = Vec::new();
        for (i, path) in paths.iter().enumerate().filter(|(i, _)| !self.fixed[*i]) {
            let wanted = (path.place, path.motion.start);
            // By bits: a zero's sign counts too.
            if !self.frames[i].is_some_and(|own| same(&own, &wanted)) {
                frames.push(Frame { object: self.objects[i].id, place: wanted.0, pose: wanted.1 });
            }
        }
        if frames.is_empty() {
            return Ok(());
        }
        session.reframe(&frames)?;
        for (i, path) in paths.iter().enumerate() {
            self.frames[i] = Some((path.place, path.motion.start));
        }
        Ok(())
    }

    fn no_robot(&self) -> LoadError {
        let (expected, found) = ("a robot (URDF, SDFormat, MJCF), which has joints", "a scene file".to_owned());
        LoadError::Kind { file: self.file.clone(), expected, found }
    }
}

fn same(a: &(Pose, Pose), b: &(Pose, Pose)) -> bool {
    let bits = |pose: &Pose| (pose.position.to_array().map(f64::to_bits), pose.rotation.to_array().map(f64::to_bits));
    (bits(&a.0), bits(&a.1)) == (bits(&b.0), bits(&b.1))
}
