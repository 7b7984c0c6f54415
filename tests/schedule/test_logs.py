"""The logs of jobs: the newest are kept, whatever other services remove meanwhile."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

from labdrive.schedule.process import LOGS_KEPT, ProcessRunner


def test_two_services_can_remove_old_logs_at_once(tmp_path):
    for number in range(LOGS_KEPT):
        (tmp_path / f"job-{number}-1.log").touch()
    runner = ProcessRunner(tmp_path / "runs", tmp_path)

    def attempts(first):
        return [
            runner._new_log(SimpleNamespace(id=first + i, attempts=1)).exists() for i in range(60)
        ]

    with ThreadPoolExecutor(2) as pool:
        found = [*pool.map(attempts, (5000, 9000))]
    assert all(map(all, found))
    assert len(list(tmp_path.glob("*.log"))) <= LOGS_KEPT + 1
