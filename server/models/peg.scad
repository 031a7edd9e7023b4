// Shouldered locating peg for the fixture plate: 0.1 mm of play in diameter, mm. Public domain (CC0).
// The shoulder rests on z = 0; the shank points down.
shank = 4.95;
length = 24;

difference() {
    union() {
        cylinder(r = 9, h = 5);
        translate([0, 0, 5]) cylinder(r1 = 9, r2 = 6, h = 3);
        cylinder(r = 6, h = 22);
        translate([0, 0, 22]) sphere(r = 6);
        translate([0, 0, 1.5 - length]) cylinder(r = shank, h = length - 1);
        translate([0, 0, -length]) cylinder(r1 = shank - 1.5, r2 = shank, h = 1.5);
    }
    difference() {                                  // relief under the shoulder
        translate([0, 0, -1.5]) cylinder(r = 5.5, h = 1.5);
        translate([0, 0, -2]) cylinder(r = 4.4, h = 3);
    }
    for (i = [0 : 11]) rotate(i * 30) translate([6.3, 0, 10]) cylinder(r = 0.8, h = 10);
    translate([-10, 0, 16]) rotate([0, 90, 0]) cylinder(r = 1.6, h = 20);
}
