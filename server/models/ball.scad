// Bearing ball, 9.525 mm. Public domain (CC0).
sphere(r = 4.7625);
