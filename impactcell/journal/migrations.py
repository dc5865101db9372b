"""From each stored form of an earlier version to the next: of a cell's state, of an alarm, of a model.

A field that is renamed gets a row here, its place in the form before (see `Migration`) and its new key;
nothing else refers to the old name. Format 2 is the first that has a number. Rows may be added to the last
migration as long as no version that writes its result has been released; the change after that begins a
migration of its own. A later format is refused by `serialization.versioned` and `journal.database`.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from impactcell.positioning import displacement_discrepancy, model_hypotheses, scatter_hypotheses
from impactcell.positioning.prediction_watch import NOTHING_BET
from impactcell.serialization import Migration
from impactcell.serialization.tree import Tree
from impactcell.tracking.wear_batch import block_filter, run_length_bank

ALARM_NAMES_1: Final[Mapping[str, str]] = {
    "WEAR_LIMIT": "WearLimit",
    "BATCH_SHIFT": "BatchShift",
    "DEVIANT_CYCLE": "DeviantCycle",
    "MODULE_CONNECTION": "ModuleConnection",
    "MODEL_GAP": "ModelGap",
    "POSITIONING_FAULT": "PositioningFault",
    "JOURNAL_FAULT": "JournalFault",
}
"""Conditions of format 1, in the order in which its state has their alarms and delays."""
FLOATS_OF_EVIDENCE_1: Final = (
    "statistic", "threshold", "size", "size_std", "false_alarm_cycles", "false_alarm_days",
)  # fmt: skip


def _state_2(content: dict[str, Tree]) -> dict[str, Tree]:
    """Alarms and delays by name instead of by place; those of the snapshot are the state's."""
    state, snapshot = content["state"], content["snapshot"]
    of_cell = state["alarms"]
    names = [alarm["name"] for alarm in of_cell["alarms"]]
    by_name = {
        "alarms": dict(zip(names, of_cell["alarms"], strict=True)),
        "delays": dict(zip(names, of_cell["delays"], strict=True)),
    }
    return {
        **content,
        "state": {**state, "alarms": {**of_cell, **by_name}},
        "snapshot": None if snapshot is None else {**snapshot, "alarms": []},
        "belief": None if content["belief"] is None else _planner_2(content["belief"]),
    }


def _planner_2(belief: dict[str, Tree]) -> dict[str, Tree]:
    """Give what the planner has learned a discrepancy, and kinds of scatter, of which it knows nothing yet.

    Format 1 had the variance of friction as inverse-gamma: its probabilities are those of its density. What
    was learned of the parameters holds under each hypothesis of what the model lacks.
    """
    means, covs = np.asarray(belief["means"]), np.asarray(belief["covs"])
    count, size = means.shape
    lacking = model_hypotheses.WEIGHTS_STD
    weights = displacement_discrepancy.FEATURES
    wide = np.zeros((lacking.size, count, size + weights, size + weights))
    wide[..., :size, :size] = covs
    for hypothesis, std in enumerate(lacking):
        wide[hypothesis, :, size:, size:] = np.eye(weights) * std**2
        wide[hypothesis, :, size - 1, size - 1] += model_hypotheses.VISCOUS_STD[hypothesis] ** 2
    std = scatter_hypotheses.FRICTION_STD
    logarithm = -2.0 * belief["shape"] * np.log(std) - belief["rate"] / std**2
    friction = np.exp(logarithm - logarithm.max())
    others = scatter_hypotheses.PRIOR_WEIGHTS.reshape(std.size, -1).sum(axis=0)
    scatter = np.outer(friction / friction.sum(), others).ravel()
    return {
        "weights": np.outer(model_hypotheses.PROBABILITIES, belief["weights"]).ravel(),
        "means": np.tile(np.concatenate([means, np.zeros((count, weights))], axis=1), (lacking.size, 1)),
        "covs": wide.reshape(-1, size + weights, size + weights),
        "hypotheses": np.repeat(np.arange(float(lacking.size)), count),
        "scatter_weights": np.tile(scatter, (lacking.size, 1)),
        "taps": belief["taps"],
        "surprise": belief["surprise"],
        "watch": {"log_sums": NOTHING_BET, "score": 0.0, "doubted": False},
    }


def _state_6(content: dict[str, Tree]) -> dict[str, Tree]:
    """Keep what correlation of the scatter was learned: as of so many differences that show it."""
    cell = content["cell"]
    tracker = {**cell["tracker"]}
    weight = tracker["scatter_correlation"]["weight"]
    for name in ("noise", "replayed_noise"):
        scale = {**tracker[name]}
        correlation = scale.pop("correlation")
        squares = [weight * (1.0 - correlation**lag) / (1.0 - correlation) for lag in _LAGS_6]
        variogram = {
            "recent": [],
            "weights": [weight] * len(_LAGS_6),
            "squares": squares,
            "correlation": correlation,
        }
        tracker[name] = {**scale, "variogram": variogram}
    return {**content, "cell": {**cell, "tracker": tracker}}


