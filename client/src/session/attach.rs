//! Parts that go with others, frames, and pairs that no rule tests: what a gripper needs of a session.
//!
//! All of it is the client's: a part that is attached gets each record of its carrier, in the same batch; pairs that are allowed to
//! meet are exceptions of the rules. So the server, recordings and a replay know of records and rules alone.

use super::stage::Stage;
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

/// An object of the session.
#[derive(Clone, Debug)]
struct Member {
    name: String,
    group: String,
    /// Its model in its frame.
    place: Pose,
    /// Its model in the frame that it has where it is not attached.
    own: Pose,
}

/// A part that goes with another object.
#[derive(Clone, Debug)]
struct Attached {
    /// The object that it was attached to, which may be attached itself.
    carrier: u32,
    /// The object at the end of that chain, whose frame it has and whose records it gets.
    root: u32,
    /// Its model as the root's model sees it.
    held: Pose,
    /// Objects that it may touch meanwhile, the carrier among them.
    touching: Vec<u32>,
}

/// A part that is given another frame rests there; where the next step begins is told once.
const ADVANCED: Error = Error::Misuse(
    "what was attached, detached or had its carrier removed since the last step stands where `advance` was set to then: set it before, and \
     leave it until the step",
);

/// The most records of one object in a batch: a start and a motion.
const RECORDS: usize = 2;

/// Exceptions go by names, as in scene files.
const AMBIGUOUS: Error = Error::Misuse(
    "what is attached or allowed is told by names, and another object has the same: give each object a name of its own",
);

/// The objects of a session, the rules, and what is not to be tested whatever they say.
#[derive(Debug, Default)]
pub(super) struct Company {
    members: BTreeMap<u32, Member>,
    rules: Vec<Rule>,
    allowed: BTreeSet<[u32; 2]>,
    attached: BTreeMap<u32, Attached>,
    /// Names of objects in an exception; `None` where these have changed since.
    taken: Option<BTreeSet<String>>,
    /// The server may have rules with other exceptions.
    owes_rules: bool,
    /// Objects may have other frames than they should.
    owes_frames: bool,
    /// The `advance` at which parts were given frames since the last step.
    framed_at: Option<f64>,
}

impl Company {
    /// True for the name of an object that is attached or allowed to meet another one: no other may have it.
    fn is_taken(&mut self, name: &str) -> bool {
        if self.allowed.is_empty() && self.attached.is_empty() {
            return false;
        }
        let taken = self.taken.get_or_insert_with(|| {
            let touching = self.attached.iter().flat_map(|(part, attached)| attached.touching.iter().chain([part]));
            let members = self.allowed.iter().flatten().chain(touching).filter_map(|id| self.members.get(id));
            members.map(|member| member.name.clone()).collect()
        });
        taken.contains(name)
    }

    /// True where an object is in an exception.
    fn is_excepted(&self, id: u32) -> bool {
        let attached = |(part, attached): (&u32, &Attached)| *part == id || attached.touching.contains(&id);
        self.allowed.iter().any(|pair| pair.contains(&id)) || self.attached.iter().any(attached)
    }

    /// Exceptions are others from now on.
    fn change(&mut self) {
        (self.taken, self.owes_rules) = (None, true);
    }

    /// True where there are no rules but what stands for them, which names each group.
    fn stands_for_rules(&self) -> bool {
        self.rules.is_empty() && !self.exceptions().is_empty()
    }

    /// How many slots a batch needs for parts beside those of the caller, at most.
    pub fn slots(&self) -> usize {
        RECORDS * self.attached.len()
    }

    /// True for a part, which has no records of its own.
    pub fn is_attached(&self, id: u32) -> bool {
        self.attached.contains_key(&id)
    }

    /// The object whose records an object gets: its own, unless it is attached.
    pub fn root_of(&self, id: u32) -> u32 {
        self.attached.get(&id).map_or(id, |attached| attached.root)
    }

