#!/usr/bin/env python3
"""Writes the first inputs of every fuzz target to `corpus/TARGET`: small valid files, from which the fuzzer goes on.

    python3 seeds.py && cargo +nightly fuzz run tables
"""

import gzip
import json
import pathlib
import struct
import zlib

FOLDER = pathlib.Path(__file__).parent
ROOT = FOLDER.parent


def seed(target, name, contents):
    path = FOLDER / "corpus" / target / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(contents if isinstance(contents, bytes) else contents.encode())


def nifti(shape, code, values, byte_order="<"):
    """A NIfTI-1 image of values of one type."""
    form = {4: "h", 16: "f", 64: "d"}[code]
    dim = [len(shape), *shape] + [1] * (7 - len(shape))
    head = bytearray(348)
    struct.pack_into(byte_order + "i", head, 0, 348)
    struct.pack_into(byte_order + "8h", head, 40, *dim)
    struct.pack_into(byte_order + "2h", head, 70, code, 8 * struct.calcsize(form))
    struct.pack_into(byte_order + "8f", head, 76, 1, 1, 0.5, 0.75, 1, 1, 1, 1)
    struct.pack_into(byte_order + "3f", head, 108, 352, 1, 0)
    head[123] = 2
    struct.pack_into(byte_order + "2h", head, 252, 0, 1)
    for row in range(3):
        struct.pack_into(byte_order + "4f", head, 280 + 16 * row, *[float(row == c) for c in range(3)], -1.0)
    head[344:348] = b"n+1\0"
    return bytes(head) + b"\0" * 4 + struct.pack(f"{byte_order}{len(values)}{form}", *values)


