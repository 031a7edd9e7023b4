//! Solids as they are written, held against what is the same.

use super::{Volumes, read};

fn volumes(solids: &str) -> Volumes {
    let text = format!(
        "<gdml><solids>{solids}</solids><structure><volume name=\"A\"><solidref ref=\"s\"/></volume></structure></gdml>"
    );
    read(text.as_bytes()).unwrap_or_else(|e| panic!("{text}: {e:?}"))
}

#[test]
fn planes_that_differ_by_rounding_are_one() {
    let written = |solid: &dyn Fn(&str) -> String, z: &str| volumes(&solid(z)).volumes[0].text.clone();
    let part = "startphi=\"93\" deltaphi=\"100\" aunit=\"deg\"";
    let stack = |kind: &str, more: &str, z: &str| {
        format!(
            "<{kind} name=\"s\" {part} {more}><zplane rmin=\"58.76\" rmax=\"85.9\" z=\"-63.9\"/>\
             <zplane rmin=\"22.2\" rmax=\"42.2\" z=\"-32.8\"/><zplane rmin=\"50\" rmax=\"59.97\" z=\"{z}\"/>\
             <zplane rmin=\"40.1\" rmax=\"56.6\" z=\"98.2\"/></{kind}>"
        )
    };
    let outline = |kind: &str, more: &str, z: &str| {
        format!(
            "<{kind} name=\"s\" {part} {more}><rzpoint r=\"40\" z=\"-32.8\"/><rzpoint r=\"60\" z=\"10\"/>\
             <rzpoint r=\"40\" z=\"50\"/><rzpoint r=\"20\" z=\"50\"/><rzpoint r=\"20\" z=\"{z}\"/></{kind}>"
        )
    };
    let sections = |z: &str| {
        format!(
            "<xtru name=\"s\"><twoDimVertex x=\"0\" y=\"0\"/><twoDimVertex x=\"0\" y=\"9\"/><twoDimVertex x=\"9\" y=\"0\"/>\
             <section zOrder=\"0\" zPosition=\"-63.9\"/><section zOrder=\"1\" zPosition=\"-32.8\"/>\
             <section zOrder=\"2\" zPosition=\"{z}\" scalingFactor=\"2\"/><section zOrder=\"3\" zPosition=\"98.2\"/></xtru>"
        )
    };
    let sides = "numsides=\"6\"";
    let all: [&dyn Fn(&str) -> String; 5] = [
        &|z| stack("polycone", "", z),
        &|z| stack("polyhedra", sides, z),
        &|z| outline("genericPolycone", "", z),
        &|z| outline("genericPolyhedra", sides, z),
        &|z| sections(z),
    ];
    for solid in all {
        let same = written(solid, "-32.8");
        for z in ["-32.80000000000001", "-32.799999999999997", "-(98.4)/3", "-3.28e1-2e-11"] {
            assert_eq!(written(solid, z), same, "{z}");
        }
        // What is no rounding stays.
        for z in ["-32.800001", "-32.79999"] {
            assert_ne!(written(solid, z), same, "{z}");
        }
    }
}
