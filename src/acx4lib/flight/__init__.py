"""A user's flight: its folder read, checked and summarised.

The layout and every rule stand in the flight-data contract. `read` says everything that is
wrong at once; what is merely odd becomes a note.
"""

from acx4lib.flight.reader import Flight, read, read_kept, table_files
from acx4lib.flight.setup import Apriori, Synthetic
from acx4lib.flight.summary import summary

__all__ = ["Apriori", "Flight", "Synthetic", "read", "read_kept", "summary", "table_files"]
