"""The common style of all figures: palette, lines, type, and small shared parts.

Every figure is made inside `applied`, without pyplot, which would keep it or open a window::

    with applied():
        fig, axes = subplots(..., figsize=(WIDTH, 3.0))
        ...
    return fig
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import AbstractContextManager
from functools import cache
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.transforms import Bbox

from acx4book.typesetting.plain_text import shown
from acx4lib.expected import Array, Index

WIDTH = 7.0
"""Width of a figure, inches; the book shows it over the whole column."""

MARGIN = 0.04
"""Free space above and below a drawing, inches."""

PAGE_DPI = 96
"""Pixels of a page in an inch."""

INK = "#1f2933"
SOFT = "#67737f"
PAPER = "#fbfcfd"
"""Colours of important text and marks, of explanations, and of the background of axes.

In the dark a page has others in their place, as for all of `NAMES`; white and `BLACK` remain.
"""

BLACK = "#161d24"
"""Ink on backgrounds that are light by day and by night: pictures, cells of a matrix."""

EDGE = "#a9b3bc"
GRID = "#e3e8ec"
MUTED = "#cfd6dc"
LAND = "#e6efe9"
LAND_EDGE = "#b3c7b6"
SHEET = "#d7e5f5"
"""Colours of the frame of axes, of their grid, of bars that explain others, of the ground seen from
above, of its border, and of the plane of an image."""

BLUE = "#2158a0"
ORANGE = "#e58a1f"
TEAL = "#1d9a78"
PLUM = "#741f5a"
SKY = "#9cc6ef"
BRICK = "#bf4630"
PALETTE = (BLUE, ORANGE, TEAL, PLUM, SKY, BRICK)
"""Colours in order; readers who do not see all colours can distinguish every pair."""

WRITTEN = {TEAL: "#147a5d", ORANGE: "#955400"}
"""Darker colours for text, in place of colours too light for letters on white."""

NAMES = {
    INK: "ink",
    SOFT: "soft",
    PAPER: "paper",
    EDGE: "edge",
    GRID: "grid",
    MUTED: "muted",
    LAND: "land",
    LAND_EDGE: "land-edge",
    SHEET: "sheet",
    BLUE: "blue",
    ORANGE: "orange",
    TEAL: "teal",
    PLUM: "plum",
    SKY: "sky",
    BRICK: "brick",
    WRITTEN[TEAL]: "teal-words",
    WRITTEN[ORANGE]: "orange-words",
}
"""Names of the colours that a page sets: `--figure-ink` in its style sheet, for day and night."""

PRINTED = INK
"""Colour of the paper's values in all figures; they are dashed lines or open diamonds."""

_LARGE = [
    *("#f3f6f9", "#d6e4f1", "#b9d3ea", "#91b9dd", "#699fd0"),
    *("#477fba", "#265fa3", "#1d477c", "#142f57"),
]
_OFF = [
    *("#8f4a0b", "#ba6a15", "#e58a20", "#eec088", "#f6f3ef"),
    *("#aac3dc", "#5e92c8", "#3a689d", "#173f73"),
]

SEQUENCE = ListedColormap(_LARGE, "acx4 sequence")
"""From small (light) to large (dark), for marks; a page in the dark turns it round."""

SHADES = LinearSegmentedColormap.from_list("acx4 shades", ["#3f7dc400", "#3f7dc4"])
"""From zero (transparent) to large (blue): for fields, by day and by night."""

BOTH_WAYS = ListedColormap(_OFF, "acx4 both ways")
"""The same for marks; in the dark, zero is dark."""

SCALES = {
    colour: f"{name}-{step}"
    for name, scale in (("large", _LARGE), ("off", _OFF))
    for step, colour in enumerate(scale)
}
"""Names of the colours of both scales, which a page sets as it does `NAMES`."""

SMALL = 8.3
"""Size of the smallest letters, points: 11 px in a figure over the column of a wide window."""

LETTERS: Any = {"size": SMALL}
"""The same for the keys of arrows."""

MANY = 4000
"""Largest number of marks in a panel; of more, a selection is drawn."""

LISTED = 18
"""Largest number of names in a legend; of more, repeated colours could not be told apart."""

LONGEST = 24
"""Largest number of characters of a name in a figure."""

