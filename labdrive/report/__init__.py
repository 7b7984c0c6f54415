"""The report of a run: one page that needs nothing else, made from the run folder alone."""

from contextlib import suppress
from pathlib import Path

from labdrive.model.errors import StoreError
from labdrive.report.page import page


def write_report(run: Path) -> Path:
    """Write `run`/report.html, aside and then renamed, and return its path.

    The same folder gives the same page, byte for byte. StoreError if a file of the run is damaged
    or the page cannot be written.
    """
    path = run / "report.html"
    aside = path.with_name(".report.html.part")
    text = page(run)
    try:
        aside.write_text(text, encoding="utf-8", newline="\n")
        aside.replace(path)
    except OSError as error:
        with suppress(OSError):
            aside.unlink(missing_ok=True)
        why = error.strerror or error
        raise StoreError(f"cannot write {path}: {why}; free some space, or its folder") from error
    return path
