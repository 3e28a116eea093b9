"""Specimens, materials and scans, as the program's files hold them.

What may stand in a field is the program's to say: a new specimen or material is put before it, and what it refuses is
raised in its own words.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, Iterable, Mapping, Optional, Sequence, Tuple, Union

from ._errors import InputError
from ._plain import JsonSource, given, only_known, plain, read_json
from ._program import PathLike, encoded, run_program

Numbers = Union[float, Iterable[float]]

# A request that holds the part beside little else, so that what is refused is the part, and its answer comes at once.
_CURVE = "stretch,nominal_stress_kpa\n1,0\n1.1,5\n1.2,9\n1.3,13\n"
_CHECKS: Dict[str, Tuple[str, Dict[str, Any]]] = {
    "specimen": ("uniaxial", {"csv": _CURVE, "fit": {"max_terms": 1}}),
    "material": ("export-material", {}),
}


# Extents of a block.
_EXTENTS = ("length_mm", "thickness_mm", "width_mm")
# Dimensions of a dumb-bell of free gauge.
_GAUGE = ("gauge_width_mm", "gauge_length_mm", "fillet_radius_mm")


def _check(part: str, value: Dict[str, Any]) -> None:
    problems = _problems(part, encoded(value))
    if problems:
        raise InputError(problems)


@functools.lru_cache(maxsize=1024)
def _problems(part: str, text: str) -> Tuple[str, ...]:
    """What the program has against a part. Kept, since loops over designs make the same parts again and again."""
    kind, rest = _CHECKS[part]
    try:
        run_program(["run", kind], {part: json.loads(text), **rest}, name=kind, has_files=False)
    except InputError as error:
        return tuple(problem.replace(f"/{part}", "", 1) for problem in error.problems)
    return ()


def _tuple(numbers: Any) -> Tuple[float, ...]:
    """One number or several; what is neither goes on to the program, which says what it should be."""
    is_several = isinstance(numbers, Iterable) and not isinstance(numbers, (str, bytes))
    return tuple(plain(list(numbers))) if is_several else (plain(numbers),)


@dataclass(frozen=True)
class HoleShape:
    """The outline of a hole that is not a circle: `kind` is `ellipse` or `slot`.

    `length_mm` is its extent along it, and the hole's `diameter_mm` then that across it; `angle_deg` runs from x
    towards the section's other axis (z for holes along the thickness, y for holes along the width).
    """

    kind: str
    length_mm: float
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "length_mm", plain(self.length_mm))
        object.__setattr__(self, "angle_deg", plain(self.angle_deg))

    def to_dict(self) -> Dict[str, Any]:
        """As `specimen/1` holds it."""
        return {"kind": self.kind, "length_mm": self.length_mm, "angle_deg": self.angle_deg}


@dataclass(frozen=True)
class Hole:
    """A hole through the whole block: a circle, or with a `shape` an ellipse or a slot.

    A circle with `is_notch` has its centre near a free side of the block, which cuts it open.

    Along the thickness it is centred at (x, z), along the width at (x, y), in mm from the block's centre.
    """

    center_mm: Tuple[float, float]
    diameter_mm: float
    axis: str = "thickness"
    shape: Optional[HoleShape] = None
    is_notch: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "center_mm", _tuple(self.center_mm))
        object.__setattr__(self, "diameter_mm", plain(self.diameter_mm))

    def to_dict(self) -> Dict[str, Any]:
        """As `specimen/1` holds it."""
        more: Dict[str, Any] = {} if self.shape is None else {"shape": self.shape.to_dict()}
        if self.is_notch:
            more["is_notch"] = True
        return {"axis": self.axis, "center_mm": list(self.center_mm), "diameter_mm": self.diameter_mm, **more}

    @classmethod
    def _of_program(cls, found: Dict[str, Any]) -> "Hole":
        only_known(found, ("axis", "center_mm", "diameter_mm", "shape", "is_notch"), "a hole")
        shape = found.get("shape")
        if shape is not None:
            only_known(shape, ("kind", "length_mm", "angle_deg"), "a hole's shape")
        return cls(**{**found, "shape": None if shape is None else HoleShape(**shape)})


@dataclass(frozen=True)
class Dumbbell:
    """The outline of a dumb-bell of free gauge: the specimen's length and width are those of the whole.

    The gauge is joined to the ends by two arcs of `fillet_radius_mm` each, the first tangent to the gauge, the second
    to the end.
    """

    gauge_width_mm: float
    gauge_length_mm: float
    fillet_radius_mm: float

    def __post_init__(self) -> None:
        for name in _GAUGE:
            object.__setattr__(self, name, plain(getattr(self, name)))

    def to_dict(self) -> Dict[str, Any]:
        """As `specimen/1` holds it."""
        return {"dumbbell": {name: getattr(self, name) for name in _GAUGE}}

    @classmethod
    def _of_program(cls, found: Dict[str, Any]) -> "Dumbbell":
        only_known(found, ("dumbbell",), "the outline")
        only_known(found["dumbbell"], _GAUGE, "the outline's dumb-bell")
        return cls(**found["dumbbell"])


@dataclass(frozen=True)
class Sample:
    """A further sample of a double-lap test: a block of its own that shares drive and load cell with the others."""

    length_mm: float
    thickness_mm: float
    width_mm: float
    holes: Tuple[Hole, ...] = ()
    wedge_mm: Optional[float] = None

    def __post_init__(self) -> None:
        for name in (*_EXTENTS, "wedge_mm"):
            object.__setattr__(self, name, plain(getattr(self, name)))
        object.__setattr__(self, "holes", tuple(self.holes))

    def to_dict(self) -> Dict[str, Any]:
        """As `specimen/1` holds it."""
        block = {**{name: getattr(self, name) for name in _EXTENTS}, **given(wedge_mm=self.wedge_mm)}
        return {"block": block, "holes": [hole.to_dict() for hole in self.holes]}

    @classmethod
    def _of_program(cls, found: Dict[str, Any]) -> "Sample":
        only_known(found, ("block", "holes"), "a further sample")
        return cls(**_block(found), holes=_holes(found))


def _block(found: Dict[str, Any]) -> Dict[str, float]:
    only_known(found["block"], (*_EXTENTS, "wedge_mm"), "the block")
    return dict(found["block"])


def _holes(found: Dict[str, Any]) -> Tuple[Hole, ...]:
    return tuple(Hole._of_program(hole) for hole in found.get("holes") or [])


@dataclass(frozen=True)
class Specimen:
    """A specimen (`specimen/1`): a block with holes, how it is held, and the drives at which it is scanned.

    Lengths are in mm. The frame has its origin at the block's centre: x along the length (the pull direction), y along
    the thickness, z along the width. `test` is `double_lap_shear` or `uniaxial`. The block of a double-lap test may be a
    wedge: `wedge_mm` is its thickness at x = +length/2 less that at x = -length/2, and `thickness_mm` that in the middle.
    A double-lap test may hold further samples, unlike the first; their forces add. `outline` is `block`, `iso37_type4` or a `Dumbbell`, the last two in
    a uniaxial test.
    """

    length_mm: float
    thickness_mm: float
    width_mm: float
    test: str
    drive_mm: Tuple[float, ...]
    holes: Tuple[Hole, ...] = ()
    samples_in_parallel: Optional[int] = None
    outline: Union[None, str, Dumbbell] = None
    name: str = "specimen"
    other_samples: Tuple[Sample, ...] = ()
    drive_angle_deg: Optional[float] = None
    precompression_mm: Optional[float] = None
    wedge_mm: Optional[float] = None

    def __init__(
        self,
        *,
        length_mm: float,
        thickness_mm: float,
        width_mm: float,
        test: str,
        drive_mm: Numbers,
        holes: Sequence[Hole] = (),
        samples_in_parallel: Optional[int] = None,
        outline: Union[None, str, Dumbbell] = None,
        name: str = "specimen",
        other_samples: Sequence[Sample] = (),
        drive_angle_deg: Optional[float] = None,
        precompression_mm: Optional[float] = None,
        wedge_mm: Optional[float] = None,
    ) -> None:
        values = {"length_mm": length_mm, "thickness_mm": thickness_mm, "width_mm": width_mm, "test": test}
        self._set(holes=tuple(holes), outline=outline, name=name, drive_mm=_tuple(drive_mm), **plain(values))
        self._set(samples_in_parallel=plain(samples_in_parallel), other_samples=tuple(other_samples))
        self._set(drive_angle_deg=plain(drive_angle_deg), precompression_mm=plain(precompression_mm))
        self._set(wedge_mm=plain(wedge_mm))
        _check("specimen", self.to_dict())

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @classmethod
    def from_json(cls, source: JsonSource) -> "Specimen":
        """From a `specimen/1`: a file, its text, or the object itself."""
        found = read_json(source)
        _check("specimen", found)
        return cls._of_program(found)

    @classmethod
    def _of_program(cls, found: Dict[str, Any]) -> "Specimen":
        """What the program has written or checked."""
        own = ("name", "test", "drive_mm", "samples_in_parallel", "outline", "drive_angle_deg", "precompression_mm")
        only_known(found, (*own, "schema", "block", "holes", "other_samples"), "the specimen")
        specimen = object.__new__(cls)
        others = tuple(Sample._of_program(sample) for sample in found.get("other_samples") or [])
        specimen._set(samples_in_parallel=None, outline=None, other_samples=others)
        specimen._set(drive_angle_deg=None, precompression_mm=None, wedge_mm=None)
        specimen._set(holes=_holes(found), **_block(found), **{name: found[name] for name in own if name in found})
        specimen._set(drive_mm=tuple(found["drive_mm"]))
        if isinstance(found.get("outline"), dict):
            specimen._set(outline=Dumbbell._of_program(found["outline"]))
        return specimen

    def replace(self, **changes: Any) -> "Specimen":
        """A specimen with other values of these fields, such as `replace(holes=[Hole((0, 0), 5)])`."""
        return dataclasses.replace(self, **changes)

    def to_dict(self) -> Dict[str, Any]:
        """The object of a `specimen/1`."""
        optional = given(
            outline=self.outline.to_dict() if isinstance(self.outline, Dumbbell) else self.outline,
            samples_in_parallel=self.samples_in_parallel,
            drive_angle_deg=self.drive_angle_deg,
            precompression_mm=self.precompression_mm,
        )
        if self.other_samples:
            optional["other_samples"] = [sample.to_dict() for sample in self.other_samples]
        block = {"length_mm": self.length_mm, "thickness_mm": self.thickness_mm, "width_mm": self.width_mm}
        return {
            "schema": "specimen/1",
            "name": self.name,
            "test": self.test,
            "block": {**block, **given(wedge_mm=self.wedge_mm)},
            "holes": [hole.to_dict() for hole in self.holes],
            "drive_mm": list(self.drive_mm),
            **optional,
        }

    def to_json(self, file: Optional[PathLike] = None) -> str:
        """The text of a `specimen/1`, also written to `file`."""
        return _to_json(self.to_dict(), file)


@dataclass(frozen=True)
class Term:
    """An Ogden term: μ in kPa and the exponent α."""

    mu_kpa: float
    alpha: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "mu_kpa", plain(self.mu_kpa))
        object.__setattr__(self, "alpha", plain(self.alpha))

    def to_dict(self) -> Dict[str, Any]:
        """As `ogden/1` holds it."""
        return {"mu_kpa": self.mu_kpa, "alpha": self.alpha}


_LAWS = {
    "neo_hookean/1": ("mu_kpa",),
    "mooney_rivlin/1": ("c_1_kpa", "c_2_kpa"),
    "yeoh/1": ("c_1_kpa", "c_2_kpa", "c_3_kpa"),
    "gent/1": ("mu_kpa", "j_m"),
    "arruda_boyce/1": ("mu_kpa", "lambda_m"),
}


@dataclass(frozen=True)
class Law:
    """An energy in the first invariant (and, of Mooney and Rivlin, in the second): the schema of its file and its numbers by their names there."""

    schema: str
    values: Dict[str, float]


@dataclass(frozen=True)
class Material:
    """A hyperelastic material, Ψ = Σ μᵢ/αᵢ (Σλ̄^αᵢ − 3) + W(Ī₁ − 3) + κ/2 (ln J)², with κ (`bulk_kpa`) in kPa.

    `Material([(17.0, 1.91)], bulk_kpa=2173)` is Ogden's (`ogden/1`): terms are :class:`Term` or pairs of μ (kPa) and α.
    `Material.neo_hookean`, `Material.mooney_rivlin`, `Material.yeoh`, `Material.gent` and `Material.arruda_boyce` have a
    :class:`Law` W in the place of terms.
    """

    terms: Tuple[Term, ...]
    bulk_kpa: float
    law: Optional["Law"] = None

    def __init__(
        self,
        terms: Sequence[Union[Term, Tuple[float, float]]] = (),
        *,
        bulk_kpa: float,
        law: Optional["Law"] = None,
    ) -> None:
        object.__setattr__(self, "terms", tuple(t if isinstance(t, Term) else Term(*t) for t in terms))
        object.__setattr__(self, "bulk_kpa", plain(bulk_kpa))
        object.__setattr__(self, "law", law)
        _check("material", self.to_dict())

    @classmethod
    def neo_hookean(cls, mu_kpa: float, *, bulk_kpa: float) -> "Material":
        """W = ½ μ x, x = Ī₁ − 3 (`neo_hookean/1`)."""
        return cls(bulk_kpa=bulk_kpa, law=Law("neo_hookean/1", {"mu_kpa": plain(mu_kpa)}))

    @classmethod
    def mooney_rivlin(cls, c_1_kpa: float, c_2_kpa: float, *, bulk_kpa: float) -> "Material":
        """c₁ (Ī₁ − 3) + c₂ (Ī₂ − 3) (`mooney_rivlin/1`)."""
        values = {"c_1_kpa": plain(c_1_kpa), "c_2_kpa": plain(c_2_kpa)}
        return cls(bulk_kpa=bulk_kpa, law=Law("mooney_rivlin/1", values))

    @classmethod
    def yeoh(cls, c_kpa: Tuple[float, float, float], *, bulk_kpa: float) -> "Material":
        """W = c₁ x + c₂ x² + c₃ x³, x = Ī₁ − 3 (`yeoh/1`)."""
        values = {f"c_{n}_kpa": plain(c) for n, c in enumerate(c_kpa, 1)}
        return cls(bulk_kpa=bulk_kpa, law=Law("yeoh/1", values))

    @classmethod
    def gent(cls, mu_kpa: float, j_m: float, *, bulk_kpa: float) -> "Material":
        """W = −½ μ J_m ln(1 − x/J_m), x = Ī₁ − 3 (`gent/1`)."""
        return cls(bulk_kpa=bulk_kpa, law=Law("gent/1", {"mu_kpa": plain(mu_kpa), "j_m": plain(j_m)}))

    @classmethod
    def arruda_boyce(cls, mu_kpa: float, lambda_m: float, *, bulk_kpa: float) -> "Material":
        """Eight chains that lock at the stretch λ_m (`arruda_boyce/1`)."""
        return cls(bulk_kpa=bulk_kpa, law=Law("arruda_boyce/1", {"mu_kpa": plain(mu_kpa), "lambda_m": plain(lambda_m)}))

    @classmethod
    def from_json(cls, source: JsonSource) -> "Material":
        """From a material's file, such as the `material.json` of a fit: a file, its text, or the object itself."""
        found = read_json(source)
        _check("material", found)
        return cls._of_program(found)

    @classmethod
    def _of_program(cls, found: Dict[str, Any]) -> "Material":
        names = _LAWS.get(found["schema"])
        only_known(found, ("schema", "bulk_kpa", *(("terms",) if names is None else names)), "the material")
        for term in found.get("terms", ()):
            only_known(term, ("mu_kpa", "alpha"), "a term")
        material = object.__new__(cls)
        object.__setattr__(material, "terms", tuple(Term(**term) for term in found.get("terms", ())))
        object.__setattr__(material, "bulk_kpa", found["bulk_kpa"])
        law = None if names is None else Law(found["schema"], {name: found[name] for name in names})
        object.__setattr__(material, "law", law)
        return material

    def to_dict(self) -> Dict[str, Any]:
        """The object of the material's file."""
        if self.law is not None and not self.terms:
            return {"schema": self.law.schema, "bulk_kpa": self.bulk_kpa, **self.law.values}
        return {"schema": "ogden/1", "bulk_kpa": self.bulk_kpa, "terms": [term.to_dict() for term in self.terms]}

    def to_json(self, file: Optional[PathLike] = None) -> str:
        """The text of the material's file, also written to `file`."""
        return _to_json(self.to_dict(), file)


