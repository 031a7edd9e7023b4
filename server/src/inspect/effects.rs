//! What a scene computes for which pairs, and what not: its rules as the world compiles them, pair by pair of groups.

use crate::import::{Scene, SceneObject};
use crate::terminal::sentence;
use crate::world::{PairPlan, Plans};
use contactd_proto::effects::{self, Effect};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// Pairs of two groups that are treated alike.
type Line = ([String; 2], Fate);

/// What becomes of a pair.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fate {
    /// What is computed, in words.
    Searched(String),
    Off(&'static str),
}

/// A scene's plans as text: what is computed for which pairs, what for none, and what the motion itself rules out.
pub fn effects(scene: &Scene) -> String {
    let mut plans = Plans::default();
    let groups: Vec<u32> = scene.objects.iter().map(|o| plans.group(&o.group)).collect();
    plans.set(scene.rules.clone());
    let mut lines: BTreeMap<Line, u64> = BTreeMap::new();
    let mut used: Vec<PairPlan> = Vec::new();
    let mut note = |a: &SceneObject, b: &SceneObject, names: [&str; 2], count: u64| {
        if count == 0 {
            return;
        }
        let mut between = [a.group.clone(), b.group.clone()];
        between.sort();
        let of = |o: &SceneObject| groups[scene.objects.iter().position(|p| p.group == o.group).unwrap_or(0)];
        let fate = if a.is_static && b.is_static {
            Fate::Off("never searched: both are static")
        } else if let Some(plan) = plans.of([of(a), of(b)], names) {
            let plan = plans.plan(plan);
            if !used.contains(plan) {
                used.push(*plan);
            }
            Fate::Searched(plan.phrases().join("; "))
        } else if scene.rules.iter().any(|r| r.names([&a.group, &b.group], names)) {
            Fate::Off("off: by its rule")
        } else {
            Fate::Off("off: no rule names it")
        };
        *lines.entry((between, fate)).or_default() += count;
    };
    // Named exceptions one by one, all other pairs of two groups together.
    let named: BTreeSet<[usize; 2]> = exceptions(scene);
    for [i, j] in &named {
        let (a, b) = (&scene.objects[*i], &scene.objects[*j]);
        note(a, b, [&a.name, &b.name], 1);
    }
    let kinds = kinds(scene);
    for (k, (a, of_a)) in kinds.iter().enumerate() {
        for (b, of_b) in &kinds[k..] {
            let all = if std::ptr::eq(*a, *b) { of_a * (of_a - 1) / 2 } else { of_a * of_b };
            let is = |o: &SceneObject, kind: &SceneObject| o.group == kind.group && o.is_static == kind.is_static;
            let apart = named
                .iter()
                .map(|p| p.map(|i| &scene.objects[i]))
                .filter(|[p, q]| (is(p, a) && is(q, b)) || (is(p, b) && is(q, a)));
            note(a, b, ["", ""], all - apart.count() as u64);
        }
    }
    let mut out = String::new();
    let off = |fate: &Fate| matches!(fate, Fate::Off(_));
    let sum = |wanted: bool| -> u64 { lines.iter().filter(|((_, f), _)| off(f) == wanted).map(|(_, n)| n).sum() };
    let _ = writeln!(out, "  {} pairs are searched when they are near, {} never", sum(false), sum(true));
    for (([g, h], fate), count) in &lines {
        let words = match fate {
            Fate::Searched(words) => words,
            Fate::Off(why) => *why,
        };
        let pairs = if *count == 1 { "pair" } else { "pairs" };
        out += &sentence("    ", &format!("{g} - {h}: {count} {pairs}: {words}"));
    }
    let asked = |effect: &Effect| effect.asked.is_none_or(|asked| used.iter().any(|plan| asked(plan)));
    let not: Vec<&str> = effects::ALL.iter().filter(|effect| !asked(effect)).map(|effect| effect.word).collect();
    if !(used.is_empty() || not.is_empty()) {
        out += &sentence("    ", &format!("for no pair: {}", not.join(", ")));
    }
    let (mut rest, mut slide, mut turn) = (0, 0, 0);
    for o in &scene.objects {
        match (o.motion.is_rest(), o.motion.spin == DVec3::ZERO) {
            (true, _) => rest += 1,
            (false, true) => slide += 1,
            (false, false) => turn += 1,
        }
    }
    let told = format!(
        "of the objects, in this step: at rest {rest} (two of them: asked about the start alone), translating {slide} (no \
         bounds of rotation), turning {turn}"
    );
    out += &sentence("  ", &told);
    out
}

