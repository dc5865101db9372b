"""The live page in a cell file."""

from typing import Annotated, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, model_validator

from impactcell.settings.fields import InputFile, OutputDirectory, Section, page_endpoint, public_address


class WebSection(Section):
    """The live page; cells with the same endpoint share one, and its users are those of OPC UA."""

    endpoint: Annotated[str, AfterValidator(page_endpoint)] = "http://127.0.0.1:8480"
    """Where browsers find it; an address other than loopback opens it to the network."""
    public_url: Annotated[str, AfterValidator(public_address)] | None = None
    """Address in the browser where a proxy is before the page; it then works there alone."""
    certificate: InputFile | None = None
    """Certificate (PEM) of the page, for https."""
    key: InputFile | None = None
    """Its private key (PEM)."""
    studies_dir: OutputDirectory | None = None
    """Directory for the measurements that people drop on the page; absent: `studies` beside the cell file."""
    allow_without_encryption: bool = False
    """Opens plain http beyond loopback, where anybody can listen; every start then warns."""

    @property
    def is_in_the_clear(self) -> bool:
        """Whether passwords cross a network without encryption, to the page or to the proxy before it."""
        addresses = (self.endpoint, self.public_url or self.endpoint)
        return any(address.startswith("http:") and not _is_loopback(address) for address in addresses)

    @model_validator(mode="after")
    def _encryption(self) -> Self:
        is_https = self.endpoint.startswith("https:")
        if is_https != (self.certificate is not None) or is_https != (self.key is not None):
            raise ValueError("https needs certificate and key, and http has neither")
        if self.is_in_the_clear and not self.allow_without_encryption:
            raise ValueError(
                "passwords would cross the network in the clear: use https with certificate and key, "
                "or say allow_without_encryption: true"
            )
        return self


def _is_loopback(address: str) -> bool:
    return urlsplit(address).hostname in ("127.0.0.1", "::1", "localhost")
