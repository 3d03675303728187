"""PyBullet's OpenGL renderer without a display (EGL): its trial and its start.

Facts about pybullet 3.2.7: if the plug-in cannot start, it ends the process; a trial therefore runs in another one. The
plug-in prints to standard output. If two clients are open, one shows the other's bodies. Images are no larger than the
plug-in's window. Bodies with the same mesh share its scale and transparency and so cannot be hidden one by one.
"""

import functools
import importlib.util
from collections.abc import Sequence
from dataclasses import replace

from sim.world.engine import explain_failure, pybullet, silence_c_code
from tracking.errors import InputError
from tracking.geometry.visibility import Forest, Tree

MOST_PIXELS = 768  # along each edge; the height of the plug-in's window
_PLUGIN = "_eglRendererPlugin"
_TRIAL = f"""
import sys, pybullet as p
client = p.connect(p.DIRECT)
assert p.loadPlugin(sys.argv[1], {_PLUGIN!r}, physicsClientId=client) >= 0
p.getCameraImage(16, 16, renderer=p.ER_BULLET_HARDWARE_OPENGL, physicsClientId=client)
p.disconnect(client)
"""
_open: set[int] = set()


def connect(pixels: int, trees: Sequence[Tree]) -> int:
    """A client with the OpenGL renderer, for images of up to `pixels` along an edge and trees of equal size.

    InputError if the images are too large, trees are porous or differ in size, or the renderer cannot start.
    """
    if pixels > MOST_PIXELS:
        finer = "images through lenses are drawn 1.5 to 3 times as fine"
        raise InputError(f"uavs.pixels: {pixels} is not allowed with 'egl'; expected at most {MOST_PIXELS}; {finer}")
    if Forest(tuple(trees)).is_porous:
        raise InputError("sensing.renderer: 'egl' draws opaque trees only (trees.leaf_area_density); allowed is tiny")
    sizes = len({replace(tree, x=0.0, y=0.0) for tree in trees})
    if sizes > 1:
        limit = f"'egl' draws trees of one size only, not of {sizes} (trees.largest_radius, trees.height or trees.file)"
        raise InputError(f"sensing.renderer: {limit}; allowed is tiny")
    reason = explain_refusal()
    if reason:
        raise InputError(f"sensing.renderer: 'egl' cannot start here ({reason}); allowed is tiny")
    if _open:
        raise RuntimeError("EGL renders one world at a time: close the other one first")
    client = int(pybullet.connect(pybullet.DIRECT))
    with silence_c_code():
        pybullet.loadPlugin(_find_plugin(), _PLUGIN, physicsClientId=client)
        for _ in range(2):  # the plug-in prints at the first and the second image
            pybullet.getCameraImage(16, 16, renderer=pybullet.ER_BULLET_HARDWARE_OPENGL, physicsClientId=client)
    _open.add(client)
    return client


def disconnect(client: int) -> None:
    """Close a client of `connect`."""
    _open.discard(client)
    with silence_c_code():
        pybullet.disconnect(physicsClientId=client)


@functools.lru_cache(maxsize=1)
def explain_refusal() -> str:
    """Reason why the plug-in cannot start here; empty if it can."""
    plugin = _find_plugin()
    if not plugin:
        return "this PyBullet has no plug-in eglRenderer"
    return explain_failure("OpenGL", _TRIAL, plugin)


def _find_plugin() -> str:
    found = importlib.util.find_spec("eglRenderer")
    return (found.origin or "") if found else ""
