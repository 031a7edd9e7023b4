//! What stages 1 and 2 save stage 3, on the 94 cases with a known answer.
//! `cargo test -p contactd-tests --test search stages:: -- --nocapture` prints the table.

use contactd::contact::{Counters, Status, Strategies};
use contactd::octree::Model;
use contactd_tests::engine::ask_with;
use contactd_tests::judge::{Case, cases};

fn work(case: &Case, strategies: Strategies) -> Counters {
    let (a, b) = (Model::new(case.a.0.clone()), Model::new(case.b.0.clone()));
    let o = ask_with((&a, case.a.1), (&b, case.b.1), case.resolution, strategies);
    assert_ne!(o.status(), Status::Undecided, "{}", case.name);
    assert!(case.known.judge(&o, 1e-8).is_ok(), "{}: {o:?}", case.name);
    o.counters
}

fn median(mut v: Vec<f64>) -> f64 {
    v.sort_by(f64::total_cmp);
    0.5 * (v[(v.len() - 1) / 2] + v[v.len() / 2])
}

#[test]
fn every_case_by_stage() {
    println!("case                          tree  stage 1  pairs  cells");
    for case in cases() {
        let c = work(&case, Strategies::default());
        println!("{:28} {:5} {:8} {:6} {:6}", case.name, c.primitives, c.after_stage1, c.candidates, c.cells);
        assert!(c.after_stage1 <= c.primitives);
        // Stage 3 works on what stage 2 handed over: cells without a candidate pair would have another source.
        assert!(c.candidates > 0 || c.cells == 0, "{}: {c:?}", case.name);
    }
}

#[test]
fn without_stage_1_or_stage_2_the_work_on_a_part_of_forty_and_forty_doubles() {
    // The work at the resolution asked for, however much.
    let all = Strategies { coarser: false, ..Strategies::default() };
    let (mut without_1, mut without_2) = (vec![], vec![]);
    println!("case      cells, evaluations: all  no stage 1  no stage 2");
    for case in cases().iter().filter(|c| c.name.starts_with("part_")) {
        let all_of = work(case, all);
        let no_1 = work(case, Strategies { region: false, ..all });
        let no_2 = work(case, Strategies { walk: false, ..all });
        let columns = [&all_of, &no_1, &no_2].map(|c| format!("{:6} {:8}", c.cells, c.evaluations));
        println!("{:8} {}", case.name, columns.join("  "));
        without_1.push(no_1.evaluations as f64 / all_of.evaluations as f64);
        without_2.push(no_2.evaluations as f64 / all_of.evaluations as f64);
    }
    let (one, two) = (median(without_1), median(without_2));
    println!("median ratio of evaluations: without stage 1 {one:.1}, without stage 2 {two:.1}");
    assert!(one >= 2.0 && two >= 2.0, "{one} {two}");
}
