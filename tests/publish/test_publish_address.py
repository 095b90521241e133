"""Where values go is said by one URL, and nobody is let in unless it says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from threadpitch.publish import PublishError
from threadpitch.publish.address import PASSWORD, read_receiver


@pytest.mark.parametrize(("url", "message"), [
    ("http://host", "'http' ?: is no URL|http: is no URL"),
    ("mqtt://", "is no URL to publish to"),
    ("mqtt://127.0.0.1:port", "cannot be read"),
    ("mqtt://127.0.0.1", "nobody says who they are"),
    ("mqtt://host?anonymous=yes", "is another computer, and nothing is encrypted"),
    ("mqtt://user:word@host", "is another computer, and nothing is encrypted"),
    ("mqtts://host", "nobody says who they are"),
    ("mqtts://user@host", f"the password is missing; set the environment variable {PASSWORD}"),
    ("mqtts://user:word@host?ca=/nowhere.pem", "/nowhere.pem: is not there"),
    ("mqtts://user:word@host/a/+/b", "holds letters that MQTT gives a meaning"),
    ("mqtts://user:word@host?colour=red", "'colour' is not known"),
    ("mqtt://127.0.0.1?anonymous=perhaps", "anonymous=perhaps is neither yes nor no"),
    ("opc.tcp://127.0.0.1", "nobody says who they are"),
    ("opc.tcp://0.0.0.0?anonymous=yes", "is another computer, and nothing is encrypted"),
])
def test_refused(url: str, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PASSWORD, raising=False)
    with pytest.raises(PublishError, match=message) as error:
        read_receiver(url)
    assert "word@" not in str(error.value)


def test_a_certificate_needs_its_key(tmp_path: Path) -> None:
    (tmp_path / "a.pem").touch()
    with pytest.raises(PublishError, match="a certificate needs its key"):
        read_receiver(f"mqtts://host?certificate={tmp_path / 'a.pem'}")


def test_what_is_asked_for_is_let_in() -> None:
    found = read_receiver("mqtt://host:1999/plant/hall%202?anonymous=yes&plain=yes")
    assert (found.host, found.port, found.prefix, found.anonymous) == ("host", 1999, "plant/hall 2", True)
    assert read_receiver("opc.tcp://[::1]?anonymous=yes").name == "opc.tcp://[::1]:4840"


def test_the_name_of_a_receiver_holds_no_password(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PASSWORD, "from the environment")
    found = read_receiver("mqtts://user:se%20cret@host/x")
    assert (found.name, found.password) == ("mqtts://user@host:8883/x", "se cret")
    assert read_receiver("mqtts://user@host/x").password == "from the environment"
