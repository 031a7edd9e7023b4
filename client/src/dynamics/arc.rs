//! From a contact on the chord of a motion to the one on its arc.
//!
//! Under constant acceleration A a body's way is x(t) = x₀ + v₀ t + ½ A t²; the engine searches its chord, the straight way
//! to the end of time T. At time t they are ½ A t (T − t) apart, the *sag*. So when the engine stops a chord, the time at which
//! the arc meets is solved for along the contact's normal, and the chord to there is proposed instead: it ends on the arc, in
//! the contact. What is taken has a sag below a tolerance and ends where the arc does, so that position, speed and energy belong
//! together.

use super::body::Entry;
use glam::DVec3;

/// Largest distance of arc and chord over all moving bodies when a motion of duration `t` is stopped at its fraction `s`.
pub fn sag(entries: &[Entry], t: f64, s: f64) -> f64 {
    let half = 0.5 * t * s * (1.0 - s);
    let bend = |e: &Entry| (e.plan.end.v - e.now.v).length().max((e.plan.end.w - e.now.w).length() * e.radius);
    entries.iter().filter(|e| e.plan.moves).map(|e| half * bend(e)).fold(0.0, f64::max)
}

/// Where the chords of two bodies meet.
#[derive(Clone, Copy, Debug)]
pub struct Meeting {
    /// The bodies.
    pub bodies: [usize; 2],
    /// Where.
    pub point: DVec3,
    /// Unit normal from the first to the second.
    pub normal: DVec3,
    /// At which fraction of the motion.
    pub at: f64,
}

/// The time within (0, t) to propose next: when the bodies' arcs come within `skin` of each other along the normal.
pub fn meeting(entries: &[Entry], m: &Meeting, t: f64, skin: f64) -> f64 {
    let at = m.at * t;
    // Speed and acceleration of a body's point along the normal when the chords meet.
    let of = |i: usize| {
        let e = &entries[i];
        let arm = m.point - (e.pose.position + e.plan.mean.v * at);
        let gain = |from: DVec3, to: DVec3| (to - from) / t;
        let (a, alpha) = (gain(e.now.v, e.plan.end.v), gain(e.now.w, e.plan.end.w));
        let speed = e.now.v + a * at + (e.now.w + alpha * at).cross(arm);
        (speed.dot(m.normal), (a + alpha.cross(arm)).dot(m.normal))
    };
    let ((speed_a, a), (speed_b, b)) = (of(m.bodies[0]), of(m.bodies[1]));
    let (speed, bend) = (speed_b - speed_a, b - a);
    // gap(at + d) = gap + speed d + ½ bend d², with the gap that the sag makes where the chords meet.
    let gap = -0.5 * at * (t - at) * bend - skin;
    let under = speed * speed - 2.0 * bend * gap;
    if speed >= 0.0 || under < 0.0 {
        // The arcs pass each other by: up to where the chords meet it is, and on from there.
        return at;
    }
    let d = 2.0 * gap / (under.sqrt() - speed);
    let time = at + d;
    if time < t { time.max(0.5 * at) } else { 0.5 * (at + t) }
}
