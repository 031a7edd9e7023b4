//! Effects: what a scene asks of its pairs, by name, and how often each was worked out.

use iceoryx2::prelude::ZeroCopySend;

macro_rules! effects {
    ($($(#[$doc:meta])* $field:ident = $bit:ident: $value:literal, $word:literal);+ $(;)?) => {
        /// How often each effect was worked out: in a step (its reply), or since the server's start (its status). An effect
        /// that no rule asks for, or that the motion itself rules out, is not worked out: its counter is exactly 0. What an
        /// earlier step has proven need not be worked out again, so counters are no part of the answer's bits.
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend, bytemuck::Pod, bytemuck::Zeroable,
        )]
        #[repr(C)]
        pub struct EffectCounters {
            $($(#[$doc])* pub $field: u64,)+
        }

        $($(#[$doc])* pub const $bit: u32 = $value;)+

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
    continuous = EFFECT_CONTINUOUS: 1, "continuous";
    /// Pairs tested at the end of the step only.
    discrete = EFFECT_DISCRETE: 2, "discrete";
    /// Of the pairs searched over the step those of which a body turns: their bounds are those of rotation.
    turning = EFFECT_TURNING: 4, "turning";
    /// Times of contact worked out: continued from the witness back to where the surfaces meet.
    times = EFFECT_TIME: 8, "time";
    /// Contact points with their normal, kind and faces.
    contacts = EFFECT_CONTACT: 16, "contact";
    /// Pairs whose contact regions were looked for.
    patches = EFFECT_PATCH: 32, "patch";
    /// Deepest points of overlaps at the start.
    penetrations = EFFECT_PENETRATION: 64, "penetration";
    /// Separations tested against a margin.
    margins = EFFECT_MARGIN: 128, "margin";
    /// Overlaps at the start that were searched past.
    past_overlaps = EFFECT_PAST_OVERLAP: 256, "ignore_if_separating";
    /// Sensor pairs told.
    sensors = EFFECT_SENSOR: 512, "sensor";
}

const _: () = assert!(size_of::<EffectCounters>() == 80);

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
