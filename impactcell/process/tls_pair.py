"""Certificates and a private key as TLS reads them, and what of them it cannot use."""

import ssl
from pathlib import Path
from typing import Final

_BEGIN: Final = b"-----BEGIN "
_NO_CERTIFICATE: Final = (
    "holds no certificate in PEM, which is needed; "
    "`openssl x509 -inform DER -in FILE -out cert.pem` makes one of a file in DER"
)
_PRIVATE_KEY: Final = b"PRIVATE KEY-----"
"""How the first line of a private key ends, whatever its kind."""
_ENCRYPTED: Final = (b"-----BEGIN ENCRYPTED PRIVATE KEY", b"Proc-Type: 4,ENCRYPTED")
"""How a key begins that has a passphrase."""


def pair_fault(certificate: Path, key: Path) -> str:
    """Say which of two files TLS cannot use, why, and what to do; empty where it can use both."""
    try:
        if _BEGIN not in certificate.read_bytes():
            return f"{certificate}: {_NO_CERTIFICATE}"
        secret = key.read_bytes()
        if _PRIVATE_KEY not in secret:
            if key == certificate:
                return f"{certificate}: holds no private key beside the certificate; name that as `key`"
            return (
                f"{key}: holds no private key in PEM, which is needed; "
                "`openssl pkey -inform DER -in FILE -out key.pem` makes one of a file in DER"
            )
        if any(begin in secret for begin in _ENCRYPTED):
            return (
                f"{key}: has a passphrase, for which a service cannot be asked; "
                "`openssl pkey -in FILE -out key.pem` takes it off"
            )
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key)
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            return f"{key}: is not the private key of {certificate}; name the two that belong together"
        return f"{certificate}: cannot be used with {key} ({error.reason or error}); name others"
    except OSError as error:
        unread = error.filename or certificate
        return f"{unread}: cannot be read: {error.strerror}; let who runs the service read it"
    return ""


def authority_fault(certificates: Path) -> str:
    """Say why TLS cannot use a file of authorities' certificates, and what to do; empty where it can."""
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT).load_verify_locations(certificates)
    except ssl.SSLError:
        return f"{certificates}: {_NO_CERTIFICATE}"
    except OSError as error:
        return f"{certificates}: cannot be read: {error.strerror}; let who runs the service read it"
    return ""
