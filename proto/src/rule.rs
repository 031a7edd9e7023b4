//! Rules: which pairs of a scene are searched, how, and what is told of them.
//!
//! Rules belong to pairs of groups. The first rule that names a pair decides; a pair that no rule names is off once a
//! scene has rules, and without rules every pair is continuous with report `contact`.

/// What happens between two groups of objects.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The two groups; both may be the same.
    pub between: [String; 2],
    /// Single pairs, by object name, that this rule leaves out.
    pub except: Vec<[String; 2]>,
    /// How the pair is searched.
    pub detect: Detect,
    /// What is told of it.
    pub report: Report,
    /// Depth and direction where a step starts in overlap.
    pub penetration: bool,
    /// Report at this separation (length, >= 0), measured by f: never late, early at sharp features.
    pub margin: f64,
    /// What a pair that starts in overlap does.
    pub initial_overlap: InitialOverlap,
    /// Record only; never stops first.
    pub sensor: bool,
}

impl Rule {
    /// The rule of `between` with every other field at its default.
    pub fn new(between: [String; 2]) -> Self {
        Self {
            between,
            except: Vec::new(),
            detect: Detect::Continuous,
            report: Report::Contact,
            penetration: false,
            margin: 0.0,
            initial_overlap: InitialOverlap::Report,
            sensor: false,
        }
    }

    /// True when the rule decides for objects of groups `groups` called `names`, in either order.
    pub fn names(&self, groups: [&str; 2], names: [&str; 2]) -> bool {
        let same = |p: &[String; 2], q: [&str; 2]| (p[0] == q[0] && p[1] == q[1]) || (p[0] == q[1] && p[1] == q[0]);
        same(&self.between, groups) && !self.except.iter().any(|e| same(e, names))
    }
}

macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $word:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $name { $($(#[$vdoc])* $variant),+ }

        impl $name {
            /// All of them, in the order of their codes.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The word that files use.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }

            /// The one that files call `word`.
            pub fn of_name(word: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|v| v.name() == word)
            }
        }
    };
}

words! {
    /// How a pair is searched.
    Detect {
        /// Not at all.
        Off = "off",
        /// The end pose only.
        Discrete = "discrete",
        /// The whole motion.
        Continuous = "continuous",
    }
}

words! {
    /// What is told of a pair; each includes the ones before it.
    Report {
        /// Yes or no.
        Hit = "hit",
        /// The time.
        Time = "time",
        /// Point, normal and kind.
        Contact = "contact",
        /// The points of all contact regions.
        Patch = "patch",
    }
}

words! {
    /// What a pair that starts in overlap does.
    InitialOverlap {
        /// The overlap is the answer.
        Report = "report",
        /// The search goes on for the starting depth + delta.
        IgnoreIfSeparating = "ignore_if_separating",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_names_its_groups_in_either_order_but_not_its_exceptions() {
        let mut rule = Rule::new(["robot".into(), "cell".into()]);
        rule.except.push(["gripper".into(), "part".into()]);
        assert!(rule.names(["cell", "robot"], ["a", "b"]));
        assert!(!rule.names(["cell", "cell"], ["a", "b"]));
        assert!(!rule.names(["cell", "robot"], ["part", "gripper"]));
    }

    #[test]
    fn every_word_is_read_back() {
        assert!(Detect::ALL.iter().all(|d| Detect::of_name(d.name()) == Some(*d)));
        assert!(Report::ALL.iter().all(|d| Report::of_name(d.name()) == Some(*d)));
        assert_eq!(Report::of_name("Hit"), None);
    }
}
