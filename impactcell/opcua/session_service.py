"""Sessions (Part 4, 5.7): the door of the server.

Mended: asyncua makes sessions on channels without security whatever the endpoints say, does not compare the
client's certificates with each other, and answers a client that takes over a session without asking who it
is.
"""

import logging
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import INVALID_SIGNATURE, StrictBuffer
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.certificates.certificate_files import application_uris
from impactcell.opcua.certificates.trust_list import TrustList
from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.languages import Languages
from impactcell.opcua.services.discovery_service import DiscoveryService
from impactcell.opcua.sessions.authentication import Authenticator, ClientApplication
from impactcell.opcua.sessions.request_dispatch import RequestContext, Service
from impactcell.opcua.sessions.session_table import Session, SessionTable
from impactcell.opcua.subscriptions.subscription_service import SubscriptionService

_log = logging.getLogger(__name__)

NONCE_BYTES: Final = 32
"""Shortest nonce of a client (Part 4, 5.7.2.2)."""


class SessionService:
    """Lets users in."""

    def __init__(
        self,
        discovery: DiscoveryService,
        sessions: SessionTable,
        subscriptions: SubscriptionService,
        authenticator: Authenticator,
        trust: TrustList,
        limits: ServerLimits,
        languages: Languages,
        *,
        allow_none: bool,
    ) -> None:
        self._discovery = discovery
        self._sessions = sessions
        self._subscriptions = subscriptions
        self._authenticator = authenticator
        self._trust = trust
        self._limits = limits
        self._allow_none = allow_none
        self._languages = languages

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "CreateSession": Service(ua.CreateSessionParameters, self.create_session, needs_session=False),
            "ActivateSession": Service(
                ua.ActivateSessionParameters, self.activate_session, needs_session=False, waits=True
            ),
            "CloseSession": Service(None, self.close_session, needs_session=False),
            "Cancel": Service(ua.CancelParameters, self.cancel),
        }

    async def create_session(
        self, context: RequestContext, parameters: ua.CreateSessionParameters
    ) -> ua.CreateSessionResponse:
        """Make a session that waits for its user."""
        channel = context.connection.channel
        if not channel.is_encrypted:
            if not self._allow_none:
                raise StatusCodeError(ua.StatusCodes.BadSecurityModeInsufficient)
        else:
            if parameters.ClientCertificate != channel.peer_certificate:
                raise StatusCodeError(ua.StatusCodes.BadCertificateInvalid)
            if len(parameters.ClientNonce or b"") < NONCE_BYTES:
                raise StatusCodeError(ua.StatusCodes.BadNonceInvalid)
            if parameters.ClientDescription.ApplicationUri not in application_uris(
                parameters.ClientCertificate
            ):
                raise StatusCodeError(ua.StatusCodes.BadCertificateUriInvalid)
        session = self._sessions.create(
            context.connection,
            parameters.SessionName,
            parameters.RequestedSessionTimeout,
            channel.peer_certificate,
        )
        response = ua.CreateSessionResponse()
        result = response.Parameters
        result.SessionId = session.session_id
        result.AuthenticationToken = session.token
        result.RevisedSessionTimeout = session.timeout_s * 1e3
        result.ServerNonce = session.nonce
        result.MaxRequestMessageSize = self._limits.message_bytes
        endpoint_request = ua.GetEndpointsParameters()
        endpoint_request.EndpointUrl = parameters.EndpointUrl
        result.ServerEndpoints = self._discovery.endpoints(endpoint_request, context.connection.local_address)
        result.ServerCertificate = self._trust.own_certificate
        if channel.is_encrypted:
            policy: Any = channel.policy
            signed = (parameters.ClientCertificate or b"") + (parameters.ClientNonce or b"")
            result.ServerSignature.Signature = policy.asymmetric_cryptography.signature(signed)
            result.ServerSignature.Algorithm = policy.AsymmetricSignatureURI
        return response

    async def activate_session(
        self, context: RequestContext, parameters: ua.ActivateSessionParameters
    ) -> ua.ActivateSessionResponse:
        """Let a user in, or bring a session to another channel."""
        session = self._sessions.find(context.header.AuthenticationToken)
        channel = context.connection.channel
        if session.connection is not context.connection:
            if not session.is_activated:
                raise StatusCodeError(ua.StatusCodes.BadSecureChannelIdInvalid)
            if session.certificate != channel.peer_certificate or session.policy_uri != channel.policy_uri:
                raise StatusCodeError(ua.StatusCodes.BadSecurityChecksFailed)
        self._check_signature(session, context, parameters.ClientSignature)
        nonce, before = session.nonce, session.actor
        actor = await self._authenticator.identify(
            parameters.UserIdentityToken,
            parameters.UserTokenSignature,
            nonce,
            ClientApplication(context.connection.address, channel.peer_certificate),
        )
        if session.closed:
            raise StatusCodeError(ua.StatusCodes.BadSessionIdInvalid)
        given_way = self._sessions.admit(session, actor.user)
        if given_way is not None:
            self._subscriptions.end_session(given_way, delete=False)
            self._sessions.remove(given_way)
        if before is not None and before.user != actor.user:
            # Part 4, 5.7.3.1: another user may take the session, but not what the first one listens to.
            self._subscriptions.end_session(session, delete=True)
        session.actor = actor
        session.language = self._languages.choose(parameters.LocaleIds) or session.language
        session.attach(context.connection)
        session.last_seen = self._sessions.clock()
        context.connection.activated()
        _log.info("%s (%s) logged in from %s", actor.user, actor.role.name.lower(), actor.address)
        response = ua.ActivateSessionResponse()
        response.Parameters.ServerNonce = session.renew_nonce()
        return response

    def _check_signature(
        self, session: Session, context: RequestContext, signature: ua.SignatureData
    ) -> None:
        channel = context.connection.channel
        if not channel.is_encrypted:
            return
        policy: Any = channel.policy
        try:
            policy.asymmetric_cryptography.verify(
                self._trust.own_certificate + session.nonce, signature.Signature or b""
            )
        except (*INVALID_SIGNATURE, ValueError, TypeError):
            raise StatusCodeError(ua.StatusCodes.BadApplicationSignatureInvalid) from None

    async def close_session(self, context: RequestContext, body: StrictBuffer) -> ua.CloseSessionResponse:
        """End a session."""
        session = self._sessions.find(context.header.AuthenticationToken)
        if session.connection is not context.connection:
            raise StatusCodeError(ua.StatusCodes.BadSecureChannelIdInvalid)
        delete = body.read(1) != b"\x00"
        self._subscriptions.end_session(session, delete=delete)
        self._sessions.remove(session)
        return ua.CloseSessionResponse()

    async def cancel(self, _context: RequestContext, _wanted: ua.CancelParameters) -> ua.CancelResponse:
        """Cancel nothing: no request but Publish waits."""
        return ua.CancelResponse()
