"""A drawing written shorter: the same marks in the same order, to a hundredth of a point.

Names that nothing refers to are left out, and groups that say nothing. What neighbours have in
common stands once, with a group around them. Paths are written relative to the last point.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from itertools import groupby, pairwise
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

SVG = "http://www.w3.org/2000/svg"
ET.register_namespace("", SVG)

GROUND = "patch_1"
"""Name of the sheet under a figure: a page takes it away."""

REFERENCE = re.compile(r"#([\w.-]+)")
FONT, SHORT = "DejaVuSans-", "D"
"""Begin of the names of letters, and what stands for it."""

COMMON = ("style", "clip-path")
"""Attributes that a group may have for what is in it."""

OF_GROUPS = re.compile(r"(?<!-)\bopacity")
"""In a style: what means another thing on a group than on each of its parts."""

JOINED = "stroke-linejoin: round"
"""What matplotlib's style sheet says of all elements, also of those of the page around."""

PLACE = re.compile(r"translate\((-?[\d.]+)[ ,]+(-?[\d.]+)\)")
STEP = re.compile(r"[A-Za-z]|-?\d*\.?\d+(?:e-?\d+)?")
POINTS = {"M": 1, "L": 1, "Q": 2, "C": 3}
"""How many points follow a letter of a path."""


def compact(root: Element) -> None:
    """Shorten a drawing.

    Parameters
    ----------
    root : Element
        As matplotlib draws it, without texts; it is changed.
    """
    _drop_styles(root)
    used = {name for element in root.iter() for name in _references(element)}
    for element in root.iter():
        element.text = element.tail = None
        if element.get("id") not in {*used, GROUND}:
            element.attrib.pop("id", None)
        for key, value in element.items():
            element.set(key, value.replace(FONT, SHORT) if key != "d" else path(value))
        _place(element)
    _group(root)


def _references(element: Element) -> Iterator[str]:
    for key, value in element.items():
        if key == "href" or "url(" in value:
            yield from REFERENCE.findall(value)


def _drop_styles(root: Element) -> None:
    """Take out style sheets: what they say stands in the outermost group."""
    for parent in root.iter():
        for child in [c for c in parent if c.tag == f"{{{SVG}}}style"]:
            parent.remove(child)
    for group in root.findall(f"{{{SVG}}}g"):
        group.set("style", JOINED)


def _place(element: Element) -> None:
    """Write where a letter stands in a line, in hundredths of its size, as whole numbers."""
    place = PLACE.fullmatch(element.get("transform", ""))
    if element.tag == f"{{{SVG}}}use" and place:
        del element.attrib["transform"]
        for key, number in zip("xy", place.groups(), strict=True):
            if round(float(number)):
                element.set(key, f"{float(number):.0f}")


# --- groups ----------------------------------------------------------------------------------


def _group(parent: Element) -> None:
    """Open groups that say nothing, and put one around neighbours that have all in common."""
    for child in parent:
        _group(child)
    children = [inside for child in parent for inside in _opened(child)]
    parent[:] = [part for _, run in groupby(children, _common) for part in _together([*run])]
    if len(parent) == 1 and parent.tag == parent[0].tag == f"{{{SVG}}}g" and _free(parent):
        (only,) = parent
        parent.attrib.update(only.attrib)
        parent[:] = [*only]


def _free(group: Element) -> bool:
    """Tell whether a group can have all that another one in it says."""
    return not ({*group[0].keys()} & {*group.keys()}) and "transform" not in group[0].attrib


def _opened(element: Element) -> list[Element]:
    """Return what stands for an element: of a group that says nothing, its parts."""
    empty = element.tag in {f"{{{SVG}}}g", f"{{{SVG}}}defs"} and not len(element)
    if empty:
        return []
    return [*element] if element.tag == f"{{{SVG}}}g" and not element.attrib else [element]


def _common(element: Element) -> tuple[str, ...]:
    """Return what an element may share with its neighbours, all empty where it is nothing."""
    found = tuple(element.get(key, "") for key in COMMON)
    moved = "transform" in element.attrib and "clip-path" in element.attrib
    named = "id" in element.attrib or element.tag == f"{{{SVG}}}clipPath"
    return ("", "") if moved or named or OF_GROUPS.search(found[0]) else found


def _together(run: list[Element]) -> list[Element]:
    """Return a group around elements that share something, or the elements."""
    shared = {key: value for key, value in zip(COMMON, _common(run[0]), strict=True) if value}
    if len(run) == 1 or not shared:
        return run
    for element in run:
        for key in shared:
            del element.attrib[key]
    group = Element(f"{{{SVG}}}g", shared)
    group.extend(inside for element in run for inside in _opened(element))
    return [group]


# --- paths -----------------------------------------------------------------------------------


def path(d: str) -> str:
    """Return the data of a path, relative to the last point, in hundredths that are not lost.

    Parameters
    ----------
    d : str
        Of the letters M, L, Q, C and z alone, as matplotlib writes them.
    """
    numbers, letter, last, start = [], "", (0, 0), (0, 0)
    written: list[str] = []
    for step in STEP.findall(d):
        if step in "zZ":
            written.append("z")
            last = start
        elif step.isalpha():
            letter = step
        else:
            numbers.append(round(100 * float(step)))
        if letter in POINTS and len(numbers) == 2 * POINTS[letter]:
            written.append(_step(letter, numbers, last))
            last = (numbers[-2], numbers[-1])
            start = last if letter == "M" else start
            letter, numbers = "L" if letter == "M" else letter, []
    return _joined(written)


def _step(letter: str, numbers: list[int], last: tuple[int, int]) -> str:
    """Return one step, relative to the last point."""
    if letter == "L" and numbers[1] == last[1]:
        return f"h{_number(numbers[0] - last[0])}"
    if letter == "L" and numbers[0] == last[0]:
        return f"v{_number(numbers[1] - last[1])}"
    parts = [_number(n - last[i % 2]) for i, n in enumerate(numbers)]
    text = parts[0]
    for before, part in pairwise(parts):
        text += part if part[0] == "-" or (part[0] == "." and "." in before) else f" {part}"
    return letter.lower() + text


@cache
def _number(hundredths: int) -> str:
    return re.sub(r"^(-?)0\.", r"\1.", f"{hundredths / 100:.2f}".rstrip("0").rstrip("."))


def _joined(steps: list[str]) -> str:
    """Return steps in a row; a letter that repeats is left out."""
    text = before = ""
    for step in steps:
        letter, numbers = step[0], step[1:]
        after = "l" if before == "m" else before
        if letter != after or letter in "mz":
            text += step
        else:
            text += numbers if numbers[0] == "-" else f" {numbers}"
        before = letter
    return text
