"""Fill the book's folder: ``python -m acx4book.pages FLIGHT RESULTS BOOK [IDEAL]``."""

import sys
from pathlib import Path

from acx4book.pages import build
from acx4lib.errors import Acx4Error

if __name__ == "__main__":
    try:
        build.fill(*map(Path, sys.argv[1:5]))
    except Acx4Error as error:  # results that were changed, a notebook that failed
        sys.exit(str(error))
