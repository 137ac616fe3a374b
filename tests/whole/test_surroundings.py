"""The command where something around it is missing, closed, full or cannot be written."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import acx4lib
import acx4sim
from acx4lib import system
from support.helpers import repeats

# --- the command where something around it is missing, closed, full or cannot be written -----
#
# Permissions stop no administrator, so what cannot be written here is no folder at all.


COMMAND = [sys.executable, "-c", "from acx4book.command.acx4 import main; main()"]
RUN = ["run", "--results", "/nowhere/results"]
SOURCES = Path(acx4lib.__file__).parents[1]
NOWHERE = "/proc/nonexistent"
"""A home that nobody can make."""


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("surroundings") / "flight"
    options = acx4sim.Options(blocks=("validation",))
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1, options=options), folder)
    toml = folder / "flight.toml"
    lines = toml.read_text(encoding="utf-8").splitlines()
    named = ['name = "Größe 相机"' if line.startswith("name =") else line for line in lines]
    toml.write_text("\n".join(named), encoding="utf-8")
    return folder


def run(*arguments, env=None, **kwargs):
    """Run the command with changes of the environment; None takes a variable out."""
    changed = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path)), **(env or {})}
    kept = {name: value for name, value in changed.items() if value is not None}
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "timeout": 120, **kwargs}
    done = subprocess.run([*COMMAND, *arguments], env=kept, check=False, **given)
    assert b"Traceback" not in (done.stderr or b"")
    return done


# --- standard streams ------------------------------------------------------------------------


def test_a_reader_who_goes_away_is_no_error_to_talk_about(flight):
    read, write = os.pipe()
    os.close(read)
    done = run("check", flight, stdout=write)
    os.close(write)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_behind_standard_output_is_a_line(flight):
    with Path("/dev/full").open("w") as full:
        done = run("check", flight, stdout=full)
    assert done.returncode == 2
    assert done.stderr == b"standard output: No space left on device\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_the_status_says_it_where_standard_error_cannot():
    with Path("/dev/full").open("w") as full:
        assert run("check", "nowhere", stderr=full).returncode == 2


@pytest.mark.parametrize(
    ("closed", "command", "status"),
    [
        (">&-", "check flight", 0),
        (">&- 2>&- <&-", "check flight", 0),
        ("2>&-", "check nowhere", 2),
        (">&-", "simulate single-head --out new", 0),
        (">&-", "--help", 0),
    ],
)
def test_closed_streams_change_nothing(flight, tmp_path, closed, command, status):
    (tmp_path / "flight").symlink_to(flight)
    whole = f'exec "$@" {command} {closed}'
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path))}
    done = subprocess.run(
        ["sh", "-c", whole, "sh", *COMMAND], cwd=tmp_path, env=env, capture_output=True, check=False
    )
    assert done.returncode == status
    assert done.stderr == b""
    if "new" in command:
        assert json.loads((tmp_path / "new.truth.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "env",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"LC_ALL": "POSIX", "PYTHONIOENCODING": "latin-1"},
    ],
    ids=["ascii", "C", "latin-1"],
)
def test_names_of_any_script_are_said_in_any_encoding(flight, env):
    done = run("check", flight, env=env)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"Gr" in done.stdout.splitlines()[0]


def test_a_path_that_is_no_text_is_said_all_the_same(tmp_path):
    done = run("check", tmp_path / os.fsdecode(b"bad\xff\x1b[31m\n"))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert rb"bad\xff\x1b[31m" in line
    assert line.endswith(b"is no folder; must be the folder of a flight, with a flight.toml")
    out = os.fsencode(tmp_path / "flight") + b"\xfe"
    done = run("simulate", "single-head", "--out", out)
    assert (done.returncode, done.stderr) == (0, b"")
    assert rb"flight\xfe" in done.stdout


# --- folders ---------------------------------------------------------------------------------


def test_a_current_folder_that_is_gone_is_a_line(flight, tmp_path):
    gone = tmp_path / "gone"
    script = f'cd "{gone}" && rmdir "{gone}" && exec "$@"'
    for arguments, status, said in (
        (["--help"], 0, b""),
        (["simulate", "single-head", "--out", "new"], 2, b"the current folder is no more: "),
        ([*RUN, str(flight), "--jobs", "2"], 2, b"the current folder is no more: "),
    ):
        gone.mkdir()
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        done = subprocess.run(
            ["sh", "-c", script, "sh", *COMMAND, *arguments],
            env=env,
            capture_output=True,
            check=False,
        )
        assert done.returncode == status
        assert done.stderr.startswith(said)
        assert len(done.stderr.splitlines()) == bool(said)


def test_no_home_no_temporary_folder_and_no_caches_are_no_matter(flight):
    env = {"HOME": NOWHERE, "TMPDIR": NOWHERE, "XDG_CACHE_HOME": NOWHERE, "MPLCONFIGDIR": NOWHERE}
    for changed in (env, dict.fromkeys(env)):
        done = run("check", flight, env=changed)
        assert (done.returncode, done.stderr) == (0, b"")


def test_help_needs_nothing_but_its_own_package():
    """What can be broken, unwritable or missing is not even looked at."""
    code = (
        "import contextlib, sys, acx4book.command.acx4\n"
        "for given in ['--help'], ['--version'], *([c, '--help'] for c in "
        "('check', 'run', 'simulate', 'report', 'render')):\n"
        "    with contextlib.suppress(SystemExit):\n"
        "        acx4book.command.acx4.main(given)\n"
        "print(*(name for name in sys.modules if '.' not in name), file=sys.stderr)\n"
        "import nbformat; print('lark' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    heavy = "numpy scipy pandas numba cv2 pyproj matplotlib rich papermill nbformat nbclient"
    more = "jupyter_client ipykernel IPython zmq tifffile imagecodecs threadpoolctl asyncio"
    assert not set(done.stderr.split()) & {*heavy.split(), *more.split()}
    assert done.stdout.splitlines()[-1] == "False"  # a grammar that takes longer than all else


# --- compiled code ---------------------------------------------------------------------------

TWICE = """
import sys
from acx4lib import compiling

