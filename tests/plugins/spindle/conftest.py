"""Buses and drives for the spindle's tests: real sockets, real terminals, and no hardware."""

from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

import can
import pytest

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.limits import Limits
from labdrive_sim.canopen_devices import CanopenDevices, CanopenDrive, CanopenEncoder
from labdrive_sim.drive_axis import Axis
from labdrive_sim.spindle import Spindle
from labdrive_spindle.can_bus import CanBus
from labdrive_spindle.canopen_actuator import CanopenSpindle
from labdrive_spindle.canopen_sensors import CanopenDriveSensor
from labdrive_spindle.canopen_sensors import CanopenEncoder as Encoder

RECIPES = Path(__file__).parents[3] / "recipes"


def context(name, **links):
    return DeviceContext(name, Limits(), links=links)


@dataclass
class CanBench:
    """A bus inside this process with an emulated drive (5) and encoder (6) on it."""

    bus: CanBus
    axis: Axis
    devices: CanopenDevices
    drive: CanopenDrive

    def actuator(self, **settings):
        given = {"link": "can", "node": 5, "profile": {"velocity": "10 Hz"}, **settings}
        settings = CanopenSpindle.Settings.model_validate(given)
        return CanopenSpindle(settings, context("spindle", can=self.bus))

    def encoder(self, **settings):
        given = {"link": "can", "node": 6, **settings}
        return Encoder(Encoder.Settings.model_validate(given), context("encoder", can=self.bus))

    def drive_sensor(self, **settings):
        given = {"link": "can", "node": 5, "counts_per_revolution": 1 << 20, **settings}
        settings = CanopenDriveSensor.Settings.model_validate(given)
        return CanopenDriveSensor(settings, context("drive", can=self.bus))


@pytest.fixture
def can_bench():
    """Build a bench on python-can's virtual interface; closed with the test."""
    built = []

    def build(plant=None, *, connect=True, **bus_settings):
        channel = str(uuid4())
        axis = Axis(Spindle(Spindle.Settings.model_validate(plant or {}), context("plant")))
        drive, encoder = CanopenDrive(axis, 5), CanopenEncoder(axis, 6, 1e-9, 0.5e-9, 1)
        devices = CanopenDevices(drive, encoder, can.Bus(channel, "virtual"))
        given = {"interface": "virtual", "channel": channel, "sync_period": "2 ms", **bus_settings}
        bus = CanBus(CanBus.Settings.model_validate(given), context("can"))
        built.append((bus, devices))
        if connect:
            bus.connect()
        return CanBench(bus, axis, devices, drive)

    yield build
    for bus, devices in built:
        bus.close()
        devices.close()
