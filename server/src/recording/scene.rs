//! One step as a scene folder for `contactd check`: the scene's file, and each model in a folder of its own with the files that it
//! names.
//!
//! Motions keep their bits: numbers are written in the shortest way that reads back as they are, and a motion as the end or the
//! rotation vector of which the reader makes it. What a scene cannot say is refused, or told in a comment at its head.

use super::content::Content;
use crate::import::{FORMATS, pose_text};
use contactd_proto::control::{Facets, ObjectSpec};
use contactd_proto::pose_record::PoseCommand;
use contactd_proto::rule::Setting;
use contactd_proto::{Effects, Motion, MotionState, Pose, Rule};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write as _;
use std::path::{Component, Path};
use std::sync::Arc;

/// An object with its motion over the step.
#[derive(Clone, Debug)]
pub struct Standing {
    /// As it was added; its model's id among those of the scene.
    pub spec: ObjectSpec,
    /// Its motion.
    pub motion_state: MotionState,
}

/// A step, to be written as a scene.
#[derive(Clone, Debug, Default)]
pub struct SceneFolder {
    /// What the scene's first comment says of it.
    pub title: String,
    /// Models by id.
    pub models: BTreeMap<u32, Arc<Content>>,
    /// Objects in the order of their ids.
    pub objects: Vec<Standing>,
    /// Rules in force.
    pub rules: Vec<Rule>,
    /// Resolution of every pair, if it is stated.
    pub resolution: Option<f64>,
    /// Duration of the step, seconds; 0: unknown.
    pub dt: f64,
}

impl SceneFolder {
    /// Writes it into a new folder.
    ///
    /// # Errors
    /// The folder exists or cannot be written; what a scene cannot say. One sentence.
    pub fn write(&self, folder: &Path) -> Result<(), String> {
        let failed = |path: &Path, e: std::io::Error| format!("{}: expected to write, found {e}", path.display());
        let files = self.files()?;
        let text = self.text()?;
        if let Some(above) = folder.parent() {
            std::fs::create_dir_all(above).map_err(|e| failed(above, e))?;
        }
        std::fs::create_dir(folder)
            .map_err(|e| format!("{}: expected to make a new folder, found {e}", folder.display()))?;
        for (name, bytes) in files {
            let path = folder.join(name);
            if let Some(above) = path.parent() {
                std::fs::create_dir_all(above).map_err(|e| failed(above, e))?;
            }
            std::fs::write(&path, bytes).map_err(|e| failed(&path, e))?;
        }
        let path = folder.join("scene.toml");
        std::fs::write(&path, text).map_err(|e| failed(&path, e))
    }

    /// What the models of its text were made of, in that order.
    pub fn contents(&self) -> Vec<Arc<Content>> {
        self.used().map(|(_, content)| content.clone()).collect()
    }

    /// The models that objects are of.
    fn used(&self) -> impl Iterator<Item = (u32, &Arc<Content>)> {
        let used: BTreeSet<u32> = self.objects.iter().map(|o| o.spec.model).collect();
        self.models.iter().filter(move |(id, _)| used.contains(id)).map(|(id, content)| (*id, content))
    }

    /// The files of the models, by their paths in the folder.
    fn files(&self) -> Result<Vec<(String, &[u8])>, String> {
        let mut files = Vec::new();
        for (id, content) in self.used() {
            files.push((file_of(id, content), content.bytes.as_slice()));
            for attachment in content.attached.iter().flatten() {
                let Ok(bytes) = &attachment.bytes else { continue };
                if !stays_below(Path::new(&attachment.name)) {
                    return Err(format!(
                        "model {id} ({}) names the file {:?}, which is not below its own folder: a scene folder cannot hold it",
                        content.name, attachment.name
                    ));
                }
                files.push((format!("model-{id}/{}", attachment.name), bytes));
            }
        }
        Ok(files)
    }

    /// The scene's file.
    ///
    /// # Errors
    /// What a scene cannot say. One sentence.
    pub fn text(&self) -> Result<String, String> {
        let mut out = String::new();
        self.head(&mut out);
        if let Some(resolution) = self.resolution {
            let _ = writeln!(out, "resolution = {resolution:?}");
        }
        // A largest speed says nothing without a duration, and then nothing is refused because of it.
        let has_speed = self.dt > 0.0 && self.objects.iter().any(|o| o.spec.max_speed.is_finite());
        if has_speed {
            let _ = writeln!(out, "dt = {:?}", self.dt);
        }
        for (id, content) in self.used() {
            let _ = writeln!(out, "\n[[model]] # {}", comment(&content.name));
            let _ = writeln!(out, "name = \"model-{id}\"\nfile = {}", quoted(&file_of(id, content)));
        }
        let names = self.names();
        for (object, name) in self.objects.iter().zip(&names) {
            write_object(&mut out, object, name, has_speed)?;
        }
        let mut of_name: HashMap<&str, Vec<&str>> = HashMap::new();
        for (object, name) in self.objects.iter().zip(&names) {
            of_name.entry(&object.spec.name).or_default().push(name);
        }
        self.rules.iter().for_each(|rule| write_rule(&mut out, rule, &of_name));
        Ok(out)
    }

