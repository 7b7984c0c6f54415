"""The devices of a bench: built from its file, connected in order, left safe whatever happens."""

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from labdrive.engine.sensing import own_clock
from labdrive.interfaces.devices import Actuator, DeviceContext, HasLegs, Link, Load, Sensor
from labdrive.interfaces.experiment import Tables
from labdrive.interfaces.interlocks import Interlock
from labdrive.interfaces.limits import Limits
from labdrive.interfaces.optimizer import ChecksSampling, Optimizer
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.interfaces.waveform import Waveform
from labdrive.model.arrays import FloatArray
from labdrive.model.errors import LabdriveError, RunInterruptedError
from labdrive.model.motion import Motion
from labdrive.model.recording import Sampling
from labdrive.model.waveform import WaveformTable

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Devices:
    """A bench's devices, built but not connected; `actuator` is the one the recipe drives."""

    links: Mapping[str, Link]
    actuators: Mapping[str, Actuator]
    sensors: Mapping[str, Sensor]
    limits: Limits
    actuator_name: str
    optimizers: Mapping[str, type[Optimizer]]
    bench_load: Load | None = None
    interlocks: tuple[Interlock, ...] = ()

    @property
    def actuator(self) -> Actuator:
        """The actuator that the recipe drives."""
        return self.actuators[self.actuator_name]

    @property
    def position_unit(self) -> str:
        """Unit of the actuator's travel: m or rad."""
        return self.actuator.position_unit

    @property
    def max_samples_per_period(self) -> int | None:
        """The most samples a cycle the actuator can clock, None if nothing bounds it."""
        return self.actuator.max_samples_per_period

    @property
    def sampling(self) -> Sampling:
        """How the samples of a recording will come about."""
        sampling = self.actuator.sampling
        return Sampling.POLLED if own_clock(sampling, self.sensors) else sampling

    @property
    def fixed_motion(self) -> Motion | None:
        """The only motion there is, where nothing can be driven (a recording); else None."""
        return self.actuator.fixed_motion

    def nominal_table(self, waveform: Waveform | None) -> WaveformTable:
        """Return the actuator's uncorrected table."""
        return self.actuator.nominal_table(waveform)

    def travel_per_period(self, table: WaveformTable) -> float:
        """Return the travel expected of one cycle."""
        return self.actuator.travel_per_period(table)

    def tips(self, table: WaveformTable) -> Mapping[str, FloatArray]:
        """Return the tips of the legs; nothing for actuators without legs."""
        return self.actuator.tips(table) if isinstance(self.actuator, HasLegs) else {}

    def mirrored(self, table: WaveformTable) -> WaveformTable | None:
        """Return the table for travel the other way; None for actuators without legs."""
        return self.actuator.mirrored(table) if isinstance(self.actuator, HasLegs) else None

    def of(self, actuator: str) -> "Devices":
        """Return the same devices with another actuator to drive."""
        return replace(self, actuator_name=actuator)

    @property
    def has_load(self) -> bool:
        """True if the bench can put an external force on the actuator."""
        return self.bench_load is not None

    def played(self, tables: Tables) -> dict[str, WaveformTable]:
        """Return the tables by actuator."""
        if isinstance(tables, WaveformTable):
            return {self.actuator_name: tables}
        return dict(tables)

    def sensor_unit(self, sensor: str) -> str:
        """Return the SI unit of a sensor."""
        return self.sensors[sensor].unit

    def optimizer(self, settings: Any, nominal: WaveformTable) -> Optimizer:
        """Return the optimizer that a recipe's `optimizer` section names, for this table."""
        optimizer: Optimizer = self.optimizers[settings.use](settings, nominal)
        if isinstance(optimizer, ChecksSampling):
            optimizer.check_sampling(self.sampling)
        return optimizer

    def misfits(self) -> Iterator[str]:
        """Yield why the sensors' samples could not be aligned with the phase, if they cannot."""
        clocked = own_clock(self.actuator.sampling, self.sensors)
        if clocked and len(self.sensors) > 1:
            others = ", ".join(name for name in self.sensors if name != clocked[0])
            yield (
                f"sensor {clocked[0]} is polled on a clock of its own, so its readings cannot be "
                f"aligned with those of {others}; trigger it, or put it on a bench by itself"
            )
        for name, sensor in self.sensors.items():
            if not clocked and self.actuator.sampling not in sensor.samplings:
                yield f"sensor {name} cannot be {self.actuator.sampling} by {self.actuator_name}"


