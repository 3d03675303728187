"""Readable numbers in place of the ids of tracks."""

from dataclasses import replace

from sim.mission.recording import Recording
from sim.mission.snapshot import Snapshot


def number_tracks(snapshot: Snapshot, numbers: dict[int, int]) -> Snapshot:
    """The snapshot with readable numbers in place of the ids of tracks; new tracks are added to `numbers`."""
    tracks = [
        tuple([track.renumber(numbers.setdefault(track.id, len(numbers))) for track in held])
        for held in snapshot.tracks
    ]
    return replace(snapshot, tracks=tracks)


def number_snapshot(recording: Recording, k: int) -> Snapshot:
    """Scan k of a recording with numbered tracks."""
    return number_tracks(recording.snapshot(k), recording.track_numbers)
