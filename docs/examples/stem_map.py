"""Your own trees and people: a stem map with sizes of trunks and crowns, and a path that somebody walks.

Writes both tables, `stems.csv` and `walk.csv`, and draws the map at 8 s into `map.png`.
"""

import math
from pathlib import Path

import understory

STEMS = """Nr;species;x;y;dbh;height;crown_radius
1;Fagus sylvatica;691214,0;4335571,0;38,5;13,5;5,2
2;Picea abies;691228,5;4335566,0;22,0;11,0;2,4
3;Quercus robur;691222,0;4335551,5;51,0;14,0;6,1
"""  # projected coordinates [m], diameters [cm], decimal commas

Path("stems.csv").write_text(STEMS)
rows = [f"{2 * k},anna,{12 * math.cos(0.3 * k):.2f},{12 * math.sin(0.3 * k):.2f}" for k in range(6)]
Path("walk.csv").write_text("\n".join(["time,id,x,y", *rows, "0,ben,-15,-5", "10,ben,15,2"]))
settings = {
    "duration": 10,
    "trees.file": "stems.csv",
    "trees.origin": [691220, 4335560],  # of the area's centre
    "people.trajectories": "walk.csv",
    "area": {"width": 60, "height": 50},
    "uavs": [{"start": [-8, 0], "footprint": 24}, {"start": [10, 4], "footprint": 24}],
}
flight = understory.run(settings=settings)
trees = flight.columns("trees")
for number, radius in zip(trees["tree"], trees["canopy_radius_m"], strict=True):
    print(f"tree {number}: crown of {radius:.1f} m")
print(flight)
flight.map_figure(8.0).savefig("map.png")
