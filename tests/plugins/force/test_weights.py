"""Weights that a person places."""

import pytest

import labdrive_force
from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.limits import Limits
from labdrive.model.errors import DeviceError


class Person:
    """Gives the answers in order; keeps the questions."""

    def __init__(self, *answers):
        self.answers = list(answers)
        self.questions = []

    def __call__(self, question):
        self.questions.append(question)
        return self.answers.pop(0)


def weights(ask, **settings):
    cls = labdrive_force.labdrive_loads()["weights-by-hand"]
    context = DeviceContext("load", Limits(), ask=ask)
    return cls(cls.Settings.model_validate(settings), context)


def test_a_nod_means_what_was_asked_for():
    person = Person("")
    assert weights(person).apply(20.0) == 20.0
    assert "20 N (2.039 kg)" in person.questions[0]


@pytest.mark.parametrize(("answer", "force"), [("19.5 N", 19.5), ("2 kg", 19.6133), ("0 N", 0.0)])
def test_what_was_placed_counts_as_a_force_or_a_mass(answer, force):
    assert weights(Person(answer)).apply(20.0) == pytest.approx(force)


def test_on_a_friction_pair_the_same_mass_is_less_force():
    assert weights(Person("2 kg"), force_per_mass="2 N/kg").apply(4.0) == 4.0


@pytest.mark.parametrize("nonsense", ["20", "twenty", "3 m", "-1 N"])
def test_nonsense_is_asked_again_with_the_reason(nonsense):
    person = Person(nonsense, "20 N")
    assert weights(person).apply(20.0) == 20.0
    assert "as 20 N or 2 kg, or nothing for 20 N" in person.questions[1]


def test_nobody_there_is_an_error():
    load = weights(None)
    load.make_safe()
    with pytest.raises(DeviceError, match="nobody is there"):
        load.apply(1.0)
    load.close()
