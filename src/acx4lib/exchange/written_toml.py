"""Nested tables as TOML text."""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

ROW = 5
"""Lists inside a list that stand on one line."""


def written(values: Mapping[str, Any], *, inline: str = "") -> str:
    """Return the TOML text of nested tables: those of flight.toml, or of a plan.

    Parameters
    ----------
    values : mapping
        Text, numbers, truth values, dates, lists of them, and tables of these.
    inline : str
        Name of the table whose tables are a line each.
    """
    return "\n".join(_lines(values, (), inline)).strip("\n") + "\n"


def _lines(table: Mapping[str, Any], keys: tuple[str, ...], inline: str) -> Iterator[str]:
    whole = keys[-1:] == (inline,)
    plain = {key: value for key, value in table.items() if whole or not isinstance(value, Mapping)}
    if keys and (plain or not table):
        yield ""
        yield f"[{'.'.join(map(_key, keys))}]"
    yield from (f"{_key(key)} = {_value(value)}" for key, value in plain.items())
    for key, value in table.items():
        if key not in plain:
            yield from _lines(value, (*keys, key), inline)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else _text(name)


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_key(key)} = {_value(one)}' for key, one in value.items())}}}"
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple):
        lines = (value[i : i + ROW] for i in range(0, len(value), ROW))
        return "[\n" + "".join(f"    {', '.join(map(_value, line))},\n" for line in lines) + "]"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, dt.date | dt.time):
        return value.isoformat()
    return json.dumps(value)
