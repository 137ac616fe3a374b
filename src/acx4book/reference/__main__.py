"""Computes and stores all comparisons: ``python -m acx4book.reference``."""

from __future__ import annotations

import sys

from acx4book.reference import comparisons
from acx4book.reference.data import ReferenceDataError

if __name__ == "__main__":
    try:
        comparisons.store()
    except ReferenceDataError as error:
        sys.exit(str(error))
