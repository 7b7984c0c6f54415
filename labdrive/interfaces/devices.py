"""What actuators, sensors and links are: roles a plain class fills by having these methods.

Constructors touch no hardware: benches are built to be checked far more often than to be run.
All commands move to a state and may be repeated; `close` and `make_safe` must work at any time
after construction, connected or not.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from pydantic import BaseModel

from labdrive.interfaces.limits import Limits
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Motion
from labdrive.model.recording import Sampling
from labdrive.model.waveform import WaveformTable
from labdrive.periodic.trajectories import Trajectory


@dataclass(frozen=True)
class DeviceContext:
    """What a device is told besides its settings.

    `links` are the bench's, by name, in the order of the bench file. `seed` is the run's: noise
    of a simulated recording must come from a generator seeded by (seed, recording number, device).
    `trajectories` are the installed ones by name. `ask` puts a question to the person at the
    bench and returns the answer; None where nobody is there.
    """

    name: str
    limits: Limits
    links: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    folder: Path = field(default_factory=Path)
    trajectories: Mapping[str, Trajectory] = field(default_factory=dict)
    ask: Callable[[str], str] | None = None


@dataclass(frozen=True)
class Acquisition:
    """One motion to be played and read. `number` is its recording's, counted from 1 in a run."""

    number: int
    motion: Motion


@dataclass(frozen=True, eq=False)
class Samples:
    """Instants of a motion that have come to pass.

    `phase` [rad] and `time` [s since the motion began], shape (n,). `settling` says that they
    belong to cycles that are watched but not recorded; all of a chunk is of one sort.
    """

    phase: FloatArray
    time: FloatArray
    settling: bool = False


@dataclass(frozen=True, eq=False)
class Reading:
    """What a sensor read: `value` [the sensor's unit] at `time` [s since the motion began]."""

    value: FloatArray
    time: FloatArray


class Link(Protocol):
    """A connection that several devices share."""

    @property
    def Settings(self) -> type[BaseModel]:
        """A class attribute: the pydantic model of the settings."""

    def __init__(self, settings: Any, context: DeviceContext) -> None:
        """Keep the settings; touch nothing."""

    def connect(self) -> None:
        """Open the connection; DeviceError if nobody answers."""

    def close(self) -> None:
        """Close it, connected or not."""


class Actuator(Protocol):
    """Plays a waveform table, commanded by a phase."""

    @property
    def Settings(self) -> type[BaseModel]:
        """A class attribute: the pydantic model of the settings."""

    def __init__(self, settings: Any, context: DeviceContext) -> None:
        """Keep the settings; touch nothing."""

    @property
    def sampling(self) -> Sampling:
        """`triggered` if the actuator's clock latches the sensors, else `polled`."""

    @property
    def position_unit(self) -> str:
        """The unit of travel: m or rad."""

    @property
    def max_samples_per_period(self) -> int | None:
        """The most samples a cycle the actuator can clock, None if nothing bounds it."""

    @property
    def fixed_motion(self) -> Motion | None:
        """The only motion there is, where nothing can be driven (a recording); else None."""

    def nominal_table(self, waveform: Waveform | None) -> WaveformTable:
        """Return the uncorrected table, within the bench's limits. Pure: needs no connection.

        `waveform` is the recipe's, None where it gives none. InputError if it does not fit.
        """

    def travel_per_period(self, table: WaveformTable) -> float:
        """Return the travel expected of one cycle [position_unit]. Pure: plans are made with it."""

    def check(self, motion: Motion) -> None:
        """Refuse, by InputError, a motion that cannot be played. Pure: plans are held to it."""

    def connect(self) -> None:
        """Open the device; DeviceError if it does not answer."""

    def close(self) -> None:
        """Release the device, connected or not."""

    def reference(self) -> None:
        """Bring the actuator to a known state, whatever was sent before.

        Called before every recording, so quick where the state is known already.
        """

    def load(self, table: WaveformTable) -> None:
        """Make `table` the one to play, without a jump of any output."""

    def play(self, acquisition: Acquisition) -> Generator[Samples, None, None]:
        """Walk the motion with the loaded table; yield its samples as they come to pass.

        First those of the settling cycles, then the recorded ones. What it takes to get up to speed
        and to slow down is settling, too: limits are held on every chunk. Whoever iterates may stop
        at any chunk: closing the iterator halts the motion.
        """

    def make_safe(self) -> None:
        """Stop and leave the actuator where it can harm nothing; never raises for repetition."""


