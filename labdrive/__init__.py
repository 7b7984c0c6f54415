"""Measure and remove the periodic error of actuators with an internal periodic process."""
