"""MicMac's distortion models: from the ideal pixel to the measured one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.micmac import lens
from acx4lib.exchange.safe import xml_tree
from acx4lib.exchange.safe.opened import Opened

COLROW = np.array([[0.0, 0.0], [999, 799], [510, 390], [100, 700]])


def read(text):
    root = xml_tree.tree(Opened(file="AutoCal.xml", data=text.encode()))
    return lens.read(root.one("CalibrationInternConique"))


def test_what_it_adds_to_ideal_pixels_leads_back(calibration):
    one = read(calibration)
    ideal = 1000 * one.ideal(COLROW) + [500, 400]
    x, y = (ideal - [510, 390]).T
    r2 = x * x + y * y
    p1, p2, b1 = (1e-6, -2e-6, 1e-4) if "P1" in calibration else (0, 0, 0)
    col = ideal[:, 0] + x * 1e-8 * r2 + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y + b1 * x
    row = ideal[:, 1] + y * 1e-8 * r2 + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    assert_allclose(np.stack([col, row], axis=1), COLROW, atol=1e-8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("_DistM2C", "_DistC2M"), "KnownConv: 'eConvApero_DistC2M'; must be eConvApero_DistM2C"),
        (("ModNoDist", "ModGrid"), "ModGrid: distortion 'ModGrid'; must be ModNoDist, ModRad"),
        (("<F>1000</F>", ""), "'?<F> is missing"),
        (("<F>1000</F>", "<F>-5</F>"), "F: '-5'; must be a focal length in pixels"),
        (("1000 800", "1000"), "SzIm: '1000'; must be 2 numbers"),
        (("<ModNoDist></ModNoDist>", ""), "CalibDistortion: holds 0 models; must hold one"),
    ],
)
def test_other_calibrations_are_refused(calibrations, change, message):
    text = calibrations.format(model="<ModNoDist></ModNoDist>").replace(*change)
    with pytest.raises(FlightError, match=message):
        read(text)


def test_a_unified_model_is_named(calibrations):
    text = calibrations.format(model="<ModUnif><TypeModele>eModeleEbner</TypeModele></ModUnif>")
    with pytest.raises(FlightError, match="distortion 'ModUnif eModeleEbner'; must be ModNoDist"):
        read(text)
