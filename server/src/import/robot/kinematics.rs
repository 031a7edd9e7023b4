//! The tree of links, and where they stand.

use super::super::problem::Problem;
use super::super::{Note, Place};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use glam::{DQuat, DVec3};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::PathBuf;

/// Joint values by name: radians of a hinge, metres of a slide.
pub type Values = BTreeMap<String, f64>;

/// What a degree of freedom does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DofKind {
    /// It turns about an axis through a point.
    Hinge {
        /// The point, in the frame that the degree of freedom moves in.
        anchor: DVec3,
        /// The axis there, unit.
        axis: DVec3,
    },
    /// It goes along an axis, unit.
    Slide {
        /// The axis, in the frame that it moves in.
        axis: DVec3,
    },
}

/// A degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Dof {
    /// Its name, a joint's.
    pub name: String,
    /// What it does.
    pub kind: DofKind,
    /// Its limits; infinite where it has none.
    pub range: [f64; 2],
    /// Its value where none is asked for.
    pub start: f64,
    /// Its value where the link stands at its origin.
    pub zero: f64,
    /// The degree of freedom that it follows, with factor and offset.
    pub mimic: Option<(String, f64, f64)>,
}

/// A link: a rigid body.
#[derive(Clone, Debug)]
pub struct Link {
    /// Its name.
    pub name: String,
    /// Where the file has it.
    pub at: Place,
    /// The link that it hangs on, an index below its own; `None`: the world.
    pub parent: Option<usize>,
    /// Its frame in its parent's where all degrees of freedom are at their zero.
    pub origin: Pose,
    /// What moves it against that, outermost first.
    pub dofs: Vec<Dof>,
    /// What of it collides.
    pub parts: Vec<Part>,
    /// It may be anywhere: joints of six degrees of freedom, and of three, are taken as they stand.
    pub is_free: bool,
    /// It is fixed to the world.
    pub is_static: bool,
}

/// What of a link collides in the same way.
#[derive(Clone, Debug)]
pub struct Part {
    /// What it is called beside its link; empty: as the link is.
    pub name: String,
    /// A flattened OpenSCAD text, in the link's frame; files that it names are relative to the robot's.
    pub text: String,
    /// MuJoCo's contype and conaffinity; both 1 in other formats.
    pub masks: [u32; 2],
}

/// All of a file.
#[derive(Clone, Debug, Default)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// Its links, parents first.
    pub links: Vec<Link>,
    /// Pairs of links, by index, that are not tested.
    pub excepted: HashSet<[usize; 2]>,
    /// Pairs of parts, by their links and their places there, that are tested all the same, whatever their masks (MuJoCo's `<pair>`).
    pub pairs: HashSet<[(usize, usize); 2]>,
    /// What was left out or taken in another way.
    pub notes: Vec<Note>,
    /// The packages that its meshes are in, folders that are not in the file's own: what they hold may be read, and nothing around it.
    pub packages: Vec<PathBuf>,
}

impl Robot {
    /// The degrees of freedom that have values of their own.
    pub fn free(&self) -> impl Iterator<Item = &Dof> {
        self.links.iter().flat_map(|l| &l.dofs).filter(|d| d.mimic.is_none())
    }

    /// What was left out, as a note.
    pub(super) fn note(&mut self, at: Place, text: impl Into<String>) {
        self.notes.push(Note { at, text: text.into(), amount: None });
    }

    /// Lets each joint that follows one that follows another one follow the last of them.
    ///
    /// # Errors
    /// Joints that follow each other in a circle.
    pub(super) fn follow(&mut self) -> Result<(), (Place, Problem)> {
        let told: HashMap<String, (String, f64, f64)> =
            self.links.iter().flat_map(|l| &l.dofs).filter_map(|d| Some((d.name.clone(), d.mimic.clone()?))).collect();
        for link in &mut self.links {
            for dof in &mut link.dofs {
                let Some((leader, factor, offset)) = &mut dof.mimic else { continue };
                let mut left = told.len();
                while let Some((next, f, o)) = told.get(leader) {
                    if left == 0 {
                        let found = format!("joints that follow each other in a circle, {:?} among them", dof.name);
                        return Err((link.at, Problem::syntax("a joint that moves by itself and is followed", found)));
                    }
                    left -= 1;
                    // factor (f x + o) + offset
                    (*leader, *offset, *factor) = (next.clone(), *offset + *factor * o, *factor * f);
                }
            }
        }
        Ok(())
    }

    /// The value of a degree of freedom.
    pub fn value(&self, dof: &Dof, values: &Values) -> f64 {
        if let Some((of, factor, offset)) = &dof.mimic {
            let leader = self.free().find(|d| d.name == *of);
            return factor * leader.map_or(0.0, |d| self.value(d, values)) + offset;
        }
        values.get(&dof.name).copied().unwrap_or(dof.start)
    }

