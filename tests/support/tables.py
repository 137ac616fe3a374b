"""Tables of pages, read as their reader sees them."""

import html
import re

import pandas as pd


def read(text, name):
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
