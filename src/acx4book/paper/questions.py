"""The paper's four questions: as it asks them, its answers, and those of a run."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import nbformat
import pandas as pd

from acx4book.paper import printed
from acx4book.paper.scorecard import TWO_STEP
from acx4book.typesetting.myst import LABELS, myst_table, value_and_sigma, with_unit
from acx4book.typesetting.plain_text import Markup
from acx4files.results import folder
from acx4lib.geometry.parameters import AXES, BORESIGHT_ANGLES

TAG = "answer"
"""Tag of a chapter's last cell, the answer; its first paragraph is one sentence."""

SENTENCE = re.compile(r"(?<=\.) (?=[A-Z$])")
"""The blank between two sentences."""

UNANSWERED = "This flight has no data for this question."


@dataclass(frozen=True, kw_only=True)
class _Question:
    """One question of the paper.

    Attributes
    ----------
    asked : str
        In a sentence.
    sections : str
        Where the paper asks and answers it.
    chapter : str
        Name of the notebook that answers it here.
    answered : callable
        Returns the paper's answer, with the printed numbers.
    short : str
        The question in a few words.
    independence : str
        What was set so that a simulated flight agrees.
    """

    asked: str
    sections: str
    chapter: str
    answered: Callable[[], str]
    short: str
    independence: str


def _heads() -> str:
    sigma = [1e3 * printed.sigma(1, name, h) for name in ("xp_mm", "yp_mm") for h in printed.HEADS]
    return (
        "Yes. A bundle over a field of signalised points gives each head its interior orientation "
        f"while the focal length is held at {printed.statement('head_f_fixed_mm'):g} mm (its "
        f"Table 1). The principal points have standard deviations of {min(sigma):.1f} to "
        f"{max(sigma):.1f} µm, the distortion at the border is about "
        f"{printed.statement('head_border_distortion_px'):g} pixels, and interior and exterior "
        f"orientation are correlated by less than {100 * printed.statement('max_correlation'):g} %."
    )


def _synthetic() -> str:
    return (
        f"Yes. Its residuals are around {printed.statement('synthetic_quality_um'):g} µm, "
        f"{printed.statement('synthetic_quality_px'):g} pixel. Decentring distortion is not "
        "significant, and the radial distortion at the border is close to "
        f"{printed.statement('synthetic_border_distortion_px'):g} pixels, which may come from the "
        "measurement of the image points."
    )


def _mounting() -> str:
    differ = ", ".join(
        f"{LABELS[name]} is "
        f"{' mm and '.join(printed.shown(3, name, m) for m in printed.METHODS)} mm"
        for name in ("f_mm", "xp_mm", "yp_mm")
    )
    return (
        "Distortion and boresight come out alike from both methods; focal length and principal "
        f"point do not: {differ} (two-step, single-step). The two-step method does not compute the "
        "relative position of camera and IMU, and these three absorb it."
    )


def _validation() -> str:
    rms = [printed.value(4, f"rms_{axis}_m", m) for axis in AXES for m in printed.METHODS]
    share = printed.shown(4, "within_3_gsd_percent", "single_step")
    scales = (printed.statement(f"{end}_scale") for end in ("smallest", "largest"))
    return (
        f"The RMS of the differences is {min(rms):.2f} to {max(rms):.2f} m by axis, about "
        f"{printed.statement('accuracy_px'):g} pixels, with either method; {share} % of the points "
        f"lie within {printed.statement('within_factor'):g} ground pixels. That suffices for maps "
        f"at {' to '.join(f'1:{scale:.0f}' for scale in scales)} by the Brazilian standard."
    )


