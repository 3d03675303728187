"""`understory explain`."""

import shlex
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from sim.facts.event import (
    IDENTITIES,
    INCIDENTS,
    UNHELD,
    UNMATCHED,
    Event,
    format_times,
    sort_by_severity,
    summarise_outages,
)
from sim.facts.explain.explanation import explain_person, find_stretches
from sim.facts.explain.observation import Observer
from sim.facts.explain.person import make_person_facts
from sim.facts.explain.track_story import TrackFacts, tell_track_story
from sim.facts.flight import Flight, find_scans, load
from sim.facts.words import TextGroup
from sim.mission.atomic_files import claim_place, write_whole
from sim.scenario.quantities import parse_integer, parse_interval
from sim.scenario.remarks import find_small_people
from sim.terminal.commands import Recorded, check_new, find_folder
from sim.terminal.console import console, print_remarks, show_place
from sim.views.drawing.plots import save
from sim.views.frames.explain_picture import draw_explanation
from sim.views.frames.frame_panels import encode_png
from tracking.errors import InputError

_STYLES = {"lost": "red", "not found yet": "red", "off the track": "yellow", "held by some": "yellow"}


def explain(
    recorded: Recorded,
    time: Annotated[str | None, typer.Option(metavar="T", help="With --target: the scan nearest to T seconds.")] = None,
    target: Annotated[
        str | None, typer.Option(metavar="N", help="Number of the person, from 0. Default: the losses of all people.")
    ] = None,
    track: Annotated[str | None, typer.Option(metavar="N", help="Number of a track whose story to tell.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="New file for the picture. Default: one in DIR.")
    ] = None,
) -> None:
    """Say when and why people were lost. With --target, tell of one person; with --time, at one scan, with a picture.

    With --track, say how a track was born, which measurements fed it, why it was kept, and why it was deleted.
    """
    if track is not None:
        for name, value in {"--time": time, "--target": target, "--out": out}.items():
            if value is not None:
                text = f"{str(value)!r} is not allowed with --track, which tells the whole story of a track"
                raise InputError(f"{name}: {text}")
    moment = None if time is None else _read_time(time)
    if moment is not None and target is None:
        raise InputError("--target: missing; --time asks about one person, so say which, from 0")
    if out is not None:
        check_new(out, ".png", "--out")
    flight = load(recorded)
    recording = flight.recording
    scan = None if moment is None else find_scans(recording, moment, None)[0]
    print_remarks(*find_small_people(recording.setting))
    people = recording.person_count
    lacking = "no person walked in this mission" if recording.labelled else "the people of this flight are unknown"
    person = None if target is None else _read_index(target, "--target", people, lacking)
    if track is not None:
        _explain_track(flight, _read_index(track, "--track", len(recording.track_numbers), "this mission had no track"))
    elif not recording.labelled:
        _explain_fades(flight, recorded)
    elif scan is None or person is None:
        _explain_mission(flight, person, out or find_folder(recorded) / "timeline.png", recorded)
    else:
        name = f"explain-target{person}-{recording.times[scan]:.1f}s"
        with claim_place(out, find_folder(recorded) / name, ".png") as path:
            _explain_moment(flight, scan, person, path)


def _read_time(text: str) -> float:
    start, end = parse_interval(text, "--time")
    if end is not None:
        raise InputError(f"--time: {text!r} is not allowed; expected one time such as 12.4")
    return start


def _read_index(text: str, option: str, count: int, lacking: str) -> int:
    """The index below `count` that an option gives; InputError says `lacking` if the count is zero."""
    if not count:
        raise InputError(f"{option}: {text!r} is not allowed; {lacking}")
    return parse_integer(text, option, least=0, most=count - 1)


def _explain_moment(flight: Flight, scan: int, person: int, path: Path) -> None:
    with Observer(flight) as observer:
        facts = make_person_facts(observer, scan, person)
        groups = explain_person(facts)
        page = draw_explanation(facts, groups)
    with write_whole(path) as part:
        part.write_bytes(encode_png(page))
    _print(groups)
    show_place("Picture", path)


def _explain_track(flight: Flight, number: int) -> None:
    with Observer(flight) as observer:
        _print(tell_track_story(TrackFacts(observer, number)))


def _print(groups: list[TextGroup]) -> None:
    for heading, facts in groups:
        console.print(f"[bold]{escape(heading)}[/bold]")
        for fact in facts:
            console.print(f"  {escape(fact)}", soft_wrap=True)


def _explain_mission(flight: Flight, person: int | None, path: Path, recorded: Path) -> None:
    """Print one person's mission in stretches or, without a person, all losses and other events of the mission."""
    people = range(flight.recording.person_count) if person is None else [person]
    unheld = sort_by_severity(event for event in flight.events if event.kind in UNHELD and event.person in people)
    others = _find_other_events(flight) if person is None else []
    passed = [event for event in flight.events if event.kind == "hand-off" and event.person in people]
    if person is not None:
        _print_stretches(flight, person)
        _print_events("hand-offs", passed)
    elif not unheld:
        console.print("No person was lost." if people else "No person walked in this mission.")
    else:
        _print_events("losses", unheld)
    _print_events("events", others)
    if passed and person is None:
        console.print(f"{len(passed)} hand-off{'s' * (len(passed) > 1)} of people from UAV to UAV")
    if not path.exists():
        save(flight.timeline_figure(), path)
    show_place("Timeline", path)
    asked = f"understory explain {shlex.quote(str(recorded))}"
    loss = unheld[0] if unheld else None
    if person is None and people:
        shown = loss.person if loss else people[0]
        show_place(f"All of person {shown}", f"{asked} --target {shown}")
    unmatched = [event for event in others if event.kind in UNMATCHED]
    if unmatched:
        false = max(unmatched, key=lambda event: event.last - event.first)
        show_place(f"The longest {false.kind}", f"{asked} --track {false.track}")
    if loss:
        show_place("The worst loss", f"{asked} --target {loss.person} --time {loss.time:.9g}")


def _explain_fades(flight: Flight, recorded: Path) -> None:
    """Print why each track of a flight whose people are unknown faded, and other events."""
    faded = [event for event in flight.events if event.kind == "track deleted"]
    _print_events("tracks that faded", faded)
    _print_events("events", _find_other_events(flight))
    if not faded:
        console.print("No track faded.")
    for event in faded[-1:]:
        show_place("All of a track", f"understory explain {shlex.quote(str(recorded))} --track {event.track}")


def _find_other_events(flight: Flight) -> list[Event]:
    """Events other than losses, by time; links that are lost again and again are summarised."""
    return summarise_outages(flight.events, flight.recording.times, also=(*UNMATCHED, *IDENTITIES, *INCIDENTS))


def _print_stretches(flight: Flight, person: int) -> None:
    console.print(f"[bold]person {person}[/bold]")
    table = Table.grid(padding=(0, 2))
    for begin, end, held, seen in find_stretches(flight.people, person):
        style = _STYLES.get(held, "")
        table.add_row(f"  {format_times(begin, end)}", f"[{style}]{held}[/]" if style else held, seen)
    console.print(table)


def _print_events(heading: str, events: list[Event]) -> None:
    """Print events under a heading; nothing if there are none."""
    _print([TextGroup(heading, [f"{event.when}: {event.sentence}" for event in events])] if events else [])
