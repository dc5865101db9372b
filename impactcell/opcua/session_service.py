"""Discovery and sessions (Part 4, 5.5 and 5.7): the door of the server.

Mended: asyncua makes sessions on channels without security whatever the endpoints say, does not compare the
client's certificates with each other, and answers a client that takes over a session without asking who it
is.
"""

import logging
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import InvalidSignature, StrictBuffer
from impactcell.opcua.authentication import Logins
from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.endpoints import Endpoints
from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.request_dispatch import Context, Service
from impactcell.opcua.sessions import Session, Sessions
from impactcell.opcua.subscription_service import Monitoring
from impactcell.opcua.trust_list import TrustList, application_uris

_log = logging.getLogger(__name__)

NONCE_BYTES: Final = 32


class Access:
    """Answers discovery, and lets users in."""

    def __init__(
        self,
        endpoints: Endpoints,
        sessions: Sessions,
        monitoring: Monitoring,
        logins: Logins,
        trust: TrustList,
        limits: ServerLimits,
        *,
        allow_none: bool,
    ) -> None:
        self._endpoints = endpoints
        self._sessions = sessions
        self._monitoring = monitoring
        self._logins = logins
        self._trust = trust
        self._limits = limits
        self._allow_none = allow_none

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "GetEndpoints": Service(ua.GetEndpointsParameters, self.get_endpoints, needs_session=False),
            "FindServers": Service(ua.FindServersParameters, self.find_servers, needs_session=False),
            "CreateSession": Service(ua.CreateSessionParameters, self.create, needs_session=False),
            "ActivateSession": Service(ua.ActivateSessionParameters, self.activate, needs_session=False),
            "CloseSession": Service(None, self.close_session, needs_session=False),
            "Cancel": Service(ua.CancelParameters, self.cancel),
        }

    async def get_endpoints(
        self, context: Context, wanted: ua.GetEndpointsParameters
    ) -> ua.GetEndpointsResponse:
        """List the endpoints."""
        response = ua.GetEndpointsResponse()
        response.Endpoints = self._endpoints.get_endpoints(wanted, context.connection.local_address)
        return response

    async def find_servers(
        self, context: Context, wanted: ua.FindServersParameters
    ) -> ua.FindServersResponse:
        """Describe this server."""
        response = ua.FindServersResponse()
        response.Servers = self._endpoints.find_servers(wanted, context.connection.local_address)
        return response

    async def create(self, context: Context, wanted: ua.CreateSessionParameters) -> ua.CreateSessionResponse:
        """Make a session that waits for its user."""
        channel = context.connection.channel
        if not channel.is_encrypted:
            if not self._allow_none:
                raise FaultError(ua.StatusCodes.BadSecurityModeInsufficient)
        else:
            if wanted.ClientCertificate != channel.peer_certificate:
                raise FaultError(ua.StatusCodes.BadCertificateInvalid)
            if len(wanted.ClientNonce or b"") < NONCE_BYTES:
                raise FaultError(ua.StatusCodes.BadNonceInvalid)
            if wanted.ClientDescription.ApplicationUri not in application_uris(wanted.ClientCertificate):
                raise FaultError(ua.StatusCodes.BadCertificateUriInvalid)
        session = self._sessions.create(
            context.connection,
            wanted.SessionName,
            wanted.RequestedSessionTimeout,
            wanted.ClientNonce or b"",
            channel.peer_certificate,
        )
        response = ua.CreateSessionResponse()
        result = response.Parameters
        result.SessionId = session.session_id
        result.AuthenticationToken = session.token
        result.RevisedSessionTimeout = session.timeout_s * 1e3
        result.ServerNonce = session.nonce
        result.MaxRequestMessageSize = self._limits.message_bytes
        asked = ua.GetEndpointsParameters()
        asked.EndpointUrl = wanted.EndpointUrl
        result.ServerEndpoints = self._endpoints.get_endpoints(asked, context.connection.local_address)
        result.ServerCertificate = self._trust.own_certificate
        if channel.is_encrypted:
            policy: Any = channel.policy
            signed = (wanted.ClientCertificate or b"") + (wanted.ClientNonce or b"")
            result.ServerSignature.Signature = policy.asymmetric_cryptography.signature(signed)
            result.ServerSignature.Algorithm = policy.AsymmetricSignatureURI
        return response

    async def activate(
        self, context: Context, wanted: ua.ActivateSessionParameters
    ) -> ua.ActivateSessionResponse:
        """Let a user in, or bring a session to another channel."""
        session = self._sessions.find(context.header.AuthenticationToken)
        channel = context.connection.channel
        if session.connection is not context.connection:
            if not session.is_activated:
                raise FaultError(ua.StatusCodes.BadSecureChannelIdInvalid)
            if session.certificate != channel.peer_certificate or session.policy_uri != channel.policy_uri:
                raise FaultError(ua.StatusCodes.BadSecurityChecksFailed)
        self._check_signature(session, context, wanted.ClientSignature)
        nonce, before = session.nonce, session.actor
        actor = await self._logins.identify(
            wanted.UserIdentityToken,
            wanted.UserTokenSignature,
            nonce,
            context.connection.address,
            encrypted=channel.is_encrypted,
        )
        if session.closed:
            raise FaultError(ua.StatusCodes.BadSessionIdInvalid)
        if before is not None and before.user != actor.user:
            # Part 4, 5.7.3.1: another user may take the session, but not what the first one listens to.
            self._monitoring.end_session(session, delete=True)
        session.actor = actor
        session.connection = context.connection
        session.last_seen = self._sessions.clock()
        context.connection.activated()
        _log.info("%s (%s) logged in from %s", actor.user, actor.role.name.lower(), actor.address)
        response = ua.ActivateSessionResponse()
        response.Parameters.ServerNonce = session.renew_nonce()
        return response

    def _check_signature(self, session: Session, context: Context, signature: ua.SignatureData) -> None:
        channel = context.connection.channel
        if not channel.is_encrypted:
            return
        policy: Any = channel.policy
        try:
            policy.asymmetric_cryptography.verify(
                self._trust.own_certificate + session.nonce, signature.Signature or b""
            )
        except (InvalidSignature, ValueError, TypeError):
            raise FaultError(ua.StatusCodes.BadApplicationSignatureInvalid) from None

    async def close_session(self, context: Context, body: StrictBuffer) -> ua.CloseSessionResponse:
        """End a session."""
        session = self._sessions.find(context.header.AuthenticationToken)
        if session.connection is not context.connection:
            raise FaultError(ua.StatusCodes.BadSecureChannelIdInvalid)
        delete = body.read(1) != b"\x00"
        self._monitoring.end_session(session, delete=delete)
        self._sessions.remove(session)
        return ua.CloseSessionResponse()

    async def cancel(self, _context: Context, _wanted: ua.CancelParameters) -> ua.CancelResponse:
        """Cancel nothing: no request but Publish waits."""
        return ua.CancelResponse()
