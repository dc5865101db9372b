"""Trust list, users file and their commands, with certificates made by `cryptography` itself."""

import datetime as dt
import hashlib
import io
import random
import stat
import sys
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import NameOID

from impactcell.cli import access
from impactcell.errors import AccessError
from impactcell.opcua.certificates.certificate_files import (
    application_uris,
    der,
    first_of_chain,
    parse_certificate,
)
from impactcell.opcua.certificates.making import make_certificate
from impactcell.opcua.certificates.trust_list import TrustList, UntrustedError
from impactcell.scada import Role
from impactcell.scada.users import User, Users, read_users, verify, with_password, write_users

URI = "urn:test:trust"
_KEYS: list[rsa.RSAPrivateKey] = []


def key(number: int) -> rsa.RSAPrivateKey:
    while len(_KEYS) <= number:
        _KEYS.append(rsa.generate_private_key(public_exponent=65537, key_size=2048))
    return _KEYS[number]


def certificate(
    name: str,
    own: int,
    issuer: tuple[str, int] | None = None,
    *,
    ca: bool | None = False,
    days: int = 10,
    hash_=None,
) -> x509.Certificate:
    now = dt.datetime.now(dt.UTC)
    issuer_name, issuer_key = issuer or (name, own)

    def named(text: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])

    builder = (
        x509.CertificateBuilder()
        .subject_name(named(name))
        .issuer_name(named(issuer_name))
        .public_key(key(own).public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - dt.timedelta(days=20))
        .not_valid_after(now + dt.timedelta(days=days))
    )
    if ca is not None:
        builder = builder.add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
    return builder.sign(key(issuer_key), hash_ or hashes.SHA256())


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("pki")
    TrustList(directory, URI)
    return directory


@pytest.fixture
def pki(made: Path) -> Path:
    for folder in ("trusted", "issuers", "revoked", "rejected"):
        for path in (made / folder).iterdir():
            path.unlink()
    return made


def put(pki: Path, folder: str, found: x509.Certificate) -> None:
    (pki / folder / f"{found.serial_number}.der").write_bytes(der(found))


def test_a_server_without_a_certificate_makes_its_own(pki: Path) -> None:
    trust = TrustList(pki, URI)
    assert application_uris(trust.own_certificate) == [URI]
    assert stat.S_IMODE((pki / "own" / "key.pem").stat().st_mode) == 0o600
    with pytest.raises(AccessError, match="application URI"):
        TrustList(pki, "urn:another")


def test_a_certificate_whose_key_is_gone_is_made_anew_as_it_says(tmp_path: Path) -> None:
    TrustList(tmp_path, URI)
    own = tmp_path / "own"
    (own / "key.pem").unlink()
    with pytest.raises(AccessError, match=r"key\.pem: No such file .*; put it back, or move cert\.der away"):
        TrustList(tmp_path, URI)
    (own / "cert.der").unlink()
    TrustList(tmp_path, URI)
    assert (own / "key.pem").is_file()


def test_directly_trusted_and_not(pki: Path) -> None:
    trust, client = TrustList(pki, URI), certificate("client", 0)
    with pytest.raises(UntrustedError):
        trust.check(der(client))
    assert [p.read_bytes() for p in (pki / "rejected").iterdir()] == [der(client)]
    put(pki, "trusted", client)
    trust.check(der(client))
    trust.check(der(client) + der(certificate("ca", 1, ca=True)))


def test_who_is_refused_is_named_with_the_way_out(pki: Path) -> None:
    """By what the file in `rejected` and OPC UA tools show, and by the command that lets it in."""
    trust = TrustList(pki, URI)
    unknown, ended = certificate("client", 0), certificate("client", 0, days=-1)
    with pytest.raises(UntrustedError) as refused:
        trust.check(der(unknown))
    (kept,) = (pki / "rejected").iterdir()
    assert str(refused.value) == (
        f"{kept.stem}: not in `trusted`, nor issued by an authority that is; look at it, and let it in with "
        f"`impactcell certs trust '{kept}'`"
    )
    assert hashlib.sha1(der(unknown)).hexdigest().upper() in str(refused.value)
    with pytest.raises(UntrustedError) as refused:
        trust.check(der(ended))
    assert hashlib.sha1(der(ended)).hexdigest().upper() in str(refused.value)
    assert f"from {ended.not_valid_before_utc:%Y-%m-%d} to {ended.not_valid_after_utc:%Y-%m-%d}" in str(
        refused.value
    )
    assert "certs trust" not in str(refused.value), "that would not help"


