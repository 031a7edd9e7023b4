//! What robots' files name beside themselves: packages, links to elsewhere, SRDF.

use contactd::import::robot::{Ask, read_robot, scene_of};
use contactd::import::{Facets, Limits};
use contactd_tests::random_solids::Random;
use std::path::Path;

const MESH: &str = "OFF 4 4 0\n0 0 0\n4 0 0\n0 4 0\n0 0 4\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";

/// What is wrong with a robot of one mesh, or "".
fn sentence(path: &Path, mesh: &str, ask: &Ask) -> String {
    let text = format!(
        "<robot name=\"r\"><link name=\"a\"><collision><geometry><mesh filename=\"{mesh}\"/></geometry></collision></link></robot>"
    );
    std::fs::write(path, text).expect("written");
    let scene = read_robot(path, ask).and_then(|robot| scene_of(path, &robot, ask));
    let read = scene.and_then(|scene| scene.load_models(Facets::Auto, &Limits::default()).map(|_| ()));
    read.map_or_else(|e| e.to_string(), |()| String::new())
}

#[test]
fn meshes_come_from_the_files_folder_and_from_packages_and_from_nowhere_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    // A workspace: the robot's package, another one beside it, one that is named; and what is none of them.
    for place in
        ["ws/robot/urdf/own", "ws/robot/meshes", "ws/hand/meshes", "ws/secret", "far/tool/meshes", "far/secret"]
    {
        std::fs::create_dir_all(at(place)).expect("folders");
        std::fs::write(at(place).join("t.off"), MESH).expect("written");
    }
    for (link, to) in
        [("ws/hand/meshes/link.off", "ws/secret/t.off"), ("far/tool/meshes/in.off", "far/tool/meshes/t.off")]
    {
        std::os::unix::fs::symlink(at(to), at(link)).expect("a link");
    }
    std::os::unix::fs::symlink(at("ws/secret"), at("ws/hand/out")).expect("a link");
    let path = at("ws/robot/urdf/r.urdf");
    let ask = Ask { packages: vec![at("far")], ..Ask::default() };
    for mesh in [
        "own/t.off",
        "package://robot/meshes/t.off",
        "package://hand/meshes/t.off",
        "package://tool/meshes/t.off",
        "model://tool/meshes/in.off",
        "package://urdf/own/t.off",
    ] {
        assert_eq!(sentence(&path, mesh, &ask), "", "{mesh}");
    }
    let absolute = format!("package://{}", at("ws/secret/t.off").display());
    let through = format!("package://hand/{}", at("ws/secret/t.off").display());
    let file = format!("file://{}", at("ws/secret/t.off").display());
    for mesh in [
        "../meshes/t.off",
        "package://hand/meshes/link.off",
        "package://hand/out/t.off",
        "package://hand/../secret/t.off",
        "package://./secret/t.off",
        "package://../secret/t.off",
        absolute.as_str(),
        through.as_str(),
        file.as_str(),
    ] {
        let told = sentence(&path, mesh, &ask);
        assert!(told.contains("expected a readable file") && told.lines().count() == 1, "{mesh}: {told}");
    }
    // A package that one mesh is in opens no way to what is beside it.
    let both = |mesh: &str| {
        let other = format!(
            "package://hand/meshes/t.off\"/></geometry></collision><collision><geometry><mesh filename=\"{mesh}"
        );
        sentence(&path, &other, &ask)
    };
    assert_eq!(both("../../hand/meshes/t.off"), "");
    assert!(both("../../secret/t.off").contains("which is not in the folder"), "{}", both("../../secret/t.off"));
}

/// Random SRDF against a table of pairs that the test keeps.
#[test]
fn srdf_says_which_pairs_are_tested() {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, srdf) = (folder.path().join("r.urdf"), folder.path().join("r.srdf"));
    let mut r = Random::new(8);
    for k in 0..60 {
        let n = 3 + r.below(3);
        let mut urdf = "<robot name=\"r\">".to_owned();
        let mut tested = vec![vec![true; n]; n];
        for i in 0..n {
            urdf += &format!(
                "<link name=\"l{i}\"><collision><geometry><sphere radius=\"1\"/></geometry></collision></link>"
            );
            if i > 0 {
                let parent = r.below(i);
                urdf += &format!(
                    "<joint name=\"j{i}\" type=\"continuous\"><parent link=\"l{parent}\"/><child link=\"l{i}\"/></joint>"
                );
                (tested[i][parent], tested[parent][i]) = (false, false);
            }
        }
        // By default first, then what is enabled, then what is disabled; in the file they stand in any order.
        let (mut elements, mut steps) = (vec![], [vec![], vec![], vec![]]);
        for _ in 0..r.below(12) {
            let (kind, i, j) = (r.below(3), r.below(n), r.below(n));
            if i == j {
                continue;
            }
            steps[kind].push((i, j));
            elements.push(match kind {
                0 => format!("<disable_default_collisions link=\"l{i}\"/>"),
                1 => format!("<enable_collisions link1=\"l{i}\" link2=\"l{j}\"/>"),
                _ => format!("<disable_collisions link1=\"l{i}\" link2=\"l{j}\" reason=\"Never\"/>"),
            });
        }
        for (kind, all) in steps.iter().enumerate() {
            for (i, j) in all {
                match kind {
                    0 => (0..n).for_each(|other| (tested[*i][other], tested[other][*i]) = (false, false)),
                    _ => (tested[*i][*j], tested[*j][*i]) = (kind == 1, kind == 1),
                }
            }
        }
        std::fs::write(&path, urdf + "</robot>").expect("written");
        std::fs::write(&srdf, format!("<robot name=\"r\"><group name=\"g\"/>{}</robot>", elements.concat()))
            .expect("written");
        let ask = Ask { srdf: Some(srdf.clone()), ..Ask::default() };
        let robot = read_robot(&path, &ask).unwrap_or_else(|e| panic!("{e}"));
        let name = |i: usize| robot.links[i].name[1..].parse::<usize>().expect("a number");
        for i in 0..n {
            for j in i + 1..n {
                assert_eq!(robot.is_excepted(i, j), !tested[name(i)][name(j)], "{k}: {i} {j} {elements:?}");
            }
        }
    }
    for (text, words) in [
        ("<sdf/>", "r.srdf:1:1: expected a robot (SRDF) as the root element, found \"sdf\""),
        ("<robot><link name=\"l0\"/></robot>", "r.srdf:1:8: expected SRDF, which names links and joints of a URDF"),
        ("<robot><disable_default_collisions link=\"q\"/></robot>", "expected the name of a link, found \"q\""),
    ] {
        std::fs::write(&srdf, text).expect("written");
        let told = read_robot(&path, &Ask { srdf: Some(srdf.clone()), ..Ask::default() }).expect_err(text).to_string();
        assert!(told.contains(words), "{told}");
    }
}
