"""A queue and services on a clock of the test's own; a folder to run labdrive in."""

import pytest

from labdrive.schedule.queue import Queue
from labdrive.schedule.service import Service
from labdrive.schedule.workers import working

from .fakes import Clock
from .lab import QUICK, RECIPES, Lab


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def queue(tmp_path):
    queue = Queue(tmp_path / "queue.sqlite")
    yield queue
    queue.close()


@pytest.fixture
def service(queue, clock, tmp_path):
    """Return a function that makes a service with a runner."""
    with working(tmp_path / "workers") as worker:
        yield lambda runner, **more: Service(queue, runner, worker, clock, **more)


@pytest.fixture
def lab(tmp_path):
    bench = (RECIPES / "benches" / "lt40-sim.yaml").read_text()
    (tmp_path / "bench.yaml").write_text(bench)
    slow = bench.replace("x_per_volt", "speed: 0.05, x_per_volt", 1)
    (tmp_path / "slow.yaml").write_text(slow)
    faulty = bench.replace("sim-interferometer,", "sim-faulty-interferometer, fault: freeze,")
    assert faulty != bench
    (tmp_path / "faulty.yaml").write_text(faulty)
    (tmp_path / "quick.yaml").write_text(QUICK)
    return Lab(tmp_path)
