"""What the workflow works on: shots and blocks, checked, grouped and split, and the noise floor."""

from impactcell.discrepancy.data.campaign_checks import (
    check_campaign_units,
    refuse_rotation,
    without_unlike_shots,
)
from impactcell.discrepancy.data.cell_limits import CellLimits
from impactcell.discrepancy.data.coarse_raster import CoarseRaster, beside_rasters, coarse_rasters
from impactcell.discrepancy.data.excitation import (
    HELD_OUT_SHARE,
    MIN_HELD_OUT,
    MIN_TRAINING,
    ExcitationStrategy,
    Setting,
)
from impactcell.discrepancy.data.free_slide import FreeSlide
from impactcell.discrepancy.data.noise_floor import (
    NoiseFloor,
    ReplicateSpread,
    replicate_spread,
    sensor_noise,
)
from impactcell.discrepancy.data.phases import BETWEEN_SHOTS, PHASES, Trajectory
from impactcell.discrepancy.data.prepared_campaign import (
    PreparedCampaign,
    prepare,
    shot_set,
    split_held_out,
    with_open_onset,
)
from impactcell.discrepancy.data.prepared_shots import (
    CHANNELS,
    FORCE,
    POSITION,
    IndexArray,
    PreparedShot,
    ShotSet,
    concatenate_shots,
    decimate,
)
from impactcell.discrepancy.data.shots_unlike import notes_of_unlike

__all__ = [
    "BETWEEN_SHOTS",
    "CHANNELS",
    "FORCE",
    "HELD_OUT_SHARE",
    "MIN_HELD_OUT",
    "MIN_TRAINING",
    "PHASES",
    "POSITION",
    "CellLimits",
    "CoarseRaster",
    "ExcitationStrategy",
    "FreeSlide",
    "IndexArray",
    "NoiseFloor",
    "PreparedCampaign",
    "PreparedShot",
    "ReplicateSpread",
    "Setting",
    "ShotSet",
    "Trajectory",
    "beside_rasters",
    "check_campaign_units",
    "coarse_rasters",
    "concatenate_shots",
    "decimate",
    "notes_of_unlike",
    "prepare",
    "refuse_rotation",
    "replicate_spread",
    "sensor_noise",
    "shot_set",
    "split_held_out",
    "with_open_onset",
    "without_unlike_shots",
]
