"""Small projects of MicMac, of its first and its second version, written line by line."""

import numpy as np

CALIBRATION = """<?xml version="1.0" ?>
<ExportAPERO><CalibrationInternConique>
<KnownConv>eConvApero_DistM2C</KnownConv><PP>500 400</PP><F>1000</F><SzIm>1000 800</SzIm>
<CalibDistortion>{model}</CalibDistortion>
</CalibrationInternConique></ExportAPERO>"""
RADIAL = "<ModRad><CDist>510 390</CDist><CoeffDist>1e-8</CoeffDist></ModRad>"
FRASER = (
    "<ModPhgrStd><RadialePart><CDist>510 390</CDist><CoeffDist>1e-8</CoeffDist></RadialePart>"
    "<P1>1e-6</P1><P2>-2e-6</P2><b1>1e-4</b1></ModPhgrStd>"
)
ORIENTATION = """<ExportAPERO><OrientationConique>
<TypeProj>eProjStenope</TypeProj><FileInterne>Ori-A/AutoCal_C.xml</FileInterne>
<Externe><KnownConv>eConvApero_DistM2C</KnownConv><Centre>10 20 100</Centre>
<ParamRotation><CodageMatr><L1>1 0 0</L1><L2>0 -1 0</L2><L3>0 0 -1</L3></CodageMatr></ParamRotation>
</Externe></OrientationConique></ExportAPERO>"""
SURVEYED = """<DicoAppuisFlottant><OneAppuisDAF><Pt>10 20 0</Pt><NamePt>P</NamePt>
<Incertitude>0.01 0.01 0.02</Incertitude></OneAppuisDAF></DicoAppuisFlottant>"""
MEASURED = """<SetOfMesureAppuisFlottants><MesureAppuiFlottant1Im><NameIm>a.JPG</NameIm>
<OneMesureAF1I><NamePt>P</NamePt><PtIm>500 400</PtIm></OneMesureAF1I>
<OneMesureAF1I><NamePt>T</NamePt><PtIm>1 2</PtIm></OneMesureAF1I>
</MesureAppuiFlottant1Im></SetOfMesureAppuisFlottants>"""


FILES = {
    "Ori-A/AutoCal_C.xml": CALIBRATION.format(model="<ModNoDist></ModNoDist>"),
    "Ori-A/Orientation-a.JPG.xml": ORIENTATION,
    "points.xml": SURVEYED,
    "measured.xml": MEASURED,
    "other.xml": "<Something/>",
}


def write(folder, **files):
    """Write a folder with one oriented image, a surveyed point and two measurements."""
    (folder / "Ori-A").mkdir(parents=True)
    for name, text in {**FILES, **files}.items():
        (folder / name).write_text(text)
    return folder


# --- MicMac's version 2


MMVII_SIZE, MMVII_F, MMVII_PP = (1000, 800), 1000.0, (510.0, 390.0)
MMVII_K, MMVII_P, MMVII_B = (-0.1, 0.05, 0.01), (1e-4, -2e-4), (3e-4, -4e-4)
MMVII_POINTS = {"P": (10.0, 20.0, 0.0), "Q": (30.0, 10.0, 1.0), "R": (-20.0, 40.0, 2.0)}
MMVII_CENTRE = (10.0, 20.0, 100.0)

MMVII_CALIBRATION = """<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<Root><Type>"MMVII_Serialization"</Type><Version>"0.0.0"</Version><Data><InternalCalibration>
<Name>"Calib-PerspCentral-C"</Name><PixelFrame><NbPix>1000 800</NbPix></PixelFrame>
<Projection>"Stenope"</Projection>
<Auxiliary><Degree>3 1 1</Degree><IsFraserMode>1</IsFraserMode></Auxiliary>
<PerfectProj><F>1000</F><PP>510 390</PP></PerfectProj>
<Distorsion>
<Radial><K1>-0.1</K1><K2>0.05</K2><K3>0.01</K3></Radial>
<Decentric><p1>1e-4</p1><p2>-2e-4</p2></Decentric>
<Polynomial><b1>3e-4</b1><b2>-4e-4</b2></Polynomial>
</Distorsion></InternalCalibration></Data></Root>"""
MMVII_POSE = """<Root><Data><CameraPose>
<NameImage>"a.JPG"</NameImage><NameInternalCalib>"Calib-PerspCentral-C"</NameInternalCalib>
<Center>10 20 100</Center>
<RotMatrix><AxeI>1 0 0</AxeI><AxeJ>0 -1 0</AxeJ><AxeK>0 0 -1</AxeK></RotMatrix>
</CameraPose></Data></Root>"""


def mmvii_seen(ideal):
    """Return pixels of ideal points x/z, y/z by the formulas of the source."""
    x, y = ideal.T
    r2 = x * x + y * y
    radial = MMVII_K[0] * r2 + MMVII_K[1] * r2**2 + MMVII_K[2] * r2**3
    dx = (
        x * radial
        + MMVII_P[0] * (3 * x * x + y * y)
        + MMVII_P[1] * 2 * x * y
        + MMVII_B[0] * x
        + MMVII_B[1] * y
    )
    dy = y * radial + MMVII_P[0] * 2 * x * y + MMVII_P[1] * (x * x + 3 * y * y)
    return MMVII_F * np.stack([x + dx, y + dy], axis=1) + MMVII_PP


def _mmvii_of_points():
    at = np.array(list(MMVII_POINTS.values())) - MMVII_CENTRE
    return mmvii_seen(at[:, :2] / -at[:, 2:] * [1, -1])


def mmvii_files():
    """Return the texts of a project by their paths."""
    measured = "".join(
        f'<el><Name>"{name}"</Name><Pt>{col!r} {row!r}</Pt><Sigma2>1 0 1</Sigma2></el>'
        for name, (col, row) in zip(MMVII_POINTS, _mmvii_of_points().tolist(), strict=True)
    )
    surveyed = "".join(
        f'<el><Name>"{name}"</Name><Pt>{x} {y} {z}</Pt><AdditionalInfo>""</AdditionalInfo>'
        "<__Opt__Sigma2>1e-4 0 0 1e-4 0 4e-4</__Opt__Sigma2></el>"
        for name, (x, y, z) in MMVII_POINTS.items()
    )
    points = "MMVII-PhgrProj/PointsMeasure/S"
    return {
        "MMVII-PhgrProj/Ori/A/Calib-PerspCentral-C.xml": MMVII_CALIBRATION,
        "MMVII-PhgrProj/Ori/A/Ori-PerspCentral-a.JPG.xml": MMVII_POSE,
        f"{points}/MesIm-a.JPG.xml": "<Root><Data><SetMesIm>"
        f'<NameIm>"a.JPG"</NameIm><Measures>{measured}</Measures></SetMesIm></Data></Root>',
        f"{points}/MesGCP-S.xml": "<Root><Data><SetGCP>"
        f'<NameSet>"S"</NameSet><Measures>{surveyed}</Measures></SetGCP></Data></Root>',
    }


def mmvii_write(folder):
    """Write a project with one oriented image and three surveyed points in it."""
    for name, text in mmvii_files().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder
