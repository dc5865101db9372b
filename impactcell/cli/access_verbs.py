"""`impactcell users ...` and `impactcell certs ...` on the command line."""

from pathlib import Path
from typing import Annotated

import typer

from impactcell.cli.options import verb

UsersFile = Annotated[Path, typer.Argument(metavar="FILE", help="The cell's users file.")]
PkiDirectory = Annotated[Path, typer.Argument(metavar="DIR", help="The cell's certificates directory.")]

users = typer.Typer(no_args_is_help=True, help="Users of the OPC UA server.")
certs = typer.Typer(no_args_is_help=True, help="Certificates of the OPC UA server.")


@verb(users, "add")
def users_add(
    file: UsersFile,
    name: Annotated[str, typer.Argument(help="As typed at login.")],
    *,
    role: Annotated[str, typer.Option(help="observer, operator or engineer")] = "observer",
    certificate: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Log in by this certificate instead of a password.")
    ] = None,
) -> None:
    """Add a user or change one; the password is asked for, or read from standard input.

    With `--certificate` none is asked for.
    """
    from impactcell.cli.access import add_user

    add_user(file, name, role, certificate)


@verb(users, "remove")
def users_remove(file: UsersFile, name: Annotated[str, typer.Argument(help="As typed at login.")]) -> None:
    """Remove a user; sessions that are open end within a second."""
    from impactcell.cli.access import remove_user

    remove_user(file, name)


@verb(users, "list")
def users_list(
    file: UsersFile,
    *,
    rights: Annotated[bool, typer.Option("--rights", help="Show what each role may.")] = False,
) -> None:
    """List users with their roles."""
    from impactcell.cli.access import list_users

    list_users(file, rights=rights)


@verb(certs, "make")
def certs_make(
    pki: PkiDirectory,
    *,
    application_uri: Annotated[str | None, typer.Option(help="In place of this machine's.")] = None,
    host: Annotated[
        list[str] | None, typer.Option(help="A name or address of the server; repeatable.")
    ] = None,
) -> None:
    """Make the server's certificate and the folders of the trust list."""
    from impactcell.cli.access import make_certs

    make_certs(pki, application_uri, host)


@verb(certs, "trust")
def certs_trust(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A certificate, as from the rejected folder.")],
    *,
    pki: Annotated[Path | None, typer.Option(metavar="DIR", help="Where FILE is not inside one.")] = None,
) -> None:
    """Trust a client's certificate; takes effect without a restart.

    `--pki` is needed where FILE lies in no folder `rejected`.
    """
    from impactcell.cli.access import trust_cert

    trust_cert(file, pki)


@verb(certs, "list")
def certs_list(pki: PkiDirectory) -> None:
    """List certificates: own, trusted, rejected."""
    from impactcell.cli.access import list_certs

    list_certs(pki)
