// Spur gear, 24 teeth, module 2.5, mm. Public domain (CC0).
// A tooth is a convex polygon whose corners lie on the flanks; web recesses, keyed bore, lightening holes.
teeth = 24;
module_ = 2.5;
pitch = teeth * module_ / 2;
width = 10;
thin = 0.12;        // taken off each flank: backlash

module tooth() {
    linear_extrude(height = width) polygon(points = [
        [pitch - 4, -2.75 + thin], [pitch - 2.6, -2.75 + thin], [pitch, -1.96 + thin], [pitch + 1.3, -1.45 + thin], [pitch + 2.4, -0.85 + thin],
        [pitch + 2.4, 0.85 - thin], [pitch + 1.3, 1.45 - thin], [pitch, 1.96 - thin], [pitch - 2.6, 2.75 - thin], [pitch - 4, 2.75 - thin]]);
}

module recess(z) {
    difference() {
        translate([0, 0, z]) cylinder(r = 22.5, h = 3);
        translate([0, 0, z - 1]) cylinder(r1 = 11.5, r2 = 11.5, h = 5);
    }
}

difference() {
    union() {
        cylinder(r = pitch - 3, h = width);
        for (i = [0 : teeth - 1]) rotate(i * 360 / teeth) tooth();
        translate([0, 0, -2]) cylinder(r = 10, h = width + 4);
    }
    recess(width - 2.5);
    recess(-0.5);
    translate([0, 0, -3]) cylinder(r = 6, h = width + 6);
    translate([-1.5, 0, -3]) cube([3, 8, width + 6]);
    for (i = [0 : 5]) rotate(i * 60 + 30) translate([17, 0, -1]) cylinder(r = 4, h = width + 2);
}
