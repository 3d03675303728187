"""Faults in the form of a recording: JSON text that is the same for the same mission."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace

import msgspec

from sim.sensing.fault import Fault
from tracking.errors import one_line

MOST = 1000  # number of faults that are kept; a planner may fail at every decision
LONGEST = 300  # characters of a message
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]{6,}\b")  # as in <object at 0x7f...>, which differs from process to process


def encode_faults(faults: Sequence[Fault]) -> str:
    """Faults as JSON text: a list of objects with `time` [s], `uav` (null: the whole team) and `message`.

    Messages become one line of at most `LONGEST` printable characters without memory addresses. If there are more than
    `MOST` faults, the last one that is kept says how many others there were. `summary.json` has all faults with their
    traces, which name files and therefore differ between machines.
    """
    kept = [replace(fault, message=one_line(_ADDRESS.sub("0x...", fault.message), LONGEST)) for fault in faults[:MOST]]
    if len(faults) > MOST:
        kept[-1] = Fault(kept[-1].time, None, f"{len(faults) - MOST + 1} more faults are not recorded")
    return json.dumps([{"time": float(f.time), "uav": f.uav, "message": f.message} for f in kept])


def decode_faults(text: str) -> tuple[Fault, ...]:
    """The faults in a recording's text, in order of time; ValueError if invalid."""
    try:
        return msgspec.json.decode(text, type=tuple[Fault, ...])
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        raise ValueError(f"is no list of faults: {error}") from error
