"""Fill the book's folder, or build one chapter alone.

``python -m acx4book.pages FLIGHT RESULTS BOOK [IDEAL]`` or ``... chapter NAME RESULTS SITE``.
"""

import sys
from pathlib import Path

from acx4book.pages import build, flight_book
from acx4lib.errors import Acx4Error

if __name__ == "__main__":
    try:
        if sys.argv[1] == "chapter":
            flight_book.write_chapter(sys.argv[2], *map(Path, sys.argv[3:5]))
        else:
            build.fill(*map(Path, sys.argv[1:5]))
    except Acx4Error as error:  # changed results, a failed notebook
        sys.exit(str(error))
