"""What must not end a service: a full disk, a wrong clock, damaged files, services that die."""

import asyncio
import json
from contextlib import contextmanager
from datetime import timedelta

import pytest

from labdrive.model.errors import StoreError
from labdrive.schedule.queue import Queue
from labdrive.schedule.service import Ended
from labdrive.schedule.workers import Worker

from .fakes import START, Runner, schedule


class Full(Queue):
    """A queue on a disk that is full for as long as the test says so."""

    full = False

    @contextmanager
    def _change(self):
        if self.full:
            raise StoreError("the job store: database or disk is full")
        with super()._change():
            yield


@pytest.fixture
def queue(tmp_path):
    queue = Full(tmp_path / "queue.sqlite")
    yield queue
    queue.close()


class Told:
    """Notes what people are told."""

    def __init__(self):
        self.titles = []
        self.bodies = []

    async def __call__(self, title, body, plots=()):
        self.titles.append(title)
        self.bodies.append(body)


async def served(one, until, looks=2000):
    """Let a service look again and again, without waiting, until something is so."""
    task = asyncio.ensure_future(one.serve())
    for _ in range(looks):
        await asyncio.sleep(0)
        if until() or task.done():
            break
    assert not task.done(), task
    assert until()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


def states(queue):
    return [job.state for job in queue.jobs()]


@pytest.mark.parametrize(("how", "title"), [("done", None), ("failed", "labdrive: one failed")])
def test_the_end_of_a_job_is_noted_when_a_full_disk_has_room_again(
    queue, clock, service, caplog, how, title
):
    queue.put(schedule(), clock())
    clock.go(minutes=1)
    told, waited = Told(), []

    class Filling(Runner):
        async def run(self, job, entry):
            queue.full = True
            return await super().run(job, entry)

    async def sleep(seconds):
        waited.append(seconds)
        if waited.count(5.0) == 3:
            # People know before there is room.
            assert told.titles == ([] if title is None else [title])
            queue.full = False
        await asyncio.sleep(0)

    one = service(Filling(Ended(how, "the cable")), sleep=sleep, tell=told)
    asyncio.run(served(one, lambda: states(queue) == [how]))
    assert waited.count(5.0) == 3
    assert caplog.text.count("cannot be noted yet") == 1
    assert told.titles == ([] if title is None else [title])


def test_a_full_disk_when_a_job_is_due_leaves_the_runs_on_other_benches_alone(
    queue, clock, service, caplog
):
    queue.put(schedule("long", bench="other.yaml", cron="1 12 * * *"), clock())
    queue.put(schedule("due", cron="2 12 * * *"), clock())
    clock.go(minutes=1)
    looks, ran = [], []

    class Long(Runner):
        async def run(self, job, entry):
            while len(looks) < 20 and job.schedule == "long":  # noqa: ASYNC110 as services look
                await asyncio.sleep(0)
            ran.append(job.schedule)
            return Ended("done", run=f"runs/{job.id}")

    async def sleep(_):
        looks.append(None)
        if len(looks) == 3:
            queue.full = True
            clock.go(minutes=1)
        if len(looks) == 10:
            queue.full = False
        await asyncio.sleep(0)

    asyncio.run(served(service(Long(), sleep=sleep), lambda: len(ran) == 2))
    assert ran == ["due", "long"]
    assert caplog.text.count("disk is full") == 1


def test_a_job_of_ones_own_that_nothing_is_at_work_on_waits_again(queue, clock, service, tmp_path):
    queue.put(schedule(), clock())
    clock.go(minutes=1)
    one = service(Runner())
    one.queue_due()
    (name,) = [path.stem for path in (tmp_path / "workers").glob("*.lock")]
    queue.claim(name, clock())
    asyncio.run(served(one, lambda: states(queue) == ["done"]))


def test_a_failed_change_leaves_no_transaction_behind(queue, clock):
    """A full disk fails COMMIT too; deferred foreign keys are a way to have that without one."""
    queue._db.executescript(
        "PRAGMA foreign_keys = ON; CREATE TABLE a (id INTEGER PRIMARY KEY);"
        "CREATE TABLE b (a REFERENCES a (id) DEFERRABLE INITIALLY DEFERRED);"
    )
    with pytest.raises(StoreError), queue._change():
        queue._db.execute("INSERT INTO b VALUES (7)")
    queue.put(schedule(), clock())
    assert [one.entry.name for one in queue.schedules()] == ["one"]


def test_a_clock_that_was_far_ahead_silences_nothing(queue, clock, service, caplog):
    queue.put(schedule(cron="0 2 * * *", retries=1), clock())
    clock.now = START.replace(year=2036)
    asyncio.run(service(Runner(Ended("failed", "no"))).once())
    clock.now = START
    runner = Runner()
    for _ in range(10):
        clock.go(days=1)
        asyncio.run(service(runner).once())
    dues = [due for _, due, _ in runner.ran]
    assert len(dues) == len(set(dues)) == 10
    assert caplog.text.count("yet to come") == 1


def test_a_digest_comes_again_when_a_clock_that_was_far_ahead_was_put_right(clock, service):
    told = Told()
    one = service(Runner(), tell=told, digest_after=lambda last: last + timedelta(hours=24))

    async def days():
        last = await one.tell_digest(START.replace(year=2036))
        for _ in range(3):
            clock.go(days=1)
            last = await one.tell_digest(last)

    asyncio.run(days())
    assert len(told.titles) == 3


