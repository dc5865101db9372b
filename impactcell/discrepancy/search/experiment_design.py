"""Which shots, added to those there are, would tell tied effects apart, how many of them, and how surely.

Settings are looked for by the distance that is left when the rival is fitted to old and new shots together
(`separation.py`). What the nearest of them promise is the share of redraws in which the rule that ties the
two effects no longer does (`tie_redraws.py`), whichever of them is true; of the setting that is proposed it
is that about where the models come when they are fitted to simulated shots (`simulated_shots.py`).
"""

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from impactcell.discrepancy.data import HELD_OUT_SHARE, CellLimits, Setting
from impactcell.discrepancy.model import Fit, Problem
from impactcell.discrepancy.search.further_shots import FurtherShots, NewShots, answers_of
from impactcell.discrepancy.search.indistinguishability import MAX_DEVIATION, NEGLIGIBLE_DIFFERENCE
from impactcell.discrepancy.search.separation import Pair, refitted_separation, weights_of
from impactcell.discrepancy.search.tie_redraws import is_told, share_told
from impactcell.errors import PhysicsError
from impactcell.physics import Kind
from impactcell.physics.effect_names import COLUMN_PREFIX
from impactcell.physics.effects import LIBRARY, find_effect
from impactcell.physics.free_column_forms import printed

POWER = 0.9
"""Share of redraws in which the shots proposed tell two effects apart."""
POWER_DEVIATIONS = 1.28
"""Standard deviations beyond which a tenth of a normal distribution lies."""
COUNTS = (2, 3, 4, 6, 8, 10, 12, 15, 20, 25, 30, 40, 60, 80, 120, 200)
"""Shots of each kind that may be proposed; more than the last are no proposal. Own choice."""
FEW_DRAWS, DRAWS = 60, 300
"""Redraws of a first look, and those by which a share is told: it is known to 2 %."""
MAX_LOOKS = 40
"""Settings and numbers of shots, the fewest first, of which shots are drawn."""
MAX_REFITS = 4
"""Proposals that are held against shots simulated and fitted to, until one keeps its promise."""
SIMULATION = 9
"""Stream of random numbers of these shots, apart from those of other draws."""
LATE_CHANNELS = frozenset({"force_sensor_lag", "channel_skew", "position_sensor_lag"})
"""Effects that make a channel late: no weight at rest shows them."""
UNLIMITED = CellLimits()
"""Limits of a cell of which nothing is known."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A setting and how many shots of it, added to those there are, tell two effects apart.

    Attributes
    ----------
    effects : tuple of str
        The two that would be told apart.
    setting : str
        What to do, in words.
    shots : int
        0 where it is not a matter of shots but of a measurement of its own.
    power : float
        Share of redraws that told them apart; nan where it is no matter of shots.
    """

    effects: tuple[str, str]
    setting: str
    shots: int
    power: float


def propose_experiments(
    problem: Problem,
    best: Fit,
    rivals: Sequence[tuple[str, str, Fit]],
    batches: Sequence[str],
    limits: CellLimits = UNLIMITED,
    ties: Mapping[str, Sequence[str]] = MappingProxyType({}),
    *,
    remains: bool = False,
) -> tuple[Proposal, ...]:
    """For each tie the cheapest setting that breaks it.

    Parameters
    ----------
    problem : Problem
    best : Fit
    rivals : sequence of (effect, rival effect, fit of the rival's model)
    batches : sequence of str
        Names of the batches, in order of appearance.
    limits : CellLimits
        Of the cell in which the shots would be made.
    ties : mapping
        Of each effect all that is tied with it, columns of `shots.csv` among them.
    remains : bool
        Something remains beside the best model: then effects between shots are held against each other by
        the friction factors alone.
    """
    settings = problem.shots.excitation.settings_within_reach(
        problem.shots.items, best.shot_parameters.mass_kg, batches, limits
    )
    found = []
    for name, rival, fit in rivals:
        by_factors = remains and LIBRARY[name].kind is Kind.BETWEEN_SHOTS
        tie = _Tie(Pair.of(problem, best, fit, by_factors=by_factors), settings, (name, rival))
        found.append((tie, _cheapest_experiment(tie)))
    return (*_merged(found), *_other_orders(ties))


