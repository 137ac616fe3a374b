"""What keeps readers out who see little or use no mouse."""

import pytest

KINDS = (
    *("intro.html", "_executed/19-from-pictures.html"),
    *("_generated/api/acx4lib/conventions.html", "search.html"),
)
"""One page of each kind, of the shorter ones."""

FOUND = """async (options) => {
    const found = await axe.run({resultTypes: ['violations'], ...options});
    return found.violations
        .filter(one => ['serious', 'critical'].includes(one.impact))
        .map(one => `${one.id}, ${one.nodes.length} times: ${one.nodes[0].html.slice(0, 150)}`);
}"""
CONTRAST = {"runOnly": ["color-contrast"]}


def complaints(browser, html, axe, dark, names):
    """Return what axe finds in the light, and in the dark, where only contrasts differ."""
    size = {"width": 1280, "height": 900}
    context = browser.new_context(viewport=size, color_scheme="light", reduced_motion="reduce")
    page, found = context.new_page(), []
    for name in names:
        page.goto(f"{html.as_uri()}/{name}", wait_until="load")
        page.evaluate("async () => { await window.MathJax?.startup?.promise; }")
        page.evaluate(axe)
        found += [f"{name}: {one}" for one in page.evaluate(FOUND, {})]
        with dark(page):
            found += [f"{name}, dark: {one}" for one in page.evaluate(FOUND, CONTRAST)]
    context.close()
    return found


def test_pages_of_each_kind_have_no_serious_finding(browser, html, axe, dark, chapters):
    there = [name for name in KINDS if name in chapters or name == "search.html"]
    assert complaints(browser, html, axe, dark, there) == []


@pytest.mark.slow
@pytest.mark.repeats
def test_no_page_has_a_serious_finding(browser, html, axe, dark, chapters):
    assert complaints(browser, html, axe, dark, chapters) == []
