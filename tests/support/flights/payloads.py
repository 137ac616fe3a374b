"""Names that would do something wherever a name is taken for markup.

Every one holds its own mark, ``zq`` and two digits, in the part that would come alive: a page that
has the mark anywhere but in the whole name, as text, has interpreted it.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from acx4files.flight.problems import SHOWN
from support.flights import pictured

NAMES = {
    "jinja": "{{ cycler.__init__.__globals__.os.system('touch PWNED-zq01') }}",
    "slash and mathematics": "Phase $zq02_x$ 150MP/50mm",
    "a method's key": "single_step/heads/bundle/zq03",
    "img": "<img src=zq04 onerror=window.pwned=4>",
    "script": "<script>window.pwned='zq05'</script>",
    "image": "![zq06](http://zq06.example/a.png)",
    "link": "[zq07](javascript:window.pwned='zq07')",
    "bare link": "https://zq09.example/ www.zq09.example zq09@zq09.example",
    "tex": r"$\input{zq10}$",
    "backticks": "`zq13` ``zq13`",
    "directive": "```{eval-rst} .. raw:: html zq15",
    "include": "```{include} /etc/passwd zq16",
    "role": "{math}`zq17` {ref}`zq17` {download}`../conf.py <zq17>`",
    "pipe": "a | zq19 | b \\| c",
    "html comment": "<!-- zq25 -->",
    "entities": "&lt;b&gt;zq26&lt;/b&gt; &#36;x&#36; &copy;",
    "format": "{} {0} {name} zq27 %s %(x)s %n",
    "path": "../../zq28/../x",
    "device": "CON",
    "quotes": "'zq30' \"quoted\" ''twice'' \"\"",
    "rich": "[red]zq31[/red] [link=http://zq31]x[/link] \\[b]",
    "emphasis": "*zq32* **zq32** _zq32_ ~~zq32~~ ^zq32^",
    "heading": "# zq33",
    "emoji": "zq37 \N{GRINNING FACE}\N{ZERO WIDTH JOINER}\N{WOMAN} :smile:",
    "right to left": "zq38 שלום العربية (1)",
    "spaces": "  zq40   twice  ",
    "substitution": "|zq41| {{zq41}} {% raw %}zq41{% endraw %}",
    "very long": "zq46" + 60 * "W" + "<i>" + 60 * "M",
    "heading of a column": "Parameter",
    "missing": "nan",
    "number": "1.0",
    "svg": "]]>--><svg onload=window.pwned='zq53'>",
    "iframe": "<iframe srcdoc='<script>window.pwned=56</script>' name=zq56>",
    "shell": "$(touch PWNED-zq58) `touch PWNED-zq58`; touch PWNED-zq58",
    "comma": 'a,"zq60",b;c',
}
"""By what they try."""

MARK = re.compile(r"zq\d\d")


def marks(text: str) -> list[str]:
    """Return the marks of a text in their order."""
    return MARK.findall(text)


# --- the small flight with pixels, every name of it a payload of another kind ------------------


FOLDER = "{{ 7 * 7 }} $zq70$ <b> `zq70` [red]"
"""The name of the flight's folder."""

CHOSEN = {
    "camera": {"CAM": "slash and mathematics", "LEFT": "img", "RIGHT": "jinja"},
    "strip": {"1": "a method's key", "2": "role"},
    "exposure": {"E0": "path", "E1": "directive", "E2": "script", "E3": "emoji", "E4": "spaces"},
    "point": {"G0": "heading of a column", "G1": "missing", "G2": "number", "G3": "right to left"},
    "image": {},
}
"""Which payload some names become; the others follow in the order of `payloads.NAMES`."""

FLIGHT, FILE = NAMES["include"], NAMES["svg"]
"""The name of the flight, and of a table in its folder that is not of it."""

BLOCKS = ("heads", "calibration", "validation")
TOML = """
[apriori]
image_point_px = 0.1

[stages.mounting]
estimate = ["xp_mm", "yp_mm", "k1"]
gnss = ["drift"]
"""


@dataclass(frozen=True, kw_only=True)
class Written:
    """A flight on disk, what its names have become by column and old name, columns not read."""

    path: Path
    names: dict[str, dict[str, str]]
    columns: list[str]


def write(folder: Path) -> Written:
    """Write the flight; everything in it is accepted."""
    path = pictured.write_flight(folder / FOLDER, blocks=BLOCKS, mounted=("CAM", "LEFT"))
    files = [*path.glob("*/*.csv"), path / "control_points.csv"]
    tables = {file: pd.read_csv(file, dtype=str, keep_default_na=False) for file in files}
    names, columns = _renamed(list(tables.values()))
    left = list(columns)  # a table's first ones are named in notes, the others counted
    for file, table in tables.items():
        if file == path / "calibration" / "image_points.csv":
            table.loc[5, "col_px"] = str(float(table.loc[5, "col_px"]) + 40)  # a gross error
        if "file" in table:
            table["file"] = [_moved(path / "heads", old, names["image"]) for old in table["file"]]
        for column in set(names) & set(table):
            table[column] = table[column].map(names[column])
        here = [left.pop(0) for _ in range(min(SHOWN, len(left)))]
        table[here] = "x"
        table.to_csv(file, index=False)
    _write_toml(path / "flight.toml", names["camera"])
    (path / f"{FILE.replace('/', ' ')}.csv").write_text("x\n")
    return Written(path=path, names=names, columns=columns)


def _renamed(tables: list[pd.DataFrame]) -> tuple[dict[str, dict[str, str]], list[str]]:
    """Return the new names, no two of the flight the same, and payloads for columns."""
    names = {c: {o: NAMES[k] for o, k in own.items()} for c, own in CHOSEN.items()}
    taken = {FLIGHT, FILE, *(name for own in names.values() for name in own.values())}
    free = [name for name in NAMES.values() if name not in taken]
    columns = [free.pop() for _ in range(4)]
    for column, own in names.items():
        every = dict.fromkeys(name for t in tables if column in t for name in t[column])
        for old in every:
            if old not in own:
                own[old] = free.pop(0) if free else f"{old} zq99 <i>$"
    return names, columns


def _moved(folder: Path, file: str, images: dict[str, str]) -> str:
    """Rename a picture as its image, where a file may be called so."""
    if not file:
        return ""
    new = f"images/{images[Path(file).stem].replace('/', ' ')[:80]}.tif"
    (folder / file).rename(folder / new)
    return new


def _write_toml(path: Path, cameras: dict[str, str]) -> None:
    text = path.read_text()
    for old, new in cameras.items():
        text = text.replace(f"[cameras.{old}]", f"[cameras.{json.dumps(new)}]")
        text = text.replace(f'"{old}"', json.dumps(new))
    path.write_text(text.replace('"small"', json.dumps(FLIGHT)) + TOML)