    /// Writes the records of the parts behind the first `n` slots, those of the caller; how many slots are set then.
    pub fn fill(&self, slots: &mut [PoseRecord], n: usize) -> usize {
        let n = n.min(slots.len());
        let mut end = n;
        for (part, attached) in &self.attached {
            for i in 0..n {
                if slots[i].object == attached.root && end < slots.len() {
                    slots[end] = PoseRecord { object: *part, ..slots[i] };
                    end += 1;
                }
            }
        }
        end
    }

    /// An object and those that carry it, up to its root.
    fn carriers(&self, id: u32) -> impl Iterator<Item = u32> {
        std::iter::successors(Some(id), |id| self.attached.get(id).map(|attached| attached.carrier))
    }

    /// What hangs on an object, over whatever is between.
    fn parts_of(&self, id: u32) -> Vec<u32> {
        self.attached.keys().copied().filter(|part| self.carriers(*part).skip(1).any(|own| own == id)).collect()
    }

    /// Where an object's model lies in its frame.
    fn place_of(&self, id: u32) -> Pose {
        self.members.get(&id).map_or(Pose::IDENTITY, |member| member.place)
    }

    /// Pairs of objects that are not tested.
    fn exceptions(&self) -> BTreeSet<[u32; 2]> {
        let touching =
            |(part, attached): (&u32, &Attached)| attached.touching.iter().map(|o| pair(*part, *o)).collect::<Vec<_>>();
        self.allowed.iter().copied().chain(self.attached.iter().flat_map(touching)).collect()
    }

    /// True where the names of an exception are those of another pair, which would not be tested either.
    fn is_ambiguous(&self) -> bool {
        let exceptions = self.exceptions();
        if exceptions.is_empty() {
            return false;
        }
        let mut called: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
        for (id, member) in &self.members {
            called.entry(&member.name).or_default().push(*id);
        }
        let alike = |id: &u32| self.members.get(id).map_or(&[][..], |member| &called[member.name.as_str()]);
        exceptions.iter().any(|[a, b]| {
            let others = alike(a).iter().flat_map(|x| alike(b).iter().map(|y| pair(*x, *y)));
            others.into_iter().any(|[x, y]| x != y && !exceptions.contains(&[x, y]))
        })
    }

