"""`mission.html`: a mission on one self-contained page."""

import base64
import hashlib
import io
import json
import math
import shlex
from collections.abc import Iterable, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from string import Template

import av
import msgspec

from sim.facts.event import IDENTITIES, INCIDENTS, UNHELD, UNMATCHED, Event, sort_by_severity, summarise_outages
from sim.facts.flight import Flight
from sim.facts.metrics.catalogue import METRICS
from sim.facts.metrics.metric import Outcome
from sim.facts.metrics.summary import format_recording_title
from sim.mission.atomic_files import write_whole
from sim.mission.recording import Recording
from sim.scenario.loading import SCENARIOS, load_scenario
from sim.scenario.scenario import Scenario
from sim.scenario.settings_text import format_value, list_changes
from sim.scenario.uavs import Uav
from sim.views.drawing.film import HEIGHT, WIDTH, lay_out_parts
from sim.views.drawing.redrawn_film import shrink_film
from sim.views.page.charts import Shown, choose_shown
from sim.views.page.data import list_colours, make_page_data
from sim.views.scene import mark_trees
from tracking.errors import InputError, spell
from tracking.fusion.member import TRACKERS

_RESULTS = {  # metrics at the top, by their label there
    "OSPA under 1 m": "ospa.share_under_1m",
    "OSPA mean": "ospa.mean_m",
    "GOSPA mean": "gospa.mean_m",
    "people held": "share_held",
    "hand-offs": "handoffs",
}
_LARGE_FILM, _FILM = 8_000_000, 5_000_000  # bytes: a larger film is encoded again, with about so many
_MOST_FAULTS = 3  # number of faults of different kinds at the top
_PRINTED = {"losses": 6, "incidents": 3}  # entries of each list on paper, in page.css
_SCRIPTS = ("page_drawing.js", "page_map.js", "page_charts.js", "page.js")


def write_page(flight: Flight, path: Path, *, video: bytes | Path | None = None, place: str = "DIR") -> None:
    """Write a mission's page, completely or not at all.

    video: the film of the run with a frame for each scan, or None for a page without a film; InputError if it is the
    film of another mission. A long mission's page has no film. place: name of the run's folder in the commands on the
    page.
    """
    with write_whole(path) as part:
        part.write_text(make_page(flight, video=video, place=place), encoding="utf-8")


def describe_omission(recording: Recording) -> str:
    """What the page of a long mission leaves out, in words; "" for nothing."""
    shown = choose_shown(recording)
    if shown.stride == 1:
        return ""
    return (
        f"The page shows {shown.count} of {len(recording.times)} scans, one each "
        f"{shown.stride / recording.setting.rates.sensing:g} s, and no film, because the mission is long; "
        "the recording has all scans."
    )


def make_page(flight: Flight, *, video: bytes | Path | None = None, place: str = "DIR") -> str:
    """The text of a mission's page; arguments as in `write_page`."""
    recording, scenario, events = flight.recording, flight.scenario, flight.events
    shown = choose_shown(recording)
    film = video.read_bytes() if isinstance(video, Path) else video
    if film is not None:
        _check_film(film, recording)
        film = None if shown.stride > 1 else shrink_film(film, _FILM) if len(film) > _LARGE_FILM else film
    data = make_page_data(flight, None if film is None else lay_out_parts(scenario))
    listed = (*UNHELD, *UNMATCHED, *IDENTITIES) if recording.labelled else ("track deleted",)
    lost = sort_by_severity(event for event in events if event.kind in listed)
    incidents = summarise_outages(events, recording.times, also=INCIDENTS)
    variables = "".join(f" --{name}: {colour};" for name, colour in list_colours().items())
    style = f":root {{ color-scheme: light;{variables} }}{_read_asset('page.css')}"
    script = '"use strict";\n(() => {\n' + "\n".join(map(_read_asset, _SCRIPTS)) + "})();\n"  # in a scope of its own
    sources = f"style-src {_hash_source(style)}; script-src {_hash_source(script)}"
    return Template(_read_asset("page.html")).substitute(
        policy=f"default-src 'none'; img-src data:; media-src data:; {sources}",
        title=escape(format_recording_title(recording)),
        omission="".join(f"<p>{escape(text)}</p>" for text in [describe_omission(recording)] if text),
        warnings=_list_warnings(recording, [event for event in incidents if event.kind == "fault"]),
        facts="\n".join(f"<div><dt>{escape(n)}</dt><dd>{escape(v)}</dd></div>" for n, v in _list_facts(recording)),
        settings=_list_settings(scenario),
        film="" if film is None else _embed_film(film),
        losses_title="Losses, false and switched tracks" if recording.labelled else "Tracks that faded",
        lost=len(lost),
        losses=_list_events("losses", lost, recording, shown, place),
        count=len(incidents),
        incidents=_list_events("incidents", incidents, recording, shown, place),
        data=_encode_json(data),
        style=style,
        script=script,
    )


