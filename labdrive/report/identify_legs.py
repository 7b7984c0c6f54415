"""The report of an `identify_legs` run: the paper's Figure 2a and b."""

import math

from labdrive.report.legs_figures import leg_loops, leg_path
from labdrive.report.run_data import RunData
from labdrive.report.scale import significant
from labdrive.report.sections import Fact, Section, measured

CONSTRAINTS = {
    "bending": "m12 = −m11, m22 = m21",
    "stack": "m12 = −m11, m22 = m21",
    "clamp_shear": "m11 = m22 = 0",
    "free": "none",
}


def facts(run: RunData) -> list[Fact]:
    """Return how well the model fits and how wide the loops are."""
    result = run.result
    fit = [
        Fact(significant(value, 4), f"R² of {axis}") for axis, value in result["r_squared"].items()
    ]
    loops = [
        Fact(f"{width:.1%}", f"opening of the loop of {axis}, of its stroke")
        for axis, width in result["loop_width"].items()
    ]
    return fit + loops


def summary(run: RunData) -> str:
    """Return in words what was done and where the model is."""
    result = run.result
    text = (
        f"Both groups were driven in tandem, so that the rod went where the tips went. Geometry "
        f"{result['geometry']}, constraint: {CONSTRAINTS[result['geometry']]}. "
        f"{result['legs_file']} holds the model, for benches and optimizers to include."
    )
    if "stack" in result:
        stack = result["stack"]
        text += (
            f" The stacks grow by {significant(1e9 * stack['expansion'])} nm/V and stand at "
            f"±{significant(math.degrees(stack['angle']))}° to the rod's normal."
        )
    return text


def sections(run: RunData) -> list[Section]:
    """Return figures and tables."""
    result = run.result
    rows = [
        [f"m{i + 1}{j + 1}", measured(value, error, "m/V")]
        for i, row in enumerate(zip(result["matrix"], result["matrix_standard_error"], strict=True))
        for j, (value, error) in enumerate(zip(*row, strict=True))
    ]
    plays = result["plays"]
    weights = [
        [significant(radius), significant(weight)]
        for radius, weight in zip(plays["radii"], plays["weights"], strict=True)
    ]
    return [
        Section(
            "Tips over the phase",
            leg_path(run),
            "Points: the mean cycle as seen. Lines: the linear model. Both about their means.",
        ),
        Section(
            "Hysteresis",
            leg_loops(run),
            "Deflection over the voltage that drives it. Without hysteresis the loop would be the "
            "line.",
        ),
        Section(
            "Model",
            head=["", "coefficient"],
            rows=rows,
            caption="Tip = M · voltages. Errors: standard error of the mean of the cycles' own "
            "fits; what hysteresis adds is the same in every cycle and not in them.",
        ),
        Section(
            "Plays",
            head=["radius (V)", "weight"],
            rows=weights,
            caption="Expansion of an element: U + Σ weight · play(U), fitted to both loops.",
        ),
    ]
