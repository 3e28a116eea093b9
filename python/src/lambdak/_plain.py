"""Values as JSON holds them."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Dict, Mapping, Tuple, Union

import numpy as np

from ._errors import InputError

JsonSource = Union[str, "os.PathLike[str]", Mapping[str, Any]]


def plain(value: Any) -> Any:
    """`value` with arrays as lists, paths as text, and everything that has a `to_dict` as what that gives."""
    if hasattr(value, "to_dict") and not isinstance(value, Mapping):
        return plain(value.to_dict())
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist()) if value.ndim > 0 else value.item()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def given(**fields: Any) -> Dict[str, Any]:
    """The fields that are not `None`: what is left out has the program's default."""
    return {name: plain(value) for name, value in fields.items() if value is not None}


def read_json(source: JsonSource) -> Dict[str, Any]:
    """An object from a mapping, a file, or text that begins with a brace."""
    if isinstance(source, Mapping):
        found: Any = plain(source)
    else:
        is_text = isinstance(source, str) and source.lstrip().startswith("{")
        where = "the text" if is_text else os.fspath(source)
        try:
            found = json.loads(os.fspath(source) if is_text else Path(source).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError((f"cannot read {where}: {error.strerror}",)) from None
        except ValueError as error:
            raise InputError((f"{where} is not JSON: {error}",)) from None
    if not isinstance(found, dict):
        raise InputError((f"a JSON object is needed; found {type(found).__name__}",))
    return found


def only_known(found: Mapping[str, Any], known: Tuple[str, ...], what: str) -> None:
    """Refuses fields that a newer program may know: leaving them out would change what is computed."""
    unknown = [name for name in found if name not in known]
    if unknown:
        hint = "which this version of the package does not know; install a newer one"
        raise InputError(tuple(f"{what} has the field {name}, {hint}" for name in unknown))
