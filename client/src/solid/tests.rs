use super::*;
use glam::DVec2;

fn text(solid: &Solid) -> String {
    solid.text().unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn operators_print_as_openscad_writes_them_and_chains_stay_flat() {
    let hole = cylinder(3.0, 9.0);
    let far = hole.moved(DVec3::new(10.0, 0.0, 0.0));
    let plate = cuboid(40.0, 40.0, 4.0) - &hole - far + sphere(0.1);
    let expected = "\
union() {
\tdifference() {
\t\tcube(size = [40, 40, 4], center = true);
\t\tcylinder(h = 9, r1 = 3, r2 = 3, center = true);
\t\tmultmatrix([[1, 0, 0, 10], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) {
\t\t\tcylinder(h = 9, r1 = 3, r2 = 3, center = true);
\t\t}
\t}
\tsphere(r = 0.1);
}
";
    assert_eq!(text(&plate), expected);
    let many = (0..500).fold(cuboid(1.0, 1.0, 1.0), |s, i| s - sphere(1e-3 * f64::from(i + 1)));
    assert_eq!(text(&many).lines().count(), 503);
    // What is subtracted is no part of the chain.
    assert_eq!(text(&(sphere(1.0) - (sphere(2.0) - sphere(3.0)))).matches("difference").count(), 2);
}

#[test]
fn numbers_keep_their_bits() {
    for x in [0.1, 1.0 / 3.0, 1e-300, 5e-324, f64::MAX, 123_456_789.123_456_78, 1e15, 9.999_999e-6, -2.5e-7, 1e22] {
        let written = tree::number(x);
        assert_eq!(written.parse::<f64>().unwrap().to_bits(), x.to_bits(), "{written}");
        assert!(written.len() < 25, "{written}");
    }
}

#[test]
fn what_makes_no_sense_is_one_sentence_wherever_it_stands() {
    let told = |solid: Solid| (cuboid(1.0, 1.0, 1.0) - solid).text().unwrap_err().to_string();
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    for (solid, sentence) in [
        (sphere(-1.0), "sphere: expected a positive finite radius, found -1"),
        (cuboid(1.0, f64::NAN, 1.0), "box: expected a positive finite length along y, found NaN"),
        (cone(0.0, 0.0, 1.0), "cone: expected a positive finite larger radius, found 0"),
        (torus(1.0, 1.0), "torus: expected a major radius above the minor one, found 1 and 1"),
        (hyperboloid(1.0, 1.0, 1.0), "hyperboloid: expected a waist below the radius, found 1 and 1"),
        (paraboloid(1.0, 0.0), "paraboloid: expected a positive finite height, found 0"),
        (
            quadric(&[[0.0, 1.0, 0.0, 0.0]; 4], DVec3::ZERO, DVec3::ONE),
            "quadric: expected a symmetric matrix, found 0 and 1",
        ),
        (quadric(&[[1.0; 4]; 4], DVec3::ZERO, DVec3::X), "quadric: expected min below max in all coordinates"),
        (hull([]), "hull: expected one operand or more, found none"),
        (polyhedron(&corners, &[[0, 1, 4]]), "polyhedron: expected indices of 4 points, found 4 in face 0"),
        (polyhedron(&corners, &[[0, 1, 2]]), "polyhedron: expected four faces or more, found 1"),
        (sphere(1.0).scaled(DVec3::new(1.0, 0.0, 1.0)), "transform: expected a finite matrix that can be inverted"),
        (
            polygon(&[DVec2::X, DVec2::Y]).extrude(1.0),
            "polygon: expected paths of three corners or more, found 2 in path 0",
        ),
        (circle(1.0).revolve_part(7.0), "revolution: expected an angle above 0, at most 2π, found 7"),
        (sphere(1.0).with_pieces(8), "pieces: expected 9 pieces of a curve or more"),
        (
            height_field(&[[1.0, 2.0]], 1.0, 1.0, 0.0),
            "height field: expected two rows of two heights or more, found 1 of 2",
        ),
        (
            height_field(&[vec![1.0, 2.0], vec![1.0]], 1.0, 1.0, 0.0),
            "height field: expected rows of one length, found 2 heights in row 0 and 1 in row 1",
        ),
        (
            height_field(&[[1.0, 2.0], [1.0, f64::NAN]], 1.0, 1.0, 0.0),
            "height field: expected finite heights, found NaN in row 1",
        ),
        (
            height_field(&[[1.0, 2.0], [1.0, 0.5]], 1.0, 1.0, 0.5),
            "height field: expected a base below the lowest height, 0.5, found 0.5",
        ),
        (
            height_field(&[[1.0, 2.0], [1.0, 0.5]], 1.0, 0.0, 0.0),
            "height field: expected a positive finite length along y, found 0",
        ),
        (half_space(DVec3::ZERO, 1.0), "half-space: expected a direction and a finite offset, found [0, 0, 0] and 1"),
    ] {
        let found = told(solid);
        assert!(found.starts_with(sentence), "{found}");
    }
    let deep = (0..1_100).fold(sphere(1.0), |s, _| s.moved(DVec3::X));
    assert!(told(deep).starts_with("solid: expected at most 1000 levels"));
}

#[test]
fn pieces_are_told_where_there_are_curves() {
    let twisted = rectangle(1.0, 2.0).extrude_twisted(3.0, -0.5, 4) + sphere(1.0).scaled(DVec3::new(1.0, 2.0, 3.0));
    let text = text(&twisted.with_pieces(64));
    assert_eq!(text.matches("$fn = 64").count(), 2);
    assert!(text.contains("square(size = [1, 2], center = true);"), "{text}");
}
