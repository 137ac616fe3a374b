"""A user's flight, its folder read and checked (section 3.2).

`reader` lists all problems of a folder at once, or returns the whole `Flight`; odd values become
notes; `from_tables` does the same with tables in memory. A flight's blocks are plain arrays,
`block`; `design` has their heights, strips and overlaps. `tables` and `settings` declare columns
and keys, `table_files` and `toml_file` read them; `reader` finds what contradicts what.
Layout and rules of the folder: part *Your own flight* of the book. Begin with `reader`, then
`block`; after them `settings`, `block_from_tables`, `problems`, `summary`.
"""

from acx4files.flight.reader import Flight, from_tables, read, read_kept
from acx4files.flight.summary import summary

__all__ = ["Flight", "from_tables", "read", "read_kept", "summary"]
