"""Chapter 4, direct georeferencing on an independent block (section 4.3, Table 4)."""
