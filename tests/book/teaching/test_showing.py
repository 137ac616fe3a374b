"""Material for teachers, and question banks."""

import base64
import html.parser
import io
import json
import re
import zipfile
from xml.dom import minidom

import nbformat
import pytest

from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.teaching import quiz, showing
from acx4book.teaching.grading import UNEXPLAINED, apart
from acx4book.teaching.sheets.every import SHEETS
from acx4book.teaching.showing import Figure
from acx4book.typesetting import style

# --- What teachers show: tables, slides and a pack of figures --------------------------------


# --- tables ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def texts():
    return dict(showing.texts())


@pytest.mark.parametrize("name", SHEETS)
def test_the_books_tables_have_every_question_and_the_mistakes(name, texts):
    sheet = SHEETS[name]
    asked, solved = texts[f"{name}-questions.md"], texts[f"{name}-solution.md"]
    for question in sheet.questions:
        assert f"`{question.name}`" in asked
        assert f"`{question.name}`" in solved
    assert solved.count("\n| ") > len(sheet.questions) + 6


# --- slides ----------------------------------------------------------------------------------


def test_every_figure_of_the_lecture_is_in_the_book():
    for slide in showing.LECTURE:
        if slide.figure:
            text = (NOTEBOOKS_PATH / f"{slide.chapter}.ipynb").read_text(encoding="utf-8")
            named = [
                cell["metadata"].get("mystnb", {}).get("figure", {}).get("name")
                for cell in json.loads(text)["cells"]
            ]
            assert slide.figure in named


DRAWN = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="9pt" height="9pt" viewBox="0 0 9 9"><g>'
    f'<path d="m0 0v3" style="stroke: {style.INK}"/></g></svg>'
).encode()


def test_the_page_has_all_slides_and_asks_for_no_other_file():
    figure = Figure(chapter="c", name="f", caption="", alt='a "b" <c>', kind="svg", content=DRAWN)
    told = (
        showing.Slide(title="1 < 2", says=("a", "b"), chapter="c", figure="f"),
        showing.Slide(title="Two", says=("c",), chapter="c", figure="not there"),
    )
    page = showing.slides([figure], told)
    html.parser.HTMLParser().feed(page)
    assert page.count("<section>") == 2
    assert "1 &lt; 2" in page
    assert 'aria-label="a &quot;b&quot; &lt;c&gt;"' in page
    assert f'<path d="m0 0v3" style="stroke: {style.INK}"/>' in page
    assert not re.findall(r'(?:src|href)="([^#][^"]*)', page)
    assert "http" not in page


def test_every_slide_is_linked_once_by_its_number():
    text = "".join(text for _, text in showing.links())
    assert re.findall(r"slides\.html#slide-(\d+)", text) == [
        str(number) for number in range(1, len(showing.LECTURE) + 1)
    ]
    assert [name for name, _ in showing.links()] == [f"block-{k}-slides.md" for k in range(1, 6)]


# --- figure pack -----------------------------------------------------------------------------


PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)


@pytest.fixture
def executed(tmp_path):
    def cell(name, data):
        out = nbformat.v4.new_output("display_data", data=data)
        cell = nbformat.v4.new_code_cell("draw()", outputs=[out])
        if name:
            said = {"figure": {"name": name, "caption": "A\n caption."}, "image": {"alt": "Seen."}}
            cell.metadata["mystnb"] = said
        return cell

    png = base64.b64encode(PIXEL).decode()
    cells = [
        cell("fig-lines", {"image/svg+xml": "<svg/>", "image/png": png}),
        cell("fig-picture", {"image/png": png}),
        cell("", {"image/png": png}),
        cell("fig-table", {"text/plain": "1"}),
    ]
    (tmp_path / "part").mkdir()
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "part" / "1-one.ipynb")
    return tmp_path


def test_the_archive_has_every_named_figure_once_with_its_caption(executed):
    found = [*showing.figures(executed)]
    content = showing.archive(found)
    assert content == showing.archive([*showing.figures(executed)])
    with zipfile.ZipFile(io.BytesIO(content)) as pack:
        assert pack.namelist() == [
            "figures.txt",
            "part/1-one/fig-lines.svg",
            "part/1-one/fig-picture.png",
        ]
        assert pack.read("part/1-one/fig-lines.svg") == b"<svg/>"
        assert pack.read("part/1-one/fig-picture.png") == PIXEL
        assert pack.read("figures.txt").decode().count("A caption.") == 2
    assert found[0].alt == "Seen."


# --- Question banks read back as a learning platform reads them, by parsers that know no writer


STUDENT = "Ada"