/// The pairs of objects that rules name as exceptions, by index, the smaller one first.
fn exceptions(scene: &Scene) -> BTreeSet<[usize; 2]> {
    let index = |name: &str| scene.objects.iter().position(|o| o.name == name);
    let pairs = scene.rules.iter().flat_map(|r| &r.except);
    pairs
        .filter_map(|[p, q]| Some([index(p)?, index(q)?]))
        .filter(|[i, j]| i != j)
        .map(|[i, j]| [i.min(j), i.max(j)])
        .collect()
}

/// An object of each kind, static or not in each group, and how many there are.
fn kinds(scene: &Scene) -> Vec<(&SceneObject, u64)> {
    let mut kinds: Vec<(&SceneObject, u64)> = Vec::new();
    for o in &scene.objects {
        match kinds.iter_mut().find(|(k, _)| k.group == o.group && k.is_static == o.is_static) {
            Some((_, count)) => *count += 1,
            None => kinds.push((o, 1)),
        }
    }
    kinds
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn reported(rules: &str) -> String {
        let mut text = String::from("[[model]]\nname = \"m\"\nfile = \"m.csg\"\n");
        for (name, group, motion) in [
            ("plate", "cell", "motion = \"static\""),
            ("table", "cell", "motion = \"static\""),
            ("arm", "robot", "end = { position = [1, 0, 0] }"),
            ("gripper", "robot", "rotation_vector = [0, 0, 1]"),
            ("part", "part", ""),
        ] {
            text += &format!("[[object]]\nname = \"{name}\"\nmodel = \"m\"\ngroup = \"{group}\"\n{motion}\n");
        }
        let scene = Scene::parse("s.toml", &(text + rules), Path::new("")).expect("a scene");
        let text = effects(&scene);
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        // As if no line were broken.
        text.replace("\n      ", " ")
    }

    #[test]
    fn without_rules_every_pair_is_told_in_full() {
        let text = reported("");
        assert!(text.contains("9 pairs are searched when they are near, 1 never"), "{text}");
        assert!(text.contains("cell - robot: 4 pairs: the whole motion; time, point, normal, kind\n"), "{text}");
        assert!(text.contains("cell - cell: 1 pair: never searched: both are static"), "{text}");
        assert!(text.contains("for no pair: discrete, patch, penetration, margin"), "{text}");
        assert!(text.contains("at rest 3 (two of them"), "{text}");
        assert!(text.contains("translating 1 (no bounds of rotation), turning 1"), "{text}");
    }

    #[test]
    fn each_pair_has_the_plan_that_the_world_gives_it() {
        let text = reported(
            "[[rule]]\nbetween = [\"robot\", \"cell\"]\nexcept = [[\"gripper\", \"plate\"]]\nreport = \"hit\"\nmargin = 2.5\n\
             [[rule]]\nbetween = [\"robot\", \"part\"]\ndetect = \"off\"\n",
        );
        assert!(text.contains("3 pairs are searched when they are near, 7 never"), "{text}");
        assert!(text.contains("cell - robot: 3 pairs: the whole motion; yes or no; margin 2.5"), "{text}");
        assert!(text.contains("cell - robot: 1 pair: off: no rule names it"), "{text}");
        assert!(text.contains("part - robot: 2 pairs: off: by its rule"), "{text}");
        assert!(text.contains("robot - robot: 1 pair: off: no rule names it"), "{text}");
        assert!(text.contains("for no pair: discrete, time, contact, patch"), "{text}");
    }
}
