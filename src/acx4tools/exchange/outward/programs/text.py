"""Numbers, JSON and XML as text: numbers with all the digits that they have."""

from __future__ import annotations

import json
from collections.abc import Iterable
from xml.etree import ElementTree as ET


def numbers(values: Iterable[float]) -> str:
    """Return numbers with blanks between them."""
    return " ".join(map(repr, map(float, values)))


def lines(texts: Iterable[str]) -> str:
    """Return texts, each with an end of line."""
    return "".join(f"{text}\n" for text in texts)


def as_json(value: object) -> str:
    """Return a value as JSON."""
    return json.dumps(value, indent=1, ensure_ascii=False) + "\n"


def write(element: ET.Element, name: str, values: Iterable[float]) -> None:
    """Put numbers as an element below another one."""
    ET.SubElement(element, name).text = numbers(values)


def as_xml(element: ET.Element) -> str:
    """Return an element with all below it as a document."""
    ET.indent(element)
    body = ET.tostring(element, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'
