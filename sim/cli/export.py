"""`understory export`: a recorded mission for other tools, and labelled images of recordings or scenarios."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from sim.exchange.export import EXPORTS, LABELS, check_options, write_labelled_images
from sim.exchange.export import export as write_export
from sim.exchange.ros_mission import tell_noise
from sim.mission.archive import find_recording
from sim.mission.atomic_files import claim_place
from sim.mission.recording import Recording
from sim.mission.trial import Trial
from sim.mission.warmup import announce_compilation
from sim.running.fly import fly_mission
from sim.scenario.loading import SCENARIOS, load_scenario, place_of
from sim.scenario.quantities import parse_duration, parse_integers
from sim.terminal.commands import Duration, Overrides, find_folder, merge_overrides
from sim.terminal.console import print_remarks, say, show_files
from sim.terminal.progress import Show, show_compilation, show_progress
from tracking.errors import InputError, check_known, one_line
from tracking.settings import DAY

# Images are rendered after the flight, so that none are needed during it.
_FLOWN_WITH = ("sensing.mode=ideal", "appearance.randomise=true")

_Recorded = Annotated[
    list[str],
    typer.Argument(metavar="DIR...", help="A run's folder or mission.npz; for coco and yolo several, or scenarios."),
]
_To = Annotated[
    str,
    typer.Option(metavar="FORMAT", help=f"{', '.join(EXPORTS)}; or images with labels: {', '.join(LABELS)}."),
]
_Out = Annotated[Path | None, typer.Option(metavar="FOLDER", help="New folder. Default: one in DIR, or under runs/.")]
_Truth = Annotated[bool, typer.Option("--truth/--no-truth", help="People, errors and events in a bag, or not.")]
_Images = Annotated[str | None, typer.Option(metavar="FORMAT", help="Images in a bag: jpeg, the default, or png.")]
_Every = Annotated[
    str | None,
    typer.Option(metavar="TIME", help="Least time between labelled images of a camera. Default: all."),
]
_Val = Annotated[str | None, typer.Option(metavar="LIST", help="Seeds whose labelled images are for validation.")]
_Test = Annotated[str | None, typer.Option(metavar="LIST", help="Seeds whose labelled images are for the test.")]
_Seeds = Annotated[
    str | None,
    typer.Option(metavar="LIST", help="Fly scenarios with seeds such as 0-9, in random appearance."),
]
_Planner = Annotated[
    str | None, typer.Option(metavar="NAME", help="The planner that flies them. Default: greedy, which follows people.")
]


def export(
    recorded: _Recorded,
    to: _To,
    out: _Out = None,
    truth: _Truth = True,
    images: _Images = None,
    every: _Every = None,
    val: _Val = None,
    test: _Test = None,
    seeds: _Seeds = None,
    planner: _Planner = None,
    duration: Duration = None,
    overrides: Overrides = None,
) -> None:
    """Write a recorded mission for other tools, or labelled images of missions, also straight from scenarios."""
    check_known("--to", to, [*EXPORTS, *LABELS])
    check_options(to, truth=truth, images=images)
    flying = {"--planner": planner, "--duration": duration, "--set": overrides}
    if to not in LABELS:
        labelling = {"--every": every, "--val": val, "--test": test, "--seeds": seeds, **flying}
        _check_unused(labelling, f"not allowed together with --to {to}; it belongs to --to coco and yolo")
        if len(recorded) > 1:
            raise InputError(f"DIR: {recorded[1]!r} is one too many; --to {to} takes one recording")
        recording = find_recording(Path(recorded[0]))
        with claim_place(out, find_folder(Path(recorded[0])) / f"export-{to}") as folder:
            write_export(recording, to, folder, truth=truth, images=images)
        if noise := tell_noise(recording) if to == "rosbag" else "":
            print_remarks(noise)
        show_files(folder)
        return
    apart = 0.0 if every is None else parse_duration(every, "--every", DAY)
    flights: list[Recording | Trial]
    if seeds is None:
        _check_unused(flying, "only allowed together with --seeds, by which scenarios are flown")
        flights = [_find_mission(name) for name in recorded]
    else:
        changes = [*_FLOWN_WITH, *merge_overrides(overrides, duration)]
        flights = [
            Trial(load_scenario(name, changes), planner or "greedy", seed, place=place_of(name, changes))
            for name in recorded
            for seed in parse_integers(seeds, "--seeds")
        ]
    splits = _read_splits(val, test, [flight.seed for flight in flights])
    alone = Path(recorded[0]) if len(recorded) == 1 else None
    beside = find_folder(alone) / f"export-{to}" if alone and seeds is None else None
    with (
        claim_place(out, beside or Path("runs") / f"{alone.stem if alone else 'images'}-{to}") as folder,
        show_progress() as show,
        announce_compilation(say, partial(show_compilation, show)),
    ):
        write_labelled_images(_fly(flights, show), to, folder, splits=splits, every=apart)
    if to == "yolo" and "val" not in splits.values():
        print_remarks("--val: names no seed, so val of data.yaml has no images of its own")
    show_files(folder)


def _check_unused(options: Mapping[str, object], why: str) -> None:
    for name, value in options.items():
        if value is not None:
            raise InputError(f"{name}: {why}")


def _find_mission(name: str) -> Recording:
    if name in SCENARIOS and not Path(name).exists():
        raise InputError(f"DIR: {name} does not exist; to fly the scenario of this name, add seeds such as --seeds 0-9")
    recording = find_recording(Path(name))
    if recording.frames is not None:
        raise InputError(f"DIR: {name} was not flown here, so its images cannot be rendered; expected a mission")
    return recording


def _read_splits(val: str | None, test: str | None, seeds: Sequence[int]) -> dict[int, str]:
    """The split of each seed that is not for training; InputError unless they are seeds of flights, and each once."""
    splits: dict[int, str] = {}
    for split, text in (("val", val), ("test", test)):
        for seed in () if text is None else parse_integers(text, f"--{split}"):
            if seed not in seeds:
                there = one_line(", ".join(map(str, dict.fromkeys(seeds))), 100)
                raise InputError(f"--{split}: no flight has the seed {seed}; allowed are {there}")
            if seed in splits:
                raise InputError(f"--{split}: {seed} is in --{splits[seed]}, too; allowed is one of them")
            splits[seed] = split
    return splits


def _fly(flights: Sequence[Recording | Trial], show: Show) -> Iterator[Recording]:
    """The recordings of flights, flown if they were not yet."""
    for done, flight in enumerate(flights):
        show(done, len(flights), f"{done} of {len(flights)} flights")
        if isinstance(flight, Trial):
            yield fly_mission(flight).recording
        else:
            yield flight
