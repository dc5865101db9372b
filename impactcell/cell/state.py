"""What a cell is computed by and keeps between cycles, and what another design means for that."""

from dataclasses import dataclass, field, replace

from impactcell import alarms
from impactcell.alarms import AlarmSetState, AlarmSettings
from impactcell.cell.model_change import REPLACED, model_digest
from impactcell.cell.preprocessing import BatchNaming, CaptureDefaults
from impactcell.prediction import Model
from impactcell.tracking.model_gap import gap_cusum
from impactcell.tracking.signature import tracker as signature
from impactcell.tracking.signature.tracker import SignatureSettings, SignatureState
from impactcell.tracking.wear_batch import TrackerSettings, TrackerState


@dataclass(frozen=True, slots=True)
class CellDesign:
    """How one cell is computed; comes from its YAML and model file and does not change between cycles.

    Attributes
    ----------
    defaults : CaptureDefaults
        What holds where the module says nothing.
    false_alarm_cycles : float
        Designed mean number of cycles between two false alarms of one rule.
    """

    name: str
    model: Model
    tracker: TrackerSettings
    signature: SignatureSettings
    alarms: AlarmSettings
    defaults: CaptureDefaults = field(default_factory=CaptureDefaults)
    false_alarm_cycles: float = 100_000.0


@dataclass(frozen=True, slots=True, eq=False)
class CellState:
    """All that a cell keeps between cycles.

    Attributes
    ----------
    cycle, time_ns : int
        Of the last one.
    period_s : float
        Mean time between cycles, 0 before it is known.
    grid : tuple
        Length and points of the signature's grid.
    model_digest : str
        Of the model that the state was learned with; empty where that is not known.
    model_changed : bool
        Another model holds from the next cycle on.
    """

    tracker: TrackerState
    signature: SignatureState
    gap: gap_cusum.GapState
    alarms: AlarmSetState
    cycle: int = 0
    time_ns: int = 0
    period_s: float = 0.0
    batch: BatchNaming = field(default_factory=BatchNaming)
    grid: tuple[float, int] = (0.0, 0)
    model_digest: str = ""
    model_changed: bool = False


def initial_state(design: CellDesign) -> CellState:
    """State of a cell that has seen nothing."""
    return CellState(
        TrackerState(),
        signature.initial_state(design.signature),
        gap_cusum.GapState(),
        alarms.initial_state(design.alarms),
        grid=_grid(design),
        model_digest=model_digest(design.model),
    )


def migrate_state(design: CellDesign, state: CellState, time_ns: int) -> CellState:
    """Make a state fit the design: what is learned on another grid or by another model is learned anew.

    Another model moves the estimates, as another batch would, and what residuals are usual: the next cycle is
    an expected change, and says nothing of the material. Wear learned by a provisional model is learned anew,
    and so is wear where one comes into service: its friction, and how that scatters, are another's. What was
    told of it ends at `time_ns`.
    """
    if state.grid != _grid(design):
        state = replace(state, signature=signature.initial_state(design.signature), grid=_grid(design))
    model = design.model
    digest = model_digest(model)
    if state.model_digest == digest:
        return state
    has_changed = bool(state.model_digest)
    if has_changed and (model.is_provisional or model.provenance.get(REPLACED) == state.model_digest):
        told = alarms.end_surface(state.alarms, state.cycle, time_ns)
        state = replace(state, tracker=TrackerState(clock=state.tracker.clock), alarms=told)
    gap = gap_cusum.GapState() if has_changed else state.gap
    return replace(state, gap=gap, model_digest=digest, model_changed=state.model_changed or has_changed)


def _grid(design: CellDesign) -> tuple[float, int]:
    return design.signature.length_m, design.signature.points
