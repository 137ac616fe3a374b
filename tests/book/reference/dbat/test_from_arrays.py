"""The page on the library calibrates a camera from two files: judged by what DBAT printed."""

import contextlib
import re
from pathlib import Path

import numpy as np

from acx4book.reference import data, dbat_files
from support.reference_files import needs

PAGE = Path(__file__).parents[4] / "book" / "library.md"
NAMES = (
    "Camera Constant",
    "px - principal point x",
    "py - principal point y",
    "as - off-unit aspect parameter",
    "K1 - radial distortion 1",
    "K2 - radial distortion 2",
    "K3 - radial distortion 3",
    "P1 - decentering distortion 1",
    "P2 - decentering distortion 2",
)


def code():
    (found,) = re.findall(r"```{code-block} python\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    return found


@needs("dbat-camcal")
def test_the_page_s_lines_give_every_printed_digit_of_the_camera():
    names = {}
    with contextlib.chdir(data.path("dbat-camcal/images.txt").parent):
        exec(compile(code(), str(PAGE), "exec"), names)
    fit = names["fit"]
    cov = fit.solution.sigma0_sq * fit.solution.cov[:9, :9]
    order = [("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2", "b1").index(n) for n in names["free"]]
    values, cov = dbat_files.interior_to_dbat(fit.cameras[0], cov[np.ix_(order, order)])
    printed = dbat_files.read(data.path("dbat-camcal/reference_report.txt"))
    place = ("Information from last bundle", "Cameras", "Camera1 (simple)")
    for name, value, sigma in zip(NAMES, values, np.sqrt(np.diag(cov)), strict=True):
        for what, ours in (("Value", value), ("Deviation", sigma)):
            (text,) = printed[(*place, name, what)].numbers
            assert abs(ours - float(text)) <= dbat_files.last_digit(text), (name, what)
    assert fit.solution.redundancy == 3725
