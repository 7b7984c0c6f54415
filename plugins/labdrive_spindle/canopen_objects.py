"""Objects of CiA 402 drives (IEC 61800-7-201) and CiA 406 encoders, by the names used here."""

from labdrive_spindle.canopen_device import Object

DRIVE_PROFILE = 402
ENCODER_PROFILE = 406

DRIVE = {
    "error_code": Object(0x603F, 0, 16),
    "connection_lost_option": Object(0x6007, 0, 16, signed=True),
    "controlword": Object(0x6040, 0, 16),
    "statusword": Object(0x6041, 0, 16),
    "quick_stop_option": Object(0x605A, 0, 16, signed=True),
    "mode": Object(0x6060, 0, 8, signed=True),
    "mode_display": Object(0x6061, 0, 8, signed=True),
    "position": Object(0x6064, 0, 32, signed=True),
    "following_window": Object(0x6065, 0, 32),
    "following_timeout": Object(0x6066, 0, 16),
    "target_position": Object(0x607A, 0, 32, signed=True),
    "lowest_position": Object(0x607D, 1, 32, signed=True),
    "highest_position": Object(0x607D, 2, 32, signed=True),
    "profile_velocity": Object(0x6081, 0, 32),
    "profile_acceleration": Object(0x6083, 0, 32),
    "profile_deceleration": Object(0x6084, 0, 32),
    "encoder_counts": Object(0x608F, 1, 32),
    "encoder_turns": Object(0x608F, 2, 32),
    "gear_motor_turns": Object(0x6091, 1, 32),
    "gear_shaft_turns": Object(0x6091, 2, 32),
    "feed": Object(0x6092, 1, 32),
    "feed_shaft_turns": Object(0x6092, 2, 32),
    "homing_method": Object(0x6098, 0, 8, signed=True),
    "homing_velocity": Object(0x6099, 1, 32),
    "homing_slow": Object(0x6099, 2, 32),
    "position_unit": Object(0x60A8, 0, 32),
    "velocity_unit": Object(0x60A9, 0, 32),
    "interpolation_value": Object(0x60C2, 1, 8),
    "interpolation_exponent": Object(0x60C2, 2, 8, signed=True),
    "following_error": Object(0x60F4, 0, 32, signed=True),
}

ENCODER = {
    # UNSIGNED32 in CiA 406; with a sign it does not jump where it passes zero.
    "position": Object(0x6004, 0, 32, signed=True),
    "measuring_step": Object(0x6501, 0, 32),
}
