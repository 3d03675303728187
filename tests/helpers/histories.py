"""Histories made by hand."""

import numpy as np

from sim.facts.history import History
from sim.facts.metrics.holding import NO_TRACK


def history(inside, shown, detected, tracks, **other):
    """A history of one person; each UAV's column is one row of text, a letter a scan: x for yes."""
    tables = {name: np.array([[c == "x" for c in row] for row in rows]).T[:, :, None]
              for name, rows in (("inside", inside), ("shown", shown), ("detected", detected))}  # fmt: skip
    held = np.array(tracks).T[:, :, None]
    scans, uavs = held.shape[:2]
    plain = {
        "times": 0.2 * np.arange(scans),
        "present": np.ones((scans, 1), bool),
        "working": np.ones((scans, uavs), bool),
        "looked": np.ones((scans, uavs), bool),
        "hidden_by": np.full((scans, uavs, 1), -1),
        "gaps": np.full((scans, 1), NO_TRACK),
    }
    return History(**{**plain, **tables, "tracks": held, **other})
