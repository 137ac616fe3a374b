"""A notebook is run as it is read: texts, and what the last lines of cells show."""

import json
import warnings

import pytest
from matplotlib.figure import Figure

from acx4book.report.page.cells import Part, parts
from acx4book.report.shown import Text


def notebook(folder, *cells):
    path = folder / "a.ipynb"
    path.write_text(json.dumps({"cells": list(cells)}))
    return path


def text(source):
    return {"cell_type": "markdown", "metadata": {}, "source": source}


def code(source, **metadata):
    return {"cell_type": "code", "metadata": metadata, "source": source.splitlines(keepends=True)}


SHOWN = "from acx4book.report.shown import Text"


def test_texts_and_last_lines_are_shown_with_the_given_parameters(tmp_path):
    told = {"figure": {"name": "fig-a"}}
    path = notebook(
        tmp_path,
        text("# A"),
        code("n: int = 1  # default", tags=["parameters"]),
        code(f"{SHOWN}\nm = 2 * n"),
        code("m += 1\nText(str(m))"),
        code("Text('not the last line')\nm = 0"),
        code("m"),
        code("from matplotlib.figure import Figure\nfig = Figure()\nfig", mystnb=told),
    )
    counted = []
    found = list(parts(path, {"n": 20}, lambda *cells: counted.append(cells)))
    assert found[:2] == [Part(content=Text("# A")), Part(content=Text("41"))]
    assert isinstance(found[2].content, Figure)
    assert found[2].told == told
    assert counted == [(n, 7) for n in range(8)]


def test_an_error_of_a_cell_is_its_own(tmp_path):
    with pytest.raises(ZeroDivisionError):
        list(parts(notebook(tmp_path, code("1 / 0")), {}, lambda *_: None))


def test_a_warning_is_not_shown_and_others_are_still(tmp_path):
    path = notebook(tmp_path, code("import warnings\nwarnings.warn('old')"))
    assert list(parts(path, {}, lambda *_: None)) == []
    with pytest.warns(UserWarning, match="new"):
        warnings.warn("new", stacklevel=1)
