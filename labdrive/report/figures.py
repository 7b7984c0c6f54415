"""The figures of a report: what each shows, as inline SVG."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from labdrive.model.arrays import FloatArray
from labdrive.model.waveform import TURN
from labdrive.report.decimate import decimate
from labdrive.report.scale import Scale, scale_for
from labdrive.report.svg import degrees_axis, draw

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Entry = Mapping[str, Any]

POINTS = 1440
BUCKETS = 900
ACCENT, BEFORE, AFTER, GREY = "#c8500a", "#7a8794", "#0b62a4", "#9aa3ab"
# Colour-blind safe (Okabe and Ito), for channels.
CHANNELS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"]


def error_curve(entry: Entry, phase: FloatArray) -> FloatArray:
    """Return the periodic error [SI] at each phase [rad], from an entry's harmonics."""
    turn = np.exp(1j * phase)
    total = np.zeros_like(turn)
    for harmonic in reversed(entry["harmonics"]):
        total = (total + harmonic["amplitude"] * np.exp(1j * harmonic["phase"])) * turn
    return np.asarray(total.real)


def uncertainty_curve(entry: Entry) -> float:
    """Return the standard deviation [SI] of the error curve, the same at every phase."""
    return float(np.sqrt(np.sum([h["standard_error"] ** 2 for h in entry["harmonics"]])))


def errors_over_phase(iterations: Sequence[Entry], verification: Entry, unit: str) -> str:
    """Periodic error over the phase: all iterations above, those after the first update below."""
    phase = np.linspace(0, TURN, POINTS + 1)
    curves = [error_curve(entry, phase) for entry in iterations]
    checked = error_curve(verification, phase)

    def paint(axes: Any) -> None:  # noqa: ANN401
        _paint_errors(axes[0], phase, curves[:1], [0], None, unit)
        later = list(range(1, len(curves))) or [0]
        _paint_errors(axes[1], phase, [curves[i] for i in later], later, checked, unit)
        axes[0].set_title("before", loc="left")
        axes[1].set_title("after updates: note the scale", loc="left")
        degrees_axis(axes[1])

    return draw("error", paint, rows=2, height_in=4.6)


def _paint_errors(  # noqa: PLR0913
    axes: "Axes",
    phase: FloatArray,
    curves: Sequence[FloatArray],
    numbers: Sequence[int],
    checked: FloatArray | None,
    unit: str,
) -> None:
    drawn = [*curves, *([] if checked is None else [checked])]
    scale = scale_for(unit, max(float(np.abs(curve).max()) for curve in drawn))
    for number, curve, colour in zip(numbers, curves, sequence(len(curves)), strict=True):
        chosen = BEFORE if number == 0 else colour
        axes.plot(*_thin(phase, curve, scale), color=chosen, label=f"iteration {number}")
    if checked is not None:
        axes.plot(*_thin(phase, checked, scale), color=ACCENT, lw=1.0, label="verification")
    axes.axhline(0, color="black", lw=0.6)
    axes.set_ylabel(f"periodic error ({scale.unit})")
    axes.legend(ncols=4, loc="upper right", bbox_to_anchor=(1, 1.16))


def sequence(count: int) -> Sequence[Any]:
    """Return `count` colours from light to dark, told apart by those who see few colours too."""
    from matplotlib import colormaps  # noqa: PLC0415 0.3 s, needed by reports only

    return list(colormaps["viridis"](np.linspace(0.8, 0.15, count)))


def _thin(phase: FloatArray, curve: FloatArray, scale: Scale) -> tuple[FloatArray, FloatArray]:
    x, y = decimate(np.degrees(phase), curve / scale.size, BUCKETS)
    return x, y


