"""The figure of the harmonics: amplitudes with their standard errors."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labdrive.report.entries import STANDS_OUT, Entry, column
from labdrive.report.palette import COLOUR
from labdrive.report.scale import Scale, scale_for
from labdrive.report.svg import draw, legend_above, log_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Up to here each harmonic has room of its own on an even axis.
MOST_EVEN = 40


def harmonics(named: Mapping[str, Entry], unit: str) -> str:
    """Draw amplitudes with error bars, those that do not stand out of the noise hollow."""
    amplitudes = np.concatenate([column(entry, "amplitude") for entry in named.values()])
    errors = np.concatenate([column(entry, "standard_error") for entry in named.values()])
    largest = float(amplitudes.max(initial=0.0))
    scale = scale_for(unit, largest)
    order = int(max(column(entry, "k").max(initial=1) for entry in named.values()))
    positive = np.concatenate([errors[errors > 0], amplitudes[amplitudes > largest * 1e-6]])
    low = 0.3 * float(np.percentile(positive, 1)) if positive.size else 0.1

    def paint(axes: Sequence["Axes"]) -> None:
        (only,) = axes
        colours = ("before", "accent") if len(named) > 1 else ("after",)
        for (name, entry), colour, marker in zip(named.items(), colours, "oD", strict=False):
            _paint(only, entry, scale, COLOUR[colour], marker, name)
        log_axis(only, scale, low, max(2 * largest, 10 * low))
        _orders_axis(only, order)
        only.set_ylabel("amplitude")
        legend_above(only)

    return draw("harmonics", paint, height_in=3.0)


def _paint(  # noqa: PLR0913
    axes: "Axes", entry: Entry, scale: Scale, colour: str, marker: str, name: str
) -> None:
    orders = column(entry, "k")
    size = column(entry, "amplitude") / scale.size
    error = column(entry, "standard_error") / scale.size
    stands = size > STANDS_OUT * error
    # A bar that would reach below zero has no place on a logarithmic axis.
    bars = np.array([np.minimum(error, 0.999 * size), error])
    axes.errorbar(orders, size, bars, fmt="none", ecolor=colour, elinewidth=0.6, alpha=0.4)
    axes.plot(
        orders[stands],
        size[stands],
        marker,
        color=colour,
        ms=3.2,
        mew=0,
        label=name or "out of the noise",
    )
    hollow: Any = {"mfc": COLOUR["paper"], "mew": 0.6, "ms": 2.6}
    rest = ~stands
    label = f"{name}, within the noise".removeprefix(", ")
    if rest.any():
        axes.plot(orders[rest], size[rest], marker, color=colour, label=label, **hollow)


def _orders_axis(axes: "Axes", order: int) -> None:
    from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

    axes.set_xlabel("harmonic of the cycle, k")
    if order <= MOST_EVEN:
        axes.set_xlim(0.3, order + 0.7)
        axes.xaxis.set_major_locator(MaxNLocator(12, integer=True, steps=[1, 2, 4, 5, 10]))
        return
    axes.set_xscale("log", base=2)
    axes.set_xlim(0.85, order * 1.15)
    axes.xaxis.set_major_locator(LogLocator(2, numticks=16))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
