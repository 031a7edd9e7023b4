//! Rules: which pairs of a scene are searched, how, and what is told of them.
//!
//! Rules belong to pairs of groups. The first rule that names a pair decides; a pair that no rule names is off once a
//! scene has rules, and without rules every pair is continuous with report `contact`.
//!
//! What a rule can ask for stands in one table (`rules!` below). The wire, scene files, C, Python, the journal and the
//! engine's plans follow from it: [`Effects`] are its fields, [`Effects::FIELDS`] the same as a list for whoever reads or
//! writes them by name. docs/adding.md says what a new row touches.

use std::fmt;

macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[doc = $vdoc:literal])+ $variant:ident = $word:literal, $phrase:literal;)+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $name { $($(#[doc = $vdoc])+ $variant),+ }

        impl $name {
            /// All of them, in the order of their codes.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];
            /// Their words, in the same order.
            pub const WORDS: &'static [Word] =
                &[$(Word { word: $word, phrase: $phrase, doc: &[$($vdoc),+] }),+];

            /// The word that files use.
            pub fn name(self) -> &'static str {
                Self::WORDS[self as usize].word
            }

            /// The one that files call `word`.
            pub fn of_name(word: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|v| v.name() == word)
            }
        }
    };
}

/// A word that a field of a rule may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// As files have it.
    pub word: &'static str,
    /// What it says of a pair, for people; empty: nothing worth saying.
    pub phrase: &'static str,
    /// What it means, by lines.
    pub doc: &'static [&'static str],
}

words! {
    /// How a pair is searched.
    Detect {
        /// Not at all.
        Off = "off", "nothing";
        /// The end pose only.
        Discrete = "discrete", "the end pose only";
        /// The whole motion.
        Continuous = "continuous", "the whole motion";
    }
}

words! {
    /// What is told of a pair; each includes the ones before it.
    Report {
        /// Yes or no.
        Hit = "hit", "yes or no";
        /// The time too.
        Time = "time", "time";
        /// Point, normal and kind too.
        Contact = "contact", "time, point, normal, kind";
        /// The points of all contact regions too.
        Patch = "patch", "time, point, normal, kind, all contact regions";
    }
}

words! {
    /// What a pair that starts in overlap does.
    InitialOverlap {
        /// The overlap is the answer.
        Report = "report", "";
        /// The search goes on for the starting depth + the resolution.
        IgnoreIfSeparating = "ignore_if_separating", "an overlap at the start is searched past";
    }
}

/// A field of a rule that asks for something, for whoever reads or writes rules by name.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Its name, the same in files, C and Python.
    pub name: &'static str,
    /// What it means, by lines.
    pub doc: &'static [&'static str],
    /// What it may hold.
    pub values: Values,
    /// What it holds where nothing is said.
    pub initial: Setting,
    read: fn(&Effects) -> Setting,
    write: fn(&mut Effects, Setting) -> bool,
}

/// What a field may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// One of some words; the name of their type, and the words by their codes.
    Words(&'static str, &'static [Word]),
    /// Yes or no; what a yes says of a pair, for people.
    Flag(&'static str),
    /// A finite length >= 0.
    Length,
}

/// What a field holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Setting {
    /// A word, by its code.
    Word(u32),
    /// Yes or no.
    Flag(bool),
    /// A length.
    Length(f64),
}

impl Field {
    /// The field of a name.
    pub fn of_name(name: &str) -> Option<&'static Self> {
        Effects::FIELDS.iter().find(|field| field.name == name)
    }

    /// What it holds in `effects`.
    pub fn get(&self, effects: &Effects) -> Setting {
        (self.read)(effects)
    }

    /// Sets it. False for a setting of another type, and for a code that has no word; then nothing has changed. A length that is
    /// no length is refused where rules come into force ([`Effects::bad_length`]).
    #[must_use]
    pub fn set(&self, effects: &mut Effects, setting: Setting) -> bool {
        (self.write)(effects, setting)
    }

    /// The setting of a word; `None` for one that it does not know.
    pub fn word(&self, word: &str) -> Option<Setting> {
        let Values::Words(_, words) = self.values else { return None };
        words.iter().position(|w| w.word == word).map(|code| Setting::Word(code as u32))
    }

    /// The words that it knows; none where it holds something else.
    pub fn words(&self) -> impl Iterator<Item = &'static str> + use<> {
        let words: &[Word] = if let Values::Words(_, words) = self.values { words } else { &[] };
        words.iter().map(|w| w.word)
    }
}

/// A number that a field cannot hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfTable {
    /// The field.
    pub field: &'static str,
    /// The largest number that it may hold.
    pub largest: u32,
    /// What was found.
    pub found: u32,
}

