"""The text of the report, and what is computed between its paragraphs."""

import warnings

import pytest
from matplotlib.figure import Figure

from acx4book.report.page.contents import DIRECTIVE, TEXT, Part, computed, parts
from acx4book.report.shown import Text

FIGURE = Figure()
WRITTEN = """# A

B.

## C

```{section} table
```

D.

```{figure} drawn
:alt: A line.

A *line*,
which is straight.
```
"""


def test_texts_and_computed_parts_come_in_their_order():
    counted = []
    by_name = {"table": lambda: Text("42"), "drawn": lambda: FIGURE}
    table, drawn = ("fig-report-table", "fig-report-drawn")
    told = {"caption": "A *line*,\nwhich is straight.", "alt": "A line."}
    assert [*parts(WRITTEN, by_name, lambda *done: counted.append(done))] == [
        Part(content=Text("# A\n\nB.")),
        Part(content=Text("## C")),
        Part(content=Text("42"), name=table),
        Part(content=Text("D.")),
        Part(content=FIGURE, name=drawn, **told),
    ]
    assert counted == [(0, 2), (1, 2), (2, 2)]


def test_an_error_of_a_part_is_its_own():
    with pytest.raises(ZeroDivisionError):
        list(parts("```{section} a\n```", {"a": lambda: 1 / 0}, lambda *_: None))


def test_a_warning_is_not_shown_and_others_are_still():
    def old():
        warnings.warn("old", stacklevel=1)
        return Text("a")

    assert len(list(parts("```{section} a\n```", {"a": old}, lambda *_: None))) == 1
    with pytest.warns(UserWarning, match="new"):
        warnings.warn("new", stacklevel=1)


def test_every_part_that_is_computed_has_its_place_in_the_text():
    text = TEXT.read_text(encoding="utf-8")
    assert sorted(one["name"] for one in DIRECTIVE.finditer(text)) == sorted(computed(None, []))
    assert "```{" not in DIRECTIVE.sub("", text)
