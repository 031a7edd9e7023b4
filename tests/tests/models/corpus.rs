//! Fuzzing on every test run: the corpus replayed with all checks, and a short seeded campaign for each target.

use contactd_tests::fuzz::{Campaign, TARGETS, Target, checked, corpus};

fn target(name: &str) -> &'static Target {
    TARGETS.iter().find(|t| t.name == name).expect("a target")
}

#[track_caller]
fn replay(name: &str, runs: u64) {
    let target = target(name);
    let inputs = corpus(target);
    assert!(inputs.len() >= 10, "{name}: {} inputs in the corpus", inputs.len());
    for input in &inputs {
        if let Err(what) = checked(target, input, true) {
            panic!("{name} {input:02x?}: {what}");
        }
    }
    let mut campaign = Campaign::new(target, &inputs, 20);
    for _ in 0..runs {
        campaign.step();
    }
    assert!(campaign.findings.is_empty(), "{name}: {:02x?}", campaign.findings);
    println!("{name}: {} inputs of the corpus, {} runs, {:?}", inputs.len(), campaign.runs, campaign.shares);
}

#[test]
fn any_text_is_a_model_or_one_sentence() {
    replay("csg", 300);
}

#[test]
fn any_bytes_are_a_message_or_refused() {
    replay("control", 20_000);
}

#[test]
fn any_content_of_a_kept_model_is_one_that_can_be_asked_or_refused() {
    replay("cache", 5000);
}

#[test]
fn any_batch_is_taken_whole_or_changes_nothing() {
    replay("steps", 2000);
}

#[test]
fn any_scene_has_an_answer_in_order_that_the_reference_does_not_refute() {
    replay("scenes", 75);
}

#[test]
fn any_file_of_a_mesh_is_a_solid_or_one_sentence() {
    replay("meshes", 3000);
}

#[test]
fn any_drawing_or_surface_is_a_shape_or_one_sentence() {
    replay("drawings", 2000);
}
