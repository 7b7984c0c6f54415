"""The method: harmonics of a recording, phase maps that straighten them, walking waveforms.

Pure functions of arrays and values of `labdrive.model`: no files, no devices.
"""
