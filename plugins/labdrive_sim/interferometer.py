"""A simulated interferometer: white noise, random walk, drift, its own periodic error."""

from typing import Literal

import numpy as np
from pydantic import Field

from labdrive.interfaces.devices import Acquisition, DeviceContext, Reading, Samples
from labdrive.interfaces.quantities import Frequency, Length, LengthPerRootTime, Velocity
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.arrays import FloatArray
from labdrive.model.recording import Sampling
from labdrive.model.waveform import TURN
from labdrive_sim.noise import RandomWalk, generators
from labdrive_sim.plant import Quantity, Stretch, View, plant_of


class CrossTalk(SettingsBase):
    """Motion of another plant that the beam sees a share of, as with axes not quite square."""

    link: str
    share: float = Field(gt=-1, lt=1)


class Interferometer:
    """Reads the plant's position [m], latched by the actuator's clock or polled on its own."""

    class Settings(SettingsBase):
        """What the instrument does to the truth."""

        link: str = Field(description="The bench's plant that the sensor looks at.")
        axis: Literal["x", "y"] = Field(
            default="x", description="x: along the travel. y: across it, how high a rod is held."
        )
        noise: Length = Field(default=0.7e-9, ge=0, description="White, rms.")
        walk: LengthPerRootTime = Field(default=0.3e-9, ge=0, description="Random walk.")
        drift: Velocity = Field(default=0.0, description="Constant.")
        periodic_error: Length = Field(default=0.0, ge=0, description="Its own, amplitude.")
        period: Length = Field(default=316.4e-9, gt=0, description="Of its own periodic error.")
        cross_talk: tuple[CrossTalk, ...] = Field(default=(), description="Of other plants.")
        sampling: Literal["triggered", "polled"] = "triggered"
        poll_rate: Frequency = Field(default=1000.0, gt=0, description="When polled.")
        jitter: float = Field(
            default=0.5, ge=0, lt=1, description="When polled: spread of the interval, as a share."
        )

    unit = "m"

    def __init__(self, settings: Settings, context: DeviceContext) -> None:
        self._settings = settings
        self._context = context
        field = f"sensors.{context.name}"
        self._plant = plant_of(context, f"{field}.link", settings.link)
        self._others = [
            (plant_of(context, f"{field}.cross_talk.{i}.link", one.link), one.share)
            for i, one in enumerate(settings.cross_talk)
        ]

    @property
    def samplings(self) -> frozenset[Sampling]:
        """As set."""
        return frozenset({Sampling(self._settings.sampling)})

    @property
    def periods(self) -> tuple[float, ...]:
        """The period of its own error, if it has one [m]."""
        return (self._settings.period,) if self._settings.periodic_error else ()

    def connect(self) -> None:
        """Nothing to open: the plant is a link of its own."""

    def close(self) -> None:
        """Nothing to release."""

    def arm(self, acquisition: Acquisition) -> None:
        """Start the noise of this recording."""
        self._white, walk, clock = generators(self._context, acquisition, 3)
        self._walk = RandomWalk(self._settings.walk, walk)
        self._clock = _JitteredClock(self._settings.poll_rate, self._settings.jitter, clock)
        self._views = [(View(self._plant), 1.0)]
        self._views += [(View(plant), share) for plant, share in self._others]

    def read(self, samples: Samples) -> Reading:
        """Return a reading a sample, or those whose time has come where it is polled."""
        if self._settings.sampling == "triggered":
            known = [(view.stretch, share) for view, share in self._views]
            return self._reading(known, samples.time)
        known = [(view.recent(), share) for view, share in self._views]
        return self._reading(known, self._clock.until(float(samples.time[-1])))

    def _reading(self, known: list[tuple[Stretch, float]], time: FloatArray) -> Reading:
        """Return the readings at `time`, of the plants' steps and the shares that are seen."""
        settings = self._settings
        seen: Quantity = "position" if settings.axis == "x" else "height"
        position = sum(share * stretch.at(seen, time) for stretch, share in known)
        own = settings.periodic_error * np.sin(TURN * position / settings.period)
        white = settings.noise * self._white.standard_normal(len(time))
        noisy = position + own + settings.drift * time + self._walk.at(time) + white
        return Reading(np.asarray(noisy), time)


class _JitteredClock:
    """Instants one after another, each somewhere in its interval."""

    def __init__(self, rate_hz: float, jitter: float, generator: np.random.Generator) -> None:
        self._rate_hz = rate_hz
        self._jitter = jitter
        self._generator = generator
        self._count = 0
        self._drawn: FloatArray = np.zeros(0)

    def until(self, time: float) -> FloatArray:
        """Return the instants up to `time` [s] that were not returned before."""
        count = max(self._count, 1 + int(time * self._rate_hz))
        late = self._jitter * self._generator.random(count - self._count)
        instants = (np.arange(self._count, count) + late) / self._rate_hz
        known = np.append(self._drawn, instants)
        self._count, self._drawn = count, known[known > time]
        return np.asarray(known[known <= time])
