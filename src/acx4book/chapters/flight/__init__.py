"""Chapter 0, the flight that is read (section 3.2)."""
