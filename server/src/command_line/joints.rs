//! What is said of robots on the command line: joint values, packages; and the scene that they make of a file.

use super::{AccessArguments, CacheArguments, Done, models_of, prepare_scene, print, warn};
use crate::check::Check;
use crate::clearance::{self, Least, Question};
use crate::import::{self, Scene, robot};
use crate::import::{Facets, SceneObject};
use crate::octree::Model;
use crate::terminal::{clean, number};
use crate::world::PairOutcome;
use contactd_proto::Motion;
use serde_json::json;
use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a robot (URDF, SDFormat, MJCF) stands and moves.
#[derive(clap::Args)]
pub(super) struct JointArguments {
    /// Joint values of a robot at the start of the step, in radians and metres, or with a unit: shoulder=30deg,slide=5mm;
    /// key:NAME begins at a keyframe of MJCF.
    #[arg(long, value_name = "JOINT=VALUE,…", value_parser = stated)]
    joints: Vec<Stated>,
    /// Joint values at its end; the others stay.
    #[arg(long, value_name = "JOINT=VALUE,…", value_parser = stated)]
    to: Vec<Stated>,
    /// Takes a robot's meshes as their convex hulls, as MuJoCo does.
    #[arg(long)]
    hulls: bool,
    /// A folder in which a robot's packages are (package://NAME/…, model://NAME/…).
    #[arg(long, value_name = "DIR")]
    packages: Vec<PathBuf>,
    /// An SRDF file with pairs of links that are not to be tested.
    #[arg(long, value_name = "FILE")]
    srdf: Option<PathBuf>,
    /// Pairs of links that touch or overlap at the start are not tested; they are told.
    #[arg(long)]
    ignore_touching: bool,
}

impl JointArguments {
    pub fn ask(&self) -> Result<robot::Ask, String> {
        let (from, to) = (values(&self.joints)?, values(&self.to)?);
        if self.to.iter().any(|s| !s.keys.is_empty()) {
            return Err("expected a keyframe in --joints, where the step begins, found one in --to".into());
        }
        let mut keys = self.joints.iter().flat_map(|s| &s.keys).cloned();
        let key = keys.next();
        if keys.next().is_some() {
            return Err("expected one keyframe in --joints, found two".into());
        }
        Ok(robot::Ask { from, to, key, hulls: self.hulls, packages: self.packages.clone(), srdf: self.srdf.clone() })
    }

    /// Values are in units that the robot's joints take.
    fn fit(&self, file: &Path, robot: &robot::Robot) -> Result<(), String> {
        let mut stated = self.joints.iter().chain(&self.to).flat_map(|s| &s.values);
        stated.try_for_each(|(name, told)| told.fits(robot, name)).map_err(|e| of_file(file, &e))
    }

    /// They say nothing of other files.
    pub fn none(&self, file: &Path) -> Result<(), String> {
        let Self { joints, to, hulls, packages, srdf, ignore_touching } = self;
        let stated = [
            ("--joints", !joints.is_empty()),
            ("--to", !to.is_empty()),
            ("--hulls", *hulls),
            ("--packages", !packages.is_empty()),
            ("--srdf", srdf.is_some()),
            ("--ignore-touching", *ignore_touching),
        ];
        match stated.iter().find(|(_, is_stated)| *is_stated) {
            None => Ok(()),
            Some((name, _)) => {
                Err(format!("expected a robot (URDF, SDFormat, MJCF) beside {name}, found {}", file.display()))
            }
        }
    }
}

impl JointArguments {
    /// They say how a robot stands, and not how it moves.
    pub fn no_step(&self) -> Result<(), String> {
        let expected = "expected --joints in place of --to: overlaps are of what stands, not of a step";
        if self.to.is_empty() { Ok(()) } else { Err(expected.into()) }
    }
}

/// The scene without the pairs that touch at its start, where that was asked for; they are told on standard error.
pub(super) fn without_touching(
    scene: Scene,
    models: &[Arc<Model>],
    joints: &JointArguments,
) -> Result<Scene, Box<dyn Error>> {
    if !joints.ignore_touching {
        return Ok(scene);
    }
    let at_rest = |o: &SceneObject| SceneObject { motion: Motion::resting(o.motion.start), record: None, ..o.clone() };
    let rest = Scene { objects: scene.objects.iter().map(at_rest).collect(), ..scene.clone() };
    let mut check = Check::new(&rest, models, None)?;
    let outcome = check.step(false)?;
    let touch = |p: &&PairOutcome| p.outcome.meets() || p.outcome.touching;
    let mut scene = scene;
    for p in outcome.pairs.iter().filter(touch) {
        let names = [p.a, p.b].map(|id| scene.objects[id as usize].name.clone());
        warn(&format!("{} and {} touch at the start and are not tested", names[0], names[1]));
        scene.rules[0].except.push(names);
    }
    Ok(scene)
}

