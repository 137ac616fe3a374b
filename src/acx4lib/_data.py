"""Where the repository keeps the data that the library reads."""

from __future__ import annotations

from pathlib import Path


def data_path(*parts: str) -> Path:
    """Return the path of a file below the repository's `data` folder.

    Valid for a clone with an editable install; a wheel has no `data` folder beside it.

    Parameters
    ----------
    *parts : str
        Folders and file name below `data`.

    Returns
    -------
    Path

    Raises
    ------
    FileNotFoundError
        Where there is no such file: the message says how to get one.
    """
    path = Path(__file__).resolve().parents[2].joinpath("data", *parts)
    if not path.is_file():
        msg = f"{path} is missing: run acx4lib from a clone of its repository (pip install -e .)"
        raise FileNotFoundError(msg)
    return path
