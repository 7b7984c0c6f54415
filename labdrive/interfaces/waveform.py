"""The `waveform` section of a recipe."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from labdrive.interfaces.quantities import ExistingFile, Voltage
from labdrive.interfaces.settings import Settings
from labdrive.interfaces.trajectory_file import read_trajectory
from labdrive.model.wording import no_such
from labdrive.periodic.trajectories import TRAJECTORIES, Trajectory


class TrajectoryName:
    """Marks the name of an installed trajectory, or of a CSV file relative to the recipe.

    Validation takes the installed trajectories from the context key `trajectories`, the folder
    from `folder`; a file becomes an absolute path.
    """

    def __get_pydantic_core_schema__(self, _: type[Any], __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_after_validator_function(self._known, core_schema.str_schema())

    def __get_pydantic_json_schema__(
        self, _: CoreSchema, __: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "string", "format": "trajectory"}

    def _known(self, given: str, info: core_schema.ValidationInfo) -> str:
        if _is_file(given):
            return str(ExistingFile().path(given, info.context))
        known = (info.context or {}).get("trajectories", TRAJECTORIES)
        if given not in known:
            text = no_such("trajectory", given, known) + ", or name a .csv file"
            raise PydanticCustomError("trajectory", "{message}", {"message": text})
        return given


class Waveform(Settings):
    """The waveform to start from, for actuators that have a choice."""

    trajectory: Annotated[str, TrajectoryName()] = Field(
        description="Path of a leg's tip: ellipse (waveform 1 of the paper), triangle (2), box "
        "(3), one that a plugin brings, or a CSV file with the columns phase_deg, x, y."
    )
    amplitude: Literal["max"] | Voltage = Field(
        default="max",
        description="`max` fills the bench's voltage range; a voltage is the largest "
        "peak-to-peak of any channel, from the lower end of the range up.",
    )
    x_scale: float = Field(default=1.0, gt=0, le=1, description="Factor on the tip's x stroke.")
    y_scale: float = Field(default=1.0, gt=0, le=1, description="Factor on the tip's y stroke.")
    pretension: Literal["keep", "free"] = Field(
        default="keep",
        description="keep: raise the legs of a scaled waveform so that the rod is held as high, in "
        "the mean, as without scaling. free: swing about the same middle, as in the paper.",
    )

    def path(self, trajectories: Mapping[str, Trajectory]) -> Trajectory:
        """Return the trajectory; InputError, with its line, if its file cannot be read."""
        if _is_file(self.trajectory):
            return read_trajectory(Path(self.trajectory))
        return trajectories[self.trajectory]


def _is_file(trajectory: str) -> bool:
    return trajectory.lower().endswith(".csv")
