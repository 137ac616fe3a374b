"""The distribution, built without the network, installed outside of the checkout, and run there."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import acx4 as acx
import acx4sim
from acx4book.pages import flight_book
from support.helpers import parsed

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
PRESENT = sysconfig.get_path("purelib")
HOUSES = {"acx4", "acx4lib", "acx4files", "acx4sim", "acx4book"}
PTH = "present.pth"
PARTS = {"llvmlite": "numba", "cycler": "matplotlib"}
"""Packages that another one brings, as a part of itself."""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """What the distribution is made of, so that nothing is left in the checkout."""
    folder = tmp_path_factory.mktemp("copy")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    made = shutil.ignore_patterns("__pycache__", "*.egg-info")
    shutil.copytree(ROOT / "src", folder / "src", symlinks=True, ignore=made)
    shutil.copytree(ROOT / "notebooks", folder / "notebooks")
    built = shutil.ignore_patterns("_build", "_executed", "_generated", "__pycache__")
    shutil.copytree(ROOT / "book", folder / "book", ignore=built)
    downloaded = shutil.ignore_patterns("files", "flights")
    shutil.copytree(ROOT / "data", folder / "data", ignore=downloaded)
    return folder


@pytest.fixture(scope="module")
def wheel(copy, tmp_path_factory):
    out = tmp_path_factory.mktemp("wheel")
    pip(sys.executable, "wheel", "--no-build-isolation", "--wheel-dir", out, copy)
    (file,) = out.iterdir()
    return file


def pip(python, command, *arguments):
    quiet = ("--quiet", "--disable-pip-version-check", "--no-deps", "--no-index")
    pip_of_tests = [sys.executable, "-m", "pip", "--python", python]
    said = subprocess.run(
        [*pip_of_tests, command, *quiet, *arguments], capture_output=True, text=True, check=False
    )
    assert said.returncode == 0, said.stderr


def environment(folder, *installed, present=""):
    """A new environment with the project, beside the packages of a folder; its own folder."""
    venv.create(folder, symlinks=True)
    site = next(folder.glob("lib/python*/site-packages"))
    (site / PTH).write_text(present)
    pip(folder / "bin" / "python", "install", "--ignore-installed", *installed)
    return site


def run(folder, command, *arguments, **changed):
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    kept.pop("ACX4_REFERENCE_DATA", None)
    return subprocess.run(
        [folder / "env" / "bin" / command, *arguments],
        cwd=folder,
        env={**kept, **changed},
        capture_output=True,
        text=True,
        check=False,
    )


def succeeds(*command, **changed):
    done = run(*command, **changed)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def name_of(requirement):
    return re.sub(r"[-_.]+", "-", Requirement(requirement).name).lower()


def names_of(requirements):
    return {name_of(requirement) for requirement in requirements}


def requirements(*extras):
    """What the project needs with some extras, one of which may bring another."""
    needed = [*PROJECT["dependencies"], *(line for extra in extras for line in EXTRAS[extra])]
    own = [line for line in needed if name_of(line) == "acx4lib"]
    brought = {extra for line in own for extra in Requirement(line).extras}
    others = [line for line in needed if line not in own]
    return [*others, *requirements(*brought)] if brought else others


# --- what is in it, and what it needs --------------------------------------------------------


def test_the_wheel_holds_the_packages_with_their_data_and_nothing_else(wheel):
    sources = [path for path in (ROOT / "src").rglob("*.py") if "__pycache__" not in path.parts]
    expected = {path.relative_to(ROOT / "src").as_posix() for path in sources}
    expected |= {f"{house}/py.typed" for house in HOUSES}
    expected |= {"acx4book/pages/study.md", "acx4book/paper/errata.md"}
    expected |= {
        f"acx4book/report/{name}" for name in ("consequences.md", "report.html", "report.typ")
    }
    for place, files in (
        ("acx4book/chapters/stored", "data/benchmarks/measured_flights*"),
        ("acx4book/chapters/stored", "data/benchmarks/closed_chain*"),
        (
            "acx4book/chapters/stored",
            "data/benchmarks/closed_chain_pattern.csv",
        ),
        ("acx4book/notebooks/sources", "notebooks/*.ipynb"),
        ("acx4book/notebooks/sources/template", "notebooks/template/*.ipynb"),
        ("acx4book/pages/sources", "book/_config.yml"),
        ("acx4book/pages/sources", "book/references.bib"),
        *(("acx4book/pages/sources", f"book/{page}.md") for page in flight_book.READING),
        ("acx4book/pages/sources/_ext", "book/_ext/*.*"),
        ("acx4book/pages/sources/_static", "book/_static/*"),
        ("acx4book/pages/sources/_moving", "book/_moving/[a-z]*.*"),
        ("acx4book/pages/sources/images", "book/images/*.svg"),
        ("acx4book/paper/tables", "data/paper/*.csv"),
        ("acx4book/reference/measurements", "data/reference/*.csv"),
        ("acx4book/reference/measurements/results", "data/reference/results/*.csv"),
        ("acx4book/reference/measurements/four-heads", "data/reference/four-heads/*.*"),
        ("acx4book/reference/measurements/four-heads/heads", "data/reference/four-heads/heads/*"),
        ("acx4lib/georeferencing/limits", "data/standards/*.csv"),
    ):
        found = {f"{place}/{path.name}" for path in ROOT.glob(files)}
        assert found
        expected |= found
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert held == expected


def imported(house):
    """The distributions that a package's modules import."""
    found = set()
    for path in (ROOT / "src" / house).rglob("*.py"):
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add(node.module)
    modules = {name.partition(".")[0] for name in found} - HOUSES - sys.stdlib_module_names
    return distributions(PARTS.get(module, module) for module in modules)


def distributions(modules):
    known = metadata.packages_distributions()
    return {name_of(known[module][0]) for module in modules}


@pytest.mark.parametrize(
    ("house", "extras"),
    [
        ("acx4sim", ("command",)),
        ("acx4lib", ("images", "cluster")),
        ("acx4files", ("images", "cluster", "opf")),
        ("acx4book", ("book", "pdf", "reference")),
    ],
)
def test_what_a_package_imports_is_required(house, extras):
    required = names_of(requirements(*extras))
    assert imported(house) <= required


# --- installed -------------------------------------------------------------------------------


def link(site, *extras):
    """Link the requirements of some extras, and what they bring, into a folder."""
    site.mkdir()
    waiting, seen = [Requirement(line) for line in requirements(*extras)], set()
    while waiting:
        name = waiting.pop().name
        if name in seen:
            continue
        seen.add(name)
        found = metadata.distribution(name)
        brought = [Requirement(line) for line in found.requires or ()]
        waiting += [r for r in brought if r.marker is None or r.marker.evaluate({"extra": ""})]
        for top in {file.parts[0] for file in found.files} - {"..", "__pycache__"}:
            if not (site / top).exists():
                (site / top).symlink_to(found.locate_file(top))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """A folder with an environment of the wheel; the file that names the packages beside it.

    One environment for all, so that nothing has to be compiled twice.
    """
    folder = tmp_path_factory.mktemp("installed")
    site = environment(folder / "env", wheel)
    link(folder / "nothing")
    link(folder / "command", "command")
    return folder, site / PTH


@pytest.fixture
def small(installed):
    """A folder with an environment of the wheel and what the library requires, no extra."""
    folder, beside = installed
    beside.write_text(str(folder / "nothing"))
    return folder


@pytest.fixture
def whole(installed):
    """The same with all that is present."""
    folder, beside = installed
    beside.write_text(PRESENT)
    return folder


@pytest.mark.slow
def test_the_wheel_runs_a_flight_and_reports_on_it(whole):
    succeeds(whole, "acx4", "simulate", "single-head", "--out", "flight")
    assert "CAM" in succeeds(whole, "acx4", "check", "flight")
    said = succeeds(whole, "acx4", "run", "flight", "--results", "results", "--stages", "mounting")
    assert said.endswith("results in results\n")
    succeeds(whole, "acx4", "report", "results")
    page = (whole / "results" / "report.html").read_text(encoding="utf-8")
    assert 'class="verdict ' in page
    assert "@page" in page  # of the style sheet


SMALL = """
import acx4 as acx
flight = acx.read("library")
calibration = acx.calibrate(flight)["single_step"].calibration
poses = acx.georeference(flight.validation, calibration).T_m_c
print(calibration.cameras[0].interior.f, len(poses.r))
try:
    acx.render
except ModuleNotFoundError as error:
    print(error)
"""


@pytest.mark.slow
def test_what_the_library_requires_is_enough_for_a_calibration(small):
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=3), small / "library")
    numbers, error = succeeds(small, "python", "-c", SMALL).splitlines()
    focal_mm, n_images = numbers.split()
    here = acx.calibrate(acx.read(small / "library"))["single_step"].calibration
    assert float(focal_mm) == pytest.approx(here.cameras[0].interior.f, abs=1e-9)
    assert int(n_images) == 60
    assert error == (
        "acx4.render needs tifffile, not installed here: pip install 'acx4lib[images]'"
    )
