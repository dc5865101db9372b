"""The names others build on."""

from impactcell import physics
from impactcell.physics import Effect, Motion, Parameter, Plant, TapInput


def test_what_the_package_offers() -> None:
    assert set(physics.__all__) == {
        "Effect",
        "Ensemble",
        "TapEvent",
        "TapEventKind",
        "TapOutputs",
        "Kind",
        "LawKind",
        "Motion",
        "Parameter",
        "ParameterKind",
        "Phase",
        "Plant",
        "ChannelSamples",
        "TapInput",
        "Traces",
        "simulate_driven",
        "simulate_free_slide",
        "simulate_tap",
    }


def test_what_the_records_hold() -> None:
    def fields(kind: type) -> tuple[str, ...]:
        return tuple(kind.__dataclass_fields__)  # type: ignore[attr-defined]

    assert fields(Plant) == (
        "stiffness_n_per_m",
        "damping_n_s_per_m",
        "mu_s",
        "mu_k",
        "gravity_m_s2",
        "effects",
    )
    assert fields(TapInput) == (
        "velocity_m_s",
        "mass_kg",
        "stroke_m",
        "direction",
        "halts_at_separation",
        "start_m",
        "dwell_s",
        "shot",
        "shots",
        "batch",
        "columns",
    )
    assert fields(Parameter) == ("name", "unit", "null", "lower", "upper", "typical", "per_batch", "kind")
    assert {"identifier", "kind", "equation", "reference", "phases", "parameters", "dissipates"} <= set(
        fields(Effect)
    )
    assert {"events", "peak_force_n", "displacement_m", "stop_s"} <= set(fields(Motion))
