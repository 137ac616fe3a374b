"""Chapter 14, the failure clinic: common mistakes planted in a flight, and what shows each of them.

`mistakes` has the flight and changes its tables, `examined` runs a flight as a user would and keeps
what the commands say and what the residuals are; `figures` and `tables` show it. Begin with the
notebook.
"""
