"""Results: the fields that are most asked for, typed; all of the program's JSON as `raw`; its files in `folder`."""

from __future__ import annotations

import base64
import html
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict, Iterable, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from ._errors import InputError
from ._nifti import read_image
from ._optional import optional
from ._recording import Recording, grid_dataset
from ._specimen import Material, Specimen

Row = Dict[str, Any]
Sources = Tuple[Union[Recording, Path], ...]


def _number(value: Optional[float]) -> float:
    """JSON has no NaN: what the program does not know is null there."""
    return math.nan if value is None else float(value)


def _pair(values: Optional[Sequence[Optional[float]]]) -> Tuple[float, float]:
    low, high = (None, None) if values is None else values
    return (_number(low), _number(high))


@dataclass(frozen=True, eq=False)
class Result:
    """What every result has."""

    raw: Mapping[str, Any] = field(repr=False)
    """The program's whole result (its `--json`)."""
    folder: Path
    """The files of the result. Where the call named no folder, it is deleted when Python ends."""
    sources: Sources = field(repr=False)
    """The recordings that it is about, or their folders."""

    @property
    def recordings(self) -> Tuple[Recording, ...]:
        """The recordings that it is about."""
        return tuple(Recording.read(one) if isinstance(one, Path) else one for one in self.sources)

    @property
    def pictures(self) -> List[Path]:
        """The pictures (SVG)."""
        return sorted(self.folder.glob("*.svg"))

    @property
    def report(self) -> Optional[Path]:
        """The report (HTML), where there is one."""
        return next(iter(sorted(self.folder.glob("*.html"))), None)

    def _rows(self) -> List[Row]:
        """The table of the result; nothing where it has none, or where it is a file (sweeps)."""
        return []

    def to_pandas(self) -> Any:
        """The table of the result, as a data frame."""
        rows, table = self._rows(), self.folder / "table.csv"
        if rows:
            return optional("pandas").DataFrame(rows)
        if table.is_file():
            return optional("pandas").read_csv(table)
        raise InputError((f"this {type(self).__name__} has no table; its numbers are in raw",))

    def _heading(self) -> str:
        return ""

    def _repr_html_(self) -> str:
        heading = f"<p>{html.escape(self._heading())}</p>" if self._heading() else ""
        # Pictures as data: their names inside must not meet those of other pictures of the page.
        images = "".join(
            f'<figure><img alt="{html.escape(path.stem)}" style="max-width:100%" '
            f'src="data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}"></figure>'
            for path in self.pictures[:6]
        )
        return heading + _html_table(self._rows()) + images


def _html_table(rows: Sequence[Row]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in rows[0])
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(_cell(value))}</td>" for value in row.values()) + "</tr>" for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _cell(value: Any) -> str:
    return format(value, ".5g") if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class SolveStep:
    """Equilibrium at one drive."""

    drive_mm: float
    force_n: float
    normal_force_n: float
    largest_principal_stretch: float
    force_discretisation_n: Optional[float] = None
    """What the mesh may put the force wrong by."""


@dataclass(frozen=True, eq=False)
class Solution(Result):
    """Forces at the drives (`solve/1`); the fields are in `folder`, for ParaView."""

    steps: Tuple[SolveStep, ...]

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path) -> "Solution":
        """From the program's JSON."""
        steps = tuple(
            SolveStep(
                step["drive_mm"],
                step["force_n"],
                step["normal_force_n"],
                step["largest_principal_stretch"],
                step.get("force_discretisation_n"),
            )
            for step in raw["steps"]
        )
        return cls(raw, folder, (), steps=steps)

    def _rows(self) -> List[Row]:
        return [dict(vars(step)) for step in self.steps]


@dataclass(frozen=True)
class PromisedSd:
    """The standard deviation of a parameter that a scan promises (Cramér–Rao)."""

    parameter: str
    value: float
    relative_sd: float
    identifiable: bool
    discretisation_relative: Optional[float] = None
    """What the mesh may put it wrong by, relative to it."""


@dataclass(frozen=True)
class IntegratedSensitivity:
    """How much a scan tells of a parameter, over all voxels."""

    parameter: str
    sum: float
    mean_per_voxel: float
    volume_integral: float
    surface_integral: Optional[float] = None
    """Where cameras see a face: over its area in place of a volume."""
    discretisation_relative: Optional[float] = None
    """What the mesh may put them wrong by, relative to them."""


