"""Files for containers and for hosts that run checks: they name what is there."""

import os
import re
import shlex

import pytest
import yaml

from acx4sim.designs import DESIGNS
from support.helpers import ROOT

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
