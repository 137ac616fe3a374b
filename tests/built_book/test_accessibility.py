"""What keeps readers out who see little, use no mouse, or have a small screen."""

import pytest

HEIGHT = 900
KINDS = (
    *("intro.html", "_executed/foundations/5-least-squares.html", "scorecard.html"),
    *("_executed/03-mounting-calibration.html", "_generated/api/acx4lib/geometry.html"),
    *("bibliography.html", "glossary.html", "notation.html", "search.html"),
)
"""One page of each kind."""

FOUND = """async () => {
    const found = await axe.run({resultTypes: ['violations']});
    return found.violations
        .filter(one => ['serious', 'critical'].includes(one.impact))
        .map(one => `${one.id}, ${one.nodes.length} times: ${one.nodes[0].html.slice(0, 150)}`);
}"""
CUT_OFF = """async () => {
    await window.MathJax?.startup?.promise;
    await new Promise(done => setTimeout(done, 100));  // the boxes that scroll are marked
    const scrolls = box => /auto|scroll/.test(getComputedStyle(box).overflowX);
    const wide = document.documentElement.clientWidth;
    const cut = [];
    const parts = 'article :is(mjx-container, table, pre, .drawing svg)';
    for (const part of document.querySelectorAll(parts)) {
        if (part.closest('details:not([open]), .toggle-hidden')) continue;
        const {left, right, width} = part.getBoundingClientRect();
        let box = part;
        while (box && !scrolls(box)) box = box.parentElement;
        const inside = box && box.closest('article');
        const more = inside && box.scrollWidth > box.clientWidth + 1;
        if (width && !more && (left < -1 || right > wide + 1))
            cut.push(`cut off: ${part.textContent.trim().slice(0, 60)}`);
        if (more && !box.hasAttribute('data-scrolls'))
            cut.push(`scrolls, and nothing says so: ${part.textContent.trim().slice(0, 60)}`);
        if (more && box.tabIndex < 0)
            cut.push(`scrolls, and no key reaches it: ${part.textContent.trim().slice(0, 60)}`);
    }
    return cut;
}"""


def opened(browser, html, *, colours="light", width=1280):
    size = {"width": width, "height": HEIGHT}
    page = browser.new_context(
        viewport=size, color_scheme=colours, reduced_motion="reduce"
    ).new_page()

    def show(name):
        page.goto(f"{html.as_uri()}/{name}", wait_until="load")
        page.evaluate("async () => { await window.MathJax?.startup?.promise; }")
        return page

    return show


def complaints(browser, html, axe, names, colours):
    show = opened(browser, html, colours=colours)
    found = []
    for name in names:
        page = show(name)
        page.evaluate(axe)
        found += [f"{name}: {one}" for one in page.evaluate(FOUND)]
    page.context.close()
    return found


@pytest.mark.parametrize("colours", ["light", "dark"])
def test_pages_of_each_kind_have_no_serious_finding(browser, html, axe, chapters, colours):
    there = [name for name in KINDS if name in chapters or name == "search.html"]
    assert complaints(browser, html, axe, there, colours) == []


@pytest.mark.slow
@pytest.mark.repeats
@pytest.mark.parametrize("colours", ["light", "dark"])
def test_no_page_has_a_serious_finding(browser, html, axe, chapters, colours):
    assert complaints(browser, html, axe, chapters, colours) == []


def test_on_a_phone_nothing_is_cut_off_and_what_scrolls_says_so(browser, html, chapters):
    show = opened(browser, html, width=390)
    page, found = None, []
    for name in chapters:
        page = show(name)
        found += [f"{name}: {one}" for one in page.evaluate(CUT_OFF)]
    page.context.close()
    assert found == []