/// Joints and their values, and keyframes, as they were told together.
#[derive(Clone, Debug, Default)]
struct Stated {
    values: Vec<(String, Told)>,
    keys: Vec<String>,
}

/// A value of a joint in radians or metres, and the unit that it was told in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Told {
    pub value: f64,
    unit: Option<&'static Unit>,
}

/// A unit of angle or of length.
#[derive(Debug, PartialEq)]
struct Unit {
    name: &'static str,
    factor: f64,
    is_angle: bool,
}

const UNITS: [Unit; 7] = [
    Unit { name: "deg", factor: std::f64::consts::PI / 180.0, is_angle: true },
    Unit { name: "rad", factor: 1.0, is_angle: true },
    Unit { name: "turns", factor: std::f64::consts::TAU, is_angle: true },
    Unit { name: "turn", factor: std::f64::consts::TAU, is_angle: true },
    Unit { name: "mm", factor: 1e-3, is_angle: false },
    Unit { name: "cm", factor: 1e-2, is_angle: false },
    Unit { name: "m", factor: 1.0, is_angle: false },
];

impl Told {
    /// It is of a kind that the joint takes.
    fn fits(&self, robot: &robot::Robot, name: &str) -> Result<(), String> {
        let (Some(unit), Some(dof)) = (self.unit, robot.free().find(|d| d.name == name)) else { return Ok(()) };
        let name = clean(name);
        match (dof.kind, unit.is_angle) {
            (robot::DofKind::Hinge { .. }, false) => Err(format!(
                "expected an angle (rad, deg, turns) for {name}, which turns, found a length in {}",
                unit.name
            )),
            (robot::DofKind::Slide { .. }, true) => {
                Err(format!("expected a length (m, cm, mm) for {name}, which slides, found an angle in {}", unit.name))
            }
            (robot::DofKind::Hinge { .. }, true) | (robot::DofKind::Slide { .. }, false) => Ok(()),
        }
    }
}

/// Values by joint, each told once.
fn values(told: &[Stated]) -> Result<robot::Values, String> {
    let mut values = robot::Values::new();
    for (name, told) in told.iter().flat_map(|s| &s.values) {
        if values.insert(name.clone(), told.value).is_some() {
            return Err(format!("expected one value of the joint {}, found two", clean(name)));
        }
    }
    Ok(values)
}

/// Joints and their values, with commas between them. A name may have commas, too: what has no value goes with what follows.
fn stated(word: &str) -> Result<Stated, String> {
    let expected = || "expected JOINT=VALUE, as in shoulder=30deg or slide=5mm".to_owned();
    let (mut all, mut name) = (Stated::default(), String::new());
    for piece in word.split(',') {
        if let Some(key) = piece.strip_prefix("key:").filter(|key| name.is_empty() && !key.contains('=')) {
            all.keys.push(key.to_owned());
            continue;
        }
        name.push_str(piece);
        let Some((own, value)) = name.rsplit_once('=') else {
            name.push(',');
            continue;
        };
        if own.is_empty() {
            return Err(expected());
        }
        all.values.push((own.to_owned(), joint_value(value).ok_or_else(expected)?));
        name.clear();
    }
    let is_nothing = all.values.is_empty() && all.keys.is_empty();
    if is_nothing || !name.is_empty() { Err(expected()) } else { Ok(all) }
}

/// A joint's value, in radians or metres where it has no unit.
fn joint_value(word: &str) -> Option<Told> {
    let known = UNITS.iter().find_map(|unit| Some((word.strip_suffix(unit.name)?, unit)));
    let (number, unit) = known.map_or((word, None), |(number, unit)| (number, Some(unit)));
    let value = number.trim().parse::<f64>().ok()?;
    // A quotient is the nearer one of the two where units divide: 5 mm is the double 0.005.
    let value = match unit.map_or(1.0, |unit| unit.factor) {
        1e-3 => value / 1e3,
        1e-2 => value / 1e2,
        other => value * other,
    };
    value.is_finite().then_some(Told { value, unit })
}

