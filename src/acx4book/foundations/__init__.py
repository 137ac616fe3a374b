"""Part I of the book, foundations: what the chapters of theory need beside the library.

`example` is the flight of four images that goes through all chapters, `shown` sets vectors and
matrices as mathematics. `adjusting` has its adjustments, `drawings` a module of
figures for each chapter.
"""
