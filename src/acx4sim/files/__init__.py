"""A simulated flight as a folder: its tables, its flight.toml, its truth."""
