"""Skew of the channels: force recorded late against position."""

from simulator.effects.law import Effect


class ChannelSkew(Effect):
    """The force channel is sampled later than its time stamp says."""

    identifier = "channel_skew"
    defaults = {"delay_s": 1.0e-4}

    def __init__(self, delay_s: float) -> None:
        self._delay = delay_s

    def delay(self) -> float:
        return self._delay
