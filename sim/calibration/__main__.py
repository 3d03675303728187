"""`python -m sim.calibration`: fit of the constants of the camera's covariance, and NEES of the present ones."""

from typing import NamedTuple

import numpy as np
from rich.table import Table

from sim.calibration.consistency import bin_leaves, bin_nees, bin_pairs, bin_tilts
from sim.calibration.fit import fit_leaves, fit_part, fit_powers, fit_split, fit_whole, sample_forests, sample_leafy
from sim.terminal.commands import run_alone
from sim.terminal.console import console


def calibrate() -> None:
    """Fit the camera's covariance to rendered people and print its constants.

    A table of the NEES of the constants in force, on 5000 other detections, follows.
    """
    console.print(
        "tracking.detection.detection_errors.WholeError\n" + _list_constants(fit_powers(fit_whole(0, 1200), 0, 600))
    )
    console.print("tracking.detection.detection_errors.SplitError\n" + _list_constants(fit_split(0, 800)))
    console.print("tracking.detection.partial_visibility.PartError\n" + _list_constants(fit_part(1, 500)))
    console.print("tracking.detection.detection_errors.LeafError\n" + _list_constants(fit_leaves(0, 100)))
    table = Table("bin", "detections", "mean NEES", "95 % interval", "")
    for row in (
        bin_nees(sample_forests(2, 165)) + bin_leaves(sample_leafy(2, 60)) + bin_tilts(2, 200) + bin_pairs(2, 2000)
    ):
        interval = f"{row.low:.2f} to {row.high:.2f}"
        table.add_row(row.name, str(row.count), f"{row.mean:.2f}", interval, "" if row.holds else "outside")
    console.print(table)


def _list_constants(constants: NamedTuple) -> str:
    return "\n".join(f"  {name} = {np.round(value, 3).tolist()}" for name, value in constants._asdict().items())


if __name__ == "__main__":
    run_alone(calibrate)
