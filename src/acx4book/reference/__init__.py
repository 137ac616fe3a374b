"""Other people's measurements and results, held against ours (chapters 5 and 11).

`data` says which files they are and where they lie, `comparisons` computes all, or shows the last
ones where files are missing. One file or folder for each source, which also converts its
conventions: `dbat`, `nist`, `noaa`, `ign`, `heads`. Begin with `comparisons`.
"""
