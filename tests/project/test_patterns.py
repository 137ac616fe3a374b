"""Every pattern of the sources takes linear time, whatever text a stranger gives it.

Patterns are taken from the modules: those that are compiled there, and those that stand in a call.
"""

import ast
import importlib
import pkgutil
import re
import time
from re import _parser as parser

import pytest

import acx4book
import acx4lib
from support.helpers import ROOT

LENGTH = 100_000
SECONDS = 0.5
"""Linear ones take some milliseconds; quadratic ones minutes."""

OFFLINE = {"acx4book.command.batch.executors", "acx4book.pages.__main__"}
"""Modules that are no library, or need what is optional."""

CALLS = ("compile", "search", "match", "fullmatch", "finditer", "findall", "sub", "split")
OF_CATEGORY = {
    parser.CATEGORY_DIGIT: "7",
    parser.CATEGORY_SPACE: " \n",
    parser.CATEGORY_WORD: "a_7",
    parser.CATEGORY_NOT_DIGIT: "a",
    parser.CATEGORY_NOT_SPACE: "a\"'",
    parser.CATEGORY_NOT_WORD: " -",
}


def compiled():
    """Yield the patterns that modules of the two houses have."""
    for house in (acx4lib, acx4book):
        for found in pkgutil.walk_packages(house.__path__, f"{house.__name__}."):
            if found.name not in OFFLINE and not found.name.endswith("__main__"):
                module = importlib.import_module(found.name)
                values = [one for value in vars(module).values() for one in inside(value)]
                yield from (one for one in values if isinstance(one.pattern, str))


def inside(value):
    """Yield the patterns in a value."""
    if isinstance(value, re.Pattern):
        yield value
    elif isinstance(value, dict):
        yield from (one for each in value.values() for one in inside(each))
    elif isinstance(value, list | tuple):
        yield from (one for each in value for one in inside(each))


def in_calls():
    """Yield the patterns that stand in calls of the module re."""
    for path in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            named = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
            if named and getattr(node.func.value, "id", "") == "re" and node.func.attr in CALLS:
                text, *others = node.args
                flags = [
                    name.attr
                    for one in (*others, *(k.value for k in node.keywords))
                    for name in ast.walk(one)
                    if isinstance(name, ast.Attribute)
                    and isinstance(getattr(re, name.attr, None), re.RegexFlag)
                ]
                if isinstance(text, ast.Constant):
                    whole = 0
                    for name in flags:
                        whole |= getattr(re, name)
                    yield re.compile(text.value, whole)


PATTERNS = {(one.pattern, one.flags): one for one in (*compiled(), *in_calls())}


def mentioned(pattern):
    """Return the characters that a pattern mentions, and one of each kind."""
    parts = parser.parse(pattern.pattern, pattern.flags & ~re.UNICODE.value)
    return sorted({one for part in every(parts) for one in characters(*part)})[:40]


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


@pytest.mark.parametrize("pattern", PATTERNS.values(), ids=lambda one: one.pattern[:60])
def test_a_pattern_takes_linear_time(pattern):
    kinds = mentioned(pattern)
    for kind in (*kinds, "a", " "):
        for before, after in (
            ("", ""),
            ("", "\0"),
            *((one, "") for one in kinds[:12]),
            *(("", one) for one in kinds[:12]),
        ):
            text = before + kind * LENGTH + after
            start = time.process_time()
            pattern.fullmatch(text)
            pattern.search(text)
            for _ in pattern.finditer(text):
                pass
            assert time.process_time() - start < SECONDS, (before, kind, after)


def test_the_patterns_are_found():
    assert len(PATTERNS) > 60
    assert '"' in mentioned(re.compile('"[^"]*"'))
