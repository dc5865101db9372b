"""Endpoints: what the server offers, under the name by which the client reached it."""

from typing import Any, Final
from urllib.parse import urlsplit

from asyncua import ua

from impactcell.opcua.asyncua_adapter import SECURITY_POLICIES, SecurityPolicyNone
from impactcell.opcua.host_interface import Product, SecurityPolicy, ServerSettings

TRANSPORT: Final = "http://opcfoundation.org/UA-Profile/Transport/uatcp-uasc-uabinary"

POLICIES: Final = {
    SecurityPolicy.BASIC256SHA256: (SECURITY_POLICIES["Basic256Sha256"], 70),
    SecurityPolicy.AES128_SHA256_RSAOAEP: (SECURITY_POLICIES["Aes128_Sha256_RsaOaep"], 75),
    SecurityPolicy.AES256_SHA256_RSAPSS: (SECURITY_POLICIES["Aes256_Sha256_RsaPss"], 80),
}
"""asyncua's class of each policy, and how much it is preferred."""


class Endpoints:
    """Answers discovery."""

    def __init__(self, settings: ServerSettings, product: Product, certificate: bytes) -> None:
        self._settings = settings
        self._product = product
        self._certificate = certificate
        self.port = 0

    def _url(self, asked: str | None, local: tuple[str, int] | None) -> str:
        """Answer with the host and port the client used, so that it works through NAT and name aliases."""
        wanted = urlsplit(self._settings.endpoint)
        try:
            used = urlsplit(asked or "")
            if used.scheme == wanted.scheme and used.hostname:
                return wanted._replace(netloc=f"{used.netloc.rpartition('@')[2]}").geturl()
        except ValueError:
            pass
        host = local[0] if local else (wanted.hostname or "localhost")
        return wanted._replace(netloc=f"{f'[{host}]' if ':' in host else host}:{self.port}").geturl()

    def _server(self, url: str) -> ua.ApplicationDescription:
        description = ua.ApplicationDescription()
        description.ApplicationUri = self._settings.application_uri
        description.ProductUri = self._product.uri
        description.ApplicationName = ua.LocalizedText(self._product.name)
        description.ApplicationType = ua.ApplicationType.Server
        description.DiscoveryUrls = [url]
        return description

    def get_endpoints(
        self, wanted: ua.GetEndpointsParameters, local: tuple[str, int] | None
    ) -> list[ua.EndpointDescription]:
        """List endpoints."""
        if wanted.ProfileUris and TRANSPORT not in wanted.ProfileUris:
            return []
        url = self._url(wanted.EndpointUrl, local)
        found = [
            self._endpoint(url, *POLICIES[policy], ua.MessageSecurityMode.SignAndEncrypt)
            for policy in self._settings.policies
        ]
        if self._settings.allow_none:
            found.append(self._endpoint(url, SecurityPolicyNone, 0, ua.MessageSecurityMode.None_))
        return found

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

    def find_servers(
        self, wanted: ua.FindServersParameters, local: tuple[str, int] | None
    ) -> list[ua.ApplicationDescription]:
        """Describe this server, if it is asked for."""
        if wanted.ServerUris and self._settings.application_uri not in wanted.ServerUris:
            return []
        return [self._server(self._url(wanted.EndpointUrl, local))]
