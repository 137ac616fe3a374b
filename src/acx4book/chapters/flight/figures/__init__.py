"""Drawings of chapter 0: one `exposure` in space, the paper's `system` and its `target`."""