def build(  # noqa: PLR0913 what a bench is built from
    bench: Any,
    plugins: PluginSet,
    actuator: str,
    seed: int,
    folder: Path,
    ask: Callable[[str], str] | None = None,
) -> Devices:
    """Construct every device of a validated bench; touches no hardware.

    `actuator` is the name of the one to drive, `folder` that of the bench file; `ask` reaches the
    person at the bench.
    """
    limits: Limits = bench.limits

    def one(role: str, name: str, settings: Any, links: Mapping[str, Link]) -> Any:
        context = DeviceContext(name, limits, links, seed, folder, plugins.trajectories, ask)
        return plugins.role(role)[settings.plugin](settings, context)

    def make(role: str, links: Mapping[str, Link]) -> Iterator[tuple[str, Any]]:
        for name, settings in getattr(bench, role).items():
            yield name, one(role, name, settings, links)

    links: dict[str, Link] = dict(make("links", {}))
    return Devices(
        links=links,
        actuators=dict(make("actuators", links)),
        sensors=dict(make("sensors", links)),
        limits=limits,
        actuator_name=actuator,
        optimizers=plugins.optimizers,
        interlocks=bench.interlocks,
        bench_load=one("loads", "load", bench.load, links) if bench.load else None,
    )


@contextmanager
def connected(devices: Devices) -> Iterator[None]:
    """Connect links, sensors and actuators; make every actuator safe and close all in the end.

    Whatever ends the block, each actuator that was asked to connect gets `make_safe`, even if
    another device fails in the same breath; closing goes in the reverse order of connecting.
    """
    with ExitStack() as stack:
        for device in (*devices.links.values(), *devices.sensors.values()):
            stack.callback(_quietly, device.close)
            device.connect()
        if devices.bench_load is not None:
            stack.callback(_quietly, devices.bench_load.close)
            stack.callback(_quietly, devices.bench_load.make_safe)
            devices.bench_load.connect()
        for actuator in devices.actuators.values():
            stack.callback(_quietly, actuator.close)
            stack.callback(_quietly, actuator.make_safe)
            actuator.connect()
        yield


def made_safe(devices: Devices) -> dict[str, str]:
    """Stop whatever may be moving, as fast as that goes; return what failed, by device.

    Actuators come first, and none waits for another that fails. Sensors are left alone: one that
    is dead may be why this is needed.
    """
    failed: dict[str, str] = {}

    def tried(name: str, *steps: Callable[[], object]) -> None:
        for step in steps:
            try:
                step()
            except (Exception, SystemExit) as error:
                log.exception("%s", name)
                failed[name] = str(error)

    with ExitStack() as stack:
        for name, link in devices.links.items():
            stack.callback(_quietly, link.close)
            tried(name, link.connect)
        for name, actuator in devices.actuators.items():
            stack.callback(_quietly, actuator.close)
            tried(name, actuator.connect, actuator.make_safe)
        if (load := devices.bench_load) is not None:
            stack.callback(_quietly, load.close)
            tried("load", load.connect, load.make_safe)
    return failed


def _quietly(release: Any) -> None:
    """Run one release; a failure is logged so that the releases after it still happen.

    One that a signal cut short is run again: later signals are ignored.
    """
    try:
        release()
    except RunInterruptedError:
        _quietly(release)
    except LabdriveError as error:
        log.warning("%s failed: %s", getattr(release, "__qualname__", release), error)
    except (Exception, SystemExit):
        log.exception("%s failed", getattr(release, "__qualname__", release))
