"""Figures of the periodic error: over the phase, and how it falls."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.report.decimate import decimate
from labdrive.report.entries import Entry, degrees, error_over_cycle
from labdrive.report.palette import COLOUR, sequence
from labdrive.report.scale import Scale, scale_for
from labdrive.report.svg import degrees_axis, draw, legend_above, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 2400


def errors_over_phase(iterations: Sequence[Entry], verification: Entry, unit: str) -> str:
    """Draw the first iteration above, those after an update and the verification below."""
    first = error_over_cycle(iterations[0])
    updated = [error_over_cycle(entry) for entry in iterations[1:]]
    verified = error_over_cycle(verification)
    largest = max(float(np.abs(curve).max()) for curve in (*updated, verified))

    def paint(axes: Sequence["Axes"]) -> None:
        above, below = axes
        scale = _frame(above, "before", unit, float(np.abs(first).max()))
        _line(above, first, scale, COLOUR["before"], "")
        scale = _frame(below, "after", unit, largest)
        for number, (curve, colour) in enumerate(
            zip(updated, sequence(len(updated)), strict=True), start=1
        ):
            _line(below, curve, scale, colour, f"iteration {number}")
        _line(below, verified, scale, COLOUR["accent"], "verification")
        legend_above(below)
        degrees_axis(below)

    return draw("error", paint, rows=2, height_in=4.4)


def error_with_band(entry: Entry, unit: str) -> str:
    """Draw the periodic error over the phase with a band of two standard deviations."""
    curve, sigma = error_over_cycle(entry), entry["noise_floor"]["rms"]

    def paint(axes: Sequence["Axes"]) -> None:
        (only,) = axes
        scale = _frame(only, "", unit, float(np.abs(curve).max()))
        phase, error = decimate(degrees(curve), curve / scale.size, POINTS)
        band = 2 * sigma / scale.size
        label = "± 2 standard deviations"
        only.fill_between(
            phase, error - band, error + band, color=COLOUR["noise"], lw=0, label=label
        )
        only.plot(phase, error, color=COLOUR["after"])
        legend_above(only)
        degrees_axis(only)

    return draw("error", paint)


def _frame(axes: "Axes", title: str, unit: str, largest: float) -> Scale:
    scale = scale_for(unit, largest)
    axes.axhline(0, color=COLOUR["ink"], lw=0.5)
    axes.set_title(title)
    axes.set_ylabel(f"periodic error ({scale.unit})")
    return scale


def _line(axes: "Axes", curve: FloatArray, scale: Scale, colour: str, label: str) -> None:
    phase, error = decimate(degrees(curve), curve / scale.size, POINTS)
    axes.plot(phase, error, color=colour, label=label, lw=1.0)


def convergence(iterations: Sequence[Entry], verification: Entry, unit: str) -> str:
    """Draw rms and peak-to-valley over the iterations and in the verification, and the noise."""
    entries = [*iterations, verification]
    sizes = {
        name: np.array([entry["periodic_error"][name] for entry in entries])
        for name in ("pv", "rms")
    }
    floors = np.array([entry["noise_floor"]["rms"] for entry in entries])
    shown = np.concatenate([*sizes.values(), floors])
    positive = shown[shown > 0]
    scale = scale_for(unit, float(np.median(positive)) if positive.size else 1.0)
    low, high = (0.4 * positive.min(), 2.5 * positive.max()) if positive.size else (0.1, 10.0)

    def paint(axes: Sequence["Axes"]) -> None:
        (only,) = axes
        _noise_band(only, floors / scale.size, low / scale.size)
        _falling(only, sizes["pv"] / scale.size, "s", ":", "peak-to-valley")
        _falling(only, sizes["rms"] / scale.size, "o", "-", "rms")
        log_axis(only, scale, low, high)
        _iterations_axis(only, len(iterations))
        only.set_ylabel("periodic error")
        legend_above(only)

    return draw("convergence", paint, height_in=2.8)


def _noise_band(axes: "Axes", floors: FloatArray, bottom: float) -> None:
    edges = np.arange(len(floors) + 1) - 0.5
    axes.stairs(
        np.maximum(floors, bottom),
        edges,
        baseline=bottom,
        fill=True,
        color=COLOUR["noise"],
        label="noise floor, rms",
    )


def _falling(axes: "Axes", sizes: FloatArray, marker: str, style: str, name: str) -> None:
    """Draw a size over the iterations; the verification stands apart, for no fit has seen it."""
    last = len(sizes) - 1
    axes.plot(range(last), sizes[:-1], marker + style, color=COLOUR["after"], label=name)
    axes.plot([last], sizes[-1:], marker, color=COLOUR["accent"])


def _iterations_axis(axes: "Axes", iterations: int) -> None:
    every = max(1, iterations // 12)
    numbers = [i for i in range(iterations) if i % every == 0]
    axes.set_xlim(-0.5, iterations + 0.5)
    axes.set_xticks([*numbers, iterations], [*map(str, numbers), "verification"])
    axes.set_xlabel("iteration")