@dataclass(frozen=True)
class ScanSettings:
    """What an evaluation or a study takes the scan to be.

    Edges of a voxel in mm, the standard deviation of its displacement in mm, both along x, y, z, and that of the load
    cell's force (all samples together) in N.
    """

    voxel_mm: Tuple[float, float, float]
    noise_sd_mm: Tuple[float, float, float]
    force_sd_n: float
    partial_voxels: Optional[str] = None
    surface: Optional[Mapping[str, str]] = None
    """The face that cameras see in place of a scan of the volume, such as `{"face": "+z", "components": "all"}`."""
    grid: Optional[str] = None
    """Where the grid lies relative to the sample: `"centred"` unless it is `"anywhere"`, the mean over all places."""
    mm_per_radian: Optional[Tuple[float, float, float]] = None
    """Displacement per phase along x, y, z, mm/rad, where lost signal and phases that cannot be unwrapped are to count;
    `noise_sd_mm` is then that of a voxel that is displaced evenly."""

    def to_dict(self) -> Dict[str, Any]:
        """As requests and studies hold it."""
        fields: Dict[str, Any] = plain(dataclasses.asdict(self))
        return given(**fields)


def _to_json(value: Dict[str, Any], file: Optional[PathLike]) -> str:
    text = json.dumps(value, indent=2) + "\n"
    if file is not None:
        Path(os.fspath(file)).write_text(text, encoding="utf-8")
    return text
