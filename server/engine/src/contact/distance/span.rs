//! A span of time, and how far points of either body stray in it from where chords lead.
//!
//! A point fixed in one body, seen from the other, is nowhere farther than min(V·h/2, Acc·h²/8) from the chord between its places at
//! the span's ends (`motion::sweep` has V and Acc). So along a direction, and where a function is concave, both ends tell.

use crate::math::Aabb;
use crate::motion::{Instant, Relative};

/// A span of time.
#[derive(Clone, Debug)]
pub struct Span {
    /// From when on, fraction of the step.
    pub from: f64,
    /// Until when.
    pub to: f64,
    /// Its middle.
    pub middle: Instant,
    /// Its ends; of an instant one.
    pub ends: Vec<Instant>,
}

/// How points of a body stray.
#[derive(Clone, Copy, Debug)]
pub struct Stray {
    /// From their chords, a length.
    pub chord: f64,
    /// From where they are in the middle of the span, a length.
    pub middle: f64,
}

/// How points of a body move in a span, seen from the other one.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// V h: no point goes farther, a length.
    pub way: f64,
    /// Acc h²: no place has a larger second derivative by the part of the span that has passed, a length.
    pub bend: f64,
}

impl Span {
    /// A span of the motion of a against b.
    pub fn new(relative: &Relative, from: f64, to: f64) -> Self {
        let ends = if from < to { vec![relative.at(from), relative.at(to)] } else { vec![relative.at(from)] };
        Self { from, to, middle: relative.at(0.5 * (from + to)), ends }
    }

    /// How long it is.
    pub fn length(&self) -> f64 {
        self.to - self.from
    }

    /// How the points of a box of the mover's model frame stray; `relative` is the mover against the observer.
    pub fn stray(&self, relative: &Relative, aabb: &Aabb) -> Stray {
        let far = ((aabb.center() - relative.center_a()).abs() + aabb.half()).length();
        let Pace { way, bend } = self.pace(relative, far);
        let middle = 0.5 * way;
        Stray { chord: middle.min(0.125 * bend), middle }
    }

    /// How points within `far` (a length) of the mover's centre of rotation move in the span; `relative` is the mover against the observer.
    pub fn pace(&self, relative: &Relative, far: f64) -> Pace {
        let h = self.length();
        if h <= 0.0 {
            return Pace { way: 0.0, bend: 0.0 };
        }
        let b = relative.bounds(self.from, h, far);
        let observer_spin = relative.placed().1.motion.spin.length();
        let pull = (b.omega * b.omega + b.cross) * b.x_max + observer_spin * b.swing + b.bend;
        Pace { way: (b.speed + b.slip) * h * (1.0 + 1e-12), bend: pull * h * h * (1.0 + 1e-12) }
    }
}

/// The least of a function on [0, 1] that lies no deeper than `dip` s(1 − s)/2 below the chord between its values at the ends.
pub fn least_above_chord([from, to]: [f64; 2], dip: f64) -> f64 {
    let rise = to - from;
    let s = if dip > 0.0 { (0.5 - rise / dip).clamp(0.0, 1.0) } else { 0.0 };
    (from + rise * s - 0.5 * dip * s * (1.0 - s)).min(from).min(to)
}