def _check_film(film: bytes, recording: Recording) -> None:
    """InputError unless the film has the size and the number of frames of this recording's film."""
    try:
        with av.open(io.BytesIO(film)) as container:
            stream = container.streams.video[0]
            found = stream.width, stream.height, stream.frames
    except (av.FFmpegError, IndexError) as error:
        raise InputError(f"video: cannot be read: {error}") from error
    wanted = (WIDTH, HEIGHT, len(recording.times))
    if found != wanted:
        sizes = ["{} x {} with {} frames".format(*size) for size in (found, wanted)]
        raise InputError(f"video: is {sizes[0]}, that of the recording is {sizes[1]}")


def _read_asset(name: str) -> str:
    return (files("sim.views.page") / name).read_text(encoding="utf-8")


def _hash_source(text: str) -> str:
    """The source expression with which a content security policy allows only this inline text."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _encode_json(data: object) -> str:
    """JSON without characters that an HTML parser would interpret."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("&", r"\u0026").replace("<", r"\u003c").replace(">", r"\u003e")


def _embed_film(film: bytes) -> str:
    source = f"data:video/mp4;base64,{base64.b64encode(film).decode()}"
    return (
        '<video id="film" muted playsinline preload="auto" aria-label="The whole film: map and cameras" '
        f'src="{source}"></video>'
    )


def _list_warnings(recording: Recording, faults: Sequence[Event]) -> str:
    """Warnings about the results: the part that was not flown, and the first faults of planner and detector."""
    lines = [f"{event.text} {event.when}: {event.why}" for event in faults[:_MOST_FAULTS]]
    if (more := len(faults) - _MOST_FAULTS) > 0:
        lines.append(f"{more} more {'kind of fault is' if more == 1 else 'kinds of fault are'} listed below.")
    if recording.interrupted:
        lines.insert(0, f"Interrupted at {recording.times[-1]:g} s of {recording.setting.duration:g} s.")
    return "\n".join(f'<p class="warning">{escape(line)}</p>' for line in lines)


def _list_facts(recording: Recording) -> Iterable[tuple[str, str]]:
    """Facts for the top of the page: results first, then the setting."""
    outcome = Outcome(recording)
    scenario = recording.setting
    for label, metric in _RESULTS.items() if recording.labelled else ():
        yield label, METRICS[metric].with_unit(METRICS[metric](outcome))
    if name := _find_packaged_name(scenario):
        yield "scenario", name
    yield "flown", f"{recording.times[-1]:g} s, {scenario.rates.sensing} scans a second"
    crowns = [tree.solid for tree in mark_trees(recording.forest) if tree.is_crown]
    porous = [crown.leaf_area_density for crown in crowns if crown.is_porous]
    leaves = f", leaf area {_format_span(porous)}²/m³ in {len(porous)}" if porous else ""
    canopies = f", canopies of {_format_span(crown.radius for crown in crowns)}{leaves}" if crowns else ""
    yield "trees", f"{len(recording.trees)}{canopies}"
    yield "people", str(recording.person_count) if recording.labelled else "unknown"
    limited = scenario.sensing.field_of_view == "camera"
    views = f"views of {_format_span(uav.footprint for uav in scenario.uavs)}" if limited else "unlimited views"
    heights = _format_span(uav.altitude for uav in scenario.uavs)
    yield "UAVs", f"{len(scenario.uavs)}, {heights} up, {views}"
    yield "sensing", scenario.sensing.mode
    loss = f", loss {100 * scenario.network.loss:g} %" if scenario.network.loss else ""
    tracker = scenario.tracking.tracker
    fusion = scenario.network.fusion
    yield ("fusion", fusion + loss) if tracker in TRACKERS.built_in else ("tracker", tracker + loss)
    for name in ("network.bytes_per_scan_mean", "network.age_s") if scenario.network.takes_time else ():
        yield METRICS[name].label, METRICS[name].with_unit(METRICS[name](outcome))
    yield "initial tracks", scenario.tracking.initial_tracks
    if origin := scenario.geo.origin:
        yield "origin", ", ".join(spell(part, 9) for part in origin)
    yield "page by", f"understory {version('understory')}"


