"""How well set-points keep the SYNC's grid, against an empty loop that sleeps as long.

A drive in a process of its own, reached over a real socket. `late` is how long after its due time
a SYNC went out; a cycle is lost when it went out later than the next was due.
"""

import json
import subprocess
import sys
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from labdrive.interfaces.devices import Acquisition, DeviceContext
from labdrive.interfaces.limits import Limits
from labdrive.model.arrays import FloatArray
from labdrive.model.motion import Motion
from labdrive_spindle.can_bus import CanBus
from labdrive_spindle.canopen_actuator import CanopenSpindle
from labdrive_spindle.streaming import Timing

PERIODS_MS = (1, 2, 4, 10)
SECONDS = 20
SAMPLES = 100


def bare(period_s: float, seconds: float) -> FloatArray:
    """Return how late a loop wakes that does nothing [s]."""
    late, due = [], time.monotonic()
    for _ in range(round(seconds / period_s)):
        due += period_s
        time.sleep(max(0.0, due - time.monotonic()))
        late.append(time.monotonic() - due)
    return np.array(late)


def streamed(where: Mapping[str, Any], period_ms: int, seconds: float) -> Timing:
    """Stream for so long; return the timing of the SYNC."""
    settings = CanBus.Settings.model_validate(
        {
            "interface": "socketcand",
            "channel": where["channel"],
            "options": {"host": where["host"], "port": where["port"], "tcp_tune": True},
            "sync_period": f"{period_ms} ms",
        }
    )
    bus = CanBus(settings, DeviceContext("can", Limits()))
    context = DeviceContext("spindle", Limits(), links={"can": bus})
    given = {"link": "can", "node": where["drive"], "profile": {"velocity": "20 Hz"}}
    actuator = CanopenSpindle(
        CanopenSpindle.Settings.model_validate(given | {"following_error": "60 deg"}), context
    )
    rate = 1000 / period_ms / SAMPLES
    motion = Motion(max(3, round(seconds * rate)), SAMPLES, rate, 2)
    bus.connect()
    try:
        actuator.connect()
        actuator.load(actuator.nominal_table(None))
        for _ in actuator.play(Acquisition(1, motion)):
            pass
        return actuator.timing
    finally:
        actuator.make_safe()
        actuator.close()
        bus.close()


def shown(late_s: FloatArray) -> str:
    """Return median, 99th percentile and largest in us."""
    return " ".join(f"{1e6 * value:8.0f}" for value in np.percentile(late_s, [50, 99, 100]))


def main() -> None:
    """Print a line a period."""
    code = "import sys; from labdrive_sim.drive_program import main; sys.exit(main())"
    drive = subprocess.Popen(  # noqa: S603 our own program
        [sys.executable, "-c", code, "canopen"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    where = json.loads(drive.stdout.readline())
    print(
        "SYNC      late: median, 99 %, most (us)   lost cycles      empty loop (us)   ratio, 99 %"
    )
    try:
        for period in PERIODS_MS:
            reference = bare(period / 1000, SECONDS / 2)
            timing = streamed(where, period, SECONDS)
            late = np.array(timing.late_s)
            ratio = np.percentile(late, 99) / np.percentile(reference, 99)
            print(
                f"{period:2d} ms  {shown(late)}     {timing.lost:6d} of {len(late):6d}   "
                f"{shown(reference)}     {ratio:5.1f}"
            )
    finally:
        drive.communicate("quit\n")


if __name__ == "__main__":
    main()
