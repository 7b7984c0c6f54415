"""The model of the legs as a file: `identify_legs` writes it, benches and optimizers include it."""

import json
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from labdrive.interfaces.settings import Settings
from labdrive.model.errors import InputError, Problem
from labdrive.periodic.hysteresis import PlayModel
from labdrive.periodic.leg_fit import Geometry
from labdrive.periodic.legs import LegModel


class Hysteresis(Settings):
    """Plays of radius r [V] and weight w: expansion = U + sum of w play_r(U)."""

    radii_v: tuple[float, ...]
    weights: tuple[float, ...]


class LegsFile(Settings):
    """Model of the legs and where it comes from; the matrix is in m/V."""

    run: str
    geometry: Geometry
    m11: float
    m12: float
    m21: float
    m22: float
    hysteresis: Hysteresis

    @property
    def legs(self) -> LegModel:
        """The linear model."""
        return LegModel(self.m11, self.m12, self.m21, self.m22)

    @property
    def plays(self) -> PlayModel:
        """The hysteresis of an element."""
        return PlayModel(np.array(self.hysteresis.radii_v), np.array(self.hysteresis.weights))

    def text(self) -> str:
        """Return the file as written."""
        return json.dumps(self.model_dump(), indent=2) + "\n"


def read_legs(path: Path) -> LegsFile:
    """Return what a file says of the legs; InputError, with its field or line, if it is wrong."""
    try:
        return LegsFile.model_validate_json(path.read_text(encoding="utf-8"), strict=True)
    except ValidationError as error:
        raise InputError(*(_problem(path, dict(one)) for one in error.errors())) from error
    except (OSError, ValueError) as error:
        raise InputError(Problem(f"cannot be read: {error}", file=str(path))) from error


def _problem(path: Path, detail: dict[str, object]) -> Problem:
    location = detail["loc"]
    field = ".".join(map(str, location)) if isinstance(location, tuple) else ""
    message = f"{detail['msg']}; an identify_legs run writes such files"
    return Problem(message, field=field, file=str(path))
