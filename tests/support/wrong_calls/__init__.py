"""Calls that a stranger makes, and the sentences that answer them, for `test_misuse`."""
