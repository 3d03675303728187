"""Facts about people made by hand."""

import dataclasses

import numpy as np

from helpers.recordings import bare
from sim.facts.people import PeopleFacts, Views


def make_facts(inside, shown, detected, tracks, *, present=None, working=None, looked=None):
    """Facts of a recording from tables (K, n, M) for cameras, and of ids (K, n, M) of the tracks that hold people.

    People stand 20 m apart; present (K, M), working (K, n) and looked (K, n) are true by default.
    """
    scans, uavs, count = tracks.shape
    present = np.ones((scans, count), bool) if present is None else present
    working = np.ones((scans, uavs), bool) if working is None else working
    places = np.column_stack([20.0 * np.arange(count), np.zeros(count)])
    fleet = [
        [{1000 * m + int(id): (*places[m], 0, 0) for m, id in enumerate(own) if id >= 0} for own in row]
        for row in tracks
    ]
    recording = bare(
        np.where(present[:, :, None], places, np.nan),
        fleet,
        visible=shown.astype(int),
        matched=detected,
        ospa=np.where(working[:, :, None], np.ones((scans, uavs, 3)), np.nan),
        frames=np.ones((scans, uavs), bool) if looked is None else looked,
    )
    return with_views(recording, inside & recording.frames_taken[:, :, None], np.full(inside.shape, -1))


def with_views(recording, inside, hidden_by, shown=None, detected=None):
    """Facts of a recording, but with these frames: who is inside, behind which tree, shown and detected (K, n, M)."""
    if shown is not None:
        recording = dataclasses.replace(recording, visible=shown.astype(np.int64), matched=detected)
    facts = PeopleFacts(recording)
    facts.views = Views(inside, hidden_by)
    return facts


def spell_facts(inside, shown, detected, tracks, **other):
    """Facts about one person; each UAV's column is one row of text, a letter a scan: x for yes."""
    tables = [np.array([[c == "x" for c in row] for row in rows]).T[:, :, None] for rows in (inside, shown, detected)]
    return make_facts(*tables, np.array(tracks).T[:, :, None], **other)
