"""Conformance checks for authors of device plugins: call them from your own tests."""

from labdrive.testing.conformance import check_actuator, check_sensor

__all__ = ["check_actuator", "check_sensor"]
