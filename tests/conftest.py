"""What all tests share."""

import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_state_folder(tmp_path_factory):
    """Keep locks of benches, and what else outlives a run, out of the user's own folder."""
    os.environ["LABDRIVE_STATE"] = str(tmp_path_factory.mktemp("state"))


@dataclass
class DriveProgram:
    """`labdrive-sim-drive` as a process of its own; `where` is what it says of itself."""

    process: subprocess.Popen
    where: dict

    def say(self, line):
        """Type a line to it."""
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def kill(self):
        """Pull the plug."""
        self.process.kill()
        self.process.wait()

    def end(self):
        """Have it end, and see that it does."""
        if self.process.poll() is None:
            self.process.communicate("quit\n", timeout=20)
        for stream in (self.process.stdin, self.process.stdout):
            stream.close()

    def bench(self, source, folder):
        """Write a copy of a shipped bench that reaches this program; return its path."""
        text = source.read_text()
        if "port" in self.where:
            text = re.sub(r"port: \d+", f"port: {self.where['port']}", text)
        else:
            text = re.sub(
                r"host: \S+, port: \d+", f"device: {self.where['device']}, parity: none", text
            )
        bench = folder / source.name
        bench.write_text(text)
        return bench


@pytest.fixture
def drive_program(tmp_path):
    """Start emulated drives: `drive_program("canopen", plant={...})`; all end with the test."""
    started = []

    def start(bus, *options, plant=None):
        if plant is not None:
            file = tmp_path / f"plant{len(started)}.yaml"
            file.write_text(json.dumps(plant))
            options = ("--plant", str(file), *options)
        code = "import sys; from labdrive_sim.drive_program import main; sys.exit(main())"
        process = subprocess.Popen(
            [sys.executable, "-c", code, bus, *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        line = process.stdout.readline()
        assert line, "the drive did not start"
        started.append(DriveProgram(process, json.loads(line)))
        return started[-1]

    yield start
    for program in started:
        program.end()