def _state_7(content: dict[str, Tree]) -> dict[str, Tree]:
    """Begin the banks under other models anew with the next cycle: none of them had a larger scatter."""
    cell = content["cell"]
    return {**content, "cell": {**cell, "tracker": {**cell["tracker"], "walk_models": None}}}


def _state_13(content: dict[str, Tree]) -> dict[str, Tree]:
    """Date the states of alarms, wherever they are kept, as `_alarm_3` does."""
    cell = content["cell"]
    dated = {name: _alarm_3(alarm) for name, alarm in cell["alarms"]["alarms"].items()}
    return {**content, "cell": {**cell, "alarms": {**cell["alarms"], "alarms": dated}}}


def _alarm_3(content: dict[str, Tree]) -> dict[str, Tree]:
    """Tell since when an alarm is active: its activation. Its comment is of who acted last."""
    since = content["activation"] if content["active"] else 0
    said = {"comment_ns": 0, "comment_user": content["user"] if content["comment"] else ""}
    return {**content, "active_ns": since, "enabled_ns": 0, **said}


def _alarm_2(content: dict[str, Tree]) -> dict[str, Tree]:
    """Numbers as such instead of in hexadecimal, members of enums by their values."""
    evidence = content["evidence"]
    floats = {name: float.fromhex(evidence[name]) for name in FLOATS_OF_EVIDENCE_1}
    return {
        **content,
        "name": ALARM_NAMES_1[content["name"]],
        "shelving": content["shelving"].lower(),
        "evidence": {**evidence, **floats},
    }


def _model_2(content: dict[str, Tree]) -> dict[str, Tree]:
    """Numbers as such instead of in hexadecimal; only its name and its provenance are text."""
    text = {name: content[name] for name in ("name", "provenance")}
    return {name: text[name] if name in text else _numbers(content[name]) for name in content}


