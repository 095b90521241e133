"""Where values are published to, as one URL.

    mqtt://user@host:1883/prefix?anonymous=yes&plain=yes
    mqtts://user@host:8883/prefix?ca=FILE&certificate=FILE&key=FILE
    opc.tcp://127.0.0.1:4840?anonymous=yes&plain=yes&certificate=FILE&key=FILE&trusted=FOLDER

Nobody is let in or told anything unencrypted unless the URL says so: ``anonymous=yes`` does without user, password and
certificate, ``plain=yes`` without encryption on a connection to another computer. Passwords may stand in the URL; out
of sight of other users they stand in the environment variable THREADPITCH_PUBLISH_PASSWORD.
"""

from __future__ import annotations

import ipaddress
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qsl, unquote, urlsplit

from threadpitch.publish.errors import PublishError

PASSWORD = "THREADPITCH_PUBLISH_PASSWORD"
PORTS = {"mqtt": 1883, "mqtts": 8883, "opc.tcp": 4840}
_WORDS = {"mqtt": ("anonymous", "plain"), "mqtts": ("anonymous", "ca", "certificate", "key"),
          "opc.tcp": ("anonymous", "plain", "certificate", "key", "trusted")}
_EXAMPLES = "mqtts://user@host/prefix, opc.tcp://127.0.0.1:4840"


@dataclass(frozen=True)
class Receiver:
    """A receiver of values, or the server that this process becomes."""

    scheme: str  # "mqtt" | "mqtts" | "opc.tcp"
    host: str
    port: int
    prefix: str = "threadpitch"  # of MQTT's topics
    user: str | None = None
    password: str | None = None
    anonymous: bool = False
    plain: bool = False
    files: Mapping[str, Path] | None = None  # ca, certificate, key, trusted

    @property
    def encrypted(self) -> bool:
        """Whether nobody between can read."""
        return self.scheme == "mqtts" or "certificate" in (self.files or {})

    @property
    def name(self) -> str:
        """For people, and for the store to know it again: without password and files."""
        user = f"{self.user}@" if self.user else ""
        prefix = "" if self.scheme == "opc.tcp" else f"/{self.prefix}"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{user}{host}:{self.port}{prefix}"

    def file(self, word: str) -> Path | None:
        """A file that the URL names."""
        return (self.files or {}).get(word)


def read_receiver(url: str) -> Receiver:
    """The receiver that a URL states.

    Raises:
        PublishError: it is no such URL, lets in what was not asked for, or names a file that is not there.
    """
    try:
        parts = urlsplit(url)
        scheme, host, port = parts.scheme, parts.hostname, parts.port
    except ValueError:
        raise PublishError(f"the URL to publish to cannot be read; write it like {_EXAMPLES}") from None
    if scheme not in PORTS or not host:
        raise PublishError(f"{scheme or url!r}: is no URL to publish to; write it like {_EXAMPLES}")
    words = _words(scheme, parts.query)
    prefix = unquote(parts.path.strip("/")) or "threadpitch"
    if any(letter in prefix for letter in "+#\0$") or not prefix.isprintable():
        raise PublishError(f"the prefix {prefix!r} of topics holds letters that MQTT gives a meaning; take others")
    password = os.environ.get(PASSWORD) if parts.password is None else unquote(parts.password)
    found = Receiver(scheme, host, PORTS[scheme] if port is None else port, prefix,
                     None if parts.username is None else unquote(parts.username), password,
                     words.get("anonymous") == "yes", words.get("plain") == "yes",
                     {word: Path(words[word]) for word in ("ca", "certificate", "key", "trusted") if word in words})
    _check(found)
    return found


def _words(scheme: str, query: str) -> dict[str, str]:
    words = dict(parse_qsl(query, keep_blank_values=True))
    for word, value in words.items():
        if word not in _WORDS[scheme]:
            raise PublishError(f"{scheme}: {word!r} is not known; known are {', '.join(_WORDS[scheme])}")
        if word in ("anonymous", "plain") and value not in ("yes", "no"):
            raise PublishError(f"{scheme}: {word}={value} is neither yes nor no")
    return words


def _check(found: Receiver) -> None:
    for word, path in (found.files or {}).items():
        if not path.exists():
            raise PublishError(f"{path}: is not there ({word} of {found.name})")
    if ("certificate" in (found.files or {})) != ("key" in (found.files or {})):
        raise PublishError(f"{found.name}: a certificate needs its key, and a key its certificate; give both")
    if found.user is not None and found.password is None:
        raise PublishError(f"{found.name}: the password is missing; set the environment variable {PASSWORD}")
    proven = found.user is not None or "trusted" in (found.files or {}) or (
        found.scheme == "mqtts" and "certificate" in (found.files or {}))
    if not proven and not found.anonymous:
        raise PublishError(f"{found.name}: nobody says who they are; give a user, a certificate, or ask for it: "
                           "?anonymous=yes")
    if not found.encrypted and not found.plain and not _is_loopback(found.host):
        raise PublishError(f"{found.name}: is another computer, and nothing is encrypted; use TLS (mqtts:, or "
                           "certificate= and key=), or ask for it: ?plain=yes")


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
