"""``acx4 plan`` and ``acx4 simulate``: flights that are planned, and flown without an aircraft.

`plan` and `simulate` are the commands. `to_simulator` gives a plan to the simulator, which reads
none, as plain numbers; `of_design` makes a plan of one of its designs. `picture` draws a plan.
"""