QUESTIONS = (
    _Question(
        asked="Can the heads be calibrated, and oriented to each other, from aerial images alone "
        "instead of in a laboratory?",
        sections="sections 2.1 and 4.1",
        chapter="01-head-calibration",
        answered=_heads,
        short="Can the heads be calibrated from aerial images?",
        independence="values of the adjustment given, σ not",
    ),
    _Question(
        asked="Is the synthetic image that is made from the heads geometrically good?",
        sections="sections 2.1 and 4.1",
        chapter="02-synthetic-image",
        answered=_synthetic,
        short="Is the synthetic image geometrically good?",
        independence="noise, response and lens places of the pictures were chosen",
    ),
    _Question(
        asked="How does the synthetic camera sit on the GNSS/INS, and do the two-step and the "
        "single-step method agree?",
        sections="sections 2.2 and 4.2",
        chapter="03-mounting-calibration",
        answered=_mounting,
        short="Do the two-step and the single-step method agree?",
        independence="follows from given values, once a reading is chosen",
    ),
    _Question(
        asked="How accurate is direct georeferencing with these parameters, and for which maps is "
        "that enough?",
        sections="sections 4.3 and 5",
        chapter="04-validation",
        answered=_validation,
        short="How accurate is direct georeferencing?",
        independence="the noise was chosen",
    ),
)
"""The aims of the paper, from its abstract and its section 2, as questions."""


# --- texts -----------------------------------------------------------------------------------


def answers(executed: Path) -> dict[str, list[str]]:
    """Return the answers with which chapters end, by chapter and paragraph.

    Parameters
    ----------
    executed : Path
        Folder of executed notebooks.
    """
    return {
        question.chapter: _answer_of(executed / f"{question.chapter}.ipynb") or [UNANSWERED]
        for question in QUESTIONS
    }


def _answer_of(notebook: Path) -> list[str]:
    """Return the paragraphs of a notebook's answer; none where there is no such notebook."""
    if not notebook.is_file():
        return []
    read = nbformat.read(notebook, as_version=4)  # type: ignore[no-untyped-call] # untyped
    shown = [
        output.data["text/markdown"]
        for cell in read.cells
        if TAG in cell.metadata.get("tags", [])
        for output in cell.outputs
    ]
    return [part for text in shown for part in text.split("\n\n")]


def text(
    found: Mapping[str, Sequence[str]],
    ideal: Mapping[str, Sequence[str]] | None = None,
    *,
    beside_print: bool,
    many: str = "",
) -> str:
    """Return a section for each of the four questions.

    Parameters
    ----------
    found : mapping of str to sequence of str
        As `answers` returns it.
    ideal : mapping of str to sequence of str, optional
        The answers with images of one ideal camera in the place of four heads; they stand beside
        the others.
    beside_print : bool
        Whether the flight has the paper's cameras, so that its answers stand beside the paper's.
    many : str
        The accuracy of many flights, which stands before that of one.
    """
    paragraphs = {
        question.chapter: _beside(question.chapter, found, ideal or {}) for question in QUESTIONS
    }
    if many:
        paragraphs["04-validation"].insert(0, many)
    whole = [
        _section(i, question, paragraphs, beside_print) for i, question in enumerate(QUESTIONS, 1)
    ]
    return "\n\n".join(whole) + "\n"


def _beside(
    chapter: str, flown: Mapping[str, Sequence[str]], ideal: Mapping[str, Sequence[str]]
) -> list[str]:
    """Return the paragraphs of an answer; an ideal camera's sentences follow where they differ."""
    paragraphs, of_ideal = flown[chapter], ideal.get(chapter, [])
    if not of_ideal or of_ideal == [UNANSWERED]:
        return list(paragraphs)
    first = (
        f"*With images made of four heads:* {paragraphs[0]} *With one ideal camera:* {of_ideal[0]}"
    )
    said = {sentence for text in paragraphs[1:] for sentence in _sentences(text)}
    rest = [
        " ".join(sentence for sentence in _sentences(text) if sentence not in said)
        for text in of_ideal[1:]
    ]
    ideally = [f"*With one ideal camera.* {text}" for text in rest if text]
    return [first, *paragraphs[1:], *ideally]


