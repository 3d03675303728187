"""Legends of Matplotlib's figures, as they are read."""


def words(figure, legend):
    """Labels of a legend row by row, each from left to right."""
    figure.draw_without_rendering()
    places = {text: text.get_window_extent() for text in legend.get_texts()}
    return [text.get_text() for text in sorted(places, key=lambda text: (-round(places[text].y0), places[text].x0))]
