"""Recordings: displacements per voxel, as arrays here and as a folder (`mru-recording/1`) for the program."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from ._errors import InputError
from ._nifti import read_image, write_image
from ._optional import optional
from ._plain import given, plain, read_json
from ._program import PathLike, encoded, temporary_folder
from ._specimen import Numbers, Specimen

Array = npt.NDArray[Any]
MaybeNumbers = Union[float, Sequence[Optional[float]], Sequence[float], Array]

AXES = ("x", "y", "z")


def centered_origin(mask: npt.ArrayLike, voxel_mm: Sequence[float]) -> Tuple[float, float, float]:
    """Where the centre of voxel [0, 0, 0] lies, in mm, if the box around the mask is centred on the specimen."""
    filled = np.argwhere(np.asarray(mask))
    if len(filled) == 0:
        raise InputError(("the mask is empty: it has no box to centre",))
    middle = 0.5 * (filled.min(axis=0) + filled.max(axis=0)) * np.asarray(voxel_mm, dtype=float)
    return (-float(middle[0]), -float(middle[1]), -float(middle[2]))


def _measured(surface: Mapping[str, str]) -> List[int]:
    """The components that are measured of a face."""
    is_all = surface.get("components") == "all"
    return [axis for axis, name in enumerate(AXES) if is_all or not surface["face"].endswith(name)]


class Recording:
    """Displacements per voxel, one array for each drive, with the forces at them.

    Axes and components are those of the specimen's frame: index 0 and component 0 along x (the length, the pull
    direction), 1 along y (the thickness), 2 along z (the width), each increasing with its index.

    Args:
        specimen: The specimen as drawn.
        displacement_mm: Shape (drives, nx, ny, nz, 3), or (nx, ny, nz, 3) for one drive: the displacement of the
            material that was at the voxel's centre before loading, mm. NaN where nothing was measured.
        mask: Shape (nx, ny, nz): whether at least half of the voxel is material, or how large a part of it. Where it is
            left out, the voxels that hold a displacement at any drive.
        drive_mm: What the actuator was told, mm, one for each array.
        affine: 4 × 4, from a voxel's indices to its centre in mm; or else
        voxel_mm: the edges of a voxel along x, y, z, mm, and
        origin_mm: the centre of voxel [0, 0, 0] in the specimen's frame, mm (see :func:`centered_origin`).
        force_n: The load cell's mean at each drive, all samples together, N; `None` where it was not read.
        force_sd_n: Its standard deviation, N, one for all or one for each drive.
        window_s: Beginning and end of each acquisition in the time of `load`, s.
        noise_sd_mm: Standard deviation of a voxel's displacement along x, y, z, mm; estimated where it is left out.
        surface: The face that cameras saw, such as `{"face": "+z", "components": "in_plane"}`: the grid is then one layer
            on it, and a component that is not measured holds NaN, in noise_sd_mm `None`.
        filter: `none`, or `hamming2` where displacements went through a 2 × 2 × 2 Hamming kernel.
        load: Shape (readings, 3): time in s, drive in mm, force in N over the whole loading.
        id: Name of the recording in results.
    """

    def __init__(
        self,
        specimen: Specimen,
        displacement_mm: npt.ArrayLike,
        mask: Optional[npt.ArrayLike] = None,
        *,
        drive_mm: Numbers,
        affine: Optional[npt.ArrayLike] = None,
        voxel_mm: Optional[Sequence[float]] = None,
        origin_mm: Optional[Sequence[float]] = None,
        force_n: Optional[MaybeNumbers] = None,
        force_sd_n: Optional[MaybeNumbers] = None,
        window_s: Optional[Sequence[Optional[Sequence[float]]]] = None,
        noise_sd_mm: Optional[Sequence[Optional[float]]] = None,
        filter: str = "none",
        surface: Optional[Mapping[str, str]] = None,
        load: Optional[npt.ArrayLike] = None,
        id: str = "recording",
        notes: Optional[Mapping[str, Any]] = None,
    ) -> None:
        # Of masked arrays, numpy's own function would take what lies under the mask. (They are not typed everywhere.)
        masked: Any = np.ma
        u: Array = masked.array(displacement_mm, dtype=np.float32, copy=True).filled(np.nan)
        u = u[np.newaxis] if u.ndim == 4 else u
        if u.ndim != 5 or u.shape[4] != 3 or u.size == 0:
            raise InputError((f"displacement_mm has the shape {u.shape}; (drives, nx, ny, nz, 3) is needed",))
        drives = np.atleast_1d(np.asarray(drive_mm, dtype=float))
        if drives.shape != (len(u),):
            raise InputError((f"drive_mm holds {drives.size} drives and displacement_mm {len(u)}; give one for each",))
        known = np.isfinite(u).all(axis=4) if surface is None else np.isfinite(u[..., _measured(surface)]).all(axis=4)
        inside = np.asarray(known.any(axis=0) if mask is None else np.asarray(mask) >= 0.5)
        if inside.shape != u.shape[1:4]:
            raise InputError((f"mask has the shape {inside.shape}; that of a displacement is {u.shape[1:4]}",))
        u[:, ~inside] = np.nan
        self.specimen = specimen
        self.displacement_mm: npt.NDArray[np.float32] = _frozen(u)
        self.mask: npt.NDArray[np.bool_] = _frozen(inside)
        self.affine: npt.NDArray[np.float64] = _frozen(_affine(affine, voxel_mm, origin_mm))
        self.drive_mm: Tuple[float, ...] = tuple(drives.tolist())
        self.force_n = _each(force_n, len(u), "force_n")
        # The load cell is the same at every drive.
        sds: Any = [force_sd_n] * len(u) if np.ndim(np.asarray(force_sd_n, dtype=object)) == 0 else force_sd_n
        self.force_sd_n = _each(sds, len(u), "force_sd_n")
        self.window_s: Tuple[Optional[Tuple[float, float]], ...] = tuple(
            None if window is None else (float(window[0]), float(window[1])) for window in (window_s or [None] * len(u))
        )
        if len(self.window_s) != len(u):
            raise InputError((f"window_s holds {len(self.window_s)} windows; give one for each of {len(u)} drives",))
        self.noise_sd_mm: Optional[Tuple[Optional[float], ...]] = (
            None if noise_sd_mm is None else tuple(plain(list(noise_sd_mm)))
        )
        self.filter = filter
        self.surface: Optional[Dict[str, str]] = None if surface is None else dict(surface)
        self.load: Optional[npt.NDArray[np.float64]] = None if load is None else _frozen(np.array(load, dtype=float))
        if self.load is not None and (self.load.ndim != 2 or self.load.shape[1] != 3):
            raise InputError((f"load has the shape {self.load.shape}; (readings, 3) is needed: s, mm, N",))
        self.id = id
        self.notes = notes
        self._folder: Optional[Path] = None

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.__dict__ and name != "_folder":
            raise AttributeError(f"a recording stays as it is; make a new one with another {name}")
        super().__setattr__(name, value)

    @property
    def voxel_mm(self) -> Tuple[float, float, float]:
        """Edges of a voxel along x, y, z, mm."""
        x, y, z = np.sqrt((self.affine[:3, :3] ** 2).sum(axis=0)).tolist()
        return (x, y, z)

    @property
    def positions_mm(self) -> Tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The voxels' centres along x, y and z, mm."""
        x, y, z = (self.affine[a, a] * np.arange(n) + self.affine[a, 3] for a, n in enumerate(self.mask.shape))
        return (x, y, z)

    def write(self, folder: PathLike) -> Path:
        """Writes the recording's folder, which is made where it is not there; gives its path."""
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        steps: List[Dict[str, Any]] = []
        for n, drive_mm in enumerate(self.drive_mm):
            name = f"u_{n + 1}.nii.gz"
            write_image(path / name, self.displacement_mm[n], self.affine)
            told = given(force_n=self.force_n[n], force_sd_n=self.force_sd_n[n], window_s=self.window_s[n])
            steps.append({"drive_mm": drive_mm, **told, "displacement": name})
        write_image(path / "mask.nii.gz", self.mask, self.affine)
        acquisition = given(
            voxel_mm=self.voxel_mm, noise_sd_mm=self.noise_sd_mm, filter=self.filter, surface=self.surface
        )
        head: Dict[str, Any] = {
            "schema": "mru-recording/1",
            "id": self.id,
            "specimen": self.specimen.to_dict(),
            "steps": steps,
            "mask": "mask.nii.gz",
            "acquisition": acquisition,
            **given(notes=self.notes),
        }
        if self.load is not None:
            rows = "".join(f"{t!r},{d!r},{f!r}\n" for t, d, f in self.load.tolist())
            (path / "load.csv").write_text(f"time_s,drive_mm,force_n\n{rows}", encoding="utf-8")
            head["load"] = "load.csv"
        # Last, so that a folder that holds it holds all the rest.
        (path / "recording.json").write_text(encoded(head), encoding="utf-8")
        return path

    @classmethod
    def read(cls, folder: PathLike) -> "Recording":
        """Reads a recording's folder, or a recording of which the JSON file has another name than `recording.json`."""
        path = Path(folder).resolve()
        file = path if path.is_file() else path / "recording.json"
        head = read_json(file)
        try:
            recording = cls._of_folder(file.parent, head)
        except (KeyError, TypeError) as error:
            raise InputError((f"{file} is no mru-recording/1: {error!r}",)) from None
        recording._folder = path
        return recording

    @classmethod
    def _of_folder(cls, path: Path, head: Dict[str, Any]) -> "Recording":
        steps = head["steps"]
        if any("displacement" not in step for step in steps):
            hint = "make displacements of them with lambdak.import_recording(folder)"
            raise InputError((f"{path} holds raw phases, no displacements; {hint}",))
        images = [read_image(path / step["displacement"]) for step in steps]
        mask = read_image(path / head["mask"])
        load = None
        if head.get("load") is not None:
            load = np.loadtxt(path / head["load"], delimiter=",", skiprows=1, ndmin=2)
        acquisition = head["acquisition"]
        return cls(
            Specimen._of_program(head["specimen"]),
            np.stack([image.values for image in images]),
            mask.values > 0.5,
            drive_mm=[step["drive_mm"] for step in steps],
            affine=mask.affine,
            force_n=[step.get("force_n") for step in steps],
            force_sd_n=[step.get("force_sd_n") for step in steps],
            window_s=[step.get("window_s") for step in steps],
            noise_sd_mm=acquisition.get("noise_sd_mm"),
            filter=acquisition.get("filter", "none"),
            surface=acquisition.get("surface"),
            load=load,
            id=head["id"],
            notes=head.get("notes"),
        )

    def folder(self) -> Path:
        """Where the recording is on disk: what it was read from, else a folder that lasts until Python ends."""
        if self._folder is None or not self._folder.exists():
            self._folder = self.write(temporary_folder("recording"))
        return self._folder

    def to_pandas(self) -> Any:
        """A row for each drive and voxel of the mask: drive, position and displacement, all in mm."""
        tables = []
        inside = np.nonzero(self.mask)
        place = {f"{axis}_mm": self.positions_mm[a][inside[a]] for a, axis in enumerate(AXES)}
        for drive_mm, u in zip(self.drive_mm, self.displacement_mm):
            moved = {f"u{axis}_mm": u[..., a][inside] for a, axis in enumerate(AXES)}
            tables.append(optional("pandas").DataFrame({"drive_mm": drive_mm, **place, **moved}))
        return optional("pandas").concat(tables, ignore_index=True)

    def to_xarray(self) -> Any:
        """A dataset with `displacement` over drive, x, y, z and component, in mm, and `mask`."""
        return grid_dataset(self, {"displacement": self.displacement_mm})

    def _repr_html_(self) -> str:
        nx, ny, nz = self.mask.shape
        rows = "".join(
            f"<tr><td>{drive:g}</td><td>{'' if force is None else format(force, '.4g')}</td></tr>"
            for drive, force in zip(self.drive_mm, self.force_n)
        )
        voxel = " × ".join(f"{edge:g}" for edge in self.voxel_mm)
        return (
            f"<p>Recording of {int(self.mask.sum())} voxels of {voxel} mm in a grid of {nx} × {ny} × {nz}</p>"
            f"<table><tr><th>drive (mm)</th><th>force (N)</th></tr>{rows}</table>"
        )

    def __repr__(self) -> str:
        drives = ", ".join(f"{drive:g}" for drive in self.drive_mm)
        return f"Recording(id={self.id!r}, grid={self.mask.shape}, voxels={int(self.mask.sum())}, drive_mm=[{drives}])"


