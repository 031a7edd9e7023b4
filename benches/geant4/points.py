"""Points in and around the volumes of a GDML file, as Geant4 has them.

Usage: python3 points.py GEOMETRY.gdml POINTS.json      (pip install geant4-pybind; it asks for datasets, which are not needed)

For each placement in the world random points within its reach: name, point, inside or not, Geant4's distance to the surface.
CONTACTD_GDML=GEOMETRY.gdml CONTACTD_GDML_POINTS=POINTS.json cargo test -p contactd-tests --test models gdml::points compares them.
"""

import json
import random
import sys

import geant4_pybind as g4


def main(geometry, to):
    parser = g4.G4GDMLParser()
    parser.SetOverlapCheck(False)
    parser.Read(geometry, False)
    world = parser.GetWorldVolume().GetLogicalVolume()
    random.seed(5)
    points = []
    for i in range(world.GetNoDaughters()):
        placed = world.GetDaughter(i)
        at, solid, turn = placed.GetObjectTranslation(), placed.GetLogicalVolume().GetSolid(), placed.GetRotation()
        low, high = g4.G4ThreeVector(), g4.G4ThreeVector()
        solid.BoundingLimits(low, high)
        reach = 1.1 * max(low.mag(), high.mag())
        for _ in range(400):
            off = g4.G4ThreeVector(*(random.uniform(-reach, reach) for _ in range(3)))
            own = g4.G4ThreeVector(off)
            if turn is not None:
                own.transform(turn)
            inside = solid.Inside(own)
            distance = solid.DistanceToOut(own) if inside == g4.kInside else solid.DistanceToIn(own)
            point = [at.x + off.x, at.y + off.y, at.z + off.z]
            points.append([placed.GetName(), point, inside == g4.kInside, distance])
    with open(to, "w") as file:
        json.dump(points, file)
    print(f"{len(points)} points of {world.GetNoDaughters()} placements")


main(*sys.argv[1:])
