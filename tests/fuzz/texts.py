"""Small valid files of the formats that are text, and archives of them."""

from __future__ import annotations

import io
import tarfile
import zipfile

from tests.fuzz.seeds import FORCE, TIME, Files

MME = """\
Channel code                :10ROPS000000FOZC
Unit                        :N
Reference channel           :implicit
Sampling interval           :0.001
Time of first sample        :0.0
Number of samples           :3
1
2
3
"""


def mme_members() -> Files:
    listing = "Number of channels :1\nName of channel 001 :10ROPS000000FOZC / a\n"
    return {
        "a.mme": b"Title :x\nLaboratory name :Lab\n",
        "Channel/a.chn": listing.encode(),
        "Channel/a.001": MME.encode(),
    }


def zipped(members: Files) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def tarred(members: Files) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as archive:
        for name, data in members.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            archive.addfile(info, io.BytesIO(data))
    return stream.getvalue()


def lvm() -> bytes:
    head = [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Separator\tTab",
        "Decimal_Separator\t.",
        "Multi_Headings\tNo",
    ]
    head += [
        "X_Columns\tOne",
        "Time_Pref\tRelative",
        "Date\t2023/05/05",
        "Time\t13:39:50.5",
        "***End_of_Header***\t",
        "\t",
    ]
    head += [
        "Channels\t1",
        "Samples\t12",
        "Date\t2023/05/05",
        "Time\t13:39:50.5",
        "Y_Unit_Label\tN",
        "X_Dimension\tTime",
    ]
    head += ["X0\t0.0E+0", "Delta_X\t0.001", "***End_of_Header***", f"X_Value\t{FORCE}\tComment"]
    return "\n".join([*head, *(f"{t:.6f}\t{k + 0.5}" for k, t in enumerate(TIME)), ""]).encode()


def dts() -> bytes:
    head = ["Sample Rate (Hz),1000,", "ISO Channel Code,10VEHCCG0000ACXA,D0HEADCG0000ACXA", "Engineering Unit,g,g"]
    head += ["Data Starts Here,,", "Time,Chan 5:AC3,Chan 6:AC4"]
    return "\n".join([*head, *(f"{t:.6f},{k},{2 * k}" for k, t in enumerate(TIME)), ""]).encode()


def nhtsa() -> Files:
    one = "1|1|AC|NA|VECG|XL|SEC|G'S|1650|ENDEVCO||20000|200|0|-10|29|50|AM|P|made up"
    test = "V5|Overturn of a tractor|OBJ|12-MAR-1998|The laboratory|" + "|".join(["x"] * 15)
    lines = [
        "----- EV5 -----",
        "----- TEST -----",
        test,
        "----- VEHICLE -----",
        "1|A|B",
        "----- INSTRUMENTATION -----",
        one,
    ]
    curve = "".join(f"{t:.6f}\t{k:.6f}\r\n" for k, t in enumerate(TIME))
    return {"v00001.EV5": "\r\n".join([*lines, "----- END -----", ""]).encode(), "v00001.001": curve.encode()}
