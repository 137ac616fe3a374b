"""Folders that a command may write to: its own, one process at a time, every file listed.

`claims` takes a folder, `marks` lists what was written with its checksum, `locks` says who is
writing, and `places` where nobody may.
"""
