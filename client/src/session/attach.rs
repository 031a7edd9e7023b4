//! Parts that go with others, frames, and pairs that no rule tests: what a gripper needs of a session.
//!
//! All of it is the client's: a part that is attached gets each record of its carrier, in the same batch; pairs that are allowed to
//! meet are exceptions of the rules. So the server, recordings and a replay know of records and rules alone.

use super::{Session, unexpected};
use crate::transport::Transport;
use crate::{Error, Object};
use contactd_proto::control::{Answer, Command, WireFrame, WireRule};
use contactd_proto::{Pose, PoseRecord, Rule};
use std::collections::{BTreeMap, BTreeSet};

/// Another frame of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The object.
    pub object: u32,
    /// Its model in the frame.
    pub place: Pose,
    /// The frame in the world, where the object rests.
    pub pose: Pose,
}

/// A part that goes with another object.
#[derive(Clone, Debug)]
struct Attached {
    /// The object whose records it gets.
    carrier: u32,
    /// Objects that it may touch meanwhile.
    touching: Vec<u32>,
}

/// The most records of one object in a batch: a start and a motion.
const RECORDS: usize = 2;

/// The objects of a session by name and group, the rules, and what is not to be tested whatever they say.
#[derive(Clone, Debug, Default)]
pub(super) struct Company {
    /// Name and group of each object.
    names: BTreeMap<u32, [String; 2]>,
    rules: Vec<Rule>,
    allowed: BTreeSet<[u32; 2]>,
    attached: BTreeMap<u32, Attached>,
}

impl Company {
    /// An object was added; whether the rules have to be told anew: those that stand for none name groups.
    pub fn added(&mut self, id: u32, name: &str, group: &str) -> bool {
        let is_new = !self.names.values().any(|[_, known]| known == group);
        self.names.insert(id, [name.to_owned(), group.to_owned()]);
        is_new && self.rules.is_empty() && !self.exceptions().is_empty()
    }

    /// An object was removed. What it carried stays where it is.
    pub fn removed(&mut self, id: u32) {
        self.names.remove(&id);
        self.allowed.retain(|pair| !pair.contains(&id));
        self.attached.retain(|part, attached| *part != id && attached.carrier != id);
    }

    /// How many slots a batch needs for parts beside those of the caller, at most.
    pub fn slots(&self) -> usize {
        RECORDS * self.attached.len()
    }

    /// Writes the records of the parts behind the first `n` slots, those of the caller; how many slots are set then.
    pub fn fill(&self, slots: &mut [PoseRecord], n: usize) -> usize {
        let n = n.min(slots.len());
        let mut end = n;
        for (part, attached) in &self.attached {
            for i in 0..n {
                if slots[i].object == attached.carrier && end < slots.len() {
                    slots[end] = PoseRecord { object: *part, ..slots[i] };
                    end += 1;
                }
            }
        }
        end
    }

    /// Pairs of objects that are not tested.
    fn exceptions(&self) -> BTreeSet<[u32; 2]> {
        let touching =
            |(part, attached): (&u32, &Attached)| attached.touching.iter().map(|o| pair(*part, *o)).collect::<Vec<_>>();
        self.allowed.iter().copied().chain(self.attached.iter().flat_map(touching)).collect()
    }

    /// The rules as the server is told them. A scene without rules has one for each two groups, once a pair is excepted.
    fn effective(&self) -> Vec<Rule> {
        let names = |pair: [u32; 2]| {
            let [a, b] = pair.map(|id| self.names.get(&id).map(|[name, _]| name.clone()));
            Some([a?, b?])
        };
        let except: Vec<[String; 2]> = self.exceptions().into_iter().filter_map(names).collect();
        let mut rules = self.rules.clone();
        if rules.is_empty() && !except.is_empty() {
            let groups: BTreeSet<&String> = self.names.values().map(|[_, group]| group).collect();
            let groups: Vec<&String> = groups.into_iter().collect();
            for (i, group) in groups.iter().enumerate() {
                rules.extend(groups[i..].iter().map(|other| Rule::new([(*group).clone(), (*other).clone()])));
            }
        }
        for rule in &mut rules {
            rule.except.extend(except.iter().cloned());
        }
        rules
    }
}

