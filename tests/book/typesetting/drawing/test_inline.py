"""Drawings in a page: in its colours, their names apart, every letter once."""

from acx4book.typesetting.drawing.inline import inline

LETTER = '<defs><path id="D47" d="m0 0h9"/></defs><use href="#D47"/>'
DRAWING = (
    '<svg viewBox="0 0 252 90" width="252pt"><g><g id="patch_1"><path d="m0 0h9"/></g>'
    f'<g clip-path="url(#p1)" style="fill: #1f2933">{LETTER}</g>'
    '<clipPath id="p1"><rect/></clipPath></g></svg>'
)


def test_a_page_has_every_letter_once_and_the_names_of_each_drawing_apart():
    known = set()
    first, second = (inline(DRAWING, alt='"a"', name=name, known=known) for name in ("f1-", "f2-"))
    assert 'aria-label="&quot;a&quot;"' in first
    assert "width: 50%" in first  # of a column of 504 points
    assert 'id="D47"' in first
    assert 'id="D47"' not in second
    assert 'href="#D47"' in second
    assert 'clip-path="url(#f2-0)" style="fill: var(--figure-ink)"' in second
    assert 'clipPath id="f2-0"' in second
    assert "patch_1" not in first + second
