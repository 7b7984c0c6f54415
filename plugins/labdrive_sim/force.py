"""A simulated force sensor: what the moved part is driven with, with white noise."""

from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Reading, Samples
from labdrive.interfaces.quantities import Force
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.recording import Sampling
from labdrive_sim.noise import generators
from labdrive_sim.plant import View, plant_of


class ForceSensor:
    """Reads the force [N] along the travel that the load and the guide's friction take."""

    class Settings(SettingsBase):
        """What the instrument does to the truth."""

        link: str = Field(description="The bench's plant that the sensor is mounted on.")
        noise: Force = Field(default=0.02, ge=0, description="White, rms.")

    unit = "N"
    samplings = frozenset({Sampling.TRIGGERED})

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._context = context
        self._plant = plant_of(context, f"sensors.{context.name}.link", settings.link)

    def connect(self) -> None:
        """Nothing to open: the plant is a link of its own."""

    def close(self) -> None:
        """Nothing to release."""

    def read_at_rest(self) -> float:
        """Return what it would read now, without its noise."""
        return float(self._plant.stretch.force[-1])

    def arm(self, acquisition: Acquisition) -> None:
        """Start the noise of this recording."""
        (self._white,) = generators(self._context, acquisition, 1)
        self._view = View(self._plant)

    def read(self, samples: Samples) -> Reading:
        """Return a reading a sample."""
        white = self._settings.noise * self._white.standard_normal(len(samples.time))
        return Reading(self._view.stretch.at("force", samples.time) + white, samples.time)
