"""Check of tracks from outside: a tracker's initial ones, and those of trackers that are plug-ins."""

from collections.abc import Collection
from typing import Any

import numpy as np

from tracking.plugins.array_checks import check_array, check_numbers, check_positive_definite, check_whole_numbers
from tracking.plugins.plugin_error import Unusable
from tracking.track import Track, make_tracks

_PARTS = ("id", "belief", "existence")


def check_tracks(given: Collection[Any]) -> tuple[Track, ...]:
    """Return copies of tracks by ascending id; raise `Unusable`, a ValueError, if they are no tracks."""
    if not isinstance(given, Collection):
        raise Unusable(f"tracks are no sequence but {type(given).__name__}")
    for track in given:
        if lacking := [part for part in _PARTS if not hasattr(track, part)]:
            needed = "a track is an object with id, belief and existence, as tracking.track.Track"
            raise Unusable(f"among tracks is a {type(track).__name__} without {lacking[0]}; {needed}")
    count, ids = len(given), [track.id for track in given]
    numbers = check_whole_numbers("ids of tracks", ids, (count,))
    if numbers.min(initial=0) < 0:
        raise Unusable(f"ids of tracks are below 0: {ids[:10]}")
    if twice := sorted({id for id in ids if ids.count(id) > 1}):
        raise Unusable(f"ids of tracks are there twice: {twice[:10]}")
    tracks = sorted(given, key=lambda track: int(track.id))
    means = check_array("means of tracks", [t.belief.mean for t in tracks] or np.zeros((0, 4)), (count, 4))
    spreads = [t.belief.covariance for t in tracks] or np.zeros((0, 4, 4))
    covariances = check_array("covariances of tracks", spreads, (count, 4, 4))
    check_positive_definite("covariances of tracks", covariances)
    existence = check_array("existence of tracks", [t.existence for t in tracks], (count,))
    if not np.all((existence > 0.0) & (existence <= 1.0)):
        raise Unusable("existence of tracks is not in (0, 1]")
    unknown = np.full(3, np.nan)
    sightings = [getattr(track, "sighting", unknown) for track in tracks] or np.zeros((0, 3))
    seen = check_numbers("sightings of tracks", sightings)
    if seen.shape != (count, 3):
        raise Unusable(f"sightings of tracks of shape {seen.shape}, not ({count}, 3)")
    seen[~np.isfinite(seen).all(axis=1)] = np.nan
    return make_tracks(np.sort(numbers), means, covariances, existence, seen)
