"""Results of the surround-view rig in words, with their numbers."""

from __future__ import annotations

import pandas as pd

from acx4book.reference.surround.comparisons import AS_PUBLISHED, BEST


def grey_values(overlaps: pd.DataFrame) -> str:
    """Return sentences on the differences of grey values before and after equalisation.

    Parameters
    ----------
    overlaps : DataFrame
        As `comparisons.overlaps` returns it.
    """
    before, after, floor = (overlaps[f"{n}_percent"] for n in ("before", "after", "floor"))
    return (
        f"Neighbouring cameras differ in the same even ground by {before.min():.0f} to "
        f"{before.max():.0f} % as taken, and by {after.min():.0f} to {after.max():.0f} % after "
        f"one gain per camera and band, of which {floor.min():.0f} to {floor.max():.0f} % changes "
        "from one piece of ground to the next and is no gain: folds and gloss of the fabric, seen "
        "from two sides."
    )


def fit(overlaps: pd.DataFrame, refinements: pd.DataFrame) -> str:
    """Return sentences on the misfits of the published calibration and of refinements.

    Parameters
    ----------
    overlaps, refinements : DataFrame
        As `comparisons.overlaps` and `comparisons.refinements` return them.
    """
    rows = _before_and_after(refinements)
    published, best = rows[AS_PUBLISHED], rows[BEST]
    return (
        f"With the published calibration {overlaps['corners'].sum()} corners of the target are "
        f"seen {published['misfit_cm']:.1f} cm apart (rms), the worst by "
        f"{overlaps['largest_cm'].max():.0f} cm: {published['image_misfit_px']:.1f} px in the "
        f"images. Refined with the target held it is {best['misfit_cm']:.1f} cm, "
        f"{best['image_misfit_px']:.1f} px, and {best['left_out_cm']:.1f} cm at corners that the "
        f"refinement did not know; what the cameras show of the target moves by "
        f"{best['moved_cm']:.1f} cm."
    )


def frame(refinements: pd.DataFrame) -> str:
    """Return sentences on changes of the frame by refinements with the first camera held.

    Parameters
    ----------
    refinements : DataFrame
        As `comparisons.refinements` returns it.
    """
    rows = refinements.set_index("refinement")
    angles, free = rows.loc["three angles"], rows.loc["homographies"]
    return (
        f"Three angles of three cameras leave {angles['misfit_cm']:.1f} cm in the overlaps and "
        f"move the target by up to {angles['moved_most_cm']:.0f} cm; whole homographies leave "
        f"{free['misfit_cm']:.1f} cm and move it by up to {free['moved_most_cm']:.0f} cm."
    )


def ghosts(overlaps: pd.DataFrame) -> str:
    """Return sentences on objects that appear twice in the views of neighbouring cameras.

    Parameters
    ----------
    overlaps : DataFrame
        As `comparisons.overlaps` returns it.
    """
    ghost = overlaps["ghost_cm"]
    return (
        f"The top of a kerb of 10 cm in an overlap is shown twice, {ghost.min():.0f} to "
        f"{ghost.max():.0f} cm apart: cameras that are a metre above the ground, and metres away "
        "from each other, have a parallax that no calibration takes out."
    )


def answer(overlaps: pd.DataFrame, refinements: pd.DataFrame) -> str:
    """Return sentences on what a real rig shows of the method.

    Parameters
    ----------
    overlaps, refinements : DataFrame
        As `comparisons.overlaps` and `comparisons.refinements` return them.
    """
    rows = _before_and_after(refinements)
    published, best = rows[AS_PUBLISHED], rows[BEST]
    return (
        "It works: the renderer, the equalisation and the refinement of the heads need no change "
        f"for four fisheye cameras. The published calibration fits to {published['misfit_cm']:.1f} "
        f"cm in the overlaps, the refined one to {best['misfit_cm']:.1f} cm, and the target stays "
        "in its place only if it is held there. What stands above the ground is shown twice, up to "
        f"{overlaps['ghost_cm'].max():.0f} cm apart: that is parallax, and no calibration mends it."
    )


def _before_and_after(refinements: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of the published calibration and of the best refinement, a column each."""
    return refinements.set_index("refinement").loc[[AS_PUBLISHED, BEST]].T
