"""Who is who: every proof of identity is tried with a forged one, and refused with the standard's code."""

import asyncio
import logging
import os
import random
from collections.abc import AsyncIterator, Callable
from dataclasses import replace

import pytest
from asyncua import Client, ua
from asyncua.common.utils import Buffer
from asyncua.crypto import security_policies, uacrypto
from asyncua.ua.ua_binary import struct_from_binary
from cryptography.hazmat.primitives.asymmetric import rsa

from impactcell.opcua.certificates.certificate_files import der, fingerprint
from impactcell.opcua.certificates.making import make_certificate
from impactcell.scada import Role, SecurityPolicy
from impactcell.scada.users import User, read_users, write_users
from tests.opcua_server import CLIENT_URI, PASSWORDS, PatientClient, Site, site
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.slow

codes = ua.StatusCodes


@pytest.fixture
async def here(caplog: pytest.LogCaptureFixture) -> AsyncIterator[Site]:
    """A server that may not meet what it did not expect: that would be logged as an error."""
    async with site() as running:
        yield running
    assert [record.message for record in caplog.records if record.levelno >= logging.ERROR] == []


async def on_a_channel(client: Client) -> Client:
    """Connect a client up to its secure channel."""
    await client.connect_socket()
    await client.send_hello()
    await client.open_secure_channel()
    return client


async def with_session(client: Client) -> Client:
    """Connect a client up to a session that nobody has logged in to."""
    await on_a_channel(client)
    await client.create_session()
    return client


async def hang_up(client: Client) -> None:
    """Leave the server without a word."""
    protocol = client.uaclient.protocol
    if protocol is not None and protocol.transport is not None:
        protocol.transport.abort()
    client.disconnect_socket()
    await asyncio.sleep(0)


Change = Callable[[ua.ActivateSessionParameters], None]


async def activation(client: Client, user: str = "engineer", change: Change = lambda _: None) -> int:
    """Status code with which a session is activated, after a change of what is sent."""
    send = client.uaclient.activate_session

    async def changed(parameters: ua.ActivateSessionParameters) -> ua.ActivateSessionResult:
        change(parameters)
        return await send(parameters)

    client.uaclient.activate_session = changed
    try:
        await client.activate_session(user, PASSWORDS[user], client.user_certificate)
    except ua.UaStatusCodeError as error:
        return error.code
    finally:
        client.uaclient.activate_session = send
    return 0


def stranger_key() -> rsa.RSAPrivateKey:
    return rsa.generate_private_key(public_exponent=65537, key_size=2048)


@pytest.mark.parametrize("policy", list(SecurityPolicy))
async def test_client_signature(here: Site, policy: SecurityPolicy) -> None:
    own = (await here.client("engineer", policy=policy)).security_policy
    forgeries: dict[str, Callable[[], bytes | None]] = {
        "by another key": lambda: security_policies.sign_asymmetric(stranger_key(), b"x", own.URI)[0],
        "of something else": lambda: own.asymmetric_cryptography.signature(b"x"),
        "noise": lambda: os.urandom(256),
        "of another length": lambda: os.urandom(17),
        "none": lambda: None,
    }
    for name, forge in forgeries.items():
        signature = forge()

        def change(parameters: ua.ActivateSessionParameters, signature: bytes | None = signature) -> None:
            parameters.ClientSignature.Signature = signature

        client = await with_session(await here.client("engineer", policy=policy))
        assert await activation(client, change=change) == codes.BadApplicationSignatureInvalid, name
        await hang_up(client)


@pytest.mark.parametrize("policy", list(SecurityPolicy))
async def test_an_open_request_signed_by_another_key(here: Site, policy: SecurityPolicy) -> None:
    """Anybody may have the certificate of a trusted client; the channel opens only to who has its key."""
    client = await here.client("engineer", policy=policy)
    client.security_policy.asymmetric_cryptography.Signer.host_privkey = stranger_key()
    assert await refusal_of_opening(client, lambda data: data) == codes.BadSecurityChecksFailed


