"""Random situations for tests of planning."""

from collections.abc import Callable

import pytest

from planning.planner import Situation
from planning.specimens import specimen_team

Team = Callable[..., list[Situation]]


@pytest.fixture
def random_team() -> Team:
    """Situations of a team whose members hold the same beliefs, in a random forest."""
    return specimen_team
