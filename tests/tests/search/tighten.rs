//! Cells that are made smaller before they are bounded change no answer, and leave fewer cells.
//!
//! 60 random scenes here; for more
//! `CONTACTD_TIGHTEN=100000 cargo test -p contactd-tests --test search tighten:: -- --nocapture`.

use contactd::contact::{Status, Strategies};
use contactd_tests::engine::{SEARCH_ALONE, are_tied, ask_scene_with, differences};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes;
use contactd_tests::sweep::sized;
use rayon::prelude::*;

#[test]
fn smaller_cells_change_no_answer_and_are_fewer() {
    let count = sized("CONTACTD_TIGHTEN", 60_u64);
    let all: Vec<([u64; 2], bool, Option<String>)> = (0..count)
        .into_par_iter()
        .map(|i| {
            let mut r = Random::new(12_000_000 + i);
            let scene = match i % 4 {
                0 => scenes::peg(&mut r),
                1 => scenes::drilled(&mut r),
                2 => scenes::cavity(&mut r),
                _ => scenes::any(&mut r),
            };
            let without = Strategies { tighten: false, ..SEARCH_ALONE };
            let (tight, loose) = (ask_scene_with(&scene, SEARCH_ALONE), ask_scene_with(&scene, without));
            let size = scene.delta() / 1e-9;
            let differ = differences(&loose, &tight, size);
            let undecided = [&tight, &loose].map(|o| o.status() == Status::Undecided);
            let wrong = !(differ.is_empty() || undecided.contains(&true) || are_tied(&loose, &tight, size));
            let what = format!("scene {i} ({}): {differ:?}\nloose {loose:?}\ntight {tight:?}", scene.class);
            ([tight.counters.cells, loose.counters.cells], undecided[0] && !undecided[1], wrong.then_some(what))
        })
        .collect();
    let [tight, loose] = [0, 1].map(|k| all.iter().map(|a| a.0[k]).sum::<u64>());
    let lost = all.iter().filter(|a| a.1).count();
    let wrong: Vec<&String> = all.iter().filter_map(|a| a.2.as_ref()).collect();
    println!("{count} scenes: {tight} cells, {loose} without, {lost} undecided by it, {} differ", wrong.len());
    assert!(wrong.is_empty(), "{}", wrong.iter().take(3).map(|w| w.as_str()).collect::<Vec<_>>().join("\n"));
    assert!(2 * tight < loose && lost == 0, "{tight} cells, {loose} without; {lost} undecided");
}
