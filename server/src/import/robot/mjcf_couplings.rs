//! What a model in MJCF says of its bodies and joints as a whole: which pairs are not tested, what follows what, keyframes.
//!
//! Source: mujoco.readthedocs.io/en/stable/XMLreference.html, and the Computation chapter's section on collision detection.

use super::super::problem::Problem;
use super::super::xml;
use super::kinematics::Robot;
use super::mjcf_files::{Files, flag};
use super::urdf::{Result, needed, numbers_of};
use contactd_proto::Pose;
use glam::{DQuat, DVec3};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};

/// A joint's place among the numbers of a keyframe.
pub(super) enum Slot {
    /// A hinge or a slide: which degree of freedom of its body.
    Dof(usize),
    /// Three numbers of a position and four of a turn.
    Free,
    /// Four numbers.
    Ball,
}

/// Which pairs are not tested: parent and child unless the parent is the world, pairs of which neither has a degree of freedom (welded to
/// the world, or moved by hand: `mocap`), and those that the file excludes.
/// Pairs of geoms that the file names are tested whatever else is said of them, those of one body and of welded ones, too.
pub(super) fn filters(
    robot: &mut Robot,
    files: &Files<'_, '_>,
    mocap: &HashSet<usize>,
    places: &HashMap<String, Option<(usize, usize)>>,
) -> Result<()> {
    for i in 0..robot.links.len() {
        robot.links[i].is_static = robot.welded_to(i).is_none();
    }
    let welded: Vec<Option<usize>> = (0..robot.links.len()).map(|i| robot.welded_to(i)).collect();
    let above = |i: usize| welded[i].and_then(|w| robot.links[w].parent).and_then(|p| welded[p]);
    let stands = |i: usize| welded[i].is_none_or(|w| mocap.contains(&w));
    let mut filters_parents = true;
    for node in files.within("option").into_iter().filter(|n| n.tag_name().name() == "flag") {
        let Some(word) = node.attribute("filterparent") else { continue };
        let is_on = xml::either(node, word, "filterparent", ["enable", "disable"]);
        filters_parents &= is_on.map_err(|e| files.told(node, e))?;
    }
    let mut excepted = Vec::new();
    for i in 0..welded.len() {
        for j in i + 1..welded.len() {
            let of = |i: usize, j: usize| above(i).is_some() && above(i) == welded[j];
            if (filters_parents && (of(i, j) || of(j, i))) || (stands(i) && stands(j)) {
                excepted.push([i, j]);
            }
        }
    }
    robot.excepted.extend(excepted);
    for node in files.within("contact") {
        match node.tag_name().name() {
            "exclude" => {
                let pair = excluded(robot, node).map_err(|e| files.told(node, e))?;
                robot.excepted.insert(pair);
            }
            "pair" => {
                let geom = |key| {
                    let name = needed(node, key)?;
                    places.get(name).ok_or_else(|| xml::wrong(node, "the name of a geom", Some(name)))
                };
                let [a, b] = [geom("geom1"), geom("geom2")].map(|g| g.map_err(|e| files.told(node, e)));
                if let (Some(a), Some(b)) = (a?, b?) {
                    robot.pairs.insert([*a.min(b), *a.max(b)]);
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// The names of the geoms that pairs of them name.
pub(super) fn paired(files: &Files<'_, '_>) -> HashSet<String> {
    let pairs = files.within("contact").into_iter().filter(|n| n.tag_name().name() == "pair");
    let names = pairs.flat_map(|n| [n.attribute("geom1"), n.attribute("geom2")]);
    names.flatten().map(str::to_owned).collect()
}

fn excluded(robot: &Robot, node: Node<'_, '_>) -> Result<[usize; 2]> {
    let mut pair = [0; 2];
    for (k, key) in ["body1", "body2"].into_iter().enumerate() {
        let name = needed(node, key)?;
        let found = robot.links.iter().position(|l| l.name == name);
        pair[k] = found.ok_or_else(|| xml::wrong(node, "the name of a body", Some(name)))?;
    }
    pair.sort_unstable();
    Ok(pair)
}

/// Joints that follow others on a line, or that are held: joint1 − ref1 = a + b (joint2 − ref2). All other constraints are told.
pub(super) fn equalities(robot: &mut Robot, files: &Files<'_, '_>, is_active: bool) -> Result<()> {
    for node in files.within("equality") {
        let active = flag(node, "active").map_err(|e| files.told(node, e))?;
        if !active.unwrap_or(is_active) {
            continue;
        }
        let left = match node.tag_name().name() {
            "joint" => coupling(robot, node).map_err(|e| files.told(node, e))?,
            kind => Some(format!("the constraint {kind} is not kept: what it couples moves freely")),
        };
        if let Some(text) = left {
            files.note(robot, node, &text);
        }
    }
    robot.follow()
}

/// Lets a joint follow another one; else why it cannot.
fn coupling(robot: &mut Robot, node: Node<'_, '_>) -> Result<Option<String>> {
    let name = needed(node, "joint1")?;
    let place = |name: &str| {
        let of_link =
            |(i, l): (usize, &super::kinematics::Link)| Some((i, l.dofs.iter().position(|d| d.name == name)?));
        let found = robot.links.iter().enumerate().find_map(of_link);
        found.ok_or_else(|| xml::wrong(node, "the name of a hinge or a slide", Some(name)))
    };
    let (link, dof) = place(name)?;
    let mut factors = [0.0, 1.0, 0.0, 0.0, 0.0];
    if let Some(text) = node.attribute("polycoef") {
        let numbers = numbers_of(node, text, "polycoef")?;
        if numbers.len() > factors.len() {
            return Err(xml::wrong(node, "five numbers at most as polycoef", Some(text)));
        }
        factors[..numbers.len()].copy_from_slice(&numbers);
    }
    let zero = robot.links[link].dofs[dof].zero;
    let follower = &robot.links[link].dofs[dof];
    if follower.mimic.is_some() || follower.range[0] == follower.range[1] && follower.start == follower.range[0] {
        return Ok(Some(format!("a second constraint of the joint {name} is not kept")));
    }
    let Some(leader) = node.attribute("joint2") else {
        let held = zero + factors[0];
        let dof = &mut robot.links[link].dofs[dof];
        (dof.range, dof.start) = ([held; 2], held);
        return Ok(None);
    };
    let (i, k) = place(leader)?;
    if factors[2..].iter().any(|f| *f != 0.0) {
        return Ok(Some(format!("{name} does not follow {leader} on a line: both move freely")));
    }
    // What follows already what follows this one would be a circle.
    let mut at = Some(leader.to_owned());
    while let Some(of) = at {
        if of == name {
            return Ok(Some(format!("{name} and {leader} follow each other: this constraint is not kept")));
        }
        let dofs = robot.links.iter().flat_map(|l| &l.dofs);
        at = dofs.into_iter().find(|d| d.name == of).and_then(|d| d.mimic.as_ref()).map(|m| m.0.clone());
    }
    let offset = zero + factors[0] - factors[1] * robot.links[i].dofs[k].zero;
    robot.links[link].dofs[dof].mimic = Some((leader.to_owned(), factors[1], offset));
    Ok(None)
}

/// Lets the joints begin where a keyframe has them; `slots` are those of each body.
pub(super) fn begin_at(robot: &mut Robot, files: &Files<'_, '_>, slots: &[Vec<Slot>], key: &str) -> Result<()> {
    let keys: Vec<Node<'_, '_>> =
        files.within("keyframe").into_iter().filter(|k| k.tag_name().name() == "key").collect();
    let found = keys.iter().find(|k| k.attribute("name") == Some(key));
    let Some(node) = found.copied() else {
        let names: Vec<&str> = keys.iter().filter_map(|k| k.attribute("name")).collect();
        let expected = format!("one of the keyframes {}", names.join(", "));
        let expected = if names.is_empty() { "a model that has keyframes".to_owned() } else { expected };
        return Err((super::super::Place::START, Problem::syntax(expected, format!("key:{key}"))));
    };
    let Some(text) = node.attribute("qpos") else { return Ok(()) };
    let numbers = numbers_of(node, text, "qpos").map_err(|e| files.told(node, e))?;
    let width = |slot: &Slot| match slot {
        Slot::Dof(_) => 1,
        Slot::Free => 7,
        Slot::Ball => 4,
    };
    let count: usize = slots.iter().flatten().map(width).sum();
    if numbers.len() != count {
        let found = numbers.len().to_string();
        return Err(files.told(node, xml::wrong(node, format!("{count} numbers as qpos"), Some(&found))));
    }
    let mut rest = numbers.as_slice();
    for (link, slot) in slots.iter().enumerate().flat_map(|(link, all)| all.iter().map(move |slot| (link, slot))) {
        let own;
        (own, rest) = rest.split_at(width(slot));
        match slot {
            Slot::Dof(k) => robot.links[link].dofs[*k].start = own[0],
            Slot::Free => {
                let turn = DQuat::from_xyzw(own[4], own[5], own[6], own[3]);
                let turn = if turn.length() > 0.0 { turn.normalize() } else { DQuat::IDENTITY };
                robot.links[link].origin = Pose::new(DVec3::from_slice(own), turn);
            }
            Slot::Ball if own == [1.0, 0.0, 0.0, 0.0] => {}
            Slot::Ball => {
                let text = format!("a ball joint of {:?} stays as it stands: {key} turns it", robot.links[link].name);
                files.note(robot, node, &text);
            }
        }
    }
    for (link, slot) in slots.iter().enumerate().flat_map(|(link, all)| all.iter().map(move |slot| (link, slot))) {
        let Slot::Dof(k) = slot else { continue };
        let dof = &robot.links[link].dofs[*k];
        if dof.mimic.is_none() && dof.is_beyond(dof.start) {
            let expected = format!("{} to {} as {} of the keyframe", dof.range[0], dof.range[1], dof.name);
            return Err(files.told(node, xml::wrong(node, expected, Some(&dof.start.to_string()))));
        }
    }
    if node.has_attribute("mpos") || node.has_attribute("mquat") {
        files.note(robot, node, "bodies that are moved by hand stay where they stand: mpos and mquat are not read");
    }
    Ok(())
}
