"""Discovery (Part 4, 5.5): what the server offers, under the name by which the client reached it."""

from typing import Any, Final
from urllib.parse import urlsplit

from asyncua import ua

from impactcell.opcua.asyncua_adapter import SECURITY_POLICIES, SecurityPolicyNone
from impactcell.opcua.host_interface import Product, SecurityPolicy, ServerSettings
from impactcell.opcua.sessions.request_dispatch import RequestContext, Service

TRANSPORT: Final = "http://opcfoundation.org/UA-Profile/Transport/uatcp-uasc-uabinary"

POLICIES: Final = {
    SecurityPolicy.BASIC256SHA256: (SECURITY_POLICIES["Basic256Sha256"], 70),
    SecurityPolicy.AES128_SHA256_RSAOAEP: (SECURITY_POLICIES["Aes128_Sha256_RsaOaep"], 75),
    SecurityPolicy.AES256_SHA256_RSAPSS: (SECURITY_POLICIES["Aes256_Sha256_RsaPss"], 80),
}
"""asyncua's class of each policy, and how much it is preferred."""


class DiscoveryService:
    """Answers GetEndpoints and FindServers, which need no session."""

    def __init__(self, settings: ServerSettings, product: Product, certificate: bytes) -> None:
        self._settings = settings
        self._product = product
        self._certificate = certificate
        self.port = 0

    def _url(self, endpoint_url: str | None, local_address: tuple[str, int] | None) -> str:
        """Answer with the host and port the client used, so that it works through NAT and name aliases."""
        configured = urlsplit(self._settings.endpoint)
        try:
            requested = urlsplit(endpoint_url or "")
            if requested.scheme == configured.scheme and requested.hostname:
                return configured._replace(netloc=f"{requested.netloc.rpartition('@')[2]}").geturl()
        except ValueError:
            pass
        host = local_address[0] if local_address else (configured.hostname or "localhost")
        return configured._replace(netloc=f"{f'[{host}]' if ':' in host else host}:{self.port}").geturl()

    def _server(self, url: str) -> ua.ApplicationDescription:
        description = ua.ApplicationDescription()
        description.ApplicationUri = self._settings.application_uri
        description.ProductUri = self._product.uri
        description.ApplicationName = ua.LocalizedText(self._product.name)
        description.ApplicationType = ua.ApplicationType.Server
        description.DiscoveryUrls = [url]
        return description

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "GetEndpoints": Service(ua.GetEndpointsParameters, self.get_endpoints, needs_session=False),
            "FindServers": Service(ua.FindServersParameters, self.find_servers, needs_session=False),
        }

    async def get_endpoints(
        self, context: RequestContext, parameters: ua.GetEndpointsParameters
    ) -> ua.GetEndpointsResponse:
        """List the endpoints."""
        response = ua.GetEndpointsResponse()
        response.Endpoints = self.endpoints(parameters, context.connection.local_address)
        return response

    async def find_servers(
        self, context: RequestContext, parameters: ua.FindServersParameters
    ) -> ua.FindServersResponse:
        """Describe this server, if it is asked for."""
        response = ua.FindServersResponse()
        if not parameters.ServerUris or self._settings.application_uri in parameters.ServerUris:
            url = self._url(parameters.EndpointUrl, context.connection.local_address)
            response.Servers = [self._server(url)]
        return response

    def endpoints(
        self, parameters: ua.GetEndpointsParameters, local_address: tuple[str, int] | None
    ) -> list[ua.EndpointDescription]:
        """List the endpoints that a client asks for."""
        if parameters.ProfileUris and TRANSPORT not in parameters.ProfileUris:
            return []
        url = self._url(parameters.EndpointUrl, local_address)
        endpoints = [
            self._endpoint(url, *POLICIES[policy], ua.MessageSecurityMode.SignAndEncrypt)
            for policy in self._settings.policies
        ]
        if self._settings.allow_none:
            endpoints.append(self._endpoint(url, SecurityPolicyNone, 0, ua.MessageSecurityMode.None_))
        return endpoints

    def _endpoint(
        self,
        url: str,
        policy: Any,
        level: int,
        mode: ua.MessageSecurityMode,
    ) -> ua.EndpointDescription:
        endpoint = ua.EndpointDescription()
        endpoint.EndpointUrl = url
        endpoint.Server = self._server(url)
        endpoint.ServerCertificate = self._certificate
        endpoint.SecurityMode = mode
        endpoint.SecurityPolicyUri = policy.URI
        endpoint.TransportProfileUri = TRANSPORT
        endpoint.SecurityLevel = level
        # Passwords and signatures are protected by a policy even where the channel is not.
        secure = policy if level else POLICIES[self._settings.policies[0]][0]
        endpoint.UserIdentityTokens = [
            self._token("username", ua.UserTokenType.UserName, secure.URI),
            self._token("certificate", ua.UserTokenType.Certificate, secure.URI),
        ]
        return endpoint

    @staticmethod
    def _token(name: str, kind: ua.UserTokenType, policy_uri: str) -> ua.UserTokenPolicy:
        token = ua.UserTokenPolicy()
        token.PolicyId = name
        token.TokenType = kind
        token.SecurityPolicyUri = policy_uri
        return token
