"""`labdrive-sim-drive`: emulated spindle drives as programs, on a CAN bus or on Modbus.

Lines on standard input make things go wrong while it runs; `help` lists them.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TextIO

import yaml
from pydantic import ValidationError

from labdrive.interfaces.devices import DeviceContext
from labdrive.interfaces.limits import Limits
from labdrive_sim.drive_axis import Axis, AxisSettings
from labdrive_sim.spindle import Spindle
from labdrive_sim.wire_faults import Faults

SWITCH_INTERVAL_S = 2e-4
HELP = """fault CODE     raise a fault, as 0x7305
delay SECONDS  answer so much later
garble         send PDOs or answers that are cut short or spoilt
silent         send nothing any more
as-node N      answer under another node's number
well           be well again (a fault must be reset)
flood SECONDS  fill the CAN bus
state          tell, as JSON, where the motor is and whether it moves
quit           end"""

MAPS = ("cia402", "nanotec", "leadshine", "iai")

Command = Callable[[str], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one emulated drive until standard input ends or says `quit`."""
    options = _parser().parse_args(arguments)
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    try:
        plant = _plant(options.plant)
    except (OSError, yaml.YAMLError, ValidationError, TypeError) as error:
        print(f"labdrive-sim-drive: {options.plant}: {error}", file=sys.stderr)
        return 2
    settings = AxisSettings(counts_per_turn=options.counts, lag_s=options.lag)
    axis = Axis(plant, settings)
    serve = _serve_canopen if options.bus == "canopen" else _serve_modbus
    try:
        return int(serve(options, axis))
    except OSError as error:
        print(f"labdrive-sim-drive: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="labdrive-sim-drive",
        description="An emulated spindle drive.",
        epilog=f"On standard input:\n{HELP}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    buses = parser.add_subparsers(dest="bus", required=True)
    can = buses.add_parser("canopen", help="a CiA 402 drive and a CiA 406 encoder on CAN")
    can.add_argument("--node", type=int, default=5, help="the drive's number (5)")
    can.add_argument("--encoder-node", type=int, default=6, help="the encoder's number (6)")
    can.add_argument("--interface", help="a python-can interface to join, instead of serving one")
    can.add_argument("--channel", default="can0", help="channel to serve or join (can0)")
    modbus = buses.add_parser("modbus", help="a drive with Modbus registers")
    modbus.add_argument("--map", default="cia402", choices=MAPS, help="make of the drive (cia402)")
    modbus.add_argument("--unit", type=int, default=1, help="its unit number (1)")
    modbus.add_argument("--speed", type=int, default=1, help="of its clock: times real time (1)")
    modbus.add_argument(
        "--status-lag", type=float, default=0.0, help="its status registers are so late, s (0)"
    )
    modbus.add_argument("--pty", action="store_true", help="serve RTU on a pseudo-terminal")
    for bus in (can, modbus):
        bus.add_argument("--host", default="127.0.0.1", help="address to serve on (127.0.0.1)")
        bus.add_argument("--port", type=int, default=0, help="port to serve on (a free one)")
        bus.add_argument("--plant", type=Path, help="YAML file with settings of `sim-spindle`")
        bus.add_argument("--counts", type=int, default=1 << 20, help="counts a revolution")
        bus.add_argument("--lag", type=float, default=2e-3, help="of the motor's control, s")
        bus.add_argument("--resolution", type=float, default=1e-9, help="of the encoder, m")
        bus.add_argument("--noise", type=float, default=0.5e-9, help="of the encoder, m rms")
        bus.add_argument("--seed", type=int, default=1, help="of that noise")
    return parser


def _plant(file: Path | None) -> Spindle:
    given = yaml.safe_load(file.read_text()) if file else {}
    settings = Spindle.Settings.model_validate(given or {})
    return Spindle(settings, DeviceContext("plant", Limits()))


def _serve_canopen(options: argparse.Namespace, axis: Axis) -> int:
    import can

    from labdrive_sim.canopen_devices import CanopenDevices, CanopenDrive, CanopenEncoder
    from labdrive_sim.canopen_node import flood
    from labdrive_sim.socketcand import Hub

    def open_bus() -> can.BusABC:
        interface = options.interface or "virtual"
        return can.Bus(interface=interface, channel=options.channel)

    hub = None if options.interface else Hub(open_bus, options.host, options.port)
    drive = CanopenDrive(axis, options.node)
    encoder = CanopenEncoder(
        axis, options.encoder_node, options.resolution, options.noise, options.seed
    )
    devices = CanopenDevices(drive, encoder, open_bus())

    def set_faults(**faults: Any) -> None:
        devices.bus.faults = Faults(**faults)

    def _flood(seconds: str) -> None:
        # Frames of the highest priority win every arbitration: no device gets a word in.
        set_faults(silent=True)
        flood(open_bus(), float(seconds))
        set_faults()

    commands: dict[str, Command] = {
        **wire_commands(axis, set_faults),
        "flood": _flood,
    }
    _say(
        {
            "drive": options.node,
            "encoder": options.encoder_node,
            "channel": options.channel,
            **({} if hub is None else {"host": options.host, "port": hub.port}),
        }
    )
    _obey(sys.stdin, commands)
    devices.close()
    if hub is not None:
        hub.close()
    return 0


def _serve_modbus(options: argparse.Namespace, axis: Axis) -> int:
    from labdrive_sim.modbus_drive import ModbusDevice

    device = ModbusDevice(axis, options)
    server = device.server

    def set_faults(**faults: Any) -> None:
        server.faults = Faults(**faults)

    where: dict[str, Any] = {"unit": options.unit, "map": options.map}
    if options.pty:
        where["device"] = server.serve_terminal()
    else:
        where |= {"host": options.host, "port": server.serve_tcp(options.host, options.port)}
    _say(where)
    _obey(sys.stdin, wire_commands(axis, set_faults))
    device.close()
    return 0


def wire_commands(axis: Axis, set_faults: Callable[..., None]) -> dict[str, Command]:
    """Return the commands that every bus has; `set_faults` takes what is wrong with answers."""
    return {
        "fault": lambda code: axis.fail(int(code, 0)),
        "delay": lambda seconds: set_faults(delay_s=float(seconds)),
        "garble": lambda _: set_faults(garble=True),
        "silent": lambda _: set_faults(silent=True),
        "as-node": lambda node: set_faults(as_node=int(node)),
        "well": lambda _: set_faults(),
        "state": lambda _: _say(axis.told()),
    }


def _say(ready: dict[str, Any]) -> None:
    """Say, as a line of JSON, where it can be reached."""
    print(json.dumps(ready), flush=True)


def _obey(lines: TextIO, commands: dict[str, Command]) -> None:
    """Do what standard input says, line by line, until it ends or says `quit`."""
    for line in lines:
        word, _, rest = line.strip().partition(" ")
        if word == "quit":
            return
        if word == "help":
            print(HELP, flush=True)
        elif word in commands:
            _try(commands[word], rest, line)
        elif word:
            print(f"no such command: {word}; help lists them", file=sys.stderr)


def _try(command: Command, rest: str, line: str) -> None:
    try:
        command(rest)
    except ValueError as error:
        print(f"{line.strip()}: {error}", file=sys.stderr)
