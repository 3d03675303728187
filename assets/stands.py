"""Source of `stands/park.csv` and `stands/plantation.csv`: run `python -m assets.stands` after a change here.

Both stands fill 150 x 100 m. The park is an old one: 60 trees stand anywhere, at least 6 m apart. The plantation has
rows 3 m apart with trees every 2 m, of which each fourth row was felled and one tree in eight died. Heights follow from
diameters at breast height, and crowns from both, with the scatter of real trees. Sources: J. Chave et al., Improved
allometric models to estimate the aboveground biomass of tropical trees, Global Change Biology, 2014, eq. (6a), and
T. Jucker et al., Allometric equations for integrating remote sensing imagery into forest monitoring programmes, Global
Change Biology, 2017.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SEED = 21
HALF = np.array([75.0, 50.0])  # m
SCATTER = 0.07  # standard deviation of the logarithms of heights and crowns
HEADER = "x,y,dbh,height,crown_base,crown_radius,species"


def park(rng: np.random.Generator) -> list[str]:
    """Rows of the park: oaks and limes with diameters of 20 to 50 cm."""
    places: list[Array] = []
    while len(places) < 60:
        place = rng.uniform(3.0 - HALF, HALF - 3.0)
        if all(np.hypot(*(place - other)) >= 6.0 for other in places):
            places.append(place)
    species = rng.choice(["Quercus robur", "Tilia cordata"], 60).tolist()
    return rows(np.array(places), rng.uniform(20.0, 50.0, 60), rng.uniform(0.6, 0.75, 60), species, rng)


def plantation(rng: np.random.Generator) -> list[str]:
    """Rows of the plantation: spruces with diameters of 8 to 14 cm."""
    planted = [(x, y) for k, y in enumerate(np.arange(-48.5, 50.0, 3.0)) if k % 4 for x in np.arange(-74.0, 75.0, 2.0)]
    places = np.array(planted)[rng.random(len(planted)) > 1 / 8]
    places = places + rng.normal(0.0, 0.15, places.shape)
    count = len(places)
    return rows(places, rng.uniform(8.0, 14.0, count), np.full(count, 0.55), ["Picea abies"] * count, rng)


def rows(places: Array, dbh: Array, ratios: Array, species: list[str], rng: np.random.Generator) -> list[str]:
    """Rows of the file, for trees at places (T, 2) m with diameters at breast height (T,) cm.

    ratios (T,): shares of the heights that crowns take. `rng` scatters heights and crowns.
    """
    log = np.log(dbh)
    heights = np.exp(0.893 + 0.760 * log - 0.0340 * log * log + rng.normal(0.0, SCATTER, len(dbh)))
    crowns = (dbh / 0.557) ** (1 / 0.809) / heights / 2 * np.exp(rng.normal(0.0, SCATTER, len(dbh)))
    sizes = zip(places, dbh, heights, ratios, crowns, species, strict=True)
    return [f"{x:.2f},{y:.2f},{d:.1f},{h:.1f},{h * (1 - r):.1f},{c:.2f},{s}" for (x, y), d, h, r, c, s in sizes]


def main() -> None:
    """Write the files."""
    folder = Path(__file__).parent / "stands"
    folder.mkdir(exist_ok=True)
    for make in (park, plantation):
        lines = [HEADER, *make(np.random.default_rng(SEED))]
        (folder / f"{make.__name__}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
