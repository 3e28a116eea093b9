"""Makes the files of this folder with SciPy, h5py and nibabel, so that the readers are tested on files that others wrote.

The field, over indices i (thickness, 6), j (width, 4), k (length, 5) of an array as an MR-u laboratory keeps it:
component 1 = 0.01 i + 0.1 s, component 2 = -0.02 j, component 3 = 0.05 i + 0.003 k + s, for steps s = 1, 2.
The mask leaves out voxel (1, 1, 1); a speck and a second block lie behind an empty plane in `two_blocks.mat`.
"""
import h5py
import nibabel as nib
import numpy as np
from scipy.io import savemat

n1, n2, n3 = 6, 4, 5
i, j, k = np.meshgrid(np.arange(n1), np.arange(n2), np.arange(n3), indexing="ij")
steps = [[0.01 * i + 0.1 * s, -0.02 * j, 0.05 * i + 0.003 * k + s] for s in (1.0, 2.0)]
mask = np.ones((n1, n2, n3))
mask[1, 1, 1] = np.nan
osc = np.array([[1.0666, 4.775, 5.08]])
edges = osc[0]


def cell(items):
    out = np.empty((1, len(items)), dtype=object)
    for n, item in enumerate(items):
        out[0, n] = item
    return out


U_t = cell([cell(s) for s in steps])
# As meshgrid gives them: the first array changes along the second index.
X = cell([edges[1] * j, edges[0] * i, edges[2] * k])
info = {"name": "sample", "lambda": np.array([1.0, 1.0, 1.0]), "empty": np.zeros((0, 0))}
data = {"U_t": U_t, "mask": mask, "osc": osc, "prescribedU": np.array([[2.5, 5.0]]), "info": info,
        "flags": np.array([[True, False]]), "small": np.array([[1, -2]], dtype=np.int16), "text": "Grüße",
        "complex": np.array([[1 + 2j, 3 - 4j]])}
savemat("v5.mat", data, do_compression=False)
savemat("v7.mat", data, do_compression=True)
savemat("positions.mat", {"U_t": U_t, "X": X}, do_compression=True)

two = np.zeros((14, n2, n3))
two[0:6] = 1
two[8:14] = 1
u = [np.zeros((14, n2, n3)) + c for c in (0.5, 0.0, 0.0)]
u[0][8:] = 0.25
savemat("two_blocks.mat", {"U_t": cell([cell(u)]), "mask": two, "osc": osc}, do_compression=True)

# Version 7.3 as MATLAB lays it out: a user block with the text header, arrays with sizes in reverse, cells as references.
with h5py.File("v73.mat", "w", userblock_size=512, libver="earliest") as f:
    refs = f.create_group("#refs#")
    counter = [0]

    def put(group, name, value):
        d = group.create_dataset(name, data=np.asarray(value, dtype=float).T, compression="gzip", chunks=True)
        d.attrs["MATLAB_class"] = np.bytes_("double")
        return d

    def put_cell(group, name, items):
        d = group.create_dataset(name, (len(items), 1), dtype=h5py.ref_dtype)
        d.attrs["MATLAB_class"] = np.bytes_("cell")
        for n, item in enumerate(items):
            counter[0] += 1
            inner = f"r{counter[0]}"
            made = put_cell(refs, inner, item) if isinstance(item, list) else put(refs, inner, item)
            d[n, 0] = made.ref
        return d

    put_cell(f, "U_t", steps)
    put(f, "mask", mask)
    put(f, "osc", osc)
    put(f, "prescribedU", [[2.5, 5.0]])
    text = f.create_dataset("text", data=np.array([[ord(c)] for c in "Grüße"], dtype=np.uint16))
    text.attrs["MATLAB_class"] = np.bytes_("char")
    pair = np.array([[(1.0, 2.0)], [(3.0, -4.0)]], dtype=[("real", "f8"), ("imag", "f8")])
    f.create_dataset("complex", data=pair).attrs["MATLAB_class"] = np.bytes_("double")
    group = f.create_group("info")
    group.attrs["MATLAB_class"] = np.bytes_("struct")
    put(group, "lambda", [[1.0, 1.0, 1.0]])
    empty = group.create_dataset("empty", data=np.array([0, 0], dtype=np.uint64))
    empty.attrs["MATLAB_class"] = np.bytes_("double")
    empty.attrs["MATLAB_empty"] = np.uint8(1)
with open("v73.mat", "r+b") as f:
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64"
    f.write(head.ljust(124) + b"\x00\x02IM")

# NIfTI: scaled integers, other byte order, a qform alone, plain and compressed.
affine = np.diag([1.0, 0.1875, 0.75, 1.0])
affine[:3, 3] = [-2.5, -0.375, 1.5]
values = np.arange(24, dtype=float).reshape(3, 4, 2)


def image(name, dtype, endian, sform, qform):
    made = nib.Nifti1Image(values.astype(dtype), None, nib.Nifti1Header(endianness=endian))
    made.header.set_data_dtype(dtype)
    made.header.set_xyzt_units("mm")
    made.set_sform(affine if sform else None, code=1 if sform else 0)
    made.set_qform(affine if qform else None, code=1 if qform else 0)
    nib.save(made, name)


image("float64_big.nii", ">f8", ">", True, False)
image("uint8.nii.gz", "u1", "<", True, True)
image("float32_qform.nii.gz", "<f4", "<", False, True)
header = nib.Nifti1Header()
header.set_data_dtype(np.int16)
scaled = nib.Nifti1Image(0.5 * values - 1.0, affine, header)
scaled.header.set_xyzt_units("mm")
nib.save(scaled, "int16_scaled.nii.gz")
vector = np.stack([values, -values, 0.5 * values], axis=-1)[:, :, :, None, :].astype("<f4")
vector[0, 0, 0] = np.nan
made = nib.Nifti1Image(vector, affine)
made.header.set_intent(1006)
made.header.set_xyzt_units("mm")
nib.save(made, "displacement.nii.gz")