    fn head(&self, out: &mut String) {
        let _ = writeln!(out, "# {}", comment(&self.title));
        let _ = writeln!(out, "# contactd check scene.toml");
        for (id, content) in self.used() {
            let word = match content.facets {
                Facets::Auto => continue,
                Facets::Exact => "exact",
                Facets::AsWritten => "as-written",
            };
            let _ = writeln!(out, "# model-{id} was taken with --facets {word}: give that to `contactd check`, too");
        }
        for (object, name) in self.objects.iter().zip(self.names()) {
            if object.spec.name != name {
                let _ = writeln!(out, "# {name:?} is object {}, called {:?}", object.spec.id, object.spec.name);
            }
        }
    }

    /// Names of the objects, each once: those of a session may be empty or have the same.
    fn names(&self) -> Vec<String> {
        let mut count: HashMap<&str, usize> = HashMap::new();
        self.objects.iter().for_each(|o| *count.entry(&o.spec.name).or_default() += 1);
        let mut taken: BTreeSet<String> = BTreeSet::new();
        let name = |o: &Standing| {
            let own = o.spec.name.clone();
            let is_good = !own.is_empty() && count[own.as_str()] == 1;
            let base = if own.is_empty() { "object".to_owned() } else { own.clone() };
            let mut name = if is_good { own } else { format!("{base} {}", o.spec.id) };
            while taken.contains(&name) || (!is_good && count.contains_key(name.as_str())) {
                name.push('\'');
            }
            taken.insert(name.clone());
            name
        };
        self.objects.iter().map(name).collect()
    }
}

/// Where a model's file is, in the folder.
fn file_of(id: u32, content: &Content) -> String {
    let format = FORMATS.iter().find(|f| f.name == content.format).unwrap_or(&FORMATS[0]);
    format!("model-{id}/model.{}", format.endings[0])
}

/// True for a path that leads down alone.
fn stays_below(path: &Path) -> bool {
    let mut depth = 0i32;
    path.components().all(|part| {
        match part {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth -= 1,
            Component::RootDir | Component::Prefix(_) => return false,
        }
        depth >= 0
    })
}

fn write_object(out: &mut String, object: &Standing, name: &str, has_speed: bool) -> Result<(), String> {
    let Standing { spec, motion_state } = object;
    let _ = writeln!(out, "\n[[object]]\nname = {}\nmodel = \"model-{}\"", quoted(name), spec.model);
    if spec.group != "default" {
        let _ = writeln!(out, "group = {}", quoted(&spec.group));
    }
    if spec.is_static {
        out.push_str("motion = \"static\"\n");
    }
    if !spec.rotates {
        out.push_str("rotates = false\n");
    }
    if has_speed && spec.max_speed.is_finite() {
        let _ = writeln!(out, "max_speed = {:?}", spec.max_speed);
    }
    let place = spec.place.checked().map_err(|code| format!("object {}: place: {code}", spec.id))?;
    if place != Pose::IDENTITY {
        let _ = writeln!(out, "place = {}", pose_text(&place));
    }
    let MotionState { motion, end } = motion_state;
    let _ = writeln!(out, "start = {}", pose_text(&motion.start));
    if motion_state.is_rest() {
        return Ok(());
    }
    // As the reader makes a motion of them.
    let is_it = |command| same(&MotionState::ordered(motion.start, command).motion, motion);
    if is_it(PoseCommand::End(*end)) {
        let _ = writeln!(out, "end = {}", pose_text(end));
    } else if is_it(PoseCommand::Turn(end.position, motion.spin)) {
        let _ = writeln!(out, "end = {{ position = {:?} }}", end.position.to_array());
        let _ = writeln!(out, "rotation_vector = {:?}", motion.spin.to_array());
    } else {
        return Err(format!("object {}: a scene cannot say its motion", spec.id));
    }
    Ok(())
}

/// True for motions that are one to the bit.
fn same(a: &Motion, b: &Motion) -> bool {
    let bits = |m: &Motion| {
        let all = [m.start.position, m.velocity, m.spin].map(|v| v.to_array().map(f64::to_bits));
        (all, m.start.rotation.to_array().map(f64::to_bits))
    };
    bits(a) == bits(b)
}

fn write_rule(out: &mut String, rule: &Rule, of_name: &HashMap<&str, Vec<&str>>) {
    let [a, b] = rule.between.each_ref().map(|group| quoted(group));
    let _ = writeln!(out, "\n[[rule]]\nbetween = [{a}, {b}]");
    let mut pairs = Vec::new();
    for [a, b] in &rule.except {
        // Of objects that are not there nothing is to be excepted; several may have one name.
        let of = |name: &String| of_name.get(name.as_str()).cloned().unwrap_or_default();
        for x in of(a) {
            pairs.extend(of(b).iter().map(|y| format!("[{}, {}]", quoted(x), quoted(y))));
        }
    }
    if !pairs.is_empty() {
        let _ = writeln!(out, "except = [{}]", pairs.join(", "));
    }
    let effects = rule.effects();
    for field in Effects::FIELDS {
        let setting = field.get(&effects);
        if setting == field.initial {
            continue;
        }
        let _ = match setting {
            Setting::Word(code) => {
                let word = field.words().nth(code as usize).unwrap_or_default();
                writeln!(out, "{} = \"{word}\"", field.name)
            }
            Setting::Flag(on) => writeln!(out, "{} = {on}", field.name),
            Setting::Length(length) => writeln!(out, "{} = {length:?}", field.name),
        };
    }
}

/// A string of TOML.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// One line.
fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
