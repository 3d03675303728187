"""What the metrics of a trial are called, in which unit they are shown, and which way is better."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from sim.scenario.errors import InputError
from sim.scenario.loading import did_you_mean
from sim.sensing.stopwatch import STAGES
from sim.study.row import Row

Better = Literal["lower", "higher", "neither"]
UNKNOWN = "–"  # stands where there is no number


@dataclass(frozen=True)
class Measure:
    """How one metric is shown; `scale` turns its value into the unit."""

    name: str  # as in `Row.metrics`
    label: str
    unit: str = ""
    scale: float = 1.0
    digits: int = 2
    better: Better = "lower"
    least: float = 0.0  # that a value can be, not in the unit
    most: float = math.inf

    @property
    def title(self) -> str:
        """Label with unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def text(self, value: float, *, signed: bool = False) -> str:
        """The value in the unit, without it; a dash where it is undefined. Signed zeros were rounded."""
        if math.isnan(value):
            return UNKNOWN
        shown = f"{value * self.scale:{'+' if signed and value else ''}.{self.digits}f}"
        return shown[1:] if float(shown) == 0 and shown[0] == "-" and not (signed and value) else shown

    def within(self, low: float, high: float, *, signed: bool = False) -> str:
        """An interval as text; empty where there is none."""
        if math.isnan(low) or math.isnan(high):
            return ""
        return f"[{self.text(low, signed=signed)}, {self.text(high, signed=signed)}]"


def _percent(name: str, label: str) -> Measure:
    return Measure(name, label, "%", 100.0, 1, "higher", most=1.0)


_KNOWN = {
    m.name: m
    for m in (
        _percent("ospa.share_under_1m", "scans with OSPA under 1 m"),
        Measure("ospa.mean_m", "OSPA mean", "m"),
        Measure("ospa.median_m", "OSPA median", "m"),
        Measure("gospa.mean_m", "GOSPA mean", "m"),
        Measure("gospa.localisation_m", "GOSPA, localisation", "m"),
        Measure("gospa.missed", "people missed per scan"),
        Measure("gospa.false", "false tracks per scan"),
        Measure("ospa2_m", "OSPA(2)", "m"),
        Measure("identity_switches", "identity switches"),
        Measure("fragmentations", "fragmentations"),
        _percent("share_held", "people held"),
        Measure("nees.position", "NEES of positions (consistent: 2)", better="neither"),
        Measure("nees.state", "NEES of states (consistent: 4)", better="neither"),
        _percent("recall", "detection recall"),
        _percent("precision", "detection precision"),
        Measure("disagreement_m", "disagreement of UAVs", "m", digits=4),
        Measure("bytes_per_scan_mean", "sent by a UAV per scan", "kB", 1e-3),
        Measure("bytes_per_scan_max", "sent by a UAV in one scan at most", "kB", 1e-3),
        Measure("bytes_total", "sent by all UAVs", "MB", 1e-6),
        Measure("plan_bytes_total", "plans sent by all UAVs", "kB", 1e-3),
        Measure("plan_rounds", "rounds of plans", digits=0),
        Measure("faults", "faults"),
        Measure("contacts", "contacts"),
        Measure("planning_s_per_decision", "planning per decision", "ms", 1000.0, 1),
        Measure("real_time_factor", "real-time factor", "", 1.0, 1, "higher"),
        Measure("wall_s", "wall time per mission", "s"),
        *(Measure(f"seconds.{stage}", f"time for {stage}", "s") for stage in STAGES),
    )
}
DEFAULT = ("ospa.share_under_1m", "ospa.mean_m", "ospa.median_m")
RUNTIME = ("planning_s_per_decision", "wall_s", "real_time_factor")
_ENDINGS: tuple[tuple[str, Measure], ...] = (
    ("_m", Measure("", "", "m")),
    ("_s", Measure("", "", "s")),
)


def measure(name: str) -> Measure:
    """How a metric is shown; of one not known here, what its name tells, and no way of it is better."""
    if name in _KNOWN:
        return _KNOWN[name]
    label = name.replace("_", " ").replace(".", ": ")
    unit = next((plain.unit for ending, plain in _ENDINGS if name.endswith(ending)), "")
    return Measure(name, label, unit, digits=3, better="neither", least=-math.inf)


def check(asked: Iterable[str]) -> None:
    """InputError where a metric is none that trials have; for before they are flown."""
    for name in asked:
        if name not in _KNOWN:
            raise InputError(f"--metric: {name!r} is unknown; {did_you_mean(name, _KNOWN)}")


def available(rows: Iterable[Row]) -> list[str]:
    """All metrics that any of the rows has: those known here in their order, then the others by name."""
    names = {name for row in rows for name in row.metrics}
    return [name for name in _KNOWN if name in names] + sorted(names - set(_KNOWN))


def chosen(rows: Sequence[Row], asked: Sequence[str]) -> list[Measure]:
    """The metrics asked for, or else the usual ones; InputError where no row has one."""
    there = available(rows)
    for name in asked:
        if name not in there and any(row.metrics for row in rows):
            raise InputError(f"--metric: {name!r} is unknown; {did_you_mean(name, there)}")
    usual = [name for name in DEFAULT if name in there] or there[:1] or DEFAULT[:1]
    return [measure(name) for name in dict.fromkeys(asked or usual)]
