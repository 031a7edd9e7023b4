//! A robot where its joints have it, as a scene.

use super::super::openscad::Access;
use super::super::problem::Problem;
use super::super::scene::{ModelSource, Scene, SceneError, SceneObject};
use super::super::{Limits, Note, Place, read_bytes, xml};
use super::kinematics::{Part, Robot, Values};
use super::reader::{self, Ask, Reader};
use super::{mjcf, sdf, urdf};
use contactd_proto::{Motion, MotionState, Pose, PoseRecord, Rule};
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

/// Reads a robot or a world, by what its root element is.
///
/// # Errors
/// One sentence with file, line and column.
pub fn read_robot(path: &Path, ask: &Ask) -> Result<Robot, SceneError> {
    let file = path.display().to_string();
    let bytes = xml::mended(read_bytes(path, &Limits::default())?);
    let wrong = |(at, problem): (Place, Problem)| of_problem(&file, at, problem);
    let document = xml::parse(&bytes).map_err(wrong)?;
    let found = RefCell::new(Vec::new());
    let main = reader::folder_of(path);
    let reader = Reader { path, base: PathBuf::new(), within: None, ask, main, packages: &found };
    let root = document.root_element();
    let robot = match root.tag_name().name() {
        "robot" => urdf::read(root, &reader),
        "sdf" => sdf::read(root, &reader),
        "mujoco" => mjcf::read(root, &reader),
        other => Err(xml::wrong(root, "a robot (URDF), an sdf or a mujoco as the root element", Some(other))),
    };
    let mut robot = robot.map_err(wrong)?;
    if let Some(key) = ask.key.as_ref().filter(|_| root.tag_name().name() != "mujoco") {
        let problem = Problem::syntax("MJCF, which has keyframes", format!("key:{key}"));
        return Err(of_problem(&file, Place::START, problem));
    }
    robot.packages = found.into_inner();
    let mut joints = HashSet::new();
    for link in &robot.links {
        if let Some(dof) = link.dofs.iter().find(|d| !joints.insert(d.name.as_str())) {
            return Err(of_problem(
                &file,
                link.at,
                Problem::syntax("joints of different names", format!("two {:?}", dof.name)),
            ));
        }
    }
    if let Some(path) = &ask.srdf {
        let file = path.display().to_string();
        let bytes = xml::mended(read_bytes(path, &Limits::default())?);
        let wrong = |(at, problem): (Place, Problem)| of_problem(&file, at, problem);
        let document = xml::parse(&bytes).map_err(wrong)?;
        urdf::disabled(document.root_element(), &mut robot).map_err(wrong)?;
    }
    Ok(robot)
}

pub(super) fn of_problem(file: &str, at: Place, problem: Problem) -> SceneError {
    match problem {
        Problem::Syntax { expected, found } => SceneError::Value { file: file.to_owned(), at, expected, found },
        other => SceneError::Format { file: file.to_owned(), at, message: other.to_string() },
    }
}

/// A robot as a scene, over a step from joint values to others.
///
/// # Errors
/// A joint that is not there or has no value of its own; a value beyond a limit; a link whose path is no straight one with a constant
/// rate of turn.
pub fn scene_of(path: &Path, robot: &Robot, ask: &Ask) -> Result<Scene, SceneError> {
    let file = path.display().to_string();
    let (paths, step_notes) = paths_of(path, robot, &ask.from, &ask.to)?;
    let mut notes = robot.notes.clone();
    notes.extend(step_notes);
    let mut models: Vec<ModelSource> = Vec::new();
    let mut known: HashMap<&str, usize> = HashMap::new();
    let mut objects = Vec::new();
    // Which link and part each object is.
    let mut owners: Vec<((usize, usize), &Part)> = Vec::new();
    let mut names = HashMap::new();
    // Two static objects are never tested against each other: of two that a file names as a pair one is told as at rest instead.
    let is_fixed = |part: &(usize, usize)| robot.links[part.0].is_static;
    let resting: HashSet<(usize, usize)> =
        robot.pairs.iter().filter(|pair| pair.iter().all(is_fixed)).map(|[_, second]| *second).collect();
    for (i, link) in robot.links.iter().enumerate() {
        for (k, part) in link.parts.iter().enumerate() {
            let whole = if part.name.is_empty() { link.name.clone() } else { format!("{}/{}", link.name, part.name) };
            let name = unique(whole, &mut names);
            let model = *known.entry(&part.text).or_insert_with(|| {
                models.push(ModelSource {
                    name: name.clone(),
                    path: path.to_owned(),
                    at: link.at,
                    text: Some(part.text.clone()),
                });
                models.len() - 1
            });
            let LinkPath { place, motion, record } = paths[i];
            objects.push(SceneObject {
                name,
                at: link.at,
                model,
                group: "default".into(),
                is_static: link.is_static && !resting.contains(&(i, k)),
                place,
                motion,
                record,
                rotates: true,
                max_speed: None,
            });
            owners.push(((i, k), part));
        }
    }
    let mut rule = Rule::new(["default".into(), "default".into()]);
    for (a, (i, part)) in owners.iter().enumerate() {
        for (b, (j, other)) in owners.iter().enumerate().skip(a + 1) {
            let meets = |p: &Part, q: &Part| p.masks[0] & q.masks[1] != 0;
            let are_alike = meets(part, other) || meets(other, part);
            let is_tested = are_alike && i.0 != j.0 && !robot.is_excepted(i.0, j.0);
            if !is_tested && !robot.pairs.contains(&[*i, *j]) {
                rule.except.push([objects[a].name.clone(), objects[b].name.clone()]);
            }
        }
    }
    Ok(Scene {
        unit: "m".into(),
        resolution: None,
        resolution_at: None,
        dt: None,
        models,
        objects,
        rules: vec![rule],
        notes,
        file,
        access: Access { packages: robot.packages.clone(), ..Access::default() },
    })
}

