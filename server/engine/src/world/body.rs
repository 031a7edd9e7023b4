//! Bodies: a model at a place in an object's frame, the object's track, and the box it sweeps in a step.
//!
//! The swept box rests on three facts. A point c fixed in a frame that turns by θ over the step runs on an arc, and the arc
//! leaves its chord by at most |c|·θ²/8 (interpolation error of a function with |f''| <= |c|·θ²). And the point never
//! leaves the ball of radius |c| around the origin's path, nor goes farther from its start than `travel` tells. The smallest of
//! these bounds is taken, side by side.

use crate::contact::{Hull, margin};
use crate::math::{Aabb, tolerance};
use crate::octree::Model;
use contactd_proto::{Motion, MotionState, Pose};
use glam::DVec3;
use std::sync::Arc;

/// A model with the few numbers that a world asks for again and again. Shared by all sessions that use it.
#[derive(Debug)]
pub struct MeasuredModel {
    /// The model.
    pub model: Arc<Model>,
    /// Box of the solid in the model's frame.
    pub aabb: Aabb,
    /// Default resolution that the model asks for; a pair takes the larger of its two.
    pub resolution: f64,
    /// Smallest dimension of its primitives; infinite for a solid without any.
    pub smallest: f64,
    /// How many levels far {f <= level} reaches out of its box.
    sharpness: f64,
}

impl MeasuredModel {
    /// Measures a model.
    pub fn new(model: Arc<Model>) -> Self {
        let smallest = model.solid.thinnest();
        let aabb = model.solid.aabb();
        // An unbounded or empty solid has no size of its own: its partner's decides.
        let resolution =
            Some(crate::contact::default_resolution(&model, &model)).filter(|r| r.is_finite()).unwrap_or(0.0);
        let sharpness = margin::sharpness(&model.solid);
        Self { model, aabb, resolution, smallest, sharpness }
    }
}

impl MeasuredModel {
    /// How far {f <= level} reaches out of a box around the solid, however it is turned, at most: at sharp edges and apexes that is
    /// farther than the level.
    pub fn reach_of_level(&self, level: f64) -> f64 {
        // The box grows along three axes.
        if level > 0.0 { 3f64.sqrt() * self.sharpness * level } else { 0.0 }
    }
}

/// An object to be added.
#[derive(Clone, Debug)]
pub struct ObjectSpec {
    /// Its id, larger than every id before.
    pub id: u32,
    /// Its name, for the exceptions of rules.
    pub name: String,
    /// Its group, for rules.
    pub group: String,
    /// Its model.
    pub part: Arc<MeasuredModel>,
    /// It never moves.
    pub is_static: bool,
    /// It may turn.
    pub rotates: bool,
    /// Largest speed of any of its points, length per second; infinite when nothing is declared.
    pub max_speed: f64,
    /// The model in the object's frame.
    pub place: Pose,
    /// Pose before the first step.
    pub pose: Pose,
}

impl ObjectSpec {
    /// A moving object of the group "default" about which nothing is declared, its model in its own frame.
    pub fn new(id: u32, part: &Arc<MeasuredModel>, pose: Pose) -> Self {
        Self {
            id,
            name: format!("object {id}"),
            group: "default".into(),
            part: part.clone(),
            is_static: false,
            rotates: true,
            max_speed: f64::INFINITY,
            place: Pose::IDENTITY,
            pose,
        }
    }
}

/// An object of the world. What every step of it reads or writes is here, three lines of a cache: there are many bodies. The rest is
/// read as if it were here too.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub struct Body {
    /// Its id.
    pub id: u32,
    /// Index of its group in the plans.
    pub group: u32,
    /// It never moves.
    pub is_static: bool,
    /// It may turn.
    pub rotates: bool,
    /// Largest distance of a corner from the object's origin.
    reach: f64,
    /// Where it stands and how it came there.
    pub motion_state: MotionState,
    fixed: Arc<Fixed>,
}

const _: () = assert!(size_of::<Body>() == 192);

/// What no step changes of a body, and most steps do not look at.
#[derive(Clone, Debug)]
pub struct Fixed {
    /// Largest declared speed.
    pub max_speed: f64,
    /// The body as one convex primitive, or one around it; `None` for a body without bounds.
    pub(super) hull: Option<Hull>,
    /// Its model.
    pub part: Arc<MeasuredModel>,
    /// The model in the object's frame.
    pub place: Pose,
    /// Corners of the model's box in the object's frame; empty for an unbounded model.
    corners: Vec<DVec3>,
    /// Its name.
    pub name: String,
}

