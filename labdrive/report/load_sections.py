"""Tables of drives under load: what load and scaling sweeps share."""

from collections.abc import Mapping
from typing import Any

from labdrive.report.load_figures import key_of, name_of
from labdrive.report.sections import Section, measured

HOW = (
    "Compliance and slip: from the straight line through the first points, which ends where the "
    "curve leaves it by 1 % of the unloaded step or three standard errors. Stall: half-way between "
    "the largest load that was borne and the smallest under which steps were below 2 % of the "
    "unloaded one; its standard error is the distance between the two / √12."
)


def curves_table(result: Mapping[str, Any]) -> Section:
    """Return step, compliance, onset of slip and stall load of each curve."""
    unit = result["unit"]
    rows = [
        [
            name_of(key_of(curve)),
            measured(curve["step_size"], curve["step_size_standard_error"], unit),
            measured(curve["compliance"], curve["compliance_standard_error"], f"{unit}/N"),
            maybe(curve["slip_onset"], curve["slip_onset_standard_error"]),
            maybe(curve["stall_load"], curve["standard_error"]),
        ]
        for curve in result["curves"]
    ]
    head = ["", "step, unloaded", "compliance", "slips from", "stalls at"]
    return Section("Under load", head=head, rows=rows, caption=HOW)


def maybe(force: float | None, error: float | None) -> str:
    """Return a load with its standard error, or that it was not reached."""
    return "not reached" if force is None else measured(force, error or 0.0, "N")


def points_table(result: Mapping[str, Any]) -> Section:
    """Return every point."""
    unit = result["unit"]
    rows = [
        [
            name_of(key_of(point)),
            f"{point['load_set']:g} N",
            measured(point["load"], point["load_standard_error"], "N"),
            measured(point["step_size"], point["standard_error"], unit),
            "slips" if point["slipping"] else "",
        ]
        for point in result["points"]
    ]
    return Section("Points", head=["", "set", "load", "step size", ""], rows=rows)


def read_how(result: Mapping[str, Any]) -> str:
    """Return in words where the loads on the axis come from."""
    sensor = result["force_sensor"]
    if sensor is None:
        return "Loads are those that the bench set."
    less = ", less what it reads without load" if result["rolling_resistance_from"] else ""
    return f"Loads are the mean force that the sensor {sensor} read{less}."
