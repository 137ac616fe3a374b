"""Chapter 2, the synthetic image: tie points, refinement, pixels (section 2.1, Table 2)."""
