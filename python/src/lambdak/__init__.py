"""lambdak designs, verifies and diagnoses full-field experiments on soft materials.

Lengths in mm, forces in N, moduli in kPa. The frame has its origin at the centre of the block: x along the length (the
pull direction), y along the thickness, z along the width.
"""

from importlib.metadata import PackageNotFoundError, version

from ._errors import (
    InputError,
    LambdakError,
    MissingPackageError,
    NoSolutionError,
    ProgramError,
    ProgramMissingError,
    Stopped,
    TimeLimitError,
    WorseError,
    WriteError,
)
from ._functions import (
    calibrate,
    curves,
    design,
    diagnose,
    diagnose_together,
    evaluate,
    export_material,
    import_recording,
    next_scan,
    run,
    scan,
    solve,
    uniaxial,
)
from ._program import program_path, program_version
from ._recording import Recording, centered_origin
from ._results import (
    BeforeAfter,
    Calibration,
    CalibrationStep,
    Candidate,
    Cause,
    CurveFit,
    Design,
    Diagnoses,
    Diagnosis,
    Estimate,
    Evaluation,
    EvaluationStep,
    IntegratedSensitivity,
    MaterialCard,
    MaterialExport,
    NextCandidate,
    NextScan,
    Place,
    PromisedSd,
    Result,
    Scan,
    ScanStep,
    Solution,
    SolveStep,
)
from ._specimen import Hole, Material, Sample, ScanSettings, Specimen, Term

try:
    __version__ = version("lambdak")
except PackageNotFoundError:  # The sources are on the path without being installed.
    __version__ = "0"

__all__ = [
    "BeforeAfter",
    "Calibration",
    "CalibrationStep",
    "Candidate",
    "Cause",
    "CurveFit",
    "Design",
    "Diagnoses",
    "Diagnosis",
    "Estimate",
    "Evaluation",
    "EvaluationStep",
    "Hole",
    "InputError",
    "IntegratedSensitivity",
    "LambdakError",
    "Material",
    "MaterialCard",
    "MaterialExport",
    "MissingPackageError",
    "NextCandidate",
    "NextScan",
    "NoSolutionError",
    "Place",
    "ProgramError",
    "ProgramMissingError",
    "PromisedSd",
    "Recording",
    "Result",
    "Sample",
    "Scan",
    "ScanSettings",
    "ScanStep",
    "Solution",
    "SolveStep",
    "Specimen",
    "Stopped",
    "Term",
    "TimeLimitError",
    "WorseError",
    "WriteError",
    "calibrate",
    "centered_origin",
    "curves",
    "design",
    "diagnose",
    "diagnose_together",
    "evaluate",
    "export_material",
    "import_recording",
    "next_scan",
    "program_path",
    "program_version",
    "run",
    "scan",
    "solve",
    "uniaxial",
]