@dataclass(frozen=True)
class PhaseLoss:
    """What encoding displacement as a phase costs at one drive."""

    num_voxels_lost: int
    """Voxels whose phase cannot be unwrapped; they are counted in `num_voxels`."""
    mean_signal: Tuple[float, float, float]
    """The part of their signal that the others keep along x, y and z."""


@dataclass(frozen=True)
class EvaluationStep:
    """What the scan at one drive would see. Parameters are looked up by name, such as `mu_1`."""

    drive_mm: float
    force_n: float
    num_voxels: int
    median_stretch: float
    largest_principal_stretch: float
    integrated_sensitivity: Mapping[str, IntegratedSensitivity]
    promised_sd: Mapping[str, PromisedSd]
    normal_force_n: Optional[float] = None
    """Across the plates of a double-lap test, positive where it pulls them together."""
    force_discretisation_n: Optional[float] = None
    """What the mesh may put the force wrong by."""
    phase_loss: Optional[PhaseLoss] = None
    """Where the scan says how it encodes (`ScanSettings.mm_per_radian`)."""


def _phase_loss(value: Optional[Mapping[str, Any]]) -> Optional[PhaseLoss]:
    if value is None:
        return None
    x, y, z = value["mean_signal"]
    return PhaseLoss(value["num_voxels_lost"], (x, y, z))


def _promised(entries: Iterable[Mapping[str, Any]]) -> Dict[str, PromisedSd]:
    return {
        p["parameter"]: PromisedSd(
            p["parameter"],
            _number(p["value"]),
            _number(p["relative_sd"]),
            p["identifiable"],
            p.get("discretisation_relative"),
        )
        for p in entries
    }


def _evaluation_step(step: Mapping[str, Any]) -> EvaluationStep:
    sensitivity = {s["parameter"]: IntegratedSensitivity(**s) for s in step["integrated_sensitivity"]}
    return EvaluationStep(
        drive_mm=step["drive_mm"],
        force_n=step["force_n"],
        num_voxels=step["num_voxels"],
        median_stretch=step["median_stretch"],
        largest_principal_stretch=step["largest_principal_stretch"],
        integrated_sensitivity=sensitivity,
        promised_sd=_promised(step["promised_sd"]),
        normal_force_n=step.get("normal_force_n"),
        force_discretisation_n=step.get("force_discretisation_n"),
        phase_loss=_phase_loss(step.get("phase_loss")),
    )


def _detectable(entry: Mapping[str, Any]) -> "DetectableSize":
    size = entry["size"]
    return DetectableSize(
        cause=entry["cause"],
        description=entry["description"],
        parameter=entry["parameter"],
        size=math.inf if size is None else size,
        limited_by=entry["limited_by"],
        rival=entry.get("rival"),
    )


@dataclass(frozen=True)
class DetectableSize:
    """The smallest size of one parameter of a cause that a diagnosis would name with 90 % probability."""

    cause: str
    description: str
    parameter: str
    size: float
    """In the unit that the parameter's name ends with; infinite where it would never be named."""
    limited_by: str
    rival: Optional[str] = None


@dataclass(frozen=True, eq=False)
class Evaluation(Result):
    """What a scan would see and tell (`evaluation/1`). `promised_sd` is of all drives together.

    `detectable` is empty unless the evaluation was made with `has_detectable=True`.
    """

    steps: Tuple[EvaluationStep, ...]
    promised_sd: Mapping[str, PromisedSd]
    detectable: Tuple[DetectableSize, ...] = ()

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path) -> "Evaluation":
        """From the program's JSON."""
        steps = tuple(_evaluation_step(step) for step in raw["steps"])
        detectable = tuple(_detectable(entry) for entry in raw.get("detectable", ()))
        promised_sd = _promised(raw["promised_sd"])
        return cls(raw, folder, (), steps=steps, promised_sd=promised_sd, detectable=detectable)

    @property
    def correlation(self) -> npt.NDArray[np.float64]:
        """Correlations of the parameters, in the order of `promised_sd`."""
        return np.array(self.raw["correlation"], dtype=float)

    def _rows(self) -> List[Row]:
        rows: List[Row] = []
        for step in self.steps:
            for parameter, promised in step.promised_sd.items():
                seen = step.integrated_sensitivity.get(parameter)
                row: Row = {"drive_mm": step.drive_mm, "force_n": step.force_n, "num_voxels": step.num_voxels}
                row.update(parameter=parameter, integrated_sensitivity=seen.sum if seen else math.nan)
                row.update(promised_sd=promised.value, relative_sd=promised.relative_sd)
                rows.append(row)
        return rows


