"""Records for ever into the run folder given, saying each number once it is durable."""

import sys
from pathlib import Path

import numpy as np

from labdrive.model.recording import Recording
from labdrive.store.journal import Journal
from labdrive.store.recordings import write_recording


def record_for_ever(run):
    phase = np.linspace(0, 1, 20_000)
    with Journal(run / "journal.jsonl") as journal:
        for number in range(1, 10_000):
            journal.append("recording_intended", number=number)
            columns = {"s": number * phase}
            recording = Recording(number, "endless", phase, phase, columns, {"s": "m"}, 16, 4)
            stored = write_recording(run / "recordings", recording)
            journal.append("recorded", number=number, file=stored.file, sha256=stored.sha256)
            sys.stdout.write(f"{number}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    record_for_ever(Path(sys.argv[1]))
