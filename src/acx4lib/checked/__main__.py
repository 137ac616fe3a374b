"""Computes all comparisons anew and stores them: ``python -m acx4lib.checked``."""

from __future__ import annotations

import sys

from acx4lib import checked
from acx4lib.reference import ReferenceDataError

if __name__ == "__main__":
    try:
        checked.store()
    except ReferenceDataError as error:
        sys.exit(str(error))
