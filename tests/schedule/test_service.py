"""The calendar, the queue and the service, on a clock of the test's own."""

import asyncio
import json
from datetime import datetime, timedelta
from pathlib import Path

import pytest

from labdrive.schedule.calendar import due_times
from labdrive.schedule.queue import Queue
from labdrive.schedule.service import Ended, Service
from labdrive.schedule.workers import Worker, working

from .fakes import START, Runner, schedule


def local(entry, after, until):
    zone = datetime.fromisoformat
    return [due.isoformat() for due in due_times(entry, zone(after), zone(until))]


def test_half_past_two_comes_once_on_the_night_it_happens_twice():
    entry = schedule(cron="30 2 * * *", tz="Europe/Berlin")
    found = local(entry, "2026-10-24T12:00:00+00:00", "2026-10-26T12:00:00+00:00")
    assert found == ["2026-10-25T00:30:00+00:00", "2026-10-26T01:30:00+00:00"]


def test_half_past_two_comes_at_three_on_the_night_without_it():
    entry = schedule(cron="30 2 * * *", tz="Europe/Berlin")
    found = local(entry, "2026-03-28T12:00:00+00:00", "2026-03-30T12:00:00+00:00")
    assert found == ["2026-03-29T01:00:00+00:00", "2026-03-30T00:30:00+00:00"]


def test_each_due_time_is_run_once_however_often_one_looks(queue, clock, service):
    queue.put(schedule(), clock())
    runner = Runner()
    for _ in range(10):
        clock.go(seconds=30)
        asyncio.run(service(runner).once())
        asyncio.run(service(runner).once())
    assert [due for _, due, _ in runner.ran] == [
        (START + timedelta(minutes=i)).isoformat() for i in range(1, 6)
    ]


@pytest.mark.parametrize(("missed", "runs"), [("run_once", 1), ("skip", 0)])
def test_what_was_missed_while_off_is_run_once_or_skipped(queue, clock, service, missed, runs):
    queue.put(schedule(cron="0 * * * *", missed=missed), clock())
    clock.go(hours=30, minutes=10)
    runner = Runner()
    asyncio.run(service(runner).once())
    assert len(runner.ran) == runs
    (job,) = queue.jobs()
    assert job.reason.endswith("missed, with 29 before it")
    assert job.due == (START + timedelta(hours=30)).isoformat()


@pytest.mark.parametrize(("overlap", "states"), [("queue", ["queued"]), ("skip", ["skipped"])])
def test_what_is_due_behind_another_waits_or_is_skipped(queue, clock, service, overlap, states):
    queue.put(schedule(overlap=overlap), clock())

    async def two_minutes():
        one = service(Runner())
        for _ in range(2):
            clock.go(minutes=1)
            one.queue_due()

    asyncio.run(two_minutes())
    assert [job.state for job in queue.jobs()] == ["queued", *states]


def test_a_clock_set_back_makes_nothing_due_twice(queue, clock, service):
    queue.put(schedule(cron="*/10 * * * *"), clock())
    runner = Runner()
    for jump in (11, 10, -15, 5, 5, 5, 10):
        clock.go(minutes=jump)
        asyncio.run(service(runner).once())
    dues = [due for _, due, _ in runner.ran]
    assert len(dues) == len(set(dues)) == 3


def test_paused_schedules_are_not_due_and_not_missed_either(queue, clock, service):
    queue.put(schedule(), clock())
    queue.pause("one", clock(), paused=True)
    clock.go(hours=1)
    asyncio.run(service(Runner()).once())
    queue.pause("one", clock(), paused=False)
    asyncio.run(service(Runner()).once())
    assert queue.jobs() == []


def test_failures_and_hangs_are_tried_again_as_often_as_allowed(queue, clock, service):
    queue.put(schedule(cron="0 * * * *", retries=2), clock())
    for ends in (
        [Ended("failed", "no"), Ended("hung", "still"), Ended("done", run="runs/3")],
        [Ended("failed", "no")] * 3,
    ):
        clock.now = clock.now.replace(minute=0) + timedelta(hours=1)
        runner = Runner(*ends)
        for wait in (0, 30, 60):
            clock.go(seconds=wait)
            asyncio.run(service(runner).once())
        assert [attempts for *_, attempts in runner.ran] == [1, 2, 3]
    last = queue.jobs()[-1]
    assert [job.state for job in queue.jobs()] == ["done", "failed"]
    assert last.reason == "failed: no"


