"""Good files of every kind that is imported, and results that are exported: all small."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4files.exchange.outward.programs import KINDS as EXPORTS
from support import run_results
from support.pictures import tagged
from support.projects import colmap, metashape, micmac, opf, pix4d

CRS = ("--crs", "EPSG:31982")
SIZED = ("--size", "400x300")
PIXELS = ("--pixel-um", "10")

LIST = "P1 C\n1006 -1.5 1.5\n1020 1.0 -0.75\n-99\nP2 C\n1006 -0.5 1.4\n1020 1.9 -0.7\n-99\n"
GEOIN = "C remark\nCONT 1006 669850.0 7187900.0 900.0\nCHCK 1020 669900.0 7187950.0 905.0\n"
GCP_LIST = """WGS84 UTM 22S
669850.0 7187900.0 900.0 10 20 a.jpg north
669850.0 7187900.0 900.0 100.5 200.25 b.jpg north
669900.0 7187950.0 NaN 30 40 b.jpg south
"""
MODEL = {"projection_type": "brown", "width": 400, "height": 300, "focal_x": 0.9, "focal_y": 0.9}
SHOT = {"rotation": [3.1, 0.1, 0.05], "camera": "m", "gps_dop": 5.0, "orientation": 1}
RIG = {"rotation": [0, 0, 0], "translation": [0.1, 0, 0]}
RECONSTRUCTION = {
    "cameras": {"m": MODEL | {"k1": -0.05, "k2": 0.01, "p1": 1e-3, "p2": 2e-3, "c_x": 0.01}},
    "shots": {
        f"{k}.jpg": SHOT | {"translation": [-k, 2.0, 60.0], "gps_position": [k, 2.0, 60.0]}
        for k in range(3)
    },
    "points": {str(k): {"coordinates": [k, -k, k / 2], "color": [1, 2, 3]} for k in range(4)},
    "reference_lla": {"latitude": -25.4, "longitude": -49.3, "altitude": 900.0},
    "rig_cameras": {"left": RIG, "right": RIG},
    "rig_instances": {"i": RIG | {"rig_camera_ids": {"0.jpg": "left", "1.jpg": "right"}}},
}
TRACKS = "OPENSFM_TRACKS_VERSION_v2\n" + "".join(
    f"{k}.jpg\t{n}\t{n}\t{0.1 * n}\t{-0.05 * n}\t0.01\t1\t2\t3\t-1\t-1\n"
    for k in range(3)
    for n in range(4)
)
OPENSFM_CONTROL = {
    "points": [
        {
            "id": "A",
            "position": {"latitude": -25.4, "longitude": -49.3, "altitude": 905.0},
            "observations": [{"shot_id": "0.jpg", "projection": [0.0, 0.1]}],
        }
    ]
}
MICMAC = {
    "Ori-A/AutoCal_C.xml": """<?xml version="1.0" ?>
<ExportAPERO><CalibrationInternConique>
<KnownConv>eConvApero_DistM2C</KnownConv><PP>500 400</PP><F>1000</F><SzIm>1000 800</SzIm>
<CalibDistortion><ModPhgrStd><RadialePart><CDist>510 390</CDist><CoeffDist>1e-8</CoeffDist>
</RadialePart><P1>1e-6</P1></ModPhgrStd></CalibDistortion>
</CalibrationInternConique></ExportAPERO>
""",
    "Ori-A/Orientation-a.JPG.xml": """<ExportAPERO><OrientationConique>
<TypeProj>eProjStenope</TypeProj><FileInterne>Ori-A/AutoCal_C.xml</FileInterne>
<Externe><KnownConv>eConvApero_DistM2C</KnownConv><Centre>669850 7187900 2000</Centre>
<ParamRotation><CodageMatr><L1>1 0 0</L1><L2>0 -1 0</L2><L3>0 0 -1</L3></CodageMatr></ParamRotation>
</Externe><Verif><Appuis><Num>0</Num><Im>500 400</Im><Ter>669850 7187900 900</Ter></Appuis></Verif>
</OrientationConique></ExportAPERO>
""",
    "points.xml": """<DicoAppuisFlottant><OneAppuisDAF><Pt>669850 7187900 900</Pt><NamePt>P</NamePt>
