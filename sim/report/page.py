"""`report.html`: a study on one page that needs nothing else, written for readers that did not run it."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from string import Template

from sim.report.figures.pictures import Picture

_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<link rel="icon" href="data:,">
<title>$title</title>
<style>
$style
</style>
</head>
<body>
<main>
$body
</main>
</body>
</html>
""")
_STYLE = """:root { color-scheme: light;
  --ink: #282624; --soft: #66615a; --line: #ded8cc; --paper: #f8f5ed; --link: #005a8c; }
* { box-sizing: border-box; }
body { margin: 0; background: #fff; color: var(--ink); font: 16px/1.5 system-ui, "DejaVu Sans", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 28px 32px 80px; }
h1 { font-size: 28px; line-height: 1.2; margin: 0 0 6px; }
h2 { font-size: 21px; margin: 44px 0 10px; padding-top: 14px; border-top: 1px solid var(--line); }
h3 { font-size: 17px; margin: 26px 0 8px; }
p, ul { margin: 8px 0; max-width: 85ch; }
a { color: var(--link); }
nav { margin: 14px 0 0; display: flex; flex-wrap: wrap; gap: 4px 18px; }
.soft { color: var(--soft); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 14.5px; font-variant-numeric: tabular-nums; }
th, td { padding: 4px 14px 4px 0; text-align: right; vertical-align: baseline; white-space: nowrap; }
th:first-child, td:first-child, .left td, .left th { text-align: left; }
td.text { white-space: normal; overflow-wrap: anywhere; text-align: left; }
thead th { border-bottom: 2px solid var(--ink); font-weight: 600; }
tbody th { padding-top: 12px; font-weight: 600; text-align: left; }
tbody tr { border-bottom: 1px solid var(--line); }
.name { white-space: normal; overflow-wrap: anywhere; min-width: 14ch; max-width: 46ch; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 3px 22px; margin: 8px 0; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 14px 0 26px; } figure img { max-width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: 14.5px; max-width: 95ch; margin-top: 6px; }
code { font: 13.5px/1.45 ui-monospace, "DejaVu Sans Mono", monospace; }
code.command { display: block; background: var(--paper); border: 1px solid var(--line); border-radius: 4px;
  padding: 6px 10px; margin: 3px 0; user-select: all; white-space: pre-wrap; overflow-wrap: anywhere; }
.map { margin: 12px 0; scroll-margin-top: 16px; } .map:target { outline: 3px solid #e69f00; outline-offset: 5px; }
.failed { border-left: 4px solid #c8102e; padding-left: 12px; }
@media (max-width: 700px) {  /* a phone: each line of a table is a card, its headings beside the values */
  main { padding: 16px 16px 60px; overflow-wrap: anywhere; }
  dl { grid-template-columns: minmax(0, 1fr); } dd { margin-bottom: 6px; }
  .wide thead { display: none; }
  .wide table, .wide tbody, .wide tr, .wide th { display: block; }
  .wide td { display: flex; justify-content: space-between; gap: 14px; padding-right: 0; white-space: normal; }
  .wide td:empty { display: none; }
  .wide td::before { content: attr(data-head); color: var(--soft); text-align: left; }
  .wide td.name { max-width: none; font-weight: 600; } .wide td.name::before { content: none; }
}"""


def page(title: str, sections: Sequence[tuple[str, str]]) -> str:
    """The page from its sections: heading and HTML of each; the first comes without a heading, before the contents."""
    (_, opening), *rest = sections
    names = [f"section-{i}" for i in range(1, len(rest) + 1)]
    links = "\n".join(f'<a href="#{n}">{escape(h)}</a>' for n, (h, _) in zip(names, rest, strict=True))
    parts = [f'<h2 id="{n}">{escape(h)}</h2>\n{text}' for n, (h, text) in zip(names, rest, strict=True)]
    body = "\n".join([opening, f"<nav>\n{links}\n</nav>", *parts])
    return _PAGE.substitute(title=escape(title), style=_STYLE, body=body)


def figures(pictures: Sequence[Picture]) -> str:
    """Pictures inside the page, as SVG unless that is far larger."""
    return "\n".join(_figure(picture) for picture in pictures)


def _figure(picture: Picture) -> str:
    kind, data = ("svg+xml", picture.svg) if len(picture.svg) < 3 * len(picture.png) else ("png", picture.png)
    source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
    image = f'<img src="{source}" alt="{escape(picture.alt)}">'
    caption = f"<figcaption>{escape(picture.caption)}</figcaption>"
    return f"<h3>{escape(picture.title)}</h3>\n<figure>\n{image}\n{caption}\n</figure>"
