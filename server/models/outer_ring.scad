// Outer ring of a four-point-contact ball bearing, 62 mm over all. Public domain (CC0).
// The raceway is a V of two cones, tangent to a ball at 35 degrees.
ball = 4.7625;
play = 0.02;
pitch = 23;
angle = 35;
width = 16;
land = 26.6;
deepest = pitch + (ball + play) / cos(angle);
half = (deepest - land) / tan(angle);

difference() {
    translate([0, 0, -width / 2]) cylinder(r = 31, h = width);
    translate([0, 0, -width / 2 - 1]) cylinder(r = land, h = width + 2);
    cylinder(r1 = deepest, r2 = land, h = half);
    translate([0, 0, -half]) cylinder(r1 = land, r2 = deepest, h = half);
    translate([0, 0, width / 2 - 0.8]) cylinder(r1 = land, r2 = land + 0.81, h = 0.81);
    translate([0, 0, -width / 2 - 0.01]) cylinder(r1 = land + 0.81, r2 = land, h = 0.81);
    difference() {                                  // snap ring groove
        translate([0, 0, 4.5]) cylinder(r = 32, h = 1.5);
        translate([0, 0, 4]) cylinder(r = 29.6, h = 3);
    }
    for (i = [0 : 5]) rotate(i * 60 + 20) translate([25, 0, 0]) rotate([0, 90, 0]) cylinder(r = 0.9, h = 8);
}
