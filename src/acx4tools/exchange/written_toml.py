"""Nested tables as TOML text, and values added to a text with its remarks."""

from __future__ import annotations

import datetime as dt
import json
import re
import tomllib
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


def added(text: str, values: Mapping[str, Any]) -> str:
    """Return a TOML text with values added; of two the new one is taken.

    Remarks stay. A key that stands there as a remark, ``# focal_mm = 74.0``, gets its value in
    that place.

    Parameters
    ----------
    text : str
        Valid TOML.
    values : mapping
        As `written` takes them.
    """
    both = _merged(tomllib.loads(text), values)
    if "#" in text:
        sections = _sections(text)
        _set(sections, (), values)
        edited = "\n".join(line for section in sections.values() for line in section) + "\n"
        try:
            if tomllib.loads(edited) == both:
                return edited
        except tomllib.TOMLDecodeError:  # a form that is not edited line by line
            pass
    return written(both)


def _merged(before: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    both = dict(before)
    for key, value in new.items():
        old = before.get(key)
        if isinstance(value, Mapping) and isinstance(old, Mapping):
            both[key] = _merged(old, value)
        else:
            both[key] = value
    return both


def _sections(text: str) -> dict[str, list[str]]:
    """Return the lines of each table, its header the first of them, by headers; one has none."""
    sections: dict[str, list[str]] = {"": []}
    header = ""
    for line in text.rstrip("\n").split("\n"):
        if line.lstrip().startswith("["):
            header = _bare(line)
            if header in sections:  # a table of an array, or a list in a list
                header += f"#{len(sections)}"
        sections.setdefault(header, []).append(line)
    return sections


def _set(sections: dict[str, list[str]], keys: tuple[str, ...], values: Mapping[str, Any]) -> None:
    """Set the values of a table, and of those in it, line by line."""
    header = f"[{'.'.join(map(key_of, keys))}]" if keys else ""
    own = {key: value for key, value in values.items() if not isinstance(value, Mapping)}
    if own and header not in sections:
        sections[next(reversed(sections))].append("")
        sections[header] = [header]
    for key, value in own.items():
        _set_line(sections[header], min(len(keys), 1), key, value_of(value))
    for key, value in values.items():
        if isinstance(value, Mapping):
            _set(sections, (*keys, key), value)


def _set_line(lines: list[str], begin: int, key: str, value: str) -> None:
    """Set a value in the lines of a table, those before `begin` left out."""
    form = re.compile(rf"(?P<off>#\s*)?{re.escape(key_of(key))}\s*=[^#]*(?P<remark>#.*)?")
    end = len(lines)
    found = [(k, match) for k in range(begin, end) if (match := form.fullmatch(lines[k].strip()))]
    if found:
        k, match = min(found, key=lambda one: bool(one[1]["off"]))
        remark = f"  {match['remark']}" if match["remark"] else ""
        lines[k] = f"{key_of(key)} = {value}{remark}"
        return
    while end > begin and not lines[end - 1].strip():
        end -= 1
    lines.insert(end, f"{key_of(key)} = {value}")


def _bare(line: str) -> str:
    return line.partition("#")[0].strip()


def _lines(table: Mapping[str, Any], keys: tuple[str, ...], inline: str) -> Iterator[str]:
    whole = keys[-1:] == (inline,)
    plain = {key: value for key, value in table.items() if whole or not isinstance(value, Mapping)}
    if keys and (plain or not table):
        yield ""
        yield f"[{'.'.join(map(key_of, keys))}]"
    yield from (f"{key_of(key)} = {value_of(value)}" for key, value in plain.items())
    for key, value in table.items():
        if key not in plain:
            yield from _lines(value, (*keys, key), inline)


def key_of(name: str) -> str:
    """Return a key as it stands in TOML."""
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else _text(name)


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def value_of(value: Any) -> str:
    """Return a value as it stands in TOML."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key_of(key)} = {value_of(one)}' for key, one in value.items())}}}"
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple):
        lines = (value[i : i + ROW] for i in range(0, len(value), ROW))
        return "[\n" + "".join(f"    {', '.join(map(value_of, line))},\n" for line in lines) + "]"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(value_of, value))}]"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, dt.date | dt.time):
        return value.isoformat()
    return json.dumps(value)
