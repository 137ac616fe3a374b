"""The camera on its mount.

Lever arm, boresight surveyed and estimated, and its stability over time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.report.markdown import Text, parameter_title, show, table
from acx4book.report.material import Material, block_of
from acx4book.report.parameters import head_table
from acx4book.typesetting import style
from acx4book.typesetting.myst import p_value, value_and_sigma
from acx4files.results import folder
from acx4files.results.provenance import KEPT
from acx4lib.block import Block
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import log, mean_rotation, opk_jacobian
from acx4lib.geometry.parameters import LEVER_ARM, REPORTED
from acx4lib.least_squares.covariance import propagate, sigmas

# --- The lever arm: as it was surveyed, and as the calibration estimates it


AS_SURVEYED = "held as surveyed"


def _lever_table(material: Material) -> pd.DataFrame:
    """Return the surveyed components of every lever arm beside the estimated ones, in m."""
    method = material.calibration
    cameras = folder.cameras(material.found, method) if method else ()
    rows = [row for name in cameras for row in _rows(material, material.flight.cameras[name])]
    table = pd.DataFrame(rows)
    return table.drop(columns="Camera") if len(cameras) < 2 and rows else table


def _rows(material: Material, camera: Camera) -> Iterator[dict[str, str]]:
    estimates = folder.parameters(material.found, material.calibration, camera.name)
    summary = material.found.summary[material.calibration].get("declared")
    test = summary.get(f"{camera.name}/lever_arm", {}) if isinstance(summary, dict) else {}
    differences = test.get("difference") or [None] * 3
    for i, key in enumerate(LEVER_ARM):
        if not camera.prior.lever_declared[i]:
            continue
        label, surveyed = REPORTED[key][0], float(camera.T_b_c.r[i])
        sigma, row = camera.prior.lever_sigma[i], {"Camera": camera.name}
        row |= {"Component": parameter_title(label)}
        row |= {"Surveyed (m)": _surveyed(surveyed, sigma)}
        if label in estimates.index:
            value = float(estimates["value"][label])
            difference = value - surveyed if differences[i] is None else float(differences[i])
            row |= {"Estimated (m)": value_and_sigma(value, float(estimates["sigma"][label]))}
            row |= {"Difference (m)": f"{difference:+.3f}", "p": _p(test.get("p"))}
        else:
            row |= {"Estimated (m)": AS_SURVEYED, "Difference (m)": "", "p": ""}
        yield row


def _surveyed(value: float, sigma: float) -> str:
    return value_and_sigma(value, sigma) if np.isfinite(sigma) else f"{value:g}, σ not stated"


def _p(p: object) -> str:
    return p_value(float(p)) if isinstance(p, int | float) and np.isfinite(p) else ""


# --- The mounting: surveyed against estimated, heads, and the boresight over time


def section(material: Material) -> Text:
    """Return the section on the mounting, with the tests of the boresight over time."""
    heads = head_table(material, "heads/relative_orientation")
    turns = _turn_table(turns_of(material))
    return show(
        _lever_sentence(material)
        or table(_lever_table(material), LEVERS, name="tab-report-lever", obtained=SURVEYED),
        "" if heads.empty else table(heads, HEADS, name="tab-report-relative", obtained=RELATIVE),
        table(turns, "Stability of the boresight", name="tab-report-drift", obtained=TURNED),
    )


def _lever_sentence(material: Material) -> str:
    """Return a sentence where no lever arm was surveyed."""
    if not material.calibration or not _lever_table(material).empty:
        return ""
    return "flight.toml states no surveyed lever arm; the estimated one is compared with none."


LEVERS = "Lever arms, surveyed and estimated"
HEADS = "Heads in the synthetic frame"
SURVEYED = (
    "flight.toml and parameters.csv; the difference is that of all other observations, without the "
    "survey where its σ makes it one"
)
RELATIVE = (
    "orientations of the heads at the exposures that all share, averaged; σ from the covariance "
    "matrices of the heads"
)
TURNED = (
    "the residuals of all attitudes in the adjustment that is certified, tested with their joint "
    "covariance; turns of strips are less the mean, a drift is from the first exposure to the last"
)


def _turn_table(tested: Sequence[Turns]) -> pd.DataFrame:
    """Tabulate the turns of the boresight by strip and over time, with the tests."""
    rows = [
        {
            "Turn": test.title if len(test.names) == 1 else f"strip {name}",
            **{
                f"about {axis} (°)": value_and_sigma(test.turns_deg[i, k], test.sigma_deg[i, k])
                for k, axis in enumerate(AXES)
            },
            "F": f"{test.f:.2f}" if i == 0 else "",
            "Degrees of freedom": f"{test.dof}; {test.redundancy:.0f}" if i == 0 else "",
            "p": p_value(test.p) if i == 0 else "",
        }
        for test in tested
        for i, name in enumerate(test.names)
    ]
    return pd.DataFrame(rows)


def boresight_over_time(boresights: pd.DataFrame) -> Figure:
    """Draw the boresights of the images minus their mean over time, with sigma and a line.

    Parameters
    ----------
    boresights : DataFrame
        As `boresights` returns it.
    """
    if boresights.empty:
        return style.nothing("No bundle with free orientations gives boresights of single images.")
    timed = bool(boresights["time_s"].notna().all())
    time = boresights["time_s"] / 60 if timed else boresights["number"]
    with style.applied():
        fig, axes = style.subplots(3, 1, figsize=(style.WIDTH, 4.4), sharex=True)
        for ax, axis in zip(axes, "xyz", strict=True):
            values, sigma = boresights[f"{axis}_deg"], boresights[f"sigma_{axis}_deg"]
            _by_strip(ax, time.to_numpy(), values.to_numpy(), sigma.to_numpy(), boresights["strip"])
            ax.axhline(0, color=style.INK, lw=0.7)
            if np.ptp(time) > 0:
                ends = np.array([time.min(), time.max()])
                line = np.polyfit(time.to_numpy(), values.to_numpy(), 1)
                ax.plot(ends, np.polyval(line, ends), "--", color=style.INK, lw=1.0)
            ax.set_ylabel(f"about {axis} (°)")
        axes[-1].set_xlabel("time after the first image (min)" if timed else "image number")
        handles, labels = axes[0].get_legend_handles_labels()
        if any(labels):
            style.legend_below(fig, handles, ncols=8)
    return fig


def _by_strip(ax: Axes, time: Array, values: Array, sigma: Array, strips: pd.Series) -> None:
    for i, strip in enumerate(strips.unique()):
        of_strip = (strips == strip).to_numpy()
        bars: dict[str, Any] = {"fmt": "o", "ms": 3, "lw": 0.7, "color": style.colour(i)}
        label = f"strip {style.plain(strip)}" if strip else ""
        ax.errorbar(time[of_strip], values[of_strip], yerr=sigma[of_strip], label=label, **bars)


# --- The boresight over time: values of all images, and the tests of the certified adjustment


AXES = ("x", "y", "z")
SOURCES = ("mounting/two_step", "mounting/two_step_gnss")
"""Methods that orient the images without the attitudes of the trajectory."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Turns:
    """A test of the certified boresight: for steps between strips, or for a drift.

    Attributes
    ----------
    title : str
    names : tuple of str
        Strips, or of a drift one name.
    turns_deg, sigma_deg : ndarray, shape (n, 3)
        About the body's axes: of strips less the mean, of a drift from the first exposure to the
        last.
    f, redundancy, p : float
    dof : int
    """

    title: str
    names: tuple[str, ...]
    turns_deg: Array
    sigma_deg: Array
    f: float
    dof: int
    redundancy: float
    p: float

    @property
    def sentence(self) -> str:
        """Sentence for a significant test: the largest turn relative to its sigma."""
        ratio = np.nan_to_num(np.abs(self.turns_deg / self.sigma_deg))
        i, axis = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        turn, sigma = self.turns_deg[i, axis], self.sigma_deg[i, axis]
        size = f"{turn:+.4f}° ± {sigma:.4f}° about {AXES[axis]}"
        if len(self.names) == 1:
            return f"a drift, most of all {size} from the first exposure to the last"
        return f"differences between strips, most of all {size} of strip {self.names[i]}"


TITLES = {"strips": "differences between strips", "drift": "drift"}


def turns_of(material: Material) -> list[Turns]:
    """Return the tests of the certified adjustment's boresights, from its summary."""
    entry = material.found.summary.get(material.certified, {}).get("boresight_stability")
    tests: Mapping[str, Any] = entry if isinstance(entry, dict) else {}
    return [_turns_told(title, tests[key]) for key, title in TITLES.items() if tests.get(key)]


def _turns_told(title: str, test: Mapping[str, Any]) -> Turns:
    turns, sigma = (np.array(test[key], dtype=float) for key in ("turns_deg", "sigma_deg"))
    return Turns(
        title=title,
        names=tuple(test["names"]),
        turns_deg=turns,
        sigma_deg=np.where(np.isfinite(sigma), sigma, np.inf),
        f=float(test["f"]),
        dof=int(test["dof"]),
        redundancy=float(test["redundancy"]),
        p=float(test["p"]),
    )


def boresights(material: Material) -> pd.DataFrame:
    """Return the boresight of every image, eq. (13), minus the mean of its camera.

    Returns
    -------
    DataFrame
        camera, image, strip, number (in order of time), time_s (after the first image; NaN where
        not known), x_deg, y_deg, z_deg about the axes of the body, and their sigma_*_deg from the
        image's orientation and the trajectory's attitude, without the error that all images
        share. Empty where no bundle had free orientations.
    """
    source = next((s for s in SOURCES if folder.has(material.found, s)), "")
    rows = folder.rows(material.found, "exterior_orientation", source) if source else pd.DataFrame()
    if rows.empty:
        return pd.DataFrame()
    block = block_of(material, source)
    image_idx = pd.Index(block.images.names).get_indexer(pd.Index(rows["image"]))
    turns, sigma = _of_images(block, image_idx, rows)
    times = _exposure_times(material, block).to_numpy()[block.images.exposure_idx[image_idx]]
    frame = pd.DataFrame(
        {
            "camera": [block.cameras[k].name for k in block.images.camera_idx[image_idx]],
            "image": rows["image"],
            "strip": [block.images.strips[i] for i in image_idx],
            "time_s": times - np.nanmin(times) if np.isfinite(times).any() else times,
            **{f"{axis}_deg": turns[:, i] for i, axis in enumerate(AXES)},
            **{f"sigma_{axis}_deg": sigma[:, i] for i, axis in enumerate(AXES)},
        }
    )
    known = np.isfinite(times).all()
    frame = frame.sort_values("time_s", kind="stable") if known else frame
    return frame.assign(number=np.arange(1, len(frame) + 1)).reset_index(drop=True)


def _exposure_times(material: Material, block: Block) -> pd.Series:
    """Return the times of a block's exposures, s, by their names; NaN where not given."""
    path = material.folder / KEPT / block.name / "trajectory.csv"
    with path.open("rb") as file:
        table = pd.read_csv(file, dtype=str, keep_default_na=False, encoding="utf-8-sig")
    table.columns = table.columns.str.strip()
    times = table["time_s"] if "time_s" in table else pd.Series("", index=table.index)
    known = pd.Series(pd.to_numeric(times, errors="coerce").to_numpy(), index=table["exposure"])
    return known.reindex(list(block.trajectory.exposures))


def _of_images(block: Block, image_idx: Index, rows: pd.DataFrame) -> tuple[Array, Array]:
    """Return boresights minus their mean, and their sigma, body axes, degrees, shape (n, 3)."""
    enh = rows[["east_m", "north_m", "height_m"]].to_numpy()
    opk = np.radians(rows[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy())
    T_m_c = block.frame.pose_from_grid(enh, opk)
    R_b_c = np.swapaxes(block.T_m_b_images.R[image_idx], 1, 2) @ T_m_c.R
    turns, camera_idx = np.zeros((len(rows), 3)), block.images.camera_idx[image_idx]
    for k in np.unique(camera_idx):
        of_camera = camera_idx == k
        turns[of_camera] = log(R_b_c[of_camera] @ mean_rotation(R_b_c[of_camera]).T)
    sigma_deg = rows[["sigma_omega_deg", "sigma_phi_deg", "sigma_kappa_deg"]].to_numpy()
    J = R_b_c @ np.linalg.inv(opk_jacobian(opk))
    by_image = propagate(J, np.apply_along_axis(np.diag, 1, sigma_deg**2))
    attitude = np.degrees(block.trajectory.sigma_attitude[block.images.exposure_idx[image_idx]])
    return np.degrees(turns), np.sqrt(sigmas(by_image) ** 2 + attitude**2)
