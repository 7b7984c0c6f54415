"""`groups: per_group`: first each group's gain and timing, then a phase map that both follow.

A phase map re-times what both groups do together. Where the rod runs backwards while they change,
as with the ellipse, no map that they share undoes it; but each group can be led through the change
at another place of its path, at the cost of a shorter step.
"""

from dataclasses import dataclass, field, replace

from labdrive.interfaces.optimizer import Proposal
from labdrive.model.waveform import WaveformTable
from labdrive.periodic.groups import GroupCorrection, corrected, least_slope, with_gain
from labdrive.periodic.phase_map import PhaseMap
from labdrive.periodic.response import Response

FIRST_RETIMING = 0.15
MOST_RETIMING = 0.5
MOST_ROUNDS = 3
# Of the mean slope: with less left, the map's steep places ask for harmonics that no recording has.
SLOPE_WANTED = 0.1
SLOPE_ENOUGH = 0.05
# A rod that hardly runs backwards is none that re-timing helps; limiting the map does.
HARDLY_BACKWARDS = -0.1


@dataclass(frozen=True, eq=False)
class Round:
    """A timing that was tried, with the correction to go on from and the response it gave."""

    groups: GroupCorrection
    response: Response

    @property
    def slope(self) -> float:
        """The least slope, of the mean: below 0 where the rod runs backwards."""
        return least_slope(self.response)


@dataclass(frozen=True, eq=False)
class GroupsProposal(Proposal):
    """A proposal with the groups' own corrections, and the rounds that led to them.

    `settled` says that only the phase map changes from here on.
    """

    groups: GroupCorrection = field(default_factory=GroupCorrection)
    rounds: tuple[Round, ...] = ()
    settled: bool = False


def first(nominal: WaveformTable) -> GroupsProposal:
    """Return the nominal table."""
    return GroupsProposal(nominal, PhaseMap.identity())


def prepared(
    nominal: WaveformTable, before: GroupsProposal, response: Response
) -> GroupsProposal | Round:
    """Return a proposal with another timing, or the round whose timing it shall be.

    While the response clearly runs backwards the timing changes and no map does; a timing that
    does not help is given up.
    """
    now = Round(with_gain(before.groups, response), response)
    rounds = (*before.rounds, now)
    best = max(rounds, key=lambda one: one.slope)
    enough = HARDLY_BACKWARDS if len(rounds) == 1 else SLOPE_ENOUGH
    if now.slope >= enough or best is not now or len(rounds) > MOST_ROUNDS:
        return best
    groups = replace(now.groups, retiming=_next_retiming(rounds))
    table = corrected(nominal, before.phase_map, groups)
    return replace(before, table=table, groups=groups, rounds=rounds, remark=_remark(groups))


def mapped(
    nominal: WaveformTable, groups: GroupCorrection, total: PhaseMap, remark: str
) -> GroupsProposal:
    """Return the proposal that plays `total` with the groups' corrections."""
    texts = [text for text in (_remark(groups), remark) if text]
    table = corrected(nominal, total, groups)
    return GroupsProposal(table, total, "; ".join(texts), groups, settled=True)


def _next_retiming(rounds: tuple[Round, ...]) -> float:
    """Return where the least slope should come to be `SLOPE_WANTED`, by a secant."""
    here = rounds[-1].groups.retiming
    if len(rounds) == 1:
        return FIRST_RETIMING
    rise = (rounds[-1].slope - rounds[-2].slope) / (here - rounds[-2].groups.retiming)
    return min(MOST_RETIMING, here + (SLOPE_WANTED - rounds[-1].slope) / rise)


def _remark(groups: GroupCorrection) -> str:
    return f"gain {groups.gain:.4f}, re-timed by {groups.retiming:.2f} rad"
