"""The `waveform` section of a recipe."""

from typing import Literal

from pydantic import Field

from labdrive.interfaces.quantities import Voltage
from labdrive.interfaces.settings import Settings


class Waveform(Settings):
    """The waveform to start from, for actuators that have a choice."""

    trajectory: Literal["ellipse", "triangle", "box"] = Field(
        description="Path of a leg's tip: ellipse (waveform 1 of the paper), triangle (2), box (3)."
    )
    amplitude: Literal["max"] | Voltage = Field(
        default="max",
        description="`max` fills the bench's voltage range; a voltage is the largest "
        "peak-to-peak of any channel, from the lower end of the range up.",
    )
    x_scale: float = Field(default=1, gt=0, le=1, description="Factor on the tip's x stroke.")
    y_scale: float = Field(default=1, gt=0, le=1, description="Factor on the tip's y stroke.")
