"""What is worth knowing of a plan that is allowed: conditions on trajectories, and warnings."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from labdrive.engine.fields import fields_of
from labdrive.engine.plan import Prepared
from labdrive.interfaces.devices import HasPeriods
from labdrive.interfaces.experiment import PlannedRecording
from labdrive.interfaces.plugin_set import PluginSet
from labdrive.interfaces.waveform import Waveform
from labdrive.model.units import format_si
from labdrive.model.waveform import WaveformTable
from labdrive.periodic.conditions import Condition, conditions

# A harmonic of the waveform that moves anything: this share of the largest.
NOTABLE = 0.01


def trajectory_remarks(prepared: Prepared, plugins: PluginSet) -> Iterator[tuple[str, str]]:
    """Yield (trajectory, what is to be said of the five conditions) for each in the recipe."""
    told: set[str] = set()
    for field in fields_of(prepared.loaded.recipe):
        several = field.value if isinstance(field.value, tuple) else (field.value,)
        for waveform in several:
            if isinstance(waveform, Waveform) and waveform.trajectory not in told:
                told.add(waveform.trajectory)
                name = Path(waveform.trajectory).name
                for text in _told(conditions(waveform.path(plugins.trajectories))):
                    yield name, text


def _told(found: list[Condition]) -> Iterator[str]:
    broken = [condition for condition in found if not condition.holds]
    if not broken:
        yield "all five conditions on a trajectory hold"
    for one in broken:
        yield f"condition {one.number} does not hold ({one.asks}): {one.found}"


def warnings(prepared: Prepared) -> Iterator[str]:
    """Yield what may spoil the result, with a remedy."""
    told: set[str] = set()
    for planned in prepared.plan.recordings:
        for text in (*_resonance(prepared, planned), *_shared_periods(prepared, planned)):
            if text not in told:
                told.add(text)
                yield text
    yield from _corrections(prepared)


def _resonance(prepared: Prepared, planned: PlannedRecording) -> Iterator[str]:
    """Yield a warning where the waveform's harmonics come up to the bench's lowest resonance."""
    resonance, rate = prepared.devices.limits.lowest_resonance, planned.motion.period_rate_hz
    if resonance is None:
        return
    tables = prepared.devices.played(planned.table).values()
    highest = max(_highest_harmonic(table) for table in tables)
    if highest * rate >= resonance:
        slow = format_si(resonance / highest, "Hz", 3)
        yield (
            f"harmonic {highest} of the waveform is at {format_si(highest * rate, 'Hz', 3)}, not "
            f"below the bench's lowest resonance of {format_si(resonance, 'Hz', 3)}; take a "
            f"period_rate below {slow}"
        )


def _corrections(prepared: Prepared) -> Iterator[str]:
    """Yield a warning where corrections may play harmonics beyond the lowest resonance."""
    recipe, resonance = prepared.loaded.recipe, prepared.devices.limits.lowest_resonance
    settings, motion = getattr(recipe, "optimizer", None), getattr(recipe, "motion", None)
    if resonance is None or settings is None or motion is None:
        return
    highest = getattr(settings, "harmonics", None) or motion.samples_per_period // 2 - 1
    if highest * motion.period_rate >= resonance:
        below = int(np.ceil(resonance / motion.period_rate)) - 1
        yield (
            f"corrections may play harmonics up to {highest}, at "
            f"{format_si(highest * motion.period_rate, 'Hz', 3)}; the bench's lowest resonance is "
            f"{format_si(resonance, 'Hz', 3)}: set optimizer.harmonics to {below} or fewer"
        )


def _highest_harmonic(table: WaveformTable) -> int:
    """Return the highest harmonic of any channel that moves anything."""
    phase = np.arange(table.length) / table.length
    highest = 1
    for channel in table.channels:
        spectrum = np.abs(np.fft.rfft(channel.samples - channel.advance * phase))[1:]
        notable = np.flatnonzero(spectrum > NOTABLE * spectrum.max(initial=0))
        highest = max(highest, int(notable.max(initial=0)) + 1)
    return highest


def _shared_periods(prepared: Prepared, planned: PlannedRecording) -> Iterator[str]:
    """Yield a warning where a sensor's own periodic error repeats with the actuator's steps."""
    devices, cycles = prepared.devices, planned.motion.periods
    for actuator, table in devices.played(planned.table).items():
        step = abs(devices.actuators[actuator].travel_per_period(table))
        for name, sensor in devices.sensors.items():
            if not isinstance(sensor, HasPeriods) or not step:
                continue
            for period in sensor.periods:
                ratio = max(step / period, period / step)
                if cycles and abs(ratio - round(ratio)) < 1 / cycles:
                    yield (
                        f"{name} has an error of its own every {format_si(period, 'm', 4)}, and "
                        f"{format_si(step, 'm', 4)} steps fit it {round(ratio)} to 1 within one "
                        f"part in {cycles} cycles: the two cannot be told apart; take another "
                        "step size, more periods, or a second sensor"
                    )