@pytest.mark.parametrize("whose", ["the client's", "its authority's"])
def test_chains_and_revocation(pki: Path, whose: str) -> None:
    trust = TrustList(pki, URI)
    root = certificate("root", 1, ca=True)
    middle = certificate("middle", 2, ("root", 1), ca=True)
    client = certificate("client", 0, ("middle", 2))
    put(pki, "trusted", root)
    with pytest.raises(UntrustedError, match="nor issued"):
        trust.check(der(client))
    put(pki, "issuers", middle)
    trust.check(der(client))
    now = dt.datetime.now(dt.UTC)
    gone, issuer_key = (client, 2) if whose == "the client's" else (middle, 1)
    revoked = x509.RevokedCertificateBuilder().serial_number(gone.serial_number).revocation_date(now).build()
    listed = (
        x509.CertificateRevocationListBuilder()
        .issuer_name(gone.issuer)
        .last_update(now)
        .next_update(now + dt.timedelta(days=1))
        .add_revoked_certificate(revoked)
        .sign(key(issuer_key), hashes.SHA256())
    )
    from cryptography.hazmat.primitives.serialization import Encoding

    (pki / "revoked" / "middle.crl").write_bytes(listed.public_bytes(Encoding.DER))
    with pytest.raises(UntrustedError, match="revoked"):
        trust.check(der(client))


@pytest.mark.parametrize("what", ["expired", "no authority", "no word of authority", "forged", "noise"])
def test_what_is_refused(pki: Path, what: str) -> None:
    trust = TrustList(pki, URI)
    if what == "expired":
        found = der(expired := certificate("client", 0, days=-1))
        put(pki, "trusted", expired)
    elif what == "no authority":
        put(pki, "trusted", certificate("friend", 1))
        found = der(certificate("client", 0, ("friend", 1)))
    elif what == "no word of authority":
        put(pki, "trusted", certificate("friend", 1, ca=None))
        found = der(certificate("client", 0, ("friend", 1)))
    elif what == "forged":
        put(pki, "trusted", certificate("root", 1, ca=True))
        found = der(certificate("client", 0, ("root", 2)))
    else:
        found = b"\x30\x03abc"
    with pytest.raises(UntrustedError):
        trust.check(found)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::cryptography.utils.CryptographyDeprecationWarning")
def test_a_certificate_that_is_no_certificate_is_untrusted_and_nothing_else(tmp_path: Path) -> None:
    """Bytes of a good one changed at random: whatever the library below thinks of them, they are refused."""
    trust, rng, good = TrustList(tmp_path / "pki", URI), random.Random(1), der(certificate("client", 0))
    for _ in range(3_000):
        data = bytearray(good)
        for _ in range(rng.randint(1, 3)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        with pytest.raises(UntrustedError):
            trust.check(bytes(data[: rng.randrange(len(data))] if rng.random() < 0.1 else data))


def test_a_rejected_certificate_is_kept_whatever_its_subject(tmp_path: Path) -> None:
    pki = tmp_path / "pki"
    trust = TrustList(pki, URI)
    for number, name in enumerate(("a/../../b", "a\\b", "a\x00b", "a\nb", "\u00e4" * 32, "..")):
        with pytest.raises(UntrustedError):
            trust.check(der(certificate(name, 0)))
        assert len(list((pki / "rejected").iterdir())) == number + 1, repr(name)


def test_a_name_in_the_folder_of_rejected_ones_has_80_characters_of_its_subject(pki: Path) -> None:
    common_name, organization = "x" * 60, "y" * 60
    names = [(NameOID.COMMON_NAME, common_name), (NameOID.ORGANIZATION_NAME, organization)]
    subject = x509.Name([x509.NameAttribute(oid, text) for oid, text in names])
    now = dt.datetime.now(dt.UTC)
    stranger = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key(0).public_key())
        .serial_number(1)
        .not_valid_before(now)
        .not_valid_after(now + dt.timedelta(days=1))
        .sign(key(0), hashes.SHA256())
    )
    with pytest.raises(UntrustedError):
        TrustList(pki, URI).check(der(stranger))
    (file,) = (pki / "rejected").iterdir()
    shown = file.name.partition(" [")[0]
    assert shown == subject.rfc4514_string()[:80]
    assert len(subject.rfc4514_string()) > 80


