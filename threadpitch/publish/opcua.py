"""An OPC UA server that shows the pitches of now and hands out the results of the store.

Nothing is lost while a client is away: the results stay in the store, and the client gets them by
GetResultIdListFiltered and GetResultById when it is back, after a restart of this server too.
"""

from __future__ import annotations

import asyncio
import hmac
import logging
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from threadpitch.publish.address import Receiver
from threadpitch.publish.errors import PublishError
from threadpitch.store import StoreError

if TYPE_CHECKING:
    from asyncua import Server

    from threadpitch.store import Store

LOOK = 0.2  # s between two looks for new events
PATIENCE = 30.0  # s for the server to start
REPLAYED = 500  # events before the start, so that the nodes show the last values
AT_ONCE = 500
_PEM = b"-----BEGIN"
_log = logging.getLogger(__name__)
# A server that does not start is told in one line below; asyncua's traceback is for programs that listen to its log.
logging.getLogger("asyncua.server.server").addHandler(logging.NullHandler())


class OpcUaServer:
    """A thread that is an OPC UA server, until it is closed.

    Raises (the class itself):
        PublishError: asyncua is missing, a certificate cannot be read, the port is taken.
    """

    def __init__(self, receiver: Receiver, store: Store) -> None:
        _check_asyncua()
        self.receiver, self.store = receiver, store
        self.trouble = ""
        self.taken = max(0, store.last_sequence() - REPLAYED)
        self._started = threading.Event()
        self._failure: Exception | None = None
        self._loop = asyncio.new_event_loop()
        self._ends = asyncio.Event()
        self._thread = threading.Thread(target=self._work, name="opcua", daemon=True)
        self._thread.start()
        self._started.wait(PATIENCE)
        if isinstance(self._failure, OSError | ValueError):
            raise PublishError(f"{receiver.name}: the server does not start ({' '.join(str(self._failure).split())}); "
                               "is the port free, and are certificate and key PEM or DER?")
        if self._failure is not None:
            raise self._failure

    def notify(self) -> None:
        """There are new events; they are looked for several times a second."""

    def behind(self) -> int:
        """How many events the nodes do not show yet."""
        return max(0, self.store.last_sequence() - self.taken)

    def close(self) -> None:
        """End the server."""
        self._loop.call_soon_threadsafe(self._ends.set)
        self._thread.join(PATIENCE)

    def _work(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except Exception as error:
            self._failure = error
        finally:
            self._started.set()
            self._loop.close()

    async def _serve(self) -> None:
        from asyncua import Server

        from threadpitch.publish.opcua_nodes import Nodes

        server = Server(user_manager=_Users(self.receiver))
        await server.init()
        await _secure(server, self.receiver)
        nodes = Nodes(server, self.store)
        await nodes.build()
        async with server:
            await self._follow(nodes)
            self._started.set()
            while not self._ends.is_set():
                await self._follow(nodes)
                with_news = asyncio.wait_for(self._ends.wait(), LOOK)
                try:
                    await with_news
                except TimeoutError:
                    continue

    async def _follow(self, nodes: Any) -> None:
        try:
            while events := await asyncio.to_thread(self.store.events, self.taken, AT_ONCE):
                for event in events:
                    await nodes.take(event)
                    self.taken = event.sequence
            self.trouble = ""
        except StoreError as error:  # the database is away for a while; it is asked again
            self.trouble = str(error)
            _log.warning("%s", error)


class _Users:
    """Lets in who has the name and the password, or everybody where that was asked for."""

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = receiver

    def get_user(self, _: object, username: str | None = None, password: str | None = None,
                 certificate: object = None) -> Any:
        from asyncua.crypto.permission_rules import User, UserRole

        # As bytes: compare_digest refuses text beyond ASCII. Both are compared, whatever the first gives.
        name, word = (str(text or "").encode() for text in (username, password))
        same = [hmac.compare_digest(name, str(self._receiver.user or "").encode()),
                hmac.compare_digest(word, str(self._receiver.password or "").encode())]
        if self._receiver.user is None or all(same):
            return User(role=UserRole.User, name=username)
        return None


async def _secure(server: Server, receiver: Receiver) -> None:
    """Who is let in, and how it is encrypted."""
    from asyncua import ua

    server.set_endpoint(f"opc.tcp://{f'[{receiver.host}]' if ':' in receiver.host else receiver.host}:{receiver.port}")
    server.set_server_name("threadpitch")
    server.set_identity_tokens([ua.UserNameIdentityToken if receiver.user is not None else ua.AnonymousIdentityToken])
    certificate, key, trusted = (receiver.file(word) for word in ("certificate", "key", "trusted"))
    if certificate is None or key is None:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        return
    kinds = ua.SecurityPolicyType
    server.set_security_policy([kinds.Aes256Sha256RsaPss_SignAndEncrypt, kinds.Basic256Sha256_SignAndEncrypt,
                                kinds.Aes128Sha256RsaOaep_SignAndEncrypt])
    await server.load_certificate(certificate, _format(certificate))
    await server.load_private_key(key, format=_format(key))
    uri = application_uri(certificate.read_bytes())
    if uri:
        await server.set_application_uri(uri)
    if trusted is not None:
        from asyncua.crypto.truststore import TrustStore
        from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions

        kept = TrustStore([trusted], [])
        await kept.load()
        wanted = CertificateValidatorOptions.TRUSTED_VALIDATION | CertificateValidatorOptions.PEER_CLIENT
        server.set_certificate_validator(CertificateValidator(wanted, kept))


def application_uri(content: bytes) -> str:
    """The URI that a certificate (PEM or DER) is for; clients compare it with what the server says of itself."""
    from cryptography import x509

    load = x509.load_pem_x509_certificate if content.lstrip().startswith(_PEM) else x509.load_der_x509_certificate
    try:
        names = load(content).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ""
    return next(iter(names.get_values_for_type(x509.UniformResourceIdentifier)), "")


def _format(path: Path) -> str:
    """By its content: names end in .pem, .key, .crt, as it happens."""
    return "pem" if path.read_bytes().lstrip().startswith(_PEM) else "der"


def _check_asyncua() -> None:
    try:
        import asyncua  # noqa: F401 -- whether it is there
    except ImportError:
        raise PublishError("OPC UA needs asyncua, which is not installed; pip install 'threadpitch[opcua]'") from None
