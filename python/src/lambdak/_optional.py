"""pandas and xarray, which are needed by some methods alone."""

from __future__ import annotations

import importlib
from typing import Any

from ._errors import MissingPackageError


def optional(package: str) -> Any:
    """The package."""
    try:
        return importlib.import_module(package)
    except ImportError:
        hint = f"install it with `pip install {package}`, or `pip install lambdak[tables]` for pandas and xarray"
        raise MissingPackageError(f"this needs {package}, which is not installed; {hint}") from None
