"""The stages of the paper: computed from a flight, and written to the results folder.

`heads` calibrates and orients the heads (sections 2.1 and 4.1, Table 1); `synthetic` refines them
for the synthetic image (2.1, Table 2, Figure 1), from their `pictures` where there are any, and
transfers points measured in heads into it; `mounting` estimates interior orientation, boresight and
lever arm (2.2 and 4.2, Table 3), `rig` those of all heads together; `validation` tests direct
georeferencing (4.3, Table 4). Each is one function `run`, and small functions for what it reads and
writes, which a notebook calls with the methods of `calibration` between them. `attempt` calls a
method that may have no outcome. `order` says which stage a flight has data for. Begin with `heads`.
"""

from acx4lib.attempts import Failed, attempt

__all__ = ["Failed", "attempt"]