def _numbers(tree: Tree) -> Tree:
    if isinstance(tree, dict):
        return {key: _numbers(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [_numbers(value) for value in tree]
    return float.fromhex(tree)


def _under(place: str, rows: Mapping[str, Tree]) -> dict[str, Tree]:
    return {f"{place}.{row}": key for row, key in rows.items()}


_ALARM_2_RENAMED: Final[Mapping[str, str]] = {}
"""Of `impactcell.records.Alarm`, as "evidence.size": "magnitude"; they hold for the state too."""
_ALARM_2_ADDED: Final[Mapping[str, Tree]] = {"message_de": "", "activation": 0}
"""The German message, which activation it is; like those above, they hold for the state too."""
_NOISE_2_RENAMED: Final[Mapping[str, str]] = {"belief": "exponent_posterior", "rough": "winsorised_factor"}
"""Of the tracker's scale of the noise, wherever it is kept."""
_TRACKER_2_RENAMED: Final[Mapping[str, str]] = {
    "shift": "change_point",
    "shift.found_at": "detected_at",
    "monitor": "innovation_correlation",
    "replayed": "replayed_noise",
    "history": "commissioning",
    "first": "first_index",
    **_under("noise", _NOISE_2_RENAMED),
    **_under("replayed", _NOISE_2_RENAMED),
}
"""Of the state of wear and batch."""
_STATE_2_RENAMED: Final[Mapping[str, str]] = {
    "state": "cell",
    "belief": "planner",
    "state.alarms.delays": "counters",
    "state.alarms.announced": "suppressed_cycles",
    "state.batch.by_person": "by_operator",
    "state.batch.by_person.module_said": "module_batch_id",
    "state.batch.announcement_seen": "last_announcement",
    "state.gap.squares": "squared_deviations",
    **_under("state.tracker", _TRACKER_2_RENAMED),
    **_under("state.signature.reference", {"met": "cycles_met", "varied": "cycles_varied"}),
    "state.signature.reference.variation.seen": "signal",
    **_under("state.alarms.alarms.*", _ALARM_2_RENAMED),
}
"""Of all that `StoredState` holds."""
_STATE_2_ADDED: Final[Mapping[str, Tree]] = {
    "state.tracker.clock.session": 0,
    "state.tracker.wear_blocks": None,
    "state.model_digest": "",
    "state.model_changed": False,
    "state.alarms.delays.*.held_back": None,
    "state.alarms.delays.*.waited": 0,
    "snapshot.positioning.predictions": {
        "taps": 0,
        "lacking": False,
        "depends_on": "",
        "evidence": dict.fromkeys(FLOATS_OF_EVIDENCE_1, math.nan) | {"change_cycle": 0},
    },
}
"""What a state did not keep before."""
_WEAR_BLOCKS_3_ADDED: Final[Mapping[str, Tree]] = {
    "segments": np.zeros((0, block_filter.SEGMENTS, block_filter.WIDTH)),
    "weighed_until": 0.0,
}
"""Format 2 kept all blocks: they are weighed once more, and then forgotten."""
_AUTOCORRELATION_5: Final[Mapping[str, Tree]] = {
    "recent": [0.0] * 8,
    "weight": 0.0,
    "square": 0.0,
    "products": [0.0] * 8,
}
"""Of no innovations: format 4 had lag one only."""
_NOISE_5_ADDED: Final[Mapping[str, Tree]] = {"correlation": 0.0, "watched_ratio": 1.0, "latest_ratio": 1.0}
"""Of the tracker's scale of the noise: white, and as it was learned."""
_LAGS_6: Final = range(1, 5)
"""Of a variogram."""
_NO_VARIOGRAM_6: Final[Mapping[str, Tree]] = {
    "recent": [],
    "weights": [0.0] * len(_LAGS_6),
    "squares": [0.0] * len(_LAGS_6),
    "correlation": 0.0,
}
"""Of no scores: what format 5 knew of them was correlation of innovations."""
_MODEL_2_RENAMED: Final[Mapping[str, str]] = {}
"""Of `impactcell.prediction.Model`, as "predictors.force.rms": "error"."""

STATE_MIGRATIONS: Final = (
    Migration(
        _state_2,
        renamed=_STATE_2_RENAMED,
        added={**_under("state.alarms.alarms.*", _ALARM_2_ADDED), **_STATE_2_ADDED},
    ),
    Migration(
        added=_under("cell.tracker.wear_blocks", _WEAR_BLOCKS_3_ADDED),
        dropped=("cell.tracker.wear_blocks.weighed_blocks",),
    ),
    Migration(added={"last": None, "planner.uncounted_evidence": 0.0}),
    Migration(
        added={
            **_under(
                "cell.tracker",
                {
                    "innovation_correlation": _AUTOCORRELATION_5,
                    "scatter_correlation": _AUTOCORRELATION_5,
                    **_under("noise", _NOISE_5_ADDED),
                    **_under("replayed_noise", _NOISE_5_ADDED),
                },
            ),
            "cell.gap.correlation": _AUTOCORRELATION_5,
        },
        dropped=("cell.tracker.innovation_correlation",),
    ),
    Migration(
        _state_6,
        added={
            "cell.gap.variogram": _NO_VARIOGRAM_6,
            "cell.signature.deviant_share": 0.0,
            "cell.tracker.walk_models": None,
        },
        dropped=(
            "cell.tracker.scatter_correlation",
            "cell.tracker.innovation_correlation",
            "cell.gap.correlation",
        ),
    ),
    Migration(
        _state_7,
        added={
            "cell.tracker.noise.rescalings": 0.0,
            "cell.tracker.replayed_noise.rescalings": 0.0,
        },
    ),
    Migration(added={"cell.tracker.rates": run_length_bank.EMPTY, "cell.tracker.rate_change": None}),
    Migration(
        added={
            "cell.tracker.common_variance": math.nan,
            "cell.tracker.common_cycles": 0.0,
            "snapshot.wear.level_common_std": math.nan,
            **{
                f"snapshot.friction.{which}.common_std": math.nan
                for which in ("mu_s", "mu_k", "by_force", "by_distance", "combined")
            },
        }
    ),
    Migration(added=_under("snapshot.signature", {"t_squared_limit": math.nan, "spe_limit": math.nan})),
    Migration(added={"handled_target": None}),
    Migration(added={"cell.tracker.clock.earlier": [], "cell.tracker.expects_change": False}),
    Migration(_state_13),
    Migration(added=_under("planner.watch", {"told_log_sums": NOTHING_BET, "off_taps": 0, "off_score": 0.0})),
)
"""Of a cell's state: to formats 2 to 14. What earlier planners had not counted is nothing; how a module
counted before it last started is not known, nor of what they told how much a single tap had said."""
ALARM_MIGRATIONS: Final = (
    Migration(_alarm_2, renamed=_ALARM_2_RENAMED, added=_ALARM_2_ADDED),
    Migration(_alarm_3),
)
MODEL_MIGRATIONS: Final = (Migration(_model_2, renamed=_MODEL_2_RENAMED),)