async def test_an_open_request_that_was_changed_on_its_way(
    here: Site, caplog: pytest.LogCaptureFixture
) -> None:
    """Wherever a byte is changed, the connection ends with a code that says what is wrong."""
    rng, found = random.Random(1), set[int]()

    def change(data: bytes) -> bytes:
        changed = bytearray(data)
        changed[rng.randrange(12, len(data))] ^= 1 << rng.randrange(8)
        return bytes(changed)

    for _ in range(60):
        found.add(await refusal_of_opening(await here.client("engineer"), change))
    assert found <= {
        codes.BadSecurityChecksFailed,
        codes.BadSecurityPolicyRejected,
        codes.BadCertificateInvalid,
        codes.BadDecodingError,
    }
    assert caplog.text.isascii()


async def refusal_of_opening(client: Client, change: Callable[[bytes], bytes]) -> int:
    """Code of the Error message that ends a connection on its request to open, changed on its way."""
    await client.connect_socket()
    await client.send_hello()
    protocol, answers = client.uaclient.protocol, list[bytes]()
    receive, write = protocol.data_received, protocol.transport.write
    protocol.data_received = lambda data: (answers.append(data), receive(data))
    protocol.transport.write = lambda data: write(change(data))
    with pytest.raises((ConnectionError, ua.UaError, TimeoutError)):
        await client.open_secure_channel()
    answer = b"".join(answers)
    assert answer[:3] == b"ERR", answer
    await hang_up(client)
    return int.from_bytes(answer[8:12], "little")


def person(here: Site, name: str = "person", days: int = 30) -> tuple[bytes, rsa.RSAPrivateKey]:
    """A user who logs in by certificate, as engineer."""
    certificate, key = make_certificate(name, f"urn:test:{name}", ["localhost"], days=days)
    users = read_users(here.directory / "users.yaml")
    users[name] = User(name, Role.ENGINEER, certificate=fingerprint(der(certificate)))
    write_users(here.directory / "users.yaml", users)
    return der(certificate), key


async def client_of(here: Site, certificate: bytes, key: rsa.RSAPrivateKey) -> Client:
    client = await here.client(None)
    client.user_certificate = uacrypto.x509_from_der(certificate)
    client.user_private_key = key
    return await with_session(client)


async def test_a_user_certificate_without_its_key(here: Site) -> None:
    """The certificate of an engineer is no secret: who has not the key is not let in."""
    certificate, key = person(here)
    thief = await client_of(here, certificate, stranger_key())
    assert await activation(thief) == codes.BadUserSignatureInvalid

    def unsigned(parameters: ua.ActivateSessionParameters) -> None:
        parameters.UserTokenSignature = ua.SignatureData()

    assert await activation(thief, change=unsigned) == codes.BadUserSignatureInvalid
    await hang_up(thief)
    owner = await client_of(here, certificate, key)
    assert await activation(owner) == 0
    await owner.disconnect()


async def test_a_user_signature_that_was_listened_to(here: Site) -> None:
    """It is of the nonce it was made for, and worth nothing for the next."""
    certificate, key = person(here)
    heard: list[ua.SignatureData] = []
    owner = await client_of(here, certificate, key)
    assert await activation(owner, change=lambda p: heard.append(p.UserTokenSignature)) == 0
    await owner.disconnect()
    thief = await client_of(here, certificate, stranger_key())

    def replay(parameters: ua.ActivateSessionParameters) -> None:
        parameters.UserTokenSignature = heard[0]

    assert await activation(thief, change=replay) == codes.BadUserSignatureInvalid
    await hang_up(thief)


async def test_an_expired_user_certificate(here: Site) -> None:
    certificate, key = person(here, days=-1)
    client = await client_of(here, certificate, key)
    assert await activation(client) == codes.BadUserAccessDenied
    await hang_up(client)


async def test_a_password_that_was_listened_to(here: Site) -> None:
    """An encrypted password carries the nonce it was made for; sent again it is refused."""
    heard: list[ua.UserNameIdentityToken] = []
    owner = await with_session(await here.client("engineer"))
    assert await activation(owner, change=lambda p: heard.append(p.UserIdentityToken)) == 0
    await owner.disconnect()
    thief = await with_session(await here.client("engineer"))

    def replay(parameters: ua.ActivateSessionParameters) -> None:
        parameters.UserIdentityToken = heard[0]

    assert await activation(thief, change=replay) == codes.BadIdentityTokenInvalid
    await hang_up(thief)


