"""Colours (RGB) of videos and figures; colours with a meaning are safe for colour-blind viewers (Okabe-Ito)."""

Colour = tuple[int, int, int]

PAPER: Colour = (248, 245, 237)
PANEL: Colour = (255, 254, 250)
INK: Colour = (40, 38, 36)
FAINT: Colour = (150, 145, 136)
SOFT: Colour = (102, 97, 90)  # of the page's text that steps back, for which FAINT is too light
LINE: Colour = (222, 216, 204)
CANOPY: Colour = (120, 171, 112)
CANOPY_EDGE: Colour = (88, 138, 84)
TRUNK: Colour = (104, 74, 48)
ALARM: Colour = (200, 16, 46)
DETECTION: Colour = (240, 228, 66)

BLUE: Colour = (0, 114, 178)
ORANGE: Colour = (230, 159, 0)
PURPLE: Colour = (204, 121, 167)
SKY: Colour = (86, 180, 233)
VERMILLION: Colour = (213, 94, 0)

VIOLET: Colour = (94, 60, 153)
BROWN: Colour = (140, 81, 10)

# Colours of states on the page, in the timeline, the film and Rerun. UAVs that see a person have their own colours.
HIDDEN = CANOPY
OUT_OF_VIEW = LINE
HELD = INK
HELD_BY_SOME = FAINT
LOST = ALARM
NOT_FOUND_YET: Colour = (238, 170, 160)
OFF: Colour = (250, 230, 110)  # from the track, whose ellipse still has the person
FALSE: Colour = (136, 34, 85)
# Colours by name of `HOLDS`, in the same order.
HOLD_COLOURS: dict[str, Colour] = {
    "absent": FAINT,
    "not found yet": NOT_FOUND_YET,
    "lost": LOST,
    "off the track": OFF,
    "held by some": HELD_BY_SOME,
    "held": HELD,
}
UNHELD_COLOURS = {name: HOLD_COLOURS[name] for name in ("lost", "not found yet")}

UAV_COLOURS = (BLUE, ORANGE, PURPLE, SKY, VIOLET, BROWN)
# Lengths [pixel] of dashes and gaps of the lines of each six UAVs, which have the same colours; () is a whole line.
UAV_DASHES: tuple[tuple[int, ...], ...] = ((), (9, 5), (2, 5), (9, 4, 2, 4), (16, 5, 2, 5))
UNSEEN, UNSEEN_SHARE = FAINT, 0.25  # of ground that a UAV has not seen yet, and how much of that covers the ground
BELIEVED = (3, 3)  # dashes of the thin outline of the field of view that a UAV believes it has
# Darker than most colours of UAVs, so that tracks are recognised on paper, under canopies and in camera tiles.
TRACK_COLOURS = (VERMILLION, (136, 34, 85), (51, 34, 136), (0, 98, 104), (112, 92, 0))


def uav_colour(uav: int) -> Colour:
    """One of six colours; UAVs of one colour have lines with different dashes."""
    return UAV_COLOURS[uav % len(UAV_COLOURS)]


def uav_dashes(uav: int) -> tuple[int, ...]:
    """Dashes of the lines of a UAV, one of `UAV_DASHES`; from the 31st UAV on, its number alone identifies it."""
    return UAV_DASHES[uav // len(UAV_COLOURS) % len(UAV_DASHES)]


def track_colour(track: int) -> Colour:
    """One of five colours; the number beside it identifies the track."""
    return TRACK_COLOURS[track % len(TRACK_COLOURS)]


def format_css(colour: Colour) -> str:
    """A colour in CSS."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def lighten(colour: Colour) -> Colour:
    """The colour, lightened so that it is legible on a dark background."""
    return mix((255, 255, 255), colour, 0.45)


def pale(colour: Colour) -> Colour:
    """The colour for a weaker case of its state: shown but not detected, or a duplicate."""
    return mix(colour, PANEL, 0.3)


def mix(colour: Colour, other: Colour, weight: float) -> Colour:
    """A mixture of two colours; `weight` is the share of the first."""
    red, green, blue = (round(weight * a + (1 - weight) * b) for a, b in zip(colour, other, strict=True))
    return red, green, blue