@compiling.compiled
def twice(x):
    return 2 * x

assert twice(3.0) == 6.0
print(compiling.NOT_KEPT)
"""


def twice(folder, env):
    """Compile a function of a file in a process of its own; return what is said."""
    script = folder / "twice.py"
    script.write_text(TWICE, encoding="utf-8")
    whole = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path)), **env}
    done = subprocess.run(
        [sys.executable, script], env=whole, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


@pytest.mark.parametrize("shares", [(0.6,), repeats((0.0, 0.6))], ids=len)
@pytest.mark.repeats
def test_damaged_files_of_compiled_code_are_compiled_anew(tmp_path, shares):
    cache = tmp_path / "cache"
    env = {"NUMBA_CACHE_DIR": str(cache)}
    assert twice(tmp_path, env) == ""
    files = [path for path in cache.rglob("*") if path.suffix in (".nbi", ".nbc")]
    whole = {path: path.read_bytes() for path in files}
    assert len(whole) == 2
    for suffix in (".nbi", ".nbc"):
        for share in shares:
            for path, data in whole.items():
                cut = int(share * len(data)) if path.suffix == suffix else len(data)
                path.write_bytes(data[:cut])
            twice(tmp_path, env)
    for path in files:
        path.unlink()
        path.mkdir()  # neither to be read nor to be written over
    twice(tmp_path, env)


def test_a_cache_that_cannot_be_written_leaves_it_to_the_next(tmp_path):
    package = bare_package(tmp_path)
    home = tmp_path / "home"
    env = {"NUMBA_CACHE_DIR": NOWHERE, "HOME": str(home), "XDG_CACHE_HOME": "", **package}
    assert twice(tmp_path, env) == ""
    assert list((home / ".cache" / "acx4lib").rglob("*.nbi"))


def test_without_any_cache_it_compiles_and_can_say_so(tmp_path):
    env = {"NUMBA_CACHE_DIR": "", "HOME": NOWHERE, "XDG_CACHE_HOME": "", **bare_package(tmp_path)}
    assert twice(tmp_path, env).startswith("compiled code cannot be kept: ")


@pytest.mark.slow
@pytest.mark.repeats
def test_a_run_without_any_cache_says_so_once(flight, tmp_path):
    env = {"NUMBA_CACHE_DIR": "", "HOME": NOWHERE, "XDG_CACHE_HOME": "", **bare_package(tmp_path)}
    for name in ("notebooks", "data"):
        (tmp_path / name).symlink_to(SOURCES.parent / name)
    arguments = ["run", flight, "--results", tmp_path / "r", "--stages", "validation"]
    done = run(*arguments, env=env, timeout=500)
    assert done.returncode == 1
    line, other = done.stderr.splitlines()
    assert line.startswith(b"compiled code cannot be kept: ")
    assert b"rays of camera CAM" in other  # which is declared with an approximate focal length


def bare_package(folder):
    """Copy the sources so that nothing can be kept beside them; return the environment."""
    copy = folder / "src"
    if not copy.exists():
        nothing = shutil.ignore_patterns("__pycache__")
        for house in ("acx4", "acx4lib", "acx4files", "acx4sim", "acx4book"):
            shutil.copytree(SOURCES / house, copy / house, ignore=nothing)
        (copy / "acx4lib" / "__pycache__").write_text("no folder", encoding="utf-8")
    paths = [str(copy), *(path for path in sys.path if Path(path or ".").resolve() != SOURCES)]
    return {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"}


# --- kernels ---------------------------------------------------------------------------------

KERNEL = """
import sys
from pathlib import Path
import nbformat
from acx4book.notebooks import execute

