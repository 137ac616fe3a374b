"""Files are opened in two places: one writes whole files or none, the other reads regular files.

The sources are searched for calls that open files in other ways. What else is there is listed with
its reason.
"""

import ast
from functools import cache

import pytest

from support.helpers import ROOT, parsed

SOURCES = ROOT / "src"

WRITES = {
    *("write_text", "write_bytes", "touch", "symlink_to", "hardlink_to", "symlink", "os.link"),
    *("copyfile", "copy2", "copyfileobj", "copytree", "move", "rename", "renames", "ZipFile"),
    *("savetxt", "savez", "savez_compressed", "tofile", "memmap", "np.save", "savefig", "imwrite"),
    *("TiffWriter", "imsave", "json.dump", "pickle.dump", "yaml.dump", "NamedTemporaryFile"),
    *("mkstemp", "TemporaryFile", "FileHandler", "extract", "extractall", "urlretrieve"),
    *("to_excel", "to_pickle", "to_parquet", "to_hdf", "to_json"),
}
"""Calls that write into a file."""

READS = {
    *("read_text", "read_bytes", "read_csv", "read_table", "read_excel", "read_json", "read_hdf"),
    *("read_pickle", "loadtxt", "genfromtxt", "fromfile", "np.load", "imread", "TiffFile"),
}
"""Calls that read a file."""

OPENS = {"open", "fdopen"}
"""Calls that do either."""

OURS = {
    *("whole_files.write", "whole_files.copy", "whole_files.link", "table_files.read_bytes"),
    *("new.open", "drafts.open"),
}
"""Calls of the two places."""

READ_ONLY = ("pages", "reference", "chapters", "paper", "foundations", "typesetting")
"""Rooms of the book that read the project's own files."""

OTHERS = {
    "acx4files/results/whole_files.py": {
        "os.open": "the one place that writes",
        "os.fdopen": "as above",
        "draft.open": "as above",
        "os.link": "as above",
        "shutil.copyfileobj": "as above",
    },
    "acx4lib/system.py": {
        "Path('/proc/self/statm').read_text": "a file of the system",
        "os.open": "a folder, to come back to it",
    },
    "acx4files/opening.py": {"open": "the one place that reads", "os.open": "as above"},
    "acx4files/flight/table_files.py": {
        "(group / f'memory.{name}').read_text": "a file of the system",
        "Path('/proc/meminfo').read_text": "a file of the system",
        "read_bytes": "the one place that reads",
        "read_text": "of the one place that reads",
    },
    "acx4files/flight/toml_file.py": {"read_text": "of the one place that reads"},
    "acx4book/report/mounting.py": {"pd.read_csv": "of a file that is open"},
    "acx4book/teaching/flights.py": {"read_bytes": "of the one place that reads"},
    "acx4files/results/own_folder.py": {
        "os.open": "a lock is the file that is open, and is gone in the end",
        "os.fdopen": "as above",
    },
    "acx4files/images/tiff.py": {
        "tifffile.TiffWriter": "writes the draft that it is given, in many steps",
        "tifffile.TiffFile": "of bytes, after a look, or an image that a command wrote",
        "TemporaryFile": "has no name, and is gone in the end",
    },
    "acx4files/exchange/pictures.py": {"tifffile.imread": "of bytes, after a look"},
    "acx4files/measuring/views.py": {"cv2.imread": "looks first"},
    "acx4files/measuring/pairs.py": {
        "np.savez": "into the draft that is open",
        "np.load": "of a file that is open",
    },
    "acx4files/results/folder.py": {"read_text": "of the one place that reads"},
    "acx4files/results/table_files.py": {"pd.read_csv": "after is_there, or of memory"},
    "acx4files/exchange/safe.py": {
        "zipfile.ZipFile": "of bytes",
        "archive.open": "of bytes",
    },
    "acx4lib/compiling.py": {"p.read_bytes": "the library's sources"},
    "acx4lib/georeferencing/accuracy.py": {"table.read_text": "a table of the library"},
    "acx4sim/files.py": {"path.write_text": "into a draft of the whole folder"},
    "acx4sim/pictures.py": {"tifffile.imwrite": "into a draft of the whole folder"},
    "acx4sim/scenery.py": {"np.fromfile": "looks first", "os.open": "the null device"},
    "acx4book/command/terminal.py": {
        "os.open": "the null device",
        "Path(os.devnull).open": "the null device",
    },
    "acx4book/notebooks/execute.py": {"path.read_bytes": "the project's sources"},
    "acx4book/notebooks/runner.py": {"executed.parent.rename": "inside of a draft"},
    "acx4book/report/page.py": {
        "STYLE.read_text": "a style of the library",
        "TEXT.read_text": "a text of the library",
    },
    "acx4book/report/identity.py": {"METHOD.read_text": "a text of the library"},
    "acx4book/report/typeset.py": {"STYLE.read_bytes": "a style of the library"},
    "acx4book/pages/flight_book.py": {"shutil.copyfile": "into a temporary folder"},
    "acx4book/typesetting/svg.py": {"figure.savefig": "in memory"},
    "acx4book/typesetting/style.py": {"self.savefig": "in memory"},
}
"""By file and call, the reason why it opens no file that is left or may be a stranger's."""


