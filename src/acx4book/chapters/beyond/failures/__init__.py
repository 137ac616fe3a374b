"""Chapter 14, the failure clinic: common mistakes planted in a flight, and what shows each of them.

`mistakes` plants them, `examined` runs a flight as a user would and keeps what the commands say
and what the residuals are; `figures` and `sentences` show it. Begin with `mistakes`.
"""
