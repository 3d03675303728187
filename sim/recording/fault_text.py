"""Faults as a recording keeps them: JSON text that is the same for the same mission."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace

import msgspec

from sim.sensing.fault import Fault
from tracking.plugins.containment import one_line

MOST = 1000  # faults that are kept; a planner may fail at every decision
LONGEST = 300  # characters of a message
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]{6,}\b")  # as in <object at 0x7f...>, which differs from process to process


def recorded(faults: Sequence[Fault]) -> str:
    """Faults as JSON text: a list of objects with `time` [s], `uav` (null: the whole team) and `message`.

    Messages become one line of printable characters, without addresses in memory, cut after `LONGEST`; of more than
    `MOST` faults the last that is kept tells how many more there are. `summary.json` has them all, and their traces,
    which name files and so differ from machine to machine.
    """
    kept = [replace(fault, message=one_line(_ADDRESS.sub("0x...", fault.message), LONGEST)) for fault in faults[:MOST]]
    if len(faults) > MOST:
        kept[-1] = Fault(kept[-1].time, None, f"{len(faults) - MOST + 1} more faults are not recorded")
    return json.dumps([{"time": float(f.time), "uav": f.uav, "message": f.message} for f in kept])


def read(text: str) -> tuple[Fault, ...]:
    """The faults of a recording's text, in order of time; none of an old recording's, "". ValueError if it is wrong."""
    if not text:
        return ()
    try:
        return msgspec.json.decode(text, type=tuple[Fault, ...])
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as error:
        raise ValueError(f"is no list of faults: {error}") from error