macro_rules! rules {
    (
        words { $($(#[doc = $wdoc:literal])+ $word:ident: $type:ident = $initial:ident;)+ }
        flags { $($(#[doc = $fdoc:literal])+ $flag:ident, $phrase:literal;)+ }
        lengths { $($(#[doc = $ldoc:literal])+ $length:ident;)+ }
    ) => {
        /// What happens between two groups of objects.
        #[derive(Clone, Debug, PartialEq)]
        pub struct Rule {
            /// The two groups; both may be the same.
            pub between: [String; 2],
            /// Single pairs, by object name, that this rule leaves out.
            pub except: Vec<[String; 2]>,
            $($(#[doc = $wdoc])+ pub $word: $type,)+
            $($(#[doc = $fdoc])+ pub $flag: bool,)+
            $($(#[doc = $ldoc])+ pub $length: f64,)+
        }

        /// What a rule asks for its pairs.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Effects {
            $($(#[doc = $wdoc])+ pub $word: $type,)+
            $($(#[doc = $fdoc])+ pub $flag: bool,)+
            $($(#[doc = $ldoc])+ pub $length: f64,)+
        }

        /// The same as numbers: words by their codes, 0 or 1 for no and yes.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[repr(C)]
        pub struct RuleNumbers {
            $($(#[doc = $ldoc])+ pub $length: f64,)+
            $($(#[doc = $wdoc])+ pub $word: u32,)+
            $($(#[doc = $fdoc])+ pub $flag: u32,)+
        }

        impl Rule {
            /// The rule of `between` with these effects and without exceptions.
            pub fn asking(between: [String; 2], effects: Effects) -> Self {
                let Effects { $($word,)+ $($flag,)+ $($length,)+ } = effects;
                Self { between, except: Vec::new(), $($word,)+ $($flag,)+ $($length,)+ }
            }

            /// What it asks for.
            pub fn effects(&self) -> Effects {
                Effects { $($word: self.$word,)+ $($flag: self.$flag,)+ $($length: self.$length,)+ }
            }
        }

        impl Effects {
            /// What is asked where nothing is said.
            pub const DEFAULT: Self =
                Self { $($word: $type::$initial,)+ $($flag: false,)+ $($length: 0.0,)+ };

            /// The fields, in the order of the table.
            pub const FIELDS: &'static [Field] = &[
                $(Field {
                    name: stringify!($word),
                    doc: &[$($wdoc),+],
                    values: Values::Words(stringify!($type), $type::WORDS),
                    initial: Setting::Word($type::$initial as u32),
                    read: |e| Setting::Word(e.$word as u32),
                    write: |e, s| match s {
                        Setting::Word(code) => $type::ALL.get(code as usize).map(|w| e.$word = *w).is_some(),
                        Setting::Flag(_) | Setting::Length(_) => false,
                    },
                },)+
                $(Field {
                    name: stringify!($flag),
                    doc: &[$($fdoc),+],
                    values: Values::Flag($phrase),
                    initial: Setting::Flag(false),
                    read: |e| Setting::Flag(e.$flag),
                    write: |e, s| if let Setting::Flag(on) = s { e.$flag = on; true } else { false },
                },)+
                $(Field {
                    name: stringify!($length),
                    doc: &[$($ldoc),+],
                    values: Values::Length,
                    initial: Setting::Length(0.0),
                    read: |e| Setting::Length(e.$length),
                    write: |e, s| if let Setting::Length(to) = s { e.$length = to; true } else { false },
                },)+
            ];
        }

        impl From<&Effects> for RuleNumbers {
            fn from(e: &Effects) -> Self {
                Self { $($length: e.$length,)+ $($word: e.$word as u32,)+ $($flag: u32::from(e.$flag),)+ }
            }
        }

        impl RuleNumbers {
            /// Each field's name and where it stands, bytes, in the order of the fields.
            pub const OFFSETS: &'static [(&'static str, usize)] = &[
                $((stringify!($length), std::mem::offset_of!(Self, $length)),)+
                $((stringify!($word), std::mem::offset_of!(Self, $word)),)+
                $((stringify!($flag), std::mem::offset_of!(Self, $flag)),)+
            ];

            /// What they stand for.
            ///
            /// # Errors
            /// The first number that is none of its field's.
            pub fn checked(&self) -> Result<Effects, OutOfTable> {
                let code = |field, found: u32, largest: usize| {
                    if found as usize <= largest { Ok(found as usize) } else {
                        Err(OutOfTable { field, largest: largest as u32, found })
                    }
                };
                Ok(Effects {
                    $($length: self.$length,)+
                    $($word: $type::ALL[code(stringify!($word), self.$word, $type::ALL.len() - 1)?],)+
                    $($flag: code(stringify!($flag), self.$flag, 1)? == 1,)+
                })
            }
        }
    };
}

rules! {
    words {
        /// How the pair is searched.
        detect: Detect = Continuous;
        /// What is told of it.
        report: Report = Contact;
        /// What a pair that starts in overlap does.
        initial_overlap: InitialOverlap = Report;
    }
    flags {
        /// Depth and direction where a step starts in overlap; with patches, too, by which faces the bodies are in each other.
        penetration, "depth of an overlap";
        /// Record only; never stops a search for the scene's first contact.
        sensor, "sensor: stops nothing";
    }
    lengths {
        /// Report at this separation too (length, >= 0): measured by f, never late, early at sharp features.
        margin;
        /// Tell the least distance over the step, its bounds no farther apart than this (length); 0: not asked.
        clearance;
    }
}

impl Rule {
    /// The rule of `between` with every other field at its default.
    pub fn new(between: [String; 2]) -> Self {
        Self::asking(between, Effects::DEFAULT)
    }

    /// True when the rule decides for objects of groups `groups` called `names`, in either order.
    pub fn names(&self, groups: [&str; 2], names: [&str; 2]) -> bool {
        let same = |p: &[String; 2], q: [&str; 2]| (p[0] == q[0] && p[1] == q[1]) || (p[0] == q[1] && p[1] == q[0]);
        same(&self.between, groups) && !self.except.iter().any(|e| same(e, names))
    }
}

impl Effects {
    /// The first field whose length is none (finite, >= 0), and what it is.
    pub fn bad_length(&self) -> Option<(&'static str, f64)> {
        Self::FIELDS.iter().find_map(|field| match field.get(self) {
            Setting::Length(l) if !is_length(l) => Some((field.name, l)),
            Setting::Length(_) | Setting::Word(_) | Setting::Flag(_) => None,
        })
    }

    /// What is asked, in words for people: a phrase for each field that asks for something.
    pub fn phrases(&self) -> Vec<String> {
        let phrase = |field: &Field| match (field.values, field.get(self)) {
            (Values::Words(_, words), Setting::Word(code)) => words[code as usize].phrase.to_owned(),
            (Values::Flag(phrase), Setting::Flag(true)) => phrase.to_owned(),
            (Values::Length, Setting::Length(l)) if l > 0.0 => format!("{} {l}", field.name),
            _ => String::new(),
        };
        Self::FIELDS.iter().map(phrase).filter(|phrase| !phrase.is_empty()).collect()
    }
}

/// Each field with what it holds, as files have it; a flag by its name alone, where it is set.
impl fmt::Display for Effects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let each = Self::FIELDS.iter().filter_map(|field| match (field.values, field.get(self)) {
            (Values::Words(_, words), Setting::Word(code)) => {
                Some(format!("{} {}", field.name, words[code as usize].word))
            }
            (_, Setting::Length(length)) => Some(format!("{} {length}", field.name)),
            (_, Setting::Flag(true)) => Some(field.name.to_owned()),
            (_, Setting::Flag(false) | Setting::Word(_)) => None,
        });
        f.write_str(&each.collect::<Vec<_>>().join(", "))
    }
}

/// True for what a field that holds a length may hold.
pub fn is_length(length: f64) -> bool {
    length.is_finite() && length >= 0.0
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

    #[test]
    fn every_field_is_read_back_and_takes_its_own_settings_alone() {
        for field in Effects::FIELDS {
            let settings = match field.values {
                Values::Words(_, words) => (0..words.len() as u32).map(Setting::Word).collect(),
                Values::Flag(_) => vec![Setting::Flag(true), Setting::Flag(false)],
                Values::Length => vec![Setting::Length(0.5)],
            };
            let mut effects = Effects::DEFAULT;
            assert_eq!(field.get(&effects), field.initial, "{}", field.name);
            for setting in settings {
                assert!(field.set(&mut effects, setting), "{}", field.name);
                assert_eq!(field.get(&effects), setting, "{}", field.name);
                assert_eq!(RuleNumbers::from(&effects).checked(), Ok(effects));
                // Nothing else has changed.
                let mut back = effects;
                assert!(field.set(&mut back, field.initial));
                assert_eq!(back, Effects::DEFAULT);
            }
            let other = if matches!(field.values, Values::Flag(_)) { Setting::Word(0) } else { Setting::Flag(true) };
            let before = effects;
            assert!(!field.set(&mut effects, other) && !field.set(&mut effects, Setting::Word(99)));
            assert_eq!(effects, before);
            assert_eq!(Field::of_name(field.name).map(|f| f.name), Some(field.name));
        }
        let numbers = RuleNumbers { sensor: 2, ..RuleNumbers::from(&Effects::DEFAULT) };
        assert_eq!(numbers.checked(), Err(OutOfTable { field: "sensor", largest: 1, found: 2 }));
        assert_eq!(Effects { margin: -1.0, ..Effects::DEFAULT }.bad_length(), Some(("margin", -1.0)));
        assert_eq!(
            Effects { sensor: true, margin: 2.5, ..Effects::DEFAULT }.phrases(),
            ["the whole motion", "time, point, normal, kind", "sensor: stops nothing", "margin 2.5"]
        );
    }
}