<Incertitude>0.01 0.01 0.02</Incertitude></OneAppuisDAF></DicoAppuisFlottant>
""",
    "measured.xml": """<SetOfMesureAppuisFlottants><MesureAppuiFlottant1Im><NameIm>a.JPG</NameIm>
<OneMesureAF1I><NamePt>P</NamePt><PtIm>500 400</PtIm></OneMesureAF1I>
<OneMesureAF1I><NamePt>T</NamePt><PtIm>1 2</PtIm></OneMesureAF1I>
</MesureAppuiFlottant1Im></SetOfMesureAppuisFlottants>
""",
}
FISHEYE = (
    MICMAC["Ori-A/AutoCal_C.xml"].split("<CalibDistortion>")[1].split("</CalibDistortion>")[0],
    "<ModUnif><TypeModele>eModele_FishEye_10_5_5</TypeModele><Params>510</Params>"
    "<Params>390</Params><Params>-0.01</Params><Etats>990</Etats></ModUnif>",
)
ORIENTATIONS = """image,east,north,height,omega,phi,kappa,time
a,669850.0,7187900.0,2000.0,0.1,-0.2,45.0,100.5
b,669950.0,7187900.0,2001.0,0.1,-0.2,45.0,101.5
"""
POSPAC = """Mapping frame: UTM, zone 22 south, SIRGAS 2000
Boresight values: tx = 0.01, ty = 0.02, tz = 0.03
(position in Meters, orientation in Degrees, lat, long in Deg)
ID\tEVENT\tTIME(s)\tEASTING\tNORTHING\tELLIPSOID HEIGHT\tOMEGA\tPHI\tKAPPA\tLAT\tLONG
a\t1\t100.5\t669850.0\t7187900.0\t2000.0\t0.1\t-0.2\t45.0\t-25.41\t-49.31
b\t2\t101.5\t669950.0\t7187900.0\t2001.0\t0.1\t-0.2\t45.0\t-25.41\t-49.309
"""
MEASURED = """CHANTIER : HALLE - 2015
DATE : 12/06/2015

