"""The door: passwords, certificates, trust, sessions and their limits, tried by a client."""

import asyncio
import contextlib
import errno
import os
from collections.abc import AsyncIterator, Awaitable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from asyncua import Client, ua
from asyncua.crypto import uacrypto
from cryptography.hazmat.primitives.serialization import Encoding

from impactcell.errors import AccessError
from impactcell.opcua.sessions import login_throttle
from impactcell.scada import Role, SecurityPolicy, ServerLimits
from impactcell.scada.users import User, read_users, verify, with_password, write_users
from tests.certificates import self_signed
from tests.opcua_server import CLIENT_URI, PASSWORDS, PATIENT, SERVER_URI, PatientClient, Site, site
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.slow

codes = ua.StatusCodes


async def refusal(client: Client) -> int:
    """Status code with which a login is refused."""
    try:
        async with client:
            pass
    except ua.UaStatusCodeError as error:
        return error.code
    except (TimeoutError, ConnectionError, ua.UaError):
        return int(codes.BadConnectionClosed)
    return 0


async def test_every_policy_with_password() -> None:
    async with site() as here:
        for policy in SecurityPolicy:
            async with await here.client("operator", policy=policy) as client:
                await (await here.node(client, "Wear/Limit")).read_data_value(raise_on_bad_status=False)
            assert await refusal(await here.client("operator", "wrong", policy)) == codes.BadUserAccessDenied
            stranger = await here.client("operator", policy=policy, certificate=here.untrusted())
            assert await refusal(stranger) != 0


async def test_an_own_certificate_that_has_ended_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    now = datetime.now(UTC)
    begin, end = now - timedelta(days=400), now - timedelta(days=2)
    self_signed(tmp_path / "pki" / "own", SERVER_URI, begin, end, Encoding.DER)
    async with site(directory=tmp_path):
        while f"cert.der: ended on {end:%Y-%m-%d}: move" not in caplog.text:
            await asyncio.sleep(0)


async def test_no_session_without_encryption_unless_allowed() -> None:
    async with site() as here:
        client = PatientClient(here.server.endpoint)
        client.set_user("observer")
        client.set_password(PASSWORDS["observer"])
        assert await refusal(client) == codes.BadSecurityModeInsufficient
        assert len(await PatientClient(here.server.endpoint).connect_and_get_server_endpoints()) == 3
        servers = await PatientClient(here.server.endpoint).connect_and_find_servers()
        assert [server.ApplicationUri for server in servers] == ["urn:test:impactcell"]


async def test_allowed_without_encryption_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    async with site(allow_none=True) as here:
        assert any("without encryption" in record.message for record in caplog.records)
        client = PatientClient(here.server.endpoint)
        client.set_user("observer")
        client.set_password(PASSWORDS["observer"])
        async with client:
            await (await here.node(client, "Model/Name")).read_data_value(raise_on_bad_status=False)
        nobody = PatientClient(here.server.endpoint)
        assert await refusal(nobody) == codes.BadIdentityTokenRejected, "anonymous"


