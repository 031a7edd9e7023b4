//! The decoder of control messages: any bytes are a message that encodes to itself again, or `BadCommand`.

use super::Target;
use contactd_proto::control::{
    Answer, Command, Envelope, Facets, ModelFile, ObjectSpec, RecordingOrder, RecordingStatus, ServerStatus,
    SessionStatus, WireFrame, WireMass, WireRule, WireTrack, decode, encode,
};
use contactd_proto::query::{ObjectRay, PointOptions, Query, RayOptions};
use contactd_proto::{ErrorCode, MassOptions, MassProperties, Motion, MotionState, Pose, Rule};
use glam::DVec3;

pub(super) const TARGET: Target =
    Target { name: "control", run, seeds, words: &WORDS, longest: 600, thorough_every: u64::MAX };

const WORDS: [&str; 4] = ["\0\0\0\0\0\0\0\0", "\0\0\0\0\0\0", "\u{7f}", "name"];

fn seeds() -> Vec<Vec<u8>> {
    let rule = Rule { except: vec![["a".into(), "b".into()]], margin: 0.5, ..Rule::new(["x".into(), "y".into()]) };
    let motion_state = MotionState::resting(Pose::at(DVec3::new(1.0, -2.0, 0.25)));
    let object = ObjectSpec {
        id: 7,
        model: 1,
        name: "part".into(),
        group: "default".into(),
        is_static: false,
        rotates: true,
        max_speed: f64::INFINITY,
        place: Pose::IDENTITY.into(),
        pose: Pose::at(DVec3::X).into(),
    };
    let commands = [
        Command::Open { version: 1, process: (300, 70_000) },
        Command::Close,
        Command::LoadModel { model: 1, file: ModelFile::new("ball", "csg", *b"sphere(r = 1);"), facets: Facets::Exact },
        Command::AddObject(object),
        Command::RemoveObject(7),
        Command::SetRules(vec![WireRule::from(&rule)]),
        Command::SetResolution(Some(1e-9)),
        Command::Restore(vec![WireTrack::of(7, &motion_state), WireTrack::of(8, &motion_state)]),
        Command::MassProperties { model: 1, tolerance: 1e-6, boxes: 1_000_000 },
        Command::Status,
        Command::EndSession(3),
        Command::Record(RecordingOrder { path: "/a".into(), session: Some(3), process: (300, 70_000) }),
        Command::Recording { stop: true },
        Command::SaveStep("/a".into()),
        Command::Reframe(vec![WireFrame {
            object: 7,
            place: Pose::at(DVec3::Y).into(),
            pose: Pose::at(DVec3::X).into(),
        }]),
        Command::Carry { object: 7, carrier: 8, advance: 0.5 },
        Command::Ask(Query::Distance { a: 1, b: 2, tolerance: 1e-6 }),
        Command::Ask(Query::Points {
            points: vec![[1.0, 2.0, 3.0]],
            options: PointOptions::default(),
            objects: Some(vec![7]),
        }),
        Command::Ask(Query::Rays {
            rays: vec![ObjectRay { origin: [0.0; 3], direction: [0.0, 0.0, 1.0], length: 9.0 }],
            options: RayOptions::default(),
            objects: None,
        }),
    ];
    let envelope = |command| encode(&Envelope { epoch: 9, session: 3, command });
    let refused = Answer::Refused { code: 3, index: u32::MAX, detail: "why".into() };
    let loaded = Answer::Loaded { faces: vec![], warnings: vec!["snapped".into()] };
    let sessions = vec![SessionStatus { id: 3, process: 300, ..SessionStatus::default() }];
    let status = Answer::Status(ServerStatus { pid: 200, sessions, ..ServerStatus::default() });
    let recorded = Answer::Recorded(RecordingStatus { path: "/a".into(), steps: 3, ..RecordingStatus::default() });
    let mass = Answer::Mass(WireMass::from(&MassProperties::NOTHING));
    let answers = [Answer::Done, refused, loaded, mass, status, recorded];
    let answers = answers.iter().map(encode);
    commands.into_iter().map(envelope).chain(answers).map(|bytes| bytes.expect("a small message")).collect()
}

