"""A small project of MicMac's version 2, written by the layout and formulas of its source."""

import numpy as np

SIZE, F, PP = (1000, 800), 1000.0, (510.0, 390.0)
K, P, B = (-0.1, 0.05, 0.01), (1e-4, -2e-4), (3e-4, -4e-4)
POINTS = {"P": (10.0, 20.0, 0.0), "Q": (30.0, 10.0, 1.0), "R": (-20.0, 40.0, 2.0)}
CENTRE = (10.0, 20.0, 100.0)

CALIBRATION = """<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<Root><Type>"MMVII_Serialization"</Type><Version>"0.0.0"</Version><Data><InternalCalibration>
<Name>"Calib-PerspCentral-C"</Name><PixelFrame><NbPix>1000 800</NbPix></PixelFrame>
<Projection>"{projection}"</Projection>
<Auxiliary><Degree>3 1 1</Degree><IsFraserMode>1</IsFraserMode></Auxiliary>
<PerfectProj><F>1000</F><PP>510 390</PP></PerfectProj>
<Distorsion>
<Radial><K1>-0.1</K1><K2>0.05</K2><K3>0.01</K3></Radial>
<Decentric><p1>1e-4</p1><p2>-2e-4</p2></Decentric>
<Polynomial><b1>3e-4</b1><b2>-4e-4</b2></Polynomial>
</Distorsion></InternalCalibration></Data></Root>"""
POSE = """<Root><Data><CameraPose>
<NameImage>"a.JPG"</NameImage><NameInternalCalib>"Calib-PerspCentral-C"</NameInternalCalib>
<Center>10 20 100</Center>
<RotMatrix><AxeI>1 0 0</AxeI><AxeJ>0 -1 0</AxeJ><AxeK>0 0 -1</AxeK></RotMatrix>
</CameraPose></Data></Root>"""
DISTANCES = {
    "Stenope": np.tan,
    "FE_EquiDist": lambda a: a,
    "FE_EquiSolid": lambda a: 2 * np.sin(a / 2),
    "StereroGraphik": lambda a: 2 * np.tan(a / 2),
}


def seen(ideal, projection="Stenope"):
    """Return pixels of ideal points x/z, y/z by the formulas of the source."""
    r = np.hypot(*ideal.T)
    far = np.maximum(r, 1e-12)
    x, y = (ideal * (DISTANCES[projection](np.arctan(far)) / far)[:, None]).T
    r2 = x * x + y * y
    radial = K[0] * r2 + K[1] * r2**2 + K[2] * r2**3
    dx = x * radial + P[0] * (3 * x * x + y * y) + P[1] * 2 * x * y + B[0] * x + B[1] * y
    dy = y * radial + P[0] * 2 * x * y + P[1] * (x * x + 3 * y * y)
    return F * np.stack([x + dx, y + dy], axis=1) + PP


def _of_points():
    at = np.array(list(POINTS.values())) - CENTRE
    return seen(at[:, :2] / -at[:, 2:] * [1, -1])


def files(projection="Stenope"):
    """Return the texts of a project by their paths."""
    measured = "".join(
        f'<el><Name>"{name}"</Name><Pt>{col!r} {row!r}</Pt><Sigma2>1 0 1</Sigma2></el>'
        for name, (col, row) in zip(POINTS, _of_points().tolist(), strict=True)
    )
    surveyed = "".join(
        f'<el><Name>"{name}"</Name><Pt>{x} {y} {z}</Pt><AdditionalInfo>""</AdditionalInfo>'
        "<__Opt__Sigma2>1e-4 0 0 1e-4 0 4e-4</__Opt__Sigma2></el>"
        for name, (x, y, z) in POINTS.items()
    )
    points = "MMVII-PhgrProj/PointsMeasure/S"
    return {
        "MMVII-PhgrProj/Ori/A/Calib-PerspCentral-C.xml": CALIBRATION.format(projection=projection),
        "MMVII-PhgrProj/Ori/A/Ori-PerspCentral-a.JPG.xml": POSE,
        f"{points}/MesIm-a.JPG.xml": "<Root><Data><SetMesIm>"
        f'<NameIm>"a.JPG"</NameIm><Measures>{measured}</Measures></SetMesIm></Data></Root>',
        f"{points}/MesGCP-S.xml": "<Root><Data><SetGCP>"
        f'<NameSet>"S"</NameSet><Measures>{surveyed}</Measures></SetGCP></Data></Root>',
    }


def write(folder, projection="Stenope"):
    """Write a project with one oriented image and three surveyed points in it."""
    for name, text in files(projection).items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder
