"""Files that are exported for another program, and their folder."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree as ET

from acx4lib.errors import OutputError
from acx4lib.results import own_folder
from acx4lib.results.whole_files import write_all
from acx4tools.exchange.lens import WORST_PX, Left, above

COMMAND = "acx4 export"
"""The command whose name marks the folders."""

STATEMENT = "export.md"

LARGEST_PX = 0.05
"""Largest difference between a lens and its refit in the other program."""

SIGMA = "standard deviations and covariance: parameters.csv and covariance.csv have them"
BODY = "boresight and lever arm: --to toml has them"
"""Sentences on parts that many formats cannot hold."""


@dataclass(frozen=True, kw_only=True)
class Taken:
    """Files for another program, and notes for their user.

    Attributes
    ----------
    files : mapping of str to str
        Contents by file below the folder.
    lenses : mapping of str to Left
        By camera, how far the lens of the other program is from the calibrated one.
    assumed, left_out : tuple of str
        Conventions of the files, and what they have no place for: a sentence each.
    without_lenses : Taken, optional
        What is worth having where a lens is too far: the files without lenses.
    """

    files: Mapping[str, str]
    lenses: Mapping[str, Left] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    without_lenses: Taken | None = None


def near(taken: Taken, allowed_px: float = LARGEST_PX) -> Taken:
    """Return an export if its lenses are near enough, else its part without lenses.

    Raises
    ------
    OutputError
        Where a lens differs by more than is allowed and nothing is worth having without.
    """
    try:
        _require_near(taken, allowed_px)
    except OutputError as error:
        if taken.without_lenses is None:
            raise
        less = taken.without_lenses
        return replace(less, left_out=(*less.left_out, f"lenses: {error}"))
    return taken


def _require_near(taken: Taken, allowed_px: float = LARGEST_PX) -> None:
    """Raise an OutputError where a lens differs by more than is allowed."""
    far = {
        name: refit
        for name, refit in taken.lenses.items()
        if not refit.largest_px <= (max(allowed_px, WORST_PX) if refit.returned else allowed_px)
    }
    if far:
        name, difference = max(far.items(), key=lambda item: item[1].largest_px)
        msg = (
            f"{name}: the other program's lens differs by {difference.largest_px:.3g} px somewhere "
            f"in the image, more than {allowed_px:g} px; --allow {above(difference.largest_px)} "
            "exports it nevertheless"
        )
        raise OutputError(msg)


def sentences(taken: Taken) -> tuple[str, ...]:
    """Return a sentence for each lens on its difference."""
    phrases = {
        False: "lens refitted over the whole image, off",
        True: "lens not estimated, so that it goes back as it came: the flight's camera is off",
    }
    return tuple(
        f"{name}: {phrases[refit.returned]} by at most {refit.largest_px:.4f} px, "
        f"rms {refit.rms_px:.4f} px"
        for name, refit in taken.lenses.items()
    )


def _statement(taken: Taken, *, title: str, origin: str) -> str:
    """Return the text of export.md: lenses, conventions, and the parts left out."""
    parts = {
        "Lenses": sentences(taken),
        "Conventions": taken.assumed,
        "Left out": taken.left_out,
    }
    lines = [f"# {title}", "", f"{origin[0].upper()}{origin[1:]}.", ""]
    for name, texts in parts.items():
        if texts:
            lines += [f"## {name}", "", *(f"- {text}" for text in texts), ""]
    return "\n".join(lines)


def write(taken: Taken, folder: Path, *, title: str, origin: str) -> None:
    """Write the files and export.md into a folder, all of them or none.

    Parameters
    ----------
    taken : Taken
    folder : Path
        New, empty, or written by an export before; then its files are replaced.
    title : str
    origin : str
        Where the calibration comes from, a sentence without its full stop.

    Raises
    ------
    OutputError
        Where the folder is somebody else's.
    """
    texts = {**taken.files, STATEMENT: _statement(taken, title=title, origin=origin)}
    with own_folder.claim(folder, command=COMMAND) as claimed:
        claimed.expect(texts)
        for name in texts:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_all({folder / name: text for name, text in texts.items()})
        claimed.remove([name for name in claimed.files if name not in texts])
        claimed.seal()


# --- Numbers, JSON and XML as text: numbers with all the digits that they have


def numbers(values: Iterable[float]) -> str:
    """Return numbers with blanks between them."""
    return " ".join(map(repr, map(float, values)))


def lines(texts: Iterable[str]) -> str:
    """Return texts, each with an end of line."""
    return "".join(f"{text}\n" for text in texts)


def as_json(value: object) -> str:
    """Return a value as JSON."""
    return json.dumps(value, indent=1, ensure_ascii=False) + "\n"


def add_numbers(element: ET.Element, name: str, values: Iterable[float]) -> None:
    """Put numbers as an element below another one."""
    ET.SubElement(element, name).text = numbers(values)


def as_xml(element: ET.Element) -> str:
    """Return an element with all below it as a document."""
    ET.indent(element)
    body = ET.tostring(element, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'
