"""Both directions of the simulated drive, with one map and with its mirror."""

import numpy as np
import pytest

from labdrive.store.run_folder import RunFolder

QUICK = ("motion.periods=8", "motion.samples_per_period=128", "stop.max_iterations=2")
CASES = (
    "unoptimized_forward",
    "unoptimized_backward",
    "optimized_forward",
    "optimized_backward",
    "swapped_backward",
)
ALIKE = ("group_mismatch: 0", "leg_mismatch: 0", "element_mismatch: 0", "height_mismatch: 0 nm")


def rms(done):
    return {case["name"]: case["periodic_error"]["rms"] for case in done.result["cases"]}


def test_the_five_cases_come_in_the_papers_order(ran):
    done = ran("reverse_check.yaml", *QUICK)
    found = rms(done)
    assert tuple(found) == CASES
    order = [
        "optimized_forward",
        "swapped_backward",
        "optimized_backward",
        "unoptimized_backward",
    ]
    assert sorted(order, key=found.get) == order
    directions = {case["name"]: case["direction"] for case in done.result["cases"]}
    assert all(name.endswith(direction) for name, direction in directions.items())


def test_a_map_serves_the_direction_it_was_made_for(ran):
    cross = {
        (entry["map"], entry["direction"]): entry["periodic_error"]["rms"]
        for entry in ran("reverse_check.yaml", *QUICK).result["cross"]
    }
    for own in ("forward", "backward"):
        other = {"forward": "backward", "backward": "forward"}[own]
        assert cross[own, own] < 0.1 * cross[own, other]


def test_with_legs_that_are_alike_the_mirror_is_as_good_backward(ran, tmp_path):
    bench = (ran.recipes / "benches" / "lt40-sim.yaml").read_text()
    same = "\n".join(["    seed: 1", *(f"    {line}" for line in ALIKE), "    play_spread: 0"])
    path = tmp_path / "alike.yaml"
    path.write_text(bench.replace("    seed: 1", same))
    found = rms(ran("reverse_check.yaml", *QUICK, "cross=false", bench=path))
    assert found["swapped_backward"] == pytest.approx(found["optimized_forward"], rel=0.1)


def test_the_reverse_table_is_kept_with_where_to_go_on_in_it(ran):
    done = ran("reverse_check.yaml", *QUICK, "cross=false")
    assert "cross" not in done.result
    folder = RunFolder(done.outcome.folder)
    forward, reverse = (
        {name: np.array(column) for name, column in folder.read_table(table).items()}
        for table in ("forward", done.result["reverse_table"])
    )
    place = forward["switch_phase_rad"] / (2 * np.pi) * len(reverse["U0_V"])
    for name in ("U0_V", "U1_V", "U2_V", "U3_V"):
        closed = np.append(reverse[name], reverse[name][0])
        there = np.interp(place, np.arange(len(closed)), closed)
        one_entry = np.abs(np.diff(forward[name])).max()
        np.testing.assert_allclose(there, forward[name], atol=one_entry)
    # From one entry to the next a tip moves up to ten times as far.
    assert done.result["switch_jump"] < 5e-9
