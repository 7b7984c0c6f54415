"""Questions to the person at the bench, on a page that a browser on this machine shows."""

import html
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs

HOST = "127.0.0.1"
LONGEST_ANSWER = 10_000
PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>labdrive asks</title>{refresh}
<style>:root {{ color-scheme: light dark; font: 1.25rem/1.5 sans-serif }}
body {{ max-width: 32rem; margin: 4rem auto; padding: 0 1rem }}
input, button {{ font: inherit; padding: .4rem .7rem }}</style></head><body>{body}</body></html>
"""
FORM = """<form method="post"><p>{question}</p>
<input name="answer" autofocus autocomplete="off"> <button>Done</button>
<input type="hidden" name="number" value="{number}"></form>"""
IDLE = "<p>Nothing to do: the run goes on by itself. This page looks again every second.</p>"
REFRESH = '<meta http-equiv="refresh" content="1">'


class _Asked:
    """One question at a time, put by the run's thread, answered by the server's."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self.question: str | None = None
        self.number = 0
        self._answer = ""

    def ask(self, question: str) -> str:
        """Show a question; wait, as long as it takes, for its answer."""
        with self._changed:
            self.number += 1
            self.question = question
            while self.question is not None:
                # With a limit, so that Ctrl-C is not held up.
                self._changed.wait(0.2)
            return self._answer

    def answer(self, number: str, text: str) -> None:
        """Take an answer, unless it is to a question that was answered before."""
        with self._changed:
            if self.question is not None and number == str(self.number):
                self._answer, self.question = text, None
                self._changed.notify_all()


@contextmanager
def page(port: int) -> Iterator[tuple[str, Callable[[str], str]]]:
    """Serve the page on 127.0.0.1 (port 0: any that is free); yield its address and `ask`."""
    asked = _Asked()
    server = ThreadingHTTPServer((HOST, port), _handler(asked))
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1})
    thread.daemon = True
    thread.start()
    try:
        yield f"http://{HOST}:{server.server_port}/", asked.ask
    finally:
        server.shutdown()
        server.server_close()


def _handler(asked: _Asked) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            question, number = asked.question, asked.number
            form = FORM.format(question=html.escape(question or ""), number=number)
            body = form if question is not None else IDLE
            text = PAGE.format(body=body, refresh="" if question is not None else REFRESH)
            self._send(200, text.encode())

        def do_POST(self) -> None:
            # Only a form of this very page can answer: other sites' scripts name another origin.
            origin = self.headers.get("Origin")
            length = int(self.headers.get("Content-Length") or 0)
            if (
                origin not in {None, f"http://{self.headers.get('Host')}"}
                or length > LONGEST_ANSWER
            ):
                self._send(403, b"refused")
                return
            fields = parse_qs(self.rfile.read(length).decode(errors="replace"))
            asked.answer(fields.get("number", [""])[0], fields.get("answer", [""])[0])
            self.send_response(303)
            self.send_header("Location", "/")
            self.end_headers()

        def _send(self, code: int, body: bytes) -> None:
            self.send_response(code)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Say nothing: standard error is the run's."""

    return Handler
