// Fixture plate with forty chamfered holes, four corner bores and a key slot, mm. Public domain (CC0).
columns = 8;
rows = 5;
grid = 20;
hole = 5;
thick = 18;

difference() {
    translate([-columns * grid / 2, -rows * grid / 2, -thick]) cube([columns * grid, rows * grid, thick]);
    for (i = [0 : columns - 1], j = [0 : rows - 1])
        translate([(i + 0.5 - columns / 2) * grid, (j + 0.5 - rows / 2) * grid, 0]) {
            translate([0, 0, -thick - 1]) cylinder(r = hole, h = thick + 2);
            translate([0, 0, -1]) cylinder(r1 = hole, r2 = hole + 1.01, h = 1.01);
        }
    for (x = [-1, 1], y = [-1, 1]) translate([x * 70, y * 40, -thick - 1]) cylinder(r = 1.5, h = 4);
    translate([-90, -2, -thick - 1]) cube([180, 4, 3]);
}
