// Gearbox cover for base.scad: rounded shell, bearing seats with ribs, eight screw holes, two dowel bores, mm. Public domain (CC0).
tall = 34;
wall = 5;

module pillar(x, y, r, z, h) { translate([x, y, z]) cylinder(r = r, h = h); }

difference() {
    union() {
        translate([-84, -44, 0]) cube([168, 88, 8]);                       // rim
        translate([-74, -54, 0]) cube([148, 108, 8]);
        for (x = [-74, 74], y = [-44, 44]) pillar(x, y, 10, 0, 8);
        translate([-71, -33, 0]) cube([142, 66, tall]);                    // shell
        translate([-63, -41, 0]) cube([126, 82, tall]);
        for (x = [-63, 63], y = [-33, 33]) pillar(x, y, 8, 0, tall);
        for (x = [-30, 30]) pillar(x, 0, 16, tall - 1, 11);                // bearing seats and their ribs
        for (x = [-30, 30], i = [0 : 5]) translate([x, 0, tall - 1]) rotate(i * 60 + 30) translate([14, -1.5, 0]) cube([12, 3, 7]);
        translate([0, 26, tall - 1]) cylinder(r1 = 9, r2 = 7, h = 6);      // filler
    }
    translate([-66, -28, -1]) cube([132, 56, tall - wall + 1]);            // inside
    translate([-58, -36, -1]) cube([116, 72, tall - wall + 1]);
    for (x = [-58, 58], y = [-28, 28]) pillar(x, y, 8, -1, tall - wall + 1);
    for (x = [-30, 30]) pillar(x, 0, 6, 20, 40);                           // shafts
    for (x = [-30, 30]) pillar(x, 0, 11, tall + 1, 20);
    for (x = [-30, 30]) translate([x, 0, tall + 9]) cylinder(r1 = 11, r2 = 12.01, h = 1.01);
    pillar(0, 26, 4, 20, 30);
    for (x = [-77.5, 77.5]) pillar(x, 0, 3, -1, 20);                       // screws
    for (x = [-77.5, 77.5]) pillar(x, 0, 5.5, 5, 10);
    for (x = [-50, 0, 50], y = [-47.5, 47.5]) pillar(x, y, 3, -1, 20);
    for (x = [-50, 0, 50], y = [-47.5, 47.5]) pillar(x, y, 5.5, 5, 10);
    for (s = [-1, 1]) pillar(s * 77.5, s * 30, 3.05, -1, 20);              // dowels
    for (s = [-1, 1]) translate([s * 77.5, s * 30, -0.01]) cylinder(r1 = 3.56, r2 = 3.05, h = 0.51);
}
