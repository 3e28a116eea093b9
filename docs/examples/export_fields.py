"""Writes one step of a recording as another program's file: a MATLAB file or a table of points.

    python3 export_fields.py RECORDING STEP FILE.mat
    python3 export_fields.py RECORDING STEP FILE.csv

It shows how such files are laid out. MATLAB files need NumPy and SciPy, tables Python's standard library alone.
"""

import gzip
import json
import struct
import sys
from pathlib import Path

folder, step, target = Path(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
recording = json.loads((folder / "recording.json").read_text())
drive_mm = recording["steps"][step - 1]["drive_mm"]
voxel_mm = recording["acquisition"]["voxel_mm"]


def read_nifti(name):
    """Sizes, affine (rows) and numbers (x fastest, components last) of an image as lambdak writes it."""
    data = gzip.decompress((folder / name).read_bytes())
    sizes = struct.unpack_from("<8h", data, 40)
    kind = {2: "B", 16: "f"}[struct.unpack_from("<h", data, 70)[0]]
    start = int(struct.unpack_from("<f", data, 108)[0])
    affine = [struct.unpack_from("<4f", data, 280 + 16 * row) for row in range(3)]
    count = 1
    for size in sizes[1 : 1 + sizes[0]]:
        count *= size
    return sizes[1:4], affine, struct.unpack_from(f"<{count}{kind}", data, start)


shape, affine, mask = read_nifti(recording["mask"])
_, _, values = read_nifti(recording["steps"][step - 1]["displacement"])
num_voxels = len(mask)

if target.suffix == ".csv":
    rows = ["x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm"]
    for voxel in range(num_voxels):
        if not mask[voxel]:
            continue
        index = (voxel % shape[0], voxel // shape[0] % shape[1], voxel // (shape[0] * shape[1]))
        position = [affine[a][a] * index[a] + affine[a][3] for a in range(3)]
        displacement = [values[voxel + c * num_voxels] for c in range(3)]
        rows.append(",".join(f"{number:.6g}" for number in position + displacement))
    target.write_text("\n".join(rows) + "\n")
else:
    import numpy as np
    from scipy.io import savemat

    # Our arrays have the indices x, y, z. Here the first index runs along the thickness (y), the second along the width (z),
    # the third along the length (x), as it is common in MR-u laboratories.
    def turned(numbers):
        return np.array(numbers, dtype=float).reshape(shape, order="F").transpose(1, 2, 0)

    fields = [turned(values[c * num_voxels : (c + 1) * num_voxels]) for c in range(3)]
    components = np.empty((1, 3), dtype=object)
    for place, axis in enumerate([1, 2, 0]):
        components[0, place] = fields[axis]
    steps = np.empty((1, 1), dtype=object)
    steps[0, 0] = components
    savemat(target, {
        "U_t": steps,
        "mask": turned(mask),
        "osc": np.array([[voxel_mm[1], voxel_mm[2], voxel_mm[0]]]),
        "prescribedU": np.array([[drive_mm]]),
    }, do_compression=True)
print(f"{target}: {sum(1 for m in mask if m)} voxels at {drive_mm} mm")
