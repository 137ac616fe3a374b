"""``acx4 plan`` and ``acx4 simulate``: flights that are planned, and flown without an aircraft.

`plan` and `simulate` are the commands. `target` shows the strips that were chosen for a target.
"""
