"""The paper's method: filter the response to harmonics, invert it, compose the phase maps."""

from typing import Literal

from pydantic import Field

from labdrive.interfaces.legs_file import read_legs
from labdrive.interfaces.optimizer import Proposal
from labdrive.interfaces.quantities import InputFile
from labdrive.interfaces.settings import Settings as SettingsBase
from labdrive.model.errors import InputError, NonMonotonicError, Problem
from labdrive.model.recording import Recording, Sampling
from labdrive.model.waveform import TURN, WaveformTable
from labdrive.periodic.estimate import estimate
from labdrive.periodic.linearize import half_period_symmetric, linearizing_map
from labdrive.periodic.phase_map import PhaseMap
from labdrive.periodic.response import Response
from labdrive.periodic.warp import Groups, warp
from labdrive_optimizers import per_group
from labdrive_optimizers.per_group import GroupsProposal


class FourierOptimizer:
    """Solves A(psi(phi)) = c_0 phi / 2 pi for each recording; maps compose, newest innermost."""

    class Settings(SettingsBase):
        """Settings of the method."""

        estimator: Literal["exact", "paper", "least_squares"] = Field(
            default="exact",
            description="exact: differences divided by their own transfer function. paper: the "
            "formula as printed. least_squares: on real phases, for polled or jittered data.",
        )
        groups: Literal["shared_phase", "shared_table", "symmetric", "per_group"] = Field(
            default="shared_phase",
            description="Where the second group of legs takes its phase from. shared_phase: both "
            "follow one map. shared_table: it plays the first group's table half a cycle later. "
            "symmetric: the map repeats every half cycle. per_group: both follow one map, each "
            "with a gain of its own, re-timed so that both move forward where they change.",
        )
        on_nonmonotonic: Literal["error", "limit"] = Field(
            default="error",
            description="What to do where the response runs backwards: stop with an error that "
            "names the phases, or limit the correction there.",
        )
        shrink: bool = Field(
            default=True,
            description="Correct each harmonic only by what stands out of its noise, so that the "
            "noise of a recording is not written into the table.",
        )
        least_slope: float = Field(
            default=0.05, gt=0, lt=1, description="For `limit`: least slope, of the mean."
        )
        harmonics: int | None = Field(
            default=None, ge=1, description="Highest harmonic corrected; all there are by default."
        )
        drift_order: int = Field(
            default=1, ge=0, le=8, description="For least_squares: polynomial drift removed."
        )

        start: Literal["nominal", "inverse_hysteresis"] = Field(
            default="nominal",
            description="inverse_hysteresis: begin with voltages that make up for the hysteresis "
            "in `legs`.",
        )
        legs: InputFile | None = Field(
            default=None, description="The legs.json of an identify_legs run."
        )

    def __init__(self, settings: Settings, nominal: WaveformTable) -> None:
        self._settings = settings
        self._nominal = _started(settings, nominal)
        if settings.groups != "shared_phase" and len(nominal.group_phases) == 1:
            raise InputError(
                Problem(
                    "this actuator has a single group, so only shared_phase applies",
                    field="optimizer.groups",
                    got=settings.groups,
                )
            )

    def check_sampling(self, sampling: Sampling) -> None:
        """Refuse polled recordings for the estimators that need equidistant phases."""
        estimator = self._settings.estimator
        if sampling is Sampling.POLLED and estimator != "least_squares":
            message = "phases will not be equidistant on this bench; use least_squares"
            raise InputError(Problem(message, "optimizer.estimator", got=estimator))

    def first(self) -> Proposal:
        """Return the table to start with: the nominal one, or one compensated for hysteresis."""
        if self._settings.groups == "per_group":
            return per_group.first(self._nominal)
        return Proposal(self._nominal, PhaseMap.identity())

    def estimate(self, recording: Recording, sensor: str) -> Response:
        """Return the response that `sensor` saw."""
        settings = self._settings
        return estimate(
            recording,
            sensor,
            estimator=settings.estimator,
            drift_order=settings.drift_order,
            harmonics=settings.harmonics,
        )

    def next(self, tried: Proposal, response: Response) -> Proposal:
        """Return the table whose phase map also undoes what this response still shows."""
        settings = self._settings
        if settings.shrink:
            response = response.shrunk()
        if isinstance(tried, GroupsProposal):
            return self._next_per_group(tried, response)
        if settings.groups == "symmetric":
            response = half_period_symmetric(response)
        update, remark = self._update(response)
        total = tried.phase_map.after(update)
        follow: Groups = "shared_table" if settings.groups == "shared_table" else "shared_phase"
        return Proposal(warp(self._nominal, total, follow), total, remark)

    def _next_per_group(self, tried: GroupsProposal, response: Response) -> Proposal:
        """Return another timing of the groups, or the map once gain and timing stand.

        The first map leaves odd harmonics alone: the gain, which changes with it, should undo them.
        """
        groups, kept = tried.groups, response
        if not tried.settled:
            ready = per_group.prepared(self._nominal, tried, response)
            if isinstance(ready, GroupsProposal):
                return ready
            groups, kept = ready.groups, half_period_symmetric(ready.response)
        update, remark = self._update(kept)
        total = tried.phase_map.after(update)
        return per_group.mapped(self._nominal, groups, total, remark)

    def _update(self, response: Response) -> tuple[PhaseMap, str]:
        """Return the map that undoes the response and, if it had to be limited, how much."""
        try:
            return linearizing_map(response), ""
        except NonMonotonicError as error:
            if self._settings.on_nonmonotonic == "error":
                raise
            share = sum(end - start for start, end in error.phases) / TURN
            remark = f"limited over {share:.1%} of the cycle"
            return linearizing_map(response, "limit", self._settings.least_slope), remark


def _started(settings: FourierOptimizer.Settings, nominal: WaveformTable) -> WaveformTable:
    """Return the table that phase maps apply to."""
    if settings.start == "nominal":
        return nominal
    if settings.legs is None:
        message = "missing: inverse_hysteresis needs the legs.json of an identify_legs run"
        raise InputError(Problem(message, "optimizer.legs"))
    if any(channel.unit != "V" for channel in nominal.channels):
        message = "this actuator is not driven by voltages, so has no such hysteresis"
        raise InputError(Problem(message, "optimizer.start", got=settings.start))
    plays = read_legs(settings.legs).plays
    return nominal.with_samples(tuple(plays.compensated(c.samples) for c in nominal.channels))
