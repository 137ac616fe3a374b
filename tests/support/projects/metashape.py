"""A chunk of Metashape: a rig of two cameras, four exposures, nine markers."""

import zipfile

import numpy as np
import pyproj

from support.projects import scene
from support.projects.scene import NAMES, SLAVE

SCALE = 4.7
R_CHUNK = np.linalg.qr(np.array([[1.0, 2.0, 3.0], [-2.0, 1.0, 0.5], [0.3, -1.0, 2.0]]))[0]
R_CHUNK = R_CHUNK * np.sign(np.linalg.det(R_CHUNK))

CALIBRATION = f"""<calibration type="frame" class="CLASS">
  <resolution width="{scene.WIDTH}" height="{scene.HEIGHT}"/><f>FOCAL</f>
  <cx>{scene.CX - scene.WIDTH / 2}</cx><cy>{scene.CY - scene.HEIGHT / 2}</cy>
  <k1>{scene.K1}</k1><k2>{scene.K2}</k2><p1>{scene.P2}</p1><p2>{scene.P1}</p2>
</calibration>"""  # Metashape's p1 and p2 are p2 and p1 of OpenCV


def numbers(values):
    return " ".join(repr(float(value)) for value in np.ravel(values))


def chunk(*, slaves=True, wkt=None, labels=NAMES):
    """Return the XML of a chunk."""
    block = scene.scene()
    middle = block.points_e.mean(axis=0)
    wkt = pyproj.CRS(scene.CRS).to_wkt("WKT1_GDAL") if wkt is None else wkt
    cameras, locations = [], {k: [] for k in range(len(block.points_e))}
    for i, (R, r, name) in enumerate(zip(block.R_e_c, block.r_e, labels, strict=True)):
        cameras.append(_master(i, name, R_CHUNK.T @ R, R_CHUNK.T @ (r - middle) / SCALE, block))
        heads = [(2 * i, R)]
        if slaves:
            cameras.append(
                f'<camera id="{2 * i + 1}" sensor_id="1" master_id="{2 * i}" label="slave {i}"/>'
            )
            heads.append((2 * i + 1, R @ SLAVE))
        for number, turned in heads:
            for k, (u, v) in enumerate(scene.seen(turned, r, block.points_e).tolist()):
                pinned = "true" if k != 4 else "false"
                locations[k].append(
                    f'<location camera_id="{number}" pinned="{pinned}" x="{u!r}" y="{v!r}"/>'
                )
    frame = "".join(
        f'<marker marker_id="{k}">{"".join(rows)}</marker>' for k, rows in locations.items()
    )
    return f"""<chunk label="Chunk 1" enabled="true">
<sensors>{_sensor(0)}{_sensor(1) if slaves else ""}</sensors>
<components><component id="0"><transform><rotation>{numbers(R_CHUNK)}</rotation>
<translation>{numbers(middle)}</translation><scale>{SCALE}</scale></transform></component>
</components>
<cameras>{"".join(cameras)}<camera id="99" sensor_id="0" label="off" enabled="false"/></cameras>
<markers>{"".join(_marker(k, enh) for k, enh in enumerate(block.points_enh))}</markers>
<reference>{wkt.replace('"', "&quot;")}</reference>
<settings><property name="accuracy_projections" value="0.25"/></settings>
<frames><frame id="0"><markers>{frame}</markers></frame></frames>
</chunk>"""


def write(path, **wanted):
    """Write a chunk as XML that Metashape exports."""
    path.write_text(f'<document version="2.0.0">{chunk(**wanted)}</document>', encoding="utf-8")
    return path


def write_project(folder, **wanted):
    """Write a project: a .psx, and the archives beside it."""
    files = folder / "p.files"
    text = chunk(**wanted)
    begin, end = text.index("<frames>"), text.index("</frames>") + len("</frames>")
    frame = text[begin:end].removeprefix("<frames>").removesuffix("</frames>")
    listed = '<frames><frame id="0" path="0/frame.zip"/></frames>'
    _pack(files / "0" / "chunk.zip", text[:begin] + listed + text[end:])
    _pack(files / "0" / "0" / "frame.zip", frame)
    chunks = '<chunks active_id="0"><chunk id="0" path="0/chunk.zip"/></chunks>'
    _pack(files / "project.zip", f"<document>{chunks}</document>")
    project = folder / "p.psx"
    project.write_text('<document version="1.2.0" path="{projectname}.files/project.zip"/>')
    return project


def _pack(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.xml", text)


def _sensor(i):
    both = [
        CALIBRATION.replace("CLASS", "initial").replace("FOCAL", "1440.0"),
        CALIBRATION.replace("CLASS", "adjusted").replace("FOCAL", repr(scene.F)),
    ]
    master = ' master_id="0"' if i else ""
    rotation = f"<rotation>{numbers(SLAVE)}</rotation>" if i else ""
    return (
        f'<sensor id="{i}" label="head {i}" type="frame"{master}>'
        f'<resolution width="{scene.WIDTH}" height="{scene.HEIGHT}"/>'
        f'<property name="pixel_width" value="{scene.PIXEL_MM}"/>'
        f"{''.join(both)}{rotation}</sensor>"
    )


def _master(i, name, R, r, block):
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = R, r
    lon, lat, height = block.lonlath[i].tolist()
    yaw, pitch, roll = scene.YPR[i].tolist()
    return (
        f'<camera id="{2 * i}" sensor_id="0" component_id="0" label="{name}">'
        f"<transform>{numbers(transform)}</transform>"
        f'<reference x="{lon!r}" y="{lat!r}" z="{height!r}" yaw="{yaw}" pitch="{pitch}" '
        f'roll="{roll}" sxyz="0.05" enabled="true"/></camera>'
    )


def _marker(k, enh):
    east, north, height = enh.tolist()
    enabled = "false" if k == 8 else "true"
    return (
        f'<marker id="{k}" label="P{k}"><reference x="{east}" y="{north}" z="{height}" '
        f'sxyz="0.02" enabled="{enabled}"/></marker>'
    )
