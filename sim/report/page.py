"""`report.html`: a study on one page that needs nothing else, written for readers that did not run it."""

import base64
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from string import Template

from sim.report.figures.pictures import Picture


def page(title: str, sections: Sequence[tuple[str, str]]) -> str:
    """The page from its sections: heading and HTML of each; the first comes without a heading, before the contents."""
    (_, opening), *rest = sections
    names = [f"section-{i}" for i in range(1, len(rest) + 1)]
    links = "\n".join(f'<a href="#{n}">{escape(h)}</a>' for n, (h, _) in zip(names, rest, strict=True))
    parts = [f'<h2 id="{n}">{escape(h)}</h2>\n{text}' for n, (h, text) in zip(names, rest, strict=True)]
    body = "\n".join([opening, f"<nav>\n{links}\n</nav>", *parts])
    template, style = ((files("sim.report") / name).read_text(encoding="utf-8") for name in ("page.html", "page.css"))
    return Template(template).substitute(title=escape(title), style=style.rstrip(), body=body)


def figures(pictures: Sequence[Picture]) -> str:
    """Pictures inside the page, as SVG unless that is far larger."""
    return "\n".join(_figure(picture) for picture in pictures)


def _figure(picture: Picture) -> str:
    kind, data = ("svg+xml", picture.svg) if len(picture.svg) < 3 * len(picture.png) else ("png", picture.png)
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
    image = f'<img src="{source}" alt="{escape(picture.alt)}">'
    caption = f"<figcaption>{escape(picture.caption)}</figcaption>"
    return f"<h3>{escape(picture.title)}</h3>\n<figure>\n{image}\n{caption}\n</figure>"
