"""The command ``acx4 import``: a command for every kind of files."""

from __future__ import annotations

import typer

from acx4book.command.exchange import blocks, pictures, projects, trajectories

HELP = """Read other programs' files, and write a flight, or what they know of one.

Every kind says on the screen, and in import.md of the flight, which conventions it assumed, what it
found, and what it left out. A flight may come from several sources: each import adds its tables to
the folder. What is still missing is named at the end.

\b
Example:
  acx4 import odm-control gcp_list.txt --out my_flight
"""

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help=HELP)

app.command("sbet", help=trajectories.SBET_HELP)(trajectories.sbet)
app.command("metashape", help=projects.METASHAPE)(projects.metashape)
app.command("colmap", help=projects.COLMAP)(projects.colmap)
app.command("pospac-text", help=trajectories.TEXT_HELP)(trajectories.pospac_text)
app.command("orientations", help=trajectories.TABLE_HELP)(trajectories.orientations)
app.command("opensfm", help=blocks.OPENSFM)(blocks.opensfm)
app.command("pictures", help=pictures.HELP)(pictures.pictures)