def _format_span(lengths: Iterable[float]) -> str:
    """The least and the largest of some lengths [m] in words."""
    known = set(lengths)
    return " to ".join(spell(length, 3) for length in sorted({min(known), max(known)})) + " m"


def _find_packaged_name(scenario: Scenario) -> str | None:
    """Name of the packaged scenario that was flown, for any duration; None if it is not a packaged one."""
    settings = msgspec.to_builtins(scenario)
    flown = {"duration": scenario.duration}
    return next((name for name in SCENARIOS if msgspec.to_builtins(load_scenario(name)) | flown == settings), None)


def _list_settings(scenario: Scenario) -> str:
    """Settings that differ from the defaults, folded because a fleet or paths of people are long."""
    own = [_format_fleet(scenario) if text.startswith("uavs=") else text for text in list_changes(scenario)]
    if not own:
        return '<p class="settings">All settings are the defaults.</p>'
    summary = f"<summary>Settings other than the defaults: {len(own)}</summary>"
    return f'<details class="settings">{summary}{_make_codes(own)}</details>'


def _format_fleet(scenario: Scenario) -> str:
    """The fleet in the form of `--set`: a line for each UAV, without defaults."""
    default = msgspec.to_builtins(Uav(start=(math.nan, math.nan)))
    rows = [{k: v for k, v in msgspec.to_builtins(uav).items() if v != default[k]} for uav in scenario.uavs]
    return "\n".join(["uavs=[", *(f"  {format_value(row)}," for row in rows), "]"])


def _make_codes(lines: Iterable[str]) -> str:
    return "".join(f"<code>{escape(line)}</code>" for line in lines)


def _list_events(name: str, events: Sequence[Event], recording: Recording, shown: Shown, place: str) -> str:
    """A list of events as buttons, each with the commands that explain it."""
    if not events:
        return f'<p id="{name}">None.</p>'
    items = "\n".join(_make_item(event, recording, shown, place) for event in events)
    left = len(events) - _PRINTED[name]
    paper = f'\n<p class="paper">and {left} more, in mission.html</p>' if left > 0 else ""
    return f'<ol class="events" id="{name}">\n{items}\n</ol>{paper}'


def _make_item(event: Event, recording: Recording, shown: Shown, place: str) -> str:
    first, last = shown.span(event.first, event.last)
    person = "" if event.person is None else f' data-person="{event.person}"'
    why = f"<p>{escape(event.why)}</p>" if event.why else ""
    commands = _make_codes(_list_commands(event, recording, place))
    more = f"<details><summary>Look closer</summary>{commands}</details>" if commands else ""
    return (
        f'<li data-first="{first}" data-last="{last}"{person}>'
        f'<button type="button">{escape(f"{event.text} {event.when}")}</button>{why}{more}</li>'
    )


def _list_commands(event: Event, recording: Recording, place: str) -> Iterable[str]:
    time = f"{recording.times[event.first]:.9g}"
    folder = shlex.quote(place)
    if event.track is not None:
        yield f"understory explain {folder} --track {event.track}"
    if event.person is not None:
        yield f"understory explain {folder} --time {time} --target {event.person}"
    if event.uavs and recording.working[event.first, event.uavs[0]]:
        yield f"understory frames {folder} --uav {event.uavs[0]} --time {time}"
