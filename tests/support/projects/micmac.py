"""Small projects of MicMac, written line by line."""

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