class _Tie:
    """Two tied models, either of which may be the true one, and what further shots there could be.

    Parameters
    ----------
    pair : Pair
        The best one and its rival.
    settings : sequence of (str, tuple of PreparedShot)
    effects : tuple of str
        In which they differ.
    """

    def __init__(self, pair: Pair, settings: Sequence[Setting], effects: tuple[str, str]) -> None:
        self.effects = effects
        self.pairs = (pair, pair.swapped())
        self.settings = settings

    def screened(self) -> list[tuple[int, int]]:
        """Shots in all that may do, and the place of their setting, the fewest first."""
        places = self._distinct()
        items = [shot for place in places for shot in self.settings[place][1]]
        if not items:
            return []
        every = [FurtherShots(pair, items).about_now() for pair in self.pairs]
        found: dict[tuple[object, ...], tuple[int, int]] = {}
        begin = 0
        for place in places:
            kinds = np.arange(begin, begin + len(self.settings[place][1]))
            begin += len(kinds)
            if not all(new.is_known[kinds].all() for new in every):
                continue
            left = [_left(pair, new.select(kinds)) for pair, new in zip(self.pairs, every, strict=True)]
            count = max(map(_screened_count, left))
            if count <= COUNTS[-1]:
                # What differs by less than a hundredth needs as many shots: the first stands for all.
                alike = tuple(f"{D:.2g}" for one in left for D in one)
                found.setdefault((len(kinds), alike), (count * len(kinds), place))
        return sorted(found.values())

    def _distinct(self) -> list[int]:
        """List places of settings with an answer of their own: a rest with which nothing goes has none."""
        items = [shot for _, made in self.settings for shot in made]
        try:
            answers = list(answers_of(self.pairs[0], items)) if items else []
        except (PhysicsError, ValueError):
            return []
        found: dict[bytes, int] = {}
        begin = 0
        for place, (_, made) in enumerate(self.settings):
            found.setdefault(b"".join(answers[begin : begin + len(made)]), place)
            begin += len(made)
        return [*found.values()]

    def power(self, place: int, count: int) -> float:
        """Share of redraws that tell the models apart by so many shots of each kind, the lesser of both.

        0 where the plant has no answer.
        """
        made = self.settings[place][1]
        trained = _trained(count)
        kind = np.repeat(np.arange(len(made)), trained)
        groups = np.repeat([shot.group for shot in made], trained)
        least = 1.0
        for pair in self.pairs:
            try:
                new = FurtherShots(pair, made).about_refit(trained)
            except (PhysicsError, ValueError):
                return 0.0
            if not new.is_known.all():
                return 0.0
            for draws in (FEW_DRAWS, DRAWS):
                told = share_told(pair, new, kind, groups, draws, np.random.default_rng(SIMULATION))
                if told < POWER:
                    return told
            least = min(least, told)
        return least

    def is_told(self, place: int, count: int) -> bool:
        """Whether it is so with shots of either model that are simulated, and fitted to with all others."""
        made = self.settings[place][1] * _trained(count)
        return all(is_told(pair, made, np.random.default_rng(SIMULATION)) for pair in self.pairs)

    def proposal(self, place: int, count: int, power: float) -> Proposal:
        """Propose so many shots of each kind of a setting."""
        words, made = self.settings[place]
        return Proposal(self.effects, words, count * len(made), power)


def _trained(count: int) -> int:
    """How many of so many shots the models are fitted to: the others are held out."""
    return max(math.floor((1.0 - HELD_OUT_SHARE) * count), 1)


def _left(pair: Pair, new: NewShots) -> list[float]:
    """Log-likelihood that is left between the models of a pair by each of `COUNTS`, to first order."""
    weights = weights_of(pair.own, pair.models[1].spread)
    old, seen = pair.old[1].eliminate(weights), new.without_noise(*pair.columns).eliminate(weights)
    counts = [[_trained(count)] * len(new.gram) for count in COUNTS]
    return [0.5 * refitted_separation(old, seen, each) for each in counts]


