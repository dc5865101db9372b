"""Captures as bytes and back, to the same bits.

Layout, little-endian: magic `ICC3`, CRC-32 of all that follows (u32), header length (u32), header (JSON),
arrays one after the other, as long as the header says. A channel whose values are whole multiples of its
`resolution` is kept as integer codes in few bits (`rice_codec`), in less room than zlib needs
and less than half the time; one whose times follow `records.uniform_times` as start and rate. Both are
checked sample by sample when written, and what does not fit is kept as 64-bit floats, by zlib.
"""

import io
import json
import math
import struct
import zlib
from dataclasses import replace
from typing import Any

import numpy as np

from impactcell.errors import JournalDamagedError, JournalError
from impactcell.journal.rice_codec import is_uniform, rice_decode, rice_encode
from impactcell.records import Capture, Channel, Samples, Summary, uniform_times

MAGIC = b"ICC3"
_CHANNELS = ("force", "position", "actuator")


def encode_capture(capture: Capture) -> bytes:
    """Return the capture as compressed bytes; see the module's docstring for the layout."""
    arrays: list[bytes] = []
    header: dict[str, Any] = {
        "cycle": capture.cycle,
        "time_ns": capture.time_ns,
        "velocity_m_s": capture.velocity_m_s,
        "mass_kg": capture.mass_kg,
        "direction": capture.direction,
        "stroke_m": capture.stroke_m,
        "batch_id": capture.batch_id,
        "dwell_s": capture.dwell_s,
        "start_m": capture.start_m,
        "session": capture.session,
        "covariates": dict(capture.covariates),
    }
    if capture.summary is not None:
        summary = capture.summary
        header["summary"] = [summary.peak_force_n, summary.sliding_distance_m]
        stds = [summary.peak_force_std_n, summary.sliding_distance_std_m]
        if not all(math.isnan(std) for std in stds):  # else as in the captures of earlier versions
            header["summary"] += stds
    for name in _CHANNELS:
        channel: Channel | None = getattr(capture, name)
        if channel is not None:
            header[name] = _encode_channel(channel, arrays)
    text = json.dumps(header).encode()
    content = b"".join([struct.pack("<I", len(text)), text, *arrays])
    return MAGIC + struct.pack("<I", zlib.crc32(content)) + content


def decode_capture(blob: bytes | None) -> Capture:
    """Return the capture that `encode_capture` was given; `blob` is None where it could not be read.

    Raises
    ------
    JournalError
        If the bytes are not such a capture; JournalDamagedError if they were one.
    """
    if blob is None:
        raise JournalDamagedError("the stored capture lies in a part of the file that cannot be used")
    if blob[:4] != MAGIC:
        raise JournalError("not a capture of this journal format")
    if blob[4:8] != struct.pack("<I", zlib.crc32(blob[8:])):
        raise JournalDamagedError("the stored capture is damaged: its checksum is wrong")
    try:
        (length,) = struct.unpack_from("<I", blob, 8)
        header = json.loads(blob[12 : 12 + length])
        arrays = io.BytesIO(blob[12 + length :])
        channels = {name: _decode_channel(header.pop(name), arrays) for name in _CHANNELS if name in header}
        summary = header.pop("summary", None)
        capture = Capture(
            **header, force=channels.get("force"), position=channels.get("position"),
            actuator=channels.get("actuator"),
        )  # fmt: skip
        return capture if summary is None else replace(capture, summary=Summary(*summary))
    except (zlib.error, ValueError, KeyError, TypeError, AttributeError, struct.error) as error:
        raise JournalDamagedError(f"the stored capture is damaged: {error}") from error


def _encode_channel(channel: Channel, arrays: list[bytes]) -> dict[str, Any]:
    header: dict[str, Any] = {
        "count": len(channel.values),
        "noise_std": channel.noise_std,
        "full_scale": channel.full_scale,
        "resolution": channel.resolution,
    }

    def keep(name: str, array: bytes) -> None:
        header[name] = len(array)
        arrays.append(array)

    rate_hz = _uniform_rate(channel.time_s)
    if rate_hz is None:
        keep("times", _plain(channel.time_s))
    else:
        header["uniform"] = [float(channel.time_s[0]), rate_hz]
    encoded = False
    if channel.resolution:
        encoded, shifts, words = rice_encode(channel.values, channel.resolution)
    if encoded:
        keep("shifts", shifts.tobytes())
        keep("words", words.astype("<u4", copy=False).tobytes())
    else:
        keep("values", _plain(channel.values))
    return header


def _decode_channel(header: dict[str, Any], arrays: io.BytesIO) -> Channel:
    def take(name: str) -> bytes:
        return arrays.read(header[name])

    count, resolution, full_scale = header["count"], header["resolution"], header["full_scale"]
    if "uniform" in header:
        start_s, rate_hz = header["uniform"]
        time_s = uniform_times(start_s, rate_hz, count)
    else:
        time_s = _floats(take("times"))
    if "words" in header:
        shifts = np.frombuffer(take("shifts"), np.uint8)
        words = np.frombuffer(take("words"), "<u4").astype(np.uint32, copy=False)
        values = rice_decode(shifts, words, count, resolution)
    else:
        values = _floats(take("values"))
    return Channel(
        time_s=time_s,
        values=values,
        noise_std=header["noise_std"],
        full_scale=None if full_scale is None else (full_scale[0], full_scale[1]),
        resolution=resolution,
    )


def _plain(values: Samples) -> bytes:
    """64-bit floats by zlib: all lowest bytes first, then all the next, so that like ones lie together."""
    planes = values.astype("<f8", copy=False).view(np.uint8).reshape(-1, 8).T
    return zlib.compress(planes.tobytes(), level=1)


def _floats(plain: bytes) -> Samples:
    planes = np.frombuffer(zlib.decompress(plain), np.uint8).reshape(8, -1)
    return np.ascontiguousarray(planes.T).reshape(-1).view("<f8").astype(np.float64)


def _uniform_rate(time_s: Samples) -> float | None:
    if len(time_s) < 2 or not time_s[-1] > time_s[0]:
        return None
    rate_hz = (len(time_s) - 1) / (float(time_s[-1]) - float(time_s[0]))
    if not math.isfinite(rate_hz):
        return None
    for candidate in (rate_hz, float(round(rate_hz))):
        if candidate > 0 and is_uniform(time_s, candidate):
            return candidate
    return None
