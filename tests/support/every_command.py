"""What is typed for every command, and the files that it is given."""

import shutil

import typer

from acx4book.command.acx4 import app
from acx4book.planning.plan import written
from support import run_results
from support.flights import pictured, planned
from support.fuzz import sources
from support.pictures import measured


def material(folder):
    """Return a folder with flights, results and files of other programs, made below another."""
    flight, results = run_results.leave_results(folder / "one")
    heads = pictured.write_flight(folder / "heads")
    made = {
        "flown": flight,
        "results": results,
        "heads": heads,
        "of_heads": pictured.write_results(folder / "of_heads", heads),
        "pictured": measured.flown(folder / "pictures", ("C1-04", "C2-04"), reduce=16),
    }
    for name, path in made.items():
        shutil.copytree(path, folder / "all" / name)
    sources.write_all(folder / "all")
    (folder / "all" / "key.txt").write_text("0123456789abcdef" * 4)
    (folder / "all" / "plan.toml").write_text(written(planned.values()), encoding="utf-8")
    return folder / "all"


LAB = ["lab", "1", "--student", "A", "--key", "key.txt", "--out", "out"]

TYPED = {
    "check": [["check", "flown"]],
    "run": [
        ["run", "flown", "--results", "out"],
        ["run", "flown", "pictured", "--results", "out", "--jobs", "2", "--stages", "heads"],
        ["run", "single-head", "--seeds", "1-2", "--results", "out", "--jobs", "2"],
    ],
    "plan": [["plan", "plan.toml", "--out", "out"]],
    "simulate": [["simulate", "single-head", "--out", "out"]],
    "report": [["report", "results", "--out", "out.html", "--pdf"]],
    "book": [["book", "flown", "--out", "out"]],
    "new": [
        ["new", "out", "--cameras", "A", "--crs", "EPSG:32633", "--heights", "ellipsoidal"],
        ["new", "out", "--cameras", "A", "--crs", "EPSG:32633", "--heights", "EPSG:5773"],
    ],
    "export": [["export", "results", "--to", "metashape", "--out", "out"]],
    "measure": [["measure", "pictured", "--out", "out", "--jobs", "2", "--show", "out-shown"]],
    "render": [["render", "heads", "--results", "of_heads", "--out", "out", "--jobs", "2"]],
    "lab": [LAB],
    "grade": [["grade", "handed_in", "--key", "key.txt", "--out", "out.csv"]],
}
"""What is typed for each command; an import's is that of its good source."""


def imports():
    """Return what is typed for every kind of import."""
    made = {}
    for name, of in sources.SOURCES.items():
        options = [one.replace("{}", name) for one in of.options]
        typed = ["import", of.kind or name, f"{name}/{of.source}", "--out", "out", *options]
        made.setdefault(f"import {of.kind or name}", []).append(typed)
    made.pop("import export")  # which is no import
    return made


ALL = TYPED | imports()

OF_EACH_KIND = ("check", "simulate", "report", "import metashape")
"""Commands of which each goes another way: those that read, write, compute, or import."""


def names(group=None, name=""):
    """Yield the commands that the parser knows."""
    group = group or typer.main.get_command(app)
    for word, command in group.commands.items():
        below = getattr(command, "commands", None)
        yield from names(command, f"{name}{word} ") if below else [f"{name}{word}"]