@dataclass(frozen=True)
class ScanStep:
    """One drive of a synthetic scan."""

    drive_mm: float
    force_n: float
    true_force_n: float


@dataclass(frozen=True, eq=False)
class Scan(Result):
    """A synthetic scan (`scan/1`): its folder is a recording's."""

    steps: Tuple[ScanStep, ...]
    seed: int
    is_raw: bool

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path) -> "Scan":
        """From the program's JSON."""
        steps = tuple(ScanStep(s["drive_mm"], s["force_n"], s["true_force_n"]) for s in raw["steps"])
        return cls(raw, folder, (), steps=steps, seed=raw["seed"], is_raw=raw["is_raw"])

    @property
    def recording(self) -> Recording:
        """The recording, read from the folder. Raw phases have first to be made displacements of."""
        return Recording.read(self.folder)

    def _rows(self) -> List[Row]:
        return [dict(vars(step)) for step in self.steps]


@dataclass(frozen=True)
class Estimate:
    """An estimated parameter: `kappa`, `mu_1`, `mu_2`, … in kPa, `alpha_1`, `alpha_2`, …; NaN for what is unknown."""

    name: str
    value: float
    sd: float
    interval_95: Tuple[float, float]
    identifiable: bool


def _estimates(entries: Iterable[Mapping[str, Any]]) -> Dict[str, Estimate]:
    return {
        p["name"]: Estimate(
            p["name"],
            _number(p["value"]),
            _number(p.get("sd")),
            _pair(p.get("interval_95")),
            p.get("identifiable", p.get("interval_95") is not None),
        )
        for p in entries
    }


def _estimate_rows(estimates: Iterable[Estimate]) -> List[Row]:
    return [
        {
            "parameter": e.name,
            "value": e.value,
            "sd": e.sd,
            "low_95": e.interval_95[0],
            "high_95": e.interval_95[1],
            "identifiable": e.identifiable,
        }
        for e in estimates
    ]


def _shear_modulus(raw: Mapping[str, Any]) -> Estimate:
    found = raw.get("initial_shear_modulus_kpa") or {}
    interval = found.get("interval_95")
    return Estimate(
        "initial_shear_modulus_kpa", _number(found.get("value")), math.nan, _pair(interval), interval is not None
    )


@dataclass(frozen=True)
class CalibrationStep:
    """Fit and measurement at one drive of one recording."""

    recording: str
    drive_mm: float
    num_voxels: int
    rms_mm: Tuple[float, float, float]
    """Along x, y, z; NaN of a component that cameras do not measure."""
    force_n: float
    model_force_n: float


@dataclass(frozen=True, eq=False)
class Calibration(Result):
    """A material from recordings (`calibration/1`). Parameters are looked up by name, such as `mu_1`."""

    material: Material
    num_terms: int
    parameters: Mapping[str, Estimate]
    initial_shear_modulus: Estimate
    chi2_per_datum: float
    steps: Tuple[CalibrationStep, ...]

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path, sources: Sources) -> "Calibration":
        """From the program's JSON."""
        steps = tuple(
            CalibrationStep(
                s["recording"],
                s["drive_mm"],
                s["num_voxels"],
                (_number(s["rms_mm"][0]), _number(s["rms_mm"][1]), _number(s["rms_mm"][2])),
                _number(s["force_n"]),
                _number(s["model_force_n"]),
            )
            for s in raw["steps"]
        )
        return cls(
            raw,
            folder,
            sources,
            material=Material._of_program(raw["material"]),
            num_terms=raw["num_terms"],
            parameters=_estimates(raw["parameters"]),
            initial_shear_modulus=_shear_modulus(raw),
            chi2_per_datum=_number(raw["chi2_per_datum"]),
            steps=steps,
        )

    def to_xarray(self, recording: int = 0) -> Any:
        """A dataset with `measured`, `model` and `misfit` of one of the recordings over drives and voxels, in mm."""
        return _images(self, recording, {n: f"{n}_{recording + 1}_{{}}" for n in ("measured", "model", "misfit")})

    def _rows(self) -> List[Row]:
        return _estimate_rows(self.parameters.values())

    def _heading(self) -> str:
        terms = "1 term" if self.num_terms == 1 else f"{self.num_terms} terms"
        return f"Ogden material of {terms}; χ² per datum {self.chi2_per_datum:.3g}"


