"""The command ``acx4 import``: a command for every kind of files."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperGroup

from acx4book.command.exchange import blocks, pictures, points, projects, trajectories

HELP = """Read other programs' files, and write a flight, or what they know of one.

Every kind says on the screen, and in import.md of the flight, which conventions it assumed, what it
found, and what it left out. A flight may come from several sources: each import adds its tables to
the folder. What is still missing is named at the end.

\b
Examples:
  acx4 import metashape project.xml --out my_flight
  acx4 import sbet a.out --events log.csv --time gps-sow --out my_flight
"""

TITLES = {
    "trajectories": "Where images were taken, and in which attitude",
    "points": "Points measured in images, and surveyed",
    "pictures": "Pictures alone",
    "projects": "Projects",
    "blocks": "Blocks and adjustments",
}
"""Of the kinds in a module of this folder, in the order in which they are listed."""


class Grouped(TyperGroup):
    """Kinds that are listed by what they bring."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a list for each group of kinds."""
        rows: dict[str, list[tuple[str, str]]] = {title: [] for title in TITLES.values()}
        for name in self.list_commands(ctx):
            kind = self.get_command(ctx, name)
            if kind is not None:
                module = str(getattr(kind.callback, "__module__", "")).rpartition(".")[2]
                rows.setdefault(TITLES.get(module, "Others"), []).append(
                    (name, kind.get_short_help_str(limit=150))
                )
        for title, listed in rows.items():
            if listed:
                with formatter.section(title):
                    formatter.write_dl(listed)


app = typer.Typer(cls=Grouped, no_args_is_help=True, rich_markup_mode=None, help=HELP)

app.command("sbet", help=trajectories.SBET_HELP)(trajectories.sbet)
app.command("metashape", help=projects.METASHAPE)(projects.metashape)
app.command("colmap", help=projects.COLMAP)(projects.colmap)
app.command("opf", help=projects.OPF)(projects.opf)
app.command("pix4d", help=projects.PIX4D)(projects.pix4d)
app.command("pospac-text", help=trajectories.TEXT_HELP)(trajectories.pospac_text)
app.command("orientations", help=trajectories.TABLE_HELP)(trajectories.orientations)
app.command("image-points", help=points.MEASURED)(points.image_points)
app.command("control-points", help=points.SURVEYED)(points.control_points)
app.command("opensfm", help=blocks.OPENSFM)(blocks.opensfm)
app.command("micmac", help=blocks.MICMAC)(blocks.micmac)
app.command("bundler", help=blocks.BUNDLER)(blocks.bundler)
app.command("visualsfm", help=blocks.VISUALSFM)(blocks.visualsfm)
app.command("bingo", help=blocks.BINGO)(blocks.bingo)
app.command("patb", help=blocks.PATB)(blocks.patb)
app.command("odm-control", help=blocks.ODM_CONTROL)(blocks.odm_control)
app.command("pictures", help=pictures.HELP)(pictures.pictures)