folder = Path(sys.argv[1])
made = nbformat.v4.new_notebook(cells=[
    nbformat.v4.new_code_cell("seed = 1", metadata={"tags": ["parameters"]}),
    nbformat.v4.new_code_cell("import matplotlib.pyplot as plt\\nprint(seed, plt.__name__)"),
])
nbformat.write(made, folder / "a.ipynb")
execute.execute(folder / "a.ipynb", folder / "b.ipynb", parameters={"seed": 7})
for cell in nbformat.read(folder / "b.ipynb", as_version=4).cells:
    for output in cell.outputs:
        print(output.text, end="")
"""


def kernel(folder, *before, env=None):
    whole = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path)), **(env or {})}
    script = [*before, sys.executable, "-c", KERNEL, folder]
    done = subprocess.run(
        script, env=whole, capture_output=True, text=True, check=False, timeout=100
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.repeats
def test_a_kernel_needs_no_home_and_says_nothing_of_it(tmp_path):
    names = ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_RUNTIME_DIR", "JUPYTER_RUNTIME_DIR")
    env = dict.fromkeys((*names, "IPYTHONDIR", "MPLCONFIGDIR", "TMPDIR"), NOWHERE)
    assert kernel(tmp_path, env=env) == "7 matplotlib.pyplot\n"


@pytest.mark.slow
def test_a_kernel_needs_no_network_not_even_the_machines_own(tmp_path):
    without = ["unshare", "--map-root-user", "--net"]
    if (
        shutil.which("unshare") is None
        or subprocess.run([*without, "true"], check=False).returncode
    ):
        pytest.skip("this system makes no network namespaces")
    assert kernel(tmp_path, *without) == "7 matplotlib.pyplot\n"


@pytest.mark.slow
@pytest.mark.repeats
def test_a_temporary_folder_with_a_long_name_is_no_matter_to_a_kernel(tmp_path):
    """Sockets of the file system have short names."""
    long = tmp_path / ("a" * 120)
    long.mkdir()
    assert kernel(tmp_path, env={"TMPDIR": str(long)}) == "7 matplotlib.pyplot\n"


@pytest.mark.slow
def test_a_run_that_nobody_listens_to_ends_and_leaves_nothing_half_done(flight, tmp_path):
    """As behind `| head`: the first line that cannot be written ends it."""
    read, write = os.pipe()
    os.close(read)
    arguments = ["run", flight, "--results", tmp_path / "r", "--stages", "validation"]
    done = run(*arguments, stdout=write)
    os.close(write)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, b"")
    assert not list((tmp_path / "r").glob(".running-*"))


# --- other systems ---------------------------------------------------------------------------
#
# Without what only POSIX systems have, flights are simulated, checked, run and reported.


HIDE = '''
import os, signal, sys
for name in ("fcntl", "grp", "pwd", "resource", "termios", "tty", "pty", "syslog", "readline"):
    sys.modules[name] = None
FUNCTIONS = """chown fchmod fchown fchdir fork forkpty getgid getuid geteuid getegid getloadavg kill
killpg lchown mkfifo nice openpty pread pwrite sched_getaffinity setpgid setsid statvfs sysconf
waitid O_CLOEXEC O_DIRECTORY O_NOCTTY O_NOFOLLOW O_NONBLOCK O_PATH"""
SIGNALS = "SIGHUP SIGKILL SIGPIPE SIGALRM SIGCHLD pthread_sigmask alarm setitimer"
for module, names in ((os, FUNCTIONS), (signal, SIGNALS)):
    for name in names.split():
        delattr(module, name)
from acx4book.command.start import main
for typed in sys.argv[1:]:
    sys.argv[1:] = typed.split()
    try:
        main()
    except SystemExit as ended:
        if ended.code:
            raise
'''
"""Hides what Windows lacks from this interpreter, and starts one command after the other."""

COMMANDS = (
    "simulate single-head --out flight",
    "run flight --results results --numbers-only",
    "report results --out report.html",
)


@pytest.mark.slow
def test_commands_need_nothing_of_posix(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", HIDE, *COMMANDS],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "report.html").stat().st_size > 100_000
    assert not [*tmp_path.rglob(".acx4.lock")]


def test_a_process_that_cannot_be_asked_after_may_be_alive(monkeypatch):
    """On Windows to ask would end it."""
    monkeypatch.setattr(system.os, "name", "nt")
    monkeypatch.delattr(system.os, "kill")
    assert system.is_alive(1)


def test_flags_that_a_system_lacks_are_none_of_its_flags():
    assert system.flags("O_NO_SUCH") == 0