def _sentences(text: str) -> list[str]:
    """Return the sentences of a paragraph, each on one line."""
    return SENTENCE.split(" ".join(text.split()))


def _section(
    number: int, question: _Question, paragraphs: Mapping[str, Sequence[str]], beside_print: bool
) -> str:
    of_paper = (
        f"**The paper** ({question.sections}). {question.answered()}\n\n" if beside_print else ""
    )
    ours = "\n\n".join(paragraphs[question.chapter])
    return (
        f"## {number}. {question.asked}\n\n{of_paper}**This book.** {ours}\n\n"
        f"More in {{doc}}`_executed/{question.chapter}`."
    )


# --- numbers side by side --------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Told:
    """A run's results and answers to the four questions.

    Attributes
    ----------
    found : Results
        Of all stages, or of the mounting and the validation.
    answers : mapping of str to sequence of str
        As `answers` returns it.
    truth : mapping of str to mapping
        True values of the cameras, by the names of results; none of a flight without truth.
    """

    found: folder.Results
    answers: Mapping[str, Sequence[str]]
    truth: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def side_by_side(four: Told, ideal: Told | None, camera: str, spread: str = "") -> str:
    """Return a row for each question: the paper's number, and this book's, as a MyST table.

    Parameters
    ----------
    four : Told
        Of a flight whose synthetic images are made of heads.
    ideal : Told, optional
        Of the same flight with one ideal camera; mounting and validation are then of both.
    camera : str
        Name of the synthetic camera.
    spread : str
        The accuracy of many flights, which stands before that of one.
    """
    printed = (_sigma_of_heads_printed(), _quality_printed(), _shifts_printed(), _rms_printed())
    *ours, accuracy = (_sigma_of_heads(four), _quality(four), *_both(four, ideal, camera))
    ours.append(f"{spread} {accuracy}".strip())
    rows = [
        {
            "question": question.short,
            "paper": Markup(paper_text),
            "this book": Markup(our_text),
            "how independent": question.independence,
            "chapter": Markup(f"{{doc}}`_executed/{question.chapter}`"),
        }
        for question, paper_text, our_text in zip(QUESTIONS, printed, ours, strict=True)
    ]
    return myst_table(pd.DataFrame(rows), CAPTION, name="tab-side-by-side") + "\n"


CAPTION = "The paper's four questions, answered by numbers"


def _between(sigma: Sequence[float]) -> str:
    return f"σ of principal points {min(sigma):.1f}–{max(sigma):.1f} µm"


def _sigma_of_heads_printed() -> str:
    return _between(
        [1e3 * printed.sigma(1, name, h) for name in ("xp_mm", "yp_mm") for h in printed.HEADS]
    )


def _sigma_of_heads(run: Told) -> str:
    return principal_points(folder.rows(run.found, "parameters", "heads/bundle"), run.truth)


def principal_points(rows: pd.DataFrame, truth: Mapping[str, Mapping[str, float]]) -> str:
    """Return the standard deviations of principal points, and the largest true error if known.

    Parameters
    ----------
    rows : DataFrame
        Of `parameters.csv`.
    truth : mapping of str to mapping
        As `Told` has it.
    """
    rows = rows[rows["parameter"].isin(["xp_mm", "yp_mm"])]
    text = _between(list(1e3 * rows["sigma"]))
    if not truth:
        return text
    true = [truth[c][p] for c, p in zip(rows["camera"], rows["parameter"], strict=True)]
    return f"{text}, true error up to {1e3 * (rows['value'] - true).abs().max():.0f} µm"


def _quality_printed() -> str:
    return f"residuals of about {printed.statement('synthetic_quality_um'):g} µm, of image points"


