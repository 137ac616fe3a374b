"""Every pattern that reads strangers' text takes linear time, whatever the text.

Patterns are taken from the sources, each with the ways in which it is used: `fullmatch` begins in
one place, `search` in every place, so that the same pattern may be linear in one way only.
"""

from __future__ import annotations

import ast
import importlib
import re
import time
from collections import Counter
from heapq import nlargest
from itertools import product
from re import _parser as parser

import pytest

from support.fuzz import results as cases_of_results
from support.fuzz import run
from support.fuzz import strangers as cases_of_strangers
from support.helpers import ROOT, parsed, repeats

LENGTH = 100_000
SECONDS = 0.5
"""Linear ones take some milliseconds; quadratic ones from 10 s to minutes."""

OWN_TEXT = {f"acx4book/{name}" for name in ("chapters", "pages", "paper", "reference")}
OWN_TEXT |= {"acx4book/typesetting/svg.py"}
"""These read what the project wrote itself, or files whose checksums it knows."""

USES = ("search", "match", "fullmatch", "finditer", "findall", "sub", "split")
OF_CATEGORY = {
    parser.CATEGORY_DIGIT: "7",
    parser.CATEGORY_SPACE: " \n",
    parser.CATEGORY_WORD: "a_7",
    parser.CATEGORY_NOT_DIGIT: "a",
    parser.CATEGORY_NOT_SPACE: "a\"'",
    parser.CATEGORY_NOT_WORD: " -",
}


def sources():
    """Yield the modules that read strangers' text, by names and as trees."""
    for path in sorted((ROOT / "src").rglob("*.py")):
        place = path.relative_to(ROOT / "src").as_posix()
        text = path.read_text("utf-8")
        if "import re\n" in text and not any(place.startswith(f"{one}/") for one in OWN_TEXT):
            yield place.removesuffix(".py").replace("/", "."), parsed(path)


def used():
    """Return the patterns of the sources, and how each is used."""
    trees = dict(sources())
    found = {}
    for name, tree in trees.items():
        calls = [
            (node, node.func.value, node.func.attr)
            for node in ast.walk(tree)
            if isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr in USES
        ]
        module = importlib.import_module(name)
        for node, of, use in calls:
            for pattern in meant(node, of, module):
                found.setdefault((pattern.pattern, pattern.flags), (pattern, set()))[1].add(use)
    return found.values()


def meant(call, of, module):
    """Yield the patterns that a call uses: those of the module, or the one that it contains."""
    if isinstance(of, ast.Name) and of.id == "re":
        text, *others = call.args
        others += [one.value for one in call.keywords]
        flags = [node.attr for one in others for node in ast.walk(one) if is_flag(node)]
        if isinstance(text, ast.Constant):
            yield re.compile(text.value, sum({getattr(re, name) for name in flags}))
        elif isinstance(text, ast.Name):
            forms = [form for form, _ in vars(module).get("FORMS", ())]
            assert forms, f"{module.__name__}: which patterns are {text.id}?"
            yield from map(re.compile, forms)
        return
    names = [node for node in ast.walk(of) if isinstance(node, ast.Name)]
    values = [vars(module).get(node.id) for node in names]
    if isinstance(of, ast.Attribute):
        values += [getattr(value, of.attr, None) for value in values]
    yield from (one for one in values if isinstance(one, re.Pattern))


def is_flag(node):
    return isinstance(node, ast.Attribute) and hasattr(re.RegexFlag, node.attr)


def compiled():
    """Return the patterns that modules keep under a name."""
    modules = [importlib.import_module(name) for name, _ in sources()]
    values = [value for module in modules for value in vars(module).values()]
    return {one.pattern for one in values if isinstance(one, re.Pattern)}


PATTERNS = {pattern.pattern: (pattern, sorted(uses)) for pattern, uses in used()}


def mentioned(pattern):
    """Return the characters that a pattern mentions, one of each kind."""
    parts = parser.parse(pattern.pattern, pattern.flags & ~re.UNICODE.value)
    return sorted({one for part in every(parts) for one in characters(*part)})


def every(parts):
    """Yield each part of a parsed pattern, (kind, value), and the parts inside."""
    if isinstance(parts, parser.SubPattern):
        for kind, value in parts:
            yield kind, value
            yield from every(value)
    elif isinstance(parts, tuple) and parts and isinstance(parts[0], type(parser.LITERAL)):
        yield parts
    elif isinstance(parts, tuple | list):
        for one in parts:
            yield from every(one)


