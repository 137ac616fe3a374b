"""Environment, containers and the names that users meet."""

import os
import re
import shlex
import shutil
import subprocess
import sys

import pytest
import yaml

import acx4 as acx
from acx4sim.designs import DESIGNS
from support.helpers import ROOT

# --- the lists of versions agree with each other and with what README.md says of them --------


FILES = (
    "environment.txt",
    "environment-lab.txt",
    "environment-test.txt",
)
PIN = re.compile(r"^([\w.-]+)==(\S+)$", re.MULTILINE)


def pins(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    found = {re.sub(r"[-_.]+", "-", key).lower(): value for key, value in PIN.findall(text)}
    assert len(found) == sum(not line.startswith("#") for line in text.splitlines() if line)
    return found


@pytest.mark.parametrize("name", FILES)
def test_the_lock_holds_every_pin(name):
    lock = pins("environment.lock")
    assert {key: lock.get(key) for key in pins(name)} == pins(name)


@pytest.mark.parametrize("name", FILES)
def test_readme_gives_a_reason_for_every_package(name):
    table = (ROOT / "README.md").read_text(encoding="utf-8").split("## Dependencies")[1]
    rows = re.findall(r"^\| ([^|]+) \|", table, flags=re.MULTILINE)
    named = {re.sub(r"[-_.]+", "-", package).lower() for row in rows for package in row.split(", ")}
    assert set(pins(name)) <= named


# --- files for containers and for hosts that run checks: they name what is there -------------


CONTAINERFILE = (ROOT / "Containerfile").read_text(encoding="utf-8")
HOSTS = (".github/workflows/book.yml", ".gitlab-ci.yml")
VERSION = "3.11"


def commands(name):
    """Return the shell commands of a host's file."""
    found = yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))
    jobs = found.get("jobs", found)
    steps = [
        step for job in jobs.values() if isinstance(job, dict) for step in job.get("steps", [])
    ]
    scripts = [job.get("script", []) for job in jobs.values() if isinstance(job, dict)]
    return [step["run"] for step in steps if "run" in step] + [line for s in scripts for line in s]


@pytest.mark.parametrize("name", HOSTS)
def test_hosts_run_targets_and_files_that_exist(name):
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    lines = commands(name)
    assert ".ci/run" in lines
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    called = [line.split()[1:] for line in lines if line.startswith("make ")]
    assert called
    assert {word for words in called for word in words} <= targets