@runtime_checkable
class HasLegs(Protocol):
    """What an actuator with legs can say besides."""

    def tips(self, table: WaveformTable) -> Mapping[str, FloatArray]:
        """Return where the linear model of the legs has the tips at the table's entries [m].

        `x_A`, `y_A`, `x_B`, `y_B`, each of shape (table.length,). Pure.
        """

    def mirrored(self, table: WaveformTable) -> WaveformTable:
        """Return the table that, its phase falling, moves the legs as `table` does in a mirror."""


@runtime_checkable
class Relives(Protocol):
    """What a simulated actuator can do besides: a real one is still where it was left."""

    def relive(self, motion: Motion) -> None:
        """Walk a motion that an earlier process had finished, with the loaded table, unread."""


@runtime_checkable
class RelivesLoad(Protocol):
    """The same for a simulated load."""

    def relive(self, force: float) -> None:
        """Bear a load [N] that an earlier process had set."""


@runtime_checkable
class HasPeriods(Protocol):
    """What a sensor with a periodic error of its own can say besides."""

    @property
    def periods(self) -> Sequence[float]:
        """Travel over which each of its own periodic errors repeats [the sensor's unit]."""


@runtime_checkable
class ReadsAtRest(Protocol):
    """What a sensor that can be read while nothing moves can say besides."""

    def read_at_rest(self) -> float:
        """Return the reading now [the sensor's unit]; DeviceError if it does not come."""


class Load(Protocol):
    """Puts an external force on the bench's actuator: a weight, a stage with a spring, a model."""

    @property
    def Settings(self) -> type[BaseModel]:
        """A class attribute: the pydantic model of the settings."""

    def __init__(self, settings: Any, context: DeviceContext) -> None:
        """Keep the settings; touch nothing."""

    @property
    def needs_person(self) -> bool:
        """True if somebody has to be there; an unattended run refuses such a bench."""

    def connect(self) -> None:
        """Open the device; DeviceError if it does not answer."""

    def close(self) -> None:
        """Release the device, connected or not."""

    def apply(self, force: float) -> float:
        """Put `force` [N] against the travel while nothing moves; return what it came to [N].

        A weight pulls against forward travel, a friction pair against either. DeviceError if the
        force cannot be had.
        """

    def make_safe(self) -> None:
        """Take the force away if the device can; never raises for repetition."""


class Sensor(Protocol):
    """Reads one quantity."""

    @property
    def Settings(self) -> type[BaseModel]:
        """A class attribute: the pydantic model of the settings."""

    def __init__(self, settings: Any, context: DeviceContext) -> None:
        """Keep the settings; touch nothing."""

    @property
    def unit(self) -> str:
        """SI unit of the readings: m, rad, N, K, V."""

    @property
    def samplings(self) -> frozenset[Sampling]:
        """The kinds of sampling the sensor can take part in."""

    def connect(self) -> None:
        """Open the device; DeviceError if it does not answer."""

    def close(self) -> None:
        """Release the device, connected or not."""

    def arm(self, acquisition: Acquisition) -> None:
        """Get ready for a motion; what was read before is dropped."""

    def read(self, samples: Samples) -> Reading:
        """Return the readings that belong to a chunk.

        Triggered: exactly one a sample, at the sample's time. Polled: those taken during the
        chunk, each with a time of its own.
        """