def test_a_job_that_ends_after_a_digest_is_in_the_next(queue, clock, service):
    queue.put(schedule(cron="30 6 * * *"), clock())
    clock.now = START.replace(day=3, hour=6, minute=30)
    told = Told()
    one = service(Runner(), tell=told, digest_after=lambda last: last)
    one.queue_due()
    job = queue.claim("w", clock())
    clock.go(minutes=30)
    asyncio.run(one.tell_digest(clock()))
    clock.go(minutes=30)
    queue.finish(job.id, "failed", "the device was lost", None, clock())
    clock.go(hours=23, minutes=30)
    asyncio.run(one.tell_digest(clock()))
    clock.go(hours=24)
    asyncio.run(one.tell_digest(clock()))
    assert told.titles == [f"labdrive: 0 done, {n} failed" for n in (0, 1, 0)]
    assert "the device was lost" in told.bodies[1]


def test_a_digest_that_cannot_be_made_or_sent_is_logged(queue, clock, service, caplog):
    async def broken(title, body, plots=()):
        raise TypeError("no such plot")

    one = service(Runner(), tell=broken, digest_after=lambda last: last)
    assert asyncio.run(one.tell_digest(clock())) == clock()
    assert "it could not be told what the last day brought" in caplog.text


def test_damaged_results_stop_neither_alarm_nor_service(queue, clock, service, tmp_path, caplog):
    folder = tmp_path / "20260101T000000Z-characterize-0000"
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps({"status": "done"}))
    (folder / "result.json").write_text('{"periodic_')
    queue.put(schedule(alarm="periodic_error.rms"), clock())
    clock.go(minutes=1)
    assert asyncio.run(service(Runner(Ended("done", run=str(folder)))).once())
    assert states(queue) == ["done"]
    assert "result.json" in caplog.text


def test_an_alarm_on_a_number_that_results_lack_is_told_once(queue, clock, service, tmp_path):
    folder = tmp_path / "20260101T000000Z-characterize-0000"
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps({"status": "done"}))
    (folder / "result.json").write_text(
        json.dumps({"unit": "m", "step_size": 1e-6, "periodic_error": {"rms": 1e-9}})
    )
    queue.put(schedule(alarm="periodic_eror.rms"), clock())
    told = Told()
    one = service(Runner(*[Ended("done", run=str(folder))] * 2), tell=told)
    for _ in range(2):
        clock.go(minutes=1)
        asyncio.run(one.once())
    assert told.titles == ["labdrive: one alarm"]
    assert "no periodic_eror.rms to watch" in told.bodies[0]
    assert "step_size, periodic_error.rms" in told.bodies[0]


def test_a_changed_cron_is_due_from_now_on(queue, clock, service):
    queue.put(schedule(cron="0 2 * * *"), clock())
    clock.go(days=3)
    queue.put(schedule(cron="0 6 * * *"), clock())
    assert service(Runner()).queue_due() == 0
    queue.put(schedule(cron="0 6 * * *", retries=1), clock())
    clock.go(days=1)
    assert service(Runner()).queue_due() == 1


def test_what_changes_beside_the_times_loses_no_due_time(queue, clock, service):
    queue.put(schedule(cron="0 2 * * *"), clock())
    clock.go(days=1)
    queue.put(schedule(cron="0 2 * * *", retries=1), clock())
    assert service(Runner()).queue_due() == 1


def test_nothing_of_a_paused_schedule_begins_or_is_gone_on_with(queue, clock, service):
    queue.put(schedule(cron="0 * * * *"), clock())
    clock.go(hours=1)
    runner = Runner(Ended("stopped", "interrupted: stopped by SIGTERM"))
    asyncio.run(service(runner).once())
    queue.pause("one", clock(), paused=True)
    clock.go(minutes=5)
    asyncio.run(service(runner).once())
    assert len(runner.ran) == 1
    queue.pause("one", clock(), paused=False)
    asyncio.run(service(runner).once())
    assert [attempts for *_, attempts in runner.ran] == [1, 2]


def test_a_run_that_has_outlived_its_service_is_watched_even_while_paused(
    queue, clock, service, tmp_path
):
    queue.put(schedule(), clock())
    clock.go(minutes=1)
    runner = Runner()
    service(runner).queue_due()
    (tmp_path / "workers" / "gone.lock").touch()
    job = queue.claim(Worker("gone", tmp_path / "workers").name, clock())
    runner.alive.add(job.id)
    queue.pause("one", clock(), paused=True)
    asyncio.run(service(runner).once())
    assert states(queue) == ["done"]
    assert [attempts for *_, attempts in runner.ran] == [2]


def test_only_one_service_takes_over_what_another_left(queue, clock, service):
    queue.put(schedule(), clock())
    clock.go(minutes=1)
    service(Runner()).queue_due()
    left = queue.claim("gone", clock())
    assert queue.take_over(left, "first", clock()).worker == "first"
    assert queue.take_over(left, "second", clock()) is None
    queue.recover(left, clock())
    assert states(queue) == ["running"]


def test_once_says_whether_all_went_well(queue, clock, service):
    queue.put(schedule(), clock())
    clock.go(minutes=1)
    assert asyncio.run(service(Runner()).once())
    clock.go(minutes=1)
    assert not asyncio.run(service(Runner(Ended("failed", "no"))).once())
    clock.go(minutes=1)
    queue.full = True
    assert not asyncio.run(service(Runner()).once())
