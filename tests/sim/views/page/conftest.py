"""One eventful mission, and the folder of its page and film."""

import pytest
from helpers.flown_pages import eventful, film_of

from sim.facts.flight import Flight
from sim.views.page.page import write_page


@pytest.fixture(scope="package")
def mission():
    """The recording."""
    return eventful()


@pytest.fixture(scope="package")
def folder(tmp_path_factory, mission):
    folder = tmp_path_factory.mktemp("run")
    film = film_of(folder / "mission.mp4", mission)
    write_page(Flight(mission), folder / "mission.html", video=film, place="runs/it's here")
    return folder
