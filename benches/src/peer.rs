//! The same bodies and motions in parry's terms. Its cylinders and cones stand along y, ours along z.

use crate::race::{Plan, median, race};
use contactd::solid::Shape;
use contactd_proto::Motion;
use contactd_tests::primitive_pairs::rows;
use contactd_tests::scenes::{Recipe, Scene};
use glam::{DQuat, DVec3};
use parry3d_f64::math::{Pose, Rot3, Vec3};
use parry3d_f64::query::{self, NonlinearRigidMotion, ShapeCastHit, ShapeCastOptions};
use parry3d_f64::shape::SharedShape;
use std::time::Duration;

/// A vector in parry's version of glam.
pub fn vector(v: DVec3) -> Vec3 {
    Vec3::from_array(v.to_array())
}

fn rotation(q: DQuat) -> Rot3 {
    Rot3::from_array(q.to_array())
}

/// A pose in parry's types.
pub fn pose(p: &contactd_proto::Pose) -> Pose {
    Pose::from_parts(vector(p.position), rotation(p.rotation))
}

/// A body: a shape, and where it stands in its object's frame.
#[derive(Clone)]
pub struct Body {
    /// The shape.
    pub shape: SharedShape,
    /// Its frame within the object's.
    pub frame: Pose,
}

impl Body {
    /// A shape that stands in its object's frame.
    pub fn new(shape: SharedShape) -> Self {
        Self { shape, frame: Pose::IDENTITY }
    }

    /// A primitive, exact: no facets.
    ///
    /// # Panics
    /// A frustum, a half-space or what parry does not know: no benchmark has one.
    pub fn of(shape: &Shape, place: &contactd_proto::Pose) -> Self {
        // y to z.
        let upright = Pose::from_rotation(Rot3::from_rotation_x(std::f64::consts::FRAC_PI_2));
        let (shape, turn) = match shape {
            Shape::Sphere(s) => (SharedShape::ball(s.radius), Pose::IDENTITY),
            Shape::Cuboid(c) => (SharedShape::cuboid(c.half.x, c.half.y, c.half.z), Pose::IDENTITY),
            Shape::Cylinder(c) => (SharedShape::cylinder(c.half_height, c.radius), upright),
            Shape::Capsule(c) => (SharedShape::capsule_z(c.half, c.radius), Pose::IDENTITY),
            Shape::Cone(c) if c.top == 0.0 => (SharedShape::cone(c.half_height, c.bottom), upright),
            Shape::Polyhedron(p) => {
                let corners: Vec<Vec3> = p.vertices.iter().map(|v| vector(*v)).collect();
                (SharedShape::convex_hull(&corners).expect("corners of a polyhedron"), Pose::IDENTITY)
            }
            other => panic!("no peer for {other:?}"),
        };
        Self { shape, frame: pose(place) * turn }
    }

    /// Where the shape's own frame is at a time of a motion.
    pub fn pose_at(&self, motion: &Motion, t: f64) -> Pose {
        pose(&motion.at(t)) * self.frame
    }

    /// The motion of the shape's own frame over the step.
    fn motion(&self, motion: &Motion) -> NonlinearRigidMotion {
        let start = pose(&motion.start) * self.frame;
        let center = self.frame.inverse_transform_point(Vec3::ZERO);
        NonlinearRigidMotion::new(start, center, vector(motion.velocity), vector(motion.spin))
    }
}

/// A prepared question: everything that does not depend on the search is built.
pub struct Question {
    a: Body,
    b: Body,
    motions: [NonlinearRigidMotion; 2],
    turns: bool,
}

impl Question {
    /// First touch of two bodies over one step.
    pub fn new(a: Body, motion_a: &Motion, b: Body, motion_b: &Motion) -> Self {
        let motions = [a.motion(motion_a), b.motion(motion_b)];
        let turns = motion_a.spin != DVec3::ZERO || motion_b.spin != DVec3::ZERO;
        Self { a, b, motions, turns }
    }

    /// The question of a scene of two primitives.
    ///
    /// # Panics
    /// A solid that is no primitive.
    pub fn of_scene(scene: &Scene) -> Self {
        let leaf = |recipe: &Recipe| match recipe {
            Recipe::Leaf(shape, frame) => Body::of(shape, frame),
            Recipe::Op(..) => panic!("no peer for an operation"),
        };
        Self::new(leaf(&scene.a), &scene.motion_a, leaf(&scene.b), &scene.motion_b)
    }

    /// parry's answer: `cast_shapes` when nothing turns (its own documentation calls it the faster one), else
    /// `cast_shapes_nonlinear`. Its tolerance is its own, ten units in the last place; the target distance is 0.
    pub fn ask(&self) -> Option<ShapeCastHit> {
        let [m, n] = &self.motions;
        let hit = if self.turns {
            query::cast_shapes_nonlinear(m, &*self.a.shape, n, &*self.b.shape, 0.0, 1.0, true)
        } else {
            // The impact's geometry is computed on penetration only; a penetrating start is an answer at once.
            let options = ShapeCastOptions { max_time_of_impact: 1.0, ..ShapeCastOptions::default() };
            query::cast_shapes(&m.start, m.linvel, &*self.a.shape, &n.start, n.linvel, &*self.b.shape, options)
        };
        hit.expect("the pair of shapes is supported")
    }

    /// The time of parry's answer; `None` when it says that they never touch.
    pub fn time(&self) -> Option<f64> {
        self.ask().map(|hit| hit.time_of_impact)
    }
}

/// A check on the harness: parry's own median times of the translating families sphere-sphere and box-box, as the second
/// over the first. About 17 is right; far from it, the clock or the build is not what it should be.
pub fn sphere_to_box() -> f64 {
    let [sphere, cuboid] = ["sphere_sphere_translating", "box_box_translating"].map(|family| {
        let questions = rows(family).into_iter().map(|(s, _)| Question::of_scene(&s));
        questions.collect::<Vec<Question>>()
    });
    let plan = Plan { blocks: 5, least: Duration::from_micros(20) };
    let laps = race(plan, sphere.len().min(cuboid.len()), |i| cuboid[i].ask(), |i| sphere[i].ask());
    median(laps.iter().map(|l| l.own)) / median(laps.iter().map(|l| l.peer))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contactd::solid::primitive::{Cone, Cuboid};
    use contactd_proto::Pose as Placed;

    /// A cone falls with its apex ahead on a box's top, turned over by half a turn about x during the step.
    #[test]
    fn frames_and_motions_are_the_same_on_both_sides() {
        let floor = Body::of(&Shape::from(Cuboid { half: DVec3::new(5.0, 5.0, 1.0) }), &Placed::IDENTITY);
        let cone = Cone { bottom: 0.5, top: 0.0, half_height: 1.0 };
        let body = Body::of(&Shape::from(cone), &Placed::at(DVec3::new(0.0, 0.0, 0.25)));
        let down = contactd_proto::motion::quat_of_rotation_vector(DVec3::X * std::f64::consts::PI);
        let start = Placed::new(DVec3::new(0.0, 0.0, 4.25), down);
        let falling = Motion::turning(start, DVec3::new(0.0, 0.0, 0.25), DVec3::ZERO);
        let rest = Motion::resting(Placed::IDENTITY);
        // The apex stands 1.25 below the origin: it meets the top at height 1 when the origin is at 2.25.
        let straight = Question::new(floor.clone(), &rest, body.clone(), &falling).time().expect("they meet");
        assert!((straight - 0.5).abs() < 1e-9, "{straight}");
        let turning = Motion { spin: DVec3::Z * 2.0, ..falling };
        let turned = Question::new(floor, &rest, body, &turning).time().expect("they meet");
        assert!((turned - 0.5).abs() < 1e-6, "{turned}");
    }
}