def mat_element(kind, data):
    return struct.pack("<2I", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def mat(name, shape, values, compressed):
    """A MATLAB file of version 5 with one array of doubles."""
    flags = mat_element(6, struct.pack("<2I", 6, 0))
    dims = mat_element(5, struct.pack(f"<{len(shape)}i", *shape))
    array = flags + dims + mat_element(1, name.encode()) + mat_element(9, struct.pack(f"<{len(values)}d", *values))
    element = mat_element(14, array)
    if compressed:
        packed = zlib.compress(element)
        element = struct.pack("<2I", 15, len(packed)) + packed
    return b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM" + element


def dicom():
    """One MR image of 2 x 2 pixels, explicit little endian."""

    def element(group, number, kind, value):
        value = value if isinstance(value, bytes) else value.encode()
        value += (b"\0" if kind == "UI" else b" ") * (len(value) % 2)
        wide = kind in ("OW", "OB")
        length = b"\0\0" + struct.pack("<I", len(value)) if wide else struct.pack("<H", len(value))
        return struct.pack("<2H", group, number) + kind.encode() + length + value

    def number(group, place, value):
        return element(group, place, "US", struct.pack("<H", value))

    syntax = element(2, 0x10, "UI", "1.2.840.10008.1.2.1")
    meta = element(2, 0, "UL", struct.pack("<I", len(syntax))) + syntax
    data = [
        element(8, 8, "CS", "ORIGINAL\\PRIMARY\\P\\ND"),
        element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.4"),
        element(8, 0x18, "UI", "1.2.3.4"),
        element(8, 0x60, "CS", "MR"),
        element(0x18, 0x50, "DS", "0.75"),
        element(0x20, 0xD, "UI", "1.2.3"),
        element(0x20, 0xE, "UI", "1.2.3.1"),
        element(0x20, 0x11, "IS", "5"),
        element(0x20, 0x13, "IS", "1"),
        element(0x20, 0x32, "DS", "0\\0\\0"),
        element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0"),
        number(0x28, 2, 1),
        element(0x28, 4, "CS", "MONOCHROME2"),
        number(0x28, 0x10, 2),
        number(0x28, 0x11, 2),
        element(0x28, 0x30, "DS", "1\\0.5"),
        number(0x28, 0x100, 16),
        number(0x28, 0x101, 16),
        number(0x28, 0x102, 15),
        number(0x28, 0x103, 1),
        element(0x28, 0x1052, "DS", "0"),
        element(0x28, 0x1053, "DS", "0.001"),
        element(0x7FE0, 0x10, "OW", struct.pack("<4h", 1, -2, 3, -4)),
    ]
    return b"\0" * 128 + b"DICM" + meta + b"".join(data)


def paravision():
    visu = """##TITLE=Parameter List
##JCAMPDX=4.24
##$VisuCoreFrameCount=2
##$VisuCoreDim=2
##$VisuCoreSize=( 2 )
2 2
##$VisuCoreExtent=( 2 )
2 1
##$VisuCoreFrameThickness=( 1 )
0.75
##$VisuCoreUnits=( 2, 65 )
<mm> <mm>
##$VisuCoreOrientation=( 2, 9 )
1 0 0 0 1 0 0 0 1 @9*(0)
##$VisuCorePosition=( 2, 3 )
0 0 0 0 0 0.75
##$VisuCoreDataOffs=( 2 )
@2*(0)
##$VisuCoreDataSlope=( 2 )
0.001 0.001
##$VisuCoreFrameType=PHASE_IMAGE
##$VisuCoreWordType=_16BIT_SGN_INT
##$VisuCoreByteOrder=littleEndian
##$VisuCoreDiskSliceOrder=disk_normal_slice_order
##$VisuFGOrderDescDim=1
##$VisuFGOrderDesc=( 1 )
(2, <FG_SLICE>, <>, 0, 2)
##$VisuAcquisitionProtocol=( 65 )
<FLOWMAP>
##END=
"""
    reco = "##TITLE=Parameter List\n##$RECO_map_mode=PERCENTILE_MAP\n##END=\n"
    method = "##TITLE=Parameter List\n##$Method=<User:mru>\n##$PVM_SliceOrient=axial\n##END=\n"
    return b"\xff".join(
        [visu.encode(), reco.encode(), method.encode(), struct.pack("<8h", *range(8))]
    )


def main():
    for path in sorted((ROOT / "geometries").rglob("*.json")):
        seed("inputs", path.name, path.read_bytes())
    # The documented requests: an example of each kind, which the reference of the service holds.
    api = json.loads((ROOT / "api" / "openapi.json").read_text())
    for number, (address, entry) in enumerate(sorted(api["paths"].items())):
        content = entry.get("post", {}).get("requestBody", {}).get("content", {}).get("application/json", {})
        examples = [content["example"]] if "example" in content else []
        examples += [e.get("value") for e in content.get("examples", {}).values()]
        for example in examples:
            for kind in range(16):
                seed("requests", f"{number}-{kind}", bytes([kind]) + json.dumps(example).encode())
    seed("tables", "plain.csv", "time_s,stretch,nominal_stress_kpa\n0,1,0\n1,1.1,5.5\n2,1.2,9\n")
    seed("tables", "machine.csv", "Sample 3\r\n\r\nTime;Extension;Load\r\n(s);(mm);(N)\r\n0,0;0,0;0,0\r\n0,5;1,0;2,5\r\n")
    seed("tables", "load.csv", "time_s,drive_mm,force_n\n0,0,0\n1,2.5,4.6\n2,5,9.3\n")
    seed("tables", "points.csv", "x_mm,y_mm,z_mm,u_mm,v_mm,w_mm\n0,0,0,0.1,0,0\n1,0,0,0.2,0.1,0\n")
    values = [0.25 * n for n in range(24)]
    seed("nifti", "vector.nii", nifti([2, 2, 2, 3], 16, values))
    seed("nifti", "vector.nii.gz", gzip.compress(nifti([2, 2, 2, 1, 3], 64, values), mtime=0))
    seed("nifti", "mask.nii", nifti([2, 3, 4], 4, list(range(24)), ">"))
    seed("mat", "plain.mat", mat("u", [2, 2, 2, 3], values, False))
    seed("mat", "packed.mat", mat("mask", [2, 3, 4], values, True))
    for path in sorted((ROOT / "tests" / "data").rglob("*.mat")):
        if path.stat().st_size < 100_000:
            seed("mat", path.name, path.read_bytes())
    seed("scanner", "image.dcm", dicom())
    seed("scanner", "paravision", paravision())


if __name__ == "__main__":
    main()