@pytest.mark.parametrize("name", HOSTS)
def test_hosts_keep_no_secret_and_have_the_python_of_the_project(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    assert "secret" not in text.replace("needs no secret", "")
    assert f"python:{VERSION}-bookworm" in text


def test_the_container_has_the_files_that_are_installed():
    assert f"FROM python:{VERSION}-" in CONTAINERFILE
    copied = [
        shlex.split(line)[1:-1] for line in CONTAINERFILE.splitlines() if line.startswith("COPY")
    ]
    named = {name for names in copied for name in names}
    assert all((ROOT / name).exists() for name in named)
    for link in (path for path in (ROOT / "src").rglob("*") if path.is_symlink()):
        assert link.resolve().relative_to(ROOT).parts[0] in named  # what is installed with it
    extras = re.search(r'"\.\[(.*)\]"', CONTAINERFILE)[1].split(",")
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert all(re.search(rf"^{extra} = \[", project, re.M) for extra in extras)


def test_the_notebooks_of_binder_find_a_flight_and_results():
    requirements = (ROOT / ".binder" / "requirements.txt").read_text(encoding="utf-8")
    constraints = re.search(r"^-c (.*)$", requirements, re.M)[1]
    assert (ROOT / ".binder" / constraints).resolve() == ROOT / "environment.lock"
    assert (ROOT / ".binder" / "runtime.txt").read_text().strip() == f"python-{VERSION}"
    post = (ROOT / ".binder" / "postBuild").read_text(encoding="utf-8")
    made = dict(re.findall(r"acx4 simulate (\S+) --out (\S+)", post))
    assert set(made) <= set(DESIGNS)
    assert all(f"acx4 run {flight} " in post for flight in made.values())
    notebooks = [path.read_text(encoding="utf-8") for path in (ROOT / "notebooks").glob("*.ipynb")]
    read = {path for text in notebooks for path in re.findall(r"\.\./(data/flights/[\w-]+)", text)}
    assert read == set(made.values())
    assert os.access(ROOT / ".binder" / "postBuild", os.X_OK)


# --- the few names that `import acx4 as acx` gives ----------------------------------------


def test_nothing_is_loaded_before_it_is_used():
    code = "import sys, acx4; print([m for m in sys.modules if m.startswith(('acx4', 'numpy'))])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "['acx4']\n"


def test_what_a_notebook_tries_a_method_with_loads_no_tables_and_no_stage():
    loaded = "[m for m in sys.modules if m.startswith(('acx4lib.', 'pandas', 'scipy', 'numba'))]"
    code = f"import sys; from acx4files.stages import attempt; print(sorted({loaded}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = [f"acx4lib.{name}" for name in ("attempts", "errors", "shown")]
    assert done.stdout == f"{modules}\n"


def test_functions_of_the_face_are_known_before_they_are_loaded():
    assert set(acx.__all__) < set(dir(acx))
    assert all(callable(getattr(acx, name)) for name in acx.__all__)
    assert len((ROOT / "src" / "acx4" / "__init__.py").read_text("utf-8").splitlines()) <= 60
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = acx.nothing


def test_models_and_solvers_load_no_pandas():
    paths = (ROOT / "src" / "acx4lib").rglob("*.py")
    names = [".".join(path.relative_to(ROOT / "src").with_suffix("").parts) for path in paths]
    modules = ", ".join(sorted(name.removesuffix(".__init__") for name in names))
    code = f"import sys, {modules}; print({{'pandas', 'acx4files'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


# --- what make calls, and what it removes -----------------------------------------------------


needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="make is not here")


@pytest.fixture
def copy(tmp_path):
    """A folder with the Makefile and nothing of an environment."""
    (tmp_path / "clone" / "src" / "acx4sim").mkdir(parents=True)
    shutil.copy(ROOT / "Makefile", tmp_path / "clone")
    return tmp_path / "clone"


def make(folder, *arguments):
    done = subprocess.run(
        ["make", "-C", folder, *arguments], capture_output=True, text=True, check=True
    )
    return done.stdout


@needs_make
def test_the_ideal_flight_is_run_beside_the_one_that_ships_and_beside_no_other(copy):
    quick = ("-n", "-o", ".venv/.stamp", "book")
    both, other = make(copy, *quick, "REDUCE=8"), make(copy, *quick, "FLIGHT=mine/")
    results = "build/results/data-flights-acx4-ideal"
    assert "simulate acx4 --out data/flights/acx4 --images 'H1-05,H3-04,C2-05' --reduce '8'" in both
    assert "simulate acx4-ideal --out data/flights/acx4-ideal \n" in both
    assert f"--results '{results}' --stages mounting,validation -- data/flights/acx4-ideal" in both
    assert f"'build/results/data-flights-acx4' book {results}" in both
    assert "acx4-ideal" not in other
    assert "book --strict --out 'build/books/mine' -- 'build/results/mine'" in other
    alone = make(copy, *quick, "FLIGHT=data/flights/acx4-ideal")
    assert f"--results '{results}' -- 'data/flights/acx4-ideal'" in alone


@needs_make
def test_clean_leaves_the_flights_of_others(copy):
    for name in ("data/flights/mine", "data/flights/acx4", "build/results/mine", "book/_build"):
        (copy / name).mkdir(parents=True)
        (copy / name / "x").write_text("")
    make(copy, "clean")
    assert [path.name for path in (copy / "data" / "flights").iterdir()] == ["mine"]
    assert not (copy / "build").exists()
    assert not list((copy / "book").iterdir())
