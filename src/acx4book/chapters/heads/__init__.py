"""Chapter 1, the heads: interior and relative orientation (section 4.1, Table 1)."""