def of_gift(written):
    """Return the answers of every question, as the grammar of the format has them.

    A question is ``::title::text {#answers}``, an answer ``=[%weight%]low..high#feedback``. A
    backslash stands before what is none of the format's signs. Numbers have no exponent.
    """
    found = {}
    for title, _, inside in re.findall(
        r"(?s)^::((?:\\.|[^:\\])+)::((?:\\.|[^{\\])+)\{#\n(.*?)(?<!\\)\n\}", written, re.MULTILINE
    ):
        answers = [
            re.fullmatch(r"=(?:%(\d+)%)?(-?\d+\.?\d*)\.\.(-?\d+\.?\d*)#(.*)", line).groups()
            for line in inside.splitlines()
        ]
        found[plain(title)] = [
            (float(low), float(high), int(weight or 100), plain(said))
            for weight, low, high, said in answers
        ]
    return found


def plain(escaped):
    return re.sub(r"\\(.)", r"\1", escaped)


def said_by_gift(answers, value):
    among = ((points, said) for low, high, points, said in answers if low <= value <= high)
    return next(among, None)


def said_by_qti(item, value):
    """Run the response processing of an item: the first condition that holds, and no other."""
    holds = {
        "vargte": lambda limit: value >= float(limit),
        "varlte": lambda limit: value <= float(limit),
        "other": lambda _: True,
    }
    for condition in item.getElementsByTagName("respcondition"):
        (tests,) = condition.getElementsByTagName("conditionvar")
        if all(holds[test.tagName](text(test)) for test in tests.childNodes):
            (points,) = condition.getElementsByTagName("setvar")
            (shown,) = condition.getElementsByTagName("displayfeedback")
            said = [
                text(feedback.getElementsByTagName("mattext")[0])
                for feedback in item.getElementsByTagName("itemfeedback")
                if feedback.getAttribute("ident") == shown.getAttribute("linkrefid")
            ]
            return int(text(points)), *said
    raise AssertionError(value)


def text(element):
    return "".join(child.data for child in element.childNodes)


@pytest.fixture(scope="module", params=["lab-2", "lab-6"])
def banks(request, solved, key, tmp_path_factory):
    """Sheet, right answers, mistakes, the bank as GIFT, and that as QTI by its names."""
    sheet = SHEETS[request.param]
    case, right = solved(sheet.name, STUDENT)
    folder = tmp_path_factory.mktemp("quiz") / "bank"
    quiz.write(sheet, STUDENT, key, folder)
    with zipfile.ZipFile(folder / quiz.QTI) as pack:
        manifest = minidom.parseString(pack.read("imsmanifest.xml"))
        (resource,) = manifest.getElementsByTagName("resource")
        document = minidom.parseString(pack.read(resource.getAttribute("href")))
    assert resource.getAttribute("type") == "imsqti_xmlv1p2"
    items = {one.getAttribute("ident"): one for one in document.getElementsByTagName("item")}
    gift = of_gift((folder / quiz.GIFT).read_text("utf-8"))
    return sheet, right, [*sheet.mistakes(case, right)], gift, items


def test_both_have_all_questions_with_their_sigma(banks):
    sheet, _, _, gift, items = banks
    names = {q.name for q in sheet.questions}
    names |= {f"sigma_{q.name}" for q in sheet.questions if q.with_sigma}
    assert gift.keys() == items.keys() == names
    for question in sheet.questions:
        assert question.asks in text(items[question.name].getElementsByTagName("mattext")[0])


def test_right_answers_are_right_and_a_bound_away_they_are_not(banks):
    _, right, _, gift, items = banks
    for name, one in right.items():
        for value in (one.value, one.truth, one.truth + 0.99 * one.bound):
            assert said_by_gift(gift[name], value) == (100, quiz.RIGHT)
            assert said_by_qti(items[name], value) == (100, quiz.RIGHT)
        if one.sigma is not None:
            assert said_by_qti(items[f"sigma_{name}"], 1.2 * one.sigma)[0] == 100
            assert said_by_qti(items[f"sigma_{name}"], 1.4 * one.sigma)[0] == 0
        beyond = said_by_gift(gift[name], one.truth + 1.01 * one.bound)
        assert beyond is None or beyond[0] == 0
        assert said_by_gift(gift[name], 1e7) is None
        assert said_by_qti(items[name], 1e7) == (0, UNEXPLAINED)


def test_a_mistake_is_answered_by_its_own_sentence(banks):
    _, right, mistakes, gift, items = banks
    told, said_of_others = 0, 0
    for mistake in mistakes:
        for name, value in mistake.gives.items():
            if apart(name, value, right[name].truth) <= right[name].bound:
                continue
            points, says = said_by_gift(gift[name], value)
            assert points == 0
            assert said_by_qti(items[name], value) == (points, says)
            told += says == mistake.says
            said_of_others += says != mistake.says  # which gives the same number
            assert says in {one.says for one in mistakes}
    assert told > 4 * said_of_others
    assert told > 20


def test_the_same_questions_are_the_same_bytes(key, tmp_path):
    for name in ("first", "again"):
        quiz.write(SHEETS["lab-2"], STUDENT, key, tmp_path / name)
    first, again = ((tmp_path / name / quiz.QTI).read_bytes() for name in ("first", "again"))
    assert first == again
