// Gearbox base: plate with two gear journals, two dowels, eight tapped holes and a gasket groove, mm. Public domain (CC0).
module pillar(x, y, r, z, h) { translate([x, y, z]) cylinder(r = r, h = h); }

difference() {
    union() {
        translate([-84, -44, -12]) cube([168, 88, 12]);
        translate([-74, -54, -12]) cube([148, 108, 12]);
        for (x = [-74, 74], y = [-44, 44]) pillar(x, y, 10, -12, 12);
        for (x = [-30, 30]) pillar(x, 0, 5.9, -1, 15);                     // journals
        for (x = [-30, 30]) translate([x, 0, 14]) cylinder(r1 = 5.9, r2 = 4.9, h = 1);
        for (s = [-1, 1]) pillar(s * 77.5, s * 30, 3, -1, 9);              // dowels
        for (s = [-1, 1]) translate([s * 77.5, s * 30, 8]) cylinder(r1 = 3, r2 = 2, h = 1);
    }
    for (x = [-77.5, 77.5]) pillar(x, 0, 2.5, -13, 14);                    // tapped holes
    for (x = [-50, 0, 50], y = [-47.5, 47.5]) pillar(x, y, 2.5, -13, 14);
    for (x = [-77.5, 77.5]) translate([x, 0, -1]) cylinder(r1 = 2.5, r2 = 3.51, h = 1.01);
    for (x = [-50, 0, 50], y = [-47.5, 47.5]) translate([x, y, -1]) cylinder(r1 = 2.5, r2 = 3.51, h = 1.01);
    difference() {                                                         // gasket groove
        translate([-70, -40, -1]) cube([140, 80, 2]);
        translate([-68, -38, -2]) cube([136, 76, 4]);
    }
    for (x = [-30, 30]) pillar(x, 0, 2, -13, 30);                          // oil ways
    for (x = [-60, 60], y = [-34, 34]) pillar(x, y, 4, -13, 5);            // feet
}
