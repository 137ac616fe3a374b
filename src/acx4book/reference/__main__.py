"""Computes and stores all comparisons, and the flight of four heads: `make reference-results`."""

from __future__ import annotations

import sys

from acx4book.reference import comparisons, four_heads
from acx4book.reference.data import ReferenceDataError

if __name__ == "__main__":
    try:
        comparisons.store()
        four_heads.store()
    except ReferenceDataError as error:
        sys.exit(str(error))