def test_rejected_certificates_do_not_pile_up(pki: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("impactcell.opcua.certificates.trust_list.MAX_REJECTED", 3)
    trust = TrustList(pki, URI)
    for _ in range(5):
        with pytest.raises(UntrustedError):
            trust.check(der(certificate("client", 0)))
    assert len(list((pki / "rejected").iterdir())) == 3


def test_first_of_chain() -> None:
    one, two = der(certificate("one", 0)), der(certificate("two", 1))
    assert first_of_chain(one + two) == one
    with pytest.raises(ValueError, match="DER"):
        first_of_chain(b"")


def test_users_file_round_trip_and_permissions(tmp_path: Path) -> None:
    file = tmp_path / "users.yaml"
    anna = with_password(User("anna", Role.ENGINEER), "correct horse")
    write_users(file, {"anna": anna, "line": User("line", Role.OBSERVER, certificate="AB")})
    assert read_users(file)["anna"] == anna
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert "correct horse" not in file.read_text()
    assert anna.password is not None
    assert anna.password.startswith("$argon2id$v=19$m=19456,t=2,p=1$"), "OWASP's first recommendation"
    assert verify(anna, "correct horse")
    assert not verify(anna, "correct hors")
    assert not verify(None, "")
    assert not verify(User("x", Role.OBSERVER, "no hash"), "no hash")
    users = Users(file)
    assert users.find_by_certificate("AB") is not None
    write_users(file, {})
    assert users.current() == {}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("users: 1", "not a users file"),
        ("- a", "not a users file"),
        ("users: [1]", "has no name"),
        ("users: [{name: a, role: king, password: x}]", "role is one of"),
        ("users: [{name: a, role: observer}]", "neither password nor certificate"),
        ("users: [{name: a, role: observer, password: 3}]", "are text"),
        ("users: [{name: a, role: observer, password: x, admin: true}]", "does not know admin"),
        (
            "users: [{name: a, role: observer, password: x}, {name: a, role: observer, password: x}]",
            "twice",
        ),
        ("users: [", r"users\.yaml:1:9: expected the node content"),
    ],
)
def test_bad_users_files(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "users.yaml"
    file.write_text(text)
    with pytest.raises(AccessError, match=message):
        read_users(file)


def test_user_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "users.yaml"

    def typed(password: str) -> None:
        monkeypatch.setattr(sys, "stdin", io.StringIO(password + "\n"))

    typed("long enough")
    access.add_user(file, "anna", "engineer")
    assert verify(read_users(file)["anna"], "long enough")
    typed("short")
    with pytest.raises(AccessError, match="at least 8"):
        access.add_user(file, "bert")
    with pytest.raises(AccessError, match="not a role"):
        access.add_user(file, "bert", "king")
    own, _ = make_certificate("line", "urn:line", [])
    path = tmp_path / "line.der"
    path.write_bytes(der(own))
    access.add_user(file, "line", "operator", path)
    access.list_users(file, rights=True)
    out = capsys.readouterr().out
    assert "anna\tengineer\tpassword" in out
    assert "line\toperator\tcertificate" in out
    assert "| node | right |" in out
    access.remove_user(file, "anna")
    assert "anna" not in read_users(file)
    with pytest.raises(AccessError, match="no user"):
        access.remove_user(file, "anna")
    for verb in (access.list_users, lambda gone: access.remove_user(gone, "anna")):
        with pytest.raises(AccessError, match="is not there"):
            verb(tmp_path / "none.yaml")


@pytest.mark.parametrize("host", ["bad host", "", "opc.tcp://press-1:4840", "press-1..plant", "1.2.3"])
def test_a_certificate_is_made_for_no_host_that_cannot_be(tmp_path: Path, host: str) -> None:
    with pytest.raises(AccessError, match=rf"^--host '{host}': a host"):
        access.make_certs(tmp_path / "pki", URI, ["press-1.local", host])
    assert not list(tmp_path.iterdir())


def test_hosts_are_in_the_certificate_as_the_network_writes_them(tmp_path: Path) -> None:
    access.make_certs(tmp_path, URI, ["münchen.example", "10.0.0.5", "fe80::1"])
    made = parse_certificate((tmp_path / "own" / "cert.der").read_bytes())
    names = made.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert "xn--mnchen-3ya.example" in names.get_values_for_type(x509.DNSName)
    assert {"10.0.0.5", "fe80::1"} <= set(map(str, names.get_values_for_type(x509.IPAddress)))


def test_what_is_no_certificate_is_listed_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The server ignores such a file; who put it there saw nothing of it."""
    pki, now = tmp_path / "pki", dt.datetime.now(dt.UTC)
    access.make_certs(pki, URI)
    (pki / "trusted" / "scada.crt").write_text("not one")
    (pki / "trusted" / ".keep").touch()
    revoked = (
        x509.CertificateRevocationListBuilder()
        .issuer_name(certificate("ca", 0).subject)
        .last_update(now)
        .next_update(now + dt.timedelta(days=1))
        .sign(key(0), hashes.SHA256())
    )
    (pki / "revoked" / "ca.crl").write_bytes(revoked.public_bytes(Encoding.DER))
    (pki / "revoked" / "other.crl").write_text("not one")
    capsys.readouterr()
    access.list_certs(pki)
    own, *others = capsys.readouterr().out.splitlines()
    assert own.startswith("own ")
    assert others == [
        f"trusted   cannot be used: {pki}/trusted/scada.crt: no certificate in PEM or DER",
        f"revoked   cannot be used: {pki}/revoked/other.crl: no revocation list in PEM or DER",
    ]


def test_certificate_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pki = tmp_path / "pki"
    access.make_certs(pki, URI, ["cell.example.org"])
    with pytest.raises(AccessError, match="already"):
        access.make_certs(pki, URI)
    client = certificate("client", 0)
    with pytest.raises(UntrustedError):
        TrustList(pki, URI).check(der(client))
    rejected = next((pki / "rejected").iterdir())
    access.list_certs(pki)
    assert "rejected" in capsys.readouterr().out
    access.trust_cert(rejected)
    TrustList(pki, URI).check(der(client))
    assert not rejected.exists()
    other = tmp_path / "other.der"
    other.write_bytes(der(certificate("other", 1)))
    with pytest.raises(AccessError, match="--pki"):
        access.trust_cert(other)
    access.trust_cert(other, pki)
    with pytest.raises(AccessError, match="no certificate"):
        access.trust_cert(pki / "own" / "key.pem", pki)
    with pytest.raises(AccessError, match="is not there"):
        access.list_certs(tmp_path / "none")
