"""What the notebooks of the first stages call: the steps, and tables and sentences of them."""

from acx4lib.stages import flight, head_sentences, head_tables, heads, synthetic

__all__ = ["flight", "head_sentences", "head_tables", "heads", "synthetic"]
