"""What the error codes of CiA 402 drives mean: object 603Fh and the codes of EMCY messages.

Source: CiA 301, table of emergency error codes; IEC 61800-7-201, annex on error codes.
"""

_WORDS = {
    0x0000: "no error code",
    0x1000: "a generic error",
    0x2310: "continuous over-current at the output",
    0x2320: "a short circuit or earth leakage at the output",
    0x2340: "a short circuit at the output",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3210: "over-voltage of the intermediate circuit",
    0x3220: "under-voltage of the intermediate circuit",
    0x4110: "excess ambient temperature",
    0x4210: "excess temperature of the drive",
    0x4310: "excess temperature of the power stage",
    0x5112: "under-voltage of the 24 V supply",
    0x5441: "the safe-torque-off input is open",
    0x5530: "a damaged parameter memory",
    0x6010: "a software reset by its watchdog",
    0x6320: "parameters that contradict one another",
    0x7121: "a blocked motor",
    0x7300: "a sensor error",
    0x7305: "an error of the incremental encoder",
    0x7320: "an error of the position sensor",
    0x7500: "a communication error",
    0x8110: "an overrun of the CAN controller (objects lost)",
    0x8120: "a CAN controller in passive error mode",
    0x8130: "a missing heartbeat, or life-guarding error",
    0x8140: "a recovery from bus-off",
    0x8210: "a PDO of the wrong length",
    0x8220: "a PDO that is too long",
    0x8240: "an unexpected length of SYNC data",
    0x8250: "an RPDO that came too late",
    0x8400: "an error of the speed monitor",
    0x8480: "too large a speed",
    0x8500: "an error of the position monitor",
    0x8600: "a positioning error",
    0x8611: "too large a following error",
    0x8612: "a reference limit that was passed",
    0x8613: "a homing error",
    0x8700: "an error of the synchronization (SYNC missing or late)",
    0xFF01: "a manufacturer's own error",
}

# What is said of a code that is not listed: by its highest digits.
_GROUPS = {
    0x10: "a generic error",
    0x20: "a current error",
    0x30: "a voltage error",
    0x40: "a temperature error",
    0x50: "a hardware error",
    0x60: "a software error",
    0x70: "an error of an additional module",
    0x80: "a monitoring error",
    0x90: "an external error",
    0xF0: "an error of an additional function",
}


def words_for(code: int) -> str:
    """Return a code in words, with its number."""
    group = _GROUPS.get((code >> 8) & 0xF0, "an unknown error")
    if code >> 8 == 0xFF:
        group = "a manufacturer's own error"
    return f"{_WORDS.get(code, group)} (code 0x{code:04X})"