impl std::ops::Deref for Body {
    type Target = Fixed;

    #[inline]
    fn deref(&self) -> &Fixed {
        &self.fixed
    }
}

impl Body {
    /// How far from the body's box, and from where its path length tells, those points may come at which f of the body is up to
    /// half of `reach` while it goes no farther than `way` (lengths): they lie out of the box by e, see
    /// `MeasuredModel::reach_of_level`, and where the body turns they go farther than its own points do. What no point of a ball of
    /// radius R leaves by more than d leaves no point e out of it by more than d (1 + 2e/R), and no chord is longer than 2.
    pub(super) fn room(&self, reach: f64, way: f64) -> f64 {
        self.part.reach_of_level(0.5 * reach) * (1.0 + 2.0 * (way / self.reach).min(1.0))
    }

    /// A body of group `group`.
    pub fn new(spec: ObjectSpec, group: u32) -> Self {
        let aabb = spec.part.aabb;
        let corners: Vec<DVec3> =
            if aabb.is_finite() { aabb.corners().iter().map(|c| spec.place.point(*c)).collect() } else { Vec::new() };
        let reach = corners.iter().map(|c| c.length()).fold(0.0, f64::max);
        let hull = Hull::new(&spec.part.model, &spec.place);
        let reach = if aabb.is_finite() || aabb.is_empty() { reach } else { f64::INFINITY };
        Self {
            id: spec.id,
            group,
            is_static: spec.is_static,
            rotates: spec.rotates,
            reach,
            motion_state: MotionState::resting(spec.pose),
            fixed: Arc::new(Fixed {
                max_speed: spec.max_speed,
                hull,
                part: spec.part,
                place: spec.place,
                corners,
                name: spec.name,
            }),
        }
    }

    /// The same body in another frame, at rest: its model at `place` in the frame, that at `pose`.
    pub(super) fn reframe(&mut self, place: Pose, pose: Pose) {
        let spec = ObjectSpec {
            id: self.id,
            name: self.name.clone(),
            group: String::new(),
            part: self.part.clone(),
            is_static: self.is_static,
            rotates: self.rotates,
            max_speed: self.max_speed,
            place,
            pose,
        };
        *self = Self::new(spec, self.group);
    }

    /// Largest speed of any of its points under `motion`, length per step.
    pub fn speed(&self, motion: &Motion) -> f64 {
        let turning = if motion.spin == DVec3::ZERO { 0.0 } else { motion.spin.length() * self.reach };
        motion.velocity.length() + turning
    }

    /// True when something is declared of its motions.
    pub fn is_declared(&self) -> bool {
        !self.rotates || self.max_speed.is_finite()
    }

    /// True when a motion in `dt` seconds (0: unknown) keeps what was declared.
    pub fn keeps(&self, motion: &Motion, dt: f64) -> bool {
        let turns = !self.rotates && motion.spin != DVec3::ZERO;
        // Without a duration a speed per second says nothing: a declared one needs it.
        let fast = self.max_speed.is_finite() && (dt == 0.0 || self.speed(motion) > self.max_speed * dt);
        !(turns || fast)
    }

    /// Distance of its farthest corner from the object's origin; infinite for an unbounded model.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// How far the farthest of its points gets in the first part `s` of its motion, at most: |v|·s along, and the chord of
    /// the angle around, 2 sin(θ/2) <= min(θ, 2).
    #[inline]
    pub fn travel(&self, s: f64) -> f64 {
        let m = &self.motion_state.motion;
        let angle = if m.spin == DVec3::ZERO { 0.0 } else { m.spin.length() * s };
        let turning = if angle == 0.0 { 0.0 } else { angle.min(2.0) * self.reach };
        (m.velocity.length() * s + turning) * (1.0 + 1e-15)
    }

    /// How much farther than `travel` tells the farthest of its points may be from where it was, once the first part `s` of its
    /// motion is taken and it stands at `taken`: what rounding does to that pose. An end that is taken whole is kept as it was given.
    #[inline]
    pub fn rounding_at(&self, s: f64, taken: &Pose) -> f64 {
        let start = &self.motion_state.motion.start;
        if s < 1.0 {
            self.rounding(start, taken)
        } else if self.motion_state.end.rotation == start.rotation {
            0.0
        } else {
            self.reach * tolerance::BOX_ROUNDING
        }
    }

