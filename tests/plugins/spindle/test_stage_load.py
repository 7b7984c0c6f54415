"""A motorized stage as a bench's load: it presses a spring, and lets it go."""

import pytest

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.limits import Limits
from labdrive.model.errors import DeviceError, InputError
from labdrive_sim.drive_axis import STOPPING
from labdrive_spindle.stage_load import CanopenStageLoad, ModbusStageLoad

from .test_modbus import COUNTS, REGISTERS, link  # noqa: F401 a fixture

SPRING = {"stiffness": "2 N/mm", "contact": 0.5}


@pytest.fixture
def canopen(can_bench):
    bench = can_bench({"backlash": "0 um"})
    drive = {"link": "can", "node": 5, "profile": {"velocity": "10 Hz"}}
    drive |= {"turns": {"min": -1, "max": 8}}
    settings = CanopenStageLoad.Settings.model_validate({**SPRING, "drive": drive})
    context = DeviceContext("load", Limits(), links={"can": bench.bus})
    return bench, CanopenStageLoad(settings, context)


def travel(bench):
    """Return where the stage stands [mm]."""
    return 1e3 * bench.axis.plant.stretch.position[-1]


def test_a_force_is_a_travel_of_the_spring(canopen):
    bench, load = canopen
    load.make_safe()
    load.connect()
    assert load.apply(10.0) == 10.0
    assert travel(bench) == pytest.approx(5.5, abs=0.02)
    assert load.apply(3.0) == 3.0
    assert travel(bench) == pytest.approx(2.0, abs=0.02)
    load.make_safe()
    load.make_safe()
    assert travel(bench) == pytest.approx(0.5, abs=0.02)
    assert bench.axis.state == STOPPING
    load.close()
    load.close()


def test_making_it_safe_anew_moves_nothing(canopen):
    bench, load = canopen
    load.connect()
    load.apply(10.0)
    load.close()
    load.connect()  # as a fresh process does, which does not know where the contact is
    before = travel(bench)
    load.make_safe()
    assert travel(bench) == before
    load.close()


def test_forces_that_cannot_be_had_are_refused_before_moving(canopen):
    bench, load = canopen
    load.connect()
    with pytest.raises(DeviceError, match="a spring cannot pull"):
        load.apply(-1.0)
    with pytest.raises(DeviceError, match=r"would turn to 10\.500 revolutions"):
        load.apply(20.0)
    assert travel(bench) == pytest.approx(0, abs=0.01)


def test_a_stage_on_modbus_does_the_same(drive_program, link):  # noqa: F811 as above
    program = drive_program("modbus", "--speed", "8", "--counts", str(COUNTS))
    bus = link(program.where)
    drive = {"link": "bus", "counts_per_revolution": COUNTS, "registers": REGISTERS}
    settings = ModbusStageLoad.Settings.model_validate({**SPRING, "drive": drive})
    load = ModbusStageLoad(settings, DeviceContext("load", Limits(), links={"bus": bus}))
    load.connect()
    load.apply(2.0)
    position = bus.read(1, 3, 0x7000, 2)
    nanometres = position[0] << 16 | position[1]
    assert nanometres == pytest.approx(1.5e6, abs=20e3)
    load.make_safe()
    load.close()


def test_a_wrong_link_is_told_where_it_stands():
    drive = {"link": "bus", "node": 5}
    settings = CanopenStageLoad.Settings.model_validate({**SPRING, "drive": drive})
    with pytest.raises(InputError, match=r"load\.drive\.link: must name a can-bus link"):
        CanopenStageLoad(settings, DeviceContext("load", Limits()))
