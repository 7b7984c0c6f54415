"""Ready-made register maps, each with its source, and what each kind of drive has to have."""

from labdrive.model.errors import InputError, Problem
from labdrive.model.wording import no_such
from labdrive_spindle.registers import Register

CIA402_NEEDS = (
    "controlword",
    "statusword",
    "error_code",
    "mode",
    "mode_display",
    "position",
    "target_position",
    "profile_velocity",
)
CIA402_MAY_HAVE = (
    "profile_acceleration",
    "profile_deceleration",
    "homing_method",
    "homing_velocity",
    "homing_slow",
    "watchdog_time",
)

# Leadshine CS2RS series user manual: motion status and feedback (4.3), PR control (Pr8.02), the
# block of path 0 from Pr9.00 on (4.5, immediate trigger), auxiliary control word (4.3).
LEADSHINE = {
    "enable": Register(address=0x000F, write=6),
    "status": Register(address=0x1003),
    "position": Register(address=0x1014, type="int32"),
    "auxiliary": Register(address=0x1801, write=6),
    "alarm": Register(address=0x2203),
    "control": Register(address=0x6002, write=6),
}
LEADSHINE_PATH = 0x6200

# IAI, Modbus instruction manual for ROBO Cylinder controllers: PNOW, ALMC, DSS1 to DSSE (4.3.2),
# DRG1 (5.5.1) and the block of the numerical value movement command (5.6.1).
IAI = {
    "position": Register(address=0x9000, type="int32"),
    "alarm": Register(address=0x9002),
    "status": Register(address=0x9005),
    "control": Register(address=0x0D00, write=6),
}
IAI_STATUS = 0x9005
IAI_MOVE = 0x9900

# Nanotec, manuals of Modbus controllers, "Process data objects (PDO)": where the images begin.
NANOTEC_SENT = 5000
NANOTEC_TAKEN = 6000


def checked(given: dict[str, Register], field: str) -> dict[str, Register]:
    """Return a bench's own CiA 402 map; InputError for a name that is missing, or is none."""
    known = (*CIA402_NEEDS, *CIA402_MAY_HAVE)
    problems = [Problem(no_such("register", name, known), field) for name in given.keys() - known]
    missing = [name for name in CIA402_NEEDS if name not in given]
    if missing:
        problems.append(Problem(f"missing: {', '.join(missing)}", field))
    if problems:
        raise InputError(*problems)
    return given
