"""Chapter 3, the mounting: interior orientation, boresight, lever arm (section 4.2, Table 3)."""
