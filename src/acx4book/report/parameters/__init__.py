"""The calibrated parameters: `estimates` with tests and correlations, and their `tables`."""
