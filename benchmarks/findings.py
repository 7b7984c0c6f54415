"""The paper's findings on the simulated bench: twelve plants each, run from the shipped recipes.

`python benchmarks/findings.py [NAME...] [--seeds N] [--json]`; without names, all of them. Every
line is a number of a result.json, or judged on the plant's dense truth where it says so.
"""

import argparse
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from labdrive.engine.discovery import discover
from labdrive.engine.plan import Prepared, prepare
from labdrive.engine.run import run
from labdrive.model.motion import Motion
from labdrive.model.waveform import Channel, WaveformTable
from labdrive.recipe.load import load
from labdrive.store.run_folder import RunFolder

RECIPES = Path(__file__).parents[1] / "recipes"
WAVEFORMS = ("ellipse", "triangle", "box")
SLOW = {"amplifier_time": "10 ms"}
"""At one cycle a second: f0 tau = 1e-2."""
STIFF = {"tangential_stiffness": "300 N/um", "normal_stiffness": "225 N/um", "loop_width": 0.04}
"""Contacts three times as stiff, a third of the hysteresis."""
ALIKE = {
    "group_mismatch": 0.0,
    "leg_mismatch": 0.0,
    "element_mismatch": 0.0,
    "play_spread": 0.0,
    "height_mismatch": "0 nm",
}
Numbers = Mapping[str, float]
Result = Mapping[str, Any]


@dataclass
class Lab:
    """Runs recipes on plants of one's choice, in a folder that is thrown away."""

    folder: Path
    seed: int

    def __post_init__(self) -> None:
        self._host = discover()

    def run(self, recipe: str, *overrides: str, **plant: Any) -> Result:
        """Return the result of a shipped recipe on a plant with this seed and these settings."""
        self.prepared, self.run_folder, result = self._run(recipe, overrides, plant)
        return result

    def truth_nm(self, table: str) -> float:
        """Return the true periodic error [nm rms] of a table of the last run, all harmonics."""
        columns = RunFolder(self.run_folder).read_table(table)
        channels = tuple(
            Channel(name[:-2], "V", np.array(column))
            for name, column in columns.items()
            if name.endswith("_V")
        )
        plant: Any = next(iter(self.prepared.devices.links.values()))
        played = WaveformTable(channels)
        _, position = plant.truth(played, Motion(4, 256, 1.0, 4))
        step = (position[-1] - position[0]) / 4
        error = position[:-1] - step * np.arange(len(position) - 1) / played.length
        return 1e9 * float(error.reshape(4, -1).mean(axis=0).std())

    def _run(
        self, recipe: str, overrides: tuple[str, ...], plant: Mapping[str, Any]
    ) -> tuple[Prepared, Path, Result]:
        loaded = load(RECIPES / recipe, self._host.plugins, self._bench(recipe, plant), overrides)
        prepared = prepare(loaded, self._host.plugins)
        outcome = run(prepared, self._host, self.folder, lambda _: None)
        if outcome.error is not None:
            raise outcome.error
        return prepared, outcome.folder, outcome.result or {}

    def _bench(self, recipe: str, plant: Mapping[str, Any]) -> Path:
        """Write the recipe's bench with another plant; return its path."""
        named = yaml.safe_load((RECIPES / recipe).read_text())["bench"]
        bench = yaml.safe_load((RECIPES / named).read_text())
        bench["links"]["plant"] |= {"seed": self.seed, **plant}
        path = self.folder / "bench.yaml"
        path.write_text(yaml.safe_dump(bench))
        return path


def legs(lab: Lab) -> Numbers:
    """Figure 2a, b: how well the linear model fits, how wide the loop is."""
    plain = lab.run("identify_legs.yaml")
    wide = lab.run("identify_legs.yaml", loop_width=0.18)
    return {
        "R2": min(plain["r_squared"].values()),
        "loop": plain["hysteresis"],
        "R2 wide": min(wide["r_squared"].values()),
        "loop wide": wide["hysteresis"],
    }


def paper(lab: Lab) -> Numbers:
    """Figure 4: the paper's setting, `symmetric`, m = 32, slow amplifiers."""
    common = (
        "motion.samples_per_period=32",
        "motion.periods=16",
        "motion.period_rate=1 Hz",
        "motion.settle_periods=4",
        "optimizer.groups=symmetric",
        "stop.max_iterations=4",
    )
    found = {}
    for name in ("ellipse", "box"):
        result = lab.run("optimize.yaml", f"waveform.trajectory={name}", *common, **SLOW)
        before, after = (result["iterations"][i] for i in (0, result["best_iteration"]))
        found[f"{name} before, pv nm"] = 1e9 * before["periodic_error"]["pv"]
        found[f"{name} pv times"] = before["periodic_error"]["pv"] / after["periodic_error"]["pv"]
        found[f"{name} rms times"] = (
            before["periodic_error"]["rms"] / after["periodic_error"]["rms"]
        )
        truth = lab.truth_nm(before["table"]), lab.truth_nm(after["table"])
        found[f"{name} rms times, true"] = truth[0] / truth[1]
    amplitudes = [harmonic["amplitude"] for harmonic in after["harmonics"]]
    found["box starts at, of ellipse"] = found["box before, pv nm"] / found["ellipse before, pv nm"]
    found["box led by k"] = 1 + int(np.argmax(amplitudes))
    return found


def shared(lab: Lab) -> Numbers:
    """`shared_phase`, fast, m = 64, 3 updates: the true error left."""
    return _left(lab, "optimizer.groups=shared_phase")