RC: Any = {
    "figure.dpi": 150,
    "figure.facecolor": "white",
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.w_pad": 0.07,
    "figure.constrained_layout.h_pad": 0.06,
    "savefig.facecolor": "white",
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.facecolor": PAPER,
    "axes.edgecolor": EDGE,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.labelcolor": INK,
    "axes.labelsize": 8.5,
    "axes.titlesize": 9.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.prop_cycle": cycler(color=PALETTE),
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "text.color": INK,
    "lines.linewidth": 1.5,
    "lines.markersize": 4,
    "patch.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": SMALL,
    "legend.handlelength": 1.6,
    "svg.hashsalt": "acx4lib",
}
"""Settings of matplotlib."""


def applied() -> AbstractContextManager[None]:
    """Draw in the book's style; matplotlib's own settings are restored afterwards."""
    return mpl.rc_context(RC)


class _Shown(Figure):
    """A figure shown as a picture by any notebook, without pyplot."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """Return the figure as PNG, and its width on a page, px."""
        buffer = io.BytesIO()
        with mpl.rc_context(RC):
            self.draw_without_rendering()
            box = shown_part(self, self.get_tightbbox())
            self.savefig(buffer, format="png", dpi=RC["figure.dpi"], bbox_inches=box)
        return buffer.getvalue(), {"width": round(PAGE_DPI * box.width)}


def shown_part(fig: Figure, box: Bbox) -> Bbox:
    """Return the visible part of a figure, inches.

    It is as wide as the figure, or wider if a part extends beyond it, and as high as the box.

    Parameters
    ----------
    fig : Figure
    box : Bbox
        Around all that is drawn, inches.
    """
    left, right = min(0.0, box.x0), max(fig.get_figwidth(), box.x1)
    return Bbox([[left, box.y0 - MARGIN], [right, box.y1 + MARGIN]])


def figure(*, figsize: tuple[float, float]) -> Figure:
    """Return an empty figure of a size in inches."""
    fig = _Shown(figsize=figsize)
    FigureCanvasAgg(fig)
    return fig


def subplots(
    n_rows: int = 1, n_columns: int = 1, *, figsize: tuple[float, float], **options: Any
) -> tuple[Figure, Any]:
    """Return a figure of a size in inches with its axes, as ``Figure.subplots`` makes them."""
    fig = figure(figsize=figsize)
    return fig, fig.subplots(n_rows, n_columns, **options)


def colour(i: int) -> str:
    """Return the i-th colour of the palette, which repeats."""
    return PALETTE[i % len(PALETTE)]


def plain(name: str, *, longest: int = LONGEST) -> str:
    """Return a name of the flight as a label; the middle of a very long one is left out."""
    half = longest // 2
    return _drawn(name if len(name) <= longest else f"{name[:half]}…{name[-half:]}")


def _drawn(text: str) -> str:
    """Return text that matplotlib draws unchanged; characters missing in the font are escaped."""
    known = shapes()
    return shown("".join(c if ord(c) in known else ascii(c)[1:-1] for c in text), "tex")


@cache
def shapes() -> frozenset[int]:
    """Return the characters that the fonts of labels and titles have."""
    fonts = [FontProperties(family=RC["font.family"], weight=w) for w in ("normal", "bold")]
    regular, bold = (get_font(findfont(font)).get_charmap() for font in fonts)
    return frozenset(regular) & frozenset(bold)


def legend_below(fig: Figure, handles: Sequence[Any], *, ncols: int = 6) -> None:
    """Put one legend under all axes of a figure, outside of the data.

    Parameters
    ----------
    fig : Figure
    handles : sequence of Artist
        Artists with labels; of more than `LISTED` there is no legend.
    ncols : int
    """
    if len(handles) <= LISTED:
        fig.legend(handles=handles, loc="outside lower center", ncols=min(ncols, len(handles)))


def largest_in_cells(at: Array, values: Array) -> Index:
    """Return the indices of the marks to draw: all, or beyond `MANY` the largest in every cell.

    Parameters
    ----------
    at : ndarray, shape (n, 2)
        Places in a map; its square cells are as many as `MANY`.
    values : ndarray, shape (n,)

    Returns
    -------
    ndarray of int, shape (m,)
        In the order of increasing values, so that large ones are drawn on top.
    """
    order = np.argsort(values, kind="stable")
    if len(at) <= MANY:
        return order
    low, high = at.min(axis=0), at.max(axis=0)
    size = max(float(np.sqrt(np.prod(high - low) / MANY)), float((high - low).max()) / MANY)
    col, row = ((at[order] - low) // size).astype(np.intp).T
    _, last = np.unique((col * (MANY + 1) + row)[::-1], return_index=True)
    return order[np.sort(len(order) - 1 - last)]


def heading(ax: Axes, title: str, subtitle: str) -> None:
    """Write a title with a subtitle of one or several lines."""
    ax.set_title(title, pad=15 + 10 * subtitle.count("\n"))
    ax.annotate(
        subtitle,
        xy=(0, 1),
        xytext=(0, 4.5),
        xycoords="axes fraction",
        textcoords="offset points",
        fontsize=SMALL,
        color=SOFT,
    )


def bare(ax: Axes) -> None:
    """Remove spines, ticks and grid from the axes of a matrix or a drawing."""
    ax.grid(visible=False)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)


class Nothing(_Shown):
    """A figure replaced by a sentence on the reason; a notebook shows the text.

    Attributes
    ----------
    sentence : str
        Plain.
    """

    sentence: str = ""

    def _repr_markdown_(self) -> str:
        """Return the sentence as Markdown."""
        return shown(self.sentence)

    def _repr_png_(self) -> None:  # type: ignore[override] # a sentence has no pixels
        """Show no pixels."""


def nothing(text: str) -> Nothing:
    """Return a figure replaced by a sentence on the reason.

    Parameters
    ----------
    text : str
        The sentence.
    """
    with applied():
        fig = Nothing(figsize=(WIDTH, 0.9))
        FigureCanvasAgg(fig)
        fig.sentence = text
        ax = fig.subplots()
        bare(ax)
        ax.set(xticks=[], yticks=[])
        ax.text(
            0.5, 0.5, _drawn(text), ha="center", va="center", color=SOFT, transform=ax.transAxes
        )
    return fig


def round_length(longest: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, ... not above a positive length."""
    power = 10.0 ** np.floor(np.log10(longest))
    steps = np.array([1.0, 2.0, 5.0])
    # small tolerance against rounding errors at exact lengths
    return float(power * steps[steps <= longest / power * (1 + 1e-9)][-1])


