from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from acx4book.teaching import flights, grading
from acx4book.teaching.sheets import intersection
from acx4book.teaching.sheets.every import SHEETS


def test_the_points_are_the_simulators_within_sigma(solved):
    """The squares of errors over σ; a σ that is a third off would show."""
    errors = []
    for k in range(20):
        _, right = solved("lab-3", f"Student {k}")
        errors += [
            (right[name].value - right[name].truth) / right[name].sigma
            for name in intersection.POINT
        ]
    low, high = chi2.ppf([0.0005, 0.9995], 60)  # three axes of a point are weakly correlated
    assert 0.6 * low < np.sum(np.square(errors)) < 1.4 * high


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"lever_x_m": 0.0, "lever_y_m": 0.0, "lever_z_m": 0.0}, "lever arm is forgotten"),
        (dict.fromkeys(("k1", "k2", "k3", "p1", "p2"), 0.0), "distortion is forgotten"),
        ({"mount_omega_deg": 0.0, "mount_phi_deg": 0.0, "mount_kappa_deg": 90.0}, "small angles"),
    ],
)
def test_a_mistake_made_in_the_flights_files_is_named(changed, says, key, solved, handed):
    flight = flights.flight_of(SHEETS["lab-3"], "Ada", key)
    lines = [
        f"{name} = {changed[name]}" if (name := line.split(" = ")[0]) in changed else line
        for line in flight.toml.splitlines()
    ]
    spoilt = flights.case_of(replace(flight, toml="\n".join(lines) + "\n"))
    wrong = {name: answer.value for name, answer in SHEETS["lab-3"].solve(spoilt).items()}
    case, right = solved("lab-3", "Ada")
    verdicts = grading.graded(SHEETS["lab-3"], case, handed("lab-3", right, **wrong))
    assert [v for v in verdicts if v.says]
    assert all(says in v.says for v in verdicts if v.says)
