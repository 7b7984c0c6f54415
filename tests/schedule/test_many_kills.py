"""Several services on one queue, killed again and again: every job done, once, one at a time."""

import json
import os
import random
import signal
import time
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path

import pytest

from labdrive.schedule.queue import Queue
from labdrive.store.journal import read_journal

BENCHES, JOBS, SERVICES, KILLS = 2, 15, 3, 24


def children(process):
    """Return the processes that a process has started."""
    tasks = Path(f"/proc/{process.pid}/task")
    found = [path.read_text().split() for path in tasks.glob("*/children")]
    return [int(pid) for pids in found for pid in pids]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_kills_of_services_and_runs_lose_and_double_nothing(lab, seed):
    chance = random.Random(seed)  # noqa: S311 no secret is drawn
    text = (lab.folder / "bench.yaml").read_text()
    paced = text.replace("x_per_volt", "speed: 1, x_per_volt", 1)
    now = datetime.now(UTC)
    for number in range(BENCHES):
        bench, name = lab.folder / f"bench{number}.yaml", f"on{number}"
        bench.write_text(paced)
        add = ("schedule", "add", "quick.yaml", "--bench", bench.name, "--name", name)
        assert lab(*add, "--cron", "0 0 1 1 *").returncode == 0
        queue = Queue(lab.folder / "state" / "queue.sqlite")
        due = [(now - timedelta(minutes=JOBS - i), "queued", "") for i in range(JOBS)]
        assert queue.enqueue(name, str(bench), due, now) == JOBS
        queue.close()
    services = [lab.start("serve") for _ in range(SERVICES)]
    try:
        for _ in range(KILLS):
            time.sleep(chance.uniform(0.5, 3.0))
            victim = chance.randrange(SERVICES)
            for pid in children(services[victim]) if chance.random() < 0.5 else ():
                os.kill(pid, signal.SIGKILL)
            services[victim].kill()
            services[victim].communicate()
            services[victim] = lab.start("serve")
        lab.wait(lambda: {state for state, *_ in lab.jobs()} == {"done"}, timeout=400)
    finally:
        for service in services:
            service.send_signal(signal.SIGTERM)
        for service in services:
            service.communicate(timeout=60)
    jobs = lab.jobs()
    assert len(jobs) == BENCHES * JOBS
    runs = [Path(run) for _, _, run, _ in jobs]
    assert len(set(runs)) == len(runs)
    infos = [json.loads((run / "run.json").read_text()) for run in runs]
    assert {info["status"] for info in infos} == {"done"}
    assert sum(attempts for *_, attempts in jobs) > len(jobs)  # some were hit
    for number in range(BENCHES):
        spans = sorted(
            span
            for run, info in zip(runs, infos, strict=True)
            if info["bench"].endswith(f"bench{number}.yaml")
            for span in moved(run)
        )
        assert len(spans) >= JOBS
        assert all(first[1] <= second[0] for first, second in pairwise(spans))


def moved(run):
    """Yield when each recording that was finished was begun, and when it was on the disk."""
    begun = None
    for entry in read_journal(run / "journal.jsonl"):
        if entry["event"] == "recording_intended":
            begun = entry["time"]
        elif entry["event"] == "recorded":
            yield begun, entry["time"]