def scale_bar(ax: Axes, *, per_axis_unit: float, unit: str, at: tuple[float, float]) -> None:
    """Draw a scale bar of a round length, about a fifth of the axes wide.

    Parameters
    ----------
    ax : Axes
        Axes with limits, and with the same scale in both directions.
    per_axis_unit : float
        Number of `unit` in one unit of the axis.
    unit : str
        Unit of the label; of less than one km it is m.
    at : tuple of float
        Position of the left end, in fractions of the axes.
    """
    low, high = ax.get_xlim()
    length = round_length(0.25 * abs(high - low) * per_axis_unit)
    width = length / per_axis_unit / abs(high - low)
    left, bottom = at
    line: dict[str, Any] = {"color": INK, "clip_on": False, "transform": ax.transAxes, "zorder": 9}
    ax.plot([left, left + width], [bottom, bottom], lw=1.6, solid_capstyle="butt", **line)
    for end in (left, left + width):
        ax.plot([end, end], [bottom - 0.008, bottom + 0.008], lw=0.8, **line)
    ax.text(
        left + width / 2,
        bottom + 0.016,
        f"{1000 * length:g} m" if unit == "km" and length < 1 else f"{length:g} {unit}",
        transform=ax.transAxes,
        ha="center",
        va="bottom",
        fontsize=SMALL,
        zorder=9,
    )


def north_arrow(ax: Axes, *, at: tuple[float, float]) -> None:
    """Draw an arrow to grid north, which is up, with its tip at `at` in fractions of the axes."""
    ax.annotate(
        "N",
        xy=at,
        xytext=(0, -24),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=SMALL,
        arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.2, "shrinkA": 0, "shrinkB": 0},
        zorder=9,
    )


def padded(low: Array, high: Array, *, share: float = 0.04) -> tuple[Array, Array]:
    """Return limits with a margin on each side, a share of the larger extent."""
    margin = share * float(np.max(high - low))
    return low - margin, high + margin
