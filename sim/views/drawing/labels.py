"""Names in an image, placed clear of one another and of the marks."""

import numpy as np

from sim.views.drawing.lettering import TextStyle, measure_width, write
from sim.views.drawing.strokes import draw_line
from sim.views.palette import INK
from tracking.numerics.arrays import Array, Image

# Sides of a mark at which a name may stand, as steps to the right and down.
_SIDES = np.array([(1.0, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, -1), (1, 1), (-1, 1)])
# Sides of the top left corner of a view at which no edge of the view crosses the name; then the corners.
_OUTSIDE = np.array([(1.0, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)])
_CORNERS = np.array([(-1.0, -1), (1, -1), (-1, 1), (1, 1)])
_VEIL = 0.65  # opacity of the image behind a name
_GAP = 14.0  # pixels, distance from the mark
_FARTHER = np.array([0.0, 16.0, 36.0, 61.0])  # pixels, added to the distance in crowded places
_LITTLE = 20.0  # pixels that a name which is not needed may cover
_CLOSE = 1.0  # pixels, distance from the corner of a view


class Labels:
    """Placement of names beside the marks of one RGB image; marks have to be reserved before names are put."""

    def __init__(self, image: Image, *, veil: bool = True) -> None:
        """Begin without marks; `veil` fades the image behind names, for images that are full of detail."""
        self._image = image
        self._veil = veil
        self._limits = np.array([0.0, 0.0, image.shape[1], image.shape[0]])
        self._taken = np.zeros((0, 4))  # left, top, right, bottom

    def reserve(self, centres: Array, reach: float) -> None:
        """Keep names off squares around marks at pixels (2,) or (N, 2)."""
        self._take(np.concatenate([centres - reach, centres + reach], axis=-1))

    def put(
        self,
        text: str,
        anchor: Array,
        style: TextStyle,
        *,
        gap: float = _GAP,
        sides: Array = _SIDES,
        needed: bool = True,
    ) -> None:
        """Write a name where it covers least: `gap` pixels from its mark, or farther with a line to the mark.

        sides (N, 2): allowed sides of the mark, as steps to the right and down. needed: False to leave out a name for
        which there is no room beside its mark.
        """
        farther, covered, box = self._place(_measure(text, style), anchor, gap, sides)
        if not needed and (farther or covered > _LITTLE):
            return
        if farther:
            end = np.clip(anchor, box[:2], box[2:])
            line = np.array([anchor + 0.7 * _GAP * (end - anchor) / np.hypot(*(end - anchor)), end])
            draw_line(self._image, line, style.halo or INK, thickness=3)
            draw_line(self._image, line, style.colour)
        if style.halo is not None and self._veil:
            left, top, right, bottom = np.round(box).clip(0).astype(int).tolist()
            part = self._image[top:bottom, max(left - 3, 0) : right + 3]
            part[:] = part * np.float32(1 - _VEIL) + np.array(style.halo, dtype=np.float32) * np.float32(_VEIL) + 0.5
        write(self._image, text, (float(box[0]), float(box[1] + box[3]) / 2), style)
        self._take(box)

    def put_outside(self, text: str, view: Array, style: TextStyle, *, others: Array) -> None:
        """Write the name of a view outside it, at the corner at which it overlaps other views least.

        view (4,) and others (N, 4): left, top, right, bottom.
        """
        sides = _OUTSIDE[:, None] * -_CORNERS  # (5, 4, 2), of each corner
        corners = (view[:2] + view[2:] + _CORNERS * (view[2:] - view[:2])) / 2
        boxes = _make_box(corners, _measure(text, style), _CLOSE, sides)
        costs = np.round(self._beyond(boxes) + _compute_overlap(boxes[:, :, None], others).sum(axis=2))
        at = int(costs.argmin()) % len(_CORNERS)
        best = sides[costs[:, at] == costs.min(), at]
        self.put(text, corners[at], style, gap=_CLOSE, sides=best)

    def _take(self, boxes: Array) -> None:
        self._taken = np.vstack([self._taken, boxes])

    def _place(self, size: Array, anchor: Array, gap: float, sides: Array) -> tuple[bool, float, Array]:
        """Where a name covers least: True if farther from its mark than the gap, pixels covered, and its box (4,)."""
        distances = gap + _FARTHER
        boxes = _make_box(anchor, size, distances[:, None, None], sides).reshape(-1, 4)
        low, high = boxes.min(axis=0)[:2], boxes.max(axis=0)[2:]
        near = self._taken[((self._taken[:, :2] < high) & (self._taken[:, 2:] > low)).all(axis=1)]
        inside = (low >= self._limits[:2]).all() and (high <= self._limits[2:]).all()
        if inside and not len(near):
            return False, 0.0, boxes[0]
        covered = _compute_overlap(boxes, near[:, None]).sum(axis=0)
        covered += 0.0 if inside else 3.0 * self._beyond(boxes)
        best = int((10.0 * covered.reshape(-1, len(sides)) + distances[:, None]).argmin())
        return best >= len(sides), float(covered[best]), boxes[best]

    def _beyond(self, boxes: Array) -> Array:
        """Number of pixels of boxes (..., 4) beyond the image."""
        return _compute_overlap(boxes, boxes) - _compute_overlap(boxes, self._limits)


def _measure(text: str, style: TextStyle) -> Array:
    """Width and height of a name."""
    return np.array([measure_width(text, style), style.size + 4.0])


def _make_box(anchor: Array, size: Array, gap: float | Array, side: Array) -> Array:
    """Left, top, right, bottom (..., 4) of a text with a size (2,) beside its mark; marks and sides (..., 2)."""
    middle = anchor + side * (gap + size / 2)
    return np.concatenate([middle - size / 2, middle + size / 2], axis=-1)


def _compute_overlap(one: Array, other: Array) -> Array:
    """Number of pixels that boxes (..., 4) have in common with others."""
    across = np.minimum(one[..., 2], other[..., 2]) - np.maximum(one[..., 0], other[..., 0])
    down = np.minimum(one[..., 3], other[..., 3]) - np.maximum(one[..., 1], other[..., 1])
    return np.asarray(np.maximum(across, 0.0) * np.maximum(down, 0.0))