def per_group(lab: Lab) -> Numbers:
    """`per_group`, m = 256: what gain and timing of the groups' own add."""
    return _left(lab, "optimizer.groups=per_group", samples=256, updates=8)


def _left(lab: Lab, *overrides: str, samples: int = 64, updates: int = 3) -> Numbers:
    common = (
        f"motion.samples_per_period={samples}",
        "motion.periods=16",
        "motion.period_rate=1 Hz",
        "motion.settle_periods=4",
        f"stop.max_iterations={updates}",
    )
    found = {}
    for name in WAVEFORMS:
        result = lab.run("optimize.yaml", f"waveform.trajectory={name}", *common, *overrides)
        tables = result["iterations"][0]["table"], _best(result)["table"]
        before, after = map(lab.truth_nm, tables)
        found[f"{name} before, nm"] = before
        found[f"{name} after, nm"] = after
        found[f"{name} times"] = before / after
    return found


def _best(result: Result) -> Result:
    best: Result = result["iterations"][result["best_iteration"]]
    return best


def slope(lab: Lab) -> Numbers:
    """Least slope of a limited correction: what it leaves of the ellipse, m = 64, true."""
    found = {}
    for least in (0.2, 0.1, 0.05, 0.02):
        overrides = (f"optimizer.least_slope={least}", "motion.period_rate=0.5 Hz")
        left = _left(lab, *overrides)
        found[f"{least}, nm"] = left["ellipse after, nm"]
    return found


def loads(lab: Lab) -> Numbers:
    """Figure 2c: step size and stall load of each waveform, under one voltage limit."""
    curves = lab.run("load_sweep.yaml")["curves"]
    found = {f"{c['waveform']} step, um": 1e6 * c["step_size"] for c in curves}
    found |= {f"{c['waveform']} stall, N": c["stall_load"] for c in curves}
    return found | {f"{c['waveform']} compliance, nm/N": 1e9 * c["compliance"] for c in curves}


def scaling(lab: Lab) -> Numbers:
    """Figure 3: step and stall load of the scaled triangle."""
    trends = lab.run("scaling_sweep.yaml")["trends"]
    found = {"x: R2 of a line": trends["x"]["r_squared"]}
    found["x: intercept, um"] = 1e6 * trends["x"]["intercept"]
    for axes, trend in trends.items():
        for scale, share in zip(trend["scales"][1:], trend["stall_shares"][1:], strict=True):
            found[f"{axes} at {scale:g}: stall"] = share
    return found


def reverse(lab: Lab) -> Numbers:
    """Figure 5: both directions of the box, nm rms; then with legs alike; then stiff."""
    found = _cases(lab.run("reverse_check.yaml", "cross=false"))
    alike = _cases(lab.run("reverse_check.yaml", "cross=false", **ALIKE))
    found["alike: swapped / forward"] = alike["swapped_backward"] / alike["optimized_forward"]
    paper = ("optimizer.groups=symmetric", "motion.samples_per_period=32")
    stiff = _cases(lab.run("reverse_check.yaml", "cross=false", *paper, **STIFF))
    for name in ("unoptimized_backward", "optimized_backward", "swapped_backward"):
        found[f"stiff: {name} / forward"] = stiff[name] / stiff["optimized_forward"]
    return found


def _cases(result: Result) -> dict[str, float]:
    return {case["name"]: 1e9 * case["periodic_error"]["rms"] for case in result["cases"]}


def start(lab: Lab) -> Numbers:
    """Hysteresis-aware start: the first error, as a share of that of the nominal table."""
    lab.run("identify_legs.yaml")
    aware = ("optimizer.start=inverse_hysteresis", f"optimizer.legs={lab.run_folder}/legs.json")
    found = {}
    for name in WAVEFORMS:
        common = (f"waveform.trajectory={name}", "motion.periods=8", "stop.max_iterations=1")
        rms = [
            lab.run("optimize.yaml", *common, *more)["iterations"][0]["periodic_error"]["rms"]
            for more in ((), aware)
        ]
        found[f"{name}"] = rms[1] / rms[0]
    return found


FINDINGS: Mapping[str, Callable[[Lab], Numbers]] = {
    one.__name__: one
    for one in (legs, paper, shared, per_group, slope, loads, scaling, reverse, start)
}


def found(name: str, seeds: int) -> dict[str, list[float]]:
    """Return each number of a finding for every plant."""
    each: list[Numbers] = []
    for seed in range(1, seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            each.append(FINDINGS[name](Lab(Path(folder), seed)))
    return {key: [float(numbers[key]) for numbers in each] for key in each[0]}


def lines(numbers: Mapping[str, list[float]]) -> Iterator[str]:
    """Yield median and spread of each number."""
    for key, values in numbers.items():
        low, middle, high = np.min(values), np.median(values), np.max(values)
        yield f"  {key:<32} {middle:10.4g}   {low:.4g} to {high:.4g}"


def main() -> None:
    """Print the findings asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(FINDINGS))
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if unknown := set(options.names) - set(FINDINGS):
        parser.error(f"no such finding: {', '.join(unknown)}; there are {', '.join(FINDINGS)}")
    numbers = {}
    for name in options.names or FINDINGS:
        numbers[name] = found(name, options.seeds)
        if not options.json:
            print(f"{name}: {FINDINGS[name].__doc__}")
            print("\n".join(lines(numbers[name])), flush=True)
    if options.json:
        print(json.dumps(numbers))


if __name__ == "__main__":
    main()