def _screened_count(left: Sequence[float]) -> int:
    """Shots of each kind that may break the rule that ties; more than the last of `COUNTS` where none do.

    The scatter of a log-likelihood D over draws has a variance of about 2 D.
    """
    for count, D in zip(COUNTS, left, strict=True):
        if max((MAX_DEVIATION + POWER_DEVIATIONS) * math.sqrt(2.0 * D), NEGLIGIBLE_DIFFERENCE) <= D:
            return count
    return COUNTS[-1] + 1


def _cheapest_experiment(tie: _Tie) -> tuple[int, int, float] | None:
    """Find the setting that takes the fewest shots: the next cheapest is looked at until one does.

    Where as many shots of another setting were as sure, more of this one are not looked at.

    Returns
    -------
    place, count, power : int, int, float
        Of the setting, shots of each kind, and what they reach; None where no setting does.
    """
    waiting, refits = tie.screened(), 0
    seen = set[tuple[int, float]]()
    for _ in range(MAX_LOOKS):
        if not waiting or refits == MAX_REFITS:
            return None
        shots, place = heapq.heappop(waiting)
        kinds = len(tie.settings[place][1])
        count = shots // kinds
        power = tie.power(place, count)
        as_sure = (shots, round(power, 2))
        if 0.0 < power < POWER and as_sure in seen:
            continue
        seen.add(as_sure)
        if power >= POWER:
            refits += 1
            if tie.is_told(place, count):
                return place, count, power
        more = next((one for one in COUNTS if one > count), 0)
        if more:
            heapq.heappush(waiting, (more * kinds, place))
    return None


def _merged(found: Sequence[tuple[_Tie, tuple[int, int, float] | None]]) -> Iterator[Proposal]:
    """Propose for each tie what a larger experiment for another one tells as well, else its own."""
    settled = [(tie, one) for tie, one in found if one is not None]
    settled.sort(key=lambda one: -one[0].proposal(*one[1]).shots)
    chosen: dict[tuple[int, int], None] = {}
    of_tie: dict[tuple[str, str], Proposal] = {}
    for tie, cheapest in settled:
        told = ((*one, tie.power(*one)) for one in chosen if one != cheapest[:2])
        place, count, power = next((one for one in told if one[2] >= POWER), cheapest)
        chosen[place, count] = None
        of_tie[tie.effects] = tie.proposal(place, count, power)
    for effects in (tie.effects for tie, _ in found):
        yield of_tie.get(effects, Proposal(effects, _separate_measurement(*effects), 0, math.nan))


def _other_orders(ties: Mapping[str, Sequence[str]]) -> Iterator[Proposal]:
    """Say what tells effects from the columns that are tied with them."""
    for effect, tied in ties.items():
        for rival in (name for name in tied if name.startswith(COLUMN_PREFIX)):
            (column,) = find_effect(rival).columns
            setting = f"the same settings again, column {printed(column)} in another order"
            yield Proposal((effect, rival), setting, 0, math.nan)


def _separate_measurement(effect: str, rival: str) -> str:
    """Say what breaks an exact confound: a measurement outside of the shots."""
    kinds = {LIBRARY[effect].kind, LIBRARY[rival].kind}
    names = {effect, rival}
    if "mass_error" in names:
        return (
            "weigh the part: if it weighs other than told, correct its mass, else the force sensor's scale"
            if "force_sensor_gain" in names
            else "weigh the part"
        )
    if names & LATE_CHANNELS:
        return (
            "the same settings at a higher sampling rate: at first contact it shows what makes a channel late"
        )
    if Kind.SENSOR in kinds:
        return "load the force sensor with a known weight: no shot tells its error from the plant's own"
    if "surface_tilt" in names and Kind.BETWEEN_SHOTS in kinds:
        return "level the table with a spirit level, and do the same again: what is left then is no tilt"
    if Kind.BETWEEN_SHOTS in kinds:
        return "repeat the campaign in another order of batches, directions and dwells"
    if Kind.ACTUATOR in kinds:
        return "record the actuator's position"
    return "no setting within reach tells them apart: measure one of them by itself"
