"""What a bench's limits make of readings, and what the supervisor beside a run is told of them."""

import io
import json

import numpy as np

from labdrive.engine.interlocks import Interlocks
from labdrive.engine.limits import Watch
from labdrive.engine.supervisor import Supervisor
from labdrive.interfaces.devices import Reading
from labdrive.interfaces.interlocks import Interlock
from labdrive.interfaces.limits import Limits


def bounds_told(remembered, *values):
    condition = Interlock.model_validate({"sensor": "room", "within": "0.5 K"})
    interlocks = Interlocks([condition], {"room": "K"})
    interlocks.remember(remembered)
    pipe = io.StringIO()
    watch = Watch(Limits(), {"room": "K"}, "m", interlocks, Supervisor(pipe))
    for value in values:
        watch.check("room", Reading(np.array([value]), np.zeros(1)))
    told = map(json.loads, pipe.getvalue().splitlines())
    return [line for line in told if line[0] == "bounds"]


def test_the_supervisor_is_told_bounds_around_the_first_reading():
    assert bounds_told({}, 293.0, 293.4) == [["bounds", "room", 292.5, 293.5]]


def test_after_a_resume_the_bounds_are_those_of_before_the_kill():
    assert bounds_told({"room": 293.0}, 293.4) == [["bounds", "room", 292.5, 293.5]]