fn run(bytes: &[u8], _: bool) -> Result<String, String> {
    let answer = match decode::<Answer>(bytes) {
        Ok(answer) => {
            let again = encode(&answer).map_err(|e| format!("an answer that does not encode: {e}"))?;
            let back = decode::<Answer>(&again).map_err(|e| format!("an answer that does not come back: {e}"))?;
            if encode(&back) != Ok(again) {
                return Err(format!("another answer came back: {back:?}"));
            }
            std::mem::discriminant(&answer) == std::mem::discriminant(&Answer::Done)
        }
        Err(ErrorCode::BadCommand) => false,
        Err(other) => return Err(format!("answer refused as {other}")),
    };
    let envelope = match decode::<Envelope>(bytes) {
        Ok(envelope) => envelope,
        Err(ErrorCode::BadCommand) => return Ok(format!("refused {answer}")),
        Err(other) => return Err(format!("command refused as {other}")),
    };
    let again = encode(&envelope).map_err(|e| format!("a command that does not encode: {e}"))?;
    let back = decode::<Envelope>(&again).map_err(|e| format!("a command that does not come back: {e}"))?;
    if encode(&back) != Ok(again) {
        return Err(format!("another command came back: {back:?}"));
    }
    Ok(format!("{answer} {}", taken(envelope.command)?))
}

/// What the server makes of a command's numbers.
fn taken(command: Command) -> Result<String, String> {
    Ok(match command {
        Command::AddObject(o) => {
            let poses = [o.place, o.pose].map(|p| p.checked());
            for pose in poses.iter().flatten() {
                unit(pose)?;
            }
            format!("object {:?}", poses.map(|p| p.err()))
        }
        Command::SetRules(rules) => {
            let count = rules.len().min(3);
            let refused: Vec<_> = rules.into_iter().take(3).map(|r| r.checked().err()).collect();
            format!("{count} rules {refused:?}")
        }
        Command::Restore(motion_states) => {
            let checked: Vec<_> = motion_states.iter().take(3).map(WireTrack::checked).collect();
            for motion_state in checked.iter().flatten() {
                unit(&motion_state.end)?;
                let Motion { start, velocity, spin } = motion_state.motion;
                unit(&start)?;
                if !(velocity.is_finite() && spin.is_finite()) {
                    return Err(format!("a motion_state that is not finite: {motion_state:?}"));
                }
            }
            format!("restore {:?}", checked.iter().map(|t| t.as_ref().err()).collect::<Vec<_>>())
        }
        Command::Reframe(frames) => {
            let checked: Vec<_> = frames.iter().take(3).map(WireFrame::checked).collect();
            for (place, pose) in checked.iter().flatten() {
                unit(place).and(unit(pose))?;
            }
            format!("reframe {:?}", checked.iter().map(|f| f.as_ref().err()).collect::<Vec<_>>())
        }
        Command::Carry { advance, .. } => format!("carry {}", (0.0..=1.0).contains(&advance)),
        Command::Open { .. } => "open".into(),
        Command::Close => "close".into(),
        Command::Status => "status".into(),
        Command::EndSession(_) => "end".into(),
        Command::Record(_) => "record".into(),
        Command::Recording { .. } => "recording".into(),
        Command::SaveStep(_) => "save".into(),
        Command::Ask(query) => match query {
            Query::Distance { tolerance, .. } => format!("distance {:?}", tolerance >= 0.0),
            Query::Points { points, .. } => format!("points {}", points.len().min(2)),
            Query::Rays { rays, .. } => format!("rays {}", rays.len().min(2)),
        },
        Command::LoadModel { facets, .. } => format!("load {facets:?}"),
        Command::RemoveObject(_) => "remove".into(),
        Command::SetResolution(r) => format!("resolution {:?}", r.map(|r| r.is_finite())),
        Command::MassProperties { tolerance, boxes, .. } => {
            let checked = MassOptions { tolerance, boxes }.checked();
            if checked.as_ref().is_ok_and(|o| !(o.tolerance > 0.0 && o.tolerance < 1.0 && o.boxes > 0)) {
                return Err(format!("taken for options: {tolerance}, {boxes}"));
            }
            format!("mass {}", checked.is_ok())
        }
    })
}

fn unit(pose: &Pose) -> Result<(), String> {
    let fits = pose.position.is_finite() && (pose.rotation.length() - 1.0).abs() < 1e-12;
    if fits { Ok(()) } else { Err(format!("taken for a pose: {pose:?}")) }
}