def in_the_clear(parameters: ua.ActivateSessionParameters) -> None:
    parameters.UserIdentityToken.Password = PASSWORDS["engineer"].encode()
    parameters.UserIdentityToken.EncryptionAlgorithm = None


async def test_a_password_in_the_clear_on_an_open_channel() -> None:
    """Even where sessions without encryption are allowed, a password is not sent for all to read."""
    async with site(allow_none=True) as here:
        client = await with_session(PatientClient(here.server.endpoint))
        assert await activation(client, change=in_the_clear) == codes.BadIdentityTokenRejected
        assert await activation(client) == 0
        await client.disconnect()


async def test_a_password_in_the_clear_inside_an_encrypted_channel(here: Site) -> None:
    client = await with_session(await here.client("engineer"))
    assert await activation(client, change=in_the_clear) == 0
    await client.disconnect()


async def test_a_session_is_not_taken_to_the_channel_of_another_client(here: Site) -> None:
    """Two trusted clients: the token of one's session opens nothing to the other."""
    pair = here.untrusted()
    (here.directory / "pki" / "trusted" / "second.der").write_bytes(pair[0].read_bytes())
    async with await here.client("engineer") as owner:
        token, nonce = owner.uaclient.protocol.authentication_token, owner._server_nonce
        thief = await on_a_channel(await here.client("engineer", certificate=pair))
        thief.uaclient.protocol.authentication_token = token
        await _know_the_policies(thief, owner)
        thief._server_nonce = nonce
        assert await activation(thief) == codes.BadSecurityChecksFailed
        await hang_up(thief)
        await owner.get_node(ua.ObjectIds.Server).read_browse_name()


async def _know_the_policies(client: Client, other: Client) -> None:
    client._policy_ids = other._policy_ids


async def test_a_session_moves_with_its_client_and_only_with_a_signature(here: Site) -> None:
    owner = await here.client("engineer")
    await owner.connect()
    protocol = owner.uaclient.protocol
    moved = await on_a_channel(await here.client("engineer"))
    moved.uaclient.protocol.authentication_token = protocol.authentication_token
    await _know_the_policies(moved, owner)
    moved._server_nonce = os.urandom(32)
    assert await activation(moved) == codes.BadApplicationSignatureInvalid
    moved._server_nonce = owner._server_nonce
    assert await activation(moved) == 0
    await moved.get_node(ua.ObjectIds.Server).read_browse_name()
    with pytest.raises(ua.UaStatusCodeError) as refused:
        await owner.get_node(ua.ObjectIds.Server).read_browse_name()
    assert refused.value.code == codes.BadSecureChannelIdInvalid, "the old channel still works"
    await hang_up(owner)
    await owner._cancel_task(owner._renew_channel_task)
    await owner._cancel_task(owner._supervisor_task)
    await owner._cancel_task(owner._stale_watchdog_task)
    await hang_up(moved)


async def test_what_was_asked_on_the_old_channel_is_not_answered_on_the_new_one(here: Site) -> None:
    """Notifications went out under the numbers of Publish requests that the new channel had never seen."""
    owner = await here.client("engineer")
    await owner.connect()
    create = ua.CreateSubscriptionRequest()
    create.Parameters.RequestedPublishingInterval = 3.6e6  # it publishes when it is told to
    made = struct_from_binary(ua.CreateSubscriptionResponse, await sent(owner, create))
    subscription = here.server._host.subscription_service._subscriptions[made.Parameters.SubscriptionId]
    items = ua.CreateMonitoredItemsRequest()
    items.Parameters.SubscriptionId = subscription.id
    level = (await here.node(owner, "Wear/Level")).nodeid
    items.Parameters.ItemsToCreate = [
        ua.MonitoredItemCreateRequest(
            ua.ReadValueId(NodeId=level, AttributeId=ua.AttributeIds.Value), ua.MonitoringMode.Reporting,
            ua.MonitoringParameters(1, 0.0, None, 10, True),
        )
    ]  # fmt: skip
    await sent(owner, items)
    asked = [asyncio.ensure_future(sent(owner, ua.PublishRequest())) for _ in range(3)]
    await owner.get_node(ua.ObjectIds.Server).read_browse_name()  # by now they wait
    assert len(subscription.session.publish_requests) == 3

    moved = await on_a_channel(await here.client("engineer"))
    protocol = moved.uaclient.protocol
    protocol.authentication_token = owner.uaclient.protocol.authentication_token
    await _know_the_policies(moved, owner)
    moved._server_nonce = owner._server_nonce
    answered, answer = [], protocol._call_callback

    def note(number: int, body: object) -> None:
        answered.append(number)
        if number in protocol._callbackmap:
            answer(number, body)

    protocol._call_callback = note
    before = protocol._request_id
    assert await activation(moved) == 0
    here.publish()
    while here.server._host._values._fan_out._waiting:
        await asyncio.sleep(0)
    subscription._tick()
    await moved.get_node(ua.ObjectIds.Server).read_browse_name()  # what was due has come before its answer
    assert answered == list(range(before + 1, protocol._request_id + 1))
    published = struct_from_binary(ua.PublishResponse, await sent(moved, ua.PublishRequest()))
    assert published.Parameters.NotificationMessage.NotificationData
    assert answered == list(range(before + 1, protocol._request_id + 1))
    await hang_up(owner)
    await asyncio.gather(*asked, return_exceptions=True)
    await owner._cancel_task(owner._renew_channel_task)
    await owner._cancel_task(owner._supervisor_task)
    await owner._cancel_task(owner._stale_watchdog_task)
    await hang_up(moved)


