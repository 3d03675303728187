"""Elements of the report's page in HTML: facts, lists, paragraphs, commands and tables."""

import re
from collections.abc import Iterable, Sequence
from html import escape


def facts(pairs: Iterable[tuple[str, str]]) -> str:
    """Names and values; those without a value are left out."""
    lines = [f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in pairs if value]
    return "<dl>\n" + "\n".join(lines) + "\n</dl>"


def listed(lines: Iterable[str]) -> str:
    """Plain lines as a list."""
    return "<ul>\n" + "\n".join(f"<li>{escape(line)}</li>" for line in lines) + "\n</ul>"


def paragraph(text: str, kind: str = "") -> str:
    """A plain text."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def commanded(text: str) -> str:
    """A command line, which one click selects whole."""
    return f'<code class="command">{escape(text)}</code>'


def table(heads: Sequence[str], rows: Sequence[str], kind: str = "") -> str:
    """A table of rows that are HTML, under its headings."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "\n".join(_labelled(row, heads) for row in rows)
    text = f'<table class="{kind}"><thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table>'
    return f'<div class="wide">{text}</div>'


def _labelled(row: str, heads: Sequence[str]) -> str:
    """A row whose cells know their headings, for screens too narrow for columns."""
    names = iter(heads)
    return re.sub(r"<td\b", lambda _: f'<td data-head="{escape(next(names))}"', row)