/// What a link does in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkPath {
    /// The link in its object's frame, which has its origin on the axis that turns it.
    pub place: Pose,
    /// That frame's motion.
    pub motion: Motion,
    /// The same as a record, whose object id is the caller's to set; `None` for a link that rests.
    pub record: Option<PoseRecord>,
}

/// What each link does in a step from joint values to others, those that are not named stay; and notes.
///
/// # Errors
/// As `scene_of`.
pub fn paths_of(
    path: &Path,
    robot: &Robot,
    from: &Values,
    to: &Values,
) -> Result<(Vec<LinkPath>, Vec<Note>), SceneError> {
    let file = path.display().to_string();
    let from = checked(&file, robot, from)?;
    let mut end = from.clone();
    end.extend(checked(&file, robot, to)?);
    let notes = followers(&file, robot, [&from, &end])?;
    let motions = robot.motions(&from, &end).map_err(|(link, joints)| {
        let link = &robot.links[link];
        let (last, others) = joints.split_last().expect("two joints at least");
        SceneError::Value {
            file: file.clone(),
            at: link.at,
            expected: format!("joints of which one turns the link {:?} in a step: move one after the other", link.name),
            found: format!(
                "{} and {} moving at once, on a path that is no arc",
                shown(&others.join(", ")),
                shown(last)
            ),
        }
    })?;
    let path = |(place, motion): (Pose, Motion)| {
        let state = MotionState { motion, end: motion.at(1.0) };
        let end = motion.start.position + motion.velocity;
        let record = (!state.is_rest()).then(|| PoseRecord::turn(0, end, motion.spin));
        LinkPath { place, motion, record }
    };
    Ok((motions.into_iter().map(path).collect(), notes))
}

/// A name within a sentence: characters that would break its line are written as escapes.
fn shown(name: &str) -> String {
    name.chars().map(|c| if c.is_control() { c.escape_default().to_string() } else { c.to_string() }).collect()
}

/// A name that no other object has.
fn unique(name: String, known: &mut HashMap<String, usize>) -> String {
    let mut own = name.clone();
    while known.contains_key(&own) {
        let count = known.entry(name.clone()).and_modify(|n| *n += 1).or_insert(1);
        own = format!("{name} {count}");
    }
    known.insert(own.clone(), 1);
    own
}

/// Values that the robot has, within limits.
fn checked(file: &str, robot: &Robot, values: &Values) -> Result<Values, SceneError> {
    let wrong = |at, expected: String, found: String| SceneError::Value { file: file.to_owned(), at, expected, found };
    for (name, value) in values {
        let told = shown(name);
        let link = robot.links.iter().find(|l| l.dofs.iter().any(|d| d.name == *name));
        let dof = link.and_then(|l| l.dofs.iter().find(|d| d.name == *name));
        let (Some(link), Some(dof)) = (link, dof) else {
            let names: Vec<String> = robot.free().map(|d| shown(&d.name)).collect();
            return Err(wrong(Place::START, format!("one of the joints {}", names.join(", ")), format!("{name:?}")));
        };
        if let Some((leader, ..)) = &dof.mimic {
            return Err(wrong(
                link.at,
                format!("a value of {}, which {told} follows", shown(leader)),
                format!("one of {told}"),
            ));
        }
        let [low, high] = dof.range;
        if !(*value >= low && *value <= high) {
            return Err(wrong(link.at, format!("{low} to {high} as {told}"), value.to_string()));
        }
    }
    Ok(values.clone())
}

/// Joints that follow others stay within their own limits; where they do not as the file stands, that is a note.
fn followers(file: &str, robot: &Robot, values: [&Values; 2]) -> Result<Vec<Note>, SceneError> {
    let mut notes = Vec::new();
    for (link, dof) in robot.links.iter().flat_map(|l| l.dofs.iter().map(move |d| (l, d))) {
        let Some((leader, ..)) = &dof.mimic else { continue };
        let beyond = values.iter().map(|v| robot.value(dof, v)).find(|value| dof.is_beyond(*value));
        let Some(value) = beyond else { continue };
        let [low, high] = dof.range;
        let expected = format!("{low} to {high} as {}, which follows {}", shown(&dof.name), shown(leader));
        if values.iter().any(|v| v.contains_key(leader)) {
            return Err(SceneError::Value { file: file.to_owned(), at: link.at, expected, found: value.to_string() });
        }
        notes.push(Note { at: link.at, text: format!("expected {expected}, and it stands at {value}"), amount: None });
    }
    Ok(notes)
}

impl Robot {
    /// Pairs of links that are not tested: those that do not move against each other, and those that the file excepts.
    pub fn is_excepted(&self, i: usize, j: usize) -> bool {
        let pair = [i.min(j), i.max(j)];
        self.welded_to(i) == self.welded_to(j) || self.excepted.contains(&pair)
    }

    /// The link of each object of its scene.
    pub fn owners(&self) -> Vec<usize> {
        self.links.iter().enumerate().flat_map(|(i, link)| std::iter::repeat_n(i, link.parts.len())).collect()
    }

    /// The link nearest to the root that a link does not move against; `None`: it does not move against the world.
    pub fn welded_to(&self, link: usize) -> Option<usize> {
        let mut at = link;
        while self.links[at].dofs.is_empty() && !self.links[at].is_free {
            at = self.links[at].parent?;
        }
        Some(at)
    }

    /// Links that a joint connects are not tested against each other.
    pub(super) fn except_neighbours(&mut self) {
        for i in 0..self.links.len() {
            if let Some(parent) = self.links[i].parent {
                self.excepted.insert([parent.min(i), parent.max(i)]);
            }
        }
    }
}
