"""Weights of the policy: their shapes, those that training begins with, and files of them."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from understory import Array

PAIR_FEATURES, PLACE_FEATURES = 27, 8
_POOLED, _HIDDEN = 24, 16
LEARNED = Path(__file__).with_name("weights.npz")


class Weights(NamedTuple):
    """A network that scores the moves of a UAV, one and the same for all UAVs; (outputs, inputs) each.

    What the first layer makes of a move and each track is summed over tracks; with the move's own features it is the
    input of the second layer, whose outputs are summed to the score.
    """

    pair: Array  # (24, 27)
    joint: Array  # (16, 24 + 8)
    score: Array  # (16,)
    linear: Array  # (24 + 8,): straight from the inputs of the second layer to the score


SHAPES: dict[str, tuple[int, ...]] = {
    "pair": (_POOLED, PAIR_FEATURES),
    "joint": (_HIDDEN, _POOLED + PLACE_FEATURES),
    "score": (_HIDDEN,),
    "linear": (_POOLED + PLACE_FEATURES,),
}


def drawn(seed: int) -> Weights:
    """Weights by chance, with which training begins."""
    rng = np.random.default_rng(seed)
    return Weights(*(rng.standard_normal(shape) / np.sqrt(shape[-1]) for shape in SHAPES.values()))


def load(path: Path) -> Weights:
    """Weights of a file; ValueError if it cannot be read or holds others."""
    try:
        with np.load(path, allow_pickle=False) as held:
            parts = {name: held[name].astype(float) for name in held.files}
    except FileNotFoundError:
        raise ValueError(f"weights: there is no file {path}") from None
    except Exception:  # of NumPy, of the archive, or of what stands in it
        raise ValueError(f"weights: {path} is no .npz file of numbers") from None
    if set(parts) != set(SHAPES):
        raise ValueError(f"weights: {path} holds {', '.join(parts)}; expected {', '.join(SHAPES)}")
    for name, part in parts.items():
        if part.shape != SHAPES[name]:
            raise ValueError(f"weights: {name} of {path} has the shape {part.shape}; expected {SHAPES[name]}")
        if not np.all(np.isfinite(part)):
            raise ValueError(f"weights: {name} of {path} has numbers that are not finite")
    return Weights(**parts)


def save(weights: Weights, path: Path) -> None:
    """Write weights as .npz, without a moment at which the file is not whole."""
    partial = path.with_name(f".{path.name}")
    with partial.open("wb") as file:
        np.savez(file, allow_pickle=False, **weights._asdict())
    partial.replace(path)
