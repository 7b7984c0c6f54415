"""`optimize_drives`: several drives of one bench, one after the other or all together."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from labdrive.experiments.entry import entry
from labdrive.experiments.iterate import (
    Iteration,
    Loop,
    Optimized,
    Stop,
    Tuner,
    finer,
    refuse_recordings,
    summary,
)
from labdrive.experiments.waveform_list import in_place_of
from labdrive.interfaces.experiment import Bench, PlannedRecording, Setup
from labdrive.interfaces.motion import MotionSettings
from labdrive.interfaces.settings import ActuatorName, PluginSlot, SensorName
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.interfaces.waveform import Waveform
from labdrive.model.motion import Motion
from labdrive.model.recording import Recording, Sampling
from labdrive.model.waveform import WaveformTable
from labdrive.periodic.estimate import estimate
from labdrive.periodic.response import Response


class Drive(SettingsBase):
    """A drive and the sensor that sees its motion."""

    actuator: ActuatorName
    sensor: SensorName
    waveform: Waveform | None = Field(
        default=None, description="For actuators with a choice of waveform."
    )


def _each_once(drives: tuple[Drive, ...]) -> tuple[Drive, ...]:
    names = [drive.actuator for drive in drives]
    if len(set(names)) < len(names):
        raise ValueError("must name every actuator once")
    return drives


class OptimizeDrives:
    """Optimizes every drive, verifies them in one walk, and moves each alone for the cross-talk."""

    class Settings(SettingsBase):
        """Settings of the optimization; all drives walk the same motion."""

        drives: Annotated[tuple[Drive, ...], AfterValidator(_each_once)] = Field(min_length=2)
        order: Literal["one_after_the_other", "together"] = Field(
            default="one_after_the_other",
            description="together: all walk in step, so each corrects what it sees of the others.",
        )
        motion: MotionSettings
        optimizer: Annotated[SettingsBase, PluginSlot("optimizers", key="use")]
        stop: Stop = Field(default_factory=Stop)
        verification_factor: int = Field(
            default=4, ge=1, description="Samples per period of the verification, as a multiple."
        )

    def __init__(self, settings: Any) -> None:
        self._settings = settings

    def plan(self, setup: Setup) -> list[PlannedRecording]:
        """Return the most this can come to."""
        settings = self._settings
        tables = self._nominal(setup)
        for name, table in tables.items():
            refuse_recordings(setup.of(name))
            setup.optimizer(settings.optimizer, table)
        motion, back = settings.motion.motion(), settings.motion.return_to_start
        finest = self._verification_motion(setup)
        alone = [PlannedRecording(f"{n} alone", motion, {n: t}, 1, back) for n, t in tables.items()]
        if settings.order == "together":
            times = settings.stop.max_iterations + 1
            loops = [PlannedRecording("iteration", motion, tables, times, back)]
        else:
            loops = [
                self._loop(drive).planned(tables[drive.actuator], f"{drive.actuator} iteration")
                for drive in settings.drives
            ]
        return [*loops, PlannedRecording("verification", finest, tables, 1, back), *alone]

    def run(self, bench: Bench) -> Mapping[str, Any]:
        """Optimize, verify all together, move each alone; return errors and cross-talk."""
        settings = self._settings
        together = settings.order == "together"
        done = self._together(bench) if together else self._in_turn(bench)
        best = {name: optimized.best.proposal.table for name, optimized in done.items()}
        recording = self._record(
            bench, best, "verification", self._verification_motion(bench.setup)
        )
        verified = {
            drive.actuator: _judged(done[drive.actuator], recording, drive.sensor)
            for drive in settings.drives
        }
        for name, tried in verified.items():
            bench.note(summary(f"{name} verification", tried.response))
        entries = [_drive(drive, done, verified) for drive in settings.drives]
        return {
            "kind": "optimize_drives",
            "unit": entries[0]["unit"],
            "order": settings.order,
            "drives": entries,
            "cross_talk": self._cross_talk(bench, best),
        }

    def _in_turn(self, bench: Bench) -> dict[str, Optimized]:
        tables = self._nominal(bench.setup)
        return {
            drive.actuator: self._loop(drive).run(bench, tables[drive.actuator], drive.actuator)
            for drive in self._settings.drives
        }

    def _together(self, bench: Bench) -> dict[str, Optimized]:
        """Walk all drives in step until none has an update left; those that stopped walk on."""
        settings, setup = self._settings, bench.setup
        tables = self._nominal(setup)
        tuners = {
            d.actuator: Tuner(
                setup.optimizer(settings.optimizer, tables[d.actuator]),
                d.sensor,
                settings.stop,
                d.actuator,
            )
            for d in settings.drives
        }
        number = 0
        while not all(tuner.stopped for tuner in tuners.values()):
            played = {name: tuner.proposal.table for name, tuner in tuners.items()}
            recording = self._record(bench, played, f"iteration {number}")
            for name, tuner in tuners.items():
                if not tuner.stopped:
                    tuner.take(bench, setup.of(name), recording)
            number += 1
        return {name: tuner.optimized for name, tuner in tuners.items()}

    def _cross_talk(
        self, bench: Bench, tables: Mapping[str, WaveformTable]
    ) -> list[dict[str, Any]]:
        """Move each drive alone; return what every sensor sees of it."""
        found = []
        for moved in self._settings.drives:
            name = moved.actuator
            recording = self._record(bench, {name: tables[name]}, f"{name} alone")
            found += _seen(recording, name, moved.sensor, self._settings.drives)
        return found

    def _record(
        self,
        bench: Bench,
        tables: Mapping[str, WaveformTable],
        label: str,
        motion: Motion | None = None,
    ) -> Recording:
        settings = self._settings.motion
        return bench.record(
            motion or settings.motion(), tables, label, return_to_start=settings.return_to_start
        )

    def _loop(self, drive: Drive) -> Loop:
        settings = self._settings
        return Loop(
            settings.motion, drive.sensor, settings.optimizer, settings.stop, drive.actuator
        )

    def _nominal(self, setup: Setup) -> dict[str, WaveformTable]:
        tables = {}
        for i, drive in enumerate(self._settings.drives):
            with in_place_of("waveform", f"drives.{i}.waveform"):
                tables[drive.actuator] = setup.of(drive.actuator).nominal_table(drive.waveform)
        return tables

    def _verification_motion(self, setup: Setup) -> Motion:
        """Return the motion sampled as finely as every drive can clock."""
        motion: Motion = self._settings.motion.motion()
        factor = self._settings.verification_factor
        motions = [finer(motion, setup.of(d.actuator), factor) for d in self._settings.drives]
        return min(motions, key=lambda one: one.samples_per_period)


def _judged(done: Optimized, recording: Recording, sensor: str) -> Iteration:
    return Iteration(done.best.proposal, recording, done.optimizer.estimate(recording, sensor))


def _drive(
    drive: Drive, done: Mapping[str, Optimized], verified: Mapping[str, Iteration]
) -> dict[str, Any]:
    optimized, tried = done[drive.actuator], verified[drive.actuator]
    return {
        "actuator": drive.actuator,
        "sensor": drive.sensor,
        "unit": tried.response.unit,
        **optimized.result(),
        "verification": entry(tried.response, tried.recording),
        "improvement": optimized.iterations[0].rms / tried.rms,
    }


def _seen(
    recording: Recording, moved: str, own_sensor: str, drives: Sequence[Drive]
) -> list[dict[str, Any]]:
    """Return what each sensor saw while one drive moved alone.

    `share` is a sensor's travel over that of the moved drive's own; `periodic_error` what it saw
    repeat each cycle.
    """
    responses = {drive.sensor: _response(recording, drive.sensor) for drive in drives}
    travel = responses[own_sensor].step_size
    return [
        {
            "moved": moved,
            "sensor": sensor,
            "share": response.step_size / travel,
            "share_standard_error": response.step_size_standard_error / abs(travel),
            "periodic_error": {
                "pv": response.periodic_error.pv,
                "rms": response.periodic_error.rms,
            },
            "noise_floor": {"rms": response.noise_floor_rms},
        }
        for sensor, response in responses.items()
    ]


def _response(recording: Recording, sensor: str) -> Response:
    polled = recording.sampling is Sampling.POLLED
    return estimate(recording, sensor, estimator="least_squares" if polled else "exact")
