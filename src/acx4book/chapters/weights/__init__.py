"""Chapter 9, standard deviations: given wrong, estimated, and errors that change slowly."""
