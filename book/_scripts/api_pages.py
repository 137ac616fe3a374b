"""Write a page for each module of the library: ``python api_pages.py FOLDER``.

A package has one page too: what its ``__init__`` offers.
"""

from __future__ import annotations

import pkgutil
import sys
from pathlib import Path

import acx4lib

PAGE = """# {name}

```{{eval-rst}}
.. automodule:: acx4lib.{name}
```
"""


def main(folder: Path) -> None:
    """Write the pages, and remove those of modules that are gone."""
    names = [m.name for m in pkgutil.iter_modules(acx4lib.__path__) if not m.name.startswith("_")]
    pages = {f"{name.replace('_', '-')}.md": PAGE.format(name=name) for name in names}
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.glob("*.md"):
        if path.name not in pages:
            path.unlink()
    for file, text in pages.items():
        (folder / file).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
