"""Tables of pages, read as their reader sees them."""

import html
import re

import pandas as pd


def read(text, name):
    """Cells, as text, of the table with this label in a page of MyST text."""
    (body,) = re.findall(
        rf"^:name: {re.escape(name)}\n\n(.*?)\n```", text, re.DOTALL | re.MULTILINE
    )
    lines = html.unescape(body).replace("\N{NO-BREAK SPACE}", " ").splitlines()
    head, _, *rows = ([c.strip() for c in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines)
    return pd.DataFrame(rows, columns=head)


def numbers(cells):
    """Cells as numbers: without signs of minus, units and intervals behind them."""
    return [float(cell.replace("\N{MINUS SIGN}", "-").split()[0]) for cell in cells]
