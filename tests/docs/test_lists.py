"""Lists that pages give by hand are whole."""

import re
from pathlib import Path

from impactcell.fieldbus.register_map.register_types import KINDS as REGISTER_TYPES
from impactcell.physics.effect import LawKind
from impactcell.positioning import TapPlanner
from impactcell.service.monitoring import _METRICS
from impactcell.web.studies.upload import KINDS as FILE_ENDINGS
from impactcell.web.studies.upload import MAX_BYTES, MAX_FILES

ROOT = Path(__file__).resolve().parents[2]


def text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def test_every_metric_is_told_with_its_kind() -> None:
    told = set(re.findall(r"^\| `(impactcell_\w+)` \| (\w+) \|", text("docs/how-to/page.md"), re.MULTILINE))
    names = {(f"impactcell_{name}{'_total' * (kind == 'counter')}", kind) for kind, name, *_ in _METRICS}
    assert told == names | {("impactcell_alarm_active", "gauge")}


def test_what_may_be_dropped_on_the_page_is_told() -> None:
    said = text("docs/how-to/page.md").partition("drop files: ")[2]
    assert set(re.findall(r"`(\.\w+)`", said.partition(" of a campaign")[0])) == FILE_ENDINGS
    assert f"At most {MAX_FILES} files and {MAX_BYTES // 10**6} MB" in said


def test_what_the_planner_offers_is_told() -> None:
    (members,) = re.findall(r"TapPlanner\n +:members: (.*)", text("docs/reference/api.md"))
    offered = {
        name for name, part in vars(TapPlanner).items() if callable(part) or isinstance(part, property)
    }
    assert set(members.split(", ")) == {name for name in offered if not name.startswith("_")}


def test_the_place_of_every_law_is_told() -> None:
    places = text("impactcell/physics/effects/README.md").partition("| place | laws |")[2]
    assert set(re.findall(r"`([A-Z_]+)`", places)) == {kind.name for kind in LawKind}


def test_types_that_the_shipped_map_has_not_are_told() -> None:
    (said,) = re.findall(
        r"^Beside the types of the shipped map: (.*)", text("docs/how-to/another-module.md"), re.MULTILINE
    )
    shipped = set(re.findall(r"type: (\w+)", text("config/maps/fpga-v1.yaml")))
    numbers = set(REGISTER_TYPES) - shipped - {"bit"}
    assert numbers <= set(re.findall(r"`(\w+)`", said))