    /// Where each link stands in the world. Source: product of exponentials (R. Brockett, 1984).
    pub fn poses(&self, values: &Values) -> Vec<Pose> {
        let mut poses: Vec<Pose> = Vec::with_capacity(self.links.len());
        for link in &self.links {
            let mut pose = link.parent.map_or(Pose::IDENTITY, |p| poses[p]).compose(&link.origin);
            for dof in &link.dofs {
                pose = pose.compose(&dof.pose(self.value(dof, values)));
            }
            poses.push(pose);
        }
        poses
    }

    /// Whether a link hangs on another one, or is it.
    pub fn hangs_on(&self, link: usize, on: usize) -> bool {
        let mut at = Some(link);
        while let Some(i) = at {
            if i == on {
                return true;
            }
            at = self.links[i].parent;
        }
        false
    }

    /// The motion of each link's frame from values to others at constant rates: a frame that goes straight and turns at a constant
    /// rate, and the link's place in it.
    ///
    /// # Errors
    /// The link whose path is none such, by its index, and the joints that move it.
    pub fn motions(&self, from: &Values, to: &Values) -> Result<Vec<(Pose, Motion)>, (usize, Vec<String>)> {
        let starts = self.poses(from);
        let mut carried: Vec<Carried> = Vec::with_capacity(self.links.len());
        let mut out = Vec::with_capacity(self.links.len());
        for (i, link) in self.links.iter().enumerate() {
            let mut carry = link.parent.map_or_else(Carried::default, |p| carried[p].clone());
            let mut frame = link.parent.map_or(Pose::IDENTITY, |p| starts[p]).compose(&link.origin);
            for dof in &link.dofs {
                let (at, end) = (self.value(dof, from), self.value(dof, to));
                carry.add(dof, &frame, end - at).map_err(|()| {
                    let mut names = carry.names.clone();
                    names.push(dof.name.clone());
                    (i, names)
                })?;
                frame = frame.compose(&dof.pose(at));
            }
            out.push(carry.motion(&starts[i]));
            carried.push(carry);
        }
        Ok(out)
    }
}

impl Dof {
    /// True of a value that is beyond a limit, by more than rounding's.
    pub fn is_beyond(&self, value: f64) -> bool {
        let [low, high] = self.range;
        let slack = 1e-9 * value.abs().max(1.0);
        value < low - slack || value > high + slack
    }

    /// Its transform at a value.
    pub fn pose(&self, value: f64) -> Pose {
        let value = value - self.zero;
        match self.kind {
            DofKind::Slide { axis } => Pose::at(axis * value),
            DofKind::Hinge { anchor, axis } => {
                let turn = quat_of_rotation_vector(axis * value);
                Pose::new(anchor - turn * anchor, turn)
            }
        }
    }
}

/// How a frame is carried along in a step.
#[derive(Clone, Debug, Default)]
struct Carried {
    /// World.
    velocity: DVec3,
    /// A point on the axis at the start, and the rotation vector over the step; world.
    turn: Option<(DVec3, DVec3)>,
    /// The joints that move.
    names: Vec<String>,
}

/// Sine of the angle by which a slide may be off the axis that turns it: rounding's.
const PARALLEL: f64 = 1e-12;

impl Carried {
    /// A degree of freedom that moves by `by`, in a frame as it stands at the start.
    fn add(&mut self, dof: &Dof, frame: &Pose, by: f64) -> Result<(), ()> {
        if by == 0.0 {
            return Ok(());
        }
        match (dof.kind, self.turn) {
            (DofKind::Slide { axis }, None) => self.velocity += frame.vector(axis) * by,
            // What slides along the axis that turns it goes straight all the same.
            (DofKind::Slide { axis }, Some((_, turn))) => {
                let way = frame.vector(axis);
                if turn.cross(way).length() > PARALLEL * turn.length() {
                    return Err(());
                }
                self.velocity += way * by;
            }
            (DofKind::Hinge { anchor, axis }, None) => {
                self.turn = Some((frame.point(anchor), frame.vector(axis) * by));
            }
            // Two hinges about one line turn by the sum.
            (DofKind::Hinge { anchor, axis }, Some((point, turn))) => {
                let (other, along) = (frame.point(anchor), frame.vector(axis));
                let off = (other - point).cross(along).length();
                let reach = other.abs().max(point.abs()).max_element().max(1.0);
                if turn.cross(along).length() > PARALLEL * turn.length() || off > PARALLEL * reach {
                    return Err(());
                }
                self.turn = Some((point, turn + along * by));
            }
        }
        self.names.push(dof.name.clone());
        Ok(())
    }

    /// The frame that does it, and the link's place in it.
    fn motion(&self, start: &Pose) -> (Pose, Motion) {
        let Some((point, turn)) = self.turn else {
            return (Pose::IDENTITY, Motion { velocity: self.velocity, ..Motion::resting(*start) });
        };
        let frame = Pose::new(point, DQuat::IDENTITY);
        (frame.inverse().compose(start), Motion { start: frame, velocity: self.velocity, spin: turn })
    }
}
