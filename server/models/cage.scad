// Riveted cage of a ball bearing with nine spherical pockets. Public domain (CC0).
balls = 9;
ball = 4.7625;
pitch = 23;
tall = 10;

difference() {
    union() {
        translate([0, 0, -tall / 2]) cylinder(r = 25.2, h = tall);
        for (i = [0 : balls - 1]) rotate((i + 0.5) * 360 / balls) translate([pitch, 0, tall / 2]) sphere(r = 1.2);
        for (i = [0 : balls - 1]) rotate((i + 0.5) * 360 / balls) translate([pitch, 0, -tall / 2]) sphere(r = 1.2);
    }
    translate([0, 0, -tall]) cylinder(r = 20.8, h = 2 * tall);
    for (i = [0 : balls - 1]) rotate(i * 360 / balls) translate([pitch, 0, 0]) sphere(r = ball + 0.15);
    for (i = [0 : balls - 1]) rotate((i + 0.5) * 360 / balls) translate([19, 0, 0]) rotate([0, 90, 0]) cylinder(r = 1.4, h = 8);
    translate([0, 0, tall / 2 - 0.6]) cylinder(r1 = 20.8, r2 = 21.41, h = 0.61);
    translate([0, 0, -tall / 2 - 0.01]) cylinder(r1 = 21.41, r2 = 20.8, h = 0.61);
}
