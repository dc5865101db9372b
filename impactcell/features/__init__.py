"""What is extracted from a capture, once: peak force, separation, slide, rest, noise of each channel."""

from impactcell.features.channels import CheckedChannel, CheckedForce
from impactcell.features.extraction import Fault, Features, extract, required
from impactcell.features.held_drive import drive_noise_std, is_command, samples_held
from impactcell.features.measured import MeasuredFeature
from impactcell.features.noise import are_equal_steps, noise_std, white_noise_std
from impactcell.features.noise_at_rest import NoiseAtRest, noise_at_rest, with_noise_at_rest
from impactcell.features.segment import SlideSegment
from impactcell.features.slide import SlideFeatures
from impactcell.features.spikes import without_spikes

__all__ = [
    "CheckedChannel",
    "CheckedForce",
    "Fault",
    "Features",
    "MeasuredFeature",
    "NoiseAtRest",
    "SlideFeatures",
    "SlideSegment",
    "are_equal_steps",
    "drive_noise_std",
    "extract",
    "is_command",
    "noise_at_rest",
    "noise_std",
    "required",
    "samples_held",
    "white_noise_std",
    "with_noise_at_rest",
    "without_spikes",
]
