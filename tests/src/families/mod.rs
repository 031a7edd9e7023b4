//! Thirteen families of random scenes of two bodies, and a judge of the answers to them.
//!
//! | family | what is drawn |
//! |---|---|
//! | 1 plain trees | 1 to 10 primitives a body, joined and taken away |
//! | 2 deep trees | 10 to 60 |
//! | 3 coincident faces | all on a grid of quarters: repeated parts, abutting unions, flush differences, face on face |
//! | 4 size ratios | one body 10 to 100,000 times smaller than the other |
//! | 5 tiny features | a small apex, corner, ridge, ball or hole on a body 30 to 100,000 times larger |
//! | 6 needles and plates | 10 to 10,000 times longer than wide, or wider than thick |
//! | 7 fits | pegs, balls, cones, frusta, prisms and boxes in their holes, clearance ±1e-9 to 1e-2 of the radius, and none |
//! | 8 screws | the same, spinning about the axis of travel by up to 30 radians |
//! | 9 fast spins | 1 to 16 turns in the step |
//! | 10 far and scaled | others of these in units of 1e-6 to 1e6, up to 1e7 from the origin, turning about far origins |
//! | 11 grazing and resting | bodies that lie, slide and roll on each other, gaps and motions from 1e-12 on |
//! | 12 thin walls | shells of 1e-12 to 1e-2, A − A, A ∪ A, A ∩ A |
//! | 13 mirrors and polyhedra | mirrors, complements of complements, polyhedra, resolutions up to a fiftieth of a body |
//!
//! A scene is what its seed, its family and its index say. It is asked as `contactd check` asks: text through the reader, one
//! step of a world.

mod aim;
mod draw;
mod judge;
mod make;
mod run;
mod sized;
mod tree;

pub use draw::Draw;
pub use judge::{Effort, Fault, judge};
pub use make::{NAMES, scene};
pub use run::{Answer, Verdict, ask, examine, write};
pub use sized::of_size;
pub use tree::{Field, Join, Node, Shape};

use glam::{DMat3, DQuat, DVec3};

/// A body's motion over the step, as a scene file tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Position at the start.
    pub start: DVec3,
    /// Rotation at the start.
    pub rotation: DQuat,
    /// Position at the end.
    pub end: DVec3,
    /// Rotation vector over the step, world axes.
    pub spin: DVec3,
}

/// Two bodies and their step.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The first body.
    pub a: Node,
    /// The second one.
    pub b: Node,
    /// How they move.
    pub courses: [Course; 2],
    /// Resolution, length; `None` is the default.
    pub resolution: Option<f64>,
}

impl Course {
    /// The rotation at a time.
    fn matrix_at(&self, t: f64) -> DMat3 {
        let start = DMat3::from_quat(self.rotation);
        let angle = self.spin.length();
        if angle == 0.0 {
            return start;
        }
        // Rodrigues' formula: cos 1 + sin [k] + (1 - cos) k kT.
        let k = self.spin / angle;
        let (s, c) = (angle * t).sin_cos();
        let half = (angle * t / 2.0).sin();
        let column = |e: DVec3| e * c + k.cross(e) * s + k * (k.dot(e) * 2.0 * half * half);
        DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z)) * start
    }
}

impl Scene {
    /// The scene file; its models are a.csg and b.csg.
    pub fn text(&self) -> String {
        let mut out = String::new();
        if let Some(r) = self.resolution {
            out += &format!("resolution = {r:?}\n\n");
        }
        for (name, c) in ["a", "b"].iter().zip(&self.courses) {
            let v = |v: DVec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
            let q = c.rotation;
            out += &format!("[[model]]\nname = \"{name}\"\nfile = \"{name}.csg\"\n\n");
            out += &format!("[[object]]\nname = \"{name}\"\nmodel = \"{name}\"\n");
            out += &format!(
                "start = {{ position = {}, rotation = [{:?}, {:?}, {:?}, {:?}] }}\n",
                v(c.start),
                q.x,
                q.y,
                q.z,
                q.w
            );
            out += &format!("end = {{ position = {} }}\nrotation_vector = {}\n\n", v(c.end), v(c.spin));
        }
        out
    }
}