    /// The rules as the server is told them. A scene without rules has one for each two groups, once a pair is excepted.
    fn effective(&self) -> Vec<Rule> {
        let names = |pair: [u32; 2]| {
            let [a, b] = pair.map(|id| self.members.get(&id).map(|member| member.name.clone()));
            Some([a?, b?])
        };
        let except: Vec<[String; 2]> = self.exceptions().into_iter().filter_map(names).collect();
        let mut rules = self.rules.clone();
        if rules.is_empty() && !except.is_empty() {
            let groups: BTreeSet<&String> = self.members.values().map(|member| &member.group).collect();
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
    /// at the new poses. What is attached to them goes along, and has the new frames.
    ///
    /// # Errors
    /// `Refused` at the index of a frame: unknown or static object, a pose that is none; `Misuse` for an object that is attached, whose
    /// frame is its carrier's; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn reframe(&mut self, frames: &[Frame]) -> Result<(), Error> {
        self.settle()?;
        if frames.iter().any(|frame| self.company.is_attached(frame.object)) {
            return Err(Error::Misuse("a part that is attached has its carrier's frame: detach it first"));
        }
        let mut all = frames.to_vec();
        let mut of_frame: Vec<usize> = (0..frames.len()).collect();
        for (part, attached) in &self.company.attached {
            if let Some(i) = frames.iter().rposition(|frame| frame.object == attached.root) {
                let frame = &frames[i];
                all.push(Frame { object: *part, place: frame.place.compose(&attached.held), pose: frame.pose });
                of_frame.push(i);
            }
        }
        self.give_frames(&all).map_err(|error| match error {
            // What a part cannot have its carrier cannot be given.
            Error::Refused { code, index: Some(i), detail } if i as usize >= frames.len() => {
                Error::Refused { code, index: of_frame.get(i as usize).map(|i| *i as u32), detail }
            }
            other => other,
        })?;
        for frame in frames {
            if let Some(member) = self.company.members.get_mut(&frame.object) {
                member.own = frame.place;
            }
        }
        Ok(())
    }

    /// From now on `part` moves with `carrier`, as it stands to it (at `options.advance` of the last step, which must be left as it is until the
    /// next one), and is not tested against it,
    /// nor against the objects in `touching`: those that a gripper holds it with. It has the carrier's frame and gets its records, and none
    /// of its own. What is attached to the part goes along. A carrier that is attached itself hands it on to its own.
    ///
    /// # Errors
    /// `Misuse`: of a part to itself or to what it carries; an object in `touching` that was not added here; names that are others' as
    /// well; `Refused`: an object is unknown, or the part is static; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn attach(&mut self, part: u32, carrier: u32, touching: &[u32]) -> Result<(), Error> {
        if self.company.carriers(carrier).any(|own| own == part) {
            return Err(Error::Misuse("a part cannot be attached to itself, nor to what it carries"));
        }
        if touching.iter().any(|id| !self.company.members.contains_key(id)) {
            return Err(Error::Misuse("expected objects of this session that the part may touch"));
        }
        self.settle()?;
        self.check_advance()?;
        let (root, held) = (self.company.root_of(carrier), Pose::IDENTITY);
        let touching = touching.iter().copied().chain([carrier]).collect();
        let before = self.company.attached.clone();
        let done = self.as_one(|session| {
            session.company.attached.insert(part, Attached { carrier, root, held, touching });
            session.company.change();
            if session.company.is_ambiguous() {
                return Err(AMBIGUOUS);
            }
            session.company.owes_frames = true;
            session.hand_over(part, root)?;
            session.tell_rules()
        });
        // Refused before any part had another frame, as for an object that is not there: nothing is owed.
        let is_refused = matches!(done, Err(Error::Refused { .. })) && self.company.framed_at.is_none();
        self.company.owes_frames &= done.is_err() && !is_refused;
        done.inspect_err(|_| {
            self.company.attached = before;
            self.company.change();
        })
    }

    /// The part stays where it is from now on (at `options.advance` of the last step, which must be left as it is until the next one), in the
    /// frame that it had of its own, and is tested as the rules say; what is attached to it goes with it. Nothing where it is not attached.
    ///
    /// # Errors
    /// As `set_rules`; `Misuse` where parts were given frames since the last step at another `advance`.
    pub fn detach(&mut self, part: u32) -> Result<(), Error> {
        self.settle()?;
        if !self.company.is_attached(part) {
            return Ok(());
        }
        self.check_advance()?;
        self.as_one(|session| {
            session.release(part)?;
            session.tell_rules()
        })
    }

    /// Several commands that are one act. Where the session is lost on the way all is as it was before, and so is what a successor is told:
    /// asked again the act is that of a session that was not lost, to the bit.
    fn as_one(&mut self, act: impl FnOnce(&mut Self) -> Result<(), Error>) -> Result<(), Error> {
        let company = &self.company;
        let before = (company.attached.clone(), company.framed_at, company.owes_frames);
        let places: Vec<(u32, Pose)> = company.members.iter().map(|(id, member)| (*id, member.place)).collect();
        self.journal.begin();
        let done = act(self);
        if done.is_ok() || !matches!(self.stage, Stage::Lost) {
            self.journal.end();
            return done;
        }
        self.journal.undo();
        let company = &mut self.company;
        (company.attached, company.framed_at, company.owes_frames) = before;
        for (id, place) in places {
            if let Some(member) = company.members.get_mut(&id) {
                member.place = place;
            }
        }
        company.change();
        done
    }

    /// The object at the end of a part's chain, whose records it gets; `None` where it is not attached.
    pub fn carrier(&self, part: u32) -> Option<u32> {
        self.company.carriers(part).skip(1).last()
    }

