"""Other people's measurements and results, compared with ours (chapters 5 and 11).

`comparisons` computes all comparisons, or shows stored ones where files are missing; `data` has the
index of the files, and fetches them. One module or two for each source, which also convert its
conventions: `dbat_files` and `dbat_statements`, `nist`, `noaa`, `ign`, `heads`, `four_heads`. Begin
with `comparisons`.
"""