def characters(kind, value):
    """Return characters that a part of a pattern stands for."""
    if kind in (parser.LITERAL, parser.NOT_LITERAL):
        return chr(value)
    if kind is parser.CATEGORY:
        return OF_CATEGORY[value]
    if kind is parser.RANGE:
        return chr(value[0])
    return "a" if kind is parser.ANY else ""


def seconds(pattern, uses, text):
    """Return how long a pattern takes for a text, processor time."""
    if isinstance(pattern.pattern, bytes):
        text = text.encode()
    start = time.process_time()
    for use in uses:
        if use == "finditer":
            for _ in pattern.finditer(text):
                pass
        elif use == "sub":
            pattern.sub(text[:0], text)
        else:
            getattr(pattern, use)(text)
    return time.process_time() - start


@pytest.mark.parametrize(("pattern", "uses"), PATTERNS.values(), ids=[p[:60] for p in PATTERNS])
def test_a_pattern_takes_linear_time(pattern, uses):
    kinds = [*dict.fromkeys((*mentioned(pattern), "a", " "))][:40]
    for kind in kinds:
        assert seconds(pattern, uses, kind * LENGTH + "\0") < SECONDS, kind
    for before, one in slowest(pattern, uses, kinds):
        text = before + one * (LENGTH // len(one)) + "\0"
        assert seconds(pattern, uses, text) < SECONDS, (before, one)


def slowest(pattern, uses, kinds, n=2000):
    """Return what took longest of short texts: a beginning, and what is repeated after it.

    A quadratic pattern stands out here already: it takes some 100 times as long as a linear one.
    """
    both = [one for a, b in product(kinds, kinds) for one in ((a, b), ("", a + b))]
    own = [(seconds(pattern, uses, a + b * (n // len(b)) + "\0"), a, b) for a, b in both]
    return [(before, one) for _, before, one in nlargest(5, own)]


def test_the_patterns_are_found():
    assert len(PATTERNS) > 40
    assert '"' in mentioned(re.compile('"[^"]*"'))


def test_every_pattern_with_a_name_is_tried():
    one_of_two = {r"\{(numref|eq|doc)\}`([^`\n]+)`", r"\$([^$\n]+)\$"}  # the report's own text
    assert compiled() - one_of_two <= set(PATTERNS)


def test_a_quadratic_pattern_would_be_found():
    for form, use in ((r"\s*x", "search"), (r"(\w[\w,]*) ", "sub"), (r"<[^>]*>", "findall")):
        pattern = re.compile(form)
        before, one = slowest(pattern, [use], mentioned(pattern))[0]
        short, long = (
            min(seconds(pattern, [use], before + one * n) for _ in range(3)) for n in (400, 3200)
        )
        assert long > 16 * short, form


# --- mutated files are read or refused by sentences, in 10 s and 1 GB each ---------------------


@pytest.mark.parametrize("cases", [10, repeats(500)])
def test_no_mutated_flight_crashes_hangs_or_fills_the_memory(tmp_path, cases):
    """`make fuzz` draws others."""
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1)
    assert not report.findings, "\n".join(report.findings)
    assert sum(report.outcomes.values()) == cases
    outcomes = {outcome for _, outcome in report.outcomes}
    assert {"accepted", "refused", "computed"} <= outcomes


@pytest.mark.parametrize("cases", [10, repeats(300)])
def test_no_mutated_file_of_another_program_crashes_hangs_or_fills_the_memory(tmp_path, cases):
    """So many cases of every kind of import, and of exports of mutated results."""
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1, what="strangers")
    assert not report.findings, "\n".join(report.findings)
    by_kind = Counter(kind.split()[0] for kind, _ in report.outcomes.elements())
    assert by_kind == dict.fromkeys(cases_of_strangers.KINDS, cases)
    assert {outcome for _, outcome in report.outcomes} == {"accepted", "refused"}


@pytest.mark.parametrize("cases", [repeats(25), repeats(500)])
def test_no_results_that_were_tampered_with_crash_hang_or_fill_the_memory(tmp_path, cases):
    """Most have checksums that were computed anew."""
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1, what="results")
    assert not report.findings, "\n".join(report.findings)
    assert {kind.split()[0] for kind, _ in report.outcomes} == set(cases_of_results.COMMANDS)
    assert {outcome for _, outcome in report.outcomes} == {"accepted", "refused"}


@pytest.mark.parametrize("cases", [repeats(25), repeats(500)])
def test_no_mutated_archive_crashes_hangs_or_fills_the_memory(tmp_path, cases):
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1, what="archives")
    assert not report.findings, "\n".join(report.findings)
    assert {outcome for _, outcome in report.outcomes} == {"accepted", "refused"}