    /// Pairs of objects that may meet and are not tested, whatever the rules say (an allowed-collision matrix); `false`: no longer.
    /// They are exceptions of all rules, by the objects' names.
    ///
    /// # Errors
    /// `Misuse` for an object that was not added here, one with itself, or one whose name is another's as well; otherwise as `set_rules`.
    pub fn allow(&mut self, pairs: &[[u32; 2]], allowed: bool) -> Result<(), Error> {
        if pairs.iter().flatten().any(|id| !self.company.members.contains_key(id)) {
            return Err(Error::Misuse("expected pairs of objects of this session"));
        }
        if pairs.iter().any(|[a, b]| a == b) {
            return Err(Error::Misuse("expected pairs of two objects, found one object twice"));
        }
        self.settle()?;
        let before = self.company.allowed.clone();
        for [a, b] in pairs {
            match allowed {
                true => self.company.allowed.insert(pair(*a, *b)),
                false => self.company.allowed.remove(&pair(*a, *b)),
            };
        }
        self.company.change();
        let done = if self.company.is_ambiguous() { Err(AMBIGUOUS) } else { self.tell_rules() };
        done.inspect_err(|_| {
            self.company.allowed = before;
            self.company.change();
        })
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
        self.company.owes_rules = false;
        Ok(())
    }

    /// Does what an earlier call could not end, as where its server was lost: frames and rules are what the company says.
    pub(super) fn settle(&mut self) -> Result<(), Error> {
        if self.company.owes_frames {
            // Roots first: parts have the frames that these have then.
            let is_astray = |(id, member): (&u32, &Member)| {
                (!self.company.is_attached(*id) && member.place != member.own).then_some(*id)
            };
            let astray: Vec<u32> = self.company.members.iter().filter_map(is_astray).collect();
            for id in astray {
                self.own_frame(id, id)?;
            }
            let parts: Vec<u32> = self.company.attached.keys().copied().collect();
            for part in parts {
                let root = self.company.carriers(part).last().unwrap_or(part);
                self.hand_over_one(part, root)?;
            }
            self.company.owes_frames = false;
        }
        if self.company.owes_rules { self.tell_rules() } else { Ok(()) }
    }

