"""A recording on disk for tests of reading."""

import pytest
from helpers.recordings import record

from sim.mission.archive import save


@pytest.fixture(scope="session")
def saved(tmp_path_factory):
    """File of a made-up mission of eleven scans; no test may change it."""
    path = tmp_path_factory.mktemp("recording") / "mission.npz"
    save(record(), path)
    return path
