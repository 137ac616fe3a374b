"""The pages of the book that no notebook makes, and the filling of the book's folder.

``python -m acx4book.pages FLIGHT RESULTS BOOK`` calls `build`, which fills ``_executed`` and
``_generated``: notebooks, the truth of a `simulation`, `provenance`, the `example` on the page
about the library, the figures of the `frames`, the pages of this interface (`api`), and the pages
on long runs (`benchmarks`).
"""