@dataclass(frozen=True)
class NextCandidate:
    """A scan that may come next."""

    name: str
    specimen: str
    drive_mm: Tuple[float, ...]
    is_repeat: bool
    minutes: float
    promised_relative_sd: Mapping[str, float]
    gain_per_minute: float
    num_scans_to_precision: Optional[int]


@dataclass(frozen=True, eq=False)
class NextScan(Result):
    """What to scan next (`next/1`). `candidates` stand from the best on; `verdict` is none where no precision is asked."""

    sentence: str
    material: Material
    relative_sd: Mapping[str, float]
    candidates: Tuple[NextCandidate, ...]
    verdict: Optional[str]

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path, sources: Sources) -> "NextScan":
        """From the program's JSON."""
        names = [p["name"] for p in raw["parameters"]]
        candidates = tuple(
            NextCandidate(
                c["name"],
                c["specimen"],
                tuple(c["drive_mm"]),
                c["is_repeat"],
                c["minutes"],
                dict(zip(names, c["promised_relative_sd"])),
                c["gain_per_minute"],
                c["num_scans_to_precision"],
            )
            for c in raw["candidates"]
        )
        return cls(
            raw,
            folder,
            sources,
            sentence=raw["sentence"],
            material=Material._of_program(raw["material"]),
            relative_sd={p["name"]: p["relative_sd"] for p in raw["parameters"]},
            candidates=candidates,
            verdict=raw["stop"]["verdict"] if raw["stop"] else None,
        )

    def _rows(self) -> List[Row]:
        rows: List[Row] = []
        for candidate in self.candidates:
            row: Row = {"candidate": candidate.name, "minutes": candidate.minutes}
            row.update({f"relative_sd_{name}": sd for name, sd in candidate.promised_relative_sd.items()})
            row.update(gain_per_minute=candidate.gain_per_minute)
            rows.append(row)
        return rows

    def _heading(self) -> str:
        return self.sentence


def _images(result: Result, index: int, names: Mapping[str, str]) -> Any:
    """Images of vectors on the grid and drives of one of a result's recordings."""
    source = result.sources[index]
    recording = Recording.read(source) if isinstance(source, Path) else source
    numbers = range(1, len(recording.drive_mm) + 1)
    read = {
        name: np.stack([read_image(result.folder / f"{pattern.format(n)}.nii.gz").values for n in numbers])
        for name, pattern in names.items()
    }
    return grid_dataset(recording, read)


@dataclass(frozen=True)
class Place:
    """Where a cause acts: in words, and the centre and extent of a box in mm."""

    region: str
    center_mm: Tuple[float, float, float]
    extent_mm: Tuple[float, float, float]


@dataclass(frozen=True)
class Cause:
    """A cause of a misfit. `place` is `None` for what is everywhere; `remedy` is what a laboratory can do about it."""

    name: str
    category: str
    description: str
    parameters: Mapping[str, Estimate]
    place: Optional[Place]
    evidence: float
    effect_rms_mm: float
    remedy: str


def _place(found: Optional[Mapping[str, Any]]) -> Optional[Place]:
    return None if found is None else Place(found["region"], tuple(found["center_mm"]), tuple(found["extent_mm"]))


def _causes(entries: Iterable[Mapping[str, Any]]) -> Tuple[Cause, ...]:
    return tuple(
        Cause(
            c["name"],
            c["category"],
            c["description"],
            _estimates(c["parameters"]),
            _place(c["location"]),
            _number(c["evidence"]),
            _number(c["effect_rms_mm"]),
            c["remedy"],
        )
        for c in entries
    )


@dataclass(frozen=True)
class BeforeAfter:
    """A figure of the nominal model, and with the causes modelled."""

    before: float
    after: float


def _before_after(found: Mapping[str, Any]) -> BeforeAfter:
    return BeforeAfter(_number(found["before"]), _number(found["after"]))