def grid_dataset(recording: Recording, vectors: Mapping[str, Array]) -> Any:
    """A dataset of vectors on a recording's grid and drives."""
    dims = ("drive_mm", *AXES, "component")
    x, y, z = recording.positions_mm
    dataset = optional("xarray").Dataset(
        {
            **{name: (dims, values, {"units": "mm"}) for name, values in vectors.items()},
            "mask": (AXES, recording.mask),
        },
        coords={"drive_mm": list(recording.drive_mm), "x": x, "y": y, "z": z, "component": list(AXES)},
        attrs={"id": recording.id, "frame": "origin at the block's centre; x length, y thickness, z width"},
    )
    for axis in AXES:
        dataset[axis].attrs["units"] = "mm"
    return dataset


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array


def _affine(
    affine: Optional[npt.ArrayLike], voxel_mm: Optional[Sequence[float]], origin_mm: Optional[Sequence[float]]
) -> npt.NDArray[np.float64]:
    if affine is not None and voxel_mm is None and origin_mm is None:
        found = np.array(affine, dtype=float)
        if found.shape != (4, 4):
            raise InputError((f"affine has the shape {found.shape}; (4, 4) is needed",))
        return found
    if affine is not None or voxel_mm is None or origin_mm is None:
        hint = "give affine, or voxel_mm and origin_mm (centered_origin(mask, voxel_mm) helps)"
        raise InputError((f"where the voxels lie has to be said in one way: {hint}",))
    if len(voxel_mm) != 3 or len(origin_mm) != 3:
        found_sizes = f"voxel_mm holds {len(voxel_mm)} and origin_mm {len(origin_mm)} numbers"
        raise InputError((f"{found_sizes}; three are needed, for x, y, z",))
    found = np.diag([*(float(edge) for edge in voxel_mm), 1.0])
    found[:3, 3] = origin_mm
    return found


def _each(values: Optional[MaybeNumbers], count: int, name: str) -> Tuple[Optional[float], ...]:
    """One number for each drive."""
    listed = [None] * count if values is None else plain(np.atleast_1d(np.asarray(values, dtype=object)))
    found = [None if value is None else float(value) for value in listed]
    if len(found) != count:
        raise InputError((f"{name} holds {len(found)} numbers; give one for each of {count} drives",))
    return tuple(found)
