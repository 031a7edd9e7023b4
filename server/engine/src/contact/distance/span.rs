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
        let h = self.length();
        if h <= 0.0 {
            return Stray { chord: 0.0, middle: 0.0 };
        }
        let far = ((aabb.center() - relative.center_a()).abs() + aabb.half()).length();
        let b = relative.bounds(self.from, h, far);
        let observer_spin = relative.placed().1.motion.spin.length();
        let pull = (b.omega * b.omega + b.cross) * b.x_max + observer_spin * b.swing + b.bend;
        let middle = 0.5 * (b.speed + b.slip) * h;
        Stray { chord: middle.min(0.125 * pull * h * h) * (1.0 + 1e-12), middle: middle * (1.0 + 1e-12) }
    }
}