@dataclass(frozen=True, eq=False)
class Diagnosis(Result):
    """Where a recording and its model differ, and why (`diagnosis/1`).

    `verdict` is `no_mismatch`, `explained`, `explained_ambiguously` (`alternatives` cannot be told apart from the last
    cause) or `unexplained` (`left_at` says where most is left).
    """

    verdict: str
    causes: Tuple[Cause, ...]
    alternatives: Tuple[Cause, ...]
    material: Material
    parameters: Mapping[str, Estimate]
    chi2_per_datum: BeforeAfter
    kept_back_rms_mm: Optional[BeforeAfter]
    left_at: Optional[Place]
    file_prefix: str = field(repr=False)

    @classmethod
    def of(
        cls, raw: Mapping[str, Any], folder: Path, sources: Sources, prefix: str = ""
    ) -> "Diagnosis":
        """From the program's JSON."""
        return cls(
            raw,
            folder,
            sources,
            verdict=raw["verdict"],
            causes=_causes(raw["causes"]),
            alternatives=_causes(raw["alternatives"]),
            material=Material._of_program(raw["material"]),
            parameters=_estimates(raw["material_parameters"]),
            chi2_per_datum=_before_after(raw["chi2_per_datum"]),
            kept_back_rms_mm=_before_after(kept) if (kept := raw.get("kept_back_rms_mm")) else None,
            left_at=_place(raw.get("left_at")),
            file_prefix=prefix,
        )

    @property
    def pictures(self) -> List[Path]:
        """The pictures (SVG)."""
        return sorted(self.folder.glob(f"{self.file_prefix}*.svg"))

    @property
    def report(self) -> Optional[Path]:
        """The report (HTML)."""
        return next(iter(self.folder.glob(f"{self.file_prefix}report.html")), None)

    def to_xarray(self) -> Any:
        """A dataset with `residual_before` and `residual_after` the causes over drives and voxels, in mm."""
        names = ("residual_before", "residual_after")
        return _images(self, 0, {name: f"{self.file_prefix}{name}_{{}}" for name in names})

    def _rows(self) -> List[Row]:
        return [
            {
                "cause": cause.name,
                "category": cause.category,
                "description": cause.description,
                "parameter": e.name,
                "value": e.value,
                "low_95": e.interval_95[0],
                "high_95": e.interval_95[1],
                "place": "everywhere" if cause.place is None else cause.place.region,
                "effect_rms_mm": cause.effect_rms_mm,
                "remedy": cause.remedy,
            }
            for cause in self.causes
            for e in cause.parameters.values()
        ]

    def to_pandas(self) -> Any:
        """A row for each parameter of each cause; no rows where there is no cause."""
        return optional("pandas").DataFrame(self._rows())

    def _heading(self) -> str:
        return f"verdict: {self.verdict.replace('_', ' ')}"


@dataclass(frozen=True, eq=False)
class Diagnoses(Result):
    """Several recordings of one material, each diagnosed and then looked at together (`diagnoses/1`)."""

    diagnoses: Tuple[Diagnosis, ...]
    material: Material
    parameters: Mapping[str, Estimate]
    agrees: bool
    """Whether one material fits them all."""

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path, sources: Sources) -> "Diagnoses":
        """From the program's JSON."""
        together = raw["together"]
        return cls(
            raw,
            folder,
            sources,
            diagnoses=tuple(
                Diagnosis.of(one, folder, (sources[n],), f"{n + 1}-") for n, one in enumerate(raw["diagnoses"])
            ),
            material=Material._of_program(together["material"]),
            parameters=_estimates(together["material_parameters"]),
            agrees=together["one_material"]["agrees"],
        )

    @property
    def report(self) -> Optional[Path]:
        """The report on all of them (HTML); each of `diagnoses` has its own."""
        return self.folder / "together.html"

    def _rows(self) -> List[Row]:
        return _estimate_rows(self.parameters.values())

    def _heading(self) -> str:
        verdicts = ", ".join(d.verdict.replace("_", " ") for d in self.diagnoses)
        return f"verdicts: {verdicts}; one material {'fits' if self.agrees else 'does not fit'} all"


@dataclass(frozen=True)
class Candidate:
    """A design: its objective is the gain over the base specimen, 1 for the base itself."""

    specimen: Specimen
    objective: float
    closest_limit: str
    evaluation: Evaluation = field(repr=False)


