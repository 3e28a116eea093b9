"""One function for each kind of job. A field that is left out (`None`) has the program's default.

Each function takes, beside the fields of its request (docs/requests.md):

* `folder`: where the files of the result go; a folder that is deleted when Python ends where it is left out.
* `threads`: threads of the program; one per core where it is left out.
* `on_progress`: called with each line of the program's progress, such as `on_progress=print`. An error that it raises
  stops the program.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple, Union, cast

import numpy as np
import numpy.typing as npt

from ._errors import InputError
from ._plain import given, plain, read_json
from ._program import Finished, OnProgress, PathLike, run_program
from ._recording import Recording
from ._results import (
    Calibration,
    CurveFit,
    Design,
    Diagnoses,
    Diagnosis,
    Evaluation,
    MaterialExport,
    NextScan,
    Result,
    Scan,
    Solution,
)
from ._specimen import Material, Numbers, ScanSettings, Specimen

Mesh = Union[str, float]
"""`search`, `standard`, `fine`, or a factor on the standard element size."""
Recorded = Union[Recording, PathLike]
Curve = Union[PathLike, Mapping[str, npt.ArrayLike]]
# By name, or by number from 1.
Column = Union[str, int]
"""A CSV file as test machines write it, or columns by name, such as `stretch` and `nominal_stress_kpa`."""
Fields = Mapping[str, Any]
Vector = Union[Sequence[float], npt.NDArray[Any]]


def run(
    kind: str,
    request: Fields,
    *,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Result:
    """Any kind of job from its request, as `lambdak run KIND` and the service take it.

    The request may hold specimens, materials, recordings and arrays of this package wherever it holds theirs.
    """
    done = _run(kind, plain(_with_folders(request)), folder, threads, on_progress)
    return Result(done.result, done.folder, ())


def _run(
    kind: str,
    request: Mapping[str, Any],
    folder: Optional[PathLike],
    threads: Optional[int],
    on_progress: Optional[OnProgress],
) -> Finished:
    return run_program(
        ["run", kind], request, name=kind, folder=folder, threads=threads, on_progress=on_progress
    )


def _with_folders(value: Any) -> Any:
    """`value` with recordings as the folders that hold them."""
    if isinstance(value, Recording):
        return str(value.folder())
    if isinstance(value, Mapping):
        return {key: _with_folders(part) for key, part in value.items()}
    return [_with_folders(part) for part in value] if isinstance(value, (list, tuple)) else value


def _drives(drive_mm: Optional[Numbers]) -> Any:
    return None if drive_mm is None else np.atleast_1d(np.asarray(drive_mm))


def _listed(names: Optional[Sequence[str]]) -> Any:
    """A list of names; one name may stand alone."""
    if names is None:
        return None
    return [names] if isinstance(names, str) else list(names)


def solve(
    specimen: Specimen,
    material: Optional[Material] = None,
    *,
    drive_mm: Optional[Numbers] = None,
    mesh: Optional[Mesh] = None,
    fields: Optional[str] = None,
    arrays: Optional[Sequence[str]] = None,
    is_whole: Optional[bool] = None,
    has_discretisation: Optional[bool] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Solution:
    """Forces and fields of a specimen at its drives, by finite elements.

    `arrays` names further files in `folder`: `"mat"`, `"hdf5"`, `"vtkhdf"`.
    """
    request = given(
        specimen=specimen,
        material=material,
        drive_mm=_drives(drive_mm),
        mesh=mesh,
        fields=fields,
        arrays=_listed(arrays),
        is_whole=is_whole,
        has_discretisation=has_discretisation,
    )
    done = _run("solve", request, folder, threads, on_progress)
    return Solution.of(done.result, done.folder)


def evaluate(
    specimen: Specimen,
    material: Optional[Material] = None,
    *,
    scan: Optional[ScanSettings] = None,
    drive_mm: Optional[Numbers] = None,
    median_stretch: Optional[float] = None,
    mesh: Optional[Mesh] = None,
    protocol: Optional[Fields] = None,
    has_detectable: Optional[bool] = None,
    has_files: Optional[bool] = None,
    arrays: Optional[Sequence[str]] = None,
    is_whole: Optional[bool] = None,
    has_discretisation: Optional[bool] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Evaluation:
    """What a scan of a specimen would see, and what it would tell about the material.

    `has_files=False` makes numbers alone, for loops over designs. `has_detectable=True` says how small errors of the
    experiment may be and still be named by a diagnosis (`detectable` of the result). `arrays` names further files in
    `folder`: `"mat"`, `"hdf5"`, `"vtkhdf"`. `has_discretisation=False` leaves out the coarser meshes that say what the
    mesh may put the numbers wrong by.
    """
    request = given(
        specimen=specimen,
        material=material,
        scan=scan,
        drive_mm=_drives(drive_mm),
        median_stretch=median_stretch,
        mesh=mesh,
        protocol=protocol,
        has_detectable=has_detectable,
        has_files=has_files,
        arrays=_listed(arrays),
        is_whole=is_whole,
        has_discretisation=has_discretisation,
    )
    done = _run("evaluate", request, folder, threads, on_progress)
    return Evaluation.of(done.result, done.folder)


def scan(
    specimen: Specimen,
    material: Optional[Material] = None,
    *,
    drive_mm: Optional[Numbers] = None,
    voxel_mm: Optional[Vector] = None,
    surface: Optional[Fields] = None,
    offset_voxels: Optional[Vector] = None,
    noise_sd_mm: Optional[Vector] = None,
    snr: Optional[Vector] = None,
    mm_per_radian: Optional[Vector] = None,
    force_sd_n: Optional[float] = None,
    filter: Optional[str] = None,
    kspace: Optional[Fields] = None,
    is_raw: Optional[bool] = None,
    seed: Optional[int] = None,
    sample: Optional[int] = None,
    mesh: Optional[Mesh] = None,
    is_whole: Optional[bool] = None,
    name: Optional[str] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Scan:
    """A synthetic recording of a specimen, as the scanner and the load cell would give it: `scan(…).recording`.

    With `surface`, such as `{"face": "+z", "components": "all"}`, as cameras would that see this face.
    """
    request = given(
        specimen=specimen,
        material=material,
        drive_mm=_drives(drive_mm),
        voxel_mm=voxel_mm,
        surface=surface,
        offset_voxels=offset_voxels,
        noise_sd_mm=noise_sd_mm,
        snr=snr,
        mm_per_radian=mm_per_radian,
        force_sd_n=force_sd_n,
        filter=filter,
        kspace=kspace,
        is_raw=is_raw,
        seed=seed,
        sample=sample,
        mesh=mesh,
        is_whole=is_whole,
        name=name,
    )
    done = _run("scan", request, folder, threads, on_progress)
    return Scan.of(done.result, done.folder)


def import_recording(
    files: Union[PathLike, Sequence[PathLike]],
    specimen: Optional[Specimen] = None,
    *,
    form: Optional[str] = None,
    series: Optional[Union[PathLike, Mapping[str, Any]]] = None,
    phase_range: Optional[Sequence[float]] = None,
    drive_mm: Optional[Numbers] = None,
    load_csv: Optional[PathLike] = None,
    unit: Optional[str] = None,
    axes: Optional[str] = None,
    components: Optional[str] = None,
    vectors: Optional[str] = None,
    origin: Optional[str] = None,
    voxel_mm: Optional[Vector] = None,
    surface: Optional[Fields] = None,
    region: Optional[int] = None,
    noise_sd_mm: Optional[Vector] = None,
    filter: Optional[str] = None,
    method: Optional[str] = None,
    needs_agreement: Optional[bool] = None,
    anchor: Optional[str] = None,
    name: Optional[str] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Recording:
    """A recording from MATLAB files, point clouds or NIfTI images; where `files` is one folder, from raw phases.

    With `form="dicom"` or `form="paravision"`, `files` are files and folders of a scanner, and `series` (a mapping or a
    JSON file) says which of them is what. With `form="points"` and `surface`, such as `{"face": "+z"}`, the points are
    those of a face that cameras saw.
    """
    listed = [files] if isinstance(files, (str, os.PathLike)) else list(files)
    paths = [str(Path(file).resolve()) for file in listed]
    is_recording = form is None and len(paths) == 1 and Path(paths[0]).is_dir()
    request = given(
        recording=paths[0] if is_recording else None,
        files=None if is_recording else paths,
        form=form,
        series=None if series is None else read_json(series),
        phase_range=phase_range,
        specimen=specimen,
        drive_mm=_drives(drive_mm),
        load_csv=None if load_csv is None else _text(load_csv),
        unit=unit,
        axes=axes,
        components=components,
        vectors=vectors,
        origin=origin,
        voxel_mm=voxel_mm,
        surface=surface,
        region=region,
        noise_sd_mm=noise_sd_mm,
        filter=filter,
        method=method,
        needs_agreement=needs_agreement,
        anchor=anchor,
        name=name,
    )
    return Recording.read(_run("import", request, folder, threads, on_progress).folder)


def _sources(recordings: Union[Recorded, Sequence[Recorded]]) -> Tuple[Union[Recording, Path], ...]:
    several = [recordings] if isinstance(recordings, (Recording, str, os.PathLike)) else list(recordings)
    return tuple(one if isinstance(one, Recording) else Path(one).resolve() for one in several)


def _named(source: Union[Recording, Path]) -> str:
    """How the program finds a recording."""
    return str(source.folder() if isinstance(source, Recording) else source)


def calibrate(
    recordings: Union[Recorded, Sequence[Recorded]],
    *,
    num_terms: Optional[int] = None,
    law: Optional[str] = None,
    rule: Optional[str] = None,
    decrement: Optional[float] = None,
    objective: Optional[str] = None,
    beta: Optional[float] = None,
    boundary: Optional[str] = None,
    mesh_factor: Optional[float] = None,
    has_mesh_allowance: Optional[bool] = None,
    num_starts: Optional[int] = None,
    end_margin_mm: Optional[float] = None,
    protocol: Optional[Fields] = None,
    has_profiles: Optional[bool] = None,
    has_contours: Optional[bool] = None,
    arrays: Optional[Sequence[str]] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Calibration:
    """The material, from one recording or several of them together, with its uncertainty.

    `arrays` names further files in `folder`: `"mat"`, `"hdf5"`.
    """
    sources = _sources(recordings)
    request = given(
        recordings=[_named(one) for one in sources],
        num_terms=num_terms,
        law=law,
        rule=rule,
        decrement=decrement,
        objective=objective,
        beta=beta,
        boundary=boundary,
        mesh_factor=mesh_factor,
        has_mesh_allowance=has_mesh_allowance,
        num_starts=num_starts,
        end_margin_mm=end_margin_mm,
        protocol=protocol,
        has_profiles=has_profiles,
        has_contours=has_contours,
        arrays=_listed(arrays),
    )
    done = _run("calibrate", request, folder, threads, on_progress)
    return Calibration.of(done.result, done.folder, sources)


def next_scan(
    recordings: Union[Recorded, Sequence[Recorded]],
    study: Union[Fields, PathLike],
    *,
    specimens: Optional[Sequence[Specimen]] = None,
    drive_mm: Optional[Numbers] = None,
    num_drives: Optional[int] = None,
    num_terms: Optional[int] = None,
    precision: Optional[float] = None,
    precision_by_parameter: Optional[Mapping[str, float]] = None,
    scan_minutes: Optional[float] = None,
    change_minutes: Optional[float] = None,
    mesh_factor: Optional[float] = None,
    has_mesh_correction: Optional[bool] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> NextScan:
    """What to scan next, given one recording or several, and what it is worth; whether it is enough.

    `study` is a `study/1` as `design` takes it: its base specimen and `specimens` are the candidates.
    """
    sources = _sources(recordings)
    request = given(
        recordings=[_named(one) for one in sources],
        study=_spelled_out(_study(study)),
        specimens=None if specimens is None else [one.to_dict() for one in specimens],
        drive_mm=drive_mm,
        num_drives=num_drives,
        num_terms=num_terms,
        precision=precision,
        precision_by_parameter=precision_by_parameter,
        scan_minutes=scan_minutes,
        change_minutes=change_minutes,
        mesh_factor=mesh_factor,
        has_mesh_correction=has_mesh_correction,
    )
    done = _run("next", request, folder, threads, on_progress)
    return NextScan.of(done.result, done.folder, sources)


def diagnose(
    recording: Recorded,
    material: Optional[Material] = None,
    *,
    mesh_factor: Optional[float] = None,
    allowance_mm: Optional[float] = None,
    max_causes: Optional[int] = None,
    without: Optional[Sequence[str]] = None,
    boundary: Optional[str] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Diagnosis:
    """Where a recording and its model differ, what was left out, and the material with it modelled.

    `material` is what it is believed to be, where that is known.
    """
    sources = _sources(recording)
    request = _diagnosis(material, mesh_factor, allowance_mm, max_causes, without, boundary)
    request["recording"] = _named(sources[0])
    done = _run("diagnose", request, folder, threads, on_progress)
    return Diagnosis.of(done.result, done.folder, sources)


def diagnose_together(
    recordings: Sequence[Recorded],
    material: Optional[Material] = None,
    *,
    mesh_factor: Optional[float] = None,
    allowance_mm: Optional[float] = None,
    max_causes: Optional[int] = None,
    without: Optional[Sequence[str]] = None,
    boundary: Optional[str] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Diagnoses:
    """Several recordings of one material: each is diagnosed, and predicted by each other one."""
    sources = _sources(recordings)
    request = _diagnosis(material, mesh_factor, allowance_mm, max_causes, without, boundary)
    request["recordings"] = [_named(one) for one in sources]
    done = _run("diagnose", request, folder, threads, on_progress)
    return Diagnoses.of(done.result, done.folder, sources)


def _diagnosis(
    material: Optional[Material],
    mesh_factor: Optional[float],
    allowance_mm: Optional[float],
    max_causes: Optional[int],
    without: Optional[Sequence[str]],
    boundary: Optional[str],
) -> Dict[str, Any]:
    return given(
        material=material,
        mesh_factor=mesh_factor,
        allowance_mm=allowance_mm,
        max_causes=max_causes,
        without=None if without is None else list(without),
        boundary=boundary,
    )


def design(
    study: Union[Fields, PathLike],
    *,
    time_limit_min: Optional[float] = None,
    restart: bool = False,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> Design:
    """The best specimen within a study's limits, with the evidence.

    `study` is a `study/1`: a file, which may name the files of its specimen and materials beside it, or an object,
    which may hold specimens, materials and scan settings of this package. With a `folder`, a search that was stopped
    goes on where the same call is made again, and begins anew with `restart`.

    Raises:
        TimeLimitError: where `time_limit_min` ends the search; what was found is in its folder.
    """
    command: List[str] = ["design"]
    command += [] if time_limit_min is None else [f"--time-limit={time_limit_min}"]
    command += ["--restart"] if restart else []
    done = run_program(
        command,
        _study(study),
        name="design",
        folder=folder,
        threads=threads,
        on_progress=on_progress,
        has_time_limit=time_limit_min is not None,
    )
    return Design.of(done.result, done.folder)


def _study(study: Union[Fields, PathLike]) -> Dict[str, Any]:
    """The study as an object; names of files are made absolute, since it is handed on from another folder."""
    found = read_json(study)
    if not isinstance(study, Mapping):
        beside = Path(study).resolve().parent
        if isinstance(found.get("base"), str):
            found["base"] = str(beside / found["base"])
        for entry in found.get("materials") or []:
            if isinstance(entry, dict) and isinstance(entry.get("material"), str):
                entry["material"] = str(beside / entry["material"])
    return found


def _spelled_out(study: Dict[str, Any]) -> Dict[str, Any]:
    """The study with the files that it names read: a request holds no names of files."""
    if isinstance(study.get("base"), str):
        study["base"] = read_json(study["base"])
    for entry in study.get("materials") or []:
        if isinstance(entry, dict) and isinstance(entry.get("material"), str):
            entry["material"] = read_json(entry["material"])
    return study


def uniaxial(
    curve: Curve,
    *,
    specimen: Optional[Specimen] = None,
    mesh: Optional[Mesh] = None,
    law: Optional[str] = None,
    max_terms: Optional[int] = None,
    bulk_kpa: Optional[float] = None,
    min_alpha_gap: Optional[float] = None,
    has_all_branches: Optional[bool] = None,
    drive_column: Optional[Column] = None,
    stress_column: Optional[Column] = None,
    stress_unit: Optional[str] = None,
    length_mm: Optional[float] = None,
    area_mm2: Optional[float] = None,
    turned: Optional[str] = None,
    name: Optional[str] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> CurveFit:
    """Fits of Ogden terms, or of a `law`, to one uniaxial curve: of a strip, or of a dumb-bell by grips and force."""
    request = given(
        csv=_csv(curve),
        specimen=specimen,
        mesh=mesh,
        name=name,
        fit=_fit(law, max_terms, bulk_kpa, min_alpha_gap, has_all_branches),
        columns=_columns(drive_column, stress_column, stress_unit, length_mm, area_mm2, turned),
    )
    done = _run("uniaxial", request, folder, threads, on_progress)
    return CurveFit.of(done.result, done.folder)


def curves(
    tests: Mapping[str, Union[Curve, Sequence[Curve]]],
    *,
    kept_back: Sequence[str] = (),
    has_neo_hookean_term: Optional[bool] = None,
    is_exact: Optional[bool] = None,
    law: Optional[str] = None,
    max_terms: Optional[int] = None,
    bulk_kpa: Optional[float] = None,
    min_alpha_gap: Optional[float] = None,
    has_all_branches: Optional[bool] = None,
    drive_column: Optional[Column] = None,
    stress_column: Optional[Column] = None,
    second_drive_column: Optional[Column] = None,
    second_stress_column: Optional[Column] = None,
    stress_unit: Optional[str] = None,
    length_mm: Optional[float] = None,
    area_mm2: Optional[float] = None,
    second_length_mm: Optional[float] = None,
    second_area_mm2: Optional[float] = None,
    turned: Optional[str] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> CurveFit:
    """Fits of Ogden terms, or of a `law`, to curves of several tests: `{"uniaxial": …, "pure_shear": …}`.

    Tests are `uniaxial`, `equibiaxial`, `pure_shear`, `simple_shear` and `biaxial`, with one curve or a list of several;
    those named in `kept_back` are predicted. A biaxial test has columns of two stretches and of both stresses or of one.
    """
    missing = [test for test in kept_back if test not in tests]
    if missing:
        raise InputError((f"kept_back names {', '.join(missing)}; it names tests that are given: {', '.join(tests)}",))
    request = given(
        curves=[
            {"test": test, "csv": _csv(curve), "is_kept_back": test in kept_back}
            for test, one_or_several in tests.items()
            for curve in _several(one_or_several)
        ],
        has_neo_hookean_term=has_neo_hookean_term,
        is_exact=is_exact,
        fit=_fit(law, max_terms, bulk_kpa, min_alpha_gap, has_all_branches),
        columns=_columns(drive_column, stress_column, stress_unit, length_mm, area_mm2, turned),
        second_axis=given(
            drive_column=_column(second_drive_column),
            stress_column=_column(second_stress_column),
            length_mm=second_length_mm,
            area_mm2=second_area_mm2,
        ),
    )
    done = _run("curves", request, folder, threads, on_progress)
    return CurveFit.of(done.result, done.folder)


def _fit(
    law: Optional[str],
    max_terms: Optional[int],
    bulk_kpa: Optional[float],
    min_alpha_gap: Optional[float],
    has_all_branches: Optional[bool],
) -> Dict[str, Any]:
    return given(
        law=law,
        max_terms=max_terms,
        bulk_kpa=bulk_kpa,
        min_alpha_gap=min_alpha_gap,
        has_all_branches=has_all_branches,
    )


def _columns(
    drive_column: Optional[Column],
    stress_column: Optional[Column],
    stress_unit: Optional[str],
    length_mm: Optional[float],
    area_mm2: Optional[float],
    turned: Optional[str],
) -> Dict[str, Any]:
    return given(
        drive_column=_column(drive_column),
        stress_column=_column(stress_column),
        stress_unit=stress_unit,
        length_mm=length_mm,
        area_mm2=area_mm2,
        turned=turned,
    )


def _column(column: Optional[Column]) -> Optional[str]:
    return None if column is None else str(column)


def _several(curves: Union[Curve, Sequence[Curve]]) -> List[Curve]:
    """The curves of a test, one or several. A text or a table is one, though it is a sequence, too."""
    return list(curves) if isinstance(curves, (list, tuple)) else [cast(Curve, curves)]


def _csv(curve: Curve) -> str:
    """The text of a curve. Data frames have columns by name, too, though they are no mappings."""
    if isinstance(curve, (str, os.PathLike)):
        return _text(curve)
    columns = {str(name): np.asarray(values, dtype=float) for name, values in curve.items()}
    lengths = {name: values.shape for name, values in columns.items()}
    if len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise InputError((f"the curve's columns have the shapes {lengths}; they need to be lists of one length",))
    rows = zip(*(values.tolist() for values in columns.values()))
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n"


def _text(file: PathLike) -> str:
    try:
        content = Path(file).read_bytes()
    except OSError as error:
        raise InputError((f"cannot read {os.fspath(file)}: {error.strerror}",)) from None
    try:
        return content.decode("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        # Test machines in Europe write their units (°, µ) in this code.
        return content.decode("latin-1")


def export_material(
    material: Material,
    *,
    formats: Optional[Sequence[str]] = None,
    stress_unit: Optional[str] = None,
    name: Optional[str] = None,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
) -> MaterialExport:
    """A material as Abaqus, Ansys, CalculiX, COMSOL and FEBio read it, each in its own convention."""
    request = given(material=material, formats=_listed(formats), stress_unit=stress_unit, name=name)
    done = _run("export-material", request, folder, threads, on_progress)
    return MaterialExport.of(done.result, done.folder)
