// Weld-neck pipe flange, mm. Public domain (CC0).
// Eight counterbored bolt holes, bore, O-ring groove in the raised face, eight ribs, eight witness dimples.
bolts = 8;
pitch = 52;        // radius of the bolt circle
hole = 4.5;        // radius of a bolt hole: an M8 shank with half a millimetre around it
seat = 7.5;        // radius of the counterbore
disc = 14;         // thickness of the disc

module rib() {
    translate([0, 2, disc - 1]) rotate([90, 0, 0]) linear_extrude(height = 4)
        polygon(points = [[29, 0], [60, 0], [60, 3], [31, 24], [29, 24]]);
}

module bolt_hole() {
    translate([0, 0, -1]) cylinder(r = hole, h = disc + 2);
    translate([0, 0, disc - 5]) cylinder(r = seat, h = 6);
    translate([0, 0, disc - 1]) cylinder(r1 = seat, r2 = seat + 1.01, h = 1.01);
}

difference() {
    union() {
        cylinder(r = 65, h = disc);
        translate([0, 0, -2]) cylinder(r = 40, h = 3);
        translate([0, 0, disc]) cylinder(r1 = 40, r2 = 31, h = 11);
        cylinder(r = 31, h = 42);
        translate([0, 0, 42]) cylinder(r1 = 31, r2 = 28, h = 4);
        for (i = [0 : bolts - 1]) rotate((i + 0.5) * 360 / bolts) rib();
    }
    translate([0, 0, -3]) cylinder(r = 25, h = 50);
    translate([0, 0, -2.01]) cylinder(r1 = 27.01, r2 = 25, h = 2.01);
    difference() {                                  // O-ring groove
        translate([0, 0, -3]) cylinder(r = 36, h = 3);
        translate([0, 0, -4]) cylinder(r = 32, h = 5);
    }
    for (i = [0 : bolts - 1]) rotate(i * 360 / bolts) translate([pitch, 0, 0]) bolt_hole();
    for (i = [0 : bolts - 1]) rotate(i * 360 / bolts + 11.25) translate([62, 0, disc + 1]) sphere(r = 2);
}
