//! Solids built by calls: their text, what is loaded of it, and what is refused.

use crate::support::*;
use contactd_capi::error::{ERROR_ARGUMENT, ERROR_NULL};
use contactd_capi::model::contactd_mass_properties;
use contactd_capi::solid::*;
use std::ptr::{null, null_mut};

/// A solid, freed at its end.
struct Owned(*mut Built);

impl Drop for Owned {
    fn drop(&mut self) {
        done(unsafe { contactd_solid_free(&mut self.0) });
        assert!(self.0.is_null());
        done(unsafe { contactd_solid_free(&mut self.0) });
    }
}

fn built(call: impl FnOnce(*mut *mut Built) -> i32) -> Owned {
    let mut handle = null_mut();
    done(call(&mut handle));
    Owned(handle)
}

fn drawn(call: impl FnOnce(*mut *mut Drawn) -> i32) -> *mut Drawn {
    let mut handle = null_mut();
    done(call(&mut handle));
    handle
}

#[test]
fn a_plate_with_its_hole_is_printed_and_loaded() {
    let plate = built(|o| unsafe { contactd_solid_box(40.0, 40.0, 4.0, o) });
    let hole = built(|o| unsafe { contactd_solid_cylinder(3.0, 9.0, o) });
    let moved = [1.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let hole = built(|o| unsafe { contactd_solid_transformed(hole.0, moved.as_ptr(), o) });
    let operands = [plate.0.cast_const(), hole.0.cast_const()];
    let part = built(|o| unsafe { contactd_solid_join(DIFFERENCE, operands.as_ptr(), 2, o) });
    let text = string(out(|o| unsafe { contactd_solid_text(part.0, o) }));
    let expected = "difference() {\n\tcube(size = [40, 40, 4], center = true);\n\tmultmatrix([[1, 0, 0, 5], [0, 1, 0, 0], \
                    [0, 0, 1, 0], [0, 0, 0, 1]]) {\n\t\tcylinder(h = 9, r1 = 3, r2 = 3, center = true);\n\t}\n}\n";
    assert_eq!(text, expected);
    let session = Open::embedded();
    let model = out(|o| unsafe { contactd_load_solid(session.0, c"plate".as_ptr(), part.0, 0, o) });
    let mass = out(|o| unsafe { contactd_mass_properties(session.0, model, 0.0, 0, o) });
    let expected = 6400.0 - 36.0 * std::f64::consts::PI;
    assert!((mass.volume - expected).abs() <= mass.volume_error + 1e-9, "{}", mass.volume);
}

#[test]
fn outlines_become_solids() {
    let [square, disc] = [
        drawn(|o| unsafe { contactd_outline_rectangle(4.0, 4.0, o) }),
        drawn(|o| unsafe { contactd_outline_circle(1.0, o) }),
    ];
    let operands = [square.cast_const(), disc.cast_const()];
    let ring = drawn(|o| unsafe { contactd_outline_join(DIFFERENCE, operands.as_ptr(), 2, o) });
    let solid = built(|o| unsafe { contactd_outline_extrude(ring, 2.0, 1.0, 1.0, o) });
    let text = string(out(|o| unsafe { contactd_solid_text(solid.0, o) }));
    assert!(text.starts_with("linear_extrude(height = 2, center = true) {\n\tdifference() {\n"), "{text}");
    let points = [0.0, 0.0, 2.0, 0.0, 2.0, 1.0, 0.5, 0.2, 1.0, 0.2, 1.0, 0.5];
    let path = drawn(|o| unsafe { contactd_outline_polygon(points.as_ptr(), [3, 3].as_ptr(), 2, o) });
    let wider = drawn(|o| unsafe { contactd_outline_offset(path, 0.1, CORNERS_SHARP, o) });
    let moved = drawn(|o| unsafe { contactd_outline_transformed(wider, [1.0, 0.0, 9.0, 0.0, 1.0, 0.0].as_ptr(), o) });
    let turned = built(|o| unsafe { contactd_outline_revolve(moved, 1.0, o) });
    let text = string(out(|o| unsafe { contactd_solid_text(turned.0, o) }));
    assert!(text.contains("paths = [[0, 1, 2], [3, 4, 5]]") && text.contains("offset(delta = 0.1"), "{text}");
    let twisted = built(|o| unsafe { contactd_outline_twist(square, 2.0, 0.5, 4, o) });
    let twisted = built(|o| unsafe { contactd_solid_with_pieces(twisted.0, 32, o) });
    let shadow = drawn(|o| unsafe { contactd_solid_projection(twisted.0, 0, o) });
    for mut outline in [square, disc, ring, path, wider, moved, shadow] {
        done(unsafe { contactd_outline_free(&mut outline) });
        assert!(outline.is_null());
    }
}

#[test]
fn every_kind_is_there() {
    let points = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let (corners, sides) = ([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], [3; 4]);
    let all = [
        built(|o| unsafe { contactd_solid_sphere(1.0, o) }),
        built(|o| unsafe { contactd_solid_cone(1.0, 0.0, 2.0, o) }),
        built(|o| unsafe { contactd_solid_torus(3.0, 1.0, o) }),
        built(|o| unsafe { contactd_solid_capsule(1.0, 1.0, o) }),
        built(|o| unsafe { contactd_solid_superellipsoid([1.0, 2.0, 1.5].as_ptr(), [0.4, 1.0].as_ptr(), o) }),
        built(|o| unsafe { contactd_solid_polyhedron(points.as_ptr(), 4, corners.as_ptr(), sides.as_ptr(), 4, o) }),
    ];
    let heights = [1.0, 2.0, 1.0, 0.5, 1.0, 3.0];
    let field = built(|o| unsafe { contactd_solid_height_field(heights.as_ptr(), 2, 3, 4.0, 2.0, 0.0, o) });
    let text = string(out(|o| unsafe { contactd_solid_text(field.0, o) }));
    let expected = "height_field(heights = [[1, 2, 1], [0.5, 1, 3]], size = [4, 2], base = 0);\n";
    assert_eq!(text, expected);
    let operands: Vec<*const Built> = all.iter().map(|s| s.0.cast_const()).collect();
    let session = Open::embedded();
    let floor = built(|o| unsafe { contactd_solid_half_space([0.0, 0.0, 2.0].as_ptr(), -0.5, o) });
    for (name, solid) in [(c"floor", floor.0), (c"field", field.0)] {
        let _ = out(|o| unsafe { contactd_load_solid(session.0, name.as_ptr(), solid, 0, o) });
    }
    for operation in [UNION, INTERSECTION, HULL] {
        let joined = built(|o| unsafe { contactd_solid_join(operation, operands.as_ptr(), operands.len(), o) });
        let half = built(|o| unsafe { contactd_solid_half_space([0.0, 0.0, 1.0].as_ptr(), 0.1, o) });
        let pair = [joined.0.cast_const(), half.0.cast_const()];
        let cut = built(|o| unsafe { contactd_solid_join(INTERSECTION, pair.as_ptr(), 2, o) });
        let _ = out(|o| unsafe { contactd_load_solid(session.0, c"all".as_ptr(), cut.0, 0, o) });
    }
}

#[test]
fn quadrics_are_there() {
    let saddle = [1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.5, 0.0];
    let corners = [[-1.0; 3], [1.0; 3]];
    let all = [
        built(|o| unsafe { contactd_solid_paraboloid(1.0, 2.0, o) }),
        built(|o| unsafe { contactd_solid_hyperboloid(1.0, 0.5, 2.0, o) }),
        built(|o| unsafe { contactd_solid_hyperbolic_dome(1.0, 2.0, 0.5, o) }),
        built(|o| unsafe { contactd_solid_quadric(saddle.as_ptr(), corners[0].as_ptr(), corners[1].as_ptr(), o) }),
    ];
    let operands: Vec<*const Built> = all.iter().map(|s| s.0.cast_const()).collect();
    let session = Open::embedded();
    for operation in [UNION, INTERSECTION, DIFFERENCE] {
        let joined = built(|o| unsafe { contactd_solid_join(operation, operands.as_ptr(), operands.len(), o) });
        let _ = out(|o| unsafe { contactd_load_solid(session.0, c"all".as_ptr(), joined.0, 0, o) });
    }
    let mut handle = null_mut();
    let sentence = "hyperboloid: expected a waist below the radius, found 2 and 1";
    refused(unsafe { contactd_solid_hyperboloid(1.0, 2.0, 2.0, &mut handle) }, ERROR_ARGUMENT, sentence);
    let (m, low) = (saddle.as_ptr(), corners[0].as_ptr());
    refused(unsafe { contactd_solid_quadric(m, low, null(), &mut handle) }, ERROR_NULL, "max is NULL");
}

#[test]
fn what_makes_no_sense_is_refused_at_once() {
    let mut handle = null_mut();
    let sentence = "sphere: expected a positive finite radius, found -1";
    refused(unsafe { contactd_solid_sphere(-1.0, &mut handle) }, ERROR_ARGUMENT, sentence);
    assert!(handle.is_null());
    refused(unsafe { contactd_solid_sphere(1.0, null_mut()) }, ERROR_NULL, "out is NULL");
    let sentence = "index 0: the solid (freed, or never made) is NULL";
    refused(unsafe { contactd_solid_join(UNION, [null()].as_ptr(), 1, &mut handle) }, ERROR_NULL, sentence);
    let sentence = "expected operation of 0 to 4, found 5";
    refused(unsafe { contactd_solid_join(5, null(), 0, &mut handle) }, ERROR_ARGUMENT, sentence);
    let sentence = "difference: expected one operand or more";
    refused(unsafe { contactd_solid_join(DIFFERENCE, null(), 0, &mut handle) }, ERROR_ARGUMENT, sentence);
    refused(
        unsafe { contactd_solid_text(null_mut(), null_mut()) },
        ERROR_NULL,
        "the solid (freed, or never made) is NULL",
    );
    refused(unsafe { contactd_solid_half_space(null(), 0.0, &mut handle) }, ERROR_NULL, "normal is NULL");
}
