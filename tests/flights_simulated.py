"""Simulated flights as a user's would be read, and what the methods make of them.

Everything is computed once per process, whoever asks first.
"""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib import calibration, flight, mounting, relative_orientation, simulate, tie_points

EXACT = {"image_noise": 0.0, "control_noise": 0.0, "gnss_noise": 0.0, "attitude_noise": 0.0}

@cache
def fly(design, seed, blocks, exact=False):
    options = simulate.Options(blocks=blocks, **(EXACT if exact else {}))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / design
        simulate.write(simulate.DESIGNS[design](seed=seed, options=options), path)
        truth = json.loads(simulate.truth_path(path).read_text())
        return flight.read(path), truth