    /// Adds an object; returns its id.
    ///
    /// # Errors
    /// `Refused`: unknown model, bad pose or speed, too many objects, resolution; `Misuse`: a name of an object that is attached or allowed
    /// to meet another one; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn add_object(&mut self, object: Object) -> Result<u32, Error> {
        // What is owed first: the object is there in any case once it was added.
        self.settle()?;
        let id = self.last_object + 1;
        let spec = object.spec(id);
        if self.company.is_taken(&spec.name) {
            return Err(AMBIGUOUS);
        }
        self.done(Command::AddObject(spec.clone()))?;
        self.last_object = id;
        let is_new = !self.company.members.values().any(|member| member.group == spec.group);
        // The server has taken it.
        let place = spec.place.checked().unwrap_or(Pose::IDENTITY);
        let member = Member { name: spec.name.clone(), group: spec.group.clone(), place, own: place };
        self.company.members.insert(id, member);
        if self.transport.may_lose_server() {
            self.journal.object(spec);
        }
        if is_new && self.company.stands_for_rules() {
            self.company.owes_rules = true;
        }
        // The object is there, whatever becomes of the rules: they are told before the next step at the latest.
        self.settle()?;
        Ok(id)
    }

    /// Removes an object; its id is not used again. What it carried stays where it is, as if it was detached before (see `detach`).
    ///
    /// # Errors
    /// `Refused`: unknown object; `Misuse` as for `detach`; `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn remove_object(&mut self, object: u32) -> Result<(), Error> {
        self.settle()?;
        let is_excepted = self.company.is_excepted(object);
        let carried: Vec<u32> =
            self.company.attached.iter().filter(|(_, a)| a.carrier == object).map(|(part, _)| *part).collect();
        if !carried.is_empty() {
            self.check_advance()?;
        }
        self.as_one(|session| {
            for part in carried {
                session.release(part)?;
            }
            session.done(Command::RemoveObject(object))
        })?;
        self.journal.removed(object);
        let company = &mut self.company;
        company.members.remove(&object);
        if is_excepted {
            company.allowed.retain(|pair| !pair.contains(&object));
            company.attached.remove(&object);
            company.attached.values_mut().for_each(|attached| attached.touching.retain(|id| *id != object));
            company.change();
        }
        // Another object of its name is none of them. The object is gone, whatever becomes of the rules: where the session is lost meanwhile
        // they are told after the replay.
        self.settle().or_else(|e| if matches!(self.stage, Stage::Lost) { Ok(()) } else { Err(e) })
    }

    /// Ends that a part is attached: it has its own frame again, where it stands, and what hangs on it has that one.
    fn release(&mut self, part: u32) -> Result<(), Error> {
        let root = self.company.root_of(part);
        self.company.attached.remove(&part);
        self.company.change();
        self.company.owes_frames = true;
        self.own_frame(part, root)?;
        for id in self.company.parts_of(part) {
            self.hand_over(id, part)?;
        }
        self.company.owes_frames = false;
        Ok(())
    }

    /// Gives an object the frame that it has where it is not attached, where it stands by now in the frame of another one.
    fn own_frame(&mut self, object: u32, root: u32) -> Result<(), Error> {
        let Some(own) = self.company.members.get(&object).map(|member| member.own) else { return Ok(()) };
        let frame = self.carry(object, root)?;
        let pose = frame.pose.compose(&frame.place).compose(&own.inverse());
        self.give_frames(&[Frame { object, place: own, pose }])
    }

    /// Gives a part that is attached, and what hangs on it, the frame of the object at the end of its chain.
    fn hand_over(&mut self, part: u32, root: u32) -> Result<(), Error> {
        self.hand_over_one(part, root)?;
        self.company.parts_of(part).into_iter().try_for_each(|id| self.hand_over_one(id, root))
    }

    fn hand_over_one(&mut self, part: u32, root: u32) -> Result<(), Error> {
        let frame = self.carry(part, root)?;
        let held = self.company.place_of(root).inverse().compose(&frame.place);
        if let Some(attached) = self.company.attached.get_mut(&part) {
            (attached.root, attached.held) = (root, held);
        }
        Ok(())
    }

    /// Gives objects frames, whatever is attached.
    fn give_frames(&mut self, frames: &[Frame]) -> Result<(), Error> {
        let wire = |f: &Frame| WireFrame { object: f.object, place: f.place.into(), pose: f.pose.into() };
        let wires: Vec<WireFrame> = frames.iter().map(wire).collect();
        self.done(Command::Reframe(wires.clone()))?;
        wires.iter().zip(frames).for_each(|(wire, frame)| self.reframed(wire, frame.place));
        Ok(())
    }

    /// Gives a part the frame of another object, where it stands: that frame, and where the part's model lies in it.
    fn carry(&mut self, object: u32, carrier: u32) -> Result<Frame, Error> {
        self.check_advance()?;
        let advance = self.options.advance;
        let answer = self.command(Command::Carry { object, carrier, advance })?;
        let Answer::Reframed(wire) = &answer else { return Err(unexpected(&answer)) };
        let (place, pose) = wire.checked().map_err(|_| unexpected(&answer))?;
        self.reframed(wire, place);
        self.company.framed_at = Some(advance);
        Ok(Frame { object, place, pose })
    }

    /// Whether the parts that have other frames since the last step stand where the next one begins.
    pub(super) fn check_advance(&self) -> Result<(), Error> {
        if self.company.framed_at.is_some_and(|at| at != self.options.advance) { Err(ADVANCED) } else { Ok(()) }
    }

    /// A step has begun where its options say.
    pub(super) fn advanced(&mut self) {
        self.company.framed_at = None;
    }

    /// Notes that an object has another frame.
    fn reframed(&mut self, wire: &WireFrame, place: Pose) {
        if self.transport.may_lose_server() {
            self.journal.reframed(wire);
        }
        if let Some(member) = self.company.members.get_mut(&wire.object) {
            member.place = place;
        }
    }
}
