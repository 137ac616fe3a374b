"""Chapter 8, all heads in one adjustment."""
