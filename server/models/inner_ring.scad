// Inner ring of a four-point-contact ball bearing, 30 mm bore. Public domain (CC0).
ball = 4.7625;
play = 0.02;
pitch = 23;
angle = 35;
width = 16;
land = 19.4;
deepest = pitch - (ball + play) / cos(angle);
half = (land - deepest) / tan(angle);

difference() {
    translate([0, 0, -width / 2]) cylinder(r = land, h = width);
    translate([0, 0, -width / 2 - 1]) cylinder(r = 15, h = width + 2);
    translate([0, 0, width / 2 - 0.8]) cylinder(r1 = 15, r2 = 15.81, h = 0.81);
    translate([0, 0, -width / 2 - 0.01]) cylinder(r1 = 15.81, r2 = 15, h = 0.81);
    difference() {                                  // raceway: a band without the two cones that stay
        translate([0, 0, -half]) cylinder(r = land + 1, h = 2 * half);
        translate([0, 0, -half - 0.001]) cylinder(r1 = land + 0.001 * tan(angle), r2 = deepest, h = half + 0.001);
        cylinder(r1 = deepest, r2 = land + 0.001 * tan(angle), h = half + 0.001);
    }
    for (i = [0 : 3]) rotate(i * 90) translate([-1.5, 15, -width / 2 - 1]) cube([3, 2, 4]);
}
