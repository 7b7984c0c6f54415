"""Check a recipe and its bench, and print what a run would do; nothing moves."""

import argparse
from datetime import timedelta
from typing import TYPE_CHECKING

from labdrive.cli import recipe_arguments

if TYPE_CHECKING:
    from labdrive.engine.plan import Plan, Prepared


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    recipe_arguments.add_arguments(parser)


def execute(options: argparse.Namespace) -> int:
    """Print the plan; every problem found is raised as one InputError."""
    from labdrive.engine.remarks import trajectory_remarks, warnings

    prepared, host = recipe_arguments.prepare(options)
    print("\n".join(describe(prepared)))
    for trajectory, text in trajectory_remarks(prepared, host.plugins):
        print(f"  {trajectory:<15} {text}")
    for text in warnings(prepared):
        print(f"  warning         {text}")
    return 0


def describe(prepared: "Prepared") -> list[str]:
    """Return the plan in words, a line an entry."""
    recipe, plan = prepared.loaded.recipe, prepared.plan
    title = f"{recipe.title} ({recipe.kind})" if recipe.title else recipe.kind
    return [
        f"{prepared.loaded.recipe_path}: good",
        f"  {title}, on {prepared.loaded.bench_path}",
        *(f"  {line}" for line in _motions(plan)),
        *(f"  {line}" for line in _loads(prepared)),
        f"  cycles walked   {plan.cycles}, returns included",
        f"  travel needed   {_travel(prepared)}",
        f"  duration        about {timedelta(seconds=round(plan.duration_s))}, at real speed",
        f"  disk            about {_size(plan.disk_bytes)}",
    ]


def _motions(plan: "Plan") -> list[str]:
    lines = []
    width = max(15, *(len(planned.label) for planned in plan.recordings), 0)
    for planned in plan.recordings:
        motion = planned.motion
        times = f"up to {planned.times} x " if planned.times > 1 else ""
        back = ", and back" if planned.return_to_start else ""
        lines.append(
            f"{planned.label:<{width}} {times}{motion.settle_periods} + {motion.periods} cycles "
            f"{motion.direction} at {motion.period_rate_hz:.6g} Hz, "
            f"{motion.samples_per_period} samples a cycle{back}"
        )
    return lines


def _loads(prepared: "Prepared") -> list[str]:
    largest = prepared.plan.largest_load
    if largest is None:
        return []
    by_hand = ", placed by a person at the terminal" if prepared.needs_person else ""
    return [f"loads           up to {largest:g} N{by_hand}"]


def _travel(prepared: "Prepared") -> str:
    from labdrive.model.units import format_si

    plan, limits = prepared.plan, prepared.devices.limits
    if prepared.devices.fixed_motion is not None:
        return "none: a recording is played, nothing moves"
    needed = format_si(plan.travel[1] - plan.travel[0], plan.unit, 3)
    has = format_si(limits.travel.max - limits.travel.min, plan.unit) if limits.travel else "any"
    return f"about {needed} of the bench's {has}"


def _size(count: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"
