// Socket head cap screw M8 x 20, mm. Public domain (CC0).
// Hexagon socket, knurled head, ring grooves for the thread, run-in cone. The head rests on z = 0.
length = 20;

module groove(z) {
    difference() {
        translate([0, 0, z]) cylinder(r = 5, h = 0.8);
        translate([0, 0, z - 0.1]) cylinder(r = 3.4, h = 1);
    }
}

difference() {
    union() {
        cylinder(r = 6.5, h = 7.2);
        translate([0, 0, 7.2]) cylinder(r1 = 6.5, r2 = 5.7, h = 0.8);
        translate([0, 0, 1.5 - length]) cylinder(r = 4, h = length - 1);
        translate([0, 0, -length]) cylinder(r1 = 2.8, r2 = 4, h = 1.5);
    }
    translate([0, 0, 4]) cylinder($fn = 6, r = 3.464, h = 5);
    translate([0, 0, 2.6]) cylinder(r1 = 0.6, r2 = 3, h = 1.41);
    for (i = [0 : 5]) groove(-17.5 + 2 * i);
    for (i = [0 : 17]) rotate(i * 20) translate([6.7, 0, 1]) cylinder(r = 0.4, h = 6);
}
