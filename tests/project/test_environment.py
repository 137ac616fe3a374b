"""The lists of versions agree with each other and with what README.md says of them."""

import re

import pytest

from support.helpers import ROOT

FILES = (
    "environment.txt",
    "environment-lab.txt",
    "environment-test.txt",
    "environment-bench.txt",
)
PIN = re.compile(r"^([\w.-]+)==(\S+)$", re.MULTILINE)


def pins(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    found = {re.sub(r"[-_.]+", "-", key).lower(): value for key, value in PIN.findall(text)}
    assert len(found) == sum(not line.startswith("#") for line in text.splitlines() if line)
    return found


@pytest.mark.parametrize("name", FILES)
def test_the_lock_holds_every_pin(name):
    lock = pins("environment.lock")
    assert {key: lock.get(key) for key in pins(name)} == pins(name)


@pytest.mark.parametrize("name", FILES)
def test_readme_gives_a_reason_for_every_package(name):
    table = (ROOT / "README.md").read_text(encoding="utf-8").split("## Dependencies")[1]
    rows = re.findall(r"^\| ([^|]+) \|", table, flags=re.MULTILINE)
    named = {re.sub(r"[-_.]+", "-", package).lower() for row in rows for package in row.split(", ")}
    assert set(pins(name)) <= named