def convergence(iterations: Sequence[Entry], verification: Entry, unit: str) -> str:
    """Rms and peak-to-valley over the iterations, and the noise floor."""
    rms = [entry["periodic_error"]["rms"] for entry in iterations]
    valley = [entry["periodic_error"]["pv"] for entry in iterations]
    floor = [entry["noise_floor"]["rms"] for entry in iterations]
    scale = scale_for(unit, float(np.median([*rms, *valley])))
    numbers = np.arange(len(rms))

    def paint(axes: "Axes") -> None:
        axes.fill_between(
            [-0.4, len(rms) + 0.4],
            0,
            max(floor) / scale.size,
            color="#dfe7ee",
            lw=0,
            label="noise floor, rms",
        )
        axes.plot(numbers, np.array(valley) / scale.size, "s--", color=GREY, label="peak-to-valley")
        axes.plot(numbers, np.array(rms) / scale.size, "o-", color=AFTER, label="rms")
        for key, marker in (("pv", "s"), ("rms", "o")):
            value = verification["periodic_error"][key] / scale.size
            told = "verification" if key == "rms" else None
            axes.plot([len(rms)], [value], marker, color=ACCENT, label=told)
        axes.set_yscale("log")
        axes.set_ylim(0.4 * max(min(floor), 1e-30) / scale.size, 3 * max(valley) / scale.size)
        axes.set_xlim(-0.4, len(rms) + 0.4)
        axes.set_xticks(range(len(rms) + 1), [*(str(i) for i in range(len(rms))), "verified"])
        axes.set_xlabel("iteration")
        axes.set_ylabel(f"periodic error ({scale.unit})")
        axes.legend(ncols=2, loc="upper right")

    return draw("convergence", paint)


def harmonics(named: Mapping[str, Entry], unit: str) -> str:
    """Amplitudes with error bars; hollow where an amplitude is below twice its standard error."""
    largest = max(h["amplitude"] for entry in named.values() for h in entry["harmonics"])
    scale = scale_for(unit, largest)
    smallest = min(
        (
            h["standard_error"]
            for e in named.values()
            for h in e["harmonics"]
            if h["standard_error"]
        ),
        default=largest * 1e-6,
    )

    def paint(axes: "Axes") -> None:
        colours = (BEFORE, ACCENT) if len(named) > 1 else (AFTER,)
        styles = zip(named.items(), colours, ("o", "D"), strict=False)
        for (name, entry), colour, marker in styles:
            _paint_harmonics(axes, entry, scale, colour, marker, name)
        axes.set_yscale("log")
        axes.set_ylim(0.2 * smallest / scale.size, 2 * largest / scale.size)
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("harmonic of the cycle")
        axes.set_ylabel(f"amplitude ({scale.unit})")
        axes.legend(loc="upper right", ncols=2)

    return draw("harmonics", paint, height_in=3.2)


def _paint_harmonics(  # noqa: PLR0913
    axes: "Axes", entry: Entry, scale: Scale, colour: str, marker: str, name: str
) -> None:
    orders = np.array([h["k"] for h in entry["harmonics"]])
    size = np.array([h["amplitude"] for h in entry["harmonics"]]) / scale.size
    error = np.array([h["standard_error"] for h in entry["harmonics"]]) / scale.size
    stands = size > 2 * error
    lower = np.minimum(error, size * 0.999)
    bars = np.array([lower, error])
    axes.errorbar(orders, size, bars, fmt="none", ecolor=colour, elinewidth=0.7, alpha=0.55)
    axes.plot(orders[stands], size[stands], marker, color=colour, ms=3.6, label=name)
    hollow: dict[str, Any] = {"mfc": "white", "mew": 0.8, "ms": 3.2, "alpha": 0.7}
    label = f"{name}, below 2 standard errors" if (~stands).any() else None
    axes.plot(orders[~stands], size[~stands], marker, color=colour, label=label, **hollow)


