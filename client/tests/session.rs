//! What a session keeps, and what it tells the other side, when calls fail: on a transport that fails as it is told.

use contactd_client::proto::control::{Answer, Command, WireFrame, WireTrack};
use contactd_client::proto::{ContactRecord, ErrorCode, Pose, PoseRecord, StepReply, StepRequest};
use contactd_client::transport::{Opened, Transport};
use contactd_client::{Error, MassOptions, Object, Session};
use glam::DVec3;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

const LONG: Duration = Duration::from_secs(60);

/// What the next calls meet, each list in its order; an empty list: they go well.
#[derive(Default)]
struct Script {
    opens: VecDeque<Error>,
    commands: VecDeque<Error>,
    /// Commands that go well before these.
    well: usize,
    answers: VecDeque<Result<(), Error>>,
    /// What the other side was told and asked.
    log: Vec<Said>,
}

#[derive(Clone, Debug, PartialEq)]
enum Said {
    Opened,
    Command(Command),
    Step(Vec<PoseRecord>),
    Waited(Duration),
    Left,
}

#[derive(Clone, Default)]
struct Scripted {
    script: Rc<RefCell<Script>>,
    records: Vec<PoseRecord>,
    reply: Option<StepReply>,
}

impl Scripted {
    fn say(&self, said: Said) {
        self.script.borrow_mut().log.push(said);
    }
}

impl Transport for Scripted {
    fn may_lose_server(&self) -> bool {
        true
    }

    fn open(&mut self) -> Result<Opened, Error> {
        self.say(Said::Opened);
        let failure = self.script.borrow_mut().opens.pop_front();
        failure.map_or(Ok(Opened { session: 9, epoch: 7, max_batch: 4 }), Err)
    }

    fn command(&mut self, command: Command, _: Duration) -> Result<Answer, Error> {
        // Whoever takes another frame rests where it was, and lies in that frame in some way.
        let done = match &command {
            Command::Carry { object, .. } => Answer::Reframed(WireFrame {
                object: *object,
                place: Pose::at(DVec3::Y).into(),
                pose: Pose::at(DVec3::Z).into(),
            }),
            _ => Answer::Done,
        };
        self.say(Said::Command(command));
        let mut script = self.script.borrow_mut();
        if script.well > 0 {
            script.well -= 1;
            return Ok(done);
        }
        match script.commands.pop_front() {
            Some(Error::Refused { code, .. }) => {
                Ok(Answer::Refused { code: code.number(), index: u32::MAX, detail: String::new() })
            }
            failure => failure.map_or(Ok(done), Err),
        }
    }

    fn loan(&mut self, records: usize) -> Result<&mut [PoseRecord], Error> {
        self.records = vec![PoseRecord::default(); records];
        Ok(&mut self.records)
    }

    fn loaned(&self) -> &[PoseRecord] {
        &self.records
    }

    fn loaned_mut(&mut self) -> &mut [PoseRecord] {
        &mut self.records
    }

