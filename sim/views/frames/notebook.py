"""Pictures of a recording as Matplotlib figures, which notebooks show."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sim.facts.rerender import Rerenderer
from sim.mission.recording import Recording
from sim.views.drawing.map_view import MapView
from sim.views.drawing.plots import ShownFigure
from sim.views.frames.frame_panels import draw_frame_page
from sim.views.scene import make_scene, measure_map
from tracking.numerics.arrays import Image, Indices

_MAP = 900  # pixels, width of the map


def make_map_figure(recording: Recording, k: int, holds: Indices) -> Figure:
    """The map at scan k, with trails of the last seconds; its axes are in metres. holds (M,): states of `Holding`."""
    scenario = recording.setting
    width, height = measure_map(scenario)
    size = (_MAP, round(_MAP / (width / height)))
    view = MapView(scenario, recording.forest, size, recording.believed_forest)
    edges = np.array([(0, 0), size]) - 0.5  # edges of the first and the last pixel, whose centres are integers
    (left, top), (right, bottom) = (edges - np.array(size) / 2) / view.scale
    image, _ = view.draw(make_scene(recording, k, holds))
    return _make_picture(image, (left, right, -bottom, -top))


def make_frame_figure(recording: Recording, k: int, uav: int) -> Figure:
    """The annotated image of a UAV's camera at scan k, rendered again."""
    with Rerenderer(recording) as again:
        return _make_picture(draw_frame_page(again, k, uav, size=640))


def _make_picture(image: Image, extent: tuple[float, float, float, float] | None = None) -> Figure:
    """A figure with the pixels of an image (H, W, 3) and its size; `extent` as in Matplotlib."""
    height, width = image.shape[:2]
    figure = ShownFigure(figsize=(width / 100, height / 100), dpi=100)
    FigureCanvasAgg(figure)  # whose pixels can be asked for
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(image, interpolation="none", aspect="auto", extent=extent)
    axes.autoscale(False)  # whatever else is drawn
    axes.set_axis_off()
    return figure
