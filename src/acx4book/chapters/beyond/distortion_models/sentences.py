"""What the chapter says with its numbers."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.distortion_models import seams, tables
from acx4book.chapters.beyond.distortion_models.cases import DENT_UM, DENTED, SYNTHETIC
from acx4book.chapters.beyond.distortion_models.families import MODELS
from acx4book.chapters.beyond.distortion_models.seams import Pattern
from acx4book.chapters.beyond.distortion_models.study import (
    ERRORS,
    FIRST,
    REAL,
    Study,
    over_first,
    summary,
)
from acx4book.chapters.beyond.distortion_models.trials import FLEXIBLE, halved_at_um
from acx4book.typesetting.myst import at_commit

BARE = ("Ebner", "Fourier")
"""Models without radial parameters."""

HALF = 0.5
"""Share of an error at check points that a second model must reach to be worth its place."""


def made(study: Study) -> str:
    """Say when and from what the numbers of the page were computed."""
    about = study.about
    return (
        f"Computed on {about['date']} at {at_commit(about['commit'])}: {study.n_flights} flights "
        f"of each simulated case, seeds {about['first_seed']} to {about['last_seed']}, and the "
        f"measurements `{REAL}`. `make models` repeats it."
    )


def fits(study: Study) -> str:
    """Say what the criteria choose, case by case."""
    found = summary(study)
    wide = found.pivot_table(index="case", columns="model", values="bic_less_first", sort=False)
    best = zip(wide.index.astype(str), wide.idxmin(axis=1).astype(str), strict=True)
    chosen = ", ".join(f"*{model}* for {case}" for case, model in best)
    bare = found[found["model"].isin(BARE) & ~found["case"].isin([SYNTHETIC, REAL])]
    return (
        f"BIC is smallest with {chosen}. Without radial parameters neither polynomials nor waves "
        f"follow a lens: σ₀² is {bare['sigma0_sq'].min():.1f} to {bare['sigma0_sq'].max():.1f} "
        "where it should be one. The synthetic image has little radial distortion, and there they "
        "do fit."
    )


def errors(study: Study) -> str:
    """Say whether another model makes errors at check points smaller."""
    strip, direct = (over_first(study, name) for name in ("strip_height_m", "direct_height_m"))
    others = [name for name in strip.columns if name not in (FIRST, *BARE)]
    simulated = direct.drop(index=REAL, errors="ignore")[others]
    share = strip[FLEXIBLE]
    change = 100 * float(np.abs(simulated - 1).max().max())
    return (
        f"In a strip left out, the dent of {DENT_UM:g} µm makes the height's error with "
        f"*{FLEXIBLE}* {share[DENTED]:.2f} times that with Brown's model. In the "
        f"synthetic image it is {share[SYNTHETIC]:.2f} times. In direct "
        "georeferencing, the models with radial parameters differ from Brown's by at most "
        f"{change:.1f}\N{NO-BREAK SPACE}% in height, in all cases: the errors of GNSS and INS are "
        "larger than anything that a distortion model leaves."
    )


def pattern(found: Pattern) -> str:
    """Say what of the seams a distortion model takes up."""
    rest, heads = _left_at_seams(found)
    best = min(rest, key=lambda name: rest[name])
    return (
        f"From {found.height_m.min():.0f} m, Brown's model leaves {rest[FIRST]:.2f} px and the "
        f"best of the others, *{best}*, {rest[best]:.2f} px. Four cameras leave {heads:.3f} px. "
        "The pattern jumps at the seams, and all terms of all families are smooth. Moreover the "
        "pattern changes with 1 / H, and a distortion model is the same for all flying heights."
    )


def _left_at_seams(found: Pattern) -> tuple[dict[str, float], float]:
    """Return what models leave of the pattern from the lower height, and four cameras, px."""
    low = found.height_m == found.height_m.min()
    rest = {model.name: tables.rms(seams.left(found, model)[low]) for model in MODELS}
    return rest, tables.rms(seams.left_by_heads(found, MODELS[0])[low])


def depths(found: pd.DataFrame) -> str:
    """Say how deep a dent must be for another model to halve an error."""
    deepest = found["depth_um"].max()
    own = found[found["depth_um"] == deepest].set_index("model")
    factor = float((own["cost"] / own["redundancy"])[FIRST])
    return (
        f"In a strip that is adjusted with its tie points, *{FLEXIBLE}* halves the height's error "
        f"{_from(found, 'strip_height_m')}; in direct georeferencing, "
        f"{_from(found, 'direct_height_m')}. A deep dent does not stay hidden: at {deepest:.0f} "
        f"µm, σ₀² with Brown's model is {factor:.2f}, and mean residuals over the image show where "
        "the dent is."
    )


def _from(found: pd.DataFrame, name: str) -> str:
    """Say from which depth on the flexible model halves an error."""
    depth = halved_at_um(found, name)
    return f"from {depth:.0f} µm on" if np.isfinite(depth) else "at no depth of the figure"


def real(study: Study) -> str:
    """Say what the measurements of others show."""
    own = summary(study).query("case == @REAL").set_index("model")
    best = str(own["bic_less_first"].idxmin())
    factors, residuals = own["sigma0_sq"], own["strip_px"]
    percent = 100 * (1 - residuals[best] / residuals[FIRST])
    return (
        f"With Brown's model σ₀² is {factors[FIRST]:.2f}; with *{best}*, which BIC prefers, it is "
        f"{factors[best]:.2f}. In images left out the residuals are {residuals[FIRST]:.3f} px and "
        f"{residuals[best]:.3f} px. So the images of this small camera have a deformation that "
        "Brown's model does not have. It is significant: the model that follows it makes these "
        f"residuals smaller by {percent:.0f} %."
    )


def decision(study: Study, left: Pattern, over_depth: pd.DataFrame) -> str:
    """Say whether the adjustment gets a second model by name, and why."""
    shares = [over_first(study, name).min().min() for name in ERRORS]
    rest, heads = _left_at_seams(left)
    met = min(shares) <= HALF or min(rest.values()) <= HALF * rest[FIRST]
    return (
        "A second model would have its place in the adjustment if it halved an error at check "
        "points of a case, or if it took up the steps at the seams. The smallest share of the "
        f"error with Brown's model that any model reaches in any case is {min(shares):.2f}. At the "
        f"seams {min(rest.values()):.2f} px stay of {rest[FIRST]:.2f} px, and four cameras leave "
        f"{heads:.3f} px. So the adjustment {'needs a second' if met else 'keeps one'} model. "
        "The limit of this is a deep dent: in a strip that is adjusted with its tie points, the "
        f"other model halves the error in height {_from(over_depth, 'strip_height_m')}."
    )


def answer(study: Study, left: Pattern, over_depth: pd.DataFrame) -> str:
    """Answer the question of the chapter."""
    found = summary(study).set_index(["case", "model"])
    cost = found["bic_less_first"][("decentred", FLEXIBLE)]
    strip = over_first(study, "strip_height_m")["radial + Fourier"][DENTED]
    rest, heads = _left_at_seams(left)
    return (
        "Brown's model. For a symmetric or decentred lens it has the smallest BIC; Fourier's "
        f"sixteen terms in place of the decentring raise it by {cost:.0f}. Polynomials or waves "
        "alone cannot replace the radial parameters. Beside them they follow a sensor that is not "
        f"plane: a dent of {DENT_UM:g} µm leaves {strip:.2f} times the error in height in a strip "
        "left out, and direct georeferencing stays as it was. The error in a strip is halved "
        f"only for a dent {_from(over_depth, 'strip_height_m')}. At the seams of the synthetic "
        f"image no smooth model helps: {min(rest.values()):.2f} px stay, where four cameras leave "
        f"{heads:.3f} px. "
        "Recommended are Brown's parameters and a look at the mean residuals over the image. If "
        "they show the seams, adjust the heads as a rig."
    )