def calls(tree):
    """Yield what is called, as it is written, and the arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), node.args, {word.arg for word in node.keywords}


def opens(what, arguments, words):
    """Tell whether a call opens a file, by its name or, where many are alike, by its arguments."""
    name = what.rpartition(".")[2]
    if name == "rename" and words:  # columns of a table
        return False
    if name == "to_csv":
        return bool(arguments) or "path_or_buf" in words
    return bool({what, name} & (WRITES | READS | OPENS)) and what not in OURS


def only_reads(what, arguments, words):
    """Tell whether a call that opens a file only reads it; without a mode it does."""
    name = what.rpartition(".")[2]
    modes = [one.value for one in arguments if isinstance(one, ast.Constant)]
    return name in READS or (
        name == "open"
        and not words & {"mode"}
        and not any(set("wax+") & set(str(one)) for one in modes)
    )


@cache
def found():
    """Return the calls that open files, by the files of the sources."""
    out = {}
    for path in sorted(SOURCES.rglob("*.py")):
        file = path.relative_to(SOURCES).as_posix()
        own = [one for one in calls(parsed(path)) if opens(*one)]
        if file.startswith(tuple(f"acx4book/{room}/" for room in READ_ONLY)):
            own = [one for one in own if not only_reads(*one)]
        if own:
            out[file] = {what for what, *_ in own}
    return out


def test_files_are_opened_in_two_places_only():
    others = {file: {*known} for file, known in OTHERS.items()}
    assert found() == others


@pytest.mark.parametrize(
    "line",
    [
        "open(path, 'w')",
        "path.open('a')",
        "io.open(path)",
        "path.write_text('x')",
        "(a / b).write_bytes(b'')",
        "np.save(path, x)",
        "np.savez(path, x=x)",
        "table.to_csv(path)",
        "table.to_csv(path_or_buf=path)",
        "json.dump(x, file)",
        "shutil.copyfile(a, b)",
        "shutil.move(a, b)",
        "os.link(a, b)",
        "cv2.imwrite(a, b)",
        "path.rename(other)",
        "np.load(path)",
        "pd.read_csv(path)",
        "path.read_text()",
    ],
)
def test_another_way_of_opening_is_found(line):
    assert any(opens(*one) for one in calls(ast.parse(line)))


@pytest.mark.parametrize(
    "line", ["table.to_csv(index=False)", "json.dumps(x)", "x.copy()", "t.rename(columns=names)"]
)
def test_what_opens_nothing_is_not(line):
    assert not any(opens(*one) for one in calls(ast.parse(line)))