/// A sentence about a file.
fn of_file(file: &Path, sentence: &str) -> String {
    format!("{}: {sentence}", file.display())
}

/// Is it a scene? Anything else is a model.
pub(super) fn is_scene(file: &Path) -> bool {
    file.extension().is_some_and(|e| e == "toml") || robot::is_robot(file)
}

/// The scene of a file.
pub(super) fn read_scene(file: &Path, joints: &JointArguments) -> Result<Scene, Box<dyn Error>> {
    if robot::is_robot(file) {
        let ask = joints.ask()?;
        let robot = robot::read_robot(file, &ask)?;
        joints.fit(file, &robot)?;
        return Ok(robot::scene_of(file, &robot, &ask)?);
    }
    joints.none(file)?;
    Ok(import::read_scene(file)?)
}

/// A robot's joints, with their limits and where they stand; nothing of another scene.
pub(super) fn told(file: &Path, joints: &JointArguments) -> Result<String, Box<dyn Error>> {
    if !robot::is_robot(file) {
        return Ok(String::new());
    }
    let ask = joints.ask()?;
    let robot = robot::read_robot(file, &ask)?;
    let values = ask.from;
    let mut out = format!("{} links, {} joints with values\n", robot.links.len(), robot.free().count());
    for dof in robot.free() {
        let unit = match dof.kind {
            robot::DofKind::Hinge { .. } => "rad",
            robot::DofKind::Slide { .. } => "m",
        };
        let at = number(robot.value(dof, &values), 1e-9, 6);
        let limits = match dof.range {
            [low, high] if low.is_infinite() && high.is_infinite() => "without limits".to_owned(),
            [low, high] => format!("{} to {}", number(low, 1e-9, 6), number(high, 1e-9, 6)),
        };
        let _ = writeln!(out, "  {:<32} {at:>12} {unit:<3}  {limits}", clean(&dof.name));
    }
    Ok(out)
}

#[derive(clap::Args)]
pub(super) struct ClearanceArguments {
    /// The robot's file: .urdf, .sdf, MJCF's .xml.
    file: PathBuf,
    /// A joint and the range that it goes through: shoulder=0..70deg, slide=0..120mm; in radians and metres without a unit.
    #[arg(long, value_name = "JOINT=LOW..HIGH", value_parser = range, required = true, allow_hyphen_values = true)]
    range: Vec<(String, [Told; 2])>,
    /// How far apart the bounds may be, metres.
    #[arg(long, value_name = "LENGTH", default_value = "0.001", value_parser = length)]
    tolerance: f64,
    /// It is enough to know whether the clearance is at least this, metres: exit status 1 where it is not.
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    least: Option<f64>,
    /// Boxes of joint values that may be looked at; then the bounds stay as they are, exit status 3.
    #[arg(long, default_value = "200000")]
    boxes: u64,
    /// One JSON object instead of text.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    joints: JointArguments,
    #[command(flatten)]
    access: AccessArguments,
    #[command(flatten)]
    cache: CacheArguments,
}

/// A length in metres, or with a unit.
fn length(word: &str) -> Result<f64, String> {
    let length = joint_value(word).filter(|told| told.value > 0.0 && told.unit.is_none_or(|unit| !unit.is_angle));
    length
        .map(|told| told.value)
        .ok_or_else(|| "expected a positive length in metres, or with a unit, as in 20mm".into())
}

/// A joint and its range.
fn range(word: &str) -> Result<(String, [Told; 2]), String> {
    let expected = || "expected JOINT=LOW..HIGH, as in shoulder=0..70deg".to_owned();
    let (name, both) = word.rsplit_once('=').ok_or_else(expected)?;
    let (low, high) = both.split_once("..").ok_or_else(expected)?;
    // A unit behind both stands for both.
    let unit: String =
        high.chars().rev().take_while(|c| c.is_alphabetic()).collect::<Vec<_>>().into_iter().rev().collect();
    let has_own = low.chars().last().is_some_and(char::is_alphabetic);
    let low = if has_own { joint_value(low) } else { joint_value(&format!("{low}{unit}")) };
    match (name.is_empty(), low, joint_value(high)) {
        (false, Some(low), Some(high)) => Ok((name.to_owned(), [low, high])),
        _ => Err(expected()),
    }
}

