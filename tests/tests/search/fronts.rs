//! What is told in front of the search (whole primitives, bodies in holes) is what the search says by itself.
//!
//! 600 random scenes here; for more
//! `CONTACTD_FRONTS=100000 cargo test -p contactd-tests --test search fronts:: -- --nocapture`.
//! The two share the trees' values and Newton's equations, and nothing of how time before a contact is excluded.

use contactd::contact::Status;
use contactd_tests::engine::{SEARCH_ALONE, are_tied, ask, ask_scene_with, differences};
use contactd_tests::random_solids::Random;
use contactd_tests::scenes;
use contactd_tests::sweep::sized;
use rayon::prelude::*;

#[test]
fn what_is_told_in_front_of_the_search_is_what_the_search_says() {
    let count = sized("CONTACTD_FRONTS", 200_u64);
    let all: Vec<(bool, bool, Option<String>)> = (0..count)
        .into_par_iter()
        .map(|i| {
            let mut r = Random::new(9_000_000 + i);
            let scene = match i % 4 {
                0 => scenes::peg(&mut r),
                1 => scenes::drilled(&mut r),
                2 => scenes::cavity(&mut r),
                _ => scenes::any(&mut r),
            };
            let (fronted, alone) = (ask(&scene), ask_scene_with(&scene, SEARCH_ALONE));
            let size = scene.delta() / 1e-9;
            let differ = differences(&alone, &fronted, size);
            let undecided = [&fronted, &alone].iter().any(|o| o.status() == Status::Undecided);
            let wrong = !(differ.is_empty() || undecided || are_tied(&alone, &fronted, size));
            let in_front = fronted.counters.cells == 0 && fronted.counters.closed_forms > 0;
            let what = format!("scene {i} ({}): {differ:?}\nalone {alone:?}\nfronted {fronted:?}", scene.class);
            (in_front, undecided, wrong.then_some(what))
        })
        .collect();
    let in_front = all.iter().filter(|a| a.0).count();
    let undecided = all.iter().filter(|a| a.1).count();
    let wrong: Vec<&String> = all.iter().filter_map(|a| a.2.as_ref()).collect();
    println!("{count} scenes: {in_front} reported without a cell, {undecided} undecided, {} differ", wrong.len());
    assert!(wrong.is_empty(), "{}", wrong.iter().take(3).map(|w| w.as_str()).collect::<Vec<_>>().join("\n"));
    assert!(
        4 * in_front > count as usize && 200 * undecided <= count as usize,
        "{in_front} in front, {undecided} undecided"
    );
}
