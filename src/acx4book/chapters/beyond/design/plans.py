"""The plan of the paper's calibration flight."""

from __future__ import annotations

from collections.abc import Sequence

from acx4book.notebooks.simulated import of_design
from acx4lib.planning import text
from acx4lib.planning.plan import Plan
from acx4sim.designs import acx4_ideal_plan


def papers(gnss: Sequence[str] = ()) -> Plan:
    """Return the plan of the paper's calibration block, with its synthetic camera.

    Parameters
    ----------
    gnss : sequence of str
        Errors of GNSS that are unknown as well, such as ``shift``.
    """
    values = of_design.values(acx4_ideal_plan())
    values["stages"]["mounting"]["gnss"] = [*gnss]
    return text.from_values({k: v for k, v in values.items() if k not in ("heads", "validation")})
