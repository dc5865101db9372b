"""A capture comes back from the journal with the same bits, whatever it holds."""

import math
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from impactcell.errors import JournalError
from impactcell.journal.capture_codec import decode_capture, encode_capture
from impactcell.journal.rice_codec import BLOCK, rice_decode, rice_encode
from impactcell.records import Capture, Channel, Summary, uniform_times
from tests.snapshots import make_capture

floats = st.floats(allow_nan=True, allow_infinity=True)


@st.composite
def channels(draw: st.DrawFn) -> Channel:
    count = draw(st.integers(0, 40))
    if draw(st.booleans()):
        time_s = uniform_times(
            draw(st.floats(-1, 1)), draw(st.sampled_from([148.0, 1e4, 1e6, 12345.678])), count
        )
    else:
        time_s = np.sort(draw(hnp.arrays(np.float64, count, elements=st.floats(-1e3, 1e3))))
    resolution = draw(st.sampled_from([None, 5e-7, 0.02, 1.0]))
    if resolution and draw(st.booleans()):
        values = draw(hnp.arrays(np.int64, count, elements=st.integers(-(2**40), 2**40))) * resolution
    else:
        values = draw(hnp.arrays(np.float64, count, elements=floats))
    return Channel(
        time_s, values, draw(st.none() | st.floats(0, 1)), draw(st.none() | st.just((-5.0, 5.0))), resolution
    )


@pytest.mark.slow
@given(
    st.none() | channels(),
    st.none() | channels(),
    st.none() | st.text(max_size=20),
    st.dictionaries(st.text(max_size=5), st.floats(allow_nan=False) | st.text(max_size=5), max_size=3),
    st.none() | st.just(Summary(1.5, float("inf"))),
)
def test_same_bits_come_back(
    force: Channel | None,
    position: Channel | None,
    batch_id: str | None,
    covariates: dict[str, float | str],
    summary: Summary | None,
) -> None:
    capture = Capture(
        7,
        0.05,
        float("nan"),
        force,
        position,
        batch_id=batch_id,
        covariates=covariates,
        session=2**40,
        summary=summary,
    )
    back = decode_capture(encode_capture(capture))
    for name in ("force", "position"):
        was, now = getattr(capture, name), getattr(back, name)
        assert (was is None) == (now is None)
        if was is not None:
            assert now.values.tobytes() == was.values.tobytes()
            assert now.time_s.tobytes() == was.time_s.tobytes()
            assert (now.noise_std, now.full_scale, now.resolution) == (
                was.noise_std,
                was.full_scale,
                was.resolution,
            )
    assert (back.batch_id, dict(back.covariates), back.session, back.summary) == (
        batch_id,
        covariates,
        2**40,
        summary,
    )
    assert np.isnan(back.mass_kg)


@pytest.mark.slow
@given(
    st.lists(st.integers(-(2**27), 2**27) | st.integers(-300, 300), max_size=3 * BLOCK),
    st.sampled_from([1e-9, 0.02, 0.025, 1.0]),
)
def test_codes_come_back_whatever_their_steps(codes: list[int], resolution: float) -> None:
    values = np.array(codes, dtype=np.float64) * resolution
    done, shifts, words = rice_encode(values, resolution)
    assert done
    assert rice_decode(shifts, words, len(values), resolution).tobytes() == values.tobytes()


@pytest.mark.parametrize("odd", [0.013, float("nan"), float("inf"), -0.0, 1e300, 0.02 * 2**40])
def test_what_is_no_near_multiple_is_not_packed(odd: float) -> None:
    done, _, _ = rice_encode(np.array([0.02, odd]), 0.02)
    assert not done


def test_words_that_end_too_soon_give_no_values() -> None:
    done, shifts, words = rice_encode(np.arange(300.0) % 7, 1.0)
    assert done
    short = rice_decode(shifts, words[:-3], 300, 1.0)
    assert np.isnan(short[-1])
    assert (short[:200] == np.arange(200) % 7).all()


def test_white_noise_takes_little_more_than_its_entropy() -> None:
    codes = np.rint(np.random.default_rng(0).normal(0, 20, 20_000)).astype(np.int64)
    coded = Capture(
        1, 0.05, 18.9, Channel(uniform_times(0.0, 1e6, 20_000), codes * 0.02, resolution=0.02), None
    )
    entropy_bits = 20_000 * np.log2(math.sqrt(2.0) * 20.0 * math.sqrt(2.0 * math.pi * math.e))
    assert entropy_bits < 8 * len(encode_capture(coded)) < 1.06 * entropy_bits


@given(st.binary(max_size=200), st.sampled_from(["", "prefixed", "checked"]))
def test_foreign_bytes_are_refused(noise: bytes, dress: str) -> None:
    check = struct.pack("<I", zlib.crc32(noise)) if dress == "checked" else b""
    with pytest.raises(JournalError):
        decode_capture((b"ICC3" if dress else b"") + check + noise)


@given(st.data())
def test_a_changed_byte_is_noticed(data: st.DataObject) -> None:
    blob = bytearray(encode_capture(make_capture()))
    blob[data.draw(st.integers(0, len(blob) - 1))] ^= data.draw(st.integers(1, 255))
    with pytest.raises(JournalError):
        decode_capture(bytes(blob))