async def sent(client: Client, request: object) -> Buffer:
    return await client.uaclient.protocol.send_request(request, timeout=PATIENCE_S)


async def test_a_session_that_nobody_has_logged_in_to_does_not_move(here: Site) -> None:
    first = await with_session(await here.client("engineer"))
    second = await on_a_channel(await here.client("engineer"))
    second.uaclient.protocol.authentication_token = first.uaclient.protocol.authentication_token
    await _know_the_policies(second, first)
    second._server_nonce = first._server_nonce
    assert await activation(second) == codes.BadSecureChannelIdInvalid
    await hang_up(first)
    await hang_up(second)


class Deaf:
    def datachange_notification(self, node: object, value: object, data: object) -> None:
        pass


async def test_another_user_of_a_session_inherits_no_subscription(here: Site) -> None:
    here.publish()
    async with await here.client("engineer") as client:
        subscription = await client.create_subscription(500, Deaf())
        await subscription.subscribe_data_change(await here.node(client, "Wear/Level"))
        assert await activation(client, "engineer") == 0
        modify = ua.ModifySubscriptionParameters(
            SubscriptionId=subscription.subscription_id, RequestedPublishingInterval=500.0,
            RequestedLifetimeCount=1_000, RequestedMaxKeepAliveCount=10,
        )  # fmt: skip
        await client.uaclient.modify_subscription(modify)
        assert await activation(client, "observer") == 0
        with pytest.raises(ua.UaStatusCodeError) as refused:
            await client.uaclient.modify_subscription(modify)
        assert refused.value.code == codes.BadSubscriptionIdInvalid


async def test_a_subscription_is_not_transferred_to_another_user(here: Site) -> None:
    async with await here.client("engineer") as owner, await here.client("operator") as other:
        subscription = await owner.create_subscription(500, Deaf())
        wanted = ua.TransferSubscriptionsParameters(SubscriptionIds=[subscription.subscription_id])
        results = await other.uaclient.transfer_subscriptions(wanted)
        assert results[0].StatusCode.value == codes.BadUserAccessDenied


async def test_a_role_that_is_lowered_holds_for_sessions_that_live(here: Site) -> None:
    async with await here.client("engineer") as client:
        request = ua.CallMethodRequest(
            ObjectId=(await here.node(client, "")).nodeid,
            MethodId=(await here.node(client, "SetTarget")).nodeid,
            InputArguments=[ua.Variant(1.0, ua.VariantType.Double)],
        )
        assert (await client.uaclient.call([request]))[0].StatusCode.is_good()
        users = read_users(here.directory / "users.yaml")
        users["engineer"] = replace(users["engineer"], role=Role.OBSERVER)
        write_users(here.directory / "users.yaml", users)

        async def refused() -> int:
            while (code := (await client.uaclient.call([request]))[0].StatusCode.value) == 0:
                pass
            return code

        assert await asyncio.wait_for(refused(), PATIENCE_S) == codes.BadUserAccessDenied
        assert client.application_uri == CLIENT_URI