def _quality(run: Told) -> str:
    """Return the numbers with which the chapter answers."""
    sentence = run.answers["02-synthetic-image"][0]
    um, px = (re.findall(rf"([\d.]+) {unit}", sentence) for unit in ("µm", "px"))
    if not um:
        return UNANSWERED
    share = f"{um[0]} µm where heads overlap, one head's share of the differences of matched points"
    if len(px) < 2:
        return share
    return f"{share}: {px[0]} px after rotations, {px[1]} px after mean differences"


def _both(four: Told, ideal: Told | None, camera: str) -> tuple[str, str]:
    """Return the differences of the methods, and the accuracy."""
    if ideal is None:
        return _shifts(four, camera), _rms(four)
    pairs = (
        (_shifts(ideal, camera), _shifts(four, camera, title="")),
        (_rms(ideal), _rms(four, title="")),
    )
    by_shift, by_rms = (
        f"{of_ideal} (ideal camera); {of_heads} (four heads)" for of_ideal, of_heads in pairs
    )
    return by_shift, by_rms


def _listed(shifts: Sequence[float], title: str) -> str:
    return f"{title}{', '.join(f'{1e3 * shift:+.1f}' for shift in shifts)} µm"


SHIFTS = "two-step less single-step $f$, $x_p$, $y_p$: "


def _shifts_printed() -> str:
    return _listed(printed.differences(3, "two_step", "single_step", SHIFTED), SHIFTS)


def _shifts(run: Told, camera: str, title: str = SHIFTS) -> str:
    two, single = (
        folder.parameters(run.found, f"mounting/{method}", camera)["value"]
        for method in (TWO_STEP, "single_step")
    )
    return _listed([two[name] - single[name] for name in SHIFTED], title)


SHIFTED = ("f_mm", "xp_mm", "yp_mm")


def _accuracy(rms: Sequence[float], title: str) -> str:
    return f"{title}{math.hypot(*rms[:2]):.2f} m in plan, {rms[2]:.2f} m in height"


RMS = "RMS over pairs of images "


def _rms_printed() -> str:
    return _accuracy([printed.value(4, f"rms_{axis}_m", "single_step") for axis in AXES], RMS)


def _rms(run: Told, title: str = RMS) -> str:
    pairs = folder.rows(run.found, "validation", "validation/single_step")
    return _accuracy([math.sqrt((pairs[f"d_{axis}_m"] ** 2).mean()) for axis in AXES], title)


TABLE_3 = ("f_mm", "xp_mm", "yp_mm", *(f"lever_{axis}_m" for axis in "xyz"), *BORESIGHT_ANGLES)
"""Rows of the small Table 3."""


def small_table_3(runs: Mapping[str, folder.Results], camera: str) -> str:
    """Return the mounting of both methods beside the printed one, as a MyST table.

    Parameters
    ----------
    runs : mapping of str to Results
        With the stage mounting, by the kind of images.
    camera : str
        Name of the synthetic camera.
    """
    columns: dict[str, list[str]] = {}
    for title, column, method in (
        ("two-step", "two_step", ""),
        ("plain two-step", "", "two_step"),
        ("two-step, GNSS positions", "", TWO_STEP),
        ("single-step", "single_step", "single_step"),
    ):
        if column:
            columns[f"paper, {title}"] = [printed.shown(3, name, column) for name in TABLE_3]
        if not method:
            continue
        for made_of, results in runs.items():
            ours = folder.parameters(results, f"mounting/{method}", camera)
            columns[f"{made_of}, {title}"] = [
                value_and_sigma(ours["value"][name], ours["sigma"][name])
                if name in ours.index
                else "held"
                for name in TABLE_3
            ]
    units = printed.table(3).drop_duplicates("parameter").set_index("parameter")["unit"]
    names = [with_unit(LABELS[name], units[name]) for name in TABLE_3]
    table = pd.DataFrame({"Parameter": names, **columns})
    caption = (
        "From the paper's Table 3: interior orientation and mounting, printed and of simulated "
        "flights"
    )
    return myst_table(table, caption, name="tab-front") + "\n"
