"""Figures of the chapter: terms, residuals, criteria, errors, seams, and a deeper dent."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4book.chapters.beyond.distortion_models import families, seams
from acx4book.chapters.beyond.distortion_models.candidates import Fitted
from acx4book.chapters.beyond.distortion_models.families import MODELS
from acx4book.chapters.beyond.distortion_models.seams import Pattern
from acx4book.chapters.beyond.distortion_models.study import FIRST, REAL, Study, summary
from acx4book.chapters.beyond.distortion_models.trials import FLEXIBLE
from acx4book.typesetting import style
from acx4book.typesetting.field import Residuals, field_figure
from acx4lib.expected import Array, Mask

NODES = 9
"""Arrows along each side of a panel."""

MARKS = ("o", "s", "^", "D", "v", "P")
"""Of the models, so that colour is not all that tells them apart."""

TITLES: Mapping[str, str] = {
    "strip_plan_m": "strip left out, plan",
    "strip_height_m": "strip left out, height",
    "direct_height_m": "direct georeferencing, height",
}


def terms() -> Figure:
    """Draw two terms of each family over a square image."""
    at = np.linspace(-1, 1, NODES)
    uv = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    ebner, fourier = families.ebner(uv), families.fourier(uv)
    x, y = uv.T
    r2 = x * x + y * y
    fields = {
        "Brown, $k_1$": uv * r2[:, None],
        "Ebner, $a_5$": ebner[:, :, 4],
        "Fourier, $a_1$": fourier[:, :, 0],
        "Brown, $p_1$": np.stack([r2 + 2 * x * x, 2 * x * y], axis=1),
        "Ebner, $a_9$": ebner[:, :, 8],
        "Fourier, $a_{15}$": fourier[:, :, 14],
    }
    with style.applied():
        fig, axes = style.subplots(2, 3, figsize=(style.WIDTH, 4.9))
        for ax, (title, d) in zip(axes.flat, fields.items(), strict=True):
            _draw_term(ax, uv, d)
            ax.set_title(title)
    return fig


def _draw_term(ax: Axes, uv: Array, d: Array) -> None:
    longest = np.hypot(*d.T).max()
    reach = 2 / (NODES - 1) / longest
    ax.quiver(
        *uv.T,
        *(reach * d.T),
        color=style.BLUE,
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.009,
        zorder=3,
    )
    ax.set(xlim=(-1.3, 1.3), ylim=(-1.3, 1.3), aspect="equal", xticks=[], yticks=[])
    ax.plot([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1], color=style.SOFT, lw=0.7)


def residuals(fitted: Mapping[str, Fitted]) -> Figure:
    """Draw mean residuals over the image, by the title of the panel."""
    return field_figure({title: _residuals(found) for title, found in fitted.items()})


def _residuals(found: Fitted) -> Residuals:
    points = found.bundle.network.image_points
    return Residuals(
        camera=found.camera,
        colrow=points.colrow,
        v=found.bundle.solution.group("image_point").v,
        sigma_px=points.sigma_px,
    )


def criteria(study: Study) -> Figure:
    """Draw Schwarz's criterion less that of Brown's model: rows are cases."""
    found = summary(study)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 3.3))
        _draw_rows(ax, found, "bic_less_first")
        ax.axvline(0, color=style.INK, lw=0.8)
        ax.set_xscale("symlog", linthresh=30)
        ax.set_xlabel("BIC less that of Brown's model (1)")
        style.legend_below(fig, _handles(found), ncols=3)
    return fig


def errors(study: Study) -> Figure:
    """Draw errors at check points over those of Brown's model: rows are cases."""
    found = summary(study)
    found = found[found["case"] != REAL]
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 3.3), sharey=True)
        for ax, name in zip(axes, ("strip_height_m", "direct_height_m"), strict=True):
            first = found[found["model"] == FIRST].set_index("case")[name]
            ratio = found[name] / found["case"].map(first)
            _draw_rows(ax, found.assign(ratio=ratio), "ratio")
            ax.axvline(1, color=style.INK, lw=0.8)
            ax.axvline(0.5, color=style.SOFT, lw=0.8, ls="--")
            ax.set_xscale("log")
            ax.set_xticks([0.5, 1, 2, 5, 10], ["½", "1", "2", "5", "10"])
            ax.minorticks_off()
            ax.set_xlabel("error over that of Brown's model (1)")
            ax.set_title(TITLES[name].capitalize())
        style.legend_below(fig, _handles(found), ncols=3)
    return fig


