"""Pictures and cameras of which tests know every pixel."""