/// The least clearance over ranges.
pub(super) fn clearance(arguments: &ClearanceArguments) -> Result<Done, Box<dyn Error>> {
    let file = &arguments.file;
    if !robot::is_robot(file) {
        return Err(format!("expected a robot (URDF, SDFormat, MJCF), found {}", file.display()).into());
    }
    let ask = arguments.joints.ask()?;
    if !ask.to.is_empty() {
        return Err("expected --range in place of --to: a clearance is over ranges, not over a step".into());
    }
    let read = robot::read_robot(file, &ask)?;
    arguments.joints.fit(file, &read)?;
    for (name, told) in arguments.range.iter().flat_map(|(name, both)| both.iter().map(move |told| (name, told))) {
        told.fits(&read, name).map_err(|e| of_file(file, &e))?;
    }
    let scene = robot::scene_of(file, &read, &ask)?;
    let scene = Scene { access: arguments.access.with(scene.access.clone())?, ..scene };
    let prepared = prepare_scene(&scene, Facets::Auto, &arguments.cache)?;
    let models = models_of(&prepared);
    let scene = without_touching(scene, &models, &arguments.joints)?;
    let question = Question {
        ranges: arguments.range.iter().map(|(name, both)| (name.clone(), both.map(|told| told.value))).collect(),
        values: ask.from,
        tolerance: arguments.tolerance,
        least: arguments.least,
        boxes: arguments.boxes,
    };
    let least = clearance::least(&read, &scene, &models, &question).map_err(|e| of_file(file, &e))?;
    print(&if arguments.json { least_json(&least) } else { least_text(&least, &question) })?;
    Ok(match question.least {
        _ if least.pairs == 0 => Done::Well,
        _ if least.upper == 0.0 || question.least.is_some_and(|least_asked| least.upper < least_asked) => Done::Clashes,
        Some(asked) if least.lower >= asked => Done::Well,
        None if least.is_settled => Done::Well,
        _ => Done::Undecided,
    })
}

fn least_json(least: &Least) -> String {
    let point = |x: glam::DVec3| json!(x.is_finite().then(|| x.to_array()));
    let finite = |x: f64| json!(x.is_finite().then_some(x));
    json!({
        "lower": finite(least.lower), "upper": finite(least.upper), "clash": least.upper == 0.0, "settled": least.is_settled,
        "joints": least.values, "links": least.names, "points": least.points.map(point),
        "pairs": least.pairs, "boxes": least.boxes, "distances": least.distances,
    })
    .to_string()
        + "\n"
}

fn least_text(least: &Least, question: &Question) -> String {
    if least.pairs == 0 {
        return "no pair of links is tested\n".to_owned();
    }
    let fine = 0.1 * question.tolerance;
    let names = [clean(&least.names[0]), clean(&least.names[1])];
    let (lower, upper) = (number(least.lower, fine, 9), number(least.upper, fine, 9));
    let mut out = match question.least {
        _ if least.upper == 0.0 => format!("a clash: {} and {} touch\n", names[0], names[1]),
        Some(asked) if least.upper < asked => format!("nearer than {asked}: {upper}\n"),
        Some(asked) if least.lower >= asked => format!("at least {asked}, proven: {lower} or more\n"),
        _ => format!("least clearance {upper}; proven: {lower} or more\n"),
    };
    if !least.is_settled {
        let what = if least.lower > 0.0 { "not to the tolerance" } else { "whether they touch is not proven" };
        let why = if least.boxes >= question.boxes {
            "the boxes that it may look at are spent (--boxes)"
        } else {
            "rounding allows no more"
        };
        let _ = writeln!(out, "{what}: {why}");
    }
    if least.upper > 0.0 {
        let _ = writeln!(out, "  {} - {}", names[0], names[1]);
    }
    for (name, value) in &least.values {
        let _ = writeln!(out, "  {} = {}", clean(name), number(*value, 1e-9, 9));
    }
    if least.points.iter().all(|x| x.is_finite()) {
        let point = |x: glam::DVec3| x.to_array().map(|c| number(c, fine, 6)).join(", ");
        let _ = writeln!(out, "  at ({}) and ({})", point(least.points[0]), point(least.points[1]));
    }
    let Least { pairs, boxes, distances, .. } = least;
    let _ = writeln!(out, "{pairs} pairs of links, {boxes} boxes of joint values, {distances} distances");
    out
}
