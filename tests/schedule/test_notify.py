"""Notifications, delivered to a real web server on this machine."""

import asyncio
import json
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from labdrive.model.errors import InputError
from labdrive.schedule.notify import Notifier, addresses

pytest.importorskip("apprise")


@pytest.fixture
def hook():
    """Return a webhook's address and what was posted to it."""
    posted = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            posted.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_):
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
    thread.start()
    yield f"json://127.0.0.1:{server.server_port}/lab", posted
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_message_arrives(hook):
    address, posted = hook
    asyncio.run(Notifier([address]).send("labdrive: nightly failed", "the reason"))
    assert [(p["title"], p["message"]) for p in posted] == [
        ("labdrive: nightly failed", "the reason")
    ]


def test_nobody_to_tell_is_no_error():
    asyncio.run(Notifier([]).send("title", "body"))


def test_what_cannot_be_delivered_is_logged_without_its_secret(caplog):
    notifier = Notifier(["json://user:secret@127.0.0.1:9/lab"])
    asyncio.run(notifier.send("title", "body"))
    assert "was not delivered" in caplog.text
    ours = [r.getMessage() for r in caplog.records if r.name.startswith("labdrive")]
    assert not any("secret" in text for text in ours)


def test_an_address_that_is_not_understood_is_told_without_its_secret():
    with pytest.raises(
        InputError, match=r"address 2 \(nosuch://\.\.\.\) is not understood"
    ) as error:
        Notifier(["json://127.0.0.1:9/", "nosuch://token-123"])
    assert "token" not in str(error.value)


def test_addresses_come_from_environment_and_a_file_of_ones_own(tmp_path, monkeypatch):
    monkeypatch.setenv("LABDRIVE_NOTIFY", "json://a json://b")
    path = tmp_path / "notify.urls"
    path.write_text("# mine\njson://c\n\n")
    path.chmod(0o600)
    assert addresses(tmp_path) == ["json://a", "json://b", "json://c"]
    path.chmod(0o644)
    with pytest.raises(InputError, match="chmod 600"):
        addresses(tmp_path)
