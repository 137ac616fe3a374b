"""The printable report of the run that the book was made from, in a browser without a network."""

import pytest

from acx4book.report.page import write
from acx4lib.results import provenance
from support.helpers import repeats

SEEN = """() => ({
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    broken: [...document.images].filter(i => !i.complete || !i.naturalWidth).length,
    images: document.images.length,
    ground: getComputedStyle(document.body).backgroundColor,
    code: document.querySelectorAll('pre').length,
})"""


@pytest.fixture(scope="module")
def report_path(html, tmp_path_factory):
    folder = html.parents[2] / "build" / "results" / "data-flights-acx4"
    if not (folder / provenance.FILE).is_file():
        pytest.skip("the book was made from another flight")
    out = tmp_path_factory.mktemp("report") / "report.html"
    write(folder, out)
    return out


@pytest.mark.parametrize(
    ("width", "colours"),
    [(1280, "light"), (390, "dark"), repeats(1280, "dark"), repeats(390, "light")],
)
def test_the_report_is_drawn_whole_light_and_asks_for_nothing(browser, report_path, width, colours):
    context = browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme=colours, java_script_enabled=True
    )
    page = context.new_page()
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report_path.as_uri(), wait_until="load")
    seen = page.evaluate(SEEN)
    context.close()
    assert [url for url in asked if not url.startswith("data:")] == [report_path.as_uri()]
    assert (seen["overflow"], seen["broken"], seen["code"]) == (0, 0, 0)
    assert seen["images"] >= 6
    assert seen["ground"] == "rgb(255, 255, 255)"


def test_the_report_prints_on_a4_in_a_handful_of_pages(browser, report_path):
    page = browser.new_page()
    page.goto(report_path.as_uri(), wait_until="load")
    printed = page.pdf(prefer_css_page_size=True)
    page.close()
    assert printed.startswith(b"%PDF")
    assert b"/MediaBox [0 0 594" in printed or b"/MediaBox [0 0 595" in printed  # 210 mm
    assert 6 <= printed.count(b"/Type /Page\n") <= 20
