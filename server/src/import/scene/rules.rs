//! The rules of a scene file: which keys one may have follows from the table of rules (`contactd_proto::rule`).

use super::{Checker, Place, SceneError, SceneObject};
use contactd_proto::rule::{Field, Setting, Values, is_length};
use contactd_proto::{Detect, Effects, Rule};
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use std::collections::{HashMap, HashSet};
use std::fmt;
use toml::Spanned;

/// A rule as it stands in the file.
pub(super) struct RawRule {
    /// The two groups; both may be the same.
    between: [Spanned<String>; 2],
    /// Single pairs, by the objects' names, that this rule leaves out.
    except: Vec<[Spanned<String>; 2]>,
    /// The fields that are stated.
    settings: Vec<(&'static Field, Stated)>,
}

/// What is stated for a field.
enum Stated {
    Word(Spanned<String>),
    Flag(Spanned<bool>),
    Length(Spanned<f64>),
}

const FIXED: usize = 2;

/// The keys of a rule: its pairs, then the fields of the table.
static KEYS: [&str; FIXED + Effects::FIELDS.len()] = {
    let mut keys = ["between"; FIXED + Effects::FIELDS.len()];
    keys[1] = "except";
    let mut i = 0;
    while i < Effects::FIELDS.len() {
        keys[FIXED + i] = Effects::FIELDS[i].name;
        i += 1;
    }
    keys
};

/// A key, by its place among them.
struct Key(usize);

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Reader;
        impl Visitor<'_> for Reader {
            type Value = Key;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a key of a rule")
            }

            fn visit_str<E: Error>(self, key: &str) -> Result<Key, E> {
                let place = KEYS.iter().position(|known| *known == key);
                place.map(Key).ok_or_else(|| E::unknown_field(key, &KEYS))
            }
        }
        from.deserialize_identifier(Reader)
    }
}

impl<'de> Deserialize<'de> for RawRule {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Reader;
        impl<'de> Visitor<'de> for Reader {
            type Value = RawRule;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a rule")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<RawRule, A::Error> {
                let (mut between, mut except, mut settings) = (None, Vec::new(), Vec::new());
                while let Some(Key(key)) = map.next_key()? {
                    match key {
                        0 => between = Some(map.next_value()?),
                        1 => except = map.next_value()?,
                        _ => {
                            let field = &Effects::FIELDS[key - FIXED];
                            let stated = match field.values {
                                Values::Words(..) => Stated::Word(map.next_value()?),
                                Values::Flag(_) => Stated::Flag(map.next_value()?),
                                Values::Length => Stated::Length(map.next_value()?),
                            };
                            settings.push((field, stated));
                        }
                    }
                }
                let between = between.ok_or_else(|| A::Error::missing_field(KEYS[0]))?;
                Ok(RawRule { between, except, settings })
            }
        }
        from.deserialize_struct("rule", &KEYS, Reader)
    }
}

impl Checker<'_> {
    /// A rule whose exceptions are objects and whose fields hold what they may.
    pub(super) fn rule(&self, r: &RawRule, objects: &HashMap<String, usize>) -> Result<Rule, SceneError> {
        let mut except = Vec::with_capacity(r.except.len());
        for pair in &r.except {
            for name in pair {
                if !objects.contains_key(name.as_ref()) {
                    return Err(self.wrong(name, "the name of an object", &format!("\"{}\"", name.as_ref())));
                }
            }
            except.push(pair.each_ref().map(|name| name.as_ref().clone()));
        }
        let mut effects = Effects::DEFAULT;
        for (field, stated) in &r.settings {
            let setting = match stated {
                Stated::Word(word) => field.word(word.as_ref()).ok_or_else(|| self.wrong_word(word, field.words()))?,
                Stated::Flag(on) => Setting::Flag(*on.as_ref()),
                Stated::Length(length) => self.length(field, length)?,
            };
            let is_set = field.set(&mut effects, setting);
            debug_assert!(is_set, "a setting of another type is not read");
        }
        Ok(Rule { except, ..Rule::asking(r.between.each_ref().map(|group| group.as_ref().clone()), effects) })
    }

    fn length(&self, field: &Field, length: &Spanned<f64>) -> Result<Setting, SceneError> {
        let l = *length.as_ref();
        if is_length(l) {
            return Ok(Setting::Length(l));
        }
        Err(self.wrong(length, &format!("a finite {} that is not negative", field.name), &l.to_string()))
    }

    /// Rules that decide for no pair, exceptions that except none, and settings that mean nothing.
    pub(super) fn rules_without_effect(
        &self,
        rules: &[RawRule],
        objects: &[SceneObject],
        note: &mut impl FnMut(Place, String),
    ) {
        // How many objects each group has, and the group of each object.
        let mut members: HashMap<&str, usize> = HashMap::new();
        objects.iter().for_each(|o| *members.entry(&o.group).or_default() += 1);
        let group_of: HashMap<&str, &str> = objects.iter().map(|o| (o.name.as_str(), o.group.as_str())).collect();
        let mut decided: HashSet<[&str; 2]> = HashSet::new();
        for r in rules {
            let mut groups = r.between.each_ref().map(|group| group.as_ref().as_str());
            let strangers: Vec<_> = r.between.iter().filter(|g| !members.contains_key(g.as_ref().as_str())).collect();
            for g in &strangers {
                let text = format!("the rule decides for no pair: no object is of the group \"{}\"", g.as_ref());
                note(self.place(g), text);
            }
            if strangers.is_empty() && groups[0] == groups[1] && members[groups[0]] == 1 {
                let text = format!("the rule decides for no pair: the group \"{}\" has one object only", groups[0]);
                note(self.place(&r.between[0]), text);
            }
            groups.sort_unstable();
            if decided.contains(&groups) {
                let text = "the rule decides for no pair: one before it has the same groups and no exceptions".into();
                note(self.place(&r.between[0]), text);
            }
            if r.except.is_empty() {
                decided.insert(groups);
            }
            for [a, b] in &r.except {
                let mut theirs = [a, b].map(|name| group_of.get(name.as_ref().as_str()).copied().unwrap_or_default());
                theirs.sort_unstable();
                if theirs != groups || a.as_ref() == b.as_ref() {
                    let pair = format!("\"{}\" and \"{}\"", a.as_ref(), b.as_ref());
                    let text = format!("the exception has no effect: {pair} are no pair of the rule's groups");
                    note(self.place(a), text);
                }
            }
            if let Some(at) = self.beside_off(r) {
                note(at, "what the rule asks for has no effect beside detect = \"off\"".into());
            }
        }
    }

    /// The first setting of a rule that takes its pairs out and asks for something all the same.
    fn beside_off(&self, r: &RawRule) -> Option<Place> {
        let is_off = |stated: &Stated| matches!(stated, Stated::Word(word) if word.as_ref() == Detect::Off.name());
        let off = r.settings.iter().position(|(field, stated)| field.name == "detect" && is_off(stated))?;
        let others = r.settings.iter().enumerate().filter(|(i, _)| *i != off).map(|(_, (_, stated))| match stated {
            Stated::Word(word) => self.place(word),
            Stated::Flag(on) => self.place(on),
            Stated::Length(length) => self.place(length),
        });
        others.min_by_key(|place| (place.line, place.column))
    }
}
