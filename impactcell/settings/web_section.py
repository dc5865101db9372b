"""The live page in a cell file."""

from typing import Annotated, Self
from urllib.parse import urlsplit

from pydantic import AfterValidator, model_validator

from impactcell.settings.fields import InputFile, OutputDirectory, Section, page_endpoint


class WebSection(Section):
    """The live page; cells with the same endpoint share one, and its users are those of OPC UA."""

    endpoint: Annotated[str, AfterValidator(page_endpoint)] = "http://127.0.0.1:8480"
    """Where browsers find it; an address other than loopback opens it to the network."""
    certificate: InputFile | None = None
    """Certificate (PEM) of the page, for https."""
    key: InputFile | None = None
    """Its private key (PEM)."""
    studies_dir: OutputDirectory | None = None
    """Directory for the measurements that people drop on the page; absent: `studies` beside the cell file."""
    allow_without_encryption: bool = False
    """Opens plain http beyond loopback, where anybody can listen; every start then warns."""

    @property
    def is_on_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return urlsplit(self.endpoint).hostname in ("127.0.0.1", "::1", "localhost")

    @model_validator(mode="after")
    def _encryption(self) -> Self:
        is_https = self.endpoint.startswith("https:")
        if is_https != (self.certificate is not None) or is_https != (self.key is not None):
            raise ValueError("https needs certificate and key, and http has neither")
        if not (is_https or self.is_on_loopback or self.allow_without_encryption):
            raise ValueError(
                "passwords would cross the network in the clear: use https with certificate and key, "
                "or say allow_without_encryption: true"
            )
        return self
