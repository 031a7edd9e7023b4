//! Effects: what a scene asks of its pairs, by name, and how often each was worked out.
//!
//! One table (`effects!` below): counters, bits, words, and which rules ask for them. The wire, C, Python and what
//! `contactd inspect` says follow from it.

use crate::rule::{Detect, Effects, InitialOverlap, Report};
use iceoryx2::prelude::ZeroCopySend;

/// A row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Effect {
    /// The name of its counter.
    pub counter: &'static str,
    /// The name of its bit: `EFFECT_…`.
    pub bit: &'static str,
    /// The bit.
    pub value: u32,
    /// Its word.
    pub word: &'static str,
    /// What is counted, by lines.
    pub doc: &'static [&'static str],
    /// Whether a rule asks for it; `None` where it is the motion that decides.
    pub asked: Option<fn(&Effects) -> bool>,
}

macro_rules! effects {
    ($($(#[doc = $doc:literal])+ $field:ident = $bit:ident: $value:literal, $word:literal, $asked:expr;)+) => {
        /// How often each effect was worked out: in a step (its reply), or since the server's start (its status). An effect
        /// that no rule asks for, or that the motion itself rules out, is not worked out: its counter is exactly 0. What an
        /// earlier step has proven need not be worked out again, so counters are no part of the answer's bits.
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable,
        )]
        #[repr(C)]
        pub struct EffectCounters {
            $($(#[doc = $doc])+ pub $field: u64,)+
        }

        $($(#[doc = $doc])+ pub const $bit: u32 = $value;)+

        /// The table, in the order of the bits.
        pub const ALL: &[Effect] = &[$(Effect {
            counter: stringify!($field),
            bit: stringify!($bit),
            value: $value,
            word: $word,
            doc: &[$($doc),+],
            asked: $asked,
        }),+];

        impl EffectCounters {
            /// Each effect's word with its counter, in the order of the bits.
            pub fn each(&self) -> impl Iterator<Item = (&'static str, u64)> + use<> {
                [$(($word, self.$field)),+].into_iter()
            }

            /// The `EFFECT_…` bits of what ran: of the counters that are not 0.
            pub fn bits(&self) -> u32 {
                0 $(| if self.$field > 0 { $bit } else { 0 })+
            }
        }

        impl std::ops::AddAssign for EffectCounters {
            fn add_assign(&mut self, o: Self) {
                $(self.$field += o.$field;)+
            }
        }
    };
}

effects! {
    /// Pairs searched over the whole step.
    continuous = EFFECT_CONTINUOUS: 1, "continuous", Some(|e| e.detect == Detect::Continuous);
    /// Pairs tested at the end of the step only.
    discrete = EFFECT_DISCRETE: 2, "discrete", Some(|e| e.detect == Detect::Discrete);
    /// Of the pairs searched over the step those of which a body turns: their bounds are those of rotation.
    turning = EFFECT_TURNING: 4, "turning", None;
    /// Times of contact worked out: continued from the witness back to where the surfaces meet.
    times = EFFECT_TIME: 8, "time", Some(|e| e.report >= Report::Time);
    /// Contact points with their normal, kind and faces.
    contacts = EFFECT_CONTACT: 16, "contact", Some(|e| e.report >= Report::Contact);
    /// Pairs whose contact regions were looked for.
    patches = EFFECT_PATCH: 32, "patch", Some(|e| e.report >= Report::Patch);
    /// Deepest points of overlaps at the start.
    penetrations = EFFECT_PENETRATION: 64, "penetration", Some(|e| e.penetration);
    /// Separations tested against a margin.
    margins = EFFECT_MARGIN: 128, "margin", Some(|e| e.margin > 0.0);
    /// Overlaps at the start that were searched past.
    past_overlaps = EFFECT_PAST_OVERLAP: 256, "ignore_if_separating",
        Some(|e| e.initial_overlap == InitialOverlap::IgnoreIfSeparating);
    /// Sensor pairs told.
    sensors = EFFECT_SENSOR: 512, "sensor", Some(|e| e.sensor);
    /// Least distances over the step worked out.
    clearances = EFFECT_CLEARANCE: 1024, "clearance", Some(|e| e.clearance > 0.0);
}

const _: () = assert!(size_of::<EffectCounters>() == 8 * ALL.len());

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_name_what_ran_and_sums_add_up() {
        let mut sum = EffectCounters::default();
        assert_eq!(sum.bits(), 0);
        let step = EffectCounters { continuous: 3, sensors: 1, ..EffectCounters::default() };
        sum += step;
        sum += step;
        assert_eq!((sum.continuous, sum.sensors, sum.times), (6, 2, 0));
        assert_eq!(sum.bits(), EFFECT_CONTINUOUS | EFFECT_SENSOR);
        let reported: Vec<_> = sum.each().filter(|(_, n)| *n > 0).collect();
        assert_eq!(reported, [("continuous", 6), ("sensor", 2)]);
        assert!(sum.each().enumerate().all(|(i, (_, n))| (sum.bits() >> i & 1 == 1) == (n > 0)));
    }
}