def _candidate(found: Mapping[str, Any], folder: Path) -> Candidate:
    specimen = Specimen._of_program(found["specimen"])
    return Candidate(
        specimen, _number(found["objective"]), found["closest_limit"], Evaluation.of(found["evaluation"], folder)
    )


@dataclass(frozen=True, eq=False)
class Design(Result):
    """The best specimen of a study (`design/1`), the base, and all that were confirmed, best first."""

    base: Candidate
    best: Candidate
    ranked: Tuple[Candidate, ...]
    simplest: Candidate
    """Of those that meshes cannot tell from the best, the one that is the simplest to make."""
    findings: Tuple[str, ...]
    recommendation: str
    """What to make, how to scan it, and why."""

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path) -> "Design":
        """From the program's JSON."""
        ranked = tuple(_candidate(one, folder) for one in raw["ranked"])
        return cls(
            raw,
            folder,
            (),
            base=_candidate(raw["base"], folder),
            best=_candidate(raw["best"], folder),
            ranked=ranked,
            simplest=ranked[raw["simplest"]],
            findings=tuple(raw["findings"]),
            recommendation=raw["recommendation"]["make"],
        )

    def _rows(self) -> List[Row]:
        rows: List[Row] = []
        for rank, one in enumerate(self.ranked, start=1):
            rows.append(
                {
                    "rank": rank,
                    "objective": one.objective,
                    "name": one.specimen.name,
                    "holes": len(one.specimen.holes),
                    "drive_mm": one.specimen.drive_mm[-1],
                    "length_mm": one.specimen.length_mm,
                    "thickness_mm": one.specimen.thickness_mm,
                    "width_mm": one.specimen.width_mm,
                    "closest_limit": one.closest_limit,
                }
            )
        return rows

    def _heading(self) -> str:
        return self.recommendation


@dataclass(frozen=True, eq=False)
class CurveFit(Result):
    """Ogden terms, or another law, of curves of homogeneous tests (`uniaxial/1`, `curves/1`).

    `material` is `None` where the parameters are beyond what a material may hold. Its bulk modulus stands for the
    incompressible limit where `is_bulk_held` is false.
    """

    material: Optional[Material]
    num_terms: int
    parameters: Mapping[str, Estimate]
    initial_shear_modulus: Estimate
    is_bulk_held: bool
    law: Optional[str]
    bic_above_best: Mapping[str, float]
    """BIC of every law less the smallest one, best first: which law describes the curves with the fewest parameters."""

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path) -> "CurveFit":
        """From the program's JSON."""
        return cls(
            raw,
            folder,
            (),
            material=None if raw["material"] is None else Material._of_program(raw["material"]),
            num_terms=raw["num_terms"],
            parameters=_estimates(raw["parameters"]),
            initial_shear_modulus=_shear_modulus(raw),
            is_bulk_held=raw["is_bulk_held"],
            law=raw["law"],
            bic_above_best={law["name"]: law["bic_above_best"] for law in raw["laws"]["laws"]},
        )

    def _rows(self) -> List[Row]:
        return _estimate_rows(self.parameters.values())


@dataclass(frozen=True)
class MaterialCard:
    """A material as another program reads it."""

    program: str
    file: Path
    constants: Mapping[str, float]
    """The constants in that program's convention and the unit that was asked for."""

    @property
    def text(self) -> str:
        """The text of the file."""
        return self.file.read_text(encoding="utf-8")


@dataclass(frozen=True, eq=False)
class MaterialExport(Result):
    """A material for other programs (`export-material/1`); cards are looked up by format, such as `abaqus`."""

    cards: Mapping[str, MaterialCard]

    @classmethod
    def of(cls, raw: Mapping[str, Any], folder: Path) -> "MaterialExport":
        """From the program's JSON."""
        cards = {
            c["format"]: MaterialCard(
                c["program"], folder / c["file"], {constant["name"]: constant["value"] for constant in c["constants"]}
            )
            for c in raw["cards"]
        }
        return cls(raw, folder, (), cards=cards)

    def _rows(self) -> List[Row]:
        units = [(c["format"], constant) for c in self.raw["cards"] for constant in c["constants"]]
        return [{"format": f, "constant": k["name"], "value": k["value"], "unit": k["unit"]} for f, k in units]
