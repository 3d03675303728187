"""Settings as msgspec's structs: types of numbers with bounds, and reading from plain data such as a TOML table."""

import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta, inspect

from tracking.errors import InputError, did_you_mean

DAY = 86_400.0  # s, longer than any mission
MOST_SCANS = 62  # most scans for which the bits of an integer can hold misses

# Bounds are far beyond any mission, but below the values that overflow or take forever. NaN is in no bounds.
Speed = Annotated[float, Meta(ge=0.01, le=100)]  # m/s
Time = Annotated[float, Meta(ge=0, le=DAY)]  # s
Density = Annotated[float, Meta(ge=1e-15, le=1000)]  # per m²
Probability = Annotated[float, Meta(ge=0, le=1)]
Expected = Annotated[float, Meta(ge=0, le=10_000)]  # number of trees or people
Scans = Annotated[int, Meta(ge=1, le=MOST_SCANS)]

_Struct = TypeVar("_Struct", bound=msgspec.Struct)


def read_settings(data: Mapping[str, Any], kind: type[_Struct]) -> _Struct:
    """Plain data as a struct; InputError begins with the dotted field, and names its value and what is allowed."""
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise InputError(_explain(str(error), data, kind)) from error


def _explain(message: str, data: Any, kind: type[msgspec.Struct]) -> str:  # noqa: ANN401 - plain data
    """A message of msgspec, "What is wrong - at `$.path`", with the field first, its value and the nearest names."""
    reason, _, path = message.partition(" - at `$")
    parts = re.findall(r"[\w-]+", path)
    value = data
    allowed = inspect.type_info(kind)
    for part in parts:
        value, allowed = value[int(part) if isinstance(value, list | tuple) else part], _type_of_part(allowed, part)
    field = ".".join(parts)
    if isinstance(allowed, inspect.StructType) and isinstance(value, Mapping):
        known = [f.encode_name for f in allowed.fields]
        if unknown := [key for key in value if key not in known]:
            return f"{'.'.join([*parts, unknown[0]])}: unknown key; {_suggest_key(unknown[0], field, known, kind)}"
        if missing := [f.encode_name for f in allowed.fields if f.required and f.encode_name not in value]:
            return f"{'.'.join([*parts, missing[0]])}: is missing, and has no default"
    if isinstance(allowed, inspect.LiteralType):
        reason = did_you_mean(str(value), map(str, allowed.values))
    reason = reason[0].lower() + reason[1:]
    if isinstance(value, Mapping):
        table = isinstance(allowed, inspect.VarTupleType)
        return (f"{field}: " if field else "") + reason + (f"; each of several is [[{field}]]" if table else "")
    return f"{field}: {value!r} is not allowed; {reason}"


def _type_of_part(whole: inspect.Type, part: str) -> inspect.Type:
    """The type of a field, or of an item at an index, given the type of the struct or tuple that contains it."""
    if isinstance(whole, inspect.StructType):
        found = next(field.type for field in whole.fields if field.encode_name == part)
        if not isinstance(found, inspect.UnionType):
            return found
        return next((one for one in found.types if isinstance(one, inspect.StructType)), found.types[0])
    if isinstance(whole, inspect.TupleType):
        return whole.item_types[int(part)]
    return whole.item_type if isinstance(whole, inspect.VarTupleType) else inspect.AnyType()


def _suggest_key(key: str, table: str, known: list[str], kind: type[msgspec.Struct]) -> str:
    """A hint for an unknown key: the same name in another table or, without one, the most similar `known` key."""
    same = [name for name in _list_keys(inspect.type_info(kind), "") if name.rpartition(".")[2] == key]
    if not same:
        return did_you_mean(key, known)
    return (f"allowed are {', '.join(known)}; " if table else "") + f"did you mean {' or '.join(same)}?"


def _list_keys(kind: inspect.Type, name: str) -> Iterator[str]:
    """Dotted names of all keys in the tables of a struct, and in the first of each list of tables."""
    if isinstance(kind, inspect.StructType):
        for field in kind.fields:
            yield f"{name}{field.encode_name}"
            yield from _list_keys(field.type, f"{name}{field.encode_name}.")
    if isinstance(kind, inspect.VarTupleType):
        yield from _list_keys(kind.item_type, f"{name}0.")
