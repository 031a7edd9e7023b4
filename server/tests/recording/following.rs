//! A recording that is read while it is written.

use super::{Numbers, recorded, runtime_folder, scene_of};
use contactd::replay::Following;
use std::io::Write as _;

/// `CONTACTD_FOLLOWED` is how often a file grows; in the test command a few times.
fn rounds() -> u64 {
    std::env::var("CONTACTD_FOLLOWED").map_or(3, |n| n.parse().expect("a number of rounds"))
}

#[test]
fn a_file_that_grows_piece_by_piece_tells_each_step_once_as_the_whole_file_does() {
    let folder = runtime_folder();
    let (bytes, steps) = recorded(folder.path());
    // Each step by itself, by the way that knows nothing of following; steps that were refused are none.
    let whole = folder.path().join("whole.mcap");
    let expected: Vec<(u64, String)> = (1..=steps.len() as u64)
        .filter_map(|number| Some((number, scene_of(&whole, number).ok()?.text().expect("a text"))))
        .collect();
    assert!(expected.len() > 10, "{} steps were taken", expected.len());
    let mut waits = 0;
    for seed in 0..rounds() {
        let mut r = Numbers::new(seed);
        let path = folder.path().join(format!("growing-{seed}.mcap"));
        let mut file = std::fs::File::create(&path).expect("a file");
        let largest = [2_000, 9_000, 90_000][(seed % 3) as usize];
        let (mut at, mut told, mut fresh) = (0, Vec::new(), 0);
        let mut following: Option<Following> = None;
        while at < bytes.len() {
            let piece = (1 + r.below(largest) as usize).min(bytes.len() - at);
            file.write_all(&bytes[at..at + piece]).expect("room");
            at += piece;
            let Some(followed) = following.as_mut() else {
                // Until it says what it is there is nothing to follow.
                following = Following::growing(&path);
                continue;
            };
            while let Some(step) = followed.next_step().expect("no damage") {
                let (end, _) = steps[step.number as usize - 1];
                assert!(end <= at, "step {} is told before it is written", step.number);
                assert_eq!(step.is_fresh, !step.contents.is_empty(), "contents are told of a step that is fresh");
                fresh += usize::from(step.is_fresh);
                told.push((step.number, step.scene));
            }
            waits += 1;
            let (read, left) = followed.bytes();
            assert_eq!(read + left, at as u64);
        }
        let followed = following.as_mut().expect("it said what it is");
        assert!(followed.next_step().expect("no damage").is_none());
        assert_eq!(told.len(), expected.len(), "seed {seed}");
        assert!(told == expected && fresh > 0, "seed {seed}: {fresh} fresh");
    }
    assert!(waits > 250, "{waits}");
}
