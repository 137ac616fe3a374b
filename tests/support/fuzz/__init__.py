"""Flights with mutations, read as `acx4 check` reads them: every outcome must be a sentence."""
