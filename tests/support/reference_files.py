"""Tests on other people's files: skipped where these are missing, unless they are required."""

from __future__ import annotations

import os

import pytest

from acx4book.reference import data

REQUIRED = bool(os.environ.get("ACX4_REQUIRE_REFERENCE"))


def needs(name: str) -> pytest.MarkDecorator:
    """Skip without the files of a set; where ACX4_REQUIRE_REFERENCE is set, fail instead."""
    missing = not data.is_here(name) and not REQUIRED
    return pytest.mark.skipif(missing, reason=f"{name}: {data.HINT}")
