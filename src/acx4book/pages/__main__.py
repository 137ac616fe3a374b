"""Fill the book's folder, run the chapters that depend on no flight, or build one chapter alone.

``python -m acx4book.pages FLIGHT RESULTS BOOK [IDEAL]``, ``... chapters IDEAL`` or
``... chapter NAME RESULTS SITE``.
"""

import sys
from pathlib import Path

from acx4book.pages import build, flight_book, study
from acx4lib.errors import Acx4Error

if __name__ == "__main__":
    try:
        if sys.argv[1] == "chapter":
            flight_book.write_chapter(sys.argv[2], *map(Path, sys.argv[3:5]))
        elif sys.argv[1] == "chapters":
            study.run(Path(sys.argv[2]))
        else:
            build.fill(*map(Path, sys.argv[1:5]))
    except Acx4Error as error:  # changed results, a failed notebook
        sys.exit(str(error))