    fn send(&mut self, request: StepRequest) -> Result<(), Error> {
        self.say(Said::Step(self.records.clone()));
        self.reply = Some(StepReply { step: request.step, index: u32::MAX, ..StepReply::default() });
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<(), Error> {
        self.say(Said::Waited(timeout));
        match (self.script.borrow_mut().answers.pop_front(), &mut self.reply) {
            (Some(Err(Error::Refused { code, .. })), Some(reply)) => {
                reply.error = code.number();
                Ok(())
            }
            (answer, _) => answer.unwrap_or(Ok(())),
        }
    }

    fn reply(&self) -> Option<(&StepReply, &[ContactRecord])> {
        self.reply.as_ref().map(|reply| (reply, [].as_slice()))
    }

    fn leave(&mut self) {
        self.say(Said::Left);
    }
}

/// A session with an object, and its script; the log begins after that.
fn scripted() -> (Session<Scripted>, Rc<RefCell<Script>>) {
    let transport = Scripted::default();
    let script = transport.script.clone();
    let mut session = Session::new(transport).unwrap();
    assert_eq!(session.add_object(Object::new("ball", 1)), Ok(1));
    script.borrow_mut().log.clear();
    (session, script)
}

/// Moves the ball by `n` along x.
fn pose(n: u32) -> PoseRecord {
    PoseRecord::end(1, &Pose::at(DVec3::X * f64::from(n)))
}

/// Steps to `pose(n)`, and meets `answer`.
fn step(session: &mut Session<Scripted>, script: &RefCell<Script>, n: u32, answer: Result<(), Error>) -> Option<Error> {
    session.begin_step(1).unwrap()[0] = pose(n);
    script.borrow_mut().answers.push_back(answer);
    session.finish(LONG).map(|_| ()).err()
}

/// Where the last replay put the ball at the end of its motion.
fn replayed(script: &RefCell<Script>) -> [f64; 3] {
    let restored = |said: &Said| match said {
        Said::Command(Command::Restore(motion_states)) => motion_states.first().map(WireTrack::checked),
        _ => None,
    };
    let motion_state = script.borrow().log.iter().rev().find_map(restored).expect("a replay").expect("a motion_state");
    motion_state.at(1.0).position.to_array()
}

/// Every way in which a step stays without an answer: the replay stands before it, and it can be sent again.
#[test]
fn a_step_without_an_answer_is_sent_again_after_the_replay() {
    for loss in [Error::ServerLost, Error::ReplyLost, Error::refused(ErrorCode::SessionGone)] {
        let (mut session, script) = scripted();
        assert_eq!(step(&mut session, &script, 1, Ok(())), None);
        assert_eq!(step(&mut session, &script, 2, Err(loss.clone())), Some(loss.clone()));
        // Too early: it is still there afterwards, however often, and whatever the first attempt to reconnect met.
        assert_eq!(session.resend().map(|_| ()), Err(Error::ServerLost), "{loss}");
        assert_eq!(session.begin_step(1).map(|_| ()), Err(Error::ServerLost), "{loss}");
        assert_eq!(session.remove_object(1), Err(Error::ServerLost), "{loss}");
        script.borrow_mut().opens.push_back(Error::refused(ErrorCode::LimitSessions));
        assert_eq!(session.reconnect(LONG), Err(Error::refused(ErrorCode::LimitSessions)));
        assert_eq!(session.resend().map(|_| ()), Err(Error::ServerLost), "{loss}");
        session.reconnect(LONG).unwrap();
        assert_eq!(replayed(&script), [1.0, 0.0, 0.0], "{loss}");
        for _ in 0..2 {
            assert_eq!(session.resend().map(|slots| slots.to_vec()), Ok(vec![pose(2)]), "{loss}");
        }
        session.finish(LONG).unwrap();
        assert_eq!(session.resend().map(|_| ()), Err(Error::Misuse("no step was in flight when the server was lost")));
        session.reconnect(LONG).unwrap();
        assert_eq!(replayed(&script), [2.0, 0.0, 0.0], "{loss}");
    }
}

#[test]
fn a_batch_that_was_kept_is_forgotten_with_the_next_that_is_accepted() {
    let (mut session, script) = scripted();
    assert_eq!(step(&mut session, &script, 1, Err(Error::ServerLost)), Some(Error::ServerLost));
    session.reconnect(LONG).unwrap();
    // Refused: it is still the one without an answer. So it is after a loss between two steps.
    let refusal = Error::refused(ErrorCode::Busy);
    let refusal = step(&mut session, &script, 2, Err(refusal.clone())).filter(|e| e.code() == refusal.code());
    assert!(refusal.is_some());
    assert_eq!(session.resend().map(|slots| slots.to_vec()), Ok(vec![pose(1)]));
    assert_eq!(step(&mut session, &script, 3, Ok(())), None);
    for loss in [Error::ServerLost, Error::ReplyLost, Error::refused(ErrorCode::SessionGone)] {
        script.borrow_mut().commands.push_back(loss.clone());
        assert_eq!(session.set_resolution(None), Err(loss));
        assert_eq!(session.set_resolution(None), Err(Error::ServerLost));
        session.reconnect(LONG).unwrap();
        assert_eq!(session.resend().map(|_| ()), Err(Error::Misuse("no step was in flight when the server was lost")));
        assert_eq!(replayed(&script), [3.0, 0.0, 0.0]);
    }
}

#[test]
fn a_loss_between_two_steps_keeps_what_has_no_answer_and_a_later_one_takes_its_place() {
    let (mut session, script) = scripted();
    assert_eq!(step(&mut session, &script, 1, Err(Error::ReplyLost)), Some(Error::ReplyLost));
    session.reconnect(LONG).unwrap();
    script.borrow_mut().commands.push_back(Error::ServerLost);
    assert_eq!(session.set_resolution(None), Err(Error::ServerLost));
    session.reconnect(LONG).unwrap();
    assert_eq!(session.resend().map(|slots| slots.to_vec()), Ok(vec![pose(1)]));
    // A step that is given up while it is in flight has no answer either.
    assert_eq!(step(&mut session, &script, 2, Err(Error::Timeout)), Some(Error::Timeout));
    assert_eq!(session.resend().map(|_| ()), Err(Error::Misuse("a step is in flight: finish it first")));
    session.reconnect(LONG).unwrap();
    assert_eq!(replayed(&script), [0.0; 3]);
    assert_eq!(session.resend().map(|slots| slots.to_vec()), Ok(vec![pose(2)]));
}

#[test]
fn the_sentences_of_a_loss_say_what_to_do() {
    let said = Error::ReplyLost.to_string();
    assert!(said.ends_with("; reconnect, and send the step or command again"), "{said}");
    let said = Error::ServerLost.to_string();
    assert!(said.contains("or the session on it") && said.contains("reconnect"), "{said}");
}

/// The server may carry it out later, with an id that this client would give again.
#[test]
fn a_command_that_was_not_answered_in_time_is_settled_by_a_replay() {
    let (mut session, script) = scripted();
    assert_eq!(step(&mut session, &script, 1, Ok(())), None);
    script.borrow_mut().commands.push_back(Error::Timeout);
    assert_eq!(session.remove_object(1), Err(Error::Timeout));
    assert_eq!(session.begin_step(1).map(|_| ()), Err(Error::ServerLost));
    assert_eq!(session.remove_object(1), Err(Error::ServerLost));
    session.reconnect(LONG).unwrap();
    assert_eq!(replayed(&script), [1.0, 0.0, 0.0]);
    assert_eq!(step(&mut session, &script, 2, Ok(())), None);
    // What only asks leaves nothing behind.
    script.borrow_mut().commands.push_back(Error::Timeout);
    assert_eq!(session.mass_properties(1, &MassOptions::default()).err(), Some(Error::Timeout));
    assert_eq!(step(&mut session, &script, 3, Ok(())), None);
    // And the server hears of the end of a session that is lost to its client.
    script.borrow_mut().commands.push_back(Error::Timeout);
    assert_eq!(session.set_resolution(None), Err(Error::Timeout));
    assert_eq!(session.close(), Ok(()));
    assert_eq!(script.borrow().log.last(), Some(&Said::Command(Command::Close)));
}

#[test]
fn a_wait_without_an_end_is_no_overflow() {
    let (mut session, script) = scripted();
    script.borrow_mut().opens.extend([Error::NoServer("x".into()), Error::ServerLost, Error::Timeout]);
    assert_eq!(session.reconnect(Duration::MAX), Ok(()));
    assert_eq!(script.borrow().log.iter().filter(|said| **said == Said::Opened).count(), 4);
    // And one of no length is one attempt.
    script.borrow_mut().opens.push_back(Error::NoServer("x".into()));
    assert_eq!(session.reconnect(Duration::ZERO), Err(Error::NoServer("x".into())));
}

/// A step in flight is waited for before the server is told; where it does not come the session is only left.
#[test]
fn closing_waits_for_the_step_in_flight() {
    let waited = Said::Waited(Duration::from_secs(1));
    let close = Said::Command(Command::Close);
    let refusal = Error::refused(ErrorCode::Busy);
    for (answer, reported) in [
        (Ok(()), vec![waited.clone(), close.clone()]),
        (Err(refusal), vec![waited.clone(), close.clone()]),
        (Err(Error::System("no room".into())), vec![waited.clone(), close.clone()]),
        (Err(Error::Timeout), vec![waited.clone(), Said::Left]),
        (Err(Error::ReplyLost), vec![waited.clone(), Said::Left]),
        (Err(Error::ServerLost), vec![waited, Said::Left]),
    ] {
        let (mut session, script) = scripted();
        session.begin_step(1).unwrap()[0] = pose(1);
        session.send().unwrap();
        script.borrow_mut().answers.push_back(answer);
        assert_eq!(session.close(), Ok(()));
        assert_eq!(script.borrow().log[1..], reported);
    }
    // Without one the server is told at once.
    let (mut session, script) = scripted();
    session.begin_step(1).unwrap();
    assert_eq!(session.close(), Ok(()));
    assert_eq!(script.borrow().log, [close]);
}

/// A server that is lost in the middle of an act of several commands: its successor is told what was before the act, to the bit, and
/// nothing of the act is owed.
#[test]
fn an_act_that_was_cut_short_is_not_in_the_replay() {
    type Act = fn(&mut Session<Scripted>) -> Result<(), Error>;
    let attach: Act = |session| session.attach(2, 1, &[]);
    let detach: Act = |session| session.detach(2);
    let remove: Act = |session| session.remove_object(1);
    for loss in [Error::ServerLost, Error::ReplyLost, Error::refused(ErrorCode::SessionGone)] {
        for (is_attached, act, commands) in [(false, attach, 2), (true, detach, 3), (true, remove, 3)] {
            // The replay of a session that was lost in the act's k-th command; of one that was lost before it.
            let replay_of = |k: Option<usize>| {
                let (mut session, script) = scripted();
                assert_eq!(session.add_object(Object::new("part", 1)), Ok(2));
                if is_attached {
                    assert_eq!(attach(&mut session), Ok(()));
                }
                assert_eq!(step(&mut session, &script, 1, Ok(())), None);
                assert_eq!(step(&mut session, &script, 2, Ok(())), None);
                script.borrow_mut().commands.push_back(loss.clone());
                script.borrow_mut().well = k.unwrap_or(0);
                match k {
                    Some(_) => assert_eq!(act(&mut session), Err(loss.clone()), "{k:?}"),
                    None => assert_eq!(session.set_resolution(Some(1e-6)), Err(loss.clone())),
                }
                assert_eq!(
                    script.borrow().commands.len() + script.borrow().well,
                    0,
                    "{k:?}: the act has fewer commands"
                );
                script.borrow_mut().log.clear();
                assert_eq!(session.reconnect(LONG), Ok(()));
                let log = script.borrow().log.clone();
                let is_frame = |said: &Said| matches!(said, Said::Command(Command::Carry { .. } | Command::Reframe(_)));
                assert!(!log.iter().any(is_frame), "{k:?}: {log:?}");
                assert_eq!((session.carrier(2), act(&mut session)), (is_attached.then_some(1), Ok(())));
                // What is owed of rules comes behind it, and is theirs to the word.
                let end = log.iter().position(|said| matches!(said, Said::Command(Command::Restore(_))));
                log[..=end.expect("a replay")].to_vec()
            };
            let before = replay_of(None);
            for k in 0..commands {
                assert_eq!(replay_of(Some(k)), before, "{k}");
            }
        }
    }
}

/// An object is gone once the server has said so, though the session is lost before the rules are told.
#[test]
fn a_carrier_that_is_gone_is_not_asked_for_again() {
    let (mut session, script) = scripted();
    assert_eq!(session.add_object(Object::new("part", 1)), Ok(2));
    assert_eq!(session.attach(2, 1, &[]), Ok(()));
    script.borrow_mut().commands.push_back(Error::ServerLost);
    script.borrow_mut().well = 3;
    assert_eq!(session.remove_object(1), Ok(()));
    assert_eq!((script.borrow().commands.len(), session.carrier(2)), (0, None));
    script.borrow_mut().log.clear();
    assert_eq!(session.reconnect(LONG), Ok(()));
    let adds = |said: &&Said| matches!(said, Said::Command(Command::AddObject(_)));
    assert_eq!(script.borrow().log.iter().filter(adds).count(), 1);
    assert!(matches!(script.borrow().log.last(), Some(Said::Command(Command::SetRules(_)))));
}
