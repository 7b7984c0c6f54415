"""The report of a run: one page that needs nothing else, made from the run folder alone."""

from pathlib import Path

from labdrive.report.page import page


def write_report(run: Path) -> Path:
    """Write `run`/report.html, aside and then renamed, and return its path.

    The same folder gives the same page, byte for byte. OSError if it cannot be written.
    """
    path = run / "report.html"
    aside = path.with_name(".report.html.part")
    aside.write_text(page(run), encoding="utf-8")
    aside.replace(path)
    return path
