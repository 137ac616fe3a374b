"""What the notebooks of the first stages call: the steps, and tables and sentences of them."""

from acx4lib.stages import flight, heads, synthetic

__all__ = ["flight", "heads", "synthetic"]