image col row point sigma
a 10.5 20.25 1006 0.3
a 200 150 "1020" 0.3
b 12.5 20 1006 0.5
"""
SURVEYED = """1006 13 -25.41 -49.31 900.0 0.02
1020 3 -25.411 -49.309 905.5 0.02
"""
EVENTS = "image,time\na,100.52\nb,101.01\n"


@dataclass(frozen=True, kw_only=True)
class Source:
    """A good source.

    Attributes
    ----------
    write : callable
        Writes it into an empty folder.
    source : str
        What of that folder is given to the command; "." is all of it.
    options : tuple of str
        In them {} is the folder.
    kind : str
        Of the import, where it is not its own name.
    """

    write: Callable[[Path], object]
    source: str = "."
    options: tuple[str, ...] = ()
    kind: str = ""


def _files(**files: str) -> Callable[[Path], object]:
    return _of({name.replace("__", "."): text for name, text in files.items()})


def _of(files: dict[str, str]) -> Callable[[Path], object]:
    def write(folder: Path) -> None:
        for name, text in files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    return write


def _sbet(folder: Path) -> None:
    t = np.arange(100.0, 102.0, 0.05)
    records = np.zeros((len(t), 17))
    records[:, 0], records[:, 3] = t, 2000.0
    records[:, 1:3] = np.radians([-25.41, -49.31])
    records.astype("<f8").tofile(folder / "sbet.out")
    sigma = np.full((len(t), 10), 0.5)
    sigma[:, 0] = t
    sigma.astype("<f8").tofile(folder / "smrmsg.out")
    (folder / "events.csv").write_text(EVENTS)


SMALL = {
    "Camera:PrincipalPoint": "0.12,0.09",
    "Camera:PerspectiveFocalLength": 1.2,
    "Camera:PerspectiveFocalLengthUnits": "mm",
    "Camera:VignettingCenter": [8, 6],
    "Camera:VignettingPolynomial": [1e-4, -1e-5],
    "DLS:Yaw": 0.1,
    "DLS:Pitch": 0.1,
    "DLS:Roll": 0.1,
}


def _heads(folder: Path) -> None:
    """Write two heads at one exposure; so small that mutations find the metadata."""
    grey = np.full((12, 16), 5000, np.uint16)
    for k in range(2):
        said = tagged.micasense(k, relatives=(0.1 * k, 0, 0), **SMALL)
        tagged.write(folder / f"IMG_0001_{k + 1}.tif", said, pixels=grey)


def _photograph(folder: Path) -> None:
    said = {
        "drone-dji:DewarpData": "2018-03-13;364,360,2.5,-1.5,0.01,0,0,0,0",
        **{f"drone-dji:Gimbal{name}Degree": "+1.0" for name in ("Roll", "Pitch", "Yaw")},
    }
    tagged.write(folder / "DJI_0001.JPG", said, attributes=True)


def _results(folder: Path) -> None:
    made = run_results.leave_calibration(folder / "made", run_results.estimated("CAM"))
    shutil.copytree(made, folder / "results")
    shutil.rmtree(folder / "made")


SOURCES: dict[str, Source] = {
    "metashape": Source(
        write=lambda folder: metashape.write(folder / "chunk.xml"), source="chunk.xml"
    ),
    "metashape-project": Source(write=metashape.write_project, source="p.psx", kind="metashape"),
    "colmap": Source(write=colmap.write_text, options=("--orientations", "adjusted", *CRS)),
    "colmap-binary": Source(write=colmap.write_binary, kind="colmap"),
    "opf": Source(write=opf.write),
    "opensfm": Source(
        write=_of(
            {
                "reconstruction.json": json.dumps([RECONSTRUCTION], indent=1),
                "tracks.csv": TRACKS,
                "ground_control_points.json": json.dumps(OPENSFM_CONTROL, indent=1),
            }
        ),
        options=("--orientations", "adjusted"),
    ),
    "micmac": Source(write=_of(MICMAC), options=("--orientations", "adjusted", *CRS)),
    "micmac-fisheye": Source(
        write=_of({name: text.replace(*FISHEYE) for name, text in MICMAC.items()}),
        options=("--allow", "1000"),
        kind="micmac",
    ),
    "mmvii": Source(
        write=micmac.mmvii_write, options=("--orientations", "adjusted", *CRS), kind="micmac"
    ),
    "pix4d": Source(write=pix4d.write),
    "bingo": Source(write=_files(image__dat=LIST, geoin__dat=GEOIN), options=(*SIZED, *PIXELS)),
    "patb": Source(
        write=_files(a__im=LIST), source="a.im", options=(*SIZED, *PIXELS, "--unit", "mm")
    ),
    "odm-control": Source(
        write=_files(gcp_list__txt=GCP_LIST), source="gcp_list.txt", options=("--camera", "C")
    ),
    "sbet": Source(
        write=_sbet,
        source="sbet.out",
        options=(
            *("--events", "{}/events.csv", "--smrmsg", "{}/smrmsg.out", "--time", "gps-sow"),
            *CRS,
        ),
    ),
    "pospac-text": Source(write=_files(event__txt=POSPAC), source="event.txt", options=CRS),
    "orientations": Source(
        write=_files(eo__csv=ORIENTATIONS), source="eo.csv", options=(*CRS, "--of", "camera")
    ),
    "image-points": Source(
        write=_files(points__mes=MEASURED),
        source="points.mes",
        options=("--camera", "C", "--first", "0.5"),
    ),
    "control-points": Source(
        write=_files(points__app=SURVEYED),
        source="points.app",
        options=("--columns", "point skip lat lon height sigma_east", *CRS),
    ),
    "pictures": Source(write=_heads),
    "pictures-jpeg": Source(write=_photograph, kind="pictures"),
    "export": Source(write=_results, source="results", options=("--allow", "1")),
}
"""By the name of the kind."""


def export_options(case: int) -> tuple[str, ...]:
    """Return what a case is exported to."""
    kind = sorted(EXPORTS)[case % len(EXPORTS)]
    oriented = ("--orientations", "calibration") if EXPORTS[kind].oriented else ()
    return ("--to", kind, *oriented)


def write_all(folder: Path) -> None:
    """Write all good sources, each into a folder of its name."""
    for name, one in SOURCES.items():
        (folder / name).mkdir()
        one.write(folder / name)