def test_the_wait_for_a_retry_doubles(queue, clock, service):
    queue.put(schedule(cron="0 * * * *", retries=3), clock())
    clock.go(hours=1)
    runner, began = Runner(*[Ended("failed", "no")] * 4), []
    for second in range(300):
        asyncio.run(service(runner).once())
        began += [second] if len(runner.ran) > len(began) else []
        clock.go(seconds=1)
    assert began == [0, 30, 90, 210]


def test_what_an_interlock_stopped_is_not_tried_again(queue, clock, service):
    queue.put(schedule(retries=3), clock())
    clock.go(minutes=1)
    runner = Runner(Ended("interlock", "force 40 N passed 35 N"))
    assert not asyncio.run(service(runner).once())
    assert [(job.state, job.attempts) for job in queue.jobs()] == [("failed", 1)]


def test_a_run_that_somebody_stops_again_and_again_does_not_come_back_at_once(
    queue, clock, service
):
    queue.put(schedule(cron="0 * * * *"), clock())
    clock.go(hours=1)
    runner = Runner(*[Ended("stopped", "interrupted: stopped by SIGTERM")] * 9)
    for _ in range(61):
        asyncio.run(service(runner).once())
        clock.go(seconds=1)
    assert [attempts for *_, attempts in runner.ran] == [1, 2, 3]


def test_a_bench_that_somebody_else_has_is_tried_later(queue, clock, service):
    queue.put(schedule(), clock())
    clock.go(minutes=1)
    asyncio.run(service(Runner(Ended("busy", "in use by process 7"))).once())
    assert [job.state for job in queue.jobs()] == ["queued"]
    clock.go(seconds=29)
    runner = Runner()
    asyncio.run(service(runner).once())
    assert runner.ran == []
    clock.go(seconds=1)
    asyncio.run(service(runner).once())
    assert len(runner.ran) == 1


def test_waiting_for_a_bench_uses_up_no_retries(queue, clock, service):
    queue.put(schedule(cron="0 * * * *", retries=1), clock())
    clock.go(hours=1)
    busy = [Ended("busy", "in use by process 7")] * 3
    runner = Runner(*busy, Ended("failed", "no"), Ended("done", run="runs/5"))
    for _ in range(5):
        asyncio.run(service(runner).once())
        clock.go(seconds=30)
    assert [(job.state, job.attempts, job.failures) for job in queue.jobs()] == [("done", 5, 1)]


def test_jobs_of_a_service_that_is_gone_wait_again_and_those_of_a_living_one_do_not(
    queue, clock, service, tmp_path
):
    queue.put(schedule(), clock())
    queue.put(schedule("two", bench="other.yaml"), clock())
    clock.go(minutes=1)
    service(Runner()).queue_due()
    with working(tmp_path / "workers") as alive:
        gone = Worker("gone", tmp_path / "workers")
        (tmp_path / "workers" / "gone.lock").touch()
        claimed = [queue.claim(worker.name, clock()).id for worker in (gone, alive)]
        service(Runner()).recover()
        states = {job.id: job.state for job in queue.jobs()}
    assert [states[job] for job in claimed] == ["queued", "running"]


def test_a_removed_schedule_takes_its_waiting_jobs_along(queue, clock, service):
    queue.put(schedule(), clock())
    clock.go(minutes=1)
    service(Runner()).queue_due()
    queue.remove("one")
    assert queue.jobs() == []
    assert queue.schedules() == []