def waveforms(before: Mapping[str, FloatArray], after: Mapping[str, FloatArray]) -> str:
    """Draw outputs over the phase, before and after; an angle less the phase itself."""
    names = [name for name in before if name not in ("phase_rad", "psi_rad")]
    phase = before["phase_rad"]

    def paint(axes: "Axes") -> None:
        for name, colour in zip(names, CHANNELS * len(names), strict=False):
            label, old, size = _output(name, phase, before[name])
            _, new, _ = _output(name, phase, after[name])
            axes.plot(*decimate(np.degrees(phase), old * size, BUCKETS), "--", color=colour, lw=0.9)
            axes.plot(*decimate(np.degrees(phase), new * size, BUCKETS), color=colour, label=label)
        degrees_axis(axes)
        angle = names[0].endswith("_rad")
        axes.set_ylabel("angle less phase (mdeg)" if angle else "output (V)")
        axes.legend(loc="upper right", ncols=4, bbox_to_anchor=(1, 1.16))
        axes.set_title("dashed: before, full: after", loc="left")

    return draw("waveforms", paint)


def _output(name: str, phase: FloatArray, values: FloatArray) -> tuple[str, FloatArray, float]:
    """Return label, values and the factor to what is shown."""
    channel, unit = name.rsplit("_", 1)
    if unit == "rad":
        return channel, values - phase, np.degrees(1.0) * 1e3
    return channel, values, 1.0


def phase_maps(tables: Mapping[str, Mapping[str, FloatArray]]) -> str:
    """Corrected phase less commanded phase, for each table after the first."""

    def paint(axes: "Axes") -> None:
        for (name, table), colour in zip(tables.items(), sequence(len(tables)), strict=True):
            phase = np.degrees(table["phase_rad"])
            shift = np.degrees(table["psi_rad"] - table["phase_rad"])
            axes.plot(*decimate(phase, shift, BUCKETS), color=colour, label=name)
        axes.axhline(0, color="black", lw=0.6)
        degrees_axis(axes)
        axes.set_ylabel("ψ(φ) - φ (deg)")
        axes.legend(loc="upper right", ncols=4, bbox_to_anchor=(1, 1.16))

    return draw("map", paint)


def residuals(named: Mapping[str, tuple[FloatArray, FloatArray]], unit: str) -> str:
    """Raw readings less a straight line, over the whole recording, each on its own scale."""

    def paint(axes: Any) -> None:  # noqa: ANN401
        stacked = np.atleast_1d(axes)
        for (name, (phase, reading)), one, colour in zip(
            named.items(), stacked, (BEFORE, ACCENT), strict=False
        ):
            off = less_line(phase, reading)
            scale = scale_for(unit, float(np.abs(off).max()))
            one.plot(*decimate(phase / TURN, off / scale.size, BUCKETS), color=colour, lw=0.7)
            one.set_title(name, loc="left")
            one.set_ylabel(f"reading less line ({scale.unit})")
        stacked[-1].set_xlabel("cycles")

    return draw("residual", paint, rows=len(named), height_in=2.3 * len(named))


def less_line(phase: FloatArray, reading: FloatArray) -> FloatArray:
    """Return readings less their least-squares line over the phase; shape (samples,)."""
    x = phase - phase.mean()
    slope = float(x @ (reading - reading.mean()) / (x @ x))
    return np.asarray(reading - reading.mean() - slope * x)


def error_with_band(entry: Entry, unit: str) -> str:
    """Periodic error over the phase with a band of two standard deviations."""
    phase = np.linspace(0, TURN, POINTS + 1)
    curve, sigma = error_curve(entry, phase), uncertainty_curve(entry)
    scale = scale_for(unit, float(np.abs(curve).max()))
    x, y = np.degrees(phase), curve / scale.size

    def paint(axes: "Axes") -> None:
        band = 2 * sigma / scale.size
        axes.fill_between(x, y - band, y + band, color="#cfdce8", lw=0, label="±2 std. errors")
        axes.plot(x, y, color=AFTER)
        axes.axhline(0, color="black", lw=0.6)
        degrees_axis(axes)
        axes.set_ylabel(f"periodic error ({scale.unit})")
        axes.legend(loc="upper right", bbox_to_anchor=(1, 1.16))

    return draw("error", paint)
