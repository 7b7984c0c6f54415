"""Runs on a schedule: calendar, queue and service."""
