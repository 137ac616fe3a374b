"""Pages of the book without a notebook, and the files that the book is built from.

``python -m acx4book.pages FLIGHT RESULTS BOOK`` calls `build`, which fills ``_executed`` and
``_generated``: executed notebooks, the pages on the `study` and its `reproducibility`, the figures
of the `frames`, the pages on long runs (`benchmarks`), downloads (`release`), and the pages of the
programming interface. `flight_book` makes a book of one flight, `pdf` prints a book, and `words`
counts its prose.
"""