def _draw_rows(ax: Axes, found: pd.DataFrame, name: str) -> None:
    """Draw a dot for every model in the row of every case; models stand beside each other."""
    cases = list(dict.fromkeys(found["case"]))
    models = _models(found)
    for i, model in enumerate(models):
        own = found[found["model"] == model]
        beside = 0.11 * (i - (len(models) - 1) / 2)
        at = [cases.index(case) + beside for case in own["case"]]
        ax.plot(own[name], at, MARKS[i], color=style.colour(i), ms=5, clip_on=False)
    ax.set_yticks(range(len(cases)), cases)
    ax.set_ylim(len(cases) - 0.5, -0.5)


def _models(found: pd.DataFrame) -> list[str]:
    return list(dict.fromkeys(found["model"]))


def _handles(found: pd.DataFrame) -> list[Line2D]:
    return [
        Line2D([], [], ls="", marker=MARKS[i], color=style.colour(i), ms=5, label=model)
        for i, model in enumerate(_models(found))
    ]


def at_seams(pattern: Pattern) -> Figure:
    """Draw what two models and four cameras leave of the synthetic image, from the lower height."""
    low = pattern.height_m == pattern.height_m.min()
    brown, flexible = MODELS[0], next(model for model in MODELS if model.name == FLEXIBLE)
    fields = {
        brown.name: seams.left(pattern, brown)[low],
        flexible.name: seams.left(pattern, flexible)[low],
        seams.HEADS: seams.left_by_heads(pattern, brown)[low],
    }
    key = style.round_length(max(float(np.hypot(*d.T).max()) for d in fields.values()))
    names = np.unique(pattern.head)
    with style.applied():
        fig, axes = style.subplots(1, len(fields), figsize=(style.WIDTH, 3.9), sharey=True)
        for ax, (title, d) in zip(axes, fields.items(), strict=True):
            _draw_pattern(ax, pattern, low, d / key)
            style.heading(ax, title[:1].upper() + title[1:], f"rms {np.sqrt(np.mean(d**2)):.2f} px")
        axes[0].set_ylabel("row (px)")
        handles = [Line2D([], [], color=style.colour(k), label=n) for k, n in enumerate(names)]
        style.legend_below(
            fig, [*handles, Line2D([], [], ls="", label=f"distance of arrows: {key:g} px")]
        )
    return fig


def _draw_pattern(ax: Axes, pattern: Pattern, low: Mask, in_key: Array) -> None:
    """Draw every second node in rows and columns, in the colours of the heads."""
    at = pattern.colrow[low]
    places = [np.unique(x, return_inverse=True)[1] for x in at.T]
    some = (places[0] % 2 == 0) & (places[1] % 2 == 0)
    gap = 2 * float(np.min(np.diff(np.unique(at[:, 0]))))
    head = np.unique(pattern.head[low], return_inverse=True)[1]
    ax.quiver(
        *at[some].T,
        *(gap * in_key[some]).T,
        color=[style.colour(k) for k in head[some]],
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.007,
        zorder=3,
    )
    camera = pattern.camera
    ax.set(xlim=(0, camera.width_px), ylim=(camera.height_px, 0), aspect="equal")
    ax.set(xlabel="column (px)", xticks=[0, 5000, 10000])


def depths(found: pd.DataFrame) -> Figure:
    """Draw errors at check points over the depth of a dent, as `trials.over_depth` has them."""
    with style.applied():
        fig, axes = style.subplots(1, len(TITLES), figsize=(style.WIDTH, 3.0))
        for ax, (name, title) in zip(axes, TITLES.items(), strict=True):
            for model, tint in ((FIRST, style.BLUE), (FLEXIBLE, style.BRICK)):
                own = found[found["model"] == model]
                ax.plot(own["depth_um"], own[name], "o-", color=tint, ms=3.5, label=model)
            ax.set(xlabel="depth of the dent (µm)")
            ax.set_ylim(0, 1.1 * found[name].max())
            ax.set_title(title.capitalize().replace(", ", ",\n"))
        axes[0].set_ylabel("RMS at check points (m)")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig
