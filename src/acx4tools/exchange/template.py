"""The files of a new flight, to be filled in: a flight.toml with remarks, tables with a header."""

from __future__ import annotations

from collections.abc import Sequence

from acx4tools.exchange import written_toml

TABLES = {
    "images.csv": "image,camera,exposure,strip\n",
    "image_points.csv": "image,point,col_px,row_px\n",
    "trajectory.csv": "exposure,lat_deg,lon_deg,height_m,roll_deg,pitch_deg,heading_deg,time_s\n",
}
VIRTUAL = ("SYN", *(f"SYN_{k}" for k in range(1, 100)))
"""Names of the synthetic camera: the first that no head has."""

CONTROL = "point,east_m,north_m,height_m,role\n"

HEAD = """\
# A flight of acx4. What begins with # is a remark: take the # away to use a key.
# All keys, and all columns of the tables, are in the part "Your own flight" of the book.

name = {name}
crs = {crs}  # projected CRS, in metres, of all east and north
heights = {heights}  # "ellipsoidal", a vertical CRS, a geoid grid file, or an undulation in m
refraction = "none"  # or "standard"
"""

CAMERA = """
[cameras.{camera}]
# width_px = 8984  # columns of an image
# height_px = 6732  # rows of an image
# pixel_um = 6.0  # size of a pixel
# focal_mm = 74.0  # approximate; the calibration estimates it
# mount_omega_deg = 0.0  # approximate boresight: camera axes (x right, y up) in those of the body
# mount_phi_deg = 0.0
# mount_kappa_deg = -90.0  # the top of the image points forward; 90.0: backward
# lever_x_m = 0.0  # from the IMU to the camera: forward
# lever_y_m = 0.0  # left
# lever_z_m = 0.0  # up
"""

SYNTHETIC = """
# The image into which the heads are rendered is that of a camera as well; the first head is the
# reference of the others.
[synthetic]
camera = {camera}
heads = {heads}
# measured_in = "synthetic"  # or "heads": where points of calibration/ and validation/ are measured
"""

END = """
[apriori]  # standard deviations where a table has no column for them
image_point_px = 0.5
gnss_horizontal_m = 0.05
gnss_vertical_m = 0.1
roll_pitch_deg = 0.005
heading_deg = 0.008
"""


def files(name: str, *, cameras: Sequence[str], crs: str, heights: str | float) -> dict[str, str]:
    """Return the texts of a new flight by their names below its folder.

    Parameters
    ----------
    name : str
        Of the flight.
    cameras : sequence of str
        One camera has the block calibration; several are heads, and have the block heads.
    crs : str
    heights : str or float
        As flight.toml takes them.
    """
    known = {"name": name, "crs": crs, "heights": heights}
    value = {key: written_toml.value_of(one) for key, one in known.items()}
    text = HEAD.format(**value)
    is_rig = len(cameras) > 1
    synthetic = next(name for name in VIRTUAL if name not in cameras[: len(VIRTUAL) - 1])
    for camera in (*cameras, *([synthetic] if is_rig else [])):
        text += CAMERA.format(camera=written_toml.key_of(camera))
    if is_rig:
        names = {"camera": synthetic, "heads": list(cameras)}
        text += SYNTHETIC.format(**{key: written_toml.value_of(one) for key, one in names.items()})
    block = "heads" if is_rig else "calibration"
    tables = {f"{block}/{file}": header for file, header in TABLES.items()}
    return {"flight.toml": text + END, "control_points.csv": CONTROL, **tables}
