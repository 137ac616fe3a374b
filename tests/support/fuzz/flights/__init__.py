"""Flights with mutations, read as `acx4 check` reads them, and some of them adjusted."""
