"""What is looked for in figures and tables: labels with units, artists, texts apart, cells."""

import html
import re
import warnings

import matplotlib as mpl
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.quiver import Quiver

mpl.use("agg")

UNIT = re.compile(r"\((m|km|cm|mm|px|deg|%|1)\)$")


def drawn(fig):
    """Draw a figure as it goes into the book; every warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        FigureCanvasAgg(fig).draw()
    return fig


def panels(fig):
    """Return the axes that hold data, not colour bars."""
    return [ax for ax in fig.axes if ax.get_label() != "<colorbar>"]


def quivers(ax):
    return [artist for artist in ax.get_children() if isinstance(artist, Quiver)]


def assert_labelled(fig):
    for ax in panels(fig):
        assert UNIT.search(ax.get_xlabel()), ax.get_xlabel()
        if ax.get_ylabel():  # a neighbour with a shared axis has none
            assert UNIT.search(ax.get_ylabel()), ax.get_ylabel()
    assert any(ax.get_ylabel() for ax in panels(fig))


def sentence(fig):
    (text,) = drawn(fig).axes[0].texts
    return text.get_text()


def title(ax):
    return ax.get_title(loc="left")


# --- tables of pages, read as their reader sees them -------------------------------------------


def table(text, name):
    """Cells, as text, of the table with this label in a page of MyST text."""
    (body,) = re.findall(
        rf"^:name: {re.escape(name)}\n\n(.*?)\n```", text, re.DOTALL | re.MULTILINE
    )
    head, _, *rows = ([_cell(c) for c in line.split("|")[1:-1]] for line in body.splitlines())
    return pd.DataFrame(rows, columns=head)


def _cell(source):
    return html.unescape(source).replace("\N{NO-BREAK SPACE}", " ").strip()


def numbers(cells):
    """Cells as numbers: without signs of minus, units and intervals behind them."""
    return [float(cell.replace("\N{MINUS SIGN}", "-").split()[0]) for cell in cells]
