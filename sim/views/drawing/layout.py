"""Layout of a video frame: the map and camera tiles."""

import math
from dataclasses import dataclass

GAP = 10


@dataclass(frozen=True)
class Box:
    """A rectangle of pixels."""

    x: int
    y: int
    width: int
    height: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the rectangle in an image."""
        return slice(self.y, self.y + self.height), slice(self.x, self.x + self.width)


@dataclass(frozen=True)
class Parts:
    """Boxes of the shown parts of a film: the map, and tiles by UAV."""

    map: Box | None
    tiles: dict[int, Box]


def arrange_parts(panel: Box, aspect: float, uavs: int, layout: str) -> Parts:
    """Boxes of a layout: map+cameras, map, cameras, or for example uav1 for one large camera beside the map."""
    if layout == "cameras":
        return Parts(None, dict(enumerate(_make_grid(panel, uavs))))
    if layout.startswith("uav"):
        side = min(panel.height, 2 * panel.width // 3)
        room = Box(panel.x, panel.y, panel.width - side - GAP, panel.height)
        return Parts(_fit(room, aspect), {int(layout[3:]): Box(panel.x + panel.width - side, panel.y, side, side)})
    if layout == "map":
        return Parts(_fit(panel, aspect), {})
    return _arrange(panel, aspect, uavs)


def _make_grid(panel: Box, tiles: int) -> list[Box]:
    """Square tiles of the largest possible size, in rows in the middle of the panel."""

    def side(columns: int) -> int:
        rows = math.ceil(tiles / columns)
        return min((panel.width + GAP) // columns, (panel.height + GAP) // rows) - GAP

    columns = max(range(1, tiles + 1), key=side)
    edge, rows = side(columns), math.ceil(tiles / columns)
    pitch = edge + GAP
    top = panel.y + (panel.height - rows * pitch + GAP) // 2
    boxes = []
    for i in range(tiles):
        row, column = divmod(i, columns)
        in_row = min(columns, tiles - row * columns)
        left = panel.x + (panel.width - in_row * pitch + GAP) // 2
        boxes.append(Box(left + column * pitch, top + row * pitch, edge, edge))
    return boxes


def _arrange(panel: Box, aspect: float, tiles: int) -> Parts:
    """The arrangement with the largest map (width over height `aspect`) and square tiles; the map counts more.

    Tiles are in columns right of the map or in rows below it, whichever is better; right if both are equal.
    """
    options = []
    for below in (False, True):
        along, across = (panel.width, panel.height) if below else (panel.height, panel.width)
        for lines in range(1, tiles + 1):
            # Tiles have to fit along their lines, and to leave the map at least a third of the panel across them.
            most = min((along + GAP) // math.ceil(tiles / lines), int(across * 2 / 3) // lines) - GAP
            for side in range(40, most + 1, 4):
                options.append(_place_tiles(panel, aspect, tiles=tiles, lines=lines, side=side, below=below))

    def merit(parts: Parts) -> float:
        assert parts.map is not None
        return float(parts.map.width * parts.map.height * (tiles * parts.tiles[0].width ** 2) ** 0.75)

    return max(options, key=merit)


def _place_tiles(panel: Box, aspect: float, *, tiles: int, lines: int, side: int, below: bool) -> Parts:
    """The map with tiles in so many lines: rows below it, or columns right of it."""
    per_line, pitch = math.ceil(tiles / lines), side + GAP
    columns, rows = (per_line, lines) if below else (lines, per_line)
    width, height = columns * pitch, rows * pitch
    if below:
        room = Box(panel.x, panel.y, panel.width, panel.height - height)
        left, top = panel.x + (panel.width - width + GAP) // 2, panel.y + room.height + GAP
    else:
        room = Box(panel.x, panel.y, panel.width - width, panel.height)
        left, top = panel.x + room.width + GAP, panel.y + (panel.height - height + GAP) // 2
    cells = [divmod(i, columns) for i in range(tiles)]
    boxes = [Box(left + column * pitch, top + row * pitch, side, side) for row, column in cells]
    return Parts(_fit(room, aspect), dict(enumerate(boxes)))


def _fit(room: Box, aspect: float) -> Box:
    """The largest box with this aspect in the middle of the room."""
    width = min(room.width, max(round(room.height * aspect), 1))
    height = min(room.height, max(round(width / aspect), 1))
    return Box(room.x + (room.width - width) // 2, room.y + (room.height - height) // 2, width, height)
