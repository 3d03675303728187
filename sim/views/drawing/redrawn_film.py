"""The film of a recorded mission, drawn again from its recording only."""

import io
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory

import av

from sim.facts.metrics.summary import format_planner_title
from sim.facts.rerender import Rerenderer
from sim.mission.recording import Recording
from sim.scenario.scenario import Scenario
from sim.views.drawing.film import AS_FLOWN, Film, Video, add_stream
from tracking.errors import InputError, check_known
from tracking.numerics.arrays import Image


def check_layout(layout: str, scenario: Scenario) -> None:
    """InputError if the film of a mission cannot have this layout."""
    uavs = [f"uav{i}" for i in range(len(scenario.uavs))]
    check_known("--layout", layout, [AS_FLOWN, "map", "cameras", *uavs])
    if not scenario.sensing.renders and layout not in (AS_FLOWN, "map"):
        raise InputError(f"--layout: {layout!r} is not allowed, ideal sensing takes no images; expected map")


def write_film(
    recording: Recording,
    scans: Sequence[int],
    out: Path,
    *,
    layout: str = AS_FLOWN,
    speed: float = 1.0,
    progress: Callable[[int], None],
) -> None:
    """Write the film of successive scans to the new file `out`, completely or not at all.

    It has one picture per scan, shown `speed` times as fast as flown. With the layout `AS_FLOWN`, pictures are equal to
    those of `understory run`, also in the film of a part of the mission. `progress` is called with each scan.
    """
    scenario = recording.setting
    title = format_planner_title(recording.planner, recording.sees_truth)
    film = Film(
        scenario,
        recording.forest,
        planner=title,
        layout=layout,
        labelled=recording.labelled,
        believed=recording.believed_forest,
    )
    with ExitStack() as stack:
        again = stack.enter_context(Rerenderer(recording)) if film.cameras else None

        def frames(k: int) -> list[Image | None] | None:
            return again.images(k, film.cameras) if again else None

        for k in range(scans[0]):
            film.follow(recording.snapshot(k), frames(k) if k > scans[0] - film.cycle else None)
        rate = scenario.rates.sensing * Fraction(speed).limit_denominator(1000)
        video = stack.enter_context(Video(out, film, fps=rate))
        for k in scans:
            video.add(recording.snapshot(k), frames(k))
            progress(k)


def shrink_film(content: bytes, size: int) -> bytes:
    """The film with the same pictures in less detail, in about `size` bytes."""
    out = io.BytesIO()
    with (
        av.open(io.BytesIO(content), "r") as source,
        av.open(out, "w", format="mp4") as target,
    ):
        film = source.streams.video[0]
        rate = film.average_rate or Fraction(1)
        stream = add_stream(target, rate, preset="veryfast")
        stream.bit_rate = int(8 * size * rate / film.frames)
        for n, frame in enumerate(source.decode(film)):
            again = av.VideoFrame.from_ndarray(frame.to_ndarray(), format="yuv420p")
            again.pts = n
            target.mux(stream.encode(again))
        target.mux(stream.encode(None))
    return out.getvalue()


def redraw_film(recording: Recording, *, progress: Callable[[int], None]) -> bytes:
    """The content of the film that a run makes, drawn again."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "mission.mp4"
        write_film(recording, range(len(recording.times)), path, progress=progress)
        return path.read_bytes()