    /// How far the farthest of its points is displaced from one pose to another, at most.
    pub fn displacement(&self, from: &Pose, to: &Pose) -> f64 {
        let r = to.rotation * from.rotation.conjugate();
        let half = DVec3::new(r.x, r.y, r.z).length();
        let turning = if half == 0.0 { 0.0 } else { 2.0 * half * self.reach };
        (to.position - from.position).length() + turning + self.rounding(from, to)
    }

    /// What rounding does to its points in two poses.
    fn rounding(&self, from: &Pose, to: &Pose) -> f64 {
        let size = from.position.abs().max_element() + to.position.abs().max_element();
        (size + self.reach) * tolerance::BOX_ROUNDING
    }

    /// A box that holds the body at the start of its motion.
    #[inline]
    pub fn still(&self) -> Aabb {
        let start = self.motion_state.motion.start;
        self.around(Aabb::of_points(self.corners.iter().map(|c| start.point(*c))))
    }

    /// A box that holds the body at the end of its motion.
    pub fn standing(&self) -> Aabb {
        let end = self.motion_state.end;
        self.around(Aabb::of_points(self.corners.iter().map(|c| end.point(*c))))
    }

    /// A box of some of its points, right for unbounded and empty bodies too and rounded outwards.
    #[inline]
    fn around(&self, of_points: Aabb) -> Aabb {
        if self.reach.is_infinite() {
            return Aabb::ALL;
        }
        if self.corners.is_empty() {
            return Aabb::EMPTY;
        }
        let size = of_points.min.abs().max(of_points.max.abs()).max_element() + self.reach;
        of_points.grown(size * tolerance::BOX_ROUNDING)
    }

    /// A box that holds the body over the whole of its last motion.
    pub fn swept(&self) -> Aabb {
        let m = &self.motion_state.motion;
        let (first, last) = (m.at(0.0), m.at(1.0));
        let theta = m.spin.length();
        let still = Aabb::of_points(self.corners.iter().map(|c| first.point(*c)));
        let ends = still.union(&Aabb::of_points(self.corners.iter().map(|c| last.point(*c))));
        let arcs = ends.grown(self.reach * theta * theta / 8.0);
        let balls = Aabb::of_points([first.position, last.position]).grown(self.reach);
        // No farther than the path length counts, so that what it has excluded once it need not be asked about again.
        let near = still.grown(self.travel(1.0));
        self.around(if theta == 0.0 { ends } else { arcs.intersection(&balls).intersection(&near) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::primitive::Cuboid;
    use crate::solid::{Label, SolidBuilder};
    use contactd_proto::motion::quat_of_rotation_vector;

    #[test]
    fn the_swept_box_holds_every_point_at_every_time() {
        let mut b = SolidBuilder::new();
        let root = b.primitive(
            Cuboid { half: DVec3::new(1.0, 2.0, 0.5) },
            Pose::at(DVec3::new(3.0, 0.0, 1.0)),
            Label::default(),
        );
        let part = Arc::new(MeasuredModel::new(Arc::new(Model::new(b.finish(root)))));
        let spins = [0.0, 1e-3, 0.7, 3.0, 9.0, 60.0];
        for (i, spin) in spins.into_iter().enumerate() {
            let place = Pose::new(DVec3::new(-1.0, 0.5, 0.0), quat_of_rotation_vector(DVec3::new(0.3, 1.0, i as f64)));
            let spec = ObjectSpec { place, ..ObjectSpec::new(1, &part, Pose::IDENTITY) };
            let mut body = Body::new(spec, 0);
            let start = Pose::new(DVec3::new(5.0, -2.0, 1.0), quat_of_rotation_vector(DVec3::new(1.0, 0.2, 0.0)));
            let axis = DVec3::new(0.6, -0.8, 0.0);
            let motion = Motion::turning(start, DVec3::new(2.0, 9.0, 1.0), axis * spin);
            body.motion_state = MotionState { motion, end: motion.at(1.0) };
            let swept = body.swept();
            for k in 0..=200 {
                let pose = motion.at(k as f64 / 200.0);
                for c in part.aabb.corners() {
                    assert!(swept.contains(pose.point(body.place.point(c))), "spin {spin}, time {k}/200");
                }
            }
            assert!(swept.half().max_element() < 20.0, "a bound that is useless: {swept:?}");
        }
    }
}