/// A pair, the smaller id first.
fn pair(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

impl<T: Transport> Session<T> {
    /// Gives objects other frames, in which their models lie at other places: all of them, or none. A motion is one of an object's
    /// frame, whose origin goes straight while it turns; what is to turn about an axis needs a frame on that axis. The objects rest
    /// at the new poses. What is attached to them goes with the new frames.
    ///
    /// # Errors
    /// `Refused` at the index of a frame: unknown or static object, a pose that is none; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn reframe(&mut self, frames: &[Frame]) -> Result<(), Error> {
        let wire = |f: &Frame| WireFrame { object: f.object, place: f.place.into(), pose: f.pose.into() };
        let frames: Vec<WireFrame> = frames.iter().map(wire).collect();
        self.done(Command::Reframe(frames.clone()))?;
        if self.transport.may_lose_server() {
            frames.iter().for_each(|frame| self.journal.reframed(frame));
        }
        let carried: Vec<(u32, u32)> = self.company.attached.iter().map(|(part, a)| (*part, a.carrier)).collect();
        for (part, carrier) in carried.into_iter().filter(|(_, carrier)| frames.iter().any(|f| f.object == *carrier)) {
            self.carry(part, carrier)?;
        }
        Ok(())
    }

    /// From now on `part` moves with `carrier`, as it stands to it (at `options.advance` of the last step), and is not tested against it,
    /// nor against the objects in `touching`: those that a gripper holds it with. It gets the carrier's records, and none of its own.
    /// What is attached to the part goes along. A carrier that is attached itself hands it on to its own.
    ///
    /// # Errors
    /// `Misuse`: of a part to itself or to what it carries; `Refused`: an object is unknown, or the part is static; `ServerLost`,
    /// `ReplyLost`, `Timeout`, `System`.
    pub fn attach(&mut self, part: u32, carrier: u32, touching: &[u32]) -> Result<(), Error> {
        let root = self.company.attached.get(&carrier).map_or(carrier, |attached| attached.carrier);
        if root == part || carrier == part {
            return Err(Error::Misuse("a part cannot be attached to itself, nor to what it carries"));
        }
        let before = self.company.clone();
        self.carry(part, root)?;
        let along: Vec<u32> =
            self.company.attached.iter().filter(|(_, a)| a.carrier == part).map(|(id, _)| *id).collect();
        for id in along {
            self.carry(id, root)?;
            if let Some(attached) = self.company.attached.get_mut(&id) {
                attached.carrier = root;
            }
        }
        let mut touching = touching.to_vec();
        touching.push(carrier);
        self.company.attached.insert(part, Attached { carrier: root, touching });
        self.tell_rules().inspect_err(|_| self.company = before)
    }

    /// The part stays where it is from now on, and is tested as the rules say. Nothing where it is not attached.
    ///
    /// # Errors
    /// As `set_rules`.
    pub fn detach(&mut self, part: u32) -> Result<(), Error> {
        let before = self.company.clone();
        match self.company.attached.remove(&part) {
            None => Ok(()),
            Some(_) => self.tell_rules().inspect_err(|_| self.company = before),
        }
    }

    /// The object whose records a part gets; `None` where it is not attached.
    pub fn carrier(&self, part: u32) -> Option<u32> {
        self.company.attached.get(&part).map(|attached| attached.carrier)
    }

    /// Pairs of objects that may meet and are not tested, whatever the rules say (an allowed-collision matrix); `false`: no longer.
    /// They are exceptions of all rules, by the objects' names.
    ///
    /// # Errors
    /// `Misuse` for an object that was not added here; otherwise as `set_rules`.
    pub fn allow(&mut self, pairs: &[[u32; 2]], allowed: bool) -> Result<(), Error> {
        if pairs.iter().flatten().any(|id| !self.company.names.contains_key(id)) {
            return Err(Error::Misuse("expected pairs of objects of this session"));
        }
        let before = self.company.clone();
        for [a, b] in pairs {
            match allowed {
                true => self.company.allowed.insert(pair(*a, *b)),
                false => self.company.allowed.remove(&pair(*a, *b)),
            };
        }
        self.tell_rules().inspect_err(|_| self.company = before)
    }

    /// The rules that were set, without what is allowed beside them.
    pub fn rules(&self) -> &[Rule] {
        &self.company.rules
    }

    /// Replaces the session's rules. Pairs that are attached or allowed stay exceptions.
    ///
    /// # Errors
    /// `Refused` at the index of a bad rule; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn set_rules(&mut self, rules: &[Rule]) -> Result<(), Error> {
        let before = std::mem::replace(&mut self.company.rules, rules.to_vec());
        self.tell_rules().inspect_err(|_| self.company.rules = before)
    }

    /// Tells the server the rules with their exceptions.
    fn tell_rules(&mut self) -> Result<(), Error> {
        let rules = self.company.effective();
        self.done(Command::SetRules(rules.iter().map(WireRule::from).collect()))?;
        self.journal.rules(&rules);
        Ok(())
    }

    /// Adds an object; returns its id.
    ///
    /// # Errors
    /// `Refused`: unknown model, bad pose or speed, too many objects, resolution; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn add_object(&mut self, object: Object) -> Result<u32, Error> {
        let id = self.last_object + 1;
        let spec = object.spec(id);
        self.done(Command::AddObject(spec.clone()))?;
        self.last_object = id;
        let needs_rules = self.company.added(id, &spec.name, &spec.group);
        if self.transport.may_lose_server() {
            self.journal.object(spec);
        }
        if needs_rules {
            self.tell_rules()?;
        }
        Ok(id)
    }

    /// Removes an object; its id is not used again. What it carried stays where it is.
    ///
    /// # Errors
    /// `Refused`: unknown object; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn remove_object(&mut self, object: u32) -> Result<(), Error> {
        self.done(Command::RemoveObject(object))?;
        self.journal.removed(object);
        self.company.removed(object);
        Ok(())
    }

    /// Gives a part the frame of its carrier.
    fn carry(&mut self, object: u32, carrier: u32) -> Result<(), Error> {
        let advance = self.options.advance;
        match self.command(Command::Carry { object, carrier, advance })? {
            Answer::Reframed(frame) => {
                if self.transport.may_lose_server() {
                    self.journal.reframed(&frame);
                }
                Ok(())
            }
            other => Err(unexpected(&other)),
        }
    }
}
