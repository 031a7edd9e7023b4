//! What a frame did, and the sums that laws speak of.

use super::Counters;
use glam::DVec3;

/// What one frame, or many added up, did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    /// Frames.
    pub frames: u64,
    /// Seconds that were simulated.
    pub simulated: f64,
    /// Seconds that were not, since the number of sub-steps was spent.
    pub left_over: f64,
    /// Rounds of look, solve, propose: one for each contact at which the world stopped, and one for the frame's end.
    pub substeps: u64,
    /// Questions to the engine of where bodies touch.
    pub looks: u64,
    /// Questions to the engine of how far motions can go.
    pub proposals: u64,
    /// Contact points that were solved, summed over the solves.
    pub points: u64,
    /// Solves of impacts.
    pub impacts: u64,
    /// Solves of impacts whose rebound was cut, since together they would have made energy.
    pub tamed: u64,
    /// Sweeps over all points, there and back.
    pub iterations: u64,
    /// Largest change of a relative speed in the last sweep of any solve, length/s.
    pub residual: f64,
    /// Solves that spent their iterations before they met the tolerance.
    pub unconverged: u64,
    /// Pairs seen overlapping, summed over the looks.
    pub overlaps: u64,
    /// Pairs that the engine left undecided.
    pub undecided: u64,
    /// Chords that had to be lifted over a hollow surface.
    pub lifts: u64,
    /// Slow contacts that a proposal met and that were added to its solve.
    pub added: u64,
    /// Contacts with sensors.
    pub sensed: u64,
    /// Poses sent.
    pub sent: u64,
    /// The effects' operations.
    pub counters: Counters,
}

impl std::ops::AddAssign for Frame {
    fn add_assign(&mut self, o: Self) {
        self.frames += o.frames;
        self.simulated += o.simulated;
        self.left_over += o.left_over;
        self.substeps += o.substeps;
        self.looks += o.looks;
        self.proposals += o.proposals;
        self.points += o.points;
        self.impacts += o.impacts;
        self.tamed += o.tamed;
        self.iterations += o.iterations;
        self.residual = self.residual.max(o.residual);
        self.unconverged += o.unconverged;
        self.overlaps += o.overlaps;
        self.undecided += o.undecided;
        self.lifts += o.lifts;
        self.added += o.added;
        self.sensed += o.sensed;
        self.sent += o.sent;
        self.counters += o.counters;
    }
}

/// Energy and momentum of all free bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Kinetic, of motion and rotation.
    pub kinetic: f64,
    /// −m g·x, summed; 0 without gravity.
    pub potential: f64,
    /// m v, summed.
    pub linear: DVec3,
    /// x × m v + L, summed: about the world's origin.
    pub angular: DVec3,
}

impl Energy {
    /// Kinetic and potential together.
    pub fn total(&self) -> f64 {
        self.kinetic + self.potential
    }
}