@pytest.fixture
def slow_answers(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Let the answer to a wrong password take an hour from the second on; the names that are checked."""
    monkeypatch.setattr(login_throttle, "UNDELAYED_FAILURES", 1)
    monkeypatch.setattr(login_throttle, "FIRST_DELAY_S", 3600.0)
    monkeypatch.setattr(login_throttle, "MAX_DELAY_S", 3600.0)
    checked: list[str] = []

    def check(user: User | None, password: str) -> bool:
        checked.append(user.name if user else "")
        return verify(user, password)

    monkeypatch.setattr("impactcell.scada.users.Users.verify_password", staticmethod(check))
    return checked


@contextlib.asynccontextmanager
async def guessing(
    here: Site, user: str, times: int, checked: list[str], certificate: tuple[Path, Path] | None = None
) -> AsyncIterator[list[asyncio.Task[int]]]:
    """Guess on several connections at once, until as many guesses have been checked as will be."""
    assert await refusal(await here.client(user, "guess", certificate=certificate)) != 0
    before = len(checked)
    clients = [await here.client(user, "guess", certificate=certificate) for _ in range(times)]
    tasks = [asyncio.create_task(refusal(client)) for client in clients]
    while len(checked) < before + min(times, login_throttle.TURNS_PER_NAME):
        await asyncio.sleep(0)
    try:
        yield tasks
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def in_time(work: Awaitable[int]) -> int:
    """Wait for what must not wait for a guesser's hour."""
    return await asyncio.wait_for(work, PATIENCE_S)


async def test_only_the_guesser_waits(slow_answers: list[str]) -> None:
    """From one address, with one certificate: right passwords are answered while wrong ones wait."""
    async with site() as here, guessing(here, "operator", 2, slow_answers) as guesses:
        assert await in_time(refusal(await here.client("operator"))) == 0, "the guessed user"
        assert await in_time(refusal(await here.client("engineer"))) == 0, "another user"
        assert not any(guess.done() for guess in guesses), "a wrong password was answered at once"


async def test_a_client_that_is_known_does_not_wait_for_one_that_guesses(slow_answers: list[str]) -> None:
    """All turns of a name at an address are taken by guesses; who has logged in before has its own."""
    async with site() as here:
        stranger = here.untrusted()
        (here.directory / "pki" / "trusted" / "second.der").write_bytes(stranger[0].read_bytes())
        assert await refusal(await here.client("operator")) == 0
        async with guessing(here, "operator", 8, slow_answers, stranger) as guesses:
            assert await in_time(refusal(await here.client("operator"))) == 0
            assert not any(guess.done() for guess in guesses)


async def test_hanging_up_does_not_shorten_the_delay(slow_answers: list[str]) -> None:
    """A guesser who does not wait for the answer finds no turn on the next connection."""
    async with site() as here:
        async with guessing(here, "operator", 3, slow_answers):
            pass
        checked = len(slow_answers)
        again = asyncio.create_task(refusal(await here.client("operator", "another guess")))
        assert await in_time(refusal(await here.client("engineer"))) == 0
        assert slow_answers[checked:] == ["engineer"], "a fourth guess was checked"
        again.cancel()
        await asyncio.gather(again, return_exceptions=True)


def test_the_delay_grows() -> None:
    delays = [login_throttle.delay_s(number) for number in range(1, 12)]
    assert delays == [0, 0, 0, 0, 0.25, 0.5, 1, 2, 4, 8, 8]


async def test_trust_list_is_read_without_a_restart() -> None:
    async with site() as here:
        pair = here.untrusted()
        assert await refusal(await here.client("observer", certificate=pair)) != 0
        rejected = here.directory / "pki" / "rejected"
        kept = list(rejected.iterdir())
        assert [path.read_bytes() for path in kept] == [pair[0].read_bytes()]
        trusted = kept[0].rename(here.directory / "pki" / "trusted" / "stranger.der")
        assert await refusal(await here.client("observer", certificate=pair)) == 0
        trusted.unlink()
        assert await refusal(await here.client("observer", certificate=pair)) != 0


async def test_users_file_is_read_without_a_restart() -> None:
    async with site() as here:
        file = here.directory / "users.yaml"
        async with await here.client("observer") as client:
            assert await refusal(await here.client("observer", "new password")) == codes.BadUserAccessDenied
            listed = read_users(file)
            listed["observer"] = with_password(listed["observer"], "new password")
            write_users(file, listed)
            assert await refusal(await here.client("observer", "new password")) == 0
            write_users(file, {name: user for name, user in listed.items() if name != "observer"})
            node = await here.node(client, "Model/Name")

            async def read_for_ever() -> None:
                while True:
                    await node.read_data_value(raise_on_bad_status=False)

            with pytest.raises(ua.UaStatusCodeError) as refused:
                await asyncio.wait_for(read_for_ever(), PATIENCE_S)
            assert refused.value.code == codes.BadSessionIdInvalid, "the session of a removed user goes on"


async def clock_moves(client: Client) -> None:
    """Wait until the server has looked at its clock again."""
    clock = client.get_node(ua.ObjectIds.Server_ServerStatus_CurrentTime)
    before = await clock.read_value()
    async with asyncio.timeout(PATIENCE_S):
        while await clock.read_value() == before:
            pass


async def test_a_users_file_that_may_not_be_looked_at_is_told_and_survived(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async with site() as here:
        look = Path.stat

        def stat(path: Path, *, follow_symlinks: bool = True) -> os.stat_result:
            if path == here.directory / "users.yaml":
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
            return look(path, follow_symlinks=follow_symlinks)

        async with await here.client("observer") as client:
            node = await here.node(client, "Model/Name")

            async def read_for_ever() -> None:
                while True:
                    await node.read_data_value(raise_on_bad_status=False)

            with monkeypatch.context() as barred:
                barred.setattr(Path, "stat", stat)
                with pytest.raises(ua.UaStatusCodeError) as refused:
                    await asyncio.wait_for(read_for_ever(), PATIENCE_S)
                assert refused.value.code == codes.BadSessionIdInvalid
                assert await refusal(await here.client("observer")) == codes.BadUserAccessDenied
        assert "nobody can log in: " in caplog.text
        assert "users.yaml: cannot be read: Permission denied; let who runs this read it" in caplog.text
        async with await here.client("observer") as client:
            await clock_moves(client)


async def test_the_clock_goes_on_whatever_it_meets(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("impactcell.opcua.service_host.CLOCK_PERIOD_S", 0.01)
    async with site() as here:
        async with await here.client("observer") as client:
            with monkeypatch.context() as faulty:
                faulty.setattr("impactcell.scada.users.Users.find", lambda *_: 1 / 0)
                for _ in range(3):
                    await clock_moves(client)
            for _ in range(3):
                await clock_moves(client)
    told = [record for record in caplog.records if record.levelname == "ERROR"]
    assert [record.message for record in told] == ["OPC UA clock: a fault of this program; the clock goes on"]
    assert told[0].exc_info is not None


async def test_a_session_belongs_to_its_client() -> None:
    async with site() as here:
        async with await here.client("engineer") as client:
            token = client.uaclient.protocol.authentication_token
            thief = await here.client("observer")
            async with thief:
                thief.uaclient.protocol.authentication_token = token
                node = thief.get_node(ua.ObjectIds.Server)
                with pytest.raises(ua.UaStatusCodeError) as refused:
                    await node.read_browse_name()
                assert refused.value.code == codes.BadSecureChannelIdInvalid
                thief.uaclient.protocol.authentication_token = ua.NodeId(1001)
                with pytest.raises(ua.UaStatusCodeError) as refused:
                    await node.read_browse_name()
                assert refused.value.code == codes.BadSessionIdInvalid
            assert len(token.Identifier) == 32, "a token that can be guessed"
            await client.get_node(ua.ObjectIds.Server).read_browse_name()


async def test_certificate_must_be_made_for_the_application() -> None:
    async with site() as here:
        client = await here.client("observer")
        client.application_uri = "urn:somebody:else"
        assert await refusal(client) == codes.BadCertificateUriInvalid
        assert client.application_uri != CLIENT_URI


async def test_more_sessions_at_once_than_allowed() -> None:
    """A thousand scaled to forty: ten are let in, the rest is refused with the standard's code."""
    async with site(
        limits=ServerLimits(sessions=10, connections=60, undisturbed_s=PATIENCE_S, **PATIENT)
    ) as here:
        here.publish()
        async with await here.client("observer") as inside:
            held: list[Client] = []
            refused: dict[int, int] = {}

            async def attempt() -> None:
                client = await here.client("operator")
                try:
                    await client.connect()
                except ua.UaStatusCodeError as error:
                    refused[error.code] = refused.get(error.code, 0) + 1
                except (TimeoutError, ConnectionError, ua.UaError):
                    refused[0] = refused.get(0, 0) + 1
                else:
                    held.append(client)

            await asyncio.gather(*(attempt() for _ in range(40)))
            try:
                assert len(held) == 9, refused
                assert refused.get(codes.BadTooManySessions, 0) == 31, refused
                node = await here.node(inside, "Friction/StaticFriction")
                assert await node.read_value() == 0.2
            finally:
                await asyncio.gather(*(client.disconnect() for client in held))
        async with await here.client("observer"):
            pass


async def test_start_without_what_is_needed(tmp_path) -> None:
    async with site(directory=tmp_path):
        pass
    (tmp_path / "users.yaml").write_text("users: 3\n")
    with pytest.raises(AccessError, match="not a users file"):
        async with site(directory=tmp_path):
            pass
    (tmp_path / "users.yaml").unlink()
    (tmp_path / "pki" / "own" / "key.pem").write_text("no key")
    with pytest.raises(AccessError, match="key"):
        async with site(directory=tmp_path):
            pass


async def test_user_certificate() -> None:
    from impactcell.opcua.certificates.certificate_files import der, fingerprint
    from impactcell.opcua.certificates.making import make_certificate, write_pair

    async with site() as here:
        certificate, key = make_certificate("person", "urn:test:person", ["localhost"])
        paths = write_pair(here.directory / "person", certificate, key)
        client = await here.client(None)
        client.user_certificate = uacrypto.x509_from_der(paths[0].read_bytes())
        client.user_private_key = key
        assert await refusal(client) == codes.BadUserAccessDenied, "a certificate nobody knows"
        listed = read_users(here.directory / "users.yaml")
        listed["person"] = User("person", Role.ENGINEER, certificate=fingerprint(der(certificate)))
        write_users(here.directory / "users.yaml", listed)
        client = await here.client(None)
        client.user_certificate = uacrypto.x509_from_der(paths[0].read_bytes())
        client.user_private_key = key
        assert await refusal(client) == 0


def test_defaults_are_closed() -> None:
    from impactcell.scada import ServerSettings

    assert replace(ServerLimits()).sessions == 100
    assert ServerSettings.__dataclass_fields__["allow_none"].default is False
