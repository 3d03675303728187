"""Texts of planners with options: "name(option=value, ...)"."""

from collections.abc import Mapping


def split_options(text: str) -> tuple[str, list[str]]:
    """Name and parts of "name(part, ...)"; commas in brackets or quotes separate nothing.

    If brackets or quotes do not match, all of the options are one part, which begins with a bracket.
    """
    name, _, rest = text.strip().partition("(")
    parts, depth, quote = [""], 0, ""
    for sign in rest.removesuffix(")"):
        if quote:
            quote = quote if sign != quote else ""
        elif sign in "'\"":
            quote = sign
        else:
            depth += (sign in "([{") - (sign in ")]}")
        if sign == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += sign
    if depth or quote:
        parts = [f"({rest}"]
    return name.strip(), [part.strip() for part in parts if part.strip()]


def with_options(planner: str, options: Mapping[str, str]) -> str:
    """The text of a planner with further options."""
    if not options:
        return planner
    name, parts = split_options(planner)
    return f"{name}({', '.join([*parts, *(f'{key}={value}' for key, value in options.items())])})"
