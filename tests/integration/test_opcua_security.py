"""The door: passwords, certificates, trust, sessions and their limits, tried by a client."""

import asyncio
import time
from dataclasses import replace

import pytest
from asyncua import Client, ua
from asyncua.crypto import uacrypto

from impactcell.errors import AccessError
from impactcell.scada import Role, SecurityPolicy, ServerLimits
from impactcell.scada.users import User, read_users, with_password, write_users
from tests.opcua_server import CLIENT_URI, PASSWORDS, site

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


async def login(client: Client) -> float:
    """Seconds a login takes, its connection and channel not counted."""
    await client.connect_socket()
    try:
        await client.send_hello()
        await client.open_secure_channel()
        await client.create_session()
        begin = time.monotonic()
        try:
            await client.activate_session(client._username, client._password)
        finally:
            taken = time.monotonic() - begin
        await client.close_session()
    except ua.UaStatusCodeError:
        await client.close_secure_channel()
    finally:
        client.disconnect_socket()
    return taken


async def test_every_policy_with_password() -> None:
    async with site() as here:
        for policy in SecurityPolicy:
            async with await here.client("operator", policy=policy) as client:
                await (await here.node(client, "Wear/Limit")).read_data_value(raise_on_bad_status=False)
            assert await refusal(await here.client("operator", "wrong", policy)) == codes.BadUserAccessDenied
            stranger = await here.client("operator", policy=policy, certificate=here.untrusted())
            assert await refusal(stranger) != 0


async def test_no_session_without_encryption_unless_allowed() -> None:
    async with site() as here:
        client = Client(here.server.endpoint)
        client.set_user("observer")
        client.set_password(PASSWORDS["observer"])
        assert await refusal(client) == codes.BadSecurityModeInsufficient
        assert len(await Client(here.server.endpoint).connect_and_get_server_endpoints()) == 3
        servers = await Client(here.server.endpoint).connect_and_find_servers()
        assert [server.ApplicationUri for server in servers] == ["urn:test:impactcell"]


async def test_allowed_without_encryption_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    async with site(allow_none=True) as here:
        assert any("without encryption" in record.message for record in caplog.records)
        client = Client(here.server.endpoint)
        client.set_user("observer")
        client.set_password(PASSWORDS["observer"])
        async with client:
            await (await here.node(client, "Model/Name")).read_data_value(raise_on_bad_status=False)
        nobody = Client(here.server.endpoint)
        assert await refusal(nobody) == codes.BadIdentityTokenRejected, "anonymous"


async def test_wrong_passwords_slow_down_and_others_do_not_wait() -> None:
    async with site() as here:
        delays = [await login(await here.client("operator", "guess")) for _ in range(6)]
        assert min(delays[4:]) >= 0.25, delays
        assert delays[5] > delays[4], "the delay grows"
        guessing = asyncio.create_task(login(await here.client("operator", "guess")))
        port = here.server.endpoint.split(":")[2].split("/")[0]
        elsewhere = await here.client("observer")
        # Another address of this machine stands for another machine.
        begin = time.monotonic()
        loop = asyncio.get_running_loop()
        uaclient = elsewhere.uaclient

        async def connect(host: str, _port: int) -> None:
            await loop.create_connection(
                uaclient._make_protocol, "127.0.0.1", int(port), local_addr=("127.0.0.2", 0)
            )

        uaclient.connect_socket = connect
        taken = await login(elsewhere)
        assert not guessing.done(), "the guess was answered first"
        assert taken < 0.25, f"a correct login from elsewhere took {taken:.3f} s"
        assert time.monotonic() - begin < 5
        await guessing


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
                await asyncio.wait_for(read_for_ever(), 10)
            assert refused.value.code == codes.BadSessionIdInvalid, "the session of a removed user goes on"


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
    async with site(limits=ServerLimits(sessions=10, connections=60)) as here:
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
    from impactcell.opcua.certificates import make_certificate, write_pair
    from impactcell.opcua.trust_list import der, fingerprint

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