def accelerated(queue, clock, tmp_path, minutes, workers=2, benches=2):
    """Let several services share a queue over so many minutes; return what was run."""
    for i in range(benches):
        queue.put(schedule(f"every-minute-{i}", bench=f"bench-{i}.yaml"), clock())
    runner, memory = Runner(keep=False), []

    async def all_of_them(services):
        for minute in range(minutes):
            clock.go(minutes=1)
            for one in services:
                one.queue_due()
                one.start_queued()
            while any(one._tasks for one in services):
                await asyncio.sleep(0)
                for one in services:
                    one.start_queued()
            if minute in (minutes // 4, minutes - 1):
                memory.append((_resident_kb(), _open_files()))

    stores = [Queue(queue.path) for _ in range(workers)]
    with working(tmp_path / "workers") as a, working(tmp_path / "workers") as b:
        names = [a, b]
        services = [Service(store, runner, names[i % 2], clock) for i, store in enumerate(stores)]
        asyncio.run(all_of_them(services))
    for store in stores:
        store.close()
    return runner.count, memory


def _open_files():
    return len(list(Path("/proc/self/fd").iterdir()))


def _resident_kb():
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


def check_none_lost_none_doubled(queue, ran, minutes, benches):
    """The queue holds every due time, done, at the first attempt; and so many were run."""
    jobs = queue.jobs()
    assert len({(job.schedule, job.due) for job in jobs}) == minutes * benches
    assert {(job.state, job.attempts) for job in jobs} == {("done", 1)}
    assert ran == minutes * benches


def test_none_is_lost_and_none_doubled_with_two_services_on_one_queue(queue, clock, tmp_path):
    ran, _ = accelerated(queue, clock, tmp_path, minutes=100)
    check_none_lost_none_doubled(queue, ran, 100, 2)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs Linux's /proc")
def test_ten_thousand_jobs_leave_memory_and_open_files_flat(queue, clock, tmp_path):
    ran, ((before, files), (after, files_after)) = accelerated(queue, clock, tmp_path, minutes=5000)
    check_none_lost_none_doubled(queue, ran, 5000, 2)
    assert after < 1.05 * before
    assert files_after == files


@pytest.fixture
def finished(tmp_path):
    """Return a function that writes the run folder of a job that is done."""

    def write(number, rms):
        folder = tmp_path / f"20260101T{number:06d}Z-characterize-0000"
        folder.mkdir()
        info = {"status": "done", "bench": "bench.yaml", "recipe": "r.yaml", "started": ""}
        (folder / "run.json").write_text(json.dumps(info))
        result = {"unit": "m", "periodic_error": {"rms": rms}}
        (folder / "result.json").write_text(json.dumps(result))
        return Ended("done", run=str(folder))

    return write


def test_failures_and_results_out_of_control_are_told_of(queue, clock, service, finished):
    told = []

    async def tell(title, body, plots=()):
        told.append((title, body))

    errors = [1.0e-9, 1.1e-9, 0.9e-9, 1.05e-9, 1.0e-9, 9e-9]
    ends = [finished(i, rms) for i, rms in enumerate(errors)]
    queue.put(schedule(alarm="periodic_error.rms"), clock())
    runner = Runner(*ends, Ended("failed", "the cable"))
    for _ in range(7):
        clock.go(minutes=1)
        asyncio.run(service(runner, tell=tell).once())
    assert [title for title, _ in told] == ["labdrive: one alarm", "labdrive: one failed"]
    assert "periodic_error.rms 9 nm: beyond the control limits" in told[0][1]
    assert "the cable" in told[1][1]


def test_a_digest_tells_of_the_last_day_with_a_plot_for_each_alarm(queue, clock, service, finished):
    told = []

    async def tell(title, body, plots):
        told.append((title, body, [path.read_bytes()[:5] for path in plots]))

    ends = [finished(number, 1e-9 + 1e-12 * number) for number in range(6)]
    queue.put(schedule(cron="0 * * * *", alarm="periodic_error.rms"), clock())
    runner = Runner(*ends, Ended("failed", "the cable"))
    for _ in range(7):
        clock.go(hours=1)
        asyncio.run(service(runner).once())
    one = service(runner, tell=tell, digest_after=lambda after: after + timedelta(hours=12))
    assert asyncio.run(one.tell_digest(clock())) == clock()
    assert told == []
    began = clock()
    clock.go(hours=12)
    assert asyncio.run(one.tell_digest(began)) == clock()
    ((title, body, plots),) = told
    assert title == "labdrive: 6 done, 1 failed"
    assert "one: 6 done, 1 failed" in body
    assert "the cable" in body
    assert "periodic_error.rms 1.005 nm, limits" in body
    assert plots == [b"<?xml"]
