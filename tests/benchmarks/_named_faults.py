"""Faults that no test had noticed once, each with the tests that have to notice it now."""

from dataclasses import dataclass
from typing import Final

_IDENTITY: Final = "tests/integration/test_opcua_identity.py"
_OPCUA: Final = "impactcell/opcua"


@dataclass(frozen=True, slots=True)
class NamedFault:
    """`before`, which the file has once, becomes `after`."""

    what: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]


NAMED_FAULTS: Final = (
    NamedFault(
        "signature of a user certificate not checked",
        f"{_OPCUA}/authentication.py",
        "check(certificate, self._trust.own_certificate + nonce, signature.Signature)",
        "pass",
        (_IDENTITY,),
    ),
    NamedFault(
        "signature of a user certificate of another nonce taken",
        f"{_OPCUA}/authentication.py",
        "check(certificate, self._trust.own_certificate + nonce, signature.Signature)",
        "self._heard = getattr(self, '_heard', set()) | {signature.Signature}",
        (_IDENTITY,),
    ),
    NamedFault(
        "client's application signature not checked",
        f"{_OPCUA}/session_service.py",
        "self._check_signature(session, context, parameters.ClientSignature)",
        "pass",
        (_IDENTITY,),
    ),
    NamedFault(
        "session taken to the channel of another client",
        f"{_OPCUA}/session_service.py",
        "if session.certificate != channel.peer_certificate or session.policy_uri != channel.policy_uri:",
        "if False:",
        (_IDENTITY,),
    ),
    NamedFault(
        "session used on another channel without being moved",
        f"{_OPCUA}/session_table.py",
        "        if session.connection is not connection:\n            raise",
        "        if False:\n            raise",
        (_IDENTITY,),
    ),
    NamedFault(
        "session that nobody has logged in to taken to another channel",
        f"{_OPCUA}/session_service.py",
        "if not session.is_activated:",
        "if False:",
        (_IDENTITY,),
    ),
    NamedFault(
        "nonce of a password not compared",
        f"{_OPCUA}/authentication.py",
        "or body[length - len(nonce) :] != nonce",
        "",
        (_IDENTITY,),
    ),
    NamedFault(
        "another user inherits the subscriptions of a session",
        f"{_OPCUA}/session_service.py",
        "if before is not None and before.user != actor.user:",
        "if False:",
        (_IDENTITY,),
    ),
    NamedFault(
        "another user takes over a subscription",
        f"{_OPCUA}/subscription_service.py",
        "elif subscription.owner != context.actor.user:",
        "elif False:",
        (_IDENTITY,),
    ),
    NamedFault(
        "password in the clear on a channel without encryption",
        f"{_OPCUA}/authentication.py",
        "elif not encrypted:",
        "elif False:",
        (_IDENTITY,),
    ),
    NamedFault(
        "expired user certificate",
        f"{_OPCUA}/authentication.py",
        "user is None or not self._trust.is_valid_now(certificate)",
        "user is None",
        (_IDENTITY,),
    ),
    NamedFault(
        "revoked authority",
        f"{_OPCUA}/trust_list.py",
        "if self._is_revoked(issuer):",
        "if False:",
        ("tests/unit/opcua/test_trust_list.py",),
    ),
    NamedFault(
        "revoked client",
        f"{_OPCUA}/trust_list.py",
        "if self._is_revoked(certificate):",
        "if False:",
        ("tests/unit/opcua/test_trust_list.py",),
    ),
    NamedFault(
        "lowered role keeps its rights on a live session",
        f"{_OPCUA}/service_host.py",
        "elif user.role is not actor.role:",
        "elif False:",
        (_IDENTITY,),
    ),
    NamedFault(
        "methods not in the audit log",
        f"{_OPCUA}/method_service.py",
        "self._audit.method_called(context.actor, request, result.StatusCode.value, reason)",
        "pass",
        ("tests/integration/test_opcua_audit.py",),
    ),
    NamedFault(
        "acknowledgements not in the journal's audit",
        "impactcell/service/worker.py",
        "self._record(state, audit)",
        "self._record(state)",
        ("tests/unit/service",),
    ),
    NamedFault(
        "commands not in the journal's audit",
        "impactcell/service/worker.py",
        "self._record(change_state(self._state), audit)",
        "self._record(change_state(self._state))",
        ("tests/unit/service",),
    ),
    NamedFault(
        "positioning commands not in the journal's audit",
        "impactcell/service/cell_task.py",
        "await self.worker.record(audit)",
        "pass",
        ("tests/unit/service",),
    ),
    NamedFault(
        "what the planner has learned not restored",
        "impactcell/service/worker.py",
        "self.belief = restored.planner",
        "self.belief = None",
        ("tests/unit/service/test_planner_restart.py",),
    ),
    NamedFault(
        "what the planner has learned not stored",
        "impactcell/service/worker.py",
        "StoredState(state, snapshot, self.belief, last)",
        "StoredState(state, snapshot, None, last)",
        ("tests/unit/service/test_planner_restart.py",),
    ),
    NamedFault(
        "sequence number after a capture not compared",
        "impactcell/fieldbus/cycles/capture_reader.py",
        "        if before == after:\n",
        "        if before == before:\n",
        ("tests/unit/fieldbus",),
    ),
    NamedFault(
        "window that is being changed taken as at rest",
        "impactcell/fieldbus/cycles/capture_reader.py",
        "sequence % 2 == 0 and",
        "",
        ("tests/unit/fieldbus",),
    ),
    NamedFault(
        "not-a-number of a single value taken as a number",
        "impactcell/fieldbus/register_map/register.py",
        "        if code == self.not_a_number:\n            return math.nan\n",
        "",
        ("tests/unit/fieldbus/test_codec.py", "tests/unit/fieldbus/test_registers.py"),
    ),
    NamedFault(
        "command sequence does not wrap",
        "impactcell/fieldbus/register_map/positioning_registers.py",
        "else accepted % last + 1",
        "else accepted + 1",
        ("tests/unit/fieldbus/test_tap_commands.py",),
    ),
    NamedFault(
        "equation (6) weighs both with one half",
        "impactcell/prediction/equations.py",
        "return slope_f / (slope_f + slope_d * span_f / max(abs(span_d), 1e-12))",
        "return 0.5",
        ("tests/unit/prediction/test_equations.py",),
    ),
    NamedFault(
        "journal commits without waiting for the disk",
        "impactcell/journal/database.py",
        "PRAGMA synchronous = FULL",
        "PRAGMA synchronous = NORMAL",
        ("tests/unit/journal/test_power_loss.py",),
    ),
)


def faulty_source(fault: NamedFault, source: str) -> str:
    """Put a fault into the source of its file.

    Raises
    ------
    ValueError
        The file does not have `before` once: the fault has to be written anew.
    """
    if source.count(fault.before) != 1:
        raise ValueError(
            f"{fault.what}: {fault.file} has {fault.before!r} {source.count(fault.before)} times"
        )
    return source.replace(fault.before, fault.after)
